"""`segue one-hop` (show, play): what a table of one-hop transitions holds, and how it is played."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.apps.cli.clips import clips_options
from study.apps.cli.console import FILE, READABLE, emit, json_option
from study.apps.cli.one_hop import load_clips, one_hop
from study.counting import counted

if TYPE_CHECKING:
    from study.transitions.one_hop.play import Played


@one_hop.command()
@click.argument("table", type=READABLE)
@click.option(
    "--at",
    "places",
    type=(str, str, int),
    multiple=True,
    metavar="SRC DST FRAME",
    help="Show the entry of this triggered frame; may be repeated.",
)
@json_option
def show(table: Path, places: tuple[tuple[str, str, int], ...]) -> None:
    """The content of a table, and single entries of it."""
    from study.transitions.one_hop.table import COLUMNS, header, read_table

    held = read_table(table)
    blends = "their own" if len(held.columns) > len(COLUMNS) else held.blend_frames
    entries = []
    lines = [
        f"{table}: {counted(len(held.entries), 'entry', 'entries')} of {', '.join(held.columns)}; "
        f"{counted(len(held.clips), 'clip')} at "
        f"{held.fps:g} fps, blends of {blends} frames, weight {held.weight:.4g}",
        *(
            f"{held.clips[row.source]} to {held.clips[row.destination]}: frames {row.first_trigger} to "
            f"{row.first_trigger + row.triggers - 1}"
            for row in held.rows
        ),
    ]
    for source, destination, frame in places:
        a, b = held.number(source), held.number(destination)
        entry, position = held.look_up(a, b, frame), held.position(a, b, frame)
        said: dict[str, Any] = {"source": source, "destination": destination, "frame": frame, "hop": None}
        if entry is None:
            lines.append(f"{source} {frame} to {destination}: none fits in the clips")
        else:
            said |= {name: int(value) for name, value in zip(held.columns, held.entries[position], strict=True)}
            said |= {"hop": held.clips[entry.hop], "cost": float(held.costs[position])}
            said["direct_cost"] = float(held.direct_costs[position])
            lines.append(
                f"{source} {frame} to {destination}: stay {entry.stay_source}, hop {said['hop']} at offset "
                f"{entry.offset}, stay {entry.stay_hop}; cost {said['cost']:.4g}, direct {said['direct_cost']:.4g}"
            )
        entries.append(said)
    emit({**header(held), "shown": entries}, "\n".join(lines))


@one_hop.command()
@click.argument("table", type=READABLE)
@click.argument("clips", metavar="[CLIP...]", nargs=-1)
@clips_options
@click.option("--first", metavar="CLIP", help="Clip to start in (default: the first).")
@click.option(
    "--trigger",
    "triggers",
    type=(int, str),
    multiple=True,
    metavar="FRAME DST",
    help="Change to DST at this frame; may be repeated.",
)
@click.option("--method", type=click.Choice(["one-hop", "direct"]), default="one-hop", show_default=True,
              help="one-hop, through the table's hop; direct, without.")  # fmt: skip
@click.option(
    "--upper",
    type=READABLE,
    metavar="TABLE",
    help="A table of the same clips for trunk, arms and head (default: none).",
)
@click.option("--out", type=FILE, required=True, help="File to write: X.bvh, X.mp4, or X.png, a strip of poses.")
@json_option
def play(
    table: Path,
    clips: tuple[str, ...],
    library: str | None,
    first: str | None,
    triggers: tuple[tuple[int, str], ...],
    method: str,
    upper: Path | None,
    out: Path,
) -> None:
    """Play clips as the states of a state machine, with transitions from a table, and write the motion.

    The clips are those of the table, in its order (default: the motions of --library with the table's names).
    """
    from dataclasses import replace

    from study.transitions.one_hop.parts import put_together
    from study.transitions.one_hop.play import Trigger
    from study.transitions.one_hop.play import play as play_machine
    from study.transitions.one_hop.table import read_table

    held = read_table(table)
    loaded = load_clips(clips or held.clips, library, held.fps)
    wishes = [Trigger(frame, held.number(name)) for frame, name in triggers]
    start = 0 if first is None else held.number(first)
    played = play_machine(loaded, held, wishes, first=start, method=method)
    result: dict[str, Any] = {"method": method}
    if upper is not None:
        other = read_table(upper)
        if (other.clips, other.fps) != (held.clips, held.fps):
            raise click.UsageError(f"expected --upper with the clips of {table} at its rate, found others in {upper}.")
        above = play_machine(loaded, other, wishes, first=start, method=method)
        played = replace(played, clip=put_together(played.clip, above.clip))
        result["upper_segments"] = segments_of(above, held.clips)
    show_played(played, held.clips, out, result)


def segments_of(played: Played, names: Sequence[str]) -> list[dict[str, Any]]:
    """What plays when, with the names of the clips."""
    from dataclasses import asdict

    return [{**asdict(part), "clip": names[part.clip]} for part in played.segments]


def show_played(
    played: Played, names: Sequence[str], out: Path | None, result: dict[str, Any], lines: Sequence[str] = ()
) -> None:
    """Write what was played where that is asked for, and print its segments after other lines."""
    from study.motion.drawing import draw_clip
    from study.motion.readers.bvh_writing import write_bvh
    from study.transitions.one_hop.strip import draw_played

    if out is None:
        pass
    elif out.suffix.lower() == ".bvh":
        write_bvh(played.clip, out)
    elif out.suffix.lower() == ".png":
        draw_played(played, out)
    else:
        draw_clip(played.clip, out)
    segments = segments_of(played, names)
    said = [
        f"{part['start']:6} {part['kind']:6} {part['clip']} from its frame {part['clip_start']}" for part in segments
    ]
    head = [] if out is None else [f"{out}: {counted(played.clip.frames, 'frame')}"]
    file = None if out is None else str(out)
    emit(
        {"file": file, "frames": played.clip.frames, **result, "segments": segments}, "\n".join([*lines, *head, *said])
    )
