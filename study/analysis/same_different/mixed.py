"""Observers who differ, in a same-different study: counts by participant in, the typical observer's thresholds out.

Every participant has their own sensitivity and criterion under the differencing rule (`fits`): both are
log-normal over people, so that "typical" is the median observer. The mean curve of people who differ is flatter than
anybody's, and crosses 75% further out than the typical observer does; one curve fitted to all answers follows neither
quite. This model says both: the typical observer's threshold, and where the mean of all people's curves crosses.

The integral over people is a sum over an even grid of standard scores, which is exact to rounding as long as the grid
is finer than what the answers of one participant tell (Trefethen & Weideman 2014).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from study.analysis import estimates
from study.analysis.same_different import fits
from study.analysis.same_different.counts import SIDES, Counts, Side, Threshold, frames_by_side, log_threshold
from study.analysis.same_different.model import why_no_fit
from study.arrays import BoolArray, FloatArray
from study.counting import counted
from study.models.differencing import ROOT_TWO, density, detected

FEWEST_PEOPLE = 3
FARTHEST_SCORE = 4.2
COARSEST_STEP = 0.35
LARGEST_SPREAD = 1.5
ALIKE = 1e-3
AVOIDANCE = 0.5
METHOD = "mixed differencing model; Student interval of the logarithm"


@dataclass(frozen=True)
class MixedThresholds:
    """What the mixed model says."""

    typical: dict[Side, Threshold]
    """The median observer's threshold, by side."""
    population: dict[Side, Threshold]
    """Where the mean of all people's curves crosses, by side: what percentages of a large group would show."""
    sensitivity_spread: float
    criterion_spread: float
    """`sensitivity_spread`, `criterion_spread`: standard deviations over people of the logarithms."""
    criterion: float
    lapse: float
    """`criterion`, `lapse`: the typical observer's criterion, and everybody's lapse rate."""
    log_likelihood: float
    alike_log_likelihood: float
    """`log_likelihood`, `alike_log_likelihood`: of this model, and of one without individual differences."""
    alike_p_value: float
    """Likelihood-ratio test that people are alike. A spread of none is the least there can be, so the ratio is half
    of the time 0; the mixture of chi-square distributions takes that into account."""
    note: str = ""
    """What to be careful about."""


@dataclass(frozen=True, eq=False)
class _People:
    """Counts by participant, the regressors, and the grid of standard scores with the logarithms of its masses."""

    frames: FloatArray
    different: FloatArray
    shown: FloatArray
    sensitivity: FloatArray
    criterion: FloatArray
    log_mass: FloatArray


@dataclass(frozen=True, eq=False)
class _Doubt:
    """How sure the parameters are: their covariance, the point it was taken at, and how many people it rests on."""

    covariance: FloatArray
    point: FloatArray
    participants: int


def fit_mixed_thresholds(counts: Counts, *, level: float = 0.75, confidence: float = 0.95) -> MixedThresholds | str:
    """Fit the differencing model with a sensitivity and a criterion for each participant.

    Parameters
    ----------
    level
        Share of "different" at threshold.

    Returns
    -------
    MixedThresholds or str
        A sentence that says why where nothing can be fitted.

    Notes
    -----
    Maximum likelihood. Standard errors come from the curvature of the marginal likelihood, so they hold if people are
    as the model has them; `model.fit_model` asks less of them and describes the group's curve. With few
    people the likeliest spread is often none, which would make the rest look too sure, so the curvature is taken where
    the likelihood times the root of the spread of sensitivity is highest (after Chung, Rabe-Hesketh, Dorie, Gelman &
    Liu 2013).
    """
    answered = counts.shown.sum(axis=1) > 0
    reason = why_no_fit(counts)
    if not reason and answered.sum() < FEWEST_PEOPLE:
        few = counted(int(answered.sum()), "participant is", "participants are")
        reason = f"{few} too few to estimate individual differences; at least {FEWEST_PEOPLE}"
    if reason:
        return reason
    people = _people(counts, answered)
    start = fits.fit(people.frames, people.different.sum(axis=0)[None], people.shown.sum(axis=0)[None])
    if start.held[0, 2:].any() or start.held[0, 0]:
        return "the group's sensitivity or criterion is at its bound: individual differences cannot be estimated"
    slopes = np.log(start.slopes[0])
    begin = np.concatenate([np.log(start.criterion), start.lapse, slopes, [0.2, 0.2]])
    bounds = [(math.log(1e-3), math.log(9.0)), (0.0, fits.LARGEST_LAPSE), *((slope - 3, slope + 3) for slope in slopes)]
    point, value, settled = _maximise(people, begin, [*bounds, *[(0.0, LARGEST_SPREAD)] * 2], 0.0)
    near = np.concatenate([point[:-2], np.maximum(point[-2:-1], 0.1), point[-1:]])
    wary, _, _ = _maximise(people, near, [*bounds, (2 * ALIKE, LARGEST_SPREAD), (0.0, LARGEST_SPREAD)], AVOIDANCE)
    doubt = _Doubt(_covariance(wary, people), wary, len(people.shown))
    sides = [SIDES[index] for index in frames_by_side(counts.differences[counts.shown.sum(axis=0) > 0])[1]]
    nobody_else = replace(people, sensitivity=np.zeros(1), criterion=np.zeros(1), log_mass=np.zeros(1))
    alike = float(start.log_likelihood[0])
    return MixedThresholds(
        typical=_thresholds(point, doubt, nobody_else, sides, level, confidence),
        population=_thresholds(point, doubt, people, sides, level, confidence),
        sensitivity_spread=float(point[-2]),
        criterion_spread=float(point[-1]),
        criterion=math.exp(point[0]),
        lapse=float(point[1]),
        log_likelihood=value,
        alike_log_likelihood=alike,
        alike_p_value=_alike_probability(max(2 * (value - alike), 0.0)),
        note="" if settled else "the search for the maximum did not converge",
    )


