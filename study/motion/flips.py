"""Hips that flip: found, and turned back so that the knee stays on its side while hip and ankle stay where they are.

With hip and ankle given, a leg's knee can still stand anywhere on a circle about the line between them. Capture
software that loses the thigh's markers jumps along that circle, often by half a turn, and back some frames later. So
a repair turns the thigh about the line from hip to ankle: hip and ankle keep their places exactly, the knee returns
to where it was, and all detail of the motion stays. The foot, which flips with the shin, is carried on smoothly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from study.arrays import FloatArray, IntArray, runs
from study.motion import quaternions as quat
from study.motion.clip import Clip
from study.motion.skeleton import Skeleton

# A flip turns the hip by at least this (radians) between two frames; those of the CMU database by 1.6 to 3.1.
FLIP_RAD = 1.3
# Leaving a flip's jump in and spreading it over frames costs as much as turning this many frames.
_SPREAD_COST_FRAMES = 25.0
_SPREAD_S = 0.1


@dataclass(frozen=True, eq=False)
class LegFlips:
    """The flips of one leg."""

    side: str
    """`"L"` or `"R"`."""
    runs: tuple[tuple[int, int], ...]
    """Frames `(start, stop)` that are turned, in order."""
    angles: FloatArray
    """`(frames,)`: by how much the thigh is turned about the line from hip to ankle, radians; 0 where it is left alone.
    """
    size: float
    """The largest turn of the hip between two frames, radians."""


def leg_flips(clip: Clip, side: str, jumps: IntArray) -> LegFlips:
    """Which frames of a leg to turn, given the frames `jumps` before which its hip jumps by `FLIP_RAD` or more.

    At each jump the leg either changes from right to wrong or back (the frames between are turned), or a gradual
    slide round the circle ends in it (the jump is spread over the frames of the slide). The cheapest reading is
    taken: few turned frames, and hips no further from rest than need be.
    """
    hip, ankle = (clip.skeleton.role(f"{part}.{side}") for part in ("hip", "ankle"))
    rotations = clip.rotations
    axes = _leg_axes(clip, hip, ankle)
    turns = np.array([_twist(axes[k], rotations[k - 1, hip], rotations[k, hip]) for k in jumps])
    flipped = _cheapest_reading(clip, hip, axes, jumps)
    angles = np.zeros(clip.frames)
    bounds = [0, *jumps.tolist(), clip.frames]
    for segment, turned in enumerate(flipped):
        if not turned:
            continue
        start, stop = bounds[segment], bounds[segment + 1]
        entering = turns[segment - 1] if not flipped[segment - 1] else angles[start - 1]
        leaving = -turns[segment] if segment < len(jumps) and not flipped[segment + 1] else entering
        leaving += 2.0 * np.pi * np.round((entering - leaving) / (2.0 * np.pi))
        angles[start:stop] = (
            np.linspace(entering, leaving, stop - start) if stop - start > 1 else (entering + leaving) / 2
        )
    for index, k in enumerate(jumps.tolist()):
        if flipped[index] == flipped[index + 1]:
            _spread(clip, hip, angles, k, float(turns[index]))
    size = float(np.max(2.0 * quat.half_angle_between(rotations[jumps, hip], rotations[jumps - 1, hip])))
    return LegFlips(side, tuple(runs(angles != 0.0)), angles, size)


def turn_back(clip: Clip, rotations: FloatArray, flips: LegFlips) -> None:
    """Mend one leg in `rotations (frames, joints, 4)`, a copy of the clip's, in place."""
    hip, ankle = (clip.skeleton.role(f"{part}.{flips.side}") for part in ("hip", "ankle"))
    axes = _leg_axes(clip, hip, ankle)
    for start, stop in flips.runs:
        run = slice(start, stop)
        turn = quat.from_axis_angle(axes[run], flips.angles[run])
        shin = _turn_along(clip.skeleton, rotations[run], hip, int(clip.skeleton.parents[ankle]))
        foot = quat.multiply(shin, rotations[run, ankle])
        rotations[run, hip] = quat.multiply(turn, rotations[run, hip])
        with_shin = rotations[run, ankle].copy()
        in_place = quat.multiply(quat.conjugate(quat.multiply(turn, shin)), foot)
        before = rotations[start - 1, ankle] if start > 0 else None
        after = rotations[stop, ankle] if stop < clip.frames else None
        carried = [_carried_on(way, before, after) for way in (with_shin, in_place)]
        rotations[run, ankle] = min(carried, key=lambda way: way[1])[0]


