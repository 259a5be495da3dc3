"""The differencing model of a same-different task: sensitivity and criterion in, the chance of "different" out.

A participant sees two transitions, takes the difference of two noisy impressions, and answers "different" where it
exceeds a criterion (Noreen 1981; Macmillan & Creelman 2005, chapter 9). With impressions of unit variance, `delta` of
them between the two means and the criterion `tau`,

    q(delta) = Phi((delta - tau) / sqrt 2) + Phi((-delta - tau) / sqrt 2)
    P("different") = lapse / 2 + (1 - lapse) q(delta),

where lapses are answers given by tossing a coin.
"""

from __future__ import annotations

from functools import cache
from typing import Literal

import numpy as np

from study.arrays import FloatArray

Kind = Literal["different", "criterion_free"]

ROOT_TWO = float(np.sqrt(2.0))
WIDEST_DELTA = 60.0
MOST_STEPS = 100


def detected(delta: FloatArray, criterion: float | FloatArray) -> FloatArray:
    """Return q(delta): the probability of "different" of an observer who never lapses."""
    from scipy.special import ndtr

    share: FloatArray = ndtr((delta - criterion) / ROOT_TWO) + ndtr((-delta - criterion) / ROOT_TWO)
    return share


def probability_different(
    frames: FloatArray, criterion: FloatArray, lapse: FloatArray, slopes: FloatArray
) -> FloatArray:
    """Return P("different"), shape (fits, levels).

    Parameters
    ----------
    frames : ndarray, shape (levels, slopes)
        Size of the difference in the column of the slope that it belongs to, 0 in the other columns.
    criterion, lapse : ndarray, shape (fits,)
    slopes : ndarray, shape (fits, slopes)
    """
    share = detected(slopes @ frames.T, criterion[:, None])
    return lapse[:, None] / 2 + (1 - lapse[:, None]) * share


def density(value: FloatArray) -> FloatArray:
    """Return the standard normal density."""
    return np.asarray(np.exp(-0.5 * value * value) / np.sqrt(2 * np.pi), dtype=np.float64)


@cache
def criterion_free_delta(correct: float) -> float:
    """Return the d-prime at which an observer with the best criterion is right in this share of the pairs.

    Half of the pairs have no difference, half have this one (Macmillan & Creelman 2005, p. 222: the greatest share of
    correct answers under the differencing rule). Sensitivity alone decides it: no observer's own criterion enters.
    """
    from scipy.optimize import brentq

    return float(brentq(lambda delta: best_correct(np.full(1, delta), np.zeros(1)) - correct, 0.1, 10.0, xtol=1e-10))


def best_correct(different: FloatArray, same: FloatArray) -> float:
    """Return the share of right answers of an observer with the best criterion, where half of the pairs differ.

    Parameters
    ----------
    different, same : ndarray, shape (pairs,)
        Distance of the percepts' means, in standard deviations of one percept, in each of the pairs that are different
        and in each of those that are the same; the latter is 0 unless something else than what is judged differs.
    """
    criteria = np.linspace(0.0, 8.0 + float(np.abs(different).max()), 4001)
    hits, alarms = (detected(np.abs(part)[:, None], criteria).mean(axis=0) for part in (different, same))
    return float(0.5 + 0.5 * (hits - alarms).max())


def threshold_delta(criterion: FloatArray, lapse: FloatArray, kind: Kind, level: float = 0.75) -> FloatArray:
    """Return the d-prime at threshold, shape (fits,).

    `different`: this share of the answers is "different". `criterion_free`: `criterion_free_delta`.
    0 where the pairs with no difference are above it already, infinite where the lapses keep the curve below it.
    """
    if kind == "criterion_free":  # up to one half is right by guessing
        return np.full(len(criterion), criterion_free_delta(level) if level > 0.5 else 0.0)
    alarms = lapse / 2 + (1 - lapse) * detected(np.zeros(1), criterion)
    reached = (alarms < level) & (level < 1 - lapse / 2)
    found = np.zeros(len(criterion))
    found[reached] = _delta_detected(((level - lapse / 2) / (1 - lapse))[reached], criterion[reached])
    return np.asarray(np.where(level >= 1 - lapse / 2, np.inf, found), dtype=np.float64)


def _delta_detected(share: FloatArray, criterion: FloatArray) -> FloatArray:
    """The d-prime that is detected in this share of the trials, shape (fits,): Newton's steps, kept between bounds."""
    from scipy.special import ndtri

    low, high = np.zeros(len(criterion)), np.full(len(criterion), WIDEST_DELTA)
    # Where the far tail is left out, which is right but for small criteria.
    delta = np.clip(criterion + ROOT_TWO * ndtri(share), 0.1, WIDEST_DELTA)
    for _ in range(MOST_STEPS):
        off = detected(delta, criterion) - share
        low, high = np.where(off < 0, delta, low), np.where(off < 0, high, delta)
        above, below = density((delta - criterion) / ROOT_TWO), density((delta + criterion) / ROOT_TWO)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = delta - off * ROOT_TWO / (above - below)
        following = np.where((step > low) & (step < high), step, (low + high) / 2)
        settled = np.abs(following - delta) <= 1e-12 * delta
        delta = np.where(off == 0, delta, following)
        if (settled | (np.abs(off) < 1e-15)).all():
            break
    return delta
