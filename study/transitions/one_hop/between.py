"""Clips between two of one gait: walks at speeds between a slow and a fast one, each a clip like any other.

Koyama & Goto 2019 (section 5, Interpolated motions) leave states that are interpolations of clips to future work. In:
two clips with steps that repeat. Out: whole gait cycles of both, brought into step by a registration curve (Kovar &
Gleicher 2003), and their mixtures: joints by slerp, the root by how each clip steps and turns in its own facing, and
time, so that a cycle lasts as long as its share asks for. The curve also lets feet stand at the same time in both
clips, which is what keeps them from sliding in a mixture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from study.arrays import FloatArray
from study.counting import counted
from study.errors import TransitionError
from study.motion.clip import Clip, picked, retarget, sample
from study.motion.cycles import find_cycle
from study.transitions.blending import Stretch, join
from study.transitions.point_cloud import point_cloud, window_distances
from study.transitions.registration import Lead, least_path, smooth_lead
from study.transitions.support import footwork

_STANDS_M2 = 0.05
"""How far apart two poses count, square metres, for each foot that bears weight in one of them alone."""
_FINE = 8
"""Places a frame at which the time of a curve is known, between which it is taken as straight."""


@dataclass(frozen=True, eq=False)
class InStep:
    """Stretches of two clips with as many gait cycles each: a slow one, then a fast one.

    `starts` and `frames` are where they begin and how long they last, in frames; `ways_m` how far the root goes.
    """

    clips: tuple[Clip, Clip]
    cycles: int
    starts: tuple[float, float]
    frames: tuple[float, float]
    ways_m: tuple[float, float]
    lead: Lead

    def times(self, curve: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The frame of each clip at places along the curve, from 0 to 1."""
        ahead = 0.5 * self.lead.at(curve)
        (slow, fast), (slow_frames, fast_frames) = self.starts, self.frames
        return slow + slow_frames * (curve - ahead), fast + fast_frames * (curve + ahead)

    def shares(self, count: int) -> FloatArray:
        """The shares of the fast clip at which speeds lie evenly between those of both clips, `(count,)`.

        A share `w` goes `(1 - w) m1 + w m2` metres in `(1 - w) t1 + w t2` seconds; clips of one speed have even shares.
        """
        even = np.arange(1, count + 1) / (count + 1.0)
        (slow_m, fast_m), (slow, fast) = self.ways_m, self.frames
        speeds = (1.0 - even) * slow_m / slow + even * fast_m / fast
        change = fast_m - slow_m - speeds * (fast - slow)
        alike = abs(fast_m / fast - slow_m / slow) < 1e-9
        return even if alike else np.asarray((speeds * slow - slow_m) / change)


def in_step(slow: Clip, fast: Clip) -> InStep:
    """As many whole gait cycles as two clips both have, from like poses on.

    Raises
    ------
    TransitionError
        Where a clip does not end in steps that repeat, or has less than a cycle; for clips of other frame rates.
    MotionError
        For clips of other rigs.
    """
    if slow.fps != fast.fps:
        raise TransitionError(
            f"Expected clips at one frame rate, found {slow.fps:g} and {fast.fps:g} fps. Resample one of them."
        )
    clips = slow, retarget(fast, slow.skeleton)
    periods = tuple(_period(clip) for clip in clips)
    cycles = min(int((clip.frames - 1) / period) for clip, period in zip(clips, periods, strict=True))
    frames = cycles * periods[0], cycles * periods[1]
    starts = _starts(clips, frames)
    even = np.linspace(0.0, 1.0, round(max(frames)) + 1)
    parts = [sample(clip, start + length * even) for clip, start, length in zip(clips, starts, frames, strict=True)]
    apart = window_distances(point_cloud(parts[0]), point_cloud(parts[1]), 1, precision="double")
    for foot in range(2):
        ours, theirs = (np.append(weight[:, foot], weight[-1, foot]) for weight in (footwork(p).weight for p in parts))
        apart += _STANDS_M2 * np.subtract.outer(ours, theirs) ** 2
    lead = smooth_lead(least_path(apart), len(even) - 1)
    ways = [float(np.linalg.norm(np.diff(part.root_positions[:, [0, 2]], axis=0), axis=1).sum()) for part in parts]
    return InStep(clips, cycles, starts, frames, (ways[0], ways[1]), lead)


def _period(clip: Clip) -> float:
    """Frames of a gait cycle."""
    cycle, name = find_cycle(clip), clip.name or "a clip"
    if cycle is None or cycle.kind == "still":
        raise TransitionError(
            f"Expected {name} to end in steps that repeat, found {'standing' if cycle else 'none'}. Give two walks or "
            "two runs, cut to their steady steps."
        )
    if clip.frames - 1 < cycle.cycle_frames:
        raise TransitionError(
            f"Expected {name} to have a whole gait cycle, {cycle.cycle_frames:.0f} frames and one more, found "
            f"{counted(clip.frames, 'frame')}. Use a longer clip."
        )
    return cycle.cycle_frames


def _starts(clips: tuple[Clip, Clip], frames: tuple[float, float]) -> tuple[float, float]:
    """Where stretches of these lengths begin such that poses at even shares of them are most alike."""
    apart = window_distances(point_cloud(clips[0]), point_cloud(clips[1]), 1)
    shares = np.linspace(0.0, 1.0, round(max(frames)) + 1)
    rows, columns = (
        np.arange(int(clip.frames - 1 - length) + 1)[:, None] + (length * shares + 0.5).astype(np.int64)
        for clip, length in zip(clips, frames, strict=True)
    )
    costs = np.array(
        [apart[np.minimum(row, len(apart) - 1), columns.clip(max=apart.shape[1] - 1)].mean(1) for row in rows]
    )
    first, second = np.unravel_index(int(np.argmin(costs)), costs.shape)
    return float(first), float(second)


def mixed(pair: InStep, share: float, name: str = "") -> Clip:
    """A clip at the frame rate of both, with so much of the fast one in it, from 0 to 1."""
    curve = np.linspace(0.0, 1.0, _FINE * round(max(pair.frames)) + 1)
    slow, fast = pair.times(curve)
    clock = (1.0 - share) * (slow - slow[0]) + share * (fast - fast[0])
    places = np.interp(np.arange(int(clock[-1] + 1e-9) + 1), clock, curve)
    a, b = (
        sample(clip, np.minimum(at, clip.frames - 1)) for clip, at in zip(pair.clips, pair.times(places), strict=True)
    )
    count = len(places) - 2  # the first and the last pose are the margins that a blend has
    made = join(
        a,
        b,
        Stretch(a, True, True),
        Stretch(b, True, True),
        (1, count + 1),
        (1, count + 1),
        np.full(count, share),
        np.full((count, a.skeleton.joints), share),
        f"{counted(pair.cycles, 'gait cycle')} of both in step, {100 * share:.0f}% of the second",
    )
    clip = picked(made.clip, slice(1, count + 1))
    return replace(clip, name=name or made.clip.name)
