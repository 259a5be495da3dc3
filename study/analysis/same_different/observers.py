"""The marginal likelihood of a same-different study in which observers differ: counts in, its highest point out.

The integral over people is a sum over an even grid of standard scores, which is exact to rounding as long as the grid
is finer than what the answers of one participant tell (Trefethen & Weideman 2014). The model is that of `mixed`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from study.analysis.same_different import fits
from study.analysis.same_different.counts import SIDES, Counts, Side, frames_by_side
from study.arrays import BoolArray, FloatArray, IntArray
from study.models.differencing import ROOT_TWO, density, detected

FARTHEST_SCORE = 4.2
COARSEST_STEP = 0.35
LARGEST_SPREAD = 1.5
ALIKE = 1e-3
AVOIDANCE = 0.5
REACH = 1.0
UNABLE = 3.0


@dataclass(frozen=True, eq=False)
class People:
    """Counts by participant, the regressors, and the grid of standard scores with the logarithms of its masses."""

    frames: FloatArray
    different: FloatArray
    shown: FloatArray
    sensitivity: FloatArray
    criterion: FloatArray
    log_mass: FloatArray
    side_of: IntArray
    """`(slopes,)`: which of the sides shown each slope belongs to; one slope for each motion shown there."""

    @property
    def penalty(self) -> FloatArray:
        """Shape (slopes, slopes): precision of log slopes about the mean of their side."""
        same = (self.side_of[:, None] == self.side_of).astype(np.float64)
        return np.asarray((np.eye(len(same)) - same / same.sum(axis=1)) / REACH**2)


def people_of(counts: Counts, answered: BoolArray) -> tuple[People, list[Side]]:
    """What is fitted, and the sides shown."""
    present = counts.shown.sum(axis=0) > 0
    shown = counts.shown[answered][:, present]
    by_side, sides = frames_by_side(counts.differences[present])
    motions = np.array(counts.motions or [""] * len(present))[present]
    frames = by_side[:, :, None] * (motions[:, None, None] == np.unique(motions))
    side_of, motion_of = np.nonzero(frames.any(axis=0))
    # One participant's answers tell the scores to about 2 / sqrt(answers); the grid has to be finer.
    step = min(COARSEST_STEP, 2.5 / math.sqrt(float(shown.sum(axis=1).max())))
    half = np.arange(0, FARTHEST_SCORE + step, step)
    scores = np.concatenate([-half[:0:-1], half])
    first, second = (part.ravel() for part in np.meshgrid(scores, scores, indexing="ij"))
    near = first**2 + second**2 <= FARTHEST_SCORE**2
    first, second = first[near], second[near]
    log_mass = -(first**2 + second**2) / 2
    people = People(
        frames[:, side_of, motion_of],
        counts.different[answered][:, present],
        shown,
        first,
        second,
        log_mass - np.log(np.exp(log_mass).sum()),
        side_of,
    )
    return people, [SIDES[index] for index in sides]


def curves(point: FloatArray, people: People, frames: FloatArray) -> tuple[FloatArray, ...]:
    """P("different") of the people on the grid, shape (people, levels), with its derivatives by the logarithms of the
    criterion, by the lapse rate, and by the logarithm of d-prime.

    Parameters are log criterion, lapse, log slopes, and the spreads of log sensitivity and log criterion.
    """
    slopes, lapse = np.exp(point[2:-2]), point[1]
    criterion = np.exp(point[0] + point[-1] * people.criterion)[:, None]
    delta = np.exp(point[-2] * people.sensitivity)[:, None] * (frames @ slopes)
    above, below = (delta - criterion) / ROOT_TWO, (delta + criterion) / ROOT_TWO
    dense_above, dense_below = density(above), density(below)
    share = detected(delta, criterion)
    by_criterion = -(1 - lapse) * (dense_above + dense_below) / ROOT_TWO * criterion
    by_delta = (1 - lapse) * (dense_above - dense_below) / ROOT_TWO * delta
    return lapse / 2 + (1 - lapse) * share, by_criterion, 0.5 - share, by_delta


def gradient_of(
    weights: FloatArray, by: tuple[FloatArray, ...], point: FloatArray, people: People, frames: FloatArray
) -> FloatArray:
    """Derivatives by the parameters of a sum over people and levels of `weights` times P("different")."""
    by_criterion, by_lapse, by_delta = (weights * one for one in by)
    slopes = np.exp(point[2:-2])
    # A level's share of each slope: 1 for its own side and motion, where there is a difference at all.
    parts = frames * slopes / np.maximum(frames @ slopes, 1e-300)[:, None]
    each, own = by_delta.sum(axis=1), by_criterion.sum(axis=1)
    tail = [each @ people.sensitivity, own @ people.criterion]
    return np.concatenate([[own.sum(), by_lapse.sum()], by_delta.sum(axis=0) @ parts, tail])


def _weighed(share: FloatArray, people: People) -> FloatArray:
    """Logarithms of each participant's likelihood at each point of the grid times its mass, shape (points, people)."""
    value = np.log(share) @ people.different.T + np.log1p(-share) @ (people.shown - people.different).T
    return np.asarray(value + people.log_mass[:, None])


