"""Cuts worth a person's judgement: the best, the worst and random ones of two clips, by several metrics.

In: two clips and a generator. Out: `Candidate`s in random order, so that whoever labels them can't tell what a metric
thought. They serve the training set of Wang & Bodenheimer 2003, section 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from study.arrays import AnyFloat
from study.errors import TransitionError
from study.motion.clip import Clip, retarget
from study.transitions.cost_matrix import WINDOW_S, cost_matrix
from study.transitions.point_cloud import point_cloud, window_distances

METRICS = ("lee2002", "wang2003", "pointcloud")

# Least distance between candidates of one kind and metric, and between frames of one clip that a cut joins; seconds.
APART_S = 0.4


@dataclass(frozen=True)
class Candidate:
    """A cut, and how it was found, such as `best lee2002`."""

    source_frame: int
    destination_frame: int
    found: str


def candidates(
    source: Clip,
    destination: Clip,
    rng: np.random.Generator,
    *,
    best: int = 2,
    worst: int = 1,
    at_random: int = 2,
    margin_s: float = 0.5,
) -> tuple[Candidate, ...]:
    """Cuts to label.

    Of two clips of one rig at one frame rate, so many `best` and `worst` by each metric, and so many `at_random` in
    all. A cut leaves `margin_s` seconds of each clip to be seen; less where a clip is short. `TransitionError` for
    clips of under four frames.
    """
    rows, columns = _shown(source, margin_s, after=False), _shown(destination, margin_s, after=True)
    found: dict[tuple[int, int], str] = {}
    for metric in METRICS:
        costs = frame_costs(source, destination, metric)[rows.start : rows.stop, columns.start : columns.stop]
        for kind, count, order in (("best", best, costs), ("worst", worst, -costs)):
            for row, column in _least_apart(order, count, round(APART_S * source.fps)):
                key = (rows.start + row, columns.start + column)
                found[key] = f"{found[key]}, {kind} {metric}" if key in found else f"{kind} {metric}"
    for _ in range(at_random):
        key = (int(rng.integers(rows.start, rows.stop)), int(rng.integers(columns.start, columns.stop)))
        found.setdefault(key, "random")
    listed = [Candidate(*key, words) for key, words in found.items()]
    return tuple(listed[at] for at in rng.permutation(len(listed)))


def _shown(clip: Clip, margin_s: float, *, after: bool) -> range:
    """Frames of a clip at which a cut leaves a margin before it (or after it)."""
    if clip.frames < 4:
        raise TransitionError(f"Expected clips of at least 4 frames to cut, got {clip.frames} in {clip.name!r}.")
    margin = min(round(margin_s * clip.fps), clip.frames // 2)
    return range(1, clip.frames - margin) if after else range(margin, clip.frames - 1)


def frame_costs(source: Clip, destination: Clip, metric: str) -> AnyFloat:
    """What a metric of `METRICS` says of a cut between all frames of two clips, `(frames, frames)`.

    Of a clip with itself, frames within 0.4 s of each other have the median: they are no transition. So have frames
    without a whole window around them, for the point cloud.
    """
    costs: AnyFloat
    if metric == "pointcloud":
        costs = _centred_windows(source, destination)
    else:
        costs = cost_matrix(source, destination, weights=metric)
    if source is destination:
        # Frames next to each other are no transition: neither best nor worst.
        frames = np.arange(source.frames)
        near = np.abs(frames[:, None] - frames) < APART_S * source.fps
        costs[near] = np.median(costs)
    return costs


def _centred_windows(source: Clip, destination: Clip) -> AnyFloat:
    """Point cloud distances of the windows around all frames; the median for frames without a whole window."""
    window = min(max(1, round(WINDOW_S * source.fps)), source.frames, destination.frames)
    found = window_distances(point_cloud(source), point_cloud(retarget(destination, source.skeleton)), window)
    costs = np.full((source.frames, destination.frames), np.median(found))
    first = window // 2
    costs[first : first + found.shape[0], first : first + found.shape[1]] = found
    return costs


def _least_apart(costs: AnyFloat, count: int, apart: int) -> list[tuple[int, int]]:
    """The `count` least entries of which no two are within `apart` rows and columns of each other."""
    left = costs.copy()
    chosen = []
    for _ in range(count):
        row, column = (int(n) for n in np.unravel_index(int(np.argmin(left)), left.shape))
        if not np.isfinite(left[row, column]):
            break
        chosen.append((row, column))
        left[max(row - apart, 0) : row + apart + 1, max(column - apart, 0) : column + apart + 1] = np.inf
    return chosen
