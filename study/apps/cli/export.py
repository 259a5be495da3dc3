"""`segue export`: answers for other programs (CSV, Parquet) and archives (Psych-DS, BIDS), or a study to publish."""

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
    type=click.Choice(["csv", "parquet", "psych-ds", "bids", "release"]),
    default="csv",
    show_default=True,
    help="csv or parquet, one table; psych-ds or bids, a folder in that format, without identities; release, a folder "
    "to publish, with stimuli, responses and report. Each describes every column.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="File (csv, parquet) or folder (default: RESULTS/answers.csv, RESULTS/psych-ds, ...).",
)
@click.option(
    "--author",
    "authors",
    metavar="NAME",
    multiple=True,
    help="Who is to be cited, as 'Family, Given' or the name of a group; may be repeated. A release needs it.",
)
@click.option(
    "--licence",
    metavar="SPDX",
    default="",
    help="What others may do with the data, by its name at spdx.org/licenses, as CC-BY-4.0 (default: not stated). "
    "A release needs it.",
)
@database_option
@json_option
def export(
    results: Path, kind: str, out: Path | None, authors: tuple[str, ...], licence: str, database: str | None
) -> None:
    """Export all responses for other programs and for archives."""
    from study.experiment.folder import PROTOCOL
    from study.experiment.form import asked
    from study.experiment.protocol.whole import load_protocol
    from study.experiment.stimuli.manifest import read_manifest
    from study.experiment.store.export import credited
    from study.experiment.store.export import export as export_folder
    from study.experiment.store.frames import dictionary_beside, export_csv, export_parquet
    from study.experiment.store.responses import open_answers
    from study.report.release import release

    credit = credited(authors, licence)
    protocol, manifest = load_protocol(results / PROTOCOL), read_manifest(results)
    with open_answers(results, database) as responses:
        if kind in ("csv", "parquet"):
            place = out or results / f"answers.{kind}"
            write = {"csv": export_csv, "parquet": export_parquet}[kind]
            write(responses, place, manifest.blends, asked(protocol))
            beside = {"dictionary": str(dictionary_beside(place))} if kind == "csv" else {}
            emit({"file": str(place), **beside}, str(place))
            return
        place = out or results / kind
        if kind == "release":
            release(protocol, manifest, responses, place, credit)
        else:
            export_folder(protocol, responses, kind, place, manifest.blends, credit)
    files = sum(1 for path in place.rglob("*") if path.is_file())
    emit({"folder": str(place), "files": files}, f"{place}: {counted(files, 'file')}")
