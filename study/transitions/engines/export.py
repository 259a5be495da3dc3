"""A folder that game engines read: clips as animations, transitions between them in seconds, importers.

In: clips on one skeleton at one frame rate, and what `segue advise` found for them or a one-hop table. Out: a folder
with `clips.glb`, `state_machine.json`, of a table `one_hop.bin` and `one_hop.json`, and the files of `importers/`.

How times are counted. A blend of `b` frames from frame `i` on has the shares `1 / (b + 1)` to `b / (b + 1)`
(`study.transitions.blending.blend_weights`), so an engine's linear cross-fade starts one frame earlier, with share 0,
and lasts `(b + 1) / fps` seconds. An animation of `n` frames is `(n - 1) / fps` seconds long; that is the 1 of
normalised times.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from study.errors import TransitionError
from study.files import write_whole
from study.motion.clip import Clip
from study.motion.readers.gltf_writing import write_glb
from study.motion.readers.rigid import unique
from study.transitions.blending import blend
from study.transitions.one_hop.table import OneHopTable, write_table

FORMAT, VERSION = "segue state machine", 1
SPECIFICATION = "start-end"
_DECIMALS = 6


@dataclass(frozen=True)
class Advised:
    """A transition of `segue advise`; names of the clips, and frames at the rate of the advice."""

    source: str
    destination: str
    method: str
    make: str
    start_frame: int
    end_frame: int
    blend_frames: int


def read_advice(path: Path, said: Any) -> tuple[float, list[Advised]]:
    """The frame rate and the transitions of an `advice.json`; `TransitionError` for what is none."""
    names = [field.name for field in fields(Advised)]
    try:
        rows = [Advised(**{name: row[name] for name in names}) for row in said["advice"]]
        words = [word for row in rows for word in astuple(row)[:4]]
        frames = [frame for row in rows for frame in astuple(row)[4:]]
        if rows and {*map(type, words)} == {str} and {*map(type, frames)} == {int} and said["fps"] > 0.0:
            return float(said["fps"]), rows
    except (KeyError, TypeError):
        pass  # refused with what has other values
    raise TransitionError(
        f"{path}: expected the advice.json of `segue advise --out`, or a one-hop table, found neither."
    )


def export(
    folder: Path, clips: Mapping[str, Clip], shown: Sequence[Clip], advice: Sequence[Advised], table: OneHopTable | None
) -> dict[str, Any]:
    """Write the files, each whole or not at all, and give the state machine.

    Parameters
    ----------
    folder
        Other files in it stay, since it may be a game's.
    clips
        The states by name, on one skeleton, at the frame rate of the advice or the table.
    shown
        The same as the animations have them, maybe at their own rates.
    advice, table
        The transitions; none, or None, where there are none of that kind.
    """
    animations = dict(zip(unique([re.sub(r"[^\w .-]", "_", name) for name in clips]), shown, strict=True))
    states = [
        {"name": name, "animation": animation, "frames": c.frames, "fps": c.fps, "length_s": (c.frames - 1) / c.fps}
        for name, (animation, c) in zip(clips, animations.items(), strict=True)
    ]
    machine = {
        "format": FORMAT,
        "version": VERSION,
        "file": "clips.glb",
        "states": states,
        "transitions": [_transition(row, clips[row.source], clips[row.destination]) for row in advice],
        "one_hop": None if table is None else {"table": "one_hop.bin", "header": "one_hop.json"},
    }
    # A line for each key, and for each list of numbers.
    text = re.sub(r"\[\s+([^][{}]*?)\s+\]", lambda m: f"[{' '.join(m[1].split())}]", json.dumps(machine, indent=1))
    write_glb(animations, folder / "clips.glb")
    write_whole(folder / "state_machine.json", f"{text}\n")
    if table is not None:
        write_table(table, folder / "one_hop.bin")
    for file in filter(Path.is_file, (Path(__file__).parent / "importers").iterdir()):
        write_whole(folder / file.name, file.read_bytes())
    return machine


def _transition(row: Advised, source: Clip, destination: Clip) -> dict[str, Any]:
    """A transition in seconds, as parts of the clips' lengths, and with the root's path through it."""
    made = blend(source, destination, row.start_frame, row.end_frame, row.blend_frames, specification=SPECIFICATION)
    lead = 1 if made.source_frames[0] > 0 and made.destination_frames[0] > 0 else 0
    times = made.source_frames[0] - lead, made.destination_frames[0] - lead, row.blend_frames + lead
    through = slice(made.blend_start - lead, made.blend_stop + 1)
    root = [made.clip.root_positions[through], made.clip.rotations[through, 0][:, [1, 2, 3, 0]]]
    said: dict[str, Any] = {name: getattr(row, name) for name in ("source", "destination", "method", "make")}
    said |= {"specification": SPECIFICATION, "fps": source.fps, "blend_frames": row.blend_frames}
    for name, frames, whole in zip(("start", "offset", "duration"), times, (source, destination, source), strict=True):
        said |= {f"{name}_s": frames / source.fps, f"{name}_normalised": frames / (whole.frames - 1)}
    said |= {"turn_radians": made.alignment.yaw, "shift_m": list(made.alignment.translation)}
    return said | {"root": np.round(np.concatenate(root, axis=1), _DECIMALS).tolist()}