def _share(point: FloatArray, people: People) -> tuple[FloatArray, tuple[FloatArray, ...]]:
    share, *by = curves(point, people, people.frames)
    return np.clip(share, fits.SMALLEST_PROBABILITY, 1 - fits.SMALLEST_PROBABILITY), tuple(by)


def log_likelihood(point: FloatArray, people: People) -> tuple[float, FloatArray]:
    """Return the marginal log likelihood, the penalty included, and its gradient."""
    share, by = _share(point, people)
    value = _weighed(share, people)
    highest = value.max(axis=0)
    mass = np.exp(value - highest)
    total = mass.sum(axis=0)
    mass /= total
    # Each grid point answers for the participants by their posterior masses there.
    yes, asked = mass @ people.different, mass @ people.shown
    weights = (yes - asked * share) / (share * (1 - share))
    gradient = gradient_of(weights, by, point, people, people.frames)
    pull = people.penalty @ point[2:-2]
    gradient[2:-2] -= pull
    return float((highest + np.log(total)).sum() - point[2:-2] @ pull / 2), gradient


def cannot_tell(point: FloatArray, people: People) -> BoolArray:
    """Return who answers rather like an observer without any sensitivity than like one of the distribution.

    That is, whose answers are `UNABLE` times as likely from such observers, with criteria as they are distributed.
    """
    blind = replace(people, frames=np.zeros_like(people.frames))
    told, blindly = (np.logaddexp.reduce(_weighed(_share(point, one)[0], one), axis=0) for one in (people, blind))
    return np.asarray(blindly - told > math.log(UNABLE))


def maximise(
    people: People, begin: FloatArray, bounds: list[tuple[float, float]], avoidance: float
) -> tuple[FloatArray, float, bool]:
    """The highest point of the likelihood times the spread of sensitivity to the power `avoidance`."""
    from scipy.optimize import minimize

    def loss(point: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = log_likelihood(point, people)
        if avoidance:
            value += avoidance * math.log(point[-2])
            gradient[-2] += avoidance / point[-2]
        return -value, -gradient

    found = minimize(loss, begin, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 200, "ftol": 1e-10})
    return np.asarray(found.x, dtype=np.float64), -float(found.fun), bool(found.success)


def covariance_of(point: FloatArray, people: People, lapse_held: bool) -> FloatArray:
    """Inverse of the curvature, avoidance included; parameters at a bound are held there."""
    step, size, here = 1e-5, len(point), log_likelihood(point, people)[1]
    curvature = np.empty((size, size))
    for place in range(size):
        moved = np.zeros(size)
        moved[place] = step
        curvature[place] = (here - log_likelihood(point + moved, people)[1]) / step
    curvature = (curvature + curvature.T) / 2
    curvature[-2, -2] += AVOIDANCE / point[-2] ** 2
    held = np.zeros(size, dtype=bool)
    held[1] = lapse_held or point[1] <= 2e-4 or point[1] >= fits.LARGEST_LAPSE - 1e-9
    held[-2:] = (point[-2:] <= ALIKE) | (point[-2:] >= LARGEST_SPREAD - 1e-9)
    free = np.flatnonzero(~held)
    result = np.zeros((size, size))
    result[np.ix_(free, free)] = np.linalg.pinv(curvature[np.ix_(free, free)], hermitian=True)
    return result
