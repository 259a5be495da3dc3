"""The differencing model of a same-different task: counts of "different" in, sensitivity, criterion and thresholds out.

`models.differencing` with `delta` as `slope x frames`: one slope a side (shorter, longer) and one criterion, which the
pairs with no difference pin down. The threshold that 2004 section 5.1 reads off the raw percentages follows from the
curve, and so does one that does not depend on the criterion.

Fits are maximum likelihood by damped Fisher scoring, many data sets at once: bootstrap samples, left-out participants.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from study.analysis.estimates import normal_quantile
from study.analysis.scoring import maximise
from study.arrays import BoolArray, FloatArray
from study.models.differencing import ROOT_TWO, Kind, density, detected, probability_different, threshold_delta

LARGEST_LAPSE = 0.1
SMALLEST_PROBABILITY = 1e-9
WIDEST_D_PRIME = 12.0
D_PRIME_POINTS = 40


@dataclass(frozen=True)
class Fits:
    """Maximum-likelihood fits of many data sets, first axis `fits`."""

    criterion: FloatArray
    """`(fits,)`: size of the felt difference above which the answer is "different", in standard deviations of an
    impression."""
    lapse: FloatArray
    """`(fits,)`: share of answers given blindly, half of them "different"."""
    slopes: FloatArray
    """`(fits, slopes)`: d-prime a frame."""
    log_likelihood: FloatArray
    """`(fits,)`: without the binomial coefficients."""
    held: BoolArray
    """`(fits, 2 + slopes)`: true where a parameter (criterion, lapse, slopes) is at the bound of its range."""
    settled: BoolArray
    """`(fits,)`: whether the search came to rest."""


def fit(frames: FloatArray, different: FloatArray, shown: FloatArray, *, lapse: float | None = None) -> Fits:
    """Fit many data sets by maximum likelihood.

    Parameters
    ----------
    frames : ndarray, shape (levels, slopes)
        As in `probability_different`, at least 0.
    different, shown : ndarray, shape (fits, levels)
        Counts of answers "different", and of all answers.
    lapse
        The lapse rate, held; sought from 0 to `LARGEST_LAPSE` where it is None.

    Notes
    -----
    Criterion and slopes are searched as logarithms within wide bounds, so that "can't tell at all" and "never wrong"
    end at a bound, which `Fits.held` tells, and are no failure.
    """
    low, high = _bounds(frames, lapse)
    found = maximise(
        lambda point, rows: _log_likelihood(point, frames, different[rows], shown[rows]),
        lambda point, rows: _scores(point, frames, different[rows], shown[rows]),
        _start(frames, different, shown),
        low,
        high,
    )
    point = found.point
    return Fits(np.exp(point[:, 0]), point[:, 1].copy(), np.exp(point[:, 2:]), found.value, found.held, found.settled)


def _bounds(frames: FloatArray, lapse: float | None) -> tuple[FloatArray, FloatArray]:
    """Bounds of log criterion, lapse and log slopes: d-prime at the largest difference from 0.02 to 40."""
    largest = np.maximum(frames.max(axis=0), 1e-9)
    lapses = (0.0, LARGEST_LAPSE) if lapse is None else (lapse, lapse)
    low = np.concatenate([[np.log(1e-3), lapses[0]], np.log(0.02 / largest)])
    high = np.concatenate([[np.log(9.0), lapses[1]], np.log(40.0 / largest)])
    return low, high


def _start(frames: FloatArray, different: FloatArray, shown: FloatArray) -> FloatArray:
    """First guesses: the criterion from the pairs with no difference, slopes from percentages turned into d-prime."""
    from scipy.special import ndtri

    share = (different + 0.5) / (shown + 1)
    nothing = frames.sum(axis=1) == 0
    alarms = (different[:, nothing].sum(axis=1) + 0.5) / (shown[:, nothing].sum(axis=1) + 1)
    criterion = np.maximum(-ROOT_TWO * ndtri(alarms / 2), 0.1)
    delta = np.maximum(criterion[:, None] + ROOT_TWO * ndtri(share), 0.05)
    weighted = shown[:, :, None] * frames[None]
    slopes = (weighted * delta[:, :, None]).sum(axis=1) / np.maximum((weighted * frames[None]).sum(axis=1), 1e-9)
    return np.column_stack([np.log(criterion), np.full(len(share), 0.02), np.log(np.maximum(slopes, 1e-9))])


def _probability_at(point: FloatArray, frames: FloatArray) -> FloatArray:
    share = probability_different(frames, np.exp(point[:, 0]), point[:, 1], np.exp(point[:, 2:]))
    return np.clip(share, SMALLEST_PROBABILITY, 1 - SMALLEST_PROBABILITY)


def _log_likelihood(point: FloatArray, frames: FloatArray, different: FloatArray, shown: FloatArray) -> FloatArray:
    share = _probability_at(point, frames)
    total: FloatArray = (different * np.log(share) + (shown - different) * np.log1p(-share)).sum(axis=1)
    return total


def _slopes_of_probability(point: FloatArray, frames: FloatArray) -> FloatArray:
    """Derivatives of P("different") by log criterion, lapse and log slopes, shape (fits, levels, 2 + slopes)."""
    criterion, lapse, slopes = np.exp(point[:, :1]), point[:, 1:2], np.exp(point[:, 2:])
    delta = slopes @ frames.T
    above, below = density((delta - criterion) / ROOT_TWO), density((delta + criterion) / ROOT_TWO)
    by_criterion = -(1 - lapse) * (above + below) / ROOT_TWO * criterion
    by_lapse = 0.5 - detected(delta, criterion)
    by_delta = (1 - lapse) * (above - below) / ROOT_TWO
    by_slopes = by_delta[:, :, None] * frames[None] * slopes[:, None, :]
    return np.concatenate([by_criterion[:, :, None], by_lapse[:, :, None], by_slopes], axis=2)


def _scores(
    point: FloatArray, frames: FloatArray, different: FloatArray, shown: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Gradient of the log likelihood and expected information, shapes (fits, p) and (fits, p, p)."""
    share = _probability_at(point, frames)
    variance = share * (1 - share)
    slopes = _slopes_of_probability(point, frames)
    gradient = np.einsum("bl,blp->bp", (different - shown * share) / variance, slopes)
    information = np.einsum("bl,blp,blq->bpq", shown / variance, slopes, slopes)
    return gradient, information