def _people(counts: Counts, answered: BoolArray) -> _People:
    present = counts.shown.sum(axis=0) > 0
    shown = counts.shown[answered][:, present]
    # One participant's answers tell the scores to about 2 / sqrt(answers); the grid has to be finer.
    step = min(COARSEST_STEP, 2.5 / math.sqrt(float(shown.sum(axis=1).max())))
    half = np.arange(0, FARTHEST_SCORE + step, step)
    scores = np.concatenate([-half[:0:-1], half])
    first, second = (part.ravel() for part in np.meshgrid(scores, scores, indexing="ij"))
    near = first**2 + second**2 <= FARTHEST_SCORE**2
    first, second = first[near], second[near]
    log_mass = -(first**2 + second**2) / 2
    return _People(
        frames_by_side(counts.differences[present])[0],
        counts.different[answered][:, present],
        shown,
        first,
        second,
        log_mass - np.log(np.exp(log_mass).sum()),
    )


def _curves(point: FloatArray, people: _People, frames: FloatArray) -> tuple[FloatArray, FloatArray]:
    """P("different") of the people on the grid, shape (people, levels), and its derivatives by the parameters.

    Parameters are log criterion, lapse, log slopes, and the spreads of log sensitivity and log criterion.
    """
    factor = np.exp(point[-2] * people.sensitivity)[:, None]
    criterion = np.exp(point[0] + point[-1] * people.criterion)[:, None]
    slopes, lapse = np.exp(point[2:-2]), point[1]
    delta = factor * (frames @ slopes)
    above, below = (delta - criterion) / ROOT_TWO, (delta + criterion) / ROOT_TWO
    dense_above, dense_below = density(above), density(below)
    share = detected(delta, criterion)
    by_criterion = -(1 - lapse) * (dense_above + dense_below) / ROOT_TWO * criterion
    by_delta = (1 - lapse) * (dense_above - dense_below) / ROOT_TWO
    by_slopes = [by_delta * factor * (frames[:, place] * slope) for place, slope in enumerate(slopes)]
    by_spreads = [by_delta * delta * people.sensitivity[:, None], by_criterion * people.criterion[:, None]]
    by = np.stack([by_criterion, 0.5 - share, *by_slopes, *by_spreads])
    return lapse / 2 + (1 - lapse) * share, by


def _log_likelihood(point: FloatArray, people: _People) -> tuple[float, FloatArray]:
    """Marginal log likelihood and its gradient."""
    share, by = _curves(point, people, people.frames)
    share = np.clip(share, fits.SMALLEST_PROBABILITY, 1 - fits.SMALLEST_PROBABILITY)
    value = people.different @ np.log(share).T + (people.shown - people.different) @ np.log1p(-share).T
    value += people.log_mass
    highest = value.max(axis=1, keepdims=True)
    weights = np.exp(value - highest)
    total = weights.sum(axis=1, keepdims=True)
    weights /= total
    # Each grid point answers for the participants by their posterior masses there.
    yes, asked = weights.T @ people.different, weights.T @ people.shown
    gradient = np.einsum("kl,pkl->p", (yes - asked * share) / (share * (1 - share)), by)
    return float((highest + np.log(total)).sum()), gradient


def _maximise(
    people: _People, begin: FloatArray, bounds: list[tuple[float, float]], avoidance: float
) -> tuple[FloatArray, float, bool]:
    """The highest point of the likelihood times the spread of sensitivity to the power `avoidance`."""
    from scipy.optimize import minimize

    def loss(point: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = _log_likelihood(point, people)
        if avoidance:
            value += avoidance * math.log(point[-2])
            gradient[-2] += avoidance / point[-2]
        return -value, -gradient

    found = minimize(loss, begin, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 200, "ftol": 1e-10})
    return np.asarray(found.x, dtype=np.float64), -float(found.fun), bool(found.success)


