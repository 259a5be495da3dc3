"""Registration curves: two stretches of motion are brought into step before they are blended.

In: the window of each clip that goes into the blend. Out: how far one has to be ahead of the other in each frame, so
that poses meet that are alike, whenever each occurs; `study.transitions.timewarp.warped_blend` blends them so. Kovar &
Gleicher 2003, "Flexible automatic motion blending with registration curves": a dynamic timewarp of bounded slope over
the distances of point clouds (section 3.1), made smooth and strictly increasing; and poses aligned pair by pair rather
than once (section 3.2). The second comes for free: `study.transitions.blending` mixes how each clip steps and turns in
its own facing, which is such an alignment of every pair.

The 2004 paper (section 3.1.4) warps both windows evenly. Here the ends of the windows are the same, and what lies
between them is warped as the motions ask for; at both ends each clip runs at the rate that it has without a warp.

A game finds the curve once a transition (or beforehand, and keeps a few slopes), 3 ms here for 60 frames. A pose then
costs what that of a plain blend does, and the two places between frames that the curve asks for: `benchmarks/poses.py`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from study.arrays import FloatArray
from study.motion.clip import Clip
from study.transitions.point_cloud import point_cloud, window_distances

STEEPEST = 2.0
"""One clip goes on at most this many times as fast as the other, each as a share of its window."""

_SHORTEST, _FEWEST, _KNOT_FRAMES = 6, 4, 4
"""A blend of so many frames has room for a curve, of so many pieces at least, and of one for so many frames."""
_SMOOTH = 0.03
"""How much a change of its slope from knot to knot counts beside its distance from the path, in the fit."""


@dataclass(frozen=True, eq=False)
class Lead:
    """By how much the destination is ahead of the source where both are in step, in shares of a window.

    `slopes (pieces - 1,)` are those of the curve at even knots between 0 and 1. They add up to 0, and the curve begins
    and ends at 0 and level; between knots its slope runs straight.
    """

    slopes: FloatArray

    def at(self, shares: FloatArray) -> FloatArray:
        """The curve at shares `(n,)` of the blend, from 0 to 1."""
        return np.asarray(_ramps(shares, len(self.slopes) + 1) @ self.slopes)


def _ramps(shares: FloatArray, pieces: int) -> FloatArray:
    """What a slope of 1 at one inner knot alone adds to a curve up to each share, `(shares, pieces - 1)`."""
    since = shares[:, None] * pieces - np.arange(1, pieces)
    rising, falling = np.clip(since + 1.0, 0.0, 1.0), np.clip(since, 0.0, 1.0)
    return np.asarray((rising**2 + falling * (2.0 - falling)) / (2.0 * pieces))


def registration(source: Clip, destination: Clip) -> Lead:
    """The curve that brings two windows into step.

    Parameters
    ----------
    source, destination
        The two windows on one skeleton, as clips of equally many frames, evenly spaced in each.
    """
    ours, theirs = point_cloud(source), point_cloud(destination)
    return smooth_lead(least_path(window_distances(ours, theirs, 1, precision="double")), source.frames - 1)


def least_path(distances: FloatArray) -> FloatArray:
    """The path of least mean distance from the first pair of poses to the last, `(pairs, 2)`, as shares of the windows.

    Parameters
    ----------
    distances : (poses, poses)
        Of the source's poses from the destination's. Each step of the path goes on by one pose in one clip and by one
        or two in the other, which bounds its slope by `STEEPEST`; it counts for as many poses as it goes on by.
    """
    poses = len(distances)
    total = np.full((poses + 1, poses + 1), np.inf)  # a row and a column before the first, which no path enters
    came = np.zeros((poses, poses), dtype=np.int64)
    total[1, 1] = distances[0, 0]
    steps = ((1, 1), (1, 2), (2, 1))
    for row in range(2, poses + 1):
        costs = np.full((3, poses - 1), np.inf)
        for place, (down, across) in enumerate(steps):
            costs[place, across - 1 :] = (
                total[row - down, 1 : poses + 1 - across] + (down + across) * distances[row - 1, across:]
            )
        came[row - 1, 1:] = costs.argmin(axis=0)
        total[row, 2:] = costs.min(axis=0)
    path = [(poses - 1, poses - 1)]
    while path[-1] != (0, 0):
        down, across = steps[came[path[-1]]]
        path.append((path[-1][0] - down, path[-1][1] - across))
    return np.array(path[::-1]) / (poses - 1.0)


def smooth_lead(path: FloatArray, count: int) -> Lead:
    """A smooth, strictly increasing curve near a path, by least squares.

    Parameters
    ----------
    path : (pairs, 2)
        Shares of the windows, as `least_path` gives them.
    count
        Steps of the blend; under 6, too few for a curve, neither is ahead.

    Notes
    -----
    A quadratic spline with even knots. Its slope is a spline of straight pieces, so bounds at the knots bound it
    everywhere.
    """
    pieces = max(_FEWEST, count // _KNOT_FRAMES)
    if count < _SHORTEST:
        return Lead(np.zeros(pieces - 1))
    from scipy.optimize import lsq_linear

    fitted = _ramps(path.mean(axis=1), pieces)
    bends = _SMOOTH * np.diff(np.eye(pieces + 1)[:, 1:-1], axis=0)
    back = 1e3 * np.ones((1, pieces - 1))
    rows = np.concatenate([fitted, bends, back])
    values = np.concatenate([path[:, 1] - path[:, 0], np.zeros(pieces + 1)])
    most = 2.0 * (STEEPEST - 1.0) / (STEEPEST + 1.0)
    found = lsq_linear(rows, values, (-most, most), method="bvls").x
    # What the fit leaves of the sum is taken from each slope as far as its bound lets it.
    left = found.sum()
    room = most + np.sign(left) * found
    return Lead(found - left * room / room.sum())
