"""The report: a results folder in; one self-contained page, and every table as CSV and JSON, out.

The page needs no network: styles, figures, strips and videos stand in it. It is the same, byte for byte, for the same
folder and version of Segue. What participants or protocols wrote is escaped by the template.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from study.errors import AnalysisError
from study.report import tables, words
from study.report.media import Preview
from study.report.sections import Drawing, Section

if TYPE_CHECKING:
    import pandas as pd

    from study.experiment.protocol import Protocol
    from study.experiment.responses import Responses
    from study.experiment.stimuli import Manifest

Result = Mapping[str, Any]
TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True, eq=False)
class Material:
    """What a report is made of."""

    protocol: Protocol
    manifest: Manifest
    answers: pd.DataFrame
    sessions: pd.DataFrame
    checks: pd.DataFrame
    presentations: pd.DataFrame


@dataclass(frozen=True, eq=False)
class Page:
    """What the template shows."""

    title: str
    source: str
    facts: tuple[str, ...]
    warnings: tuple[str, ...]
    sections: tuple[Section, ...]
    response: Drawing | None
    learning: Drawing | None
    course: tables.Table
    presentation: tables.Table | None
    exclusions: tables.Table | None
    exclusion_sentence: str
    quality: Result
    quality_sentence: str
    strips: tuple[Preview, ...]
    videos: tuple[tuple[Preview, ...], ...]
    stimuli: tables.Table
    motions: tables.Table
    participants: tables.Table
    shown_sentence: str
    methods: tuple[str, ...]
    versions: tuple[tuple[str, str], ...]
    acknowledgement: str
    mark: str


def write_report(results_folder: str | Path, *, resamples: int = 1000) -> Path:
    """Write `report.html` and `tables/` into a results folder.

    Parameters
    ----------
    results_folder
        With `protocol.toml`, `manifest.json` and `responses.sqlite`.
    resamples
        Bootstrap samples behind standard errors.

    Returns
    -------
    Path
        The page.

    Raises
    ------
    AnalysisError
        When there are no answers yet.
    SegueError
        When a part of the folder is missing or can't be read.
    """
    from study.analysis.exclusions import rules_of
    from study.analysis.summary import analyse

    folder = Path(results_folder)
    material = gather(folder)
    settings = material.protocol.analysis
    analysis = analyse(
        material.answers,
        threshold=settings.threshold,
        alpha=settings.alpha,
        resamples=resamples,
        rules=rules_of(settings.exclusions.model_dump()),
        checks=material.checks,
    )
    page = compose(material, analysis)
    write_tables(folder / "tables", all_tables(page), analysis)
    path = folder / "report.html"
    _write_whole(path, to_html(page))
    return path


def gather(folder: Path) -> Material:
    """Read a results folder.

    Raises
    ------
    AnalysisError
        When there are no answers yet.
    SegueError
        When a part of the folder is missing or can't be read.
    """
    from study.experiment.protocol import load_protocol
    from study.experiment.responses import answers_frame, open_responses, session_table
    from study.experiment.stimuli import read_manifest

    protocol = load_protocol(folder / "protocol.toml")
    manifest = read_manifest(folder)
    database = folder / "responses.sqlite"
    if not database.is_file():
        raise AnalysisError(
            f"{database}: expected answers, found no database; collect or simulate sessions for this folder first"
        )
    with open_responses(database) as responses:
        answers, sessions = answers_frame(responses), session_table(responses)
        checks, presentations = answers_frame(responses, roles=("check",)), _presentations(responses)
    if answers.empty:
        raise AnalysisError(f"{database}: expected answers, found none; collect or simulate sessions first")
    return Material(protocol, manifest, answers, sessions, checks, presentations)


def _presentations(responses: Responses) -> pd.DataFrame:
    """How every stimulus was shown."""
    import pandas as pd
    import sqlalchemy as sa

    from study.experiment.response_tables import presentations

    with responses.engine.connect() as connection:
        rows = connection.execute(sa.select(presentations)).mappings().all()
    return pd.DataFrame([dict(row) for row in rows], columns=[column.name for column in presentations.c])


def compose(material: Material, analysis: Result) -> Page:
    """Turn material and analysis into what the page shows."""
    from study.report import course, figures, media, shown

    protocol, manifest, answers = material.protocol, material.manifest, material.answers
    data, quality = str(analysis["data"]), analysis["quality"]
    mark = words.mark_of(data, manifest.synthetic)
    svg = figures.response_figure(answers, "response-times", mark)
    response = None
    if svg:
        caption = "Response times: all answers with the median, and the median over the session."
        response = Drawing(svg, caption)
    learned = course.learning_table(answers)
    line = course.learning_figure(learned, "learning", mark)
    learning = Drawing(line, learned.caption) if line else None
    return Page(
        title=protocol.title,
        source=words.sentence(protocol.source),
        facts=_facts(material, analysis),
        warnings=tuple(
            words.warnings_of(data, manifest.synthetic, quality["simulated_participants"], quality["participants"])
        ),
        sections=tuple(_sections(material, analysis, mark)),
        response=response,
        learning=learning,
        course=learned,
        presentation=course.presentation_table(material.presentations) if len(material.presentations) else None,
        exclusions=course.exclusion_table(analysis),
        exclusion_sentence=course.exclusion_sentence(analysis),
        quality=quality,
        quality_sentence=_quality_sentence(quality),
        strips=tuple(media.embed_strips(manifest)),
        videos=tuple(tuple(pair) for pair in media.embed_videos(manifest)),
        stimuli=shown.stimulus_table(manifest),
        motions=shown.motion_table(manifest),
        participants=shown.participant_table(analysis, material.sessions),
        shown_sentence=_shown_sentence(manifest),
        methods=tuple(words.methods_paragraph(protocol, manifest, analysis, _who(analysis))),
        versions=_versions(material),
        acknowledgement=manifest.acknowledgement,
        mark=mark,
    )


def _sections(material: Material, analysis: Result, mark: str) -> list[Section]:
    """One section a study, in the protocol's order."""
    from study.report import sections, shown

    known = shown.known_truth(material.sessions)
    found = []
    for study in material.protocol.studies:
        title = study.title or words.sentence(words.readable(study.name))
        names = [transition.name for transition in material.protocol.transitions_of(study)]
        if study.name in analysis["jnd"]:
            result = _in_order(analysis["jnd"][study.name], names)
            truth, data, fps = known.get(study.name), str(analysis["data"]), material.protocol.fps
            found.append(sections.jnd_section(study.name, title, result, fps=fps, data=data, mark=mark, known=truth))
        elif study.name in analysis["preference"]:
            comparisons = [_in_order(comparison, names) for comparison in analysis["preference"][study.name]]
            strong = analysis["bradley_terry"].get(study.name)
            found.append(sections.preference_section(study.name, title, comparisons, mark=mark, strengths=strong))
        elif study.name in analysis["ratings"]:
            rows, points = analysis["ratings"][study.name], study.scale_points
            variance = analysis.get("rating_anova", {}).get(study.name, ())
            alpha = float(analysis["alpha"])
            found.append(
                sections.ratings_section(study.name, title, rows, variance, mark=mark, points=points, alpha=alpha)
            )
    return found


