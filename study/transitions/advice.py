"""Where, for how long and how to blend from one clip to another, with nothing given but the clips.

In: two clips of one rig at one frame rate, and whether either moves in cycles. Out: `Advice`. The lengths are those of
Wang & Bodenheimer 2004: geodesic where a motion is cyclic, for people see when a gait falls out of phase, velocity
where neither is (section 3.1.3). Only points are taken at which the method asks for 5 to 35 frames, as it did for the
paper's motions (section 4.3).

The papers choose points apart from lengths, 2004 at random. Here each point is judged with the blend that follows from
it, by what the blend does to the motion: it bends poses by their distance (Eq. 1) and adds, in passing from one to the
other, that distance over the blend length to the velocities. As in the cost of Lee et al. the two are added, and the
velocities weigh so much that poses and velocities of these clips vary alike: `cost (1 + (tau / (b + 1))^2)`, where tau
is the time in which the motion goes through its own variation, about a sixth of a cycle. By the distance alone the
shortest blends would always win, for a good match seldom lasts. How frames are made is then chosen by what each make
does there (`comparison`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from study.arrays import IntArray
from study.errors import TransitionError
from study.motion.clip import Clip, sample
from study.motion.cycles import find_cycle
from study.transitions.batch import geodesic_lengths, velocity_lengths
from study.transitions.blend_length import FIXED_S, LONGEST_S, default_frames
from study.transitions.comparison import Measured, compare, why
from study.transitions.distances import distance_matrix, frame_distance, on_joints_of
from study.transitions.methods.lengths.wang2004 import Fixed, Geodesic, Velocity
from study.transitions.methods.makes.blends import Slerp
from study.transitions.methods.method import Place
from study.transitions.weights import joint_weights

# 2004 section 5.1: differences that are noticed, 7 frames longer or 8 frames shorter, at 30 fps.
JND_LONGER_S, JND_SHORTER_S = 7.0 / 30.0, 8.0 / 30.0
# 2004 section 4.3: optimal lengths of the motions tested, at 30 fps.
USUAL_S = (5.0 / 30.0, 35.0 / 30.0)
# What is left to be seen of a clip before and after a blend: this, or a quarter of a short clip; seconds.
_SEEN_S = 1.0
# Room for the point to be chosen in, seconds.
_FREEDOM_S = 1.0 / 3.0
# Frames of a clip that its spread is found from.
_SPREAD_FRAMES = 200
# Points that are tried for one pair of clips; evenly spaced in longer clips.
_TRIED = 250_000


@dataclass(frozen=True)
class Advice:
    """A transition between two clips."""

    source: str
    destination: str
    """Names of the clips."""
    method: str
    """Name of the length: geodesic or velocity."""
    why: str
    """What it was chosen for."""
    make: str
    """Name of the make whose frames show least flaws there."""
    make_why: str
    """What it has over a plain blend."""
    start_frame: int
    end_frame: int
    """First blended frame of the source, last blended frame of the destination."""
    blend_frames: int
    blend_s: float
    """How long to blend."""
    cost: float
    default_cost: float
    """2004 Eq. 1 for this blend, and for one of the default length at the same points."""
    default_frames: int
    """The fixed length that is compared with: 0.33 s, 10 frames at 30 fps."""
    difference_frames: int
    """How much longer the advised blend is; below zero, shorter."""
    jnd: float
    """That difference in just noticeable differences (2004 section 5.1); from 1 on, people see it."""
    makes: tuple[Measured, ...]
    """What each make does there, the advised one first; none for a rig without feet."""
    note: str = ""
    """What a reader should know."""


def is_cyclic(clip: Clip) -> bool:
    """Whether a motion goes in gait cycles, found from the motion: steps that repeat at its start or its end.

    A clip that turns, stops or sets off counts as cyclic where there are steps on one side of that. The clip's own
    frame rate shows cycles best.
    """
    return any(cycle is not None and cycle.kind != "still" for cycle in (find_cycle(clip, "start"), find_cycle(clip)))


def advise(source: Clip, destination: Clip, *, cyclic: tuple[bool, bool] | None = None) -> Advice:
    """A transition point, a blend length and a make.

    Parameters
    ----------
    source, destination
        Clips of one rig at one frame rate.
    cyclic
        Whether the source and the destination move in cycles; looked for with `is_cyclic` unless given.

    Raises
    ------
    TransitionError
        For clips of different rigs or rates, or too short for a blend of 5 frames.
    """
    destination = on_joints_of(source, destination)
    repeats = (is_cyclic(source), is_cyclic(destination)) if cyclic is None else cyclic
    method, find = (Geodesic(), geodesic_lengths) if any(repeats) else (Velocity(), velocity_lengths)
    starts, ends = _points(source, destination)
    lengths, costs = find(source, destination, starts, ends)
    strain = costs * (1.0 + (own_time(source, destination) / (lengths + 1)) ** 2)
    low, high = (round(seconds * source.fps) for seconds in USUAL_S)
    usual = (lengths >= low) & (lengths <= high)
    notes = []
    if not usual.any():
        notes.append(f"no point asks for a blend of {low} to {high} frames; this one costs least of all")
        usual[:] = True
    best = int(np.flatnonzero(usual)[np.argmin(strain[usual])])
    start, end = int(starts[best]), int(ends[best])
    chosen, fixed = (each.at(source, destination, start, end) for each in (method, Fixed()))
    length, default = chosen.blend_frames, default_frames(source.fps, FIXED_S)
    makes = compare(Place("", (source.name, destination.name), source, destination, start, end), length)
    return Advice(
        source.name,
        destination.name,
        method.name,
        _why(repeats),
        makes[0].make if makes else Slerp.name,
        why(makes),
        start,
        end,
        length,
        chosen.blend_s,
        chosen.cost,
        fixed.cost,
        default,
        length - default,
        just_noticeable((length - default) / source.fps),
        makes,
        "; ".join(filter(None, (*notes, chosen.note))),
    )


def own_time(*clips: Clip) -> float:
    """The time, in frames, in which clips go through their own variation: spread of poses over speed of joints.

    A joint that swings once in `n` frames has `n / (2 pi)`.
    """
    spread = speed = 0.0
    for clip in clips:
        weights = joint_weights(clip.skeleton)
        some = sample(clip, np.linspace(0, clip.frames - 1, min(clip.frames, _SPREAD_FRAMES)))
        spread += clip.frames * float(np.mean(distance_matrix(some, some, weights))) / 2.0
        speed += clip.frames * float(np.mean(frame_distance(clip.rotations[1:], clip.rotations[:-1], weights)))
    return float(np.sqrt(spread / speed)) if speed > 0 else 0.0


def just_noticeable(difference_s: float) -> float:
    """A difference in blend length, seconds, in just noticeable differences, 0 or more (2004 section 5.1)."""
    return difference_s / JND_LONGER_S if difference_s > 0 else abs(difference_s) / JND_SHORTER_S


def _why(cyclic: tuple[bool, bool]) -> str:
    if all(cyclic):
        return "both motions are cyclic"
    if any(cyclic):
        return f"the {'source' if cyclic[0] else 'destination'} is cyclic"
    return "neither motion is cyclic"


def _points(source: Clip, destination: Clip) -> tuple[IntArray, IntArray]:
    """Start and end frames to try: with room for all lengths where the clips are long enough."""
    fps = source.fps
    entry, after = (min(round(_SEEN_S * fps), clip.frames // 4) for clip in (source, destination))
    freedom = round(_FREEDOM_S * fps)
    room = min(source.frames - entry, destination.frames - after) - freedom
    longest = min(default_frames(fps, LONGEST_S), room)
    if longest < default_frames(fps, USUAL_S[0]):
        shorter = source if source.frames - entry < destination.frames - after else destination
        raise TransitionError(
            f"Expected clips of more than {default_frames(fps, USUAL_S[0]) + freedom} frames beside what is seen "
            f"before and after the blend, found {shorter.frames} in {shorter.name or 'one of them'}. Use longer clips."
        )
    # Frame 0 has no frame before it to tell a velocity by.
    starts = np.arange(max(entry, 1), source.frames - longest + 1)
    ends = np.arange(longest - 1, destination.frames - max(after, 1))
    step = int(np.ceil(np.sqrt(max(1.0, len(starts) * len(ends) / _TRIED))))
    grid = np.meshgrid(starts[::step], ends[::step], indexing="ij")
    return grid[0].ravel(), grid[1].ravel()
