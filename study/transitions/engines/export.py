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
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from study.errors import TransitionError
from study.files import whole_folder
from study.motion.clip import Clip
from study.motion.readers.gltf_file import unique
from study.motion.readers.gltf_writing import write_glb
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


def read_advice(path: Path, said: Mapping[str, Any]) -> tuple[float, list[Advised]]:
    """The frame rate and the transitions of an `advice.json`.

    Raises
    ------
    TransitionError
        For what `segue advise` did not write.
    """
    kinds = {
        name: int if name.endswith("_frames") or name.endswith("_frame") else str for name in Advised.__match_args__
    }
    try:
        rows = [Advised(**{name: _of(kind, row[name]) for name, kind in kinds.items()}) for row in said["advice"]]
        fps = float(said["fps"])
    except (KeyError, TypeError, ValueError) as error:
        raise TransitionError(
            f"{path}: expected the advice.json of `segue advise --out` or a one-hop table, found something else "
            f"({type(error).__name__}: {error})."
        ) from error
    if not rows or not fps > 0.0:
        raise TransitionError(f"{path}: expected advice on transitions, found none. Run `segue advise` again.")
    return fps, rows


def _of(kind: type, value: object) -> Any:
    if type(value) is not kind:
        raise TypeError(f"{value!r} is no {kind.__name__}")
    return value


def export(
    folder: Path, clips: Mapping[str, Clip], shown: Sequence[Clip], advice: Sequence[Advised], table: OneHopTable | None
) -> dict[str, Any]:
    """Write the folder, whole or not at all, and give the state machine.

    Parameters
    ----------
    folder
        It takes the place of one that is there.
    clips
        The states by name, on one skeleton, at the frame rate of the advice or the table.
    shown
        The same as the animations have them, maybe at their own rates.
    advice, table
        The transitions; none, or None, where there are none of that kind.
    """
    names = unique([re.sub(r"[^\w .-]", "_", name) for name in clips])
    states = [
        {
            "name": name,
            "animation": animation,
            "frames": clip.frames,
            "fps": clip.fps,
            "length_s": (clip.frames - 1) / clip.fps,
        }
        for name, animation, clip in zip(clips, names, shown, strict=True)
    ]
    machine = {
        "format": FORMAT,
        "version": VERSION,
        "file": "clips.glb",
        "up": "Y",
        "unit": "metre",
        "states": states,
        "transitions": [_transition(row, clips[row.source], clips[row.destination]) for row in advice],
        "one_hop": None if table is None else {"table": "one_hop.bin", "header": "one_hop.json"},
    }
    with whole_folder(folder) as unfinished:
        write_glb(dict(zip(names, shown, strict=True)), unfinished / "clips.glb")
        (unfinished / "state_machine.json").write_text(_text(machine), encoding="utf-8")
        if table is not None:
            write_table(table, unfinished / "one_hop.bin")
        for file in sorted((Path(__file__).parent / "importers").iterdir()):
            shutil.copyfile(file, unfinished / file.name)
    return machine


def _text(machine: Mapping[str, Any]) -> str:
    """JSON with a line for each key, and for each list of numbers."""
    return (
        re.sub(r"\[\s+([^][{}]*?)\s+\]", lambda m: f"[{' '.join(m[1].split())}]", json.dumps(machine, indent=1)) + "\n"
    )


def _transition(row: Advised, source: Clip, destination: Clip) -> dict[str, Any]:
    """A transition in seconds, as parts of the clips' lengths, and with the root's path through it."""
    made = blend(source, destination, row.start_frame, row.end_frame, row.blend_frames, specification=SPECIFICATION)
    lead = 1 if made.source_frames[0] > 0 and made.destination_frames[0] > 0 else 0
    start, offset, duration = (
        frames / source.fps
        for frames in (made.source_frames[0] - lead, made.destination_frames[0] - lead, row.blend_frames + lead)
    )
    through = slice(made.blend_start - lead, made.blend_stop + 1)
    root = np.concatenate([made.clip.root_positions[through], made.clip.rotations[through, 0][:, [1, 2, 3, 0]]], axis=1)
    lengths = [(clip.frames - 1) / clip.fps for clip in (source, destination)]
    return {
        "source": row.source,
        "destination": row.destination,
        "method": row.method,
        "make": row.make,
        "specification": SPECIFICATION,
        "fps": source.fps,
        "blend_frames": row.blend_frames,
        "start_s": start,
        "start_normalised": start / lengths[0],
        "offset_s": offset,
        "offset_normalised": offset / lengths[1],
        "duration_s": duration,
        "duration_normalised": duration / lengths[0],
        "turn_radians": made.alignment.yaw,
        "shift_m": list(made.alignment.translation),
        "root": np.round(root, _DECIMALS).tolist(),
    }
