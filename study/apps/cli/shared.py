"""What the verbs about one protocol share: loading it, its results folder and database, and its stimuli."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.apps.cli.console import FOLDER, progress, say

if TYPE_CHECKING:
    from renderer.workers import Where
    from study.experiment.protocol.whole import Protocol
    from study.experiment.stimuli.manifest import Manifest
    from study.experiment.stimuli.stimulus import StimulusSet

OUT = click.option("--out", type=FOLDER, default=None, help="Results folder (default: results/<name of the protocol>).")


def load(protocol: str) -> Protocol:
    """A protocol by path, or by the name of one that comes with Segue."""
    from study.experiment.protocol.whole import find_protocol, load_protocol

    return load_protocol(find_protocol(protocol))


def load_for_people(protocol: str) -> Protocol:
    """A protocol that people are about to read; what is still to be written in it is reported on standard error."""
    from study.experiment.protocol.proofreading import to_do

    loaded = load(protocol)
    for note in to_do(loaded):
        say(f"to do: {note}")
    return loaded


def results_folder(protocol: Protocol, out: Path | None) -> Path:
    """Where a run of a protocol goes."""
    return out if out is not None else Path("results") / protocol.name


def prepare_stimuli(protocol: Protocol, library: str | None) -> StimulusSet:
    """All stimuli of a protocol, with progress on standard error."""
    from study.experiment.stimuli.prepare import prepare
    from study.motion.library import open_library

    opened = open_library(library or "synthetic")
    with progress("transitions") as report:
        return prepare(protocol, opened, lambda done, total: report(done / total, f"{done} of {total}"))


def render_stimuli(stimuli: StimulusSet, folder: Path, workers: Where, *, all_levels: bool = True) -> dict[str, Any]:
    """Render what is not rendered yet, with progress on standard error; the numbers for `--json`."""
    from study.experiment.stimuli.rendering import render as render_all

    with progress("videos") as report:
        summary = render_all(
            stimuli,
            folder,
            workers,
            lambda state: report(state.videos / max(state.videos_total, 1), str(state)),
            all_levels=all_levels,
        )
    return {**asdict(summary), "folder": str(folder)}


def check_database(database: str | None, stimuli: StimulusSet | Manifest) -> None:
    """Refuse a database elsewhere that can't be opened, or is about other stimuli, before anything is rendered."""
    from study.experiment.store.responses import open_responses
    from study.experiment.store.sessions import refuse_other_stimuli

    if database is not None:
        with open_responses(database) as responses:
            refuse_other_stimuli(responses, [record.id for record in stimuli.records])