def _in_order(result: Result, names: Sequence[str]) -> Result:
    """The result with its motions in the protocol's order rather than that of the first participant's plan."""
    places = {name: place for place, name in enumerate(names)}
    return {**result, "motions": sorted(result["motions"], key=lambda row: places.get(row["motion"], len(places)))}


def _who(analysis: Result) -> str:
    quality = analysis["quality"]
    people, simulated = quality["participants"] - quality["simulated_participants"], quality["simulated_participants"]
    parts = []
    if people:
        parts.append(words.number(people, "participant"))
    if simulated:
        parts.append(words.number(simulated, "simulated observer"))
    return words.joined(parts)


def _facts(material: Material, analysis: Result) -> tuple[str, ...]:
    quality, manifest = analysis["quality"], material.manifest
    motions = (
        "synthetic motions"
        if manifest.synthetic
        else f"captured motions of the library {words.library(manifest.library)}"
    )
    return (
        _who(analysis),
        f"{quality['answered']:,} answers, {quality['missed']:,} missed",
        f"{words.number(len(manifest.records), 'stimulus', 'stimuli')} at {manifest.fps:g} frames per second",
        motions,
    )


def _quality_sentence(quality: Result) -> str:
    times = quality["response_s"]
    text = (
        f"{quality['missed']:,} of {quality['trials']:,} questions were missed ({quality['missed_percent']:.1f}%), "
        f"{quality['too_fast']:,} answered sooner than {quality['fastest_s']:g} s."
    )
    if times:
        text += (
            f" Half of the answers came within {times['50']:.2f} s, nine in ten between {times['5']:.2f} and "
            f"{times['95']:.2f} s."
        )
    if quality["shown_badly"]:
        badly = words.number(quality["shown_badly"], "answer")
        text += f" {badly} followed a stimulus that stalled or was hidden, and count all the same."
    return text + f" {words.number(quality['flagged'], 'participant')} flagged."


