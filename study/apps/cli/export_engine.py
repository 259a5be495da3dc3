"""`segue export-engine`: clips and their transitions for Godot, Unity and Unreal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from study.apps.cli.clips import clips_options
from study.apps.cli.console import FOLDER, READABLE, emit, json_option
from study.apps.cli.one_hop import load_clips
from study.counting import counted


@click.command("export-engine")
@click.argument("found", type=READABLE, metavar="ADVICE|TABLE")
@click.argument("clips", metavar="[CLIP...]", nargs=-1)
@clips_options
@click.option("--out", type=FOLDER, required=True, help="Folder to write to; other files in it stay.")
@click.option("--native", is_flag=True, help="Write each animation at its clip's own frame rate.")
@json_option
def export_engine(found: Path, clips: tuple[str, ...], library: str | None, out: Path, native: bool) -> None:
    """Write clips and their transitions for game engines: glTF, a state machine in seconds, importers.

    The clips are those that the file names, in its order (default: found by these names, in --library).
    """
    import json
    from dataclasses import replace

    from study.errors import TransitionError
    from study.files import read_text
    from study.transitions.engines.export import export, read_advice
    from study.transitions.one_hop.table import FORMAT, read_table

    said: Any = {"format": FORMAT}
    if found.suffix not in (".npz", ".bin"):
        try:
            said = json.loads(read_text(found, "advice or a one-hop table"))
        except (ValueError, RecursionError) as error:
            raise TransitionError(f"{found}: expected JSON, found something else ({error}).") from error
    is_table = isinstance(said, dict) and said.get("format") == FORMAT
    table = read_table(found) if is_table else None
    if table is None:
        fps, advice = read_advice(found, said)
        names = tuple(dict.fromkeys(name for row in advice for name in (row.source, row.destination)))
    else:
        fps, advice, names = table.fps, [], table.clips
    if clips and len(clips) != len(names):
        raise click.UsageError(f"expected {counted(len(names), 'clip')} ({', '.join(names)}), found {len(clips)}.")
    loaded = load_clips(clips or names, library, fps)
    shown = load_clips(clips or names, library, None) if native else loaded
    # Advice names files by their paths; states have the files' names.
    states = dict(zip(names, names if table else (clip.name for clip in loaded), strict=True))
    advice = [replace(row, source=states[row.source], destination=states[row.destination]) for row in advice]
    machine = export(out, dict(zip(states.values(), loaded, strict=True)), shown, advice, table)
    result = {"folder": str(out), "states": machine["states"], "transitions": len(machine["transitions"])}
    transitions = f"{len(table.rows)} in a one-hop table" if table else counted(len(advice), "transition")
    emit(result, f"{out}: {counted(len(names), 'animation')}, {transitions}")
