"""Psychometric functions by maximum likelihood: the frequentist choice beside the `posterior`.

Counts at levels come in; the maximum, a profile-likelihood interval of the threshold, and the goodness of fit go out
(Wichmann & Hill 2001). Many data sets are fitted at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from study.analysis import estimates
from study.analysis.psychometric.model import (
    LARGEST_GUESS,
    LARGEST_LAPSE,
    Data,
    Model,
    make_model,
    tidy,
    why_no_fit,
)
from study.analysis.scoring import Maxima, maximise
from study.arrays import FloatArray
from study.models.posterior_grid import prior_limits
from study.models.sigmoids import Sigmoid

PROFILE_POINTS = 41
REFINED_POINTS = 9
PROFILE_STEPS = 50
SMALLEST_PROBABILITY = 1e-9


@dataclass(frozen=True)
class LikelihoodFit:
    """A maximum-likelihood fit."""

    threshold: float | None
    """Where the sigmoid reaches one half; None where it lies outside the levels or can't be determined."""
    interval: estimates.Interval
    """By profile likelihood; an end that the levels leave open is None."""
    width: float
    lapse: float
    guess: float
    """`width`, `lapse`, `guess`: at the maximum."""
    log_likelihood: float
    deviance: float
    degrees_of_freedom: int
    """`log_likelihood`, `deviance`, `degrees_of_freedom`: the deviance is that from free shares at every level."""
    p_value: float | None
    """Of the deviance: by simulation where that was asked for, else by chi-square (rough where levels have few
    answers); small where the curve does not follow the data."""
    dispersion: float | None
    """Deviance over degrees of freedom; much above 1 where performance varied more than the binomial has it."""
    at_bound: tuple[str, ...]
    """Parameters that are at the bound of their range."""
    note: str = ""
    """What can't be estimated, and why."""


def _parts(axis: FloatArray, point: FloatArray, sigmoid: Sigmoid) -> tuple[FloatArray, FloatArray]:
    """P("yes"), shape (fits, levels), and its derivatives by threshold, log width, lapse and guess."""
    threshold, log_width, lapse, guess = (point[:, [place]] for place in range(4))
    factor = sigmoid.span / np.exp(log_width)
    value = (axis - threshold) * factor + sigmoid.half
    shape, slope = sigmoid.curve(value), sigmoid.slope(value)
    scale = 1 - lapse - guess
    by = (-scale * slope * factor, -scale * slope * (value - sigmoid.half), -shape, 1 - shape)
    share = np.clip(guess + scale * shape, SMALLEST_PROBABILITY, 1 - SMALLEST_PROBABILITY)
    return share, np.stack(by, axis=2)


