"""`segue export`: answers for other programs (CSV), and for archives (Psych-DS, BIDS)."""

from __future__ import annotations

from pathlib import Path

import click

from study.apps.cli.console import RESULTS, database_option, emit, json_option
from study.counting import counted


@click.command()
@click.argument("results", type=RESULTS)
@click.option(
    "--to",
    "kind",
    type=click.Choice(["csv", "psych-ds", "bids"]),
    default="csv",
    show_default=True,
    help="csv, one table; psych-ds or bids, a folder in that format. Each describes every column.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="File (csv) or folder (default: RESULTS/answers.csv, RESULTS/psych-ds or RESULTS/bids).",
)
@database_option
@json_option
def export(results: Path, kind: str, out: Path | None, database: str | None) -> None:
    """Export all responses for other programs and for archives."""
    from study.experiment.folder import PROTOCOL
    from study.experiment.protocol.whole import load_protocol
    from study.experiment.store.export import export as export_folder
    from study.experiment.store.frames import dictionary_beside, export_csv
    from study.experiment.store.responses import open_answers

    with open_answers(results, database) as responses:
        if kind == "csv":
            place = export_csv(responses, out or results / "answers.csv")
            emit({"file": str(place), "dictionary": str(dictionary_beside(place))}, str(place))
            return
        place = export_folder(load_protocol(results / PROTOCOL), responses, kind, out or results / kind)
    files = sum(1 for path in place.rglob("*") if path.is_file())
    emit({"folder": str(place), "files": files}, f"{place}: {counted(files, 'file')}")
