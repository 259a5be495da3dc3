"""Whether a clip runs at the speed of life: found from how people step and how bodies fall.

In: a `Clip`. Out: a `Tempo` where its frame time can't be right, else None. A frame time that is several times too long
or too short leaves every pose as it was; only the speed of the motion tells:

- Gait: people take long steps quickly and short ones slowly. The length of a step times its duration is nearly the
  same at all speeds (the walk ratio, Sekiya & Nagasaki 1998; about 0.4 m s for an adult): 0.7 to 1.65 times that in the
  steady steps of the CMU and Bandai walks and runs, from 0.9 to 4.5 m/s. Steps count where they lead straight on and
  the pelvis travels evenly: people who step slowly on purpose, as in tai chi, stop on each foot.
- Falls: nothing drops faster than gravity makes it, and a body in the air drops as fast as that. In the same motions, a
  pelvis takes at least 0.6 times as long as a stone for four centimetres, and 0.75 to 1.7 times as long in the air.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from study.arrays import FloatArray
from study.motion.clip import Clip, joint_positions
from study.motion.feet import foot_points, heading

# Length of a step times its duration, in metres and seconds, of a body with legs so long (metres).
_STEP_MS, _LEG_M = 0.40, 0.85
# Ankles this far apart along the way, as a share of the leg, are a stride; steps shorter than the second tell nothing.
_APART, _SHORTEST_STEP = 0.15, 0.35
# A step leads straight on where the hips turn by less than this (radians) and most of the way lies ahead; it is steady
# where the pelvis's speed varies by no more than this share over its parts.
_STRAIGHT, _AHEAD, _STEADY, _PARTS = 0.2, 0.8, 0.3, 8
# What no gait shows: times the usual, in all steps and in their median.
_SLOW, _SLOW_MEDIAN, _QUICK, _QUICK_MEDIAN = 2.0, 2.6, 0.5, 0.4
# Quick steps are too quick below this many seconds; where there are but two, below the second: tripping into a turn.
_QUICK_S, _TWO_QUICK_S = 0.22, 0.16
# Falls are timed over the first of these (metres); in the air, the lower foot is at least so high above the floor, and
# falls along by so much of it.
_DROP_M, _AIR_M, _ALONG = 0.04, 0.06, 0.5
_GRAVITY = 9.81
_FALLS_QUICK, _FLIGHTS_SLOW = 0.45, 2.6
_FACTORS = (2, 3, 4, 5, 8)


class Tempo(NamedTuple):
    """How many times too long (above 1) or too short (below 1) a clip's frame time is, and what tells so."""

    times: float
    reason: str

    def message(self, fps: float) -> str:
        """The same in words, for a clip with a stated frame rate."""
        size = max(self.times, 1.0 / self.times)
        factor = min(_FACTORS, key=lambda one: abs(np.log(one / size)))
        likely = fps * factor if self.times > 1.0 else fps / factor
        return (
            f"{self.reason}: the frame time seems to be about {factor} times too "
            f"{'long' if self.times > 1.0 else 'short'} ({likely:.5g} fps rather than {fps:.5g}?); "
            "if so, say `fps` in library.toml"
        )


def wrong_tempo(clip: Clip) -> Tempo | None:
    """Whether the motion is too slow or too quick for a body on earth; None where it is not, or can't be determined."""
    if clip.frames < 5 or not clip.skeleton.has("pelvis", "hip", "knee", "ankle"):
        return None
    return _by_steps(clip) or _by_falls(clip)


def _by_steps(clip: Clip) -> Tempo | None:
    durations, lengths = _steady_steps(clip)
    if len(durations) < 2:
        return None
    ratios = durations * lengths / _STEP_MS * (_LEG_M / clip.skeleton.leg_length)
    median = float(np.median(ratios))
    slow = ratios.min() > _SLOW and median > _SLOW_MEDIAN
    duration = float(np.median(durations))
    quick = ratios.max() < _QUICK and median < _QUICK_MEDIAN
    quick = quick and duration < (_QUICK_S if len(ratios) > 2 else _TWO_QUICK_S)
    if not (slow or quick):
        return None
    return Tempo(
        median,
        f"a step of {np.median(lengths):.2f} m takes {duration:.2f} s here, and people about {duration / median:.2f} s",
    )