def maximum(
    data_axis: FloatArray,
    yes: FloatArray,
    shown: FloatArray,
    model: Model,
    held: ArrayLike = (),
    steps: int = 200,
) -> Maxima:
    """Fit many data sets at the same levels.

    Parameters
    ----------
    data_axis : ndarray, shape (levels,)
        Levels as they enter the sigmoid.
    yes, shown : ndarray, shape (fits, levels)
    model
        Its overdispersion is not used.
    held : array_like, shape (fits,)
        Thresholds to hold, one a fit; none are held where empty.
    steps
        Of the search, at most.

    Returns
    -------
    Maxima
        Points (threshold, log width, lapse, guess).
    """
    sigmoid = model.sigmoid

    def value(point: FloatArray, rows: NDArray[np.intp]) -> FloatArray:
        share, _ = _parts(data_axis, point, sigmoid)
        total = yes[rows] * np.log(share) + (shown[rows] - yes[rows]) * np.log1p(-share)
        return np.asarray(total.sum(axis=1), dtype=np.float64)

    def scores(point: FloatArray, rows: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        share, by = _parts(data_axis, point, sigmoid)
        variance = share * (1 - share)
        gradient = np.einsum("bl,blp->bp", (yes[rows] - shown[rows] * share) / variance, by)
        return gradient, np.einsum("bl,blp,blq->bpq", shown[rows] / variance, by, by)

    low, high = (np.tile(end, (len(yes), 1)) for end in _bounds(data_axis, model))
    thresholds = np.asarray(held, dtype=np.float64)
    if thresholds.size:
        low[:, 0] = high[:, 0] = thresholds
    return maximise(value, scores, _start(data_axis, yes, shown, model), low, high, steps)


def _bounds(axis: FloatArray, model: Model) -> tuple[FloatArray, FloatArray]:
    (thresholds, widths), _ = prior_limits(axis)
    span = thresholds[1] - thresholds[0]
    low = [thresholds[0] - span, widths[0], 0.0, 0.0]
    high = [thresholds[1] + span, widths[1] + np.log(5), LARGEST_LAPSE, LARGEST_GUESS]
    for place, rate in ((2, model.lapse), (3, model.guess)):
        if rate is not None:
            low[place] = high[place] = rate
    return np.array(low), np.array(high)


def _start(axis: FloatArray, yes: FloatArray, shown: FloatArray, model: Model) -> FloatArray:
    """First guesses: where the share, made to rise, crosses half way, with half the levels' range as the width."""
    share = np.maximum.accumulate((yes + 0.5) / (shown + 1), axis=1)
    guess = np.full(len(yes), 0.05 if model.guess is None else model.guess)
    lapse = np.full(len(yes), 0.02 if model.lapse is None else model.lapse)
    half = (guess + 1 - lapse) / 2
    place = [np.interp(middle, line, axis) for middle, line in zip(half, share, strict=True)]
    width = np.full(len(yes), np.log((axis.max() - axis.min()) / 2))
    return np.column_stack([place, width, lapse, guess])


def fit_likelihood(
    levels: ArrayLike,
    yes: ArrayLike,
    shown: ArrayLike,
    model: Model | None = None,
    *,
    confidence: float = 0.95,
    simulations: int = 0,
    seed: int = 0,
) -> LikelihoodFit | str:
    """Fit one psychometric function by maximum likelihood; a sentence that says why where it can't be fitted.

    Parameters
    ----------
    levels, yes, shown, model, confidence
        As in `posterior.fit_psychometric`.
    simulations, seed
        Data sets drawn from the fit and fitted again, for the p-value of the deviance; 0 takes chi-square.
    """
    estimates.check_share(confidence, "confidence")
    data, chosen = tidy(levels, yes, shown), model or make_model()
    reason = why_no_fit(data)
    if reason:
        return reason
    axis = chosen.sigmoid.axis(data.levels)
    best = maximum(axis, data.yes[None], data.shown[None], chosen)
    point, found = best.point[0], float(best.value[0])
    deviance = max(2 * (float(_saturated(data.yes, data.shown)) - found), 0.0)
    freedom = len(axis) - 2 - (chosen.lapse is None) - (chosen.guess is None)
    p_value = estimates.chi_square_probability(deviance, freedom) if freedom > 0 else None
    if simulations:
        p_value = _simulated_p(axis, data, chosen, point, deviance, simulations, seed)
    threshold, interval, note = _threshold(axis, data, chosen, best, confidence)
    names = ("threshold", "width", "lapse", "guess")
    freely = (True, True, chosen.lapse is None, chosen.guess is None)
    bounds = tuple(name for name, at, free in zip(names, best.held[0], freely, strict=True) if at and free)
    return LikelihoodFit(
        threshold=threshold,
        interval=interval,
        width=float(np.exp(point[1])),
        lapse=float(point[2]),
        guess=float(point[3]),
        log_likelihood=found,
        deviance=deviance,
        degrees_of_freedom=max(freedom, 0),
        p_value=p_value,
        dispersion=deviance / freedom if freedom > 0 else None,
        at_bound=bounds,
        note="; ".join(
            filter(
                None, (note, "" if freedom > 0 else "no more levels than parameters: dispersion cannot be estimated")
            )
        ),
    )


def _saturated(yes: FloatArray, shown: FloatArray) -> FloatArray:
    from scipy.special import xlogy

    share = yes / np.maximum(shown, 1e-12)
    return np.asarray((xlogy(yes, share) + xlogy(shown - yes, 1 - share)).sum(axis=-1), dtype=np.float64)


def _simulated_p(
    axis: FloatArray, data: Data, model: Model, point: FloatArray, deviance: float, simulations: int, seed: int
) -> float:
    """Share of data sets drawn from the fit whose deviance is as large; the fit itself counts as one."""
    share, _ = _parts(axis, point[None], model.sigmoid)
    shown = np.tile(data.shown, (simulations, 1))
    yes = np.random.default_rng(seed).binomial(shown.astype(np.int64), share).astype(np.float64)
    drawn = 2 * (_saturated(yes, shown) - maximum(axis, yes, shown, model).value)
    return float((1 + (drawn >= deviance - 1e-9).sum()) / (1 + simulations))


def _threshold(
    axis: FloatArray, data: Data, model: Model, best: Maxima, confidence: float
) -> tuple[float | None, estimates.Interval, str]:
    """The threshold with its profile interval, in the unit of the levels."""
    first, last = float(axis.min()), float(axis.max())
    low, high = profile_interval(axis, data, model, best, confidence)
    ends = [None if end is None else float(model.sigmoid.levels(np.array(end))) for end in (low, high)]
    interval = estimates.Interval(ends[0], ends[1], confidence)
    place = float(best.point[0, 0])
    if (data.yes == data.shown).all() or (data.yes == 0).all():
        return (
            None,
            estimates.Interval(None, None, confidence),
            "all answers are the same: the threshold cannot be estimated",
        )
    if not first <= place <= last:
        return None, interval, f"outside the levels shown ({data.levels[0]:g} to {data.levels[-1]:g})"
    return float(model.sigmoid.levels(np.array(place))), interval, ""


def profile_interval(
    axis: FloatArray, data: Data, model: Model, best: Maxima, confidence: float = 0.95
) -> tuple[float | None, float | None]:
    """Return the ends of what the likelihood, at its best otherwise, does not exclude; None beyond the levels' range.

    The likelihood ratio is referred to chi-square with one degree of freedom.
    """
    reach = estimates.normal_quantile(confidence) ** 2
    (outer, _), _ = prior_limits(axis)
    centre = float(np.clip(best.point[0, 0], *outer))
    line = np.unique(np.concatenate([np.linspace(*outer, PROFILE_POINTS), [centre]]))
    inside = np.flatnonzero(_drop(axis, data, model, best, line) <= reach)
    if not len(inside):
        return None, None
    first, last = int(inside[0]), int(inside[-1])
    low = high = None
    if first > 0:
        low = _crossing(axis, data, model, best, line[first - 1], line[first], reach)
    if last < len(line) - 1:
        high = _crossing(axis, data, model, best, line[last + 1], line[last], reach)
    return low, high


def _drop(axis: FloatArray, data: Data, model: Model, best: Maxima, line: FloatArray) -> FloatArray:
    """Twice the loss of log likelihood where the threshold is held at each point of a line."""
    yes, shown = (np.tile(part, (len(line), 1)) for part in (data.yes, data.shown))
    held = maximum(axis, yes, shown, model, held=line, steps=PROFILE_STEPS)
    return np.asarray(2 * (max(float(best.value[0]), float(held.value.max())) - held.value), dtype=np.float64)


def _crossing(
    axis: FloatArray, data: Data, model: Model, best: Maxima, outside: float, inside: float, reach: float
) -> float:
    """Where the loss crosses `reach` between a threshold outside and one inside, by a finer line and its root."""
    line = np.linspace(outside, inside, REFINED_POINTS)
    roots = np.sqrt(np.maximum(_drop(axis, data, model, best, line), 0.0))
    at = int(np.argmax(roots <= np.sqrt(reach))) or REFINED_POINTS - 1
    part = np.clip((roots[at - 1] - np.sqrt(reach)) / max(roots[at - 1] - roots[at], 1e-12), 0.0, 1.0)
    return float(line[at - 1] + part * (line[at] - line[at - 1]))
