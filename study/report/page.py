"""What the page shows: material and its analysis in; sections, tables and sentences out, ready for the template."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from study.counting import counted
from study.report import conduct, course, figures, methods, words
from study.report import power as planning
from study.report import stimuli as shown
from study.report.material import Material
from study.report.media import Pictures
from study.report.sections.pair_ratings import section as pair_ratings_section
from study.report.sections.preference import section as preference_section
from study.report.sections.ratings import section as ratings_section
from study.report.sections.same_different import section as same_different_section
from study.report.sections.section import Drawing, Headline, Section, readings_table
from study.report.tables import Table

Result = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Part:
    """Sentences, figures and tables under one heading."""

    sentences: tuple[str, ...] = ()
    drawings: tuple[Drawing, ...] = ()
    tables: tuple[Table, ...] = ()
    folded: tuple[Table, ...] = ()


@dataclass(frozen=True, eq=False)
class Page:
    """What the template shows.

    Attributes
    ----------
    title, source, facts, warnings
        At the head of the page.
    comparison
        Results as published and corrected, side by side, and the confirmatory tests.
    sections
        One a study, in the protocol's order.
    power, conduct, stimuli
        Participants needed; how the sessions went; what was shown.
    pictures
        Strips and videos.
    methods, references, versions, acknowledgement
        At the foot.
    """

    title: str
    source: str
    facts: tuple[str, ...]
    warnings: tuple[str, ...]
    comparison: Part
    sections: tuple[Section, ...]
    power: Part
    conduct: Part
    stimuli: Part
    pictures: Pictures
    methods: tuple[tuple[str, str], ...]
    references: tuple[str, ...]
    versions: tuple[tuple[str, str], ...]
    acknowledgement: str

    @property
    def _parts(self) -> tuple[Part | Section, ...]:
        return (self.comparison, *self.sections, self.power, self.conduct, self.stimuli)

    @property
    def tables(self) -> tuple[Table, ...]:
        """Every table of the page."""
        return tuple(table for part in self._parts for table in (*part.tables, *part.folded))

    @property
    def drawings(self) -> tuple[Drawing, ...]:
        """Every figure of the page."""
        return tuple(drawing for part in self._parts for drawing in part.drawings)


def compose(material: Material, analysis: Result) -> Page:
    """Turn material and analysis into what the page shows; pictures come later."""
    protocol, manifest = material.protocol, material.manifest
    data, quality = str(analysis["data"]), analysis["quality"]
    mark = words.mark_of(data, manifest.synthetic)
    found = tuple(_sections(material, analysis, mark))
    return Page(
        title=protocol.title,
        source=words.sentence(protocol.source),
        facts=_facts(material, analysis),
        warnings=tuple(
            words.warnings_of(data, manifest.synthetic, quality["simulated_participants"], quality["participants"])
        ),
        comparison=_comparison(found, analysis),
        sections=found,
        power=_power(material, quality["participants"]),
        conduct=_conduct(material, analysis, mark),
        stimuli=Part(
            sentences=(_shown_sentence(material),),
            folded=(shown.stimulus_table(manifest), shown.motion_table(manifest)),
        ),
        pictures=Pictures((), ()),
        methods=tuple(methods.methods_paragraphs(protocol, manifest, analysis, material.presentations, who(analysis))),
        references=tuple(methods.references(protocol, analysis)),
        versions=_versions(material),
        acknowledgement=manifest.acknowledgement,
    )


def who(analysis: Result) -> str:
    """Return who answered: "12 participants", "35 simulated observers", or both."""
    quality = analysis["quality"]
    people, simulated = quality["participants"] - quality["simulated_participants"], quality["simulated_participants"]
    parts = [counted(people, "participant")] if people else []
    return words.joined([*parts, *([counted(simulated, "simulated observer")] if simulated else [])])


def _sections(material: Material, analysis: Result, mark: str) -> list[Section]:
    """One section a study, in the protocol's order; studies without answers say so."""
    protocol, known = material.protocol, shown.known_truth(material.sessions)
    found = []
    for study in protocol.studies:
        name, title = study.name, study.title or words.sentence(words.readable(study.name))
        names = [transition.name for transition in protocol.transitions_of(study)]
        if name in analysis["jnd"]:
            result = _in_order(analysis["jnd"][name], names)
            made = same_different_section.same_different_section(
                name, title, result, fps=protocol.fps, data=str(analysis["data"]), mark=mark, known=known.get(name)
            )
        elif analysis["preference"].get(name):
            comparisons = [_in_order(comparison, names) for comparison in analysis["preference"][name]]
            made = preference_section.preference_section(
                name, title, comparisons, mark=mark, strengths=analysis["bradley_terry"].get(name)
            )
        elif analysis["pair_ratings"].get(name):
            questions = [_in_order(question, names) for question in analysis["pair_ratings"][name]]
            ends = {item.name: (item.low, item.high) for item in study.items}
            made = pair_ratings_section.pair_ratings_section(
                name, title, questions, ends, mark=mark, alpha=float(analysis["alpha"])
            )
        elif analysis["ratings"].get(name):
            compared, cells = analysis["rating_anova"].get(name, ()), analysis["rating_cells"].get(name, ())
            made = ratings_section.ratings_section(
                name,
                title,
                analysis["ratings"][name],
                compared,
                cells,
                mark=mark,
                points=study.scale_points,
                alpha=float(analysis["alpha"]),
            )
        else:
            made = _without_answers(material, name, title)
        found.append(made)
    return found