def _steady_steps(clip: Clip) -> tuple[FloatArray, FloatArray]:
    """Duration (s) and length (m) of the steps that lead straight on at an even speed."""
    roles, leg = clip.skeleton.roles, clip.skeleton.leg_length
    positions, facing = joint_positions(clip), heading(clip)
    ahead = np.stack([np.sin(facing), np.cos(facing)], axis=1)
    apart = np.sum((positions[:, roles["ankle.L"]] - positions[:, roles["ankle.R"]])[:, [0, 2]] * ahead, axis=1)
    # A step lasts from one passing of the feet to the next.
    strides = np.flatnonzero(np.abs(apart) > _APART * leg)
    passing = np.flatnonzero(np.diff(np.sign(apart[strides])))
    times = 0.5 * (strides[passing] + strides[passing + 1])
    pelvis, frames = positions[:, roles["pelvis"]][:, [0, 2]], np.arange(clip.frames)
    durations, lengths = [], []
    for first, last in pairwise(times):
        moments = np.linspace(first, last, _PARTS + 1)
        places = np.stack([np.interp(moments, frames, pelvis[:, axis]) for axis in (0, 1)], axis=1)
        turned = float(np.ptp(np.interp([first, last], frames, facing)))
        middle = float(np.interp(0.5 * (first + last), frames, facing))
        way = places[-1] - places[0]
        length = float(np.linalg.norm(way))
        straight = turned < _STRAIGHT and way @ [np.sin(middle), np.cos(middle)] > _AHEAD * length
        speeds = np.linalg.norm(np.diff(places, axis=0), axis=1)
        if straight and length > _SHORTEST_STEP * leg and np.std(speeds) < _STEADY * np.mean(speeds):
            durations.append((last - first) / clip.fps)
            lengths.append(length)
    return np.array(durations), np.array(lengths)


def _by_falls(clip: Clip) -> Tempo | None:
    height = joint_positions(clip)[:, clip.skeleton.roles["pelvis"], 1]
    lowest = np.min([points[..., 1].min(axis=1) for points in foot_points(clip)], axis=0)
    in_air = lowest > np.quantile(lowest, 0.05) + _AIR_M
    stone = np.sqrt(2.0 * _DROP_M / _GRAVITY)
    falls, flights = [], []
    rises = np.append(np.flatnonzero(np.diff(height) > 0.0), clip.frames)
    for top in np.flatnonzero((height[1:-1] >= height[:-2]) & (height[1:-1] > height[2:])) + 1:
        descent = height[top : rises[np.searchsorted(rises, top)] + 1]
        below = np.flatnonzero(descent < height[top] - _DROP_M)
        if not len(below):
            continue
        bottom = top + int(below[0])
        part = (height[bottom - 1] - height[top] + _DROP_M) / (height[bottom - 1] - height[bottom])
        falls.append(float((bottom - 1 + part - top) / clip.fps / stone))
        if in_air[top] and lowest[top] - lowest[bottom] > _ALONG * _DROP_M:
            flights.append(falls[-1])
    if len(falls) > 1 and (second := sorted(falls)[1]) < _FALLS_QUICK:
        return Tempo(second, f"the body drops {_DROP_M * 100:.0f} cm in {second:.2f} of the time that a stone takes")
    if len(flights) > 1 and (least := min(flights)) > _FLIGHTS_SLOW:
        return Tempo(least, f"in the air, the body drops {_DROP_M * 100:.0f} cm in {least:.1f} times a stone's time")
    return None