def _shown_sentence(manifest: Manifest) -> str:
    extended = sum(
        any(use.added_before or use.added_after for use in (record.source, record.destination))
        for record in manifest.records
    )
    motions = "a synthetic library" if manifest.synthetic else f"the library {words.library(manifest.library)}"
    text = (
        f"{words.number(len(manifest.records), 'stimulus', 'stimuli')} from {motions}, {manifest.size[0]} × "
        f"{manifest.size[1]} pixels at {manifest.fps:g} frames per second."
    )
    if not manifest.videos:
        text += " There is no video of them in this folder: nobody can have seen them."
    if extended:
        text += (
            f" In {'all' if extended == len(manifest.records) else extended} of them a motion was too short for what "
            "is shown before or after the blend and was extended; the table says by how much."
        )
    return text


def _versions(material: Material) -> tuple[tuple[str, str], ...]:
    """Versions and hashes: of this program, of what made the stimuli, and of what was analysed."""
    import numpy as np
    import scipy

    import study

    table = hashlib.sha256(material.answers.to_csv(index=False).encode()).hexdigest()
    rows = [
        ("report by Segue", study.__version__),
        ("Python, NumPy, SciPy", f"{platform.python_version()}, {np.__version__}, {scipy.__version__}"),
        ("protocol", f"{material.protocol.name}, sha256 {material.protocol.sha256}"),
        ("answers analysed", f"sha256 {table}"),
    ]
    rows += [(f"stimuli: {name}", str(version)) for name, version in sorted(material.manifest.versions.items())]
    for column, label in (("segue_version", "sessions by Segue"), ("python_version", "sessions on Python")):
        if column in material.sessions:
            rows.append((label, ", ".join(sorted({str(value) for value in material.sessions[column].dropna()}))))
    return tuple(rows)


def all_tables(page: Page) -> list[tables.Table]:
    """Every table of the page."""
    found = [table for section in page.sections for table in (*section.tables, *section.folded)]
    optional = [table for table in (page.presentation, page.exclusions) if table is not None]
    return [*found, page.stimuli, page.motions, page.participants, page.course, *optional]


def write_tables(folder: Path, chosen: Sequence[tables.Table], analysis: Result) -> None:
    """Write every table as CSV and JSON, and the whole analysis as JSON."""
    folder.mkdir(parents=True, exist_ok=True)
    for table in chosen:
        _write_whole(folder / f"{table.name}.csv", tables.as_csv(table))
        _write_whole(folder / f"{table.name}.json", tables.as_json(table))
    _write_whole(folder / "analysis.json", json.dumps(analysis, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def to_html(page: Page) -> str:
    """Return the page as one HTML text; everything but our own SVG and CSS is escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    markup: Callable[[str], Markup] = Markup
    styles = (TEMPLATES / "report.css").read_text(encoding="utf-8")
    return environment.get_template("report.html.jinja").render(page=page, styles=markup(styles), markup=markup)


def _write_whole(path: Path, text: str) -> None:
    """Write a file under another name and rename it, so that it is there whole or not at all."""
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        unfinished.write_text(text, encoding="utf-8")
        unfinished.replace(path)
    except OSError as error:
        raise AnalysisError(f"{path}: can't be written: {error.strerror}; free the place or name another") from error
    finally:
        unfinished.unlink(missing_ok=True)
