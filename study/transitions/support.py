"""Which foot bears weight in a transition, and where it stands: what a blend of two motions owes to the floor.

In: a blended transition and the two clips that it was made from. Out: `Support`: for each foot and each step from frame
to frame how firmly it is held, and by how much it then moves too far, or lies too high or too low, in the blend as it
is.

A foot that bears weight in the blend shall move over the floor, and lie above it, as it does in the clip in which it
bears weight. So a blend of a clip with itself asks for nothing, and a captured foot keeps what little it moves.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from study.arrays import FloatArray, IntArray
from study.motion import quaternions as quat
from study.motion.clip import Clip, sample, trim
from study.motion.feet import foot_points, toes
from study.motion.legs import ramp
from study.transitions.blending import Transition, facing

# A point of a foot bears all its weight up to the first speed (m/s) and height over its lowest (m), none from the
# second.
_SPEEDS, _HEIGHTS = (0.3, 0.9), (0.04, 0.08)
# A foot is held that bears this share of the weight of the foot that bears most; below the first not at all.
_HELD = (0.4, 0.7)
# How much of the weight must be borne at all: less is flight.
_BORNE = (0.25, 0.5)


@dataclass(frozen=True, eq=False)
class Support:
    """What holds a transition to the floor, over the blend and some frames after it: `frames` from `first` on."""

    first: int
    blend_frames: int
    """The first blended frame of the transition, and how many there are."""
    held: FloatArray
    """`(frames + 1, 2)`: how firmly each foot is held, from 0 to 1, in the step into each frame and in the one after
    the last."""
    excess: FloatArray
    """`(frames + 1, 2, 3)`: how much too far each foot moves in these steps if it is held, metres."""
    apart: FloatArray
    """`(frames + 1, 2)`: how differently the two clips use the foot, from 0 (both hold it, or both move it) to 1."""
    over: FloatArray
    """`(frames, 2)`: how far each foot lies over the height at which it would stand, metres."""
    room: FloatArray
    """`(frames, 2)`: how far its lowest point is above the floor, metres; below 0 where it sinks."""

    @property
    def frames(self) -> int:
        """Frames that may be changed."""
        return len(self.over)


@dataclass(frozen=True, eq=False)
class Footwork:
    """What a clip does with its feet.

    `points` are those of each foot, `(frames, points, 3)`; `weight (steps, 2)` and `point (steps, 2)` how much weight
    each foot bears in the step from a frame to the next, and on which point; `heading (frames,)` where the figure
    faces. `root_bends` and `toe_bends (2, 2)` are the largest changes of a step from frame to frame, metres: over the
    floor and in height, first such that both together are within the largest of the clip, then each by itself.
    """

    points: tuple[FloatArray, FloatArray]
    weight: FloatArray
    point: IntArray
    heading: FloatArray
    root_bends: FloatArray
    toe_bends: FloatArray


@lru_cache(maxsize=8)
def footwork(clip: Clip) -> Footwork:
    """Find what a clip does with its feet; kept for the clips of the last few transitions."""
    # A single pose stands as if it were held.
    clip = clip if clip.frames > 1 else sample(clip, [0.0, 0.0])
    points = foot_points(clip)
    weights, slowest = [], []
    for foot in points:
        heights = foot[..., 1] - np.quantile(foot[..., 1], 0.02, axis=0)
        speed = np.linalg.norm(np.diff(foot[..., [0, 2]], axis=0), axis=-1) * clip.fps
        weight = (1.0 - ramp(speed, _SPEEDS)) * (1.0 - ramp(np.maximum(heights[1:], heights[:-1]), _HEIGHTS))
        # Of points that bear alike the slowest counts.
        best = np.argmax(weight - 1e-3 * speed, axis=1)
        weights.append(weight[np.arange(len(weight)), best])
        slowest.append(best)
    bends = [_bends(path) for path in (clip.root_positions, toes(clip))]
    return Footwork(points, np.stack(weights, axis=1), np.stack(slowest, axis=1), facing(clip), *bends)


def _bends(path: FloatArray) -> FloatArray:
    bends = np.diff(path, n=2, axis=0)
    if not len(bends):
        return np.zeros((2, 2))
    most = np.linalg.norm(bends, axis=-1).max()
    floor_own, height = np.linalg.norm(bends[..., [0, 2]], axis=-1).max(), np.abs(bends[..., 1]).max()
    # A steady walk bobs and hardly changes its speed: what it does in height it may do over the floor.
    floor = np.clip(most * floor_own / max(float(np.hypot(floor_own, height)), 1e-12), 0.6 * most, 0.8 * most)
    return np.array([[floor, floor_own], [np.sqrt(max(most**2 - floor**2, 0.0)), height]])


def find_support(transition: Transition, source: Clip, destination: Clip, frames_after: int) -> Support:
    """Find which foot bears weight in a blend and shortly after it, and how far the blend is from holding it.

    Parameters
    ----------
    transition
        A blend of the two clips, by interpolation.
    source, destination
        The clips, on the transition's skeleton.
    frames_after
        Frames after the blend that may be changed, where there are as many.

    Notes
    -----
    Each foot bears the weight that it bears in the clips, mixed by their shares. The foot that bears most is held, and
    the other one as far as it bears about as much, so that support is handed over where both bear alike.
    """
    start, count = transition.blend_start, transition.blend_frames
    frames = min(count + frames_after, transition.clip.frames - start)
    before = 1 if start else 0
    made = trim(transition.clip, start - before, start + frames)
    blended, heading = foot_points(made), facing(made)
    if not before:
        blended = (_with_first(blended[0]), _with_first(blended[1]))
        heading = _with_first(heading)
    rates = [(stop - first) / count for first, stop in (transition.source_frames, transition.destination_frames)]
    steps = np.arange(-1, frames)
    used = [
        np.where(steps < count, transition.source_frames[0] + np.floor(steps * rates[0]).astype(np.int64), -1),
        np.where(
            steps < count,
            transition.destination_frames[0] + np.floor(steps * rates[1]).astype(np.int64),
            transition.destination_frames[1] + steps - count,
        ),
    ]
    motions = [footwork(clip) for clip in (source, destination)]
    used = [
        np.where((each >= 0) & (each < len(motion.weight)), each, -1)
        for each, motion in zip(used, motions, strict=True)
    ]
    share = np.clip((steps + 1.5) / (count + 1.0), 0.0, 1.0)
    shares = np.stack([1.0 - share, share], axis=1)
    return _compared(transition, motions, used, shares, blended, heading)


def _compared(
    transition: Transition,
    motions: list[Footwork],
    used: list[IntArray],
    shares: FloatArray,
    blended: tuple[FloatArray, FloatArray],
    heading: FloatArray,
) -> Support:
    """The blend's feet beside those of its motions.

    `used` are the steps of each motion that the blend takes, -1 where it has none. Rows go by the frame that a step
    starts from: the first is the frame before the blend, the last the last frame.
    """
    borne = np.stack([_taken(each.weight, rows) for each, rows in zip(motions, used, strict=True)], axis=1)
    there = np.stack([rows >= 0 for rows in used], axis=1)
    mixed = np.where(there, shares, 0.0)
    mixed /= np.maximum(mixed.sum(axis=1, keepdims=True), 1e-9)
    weights = mixed[:, :, None] * borne
    total = weights.sum(axis=1)
    most = total.max(axis=1, keepdims=True)
    held = ramp(total / np.maximum(most, 1e-9), _HELD) * ramp(most, _BORNE)
    excess, over = np.zeros((len(shares), 2, 3)), np.zeros((len(shares), 2))
    parts = weights / np.maximum(total, 1e-9)[:, None]
    rows = np.arange(len(shares))
    after = np.minimum(rows + 1, len(shares) - 1)
    for k, motion in enumerate(motions):
        steps = np.maximum(used[k], 0)
        turn = quat.yaw(heading - motion.heading[steps])
        for foot in range(2):
            own, made = motion.points[foot], blended[foot]
            point = motion.point[steps, foot]
            moved = quat.rotate(turn, own[steps + 1, point] - own[steps, point])
            too_far = made[after, point] - made[rows, point] - moved
            part = parts[:, k, foot, None]
            excess[:, foot] += part * np.where(after[:, None] > rows[:, None], too_far, 0.0)
            over[:, foot] += part[:, 0] * (made[rows, point, 1] - own[steps, point, 1])
    lows = [np.stack([points[foot][..., 1].min(axis=0) for points in (m.points for m in motions)]) for foot in range(2)]
    room = np.stack([(made[..., 1] - mixed @ low).min(axis=1) for made, low in zip(blended, lows, strict=True)], axis=1)
    apart = np.abs(borne[:, 0] - borne[:, 1]) * np.min(there, axis=1, keepdims=True)
    return Support(transition.blend_start, transition.blend_frames, held, excess, apart, over[1:], room[1:])


def _taken(values: FloatArray, rows: IntArray) -> FloatArray:
    return np.where((rows >= 0)[:, None], values[np.clip(rows, 0, len(values) - 1)], 0.0)


def _with_first(values: FloatArray) -> FloatArray:
    return np.concatenate([values[:1], values])
