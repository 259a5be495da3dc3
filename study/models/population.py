"""Participants of a same-different task who differ from one another: an observer's parameters in, chances out.

Each decides by the differencing model: a difference of `n` frames moves the percepts apart by `n` times the observer's
d' a frame, which differs between shorter and longer blends.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from study.arrays import FloatArray
from study.errors import SessionError
from study.models.detection import said_yes
from study.models.differencing import detected
from study.models.forced import Forced

LEAST_CRITERION = 0.2
"""No participant's criterion lies below this: at 0 a person would say "different" always."""


@dataclass(frozen=True)
class SameDifferentObserver:
    """Same-different by the differencing model."""

    d_prime_shorter: float
    d_prime_longer: float
    """`d_prime_shorter`, `d_prime_longer`: sensitivity a frame of difference, for comparisons shorter and longer
    than the reference; above 0."""
    criterion: float = 2.0
    """Distance of percepts beyond which the answer is "different", in noise units; above 0."""
    lapse: float = 0.02
    """Proportion of trials answered without having looked, half of them "different"."""
    log_sensitivity_sd: float = 0.15
    criterion_sd: float = 0.15
    """`log_sensitivity_sd`, `criterion_sd`: how participants differ: standard deviations of the logarithm of both
    sensitivities together, and of the criterion."""


def probability_different(observer: SameDifferentObserver, difference_frames: float | FloatArray) -> FloatArray:
    """Probability of "different" for one observer without deviations, in the shape of the differences."""
    return _with_lapses(detected(_d_prime(observer, difference_frames), observer.criterion), observer.lapse)


def probability_found(
    forced: Forced, observer: SameDifferentObserver, difference_frames: float | FloatArray
) -> FloatArray:
    """Probability that one observer is right in a forced choice, in the shape of the differences."""
    return forced.with_lapses(_d_prime(observer, difference_frames), observer.lapse)


def probability_yes(observer: SameDifferentObserver, difference_frames: float | FloatArray) -> FloatArray:
    """Probability that one observer says "yes" in a yes-no task, in the shape of the differences."""
    return said_yes(_d_prime(observer, difference_frames), observer.criterion, observer.lapse)


def visibility(observer: SameDifferentObserver, difference_frames: float) -> float:
    """How visible a difference is to one observer, 0 to 1: how far the chance to tell in two-alternative forced choice
    which of two percepts is larger lies between guessing and certainty, 2 Phi(d' / root 2) - 1.
    """
    from scipy.special import ndtr

    return float(2 * ndtr(_d_prime(observer, difference_frames) / np.sqrt(2.0)) - 1)


def population_different(observer: SameDifferentObserver, difference_frames: float | FloatArray) -> FloatArray:
    """Probability of "different" over all participants: the mean over their sensitivities and criteria."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(31)
    weights = weights / weights.sum()
    sensitivity = np.exp(observer.log_sensitivity_sd * nodes)[:, None]
    criterion = np.maximum(observer.criterion + observer.criterion_sd * nodes, LEAST_CRITERION)[None, :]
    distance = _d_prime(observer, difference_frames)[..., None, None] * sensitivity
    chances = _with_lapses(detected(distance, criterion), observer.lapse)
    return np.asarray(np.einsum("...sc,s,c->...", chances, weights, weights))


def _d_prime(observer: SameDifferentObserver, difference_frames: float | FloatArray) -> FloatArray:
    differences = np.asarray(difference_frames, dtype=np.float64)
    slope = np.where(differences < 0, observer.d_prime_shorter, observer.d_prime_longer)
    return np.asarray(np.abs(differences) * slope)


def _with_lapses(share: FloatArray, lapse: float) -> FloatArray:
    return np.asarray(lapse / 2 + (1 - lapse) * share)


def crossing(observer: SameDifferentObserver, level: float, slope: float) -> float:
    """The difference in frames at which the population reaches a level, at a slope in d' a frame."""
    from scipy.optimize import brentq

    straight = replace(observer, d_prime_shorter=slope, d_prime_longer=slope)

    def above(frames: float) -> float:
        return float(population_different(straight, frames)) - level

    if above(0.0) >= 0 or above(60.0 / slope) <= 0:
        raise SessionError(
            f"Expected an observer that reaches {level:.0%} 'different' at some difference, found "
            f"{level + above(0.0):.1%} at none and {level + above(60.0 / slope):.1%} at most; change the criterion."
        )
    return float(brentq(above, 0.0, 60.0 / slope, xtol=1e-10))
