"""A folder that game engines read: clips as animations, transitions between them in seconds, importers.

In: clips on one skeleton at one frame rate, and what `segue advise` found for them or a one-hop table. Out: a folder
with `clips.glb`, `state_machine.json`, of a table `one_hop.bin` and `one_hop.json`, and the files of `importers/`.

How times are counted. A blend of `b` frames from frame `i` on has the shares `1 / (b + 1)` to `b / (b + 1)`
(`study.transitions.blending.blend_weights`), so an engine's linear cross-fade starts one frame earlier, with share 0,
and lasts `(b + 1) / fps` seconds. An animation of `n` frames is `(n - 1) / fps` seconds long; that is the 1 of
normalised times.

Engines can fade; what other makes do, with the feet planted as `segue advise` measured it, comes as an animation of its
own, from the source's last frame to the first that is the destination's alone.
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
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, moved, picked, retarget
from study.motion.readers.gltf_writing import write_glb
from study.motion.readers.rigid import unique
from study.transitions.blending import alignment_of
from study.transitions.methods.makes.blends import Slerp
from study.transitions.methods.method import Place
from study.transitions.methods.registry import DIRECT
from study.transitions.one_hop.table import OneHopTable, write_table

FORMAT, VERSION = "segue state machine", 1
SPECIFICATION = "start-end"
_DECIMALS = 6
_SAME_M = 1e-6
"""Joints this near to each other are in one place."""


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
        if rows and not {row.make for row in rows} <= DIRECT.keys():
            odd = next(row.make for row in rows if row.make not in DIRECT)
            raise TransitionError(f"{path}: expected makes out of {', '.join(DIRECT)}, found {odd!r}.")
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
    passages = [_transition(row, clips[row.source], clips[row.destination]) for row in advice]
    own = {at: passage for at, (_, passage) in enumerate(passages) if passage is not None}
    titles = [*clips, *(f"{advice[at].source} to {advice[at].destination}" for at in own)]
    names = unique([re.sub(r"[^\w .-]", "_", title) for title in titles])
    made = [retarget(passage, shown[0].skeleton) for passage in own.values()]
    animations = dict(zip(names, [*shown, *made], strict=True))
    called = dict(zip(own, names[len(clips) :], strict=True))
    states = [
        {"name": name, "animation": animation, "frames": c.frames, "fps": c.fps, "length_s": (c.frames - 1) / c.fps}
        for name, (animation, c) in zip(clips, animations.items(), strict=False)
    ]
    machine = {
        "format": FORMAT,
        "version": VERSION,
        "file": "clips.glb",
        "states": states,
        "transitions": [{**said, "animation": called.get(at)} for at, (said, _) in enumerate(passages)],
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


def _transition(row: Advised, source: Clip, destination: Clip) -> tuple[dict[str, Any], Clip | None]:
    """A transition in seconds and as parts of the clips' lengths, and its frames if it is no fade."""
    fades = row.make == Slerp.name
    make = Slerp(clean_feet=False) if fades else DIRECT[row.make]()
    place = Place("", (row.source, row.destination), source, destination, row.start_frame, row.end_frame)
    made = make.way(place, (row.blend_frames, row.blend_frames)).made(place)
    clip, start, stop = made.clip, made.blend_start, made.blend_stop
    entered = clip.frames - destination.frames  # the frame that would be the destination's first
    turned = quat.multiply(clip.rotations[-1, 0], quat.conjugate(destination.rotations[-1, 0]))
    turn = 2.0 * float(np.arctan2(turned[2], turned[0]))
    alignment = alignment_of(turn, clip.root_positions[-1], destination.root_positions[-1])
    if not fades:  # planted feet come to the destination's own later than its blend does
        own = joint_positions(moved(destination, alignment.yaw, np.array(alignment.translation)))[stop - entered :]
        apart = np.abs(joint_positions(clip)[stop:] - own).max(axis=(1, 2)) > _SAME_M
        stop = min(stop + int(np.max(np.flatnonzero(apart), initial=-1)) + 1, clip.frames - 1)
    lead = min(1, start, start - entered)
    start -= lead
    said: dict[str, Any] = {name: getattr(row, name) for name in ("source", "destination", "method", "make")}
    said |= {"specification": SPECIFICATION, "fps": source.fps, "blend_frames": row.blend_frames}
    times = start, start - entered, stop - start
    for name, frames, whole in zip(("start", "offset", "duration"), times, (source, destination, source), strict=True):
        said |= {f"{name}_s": frames / source.fps, f"{name}_normalised": frames / (whole.frames - 1)}
    said |= {"turn_radians": alignment.yaw, "shift_m": list(alignment.translation)}
    through = slice(start, stop + 1)
    root = np.concatenate([clip.root_positions[through], clip.rotations[through, 0][:, [1, 2, 3, 0]]], axis=1)
    said["root"] = np.round(root, _DECIMALS).tolist() if fades else []
    return said, None if fades else picked(clip, through)