def _carried_on(path: FloatArray, before: FloatArray | None, after: FloatArray | None) -> tuple[FloatArray, float]:
    """Rotations `(n, 4)` turned so as to continue the frames before and after, and the most they were turned by."""
    first = quat.IDENTITY if before is None else quat.multiply(before, quat.conjugate(path[0]))
    last = first if after is None else quat.multiply(after, quat.conjugate(path[-1]))
    first = last if before is None else first
    share = (np.arange(len(path)) + 0.5) / len(path)
    turns = quat.slerp(first, last, share)
    return quat.multiply(turns, path), float(np.max(quat.half_angle_between(turns, quat.IDENTITY)))


def _leg_axes(clip: Clip, hip: int, ankle: int) -> FloatArray:
    """The unit vector from hip to ankle in the frame of the hip's parent, `(frames, 3)`."""
    leg = np.zeros((clip.frames, 3))
    joint = ankle
    while joint != hip:
        parent = int(clip.skeleton.parents[joint])
        leg = quat.rotate(clip.rotations[:, parent], clip.skeleton.offsets[joint] + leg)
        joint = parent
    return np.asarray(leg / np.maximum(np.linalg.norm(leg, axis=1, keepdims=True), 1e-9))


def _turn_along(skeleton: Skeleton, rotations: FloatArray, upper: int, lower: int) -> FloatArray:
    """The rotation of a joint in the frame of the parent of one above it, `(frames, 4)`."""
    turn = rotations[:, lower]
    while lower != upper:
        lower = int(skeleton.parents[lower])
        turn = quat.multiply(rotations[:, lower], turn)
    return turn


def _twist(axis: FloatArray, before: FloatArray, after: FloatArray) -> float:
    """The turn about `axis` that brings the rotation `after` nearest to `before`, radians, -pi to pi."""
    relative = quat.multiply(before, quat.conjugate(after))
    angle = 2.0 * np.arctan2(float(relative[1:] @ axis), float(relative[0]))
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


def _cheapest_reading(clip: Clip, hip: int, axes: FloatArray, jumps: IntArray) -> list[bool]:
    """For each segment between jumps whether it is turned; the first is not. Dynamic programming over segments."""
    half_turn = quat.from_axis_angle(axes, np.pi)
    plain = 2.0 * quat.half_angle_between(clip.rotations[:, hip], quat.IDENTITY)
    turned = 2.0 * quat.half_angle_between(quat.multiply(half_turn, clip.rotations[:, hip]), quat.IDENTITY)
    per_frame = 1.0 + np.clip((turned - plain) / np.radians(60.0), -0.7, 2.0)
    sums = np.add.reduceat(per_frame, np.concatenate([[0], jumps]))
    costs, choices = np.array([0.0, np.inf]), []
    for total in sums[1:]:
        # Same state on both sides of a jump: spread it. Another state: nothing left to do there.
        ways = costs[:, None] + np.array([[_SPREAD_COST_FRAMES, 0.0], [0.0, _SPREAD_COST_FRAMES]])
        choices.append(np.argmin(ways, axis=0))
        costs = np.min(ways, axis=0) + np.array([0.0, total])
    states = [int(np.argmin(costs))]
    for choice in reversed(choices):
        states.append(int(choice[states[-1]]))
    return [bool(state) for state in reversed(states)]


def _spread(clip: Clip, hip: int, angles: FloatArray, jump: int, turn: float) -> None:
    """Spread a jump over the frames on that side of it where the hip turns more, which is where it slid away."""
    width = max(2, round(_SPREAD_S * clip.fps))
    speeds = quat.half_angle_between(clip.rotations[1:, hip], clip.rotations[:-1, hip])
    before = speeds[max(jump - width, 0) : jump - 1]
    after = speeds[jump : jump + width]
    if before.size and (not after.size or before.mean() >= after.mean()):
        start = max(jump - width, 1)
        angles[start:jump] -= turn * np.arange(1, jump - start + 1) / (jump - start)
    else:
        stop = min(jump + width, clip.frames)
        angles[jump:stop] += turn * np.arange(stop - jump, 0, -1) / (stop - jump)