def _covariance(point: FloatArray, people: _People) -> FloatArray:
    """Inverse of the curvature, avoidance included; parameters at a bound are held there."""
    step, size = 1e-4, len(point)
    curvature = np.empty((size, size))
    for place in range(size):
        moved = np.zeros(size)
        moved[place] = step
        ahead, behind = _log_likelihood(point + moved, people)[1], _log_likelihood(point - moved, people)[1]
        curvature[place] = -(ahead - behind) / (2 * step)
    curvature = (curvature + curvature.T) / 2
    curvature[-2, -2] += AVOIDANCE / point[-2] ** 2
    held = np.zeros(size, dtype=bool)
    held[1] = point[1] <= 2 * step or point[1] >= fits.LARGEST_LAPSE - 1e-9
    held[-2:] = (point[-2:] <= ALIKE) | (point[-2:] >= LARGEST_SPREAD - 1e-9)
    free = np.flatnonzero(~held)
    result = np.zeros((size, size))
    result[np.ix_(free, free)] = np.linalg.pinv(curvature[np.ix_(free, free)], hermitian=True)
    return result


def _log_threshold(point: FloatArray, people: _People, place: int, level: float) -> tuple[float, FloatArray]:
    """Log threshold (frames) of the people on the grid, and its derivatives; infinite where there is none.

    Where the mean curve m crosses at x, d log x / d parameter = -(d m / d parameter) / (d m / d log x), and a change of
    the logarithm of x does what one of the logarithm of the slope does.
    """
    mass = np.exp(people.log_mass)
    alone = np.zeros((1, people.frames.shape[1]))

    def mean_at(log_frames: float) -> tuple[float, FloatArray]:
        alone[0, place] = math.exp(log_frames)
        share, by = _curves(point, people, alone)
        return float(mass @ share[:, 0]), np.asarray(by[:, :, 0] @ mass, dtype=np.float64)

    low, high = -float(point[2 + place]) - 5.0, -float(point[2 + place]) + 4.0
    if mean_at(low)[0] >= level or mean_at(high)[0] < level:
        return math.inf, np.zeros(len(point))
    while high - low > 1e-8:
        middle = (low + high) / 2
        low, high = (middle, high) if mean_at(middle)[0] < level else (low, middle)
    _, gradient = mean_at(high)
    return high, -gradient / gradient[2 + place]


def _thresholds(
    point: FloatArray,
    doubt: _Doubt,
    people: _People,
    sides: list[Side],
    level: float,
    confidence: float,
) -> dict[Side, Threshold]:
    """Thresholds of the people on the grid; one person there is the median observer."""
    result: dict[Side, Threshold] = {}
    for place, side in enumerate(sides):
        largest, nothing = float(people.frames[:, place].max()), estimates.Interval(None, None, confidence)
        log_found, gradient = _log_threshold(point, people, place, level)
        if not math.isfinite(log_found):
            note = f"{100 * level:g}% is not crossed: false alarms lie above it, or lapses keep the curve below it"
            result[side] = Threshold(side, None, None, nothing, "not estimable", METHOD, note)
            continue
        variance, freedom = _variance(doubt, gradient)
        error = math.sqrt(variance) if variance > 0 else None
        times = estimates.t_quantile(confidence, freedom)
        result[side] = log_threshold(side, math.exp(log_found), error, times, largest, METHOD, confidence)
    return result


def _variance(doubt: _Doubt, gradient: FloatArray) -> tuple[float, float]:
    """Variance of the log threshold, and its degrees of freedom.

    The part that comes from people's differing rests on as many of them as there are, less one; the part that comes
    from single answers rests on many (Satterthwaite 1946). Maximum likelihood takes the first part too small by one
    participant, as it does every variance.
    """
    variance, others = float(gradient @ doubt.covariance @ gradient), doubt.participants - 1
    between = float(doubt.point[-2] ** 2 + (gradient[0] * doubt.point[-1]) ** 2) / others
    variance += between / doubt.participants
    if not variance > 0:
        return 0.0, math.inf
    part = min(between / variance, 1.0)
    return variance, others / max(part, 1e-3) ** 2


def _alike_probability(ratio: float) -> float:
    """Two spreads tested at their bound: weights 1/4, 1/2, 1/4 of chi-square with 0, 1 and 2 degrees of freedom."""
    if ratio <= 0:
        return 1.0
    return 0.5 * estimates.chi_square_probability(ratio, 1) + 0.25 * estimates.chi_square_probability(ratio, 2)
