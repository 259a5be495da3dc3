"""The verbs of a study's life: check, render, simulate, analyse, report, and demo, which does them all."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.apps.cli.console import (
    FOLDER,
    RESULTS,
    database_option,
    emit,
    json_option,
    library_option,
    progress,
    say,
    workers_options,
)
from study.apps.cli.shared import OUT, check_database, load, prepare_stimuli, render_stimuli, results_folder
from study.apps.cli.shown import shortcut_lines, table_of, trials_between
from study.counting import counted
from study.errors import MotionError, ProtocolError

if TYPE_CHECKING:
    from study.analysis.analyse import Analysis
    from study.experiment.protocol.whole import Protocol
    from study.motion.library import Library

SHARE = click.FloatRange(0.0, 1.0)


def simulate_participants(
    protocol: Protocol,
    folder: Path,
    participants: int,
    seed: int | None = None,
    database: str | None = None,
    **goes_wrong: Any,
) -> dict[str, Any]:
    """Simulated sessions on the stimuli of a results folder; the numbers for `--json`.

    `goes_wrong` are shares of the observers' settings, such as `missed`; by default the usual ones.
    """
    from study.experiment.simulation import simulate as simulate_all
    from study.experiment.stimuli.manifest import read_manifest
    from study.experiment.store.responses import open_responses
    from study.experiment.store.sessions import refuse_other_stimuli
    from study.tasks.observer import default_observer

    manifest = read_manifest(folder)
    with open_responses(database or folder) as responses, progress("answers") as report:
        refuse_other_stimuli(responses, [record.id for record in manifest.records])
        summary = simulate_all(
            protocol,
            manifest,
            responses,
            participants,
            protocol.seed if seed is None else seed,
            lambda done, total: report(done / max(total, 1), f"{done} of {total}"),
            settings=replace(default_observer(), **goes_wrong),
        )
    return {**asdict(summary), "folder": str(folder), "database": responses.place, "simulated": True}


def analyse_results(folder: Path, database: str | None = None) -> Analysis:
    """All analyses of a results folder, as its protocol decided."""
    from study.analysis.analyse import analyse_folder
    from study.experiment.folder import PROTOCOL
    from study.experiment.protocol.whole import load_protocol
    from study.experiment.store.frames import answers_frame
    from study.experiment.store.responses import open_answers

    protocol = load_protocol(folder / PROTOCOL)
    with open_answers(folder, database) as responses:
        answers, checks = answers_frame(responses), answers_frame(responses, roles=("check",))
    return analyse_folder(protocol, answers, checks)


def _missing(motions: Iterable[str], library: Library) -> Iterator[str]:
    """For each motion that a library does not have, what it says."""
    for motion in motions:
        try:
            library.entry(motion)
        except MotionError as refusal:
            yield f"motion {motion!r}: {refusal}"


@click.command()
@click.argument("protocol")
@library_option
@click.option("--texts", is_flag=True, help="Also print everything that participants read.")
@json_option
def check(protocol: str, library: str | None, texts: bool) -> None:
    """Check a protocol before running it: what will be shown, every error, and any text you have still to write.

    Exit status 2 if something can't be shown.
    """
    from study.experiment.protocol.proofreading import to_do
    from study.experiment.stimuli.outlook import look_ahead
    from study.experiment.wording import all_texts
    from study.motion.library import open_library

    opened = open_library(library or "synthetic")
    try:
        checked = load(protocol)
    except ProtocolError as refusal:
        # What is misspelled hides nothing: what else can't be shown is said in the same run.
        more = look_ahead(refusal.rest, opened).problems if refusal.rest else _missing(refusal.motions, opened)
        raise ProtocolError("\n".join([str(refusal), *more])) from None
    found, notes = look_ahead(checked, opened), to_do(checked)
    read = [asdict(one) for one in all_texts(checked, found.film_times)] if texts else []
    lines = [f"{one['where']}\n    {one['text']}\n" for one in read]
    lines += table_of(checked, found)
    lines += shortcut_lines(checked, found)
    lines += found.problems or [f"{checked.name}: all that it shows can be shown with the library {opened.name}."]
    lines.append(
        f"A participant sees {trials_between(found.fewest_trials, found.trials)} made of "
        f"{counted(found.films, 'film')} and takes about {counted(found.minutes, 'minute')}, "
        f"{found.minutes_at_most} where every answer and every film takes its longest; practice, breaks "
        "and reading are included."
    )
    lines += [f"Note: {note}" for note in found.notes]
    lines += [f"To do: {note}" for note in notes]
    result: dict[str, Any] = {"protocol": checked.name, "library": opened.name, "problems": found.problems}
    result |= {"notes": [*found.notes, *notes], "minutes": found.minutes, "minutes_at_most": found.minutes_at_most}
    result |= {"trials": found.trials, "fewest_trials": found.fewest_trials, "films": found.films, "fps": checked.fps}
    result |= {"audit": [asdict(one) for one in found.audits], "shortcuts": [asdict(one) for one in found.shortcuts]}
    result |= {"shown": [asdict(row) for row in found.rows]} | ({"texts": read} if texts else {})
    emit(result, "\n".join(lines))
    if found.problems:
        raise click.exceptions.Exit(2)


@click.command()
@click.argument("protocol")
@library_option
@OUT
@workers_options
@json_option
def render(protocol: str, library: str | None, out: Path | None, workers: int | str | None) -> None:
    """Render all stimuli of a protocol; existing ones are reused, so an interrupted run resumes."""
    from study.experiment.stimuli.rendering import rendered_already
    from study.motion.library import open_library

    checked = load(protocol)
    folder = results_folder(checked, out)
    done = rendered_already(checked, open_library(library or "synthetic"), folder)
    summary = (
        {**asdict(done), "folder": str(folder)}
        if done
        else render_stimuli(prepare_stimuli(checked, library), folder, workers)
    )
    text = (
        f"{summary['folder']}: {counted(summary['videos'], 'video')}, {counted(summary['frames'], 'frame')}, "
        f"{summary['seconds']:.0f} s of motion; {summary['rendered']} rendered now, {summary['reused']} reused"
    )
    emit(summary, text)


@click.command()
@click.argument("protocol")
@click.option(
    "--participants", type=click.IntRange(min=1), help="Number of participants in all (default: the protocol's)."
)
@click.option("--seed", type=click.IntRange(min=0), help="Seed of the observers (default: the protocol's).")
@click.option(
    "--missed",
    type=SHARE,
    default=0.005,
    show_default=True,
    help="Share of trials without a response, from 0 to 1, besides late responses.",
)
@click.option(
    "--badly-shown", type=SHARE, default=0.0, show_default=True, help="Share of presentations that stall, from 0 to 1."
)
@click.option(
    "--careless",
    type=SHARE,
    default=0.0,
    show_default=True,
    help="Share of participants who do not watch, from 0 to 1.",
)
@library_option
@OUT
@database_option
@json_option
def simulate(
    protocol: str,
    participants: int | None,
    seed: int | None,
    library: str | None,
    out: Path | None,
    database: str | None,
    **goes_wrong: float,
) -> None:
    """Sessions of simulated observers, always marked as simulated. Needs no videos, only the record of the stimuli."""
    from study.experiment.folder import MANIFEST, PROTOCOL
    from study.experiment.stimuli.manifest import record
    from study.files import read_text

    checked = load(protocol)
    folder, participants = results_folder(checked, out), participants or checked.participants
    if participants is None:
        raise click.UsageError("expected --participants, or participants in the protocol, found neither; give one.")
    known = (folder / MANIFEST).exists() and read_text(folder / PROTOCOL, "a protocol file") == checked.text
    if library is not None or not known:
        stimuli = prepare_stimuli(checked, library)
        check_database(database, stimuli)
        record(stimuli, folder)
    summary = simulate_participants(checked, folder, participants, seed, database, **goes_wrong)
    text = (
        f"{summary['folder']}: {counted(summary['participants'], 'simulated participant')}, "
        f"{counted(summary['answers'], 'answer')} made now, {summary['found']} found"
    )
    emit(summary, text)


@click.command()
@click.argument("results", type=RESULTS)
@database_option
@json_option
def analyse(results: Path, database: str | None) -> None:
    """Thresholds, preferences and ratings of a results folder."""
    from study.analysis.analyse import analysis_json

    analysis = analyse_results(results, database)
    emit(analysis_json(analysis), "\n".join(analysis.sentences()))


@click.command()
@click.argument("results", type=RESULTS)
@click.option("--out", type=FOLDER, help="Folder for the page, tables and figures (default: the results folder).")
@database_option
@json_option
def report(results: Path, out: Path | None, database: str | None) -> None:
    """Write the report: one self-contained HTML page, and its tables as CSV and JSON."""
    from study.report.document import write_report

    page = write_report(results, out=out, database=database)
    emit({"report": str(page)}, str(page))


@click.command()
@OUT
@workers_options
@click.option(
    "--participants",
    type=click.IntRange(min=1),
    default=12,
    show_default=True,
    help="Number of simulated participants.",
)
@json_option
def demo(out: Path | None, workers: int | str | None, participants: int) -> None:
    """A small study from end to end, without screen or network: stimuli, simulated observers, analysis, report."""
    from study.analysis.analyse import analysis_json
    from study.report.document import write_report

    protocol = load("demo")
    folder = results_folder(protocol, out)
    say("A small study on synthetic motions, answered by simulated observers; real ones take their place later.")
    rendered = render_stimuli(prepare_stimuli(protocol, None), folder, workers)
    simulated = simulate_participants(protocol, folder, participants)
    analysis = analyse_results(folder)
    page = write_report(folder, analysis=analysis)
    lines = [
        f"{counted(rendered['videos'], 'stimulus video')} ({counted(rendered['frames'], 'frame')}) in "
        f"{folder / 'stimuli'}",
        f"{counted(simulated['answers'] + simulated['found'], 'answer')} of "
        f"{counted(participants, 'simulated participant')} in {folder / 'responses.sqlite'}",
        *analysis.sentences(),
        f"The report: {page.resolve()}",
    ]
    emit(
        {"render": rendered, "simulate": simulated, "analysis": analysis_json(analysis), "report": str(page)},
        "\n".join(lines),
    )
