"""The just noticeable difference as published: counts of a same-different task in, thresholds out.

2004 section 5.1, Figure 6: where linear interpolation between percentages "different" crosses 75%, shorter and longer.
The differencing model (`model`) is given alongside, since linear interpolation is biased for a curved function, and its
crossing moves with the false-alarm rate.

Intervals take the participant as the unit. A threshold outside the levels shown is reported as outside, never computed.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from study.analysis import estimates
from study.analysis.same_different.counts import FEWEST_FOR_INTERVAL, SIDES, Counts, Side, Threshold, percentages
from study.arrays import FloatArray


def crossing_of_lines(sizes: FloatArray, shares: FloatArray, level: float = 0.75) -> FloatArray:
    """Return where linear interpolation between points first reaches `level`, going away from no difference.

    Parameters
    ----------
    sizes : ndarray, shape (levels,)
        Size of the difference, rising from 0 or from the smallest shown.
    shares : ndarray, shape (..., levels)
        Share of "different".

    Returns
    -------
    ndarray, shape (...)
        Infinite where the level is never reached, 0 where the first point is at or above it already.
    """
    reached = shares >= level
    first = np.argmax(reached, axis=-1)
    after, before = first[..., None], np.maximum(first - 1, 0)[..., None]
    low, high = np.take_along_axis(shares, before, -1)[..., 0], np.take_along_axis(shares, after, -1)[..., 0]
    rise = np.where(high > low, high - low, 1.0)
    place = sizes[before[..., 0]] + (level - low) / rise * (sizes[first] - sizes[before[..., 0]])
    found = np.where(first == 0, 0.0, place)
    return np.asarray(np.where(reached.any(axis=-1), found, np.inf), dtype=np.float64)


def _levels_of(counts: Counts, side: Side) -> NDArray[np.intp]:
    """Indices of the levels on one side with answers, from no difference outwards."""
    sign = -1.0 if side == "shorter" else 1.0
    sizes = sign * counts.differences
    wanted = np.flatnonzero((sizes >= 0) & (counts.shown.sum(axis=0) > 0))
    return wanted[np.argsort(sizes[wanted], kind="stable")]


def _weighted_means(shares: FloatArray, weights: FloatArray) -> FloatArray:
    """Means over participants of shares (participants, levels), weights (samples, participants); NaN ignored."""
    known = np.isfinite(shares)
    total = weights @ known.astype(np.float64)
    return np.asarray((weights @ np.where(known, shares, 0.0)) / np.where(total > 0, total, np.nan), dtype=np.float64)


def crossings(
    counts: Counts,
    *,
    level: float = 0.75,
    confidence: float = 0.95,
    resamples: int = 2000,
    rng: np.random.Generator | None = None,
) -> dict[Side, Threshold]:
    """Return the 75% crossings by linear interpolation on both sides (2004 Figure 6).

    Parameters
    ----------
    level
        Share of "different" at threshold.
    confidence, resamples
        Of the bootstrap over participants.
    rng
        Source of the bootstrap samples; seeded with 0 by default, so that a report repeats.

    Notes
    -----
    The interval holds every difference whose interpolated percentage does not differ significantly from `level`
    (Student's t over participants; Fieller's method); the standard error is the bootstrap's. Both describe the crossing
    by linear interpolation through the true percentages, which is not quite where a smooth curve crosses.
    """
    rng = rng or np.random.default_rng(0)
    count = len(counts.participants)
    weights = estimates.resampled_weights(count, resamples, rng) if count else np.zeros((0, 0))
    return {side: _line_threshold(counts, side, level, confidence, weights) for side in SIDES}


def _line_threshold(counts: Counts, side: Side, level: float, confidence: float, weights: FloatArray) -> Threshold:
    method = "linear interpolation between levels; interval over participants (Fieller)"
    unknown = estimates.Interval(None, None, confidence)
    wanted = _levels_of(counts, side)
    sizes = np.abs(counts.differences[wanted])
    if not (sizes > 0).any():
        return Threshold(side, None, None, unknown, "not estimable", method, f"no pair was {side}")
    shares = percentages(counts)[:, wanted]
    means = _weighted_means(shares, np.ones((1, len(shares))))[0]
    found = float(crossing_of_lines(sizes, means, level))
    interval, caution = _fieller(sizes, shares, level, confidence)
    if not math.isfinite(found):
        note = f"not reached within the levels shown (largest {sizes[-1]:g} frames: {100 * means[-1]:.0f}%)"
        return Threshold(side, None, None, interval, "not reached", method, note)
    if found <= 0.0 and means[0] >= level:
        note = f"{100 * means[0]:.0f}% at the smallest difference shown ({sizes[0]:g} frames): no crossing to find"
        return Threshold(side, None, None, unknown, "above", method, note)
    error = None
    if len(shares) >= FEWEST_FOR_INTERVAL:
        resampled = crossing_of_lines(sizes, np.nan_to_num(_weighted_means(shares, weights)), level)
        error = bootstrap_error(resampled)
    if len(shares) >= FEWEST_FOR_INTERVAL and None in (interval.low, interval.high):
        ends = [word for word, end in (("below", interval.low), ("above", interval.high)) if end is None]
        open_end = f"open {' and '.join(ends)}: no level shown there differs significantly from {100 * level:g}%"
        caution = "; ".join(filter(None, [caution, f"the interval is {open_end}"]))
    if (np.diff(means) < 0).any():
        caution = "; ".join(filter(None, [caution, "percentages do not rise throughout: the first crossing is given"]))
    return Threshold(side, found, error, interval, "reached", method, caution)


def bootstrap_error(resampled: FloatArray) -> float | None:
    """Bootstrap standard error; None where more than one sample in twenty has no threshold."""
    known = resampled[np.isfinite(resampled)]
    if len(known) < 0.95 * len(resampled) or len(known) < 2:
        return None
    return float(known.std(ddof=1))


def _fieller(sizes: FloatArray, shares: FloatArray, level: float, confidence: float) -> tuple[estimates.Interval, str]:
    """Differences at which the interpolated mean does not differ significantly from `level`, and a caution.

    Where all participants agree the spread can't be seen; it is then taken from two answers more, one of each kind.
    """
    count = len(shares)
    if count < FEWEST_FOR_INTERVAL:
        return estimates.Interval(None, None, confidence), "one participant: no interval over participants"
    grid = np.unique(np.concatenate([sizes, np.linspace(sizes[0], sizes[-1], 2001)]))
    right = np.clip(np.searchsorted(sizes, grid, side="left"), 1, len(sizes) - 1) if len(sizes) > 1 else None
    if right is None:
        return estimates.Interval(None, None, confidence), "one level only"
    share = (grid - sizes[right - 1]) / (sizes[right] - sizes[right - 1])
    mixed = shares[:, right - 1] * (1 - share) + shares[:, right] * share
    known = np.isfinite(mixed)
    number = known.sum(axis=0)
    mean = np.where(known, mixed, 0.0).sum(axis=0) / np.maximum(number, 1)
    variance = (np.where(known, mixed - mean, 0.0) ** 2).sum(axis=0) / np.maximum(number - 1, 1) / np.maximum(number, 1)
    guarded = (mean * number + 1) / (number + 2)
    variance = np.where(variance < 1e-12, guarded * (1 - guarded) / (number + 2), variance)
    numbers, where = np.unique(number, return_inverse=True)
    times = np.array([estimates.t_quantile(confidence, max(int(n) - 1, 1)) for n in numbers])[where]
    half = times * np.sqrt(variance)
    surely_below, surely_above = mean + half < level, mean - half > level
    # From outside in: below the low end all is surely under the level, above the high end all is surely over it.
    low_place = int(np.argmax(~surely_below))
    high_place = len(grid) - 1 - int(np.argmax(~surely_above[::-1]))
    low = None if not surely_below[0] else float(grid[low_place]) if not surely_below.all() else float(grid[-1])
    high = None if not surely_above[-1] else float(grid[high_place])
    return estimates.Interval(low, high, confidence), ""