def _without_answers(material: Material, name: str, title: str) -> Section:
    asked = material.answers[material.answers["study"] == name]
    missed = int(asked["answer"].isna().sum())
    if asked.empty:
        why = "nobody has come to it yet"
    elif missed == len(asked):
        why = f"all {counted(missed, 'question')} were missed"
    elif not missed:
        why = f"all {counted(len(asked), 'answer')} are left out by the rules of exclusion"
    else:
        rest = counted(len(asked) - missed, "answer")
        why = f"{missed:,} of {counted(len(asked), 'question')} were missed and {rest} left out by rules"
    return Section(f"study-{name}", title, (Headline(f"{title}: there is no result, for {why}.", ""),))


def _in_order(result: Result, names: Sequence[str]) -> Result:
    """The result with its motions in the protocol's order rather than that of the first participant's plan."""
    places = {name: place for place, name in enumerate(names)}
    return {**result, "motions": sorted(result["motions"], key=lambda row: places.get(row["motion"], len(places)))}


def _comparison(sections: Sequence[Section], analysis: Result) -> Part:
    made = (readings_table(sections), preference_section.confirmatory_table(analysis["confirmatory"]))
    return Part(tables=tuple(table for table in made if table is not None))


def _power(material: Material, asked: int) -> Part:
    if not material.power:
        return Part()
    drawings = [
        planning.power_drawing(found, f"power_{place + 1}", asked) for place, found in enumerate(material.power)
    ]
    sentences = tuple(planning.power_sentence(found) for found in material.power)
    return Part(sentences, tuple(drawings), (planning.power_table(material.power),))


def _conduct(material: Material, analysis: Result, mark: str) -> Part:
    answers, presented = material.answers, material.presentations
    learned = course.learning_table(answers)
    drawings = [
        ("response_times", figures.response_figure(answers, "response-times", mark),
         "Response times: all answers with the median, and the median and middle half over the session."),
        ("learning", course.learning_figure(learned, "learning", mark), learned.caption),
        ("presentation", conduct.presentation_figure(presented, "presentation", mark),
         "The longest time between two frames of every presentation; 1 is perfect, faulty ones are orange."),
    ]  # fmt: skip
    sentences = (_quality_sentence(analysis["quality"]), _sessions_sentence(material),
                 conduct.checks_sentence(material.checks), conduct.exclusion_sentence(analysis))  # fmt: skip
    return Part(
        sentences=tuple(sentence for sentence in sentences if sentence),
        drawings=tuple(Drawing(name, svg, caption) for name, svg, caption in drawings if svg),
        tables=(
            *([conduct.presentation_table(presented)] if len(presented) else []),
            *conduct.exclusion_tables(analysis),
        ),
        folded=(shown.participant_table(analysis, material.sessions), learned),
    )


def _facts(material: Material, analysis: Result) -> tuple[str, ...]:
    quality, manifest = analysis["quality"], material.manifest
    motions = (
        "synthetic motions"
        if manifest.synthetic
        else f"captured motions of the library {words.library(manifest.library)}"
    )
    return (
        who(analysis),
        f"{counted(quality['answered'], 'answer')}, {quality['missed']:,} missed",
        f"{counted(len(manifest.records), 'stimulus', 'stimuli')} at {manifest.fps:g} frames per second",
        motions,
    )


def _quality_sentence(quality: Result) -> str:
    times = quality["response_s"]
    text = (
        f"{quality['missed']:,} of {counted(quality['trials'], 'question')} were missed "
        f"({quality['missed_percent']:.1f}%), {quality['too_fast']:,} answered sooner than {quality['fastest_s']:g} s."
    )
    if times:
        text += (
            f" Half of the answers came within {times['50']:.2f} s, nine in ten between {times['5']:.2f} and "
            f"{times['95']:.2f} s."
        )
    if quality["shown_badly"]:
        text += f" {counted(quality['shown_badly'], 'answer')} followed a stimulus that stalled or was hidden."
    flagged = counted(quality["flagged"], "participant")
    return text + (
        f" {flagged} {'is' if quality['flagged'] == 1 else 'are'} flagged, which alone leaves nobody out, for one of "
        f"these: {'; '.join(quality['rules'])}."
    )


def _sessions_sentence(material: Material) -> str:
    """Sessions without answers, and participants who withdrew."""
    parts = []
    empty = len(material.sessions) - material.answers["participant"].nunique()
    if empty > 0:
        parts.append(f"{counted(empty, 'session')} begun without an answer that counts")
    if material.withdrawn:
        parts.append(f"{counted(material.withdrawn, 'participant')} withdrew, and their answers are deleted")
    return f"Beside these: {words.joined(parts)}." if parts else ""


def _shown_sentence(material: Material) -> str:
    manifest = material.manifest
    extended = sum(
        any(use.added_before or use.added_after for use in (record.source, record.destination))
        for record in manifest.records
    )
    motions = "a synthetic library" if manifest.synthetic else f"the library {words.library(manifest.library)}"
    text = (
        f"{counted(len(manifest.records), 'stimulus', 'stimuli')} from {motions}, {manifest.size[0]} × "
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
