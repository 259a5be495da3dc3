"""`segue export-stimuli` and `segue import-answers`: sessions in jsPsych, PsychoPy and other programs."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from study.apps.cli.console import (
    FOLDER,
    READABLE,
    RESULTS,
    database_option,
    emit,
    json_option,
    library_option,
    workers_options,
)
from study.apps.cli.shared import load_for_people, prepare_stimuli, render_stimuli
from study.counting import counted


@click.command("export-stimuli")
@click.argument("protocol")
@click.option(
    "--to",
    "tool",
    type=click.Choice(["csv", "jspsych", "psychopy"]),
    default="csv",
    show_default=True,
    help="csv, one table of trials for any program; jspsych, a timeline; psychopy, a table of conditions each.",
)
@click.option("--participants", type=click.IntRange(1, 9999), help="Number of participants (default: the protocol's).")
@library_option
@click.option("--out", type=FOLDER, required=True, help="Folder for films and trials; a results folder, too.")
@workers_options
@json_option
def export_stimuli(
    protocol: str, tool: str, participants: int | None, library: str | None, out: Path, workers: int | str | None
) -> None:
    """Films and trials for another program, which shows them in place of Segue.

    `segue import-answers` brings the answers back.
    """
    from study.experiment.elsewhere.sending import send
    from study.experiment.stimuli.manifest import read_manifest

    loaded = load_for_people(protocol)
    participants = participants or loaded.participants
    if participants is None:
        raise click.UsageError("expected --participants, or participants in the protocol, found neither; give one.")
    rendered = render_stimuli(prepare_stimuli(loaded, library), out, workers)
    names = send(out, loaded, read_manifest(out), tool, participants)
    result = {"folder": str(out), "to": tool, "participants": names, "videos": rendered["videos"]}
    told = f"{counted(rendered['videos'], 'film')} and the trials of {counted(len(names), 'participant')}"
    emit(result, f"{out}: {told}; README.md says how to play them")


@click.command("import-answers")
@click.argument("results", type=RESULTS)
@click.argument("files", type=READABLE, nargs=-1, required=True, metavar="FILE...")
@click.option("--answer", help="Column of the answers (default: answer, NAME.keys, NAME.response or response).")
@click.option("--time", "seconds", help="Column of response times, seconds (default: response_s, NAME.rt or rt).")
@database_option
@json_option
def import_answers(
    results: Path, files: tuple[Path, ...], answer: str | None, seconds: str | None, database: str | None
) -> None:
    """Bring answers from another program back into the folder that `segue export-stimuli` wrote.

    Each FILE is a table (CSV) or JSON, as the program saved it.
    """
    from study.apps.cli.fit import read_table
    from study.errors import AnalysisError, SessionError
    from study.experiment.elsewhere.bringing import Brought, bring
    from study.experiment.elsewhere.sending import KEY
    from study.experiment.folder import PROTOCOL
    from study.experiment.protocol.whole import load_protocol
    from study.experiment.stimuli.manifest import read_manifest
    from study.experiment.store.responses import open_responses

    protocol, manifest = load_protocol(results / PROTOCOL), read_manifest(results)
    rows: dict[str, Brought] = {}
    with open_responses(database or results) as responses:
        for file in files:
            try:
                table = read_table(file, KEY)
                cells = zip(table.index, table.to_dict("records"), strict=True)
                numbered = [(int(at) + 2, {str(name): cell for name, cell in row.items()}) for at, row in cells]
                rows[str(file)] = bring(protocol, manifest, responses, numbered, file.name, (answer, seconds))
            except (AnalysisError, SessionError) as refusal:
                raise SessionError(f"{file}: {refusal}") from refusal
    lines = [
        f"{file}: {counted(one.answers, 'answer')} of {counted(one.participants, 'participant')}; all answered: "
        f"{one.finished}" + (f"; {counted(one.late, 'answer')} came too late and count as missed" if one.late else "")
        for file, one in rows.items()
    ]
    emit({"folder": str(results), "files": {file: asdict(one) for file, one in rows.items()}}, "\n".join(lines))
