"""Drafts: stimuli before they have a camera: frames made, cut to entry and exit, and put in the common place.

What a study shows of a transition comes in (`films.Planned`); joint positions, each film's once, go out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from study.experiment.protocol.whole import Protocol
from study.experiment.stimuli.films import Film, Planned
from study.experiment.stimuli.points import Settled
from study.experiment.stimuli.ways import Ways
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, trim
from study.transitions.blending import blend, facing
from study.transitions.flaws import Flaws, find_flaws

FloatArray = NDArray[np.float64]

_TRAVELS_M = 0.5


@dataclass(frozen=True, eq=False)
class Draft:
    """A stimulus before it has a camera: `positions (frames, points, 3)` in metres, and the frames that are blended.

    `flaws` are None for a figure without feet; `holds_feet` says whether its feet are to stand.
    """

    settled: Settled
    method: str
    difference_frames: int
    blend_frames: int
    clip: Clip
    blend: tuple[int, int]
    positions: FloatArray
    notes: tuple[str, ...]
    flaws: Flaws | None
    holds_feet: bool


def add_drafts(protocol: Protocol, planned: Planned, drafts: dict[Film, Draft], ways: Ways) -> None:
    """Make what is seen in one study of one transition, except for what was made before."""
    for showing in planned.showings:
        condition = showing.condition
        for film, method, difference in zip(showing.films, condition.methods, condition.added_frames, strict=True):
            if film not in drafts:
                drafts[film] = _draft(protocol, planned, method, difference, film, ways)


def _draft(protocol: Protocol, planned: Planned, method: str, difference: int, film: Film, ways: Ways) -> Draft:
    """Make the frames, cut them to entry and exit, and place them at the origin with the common heading."""
    settled = planned.settled.at(method)
    points = replace(settled, start_frame=film.start_frame, end_frame=film.end_frame)
    place = ways.place(planned.study, points)
    made = film.way.made(place)
    first = made.blend_start - film.way.lead - film.frames_before - protocol.entry_frames
    clip = trim(made.clip, first, made.blend_stop + film.frames_on + protocol.exit_frames)
    notes = tuple(note for note in (made.note, settled.lengths[method].note) if note)
    positions = _placed(joint_positions(clip, ends=True), protocol, settled)
    blended = made.blend_start - first, made.blend_stop - first
    flaws = find_flaws(clip, blended, film.way.motions(place)) if clip.skeleton.has("ankle") else None
    frames, holds = film.way.blend_frames, film.way.holds_feet
    return Draft(points, method, difference, frames, clip, blended, positions, notes, flaws, holds)


def _placed(positions: FloatArray, protocol: Protocol, settled: Settled) -> FloatArray:
    """Points with the pelvis over the origin where the blend starts, and the way of the transition along +Z.

    The way is that of a blend of one frame whatever the length: entries are the same for all lengths and shall stay
    so. Rounded to a tenth of a millimetre, so that the hash doesn't hang on the last bits of a machine's arithmetic.
    """
    points = settled.start_frame, settled.end_frame
    made = blend(settled.source.clip, settled.destination.clip, *points, 1)
    path = made.clip.root_positions
    way = path[made.blend_stop + protocol.exit_frames - 1] - path[made.blend_start - protocol.entry_frames]
    if np.hypot(way[0], way[2]) > _TRAVELS_M:
        heading = float(np.arctan2(way[0], way[2]))
    else:
        heading = float(facing(trim(settled.source.clip, settled.start_frame, settled.start_frame + 1))[0])
    floor = settled.source.clip.root_positions[settled.start_frame] * np.array([1.0, 0.0, 1.0])
    return np.round(quat.rotate(quat.yaw(-heading), positions - floor), 4)
