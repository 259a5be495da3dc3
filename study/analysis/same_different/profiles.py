"""Intervals of the just noticeable difference by profile likelihood of the differencing model: counts in."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from study.analysis.estimates import Interval, normal_quantile
from study.analysis.same_different.counts import SIDES, Counts, Side, frames_by_side
from study.analysis.same_different.fits import LARGEST_LAPSE, Fits, fit, threshold_frames
from study.analysis.scoring import maximise
from study.models.differencing import probability_different, threshold_delta

FloatArray = NDArray[np.float64]

PROFILE_POINTS = 41
WIDEST_PROFILE = 4.0


def profile_intervals(counts: Counts, level: float = 0.75, confidence: float = 0.95) -> dict[Side, Interval]:
    """Return intervals of the just noticeable difference by profile likelihood, by side; all answers as independent.

    Where participants differ these are too narrow: the jackknife's are given alongside. An end beyond the levels shown
    is open.
    """
    present = counts.shown.sum(axis=0) > 0
    differences = counts.differences[present]
    frames, sides = frames_by_side(differences)
    different, shown = counts.different[:, present].sum(axis=0), counts.shown[:, present].sum(axis=0)
    if not sides or not (differences == 0).any() or different.sum() in (0, shown.sum()):
        return {}
    best = fit(frames, different[None], shown[None])
    found = threshold_frames(best, "different", level)[0]
    return {
        SIDES[side]: _profile(frames, different, shown, best, place, float(found[place]), level, confidence)
        for place, side in enumerate(sides)
    }


def _profile(
    frames: FloatArray,
    different: FloatArray,
    shown: FloatArray,
    best: Fits,
    place: int,
    found: float,
    level: float,
    confidence: float,
) -> Interval:
    largest = float(frames[:, place].max())
    if not math.isfinite(found) or found <= 0 or best.held[0, 2 + place]:
        return Interval(None, None, confidence)
    reach = normal_quantile(confidence)
    line = np.exp(np.linspace(math.log(found / WIDEST_PROFILE), math.log(found * WIDEST_PROFILE), PROFILE_POINTS))
    for _ in range(2):
        value = _held_at(line, frames, different, shown, best, place, level)
        root = np.sqrt(np.maximum(2 * (max(float(best.log_likelihood[0]), float(value.max())) - value), 0.0))
        below, above = line <= found, line >= found
        low = _end(line[below][::-1], root[below][::-1], reach)
        high = _end(line[above], root[above], reach)
        inner = [low / 1.1 if low else line[0], high * 1.1 if high else line[-1]]
        line = np.exp(np.linspace(math.log(inner[0]), math.log(inner[1]), PROFILE_POINTS))
    return Interval(low, high if high is not None and high <= largest else None, confidence)


def _end(line: FloatArray, root: FloatArray, reach: float) -> float | None:
    """Where the root of the likelihood ratio first exceeds `reach`, going outwards; None where it does not."""
    beyond = np.flatnonzero(root > reach)
    if not len(beyond):
        return None
    at = int(beyond[0])
    if at == 0:
        return float(line[0])
    part = (reach - root[at - 1]) / (root[at] - root[at - 1])
    return float(line[at - 1] + part * (line[at] - line[at - 1]))


def _held_at(
    line: FloatArray,
    frames: FloatArray,
    different: FloatArray,
    shown: FloatArray,
    best: Fits,
    place: int,
    level: float,
) -> FloatArray:
    """The largest log likelihood with the threshold of one side held at each point of a line."""
    others = [other for other in range(frames.shape[1]) if other != place]

    def whole(point: FloatArray, rows: NDArray[np.intp]) -> FloatArray:
        criterion, lapse = np.exp(point[:, 0]), point[:, 1]
        delta = threshold_delta(criterion, lapse, "different", level)
        slopes = np.empty((len(point), frames.shape[1]))
        slopes[:, others] = point[:, 2:]
        slopes[:, place] = np.log(np.clip(delta, 1e-6, 1e3) / line[rows])
        return np.column_stack([point[:, :2], slopes])

    def share(point: FloatArray, rows: NDArray[np.intp]) -> FloatArray:
        full = whole(point, rows)
        found = probability_different(frames, np.exp(full[:, 0]), full[:, 1], np.exp(full[:, 2:]))
        return np.clip(found, 1e-9, 1 - 1e-9)

    def value(point: FloatArray, rows: NDArray[np.intp]) -> FloatArray:
        p = share(point, rows)
        return np.asarray((different * np.log(p) + (shown - different) * np.log1p(-p)).sum(axis=1), dtype=np.float64)

    def scores(point: FloatArray, rows: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        p, step = share(point, rows), 1e-5
        by = np.empty((*p.shape, point.shape[1]))
        for axis in range(point.shape[1]):
            moved = np.zeros(point.shape[1])
            moved[axis] = step
            by[:, :, axis] = (share(point + moved, rows) - share(point - moved, rows)) / (2 * step)
        variance = p * (1 - p)
        gradient = np.einsum("bl,blp->bp", (different - shown * p) / variance, by)
        return gradient, np.einsum("bl,blp,blq->bpq", shown / variance, by, by)

    start = np.concatenate([np.log(best.criterion[:1]), best.lapse[:1], np.log(best.slopes[0, others])])
    largest = frames.max(axis=0)[others]
    low = np.concatenate([[math.log(1e-3), 0.0], np.log(0.02 / largest)])
    high = np.concatenate([[math.log(9.0), LARGEST_LAPSE], np.log(40.0 / largest)])
    return maximise(value, scores, np.tile(start, (len(line), 1)), low, high, steps=60).value
