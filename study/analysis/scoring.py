"""Maximum likelihood by damped Fisher scoring, many data sets at once: functions in, the highest points out.

Bootstrap samples, left-out participants and profiles of a likelihood are many small fits of one model. All of them
step together here; those that have come to rest are left alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.arrays import BoolArray, FloatArray

Rows = NDArray[np.intp]
Value = Callable[[FloatArray, Rows], FloatArray]
Scores = Callable[[FloatArray, Rows], tuple[FloatArray, FloatArray]]

LARGEST_STEP = 1.0


@dataclass(frozen=True, eq=False)
class Maxima:
    """Where the searches came to rest."""

    point: FloatArray
    """`(fits, parameters)`"""
    value: FloatArray
    """`(fits,)`"""
    held: BoolArray
    """`(fits, parameters)`: true where a parameter is at a bound."""
    settled: BoolArray
    """`(fits,)`"""


def maximise(
    value: Value, scores: Scores, start: FloatArray, low: FloatArray, high: FloatArray, steps: int = 200
) -> Maxima:
    """Climb to the maximum of every data set.

    Parameters
    ----------
    value
        Log likelihood of points, shape (rows, parameters), for the data sets of these row numbers.
    scores
        Its gradient and expected information there, shapes (rows, p) and (rows, p, p).
    start : ndarray, shape (fits, parameters)
        First guesses; brought within the bounds.
    low, high : ndarray, shape (parameters,) or (fits, parameters)
        Bounds; equal ones hold a parameter where it is.
    steps
        At most this many.
    """
    low, high = np.broadcast_to(low, start.shape), np.broadcast_to(high, start.shape)
    point = np.clip(start, low, high)
    best = value(point, np.arange(len(point)))
    damping = np.full(len(point), 1e-3)
    settled = np.zeros(len(point), dtype=bool)
    for _ in range(steps):
        now = np.flatnonzero(~settled)
        if not len(now):
            break
        gradient, information = scores(point[now], now)
        step = _step(point[now], damping[now], low[now], high[now], gradient, information)
        proposal = np.clip(point[now] + step, low[now], high[now])
        moved = np.abs(proposal - point[now]).max(axis=1)
        proposed = value(proposal, now)
        gain = proposed - best[now]
        better = gain >= 0
        point[now[better]], best[now[better]] = proposal[better], proposed[better]
        damping[now] = np.where(better, damping[now] / 10, damping[now] * 10)
        settled[now] = (moved < 1e-8) | (better & (gain < 1e-10) & (moved < 1e-4)) | (damping[now] > 1e12)
        damping = np.maximum(damping, 1e-9)
    held = (point <= low + 1e-9) | (point >= high - 1e-9)
    return Maxima(point, best, held, settled)


def _step(
    point: FloatArray,
    damping: FloatArray,
    low: FloatArray,
    high: FloatArray,
    gradient: FloatArray,
    information: FloatArray,
) -> FloatArray:
    """One damped step; parameters that would leave their range from its bound are held."""
    held = ((point <= low) & (gradient < 0)) | ((point >= high) & (gradient > 0)) | (low == high)
    free = (~held).astype(np.float64)
    information = information * free[:, :, None] * free[:, None, :]
    diagonal = np.einsum("bpp->bp", information)
    size = point.shape[1]
    information = information + np.eye(size) * (damping[:, None] * (diagonal + 1e-6) + (1 - free) + 1e-12)[:, None, :]
    step = np.linalg.solve(information, (gradient * free)[:, :, None])[:, :, 0]
    return np.asarray(np.clip(step, -LARGEST_STEP, LARGEST_STEP), dtype=np.float64)