# Thresholds


def threshold_frames(fits: Fits, kind: Kind = "different", level: float = 0.75) -> FloatArray:
    """Return the threshold of every slope in frames, shape (fits, slopes); infinite where it is never reached."""
    delta = threshold_delta(fits.criterion, fits.lapse, kind, level)[:, None]
    return np.asarray(np.where(np.isfinite(delta), delta / fits.slopes, np.inf), dtype=np.float64)


# One table of hits and false alarms


def d_prime_interval(
    hits: float, different_pairs: float, alarms: float, same_pairs: float, confidence: float = 0.95
) -> tuple[float, float | None]:
    """Return the interval of d-prime by profile likelihood, answers taken as independent; None for an open upper end.

    Parameters
    ----------
    hits, different_pairs
        Answers "different" of all answers where there was a difference.
    alarms, same_pairs
        The same where there was none; pairs of both kinds are needed.
    """
    frames, reach = np.array([[0.0], [1.0]]), normal_quantile(confidence)
    counts = (np.array([alarms, hits], dtype=np.float64), np.array([same_pairs, different_pairs], dtype=np.float64))
    found = fit(frames, counts[0][None], counts[1][None], lapse=0.0)
    near = np.linspace(-6, 6, D_PRIME_POINTS) * float(np.sqrt(covariance(found, frames, *counts)[2, 2]))
    line = np.concatenate([[1e-3], np.exp(np.linspace(np.log(0.03), np.log(WIDEST_D_PRIME), D_PRIME_POINTS))])
    line = np.concatenate([line, np.clip(found.slopes[0, 0] * np.exp(np.clip(near, -9, 9)), 1e-3, WIDEST_D_PRIME)])
    line = np.unique(line)
    different, shown = (np.tile(row, (len(line), 1)) for row in counts)
    low, high = _bounds(frames, 0.0)
    low, high = np.tile(low, (len(line), 1)), np.tile(high, (len(line), 1))
    low[:, 2] = high[:, 2] = np.log(line)
    value = maximise(
        lambda point, rows: _log_likelihood(point, frames, different[rows], shown[rows]),
        lambda point, rows: _scores(point, frames, different[rows], shown[rows]),
        _start(frames, different, shown),
        low,
        high,
        steps=25,  # those that take longer lie where the likelihood is lowest
    ).value
    best = max(float(found.log_likelihood[0]), float(value.max()))
    root = np.sqrt(np.maximum(2 * (best - value), 0.0))
    inside = np.flatnonzero(root <= reach)
    first, last = int(inside[0]), int(inside[-1])
    lower = 0.0 if first == 0 else float(np.interp(reach, root[[first, first - 1]], line[[first, first - 1]]))
    if last == len(line) - 1:
        return lower, None
    return lower, float(np.interp(reach, root[[last, last + 1]], line[[last, last + 1]]))


# Covariance


def covariance(fits: Fits, frames: FloatArray, different: FloatArray, shown: FloatArray) -> FloatArray:
    """Return the covariance of log criterion, lapse and log slopes of one fit, all answers taken as independent.

    Parameters
    ----------
    fits
        One fit (the first is used).
    frames : ndarray, shape (levels, slopes)
    different, shown : ndarray, shape (levels,)
        What it was fitted to.

    Returns
    -------
    ndarray, shape (2 + slopes, 2 + slopes)
        Inverse of the expected information. A parameter at its bound has neither variance nor covariance: what is
        given holds with that parameter fixed.
    """
    point = np.concatenate([np.log(fits.criterion[:1]), fits.lapse[:1], np.log(fits.slopes[0])])[None]
    free = np.flatnonzero(~fits.held[0])
    _, information = _scores(point, frames, different[None], shown[None])
    result = np.zeros(information.shape[1:])
    result[np.ix_(free, free)] = np.linalg.pinv(information[0][np.ix_(free, free)])
    return result


def log_threshold_gradient(fits: Fits, kind: Kind, level: float = 0.75) -> FloatArray:
    """Return derivatives of the log threshold by log criterion, lapse and log slopes, shape (slopes, 2 + slopes)."""
    step = 1e-5
    criterion = fits.criterion[0] * np.exp(np.array([step, -step, 0, 0]))
    lapse = fits.lapse[0] + np.array([0, 0, step, -step])
    log_delta = np.log(threshold_delta(criterion, lapse, kind, level))
    slopes = fits.slopes.shape[1]
    gradient = np.zeros((slopes, 2 + slopes))
    gradient[:, 0] = (log_delta[0] - log_delta[1]) / (2 * step)
    gradient[:, 1] = (log_delta[2] - log_delta[3]) / (2 * step)
    gradient[:, 2:] = -np.eye(slopes)
    return gradient
