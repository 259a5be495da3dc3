"""Psychometric functions: counts at stimulus levels in; threshold, width, lapse and guess rate with intervals out.

    p(level) = guess + (1 - guess - lapse) F(level; threshold, width)

The default is a posterior on a grid, with the intervals of its marginals (Wichmann & Hill 2001; Schuett, Harmeling,
Macke & Wichmann 2016): a lapse rate and a spread of performance beyond the binomial (beta-binomial) are averaged over,
not fixed. The likelihood's own maximum, profile and deviance stand in `likelihood`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from study.analysis.estimates import Interval, check_share
from study.analysis.psychometric.model import LARGEST_GUESS, LARGEST_LAPSE, Data, Model, make_model, tidy, why_no_fit
from study.arrays import FloatArray
from study.models.posterior_grid import OVERDISPERSION_EDGES, Grid, evaluate, posterior_range
from study.models.sigmoids import Sigmoid

Status = Literal["reached", "not reached", "not estimable"]


@dataclass(frozen=True)
class Estimate:
    """A parameter: posterior median and marginal interval; None where the data don't tell."""

    value: float | None
    interval: Interval
    status: Status = "reached"
    note: str = ""


@dataclass(frozen=True, eq=False)
class PsychometricFit:
    """A psychometric function with its uncertainty."""

    data: Data
    model: Model
    """`data`, `model`: what was fitted to what."""
    threshold: Estimate
    """The level where the sigmoid reaches one half, between guess and lapse rate; 75% in 2AFC without lapses."""
    width: Estimate
    """Distance from 5% to 95% of the sigmoid; of the logarithm of the level for Weibull."""
    lapse: Estimate
    guess: Estimate
    """`lapse`, `guess`: rates; a fixed one has an interval of no length."""
    overdispersion: Estimate
    """Square root of the correlation of answers at one level; 0 for plain binomial."""
    grid: Grid
    """The posterior."""
    confidence: float
    note: str = ""
    """What to be careful about."""


def fit_psychometric(
    levels: ArrayLike, yes: ArrayLike, shown: ArrayLike, model: Model | None = None, *, confidence: float = 0.95
) -> PsychometricFit | str:
    """Fit one psychometric function; a sentence that says why where nothing can be fitted.

    Parameters
    ----------
    levels : array_like, shape (blocks,)
        Stimulus levels; the share of "yes" rises with them.
    yes, shown : array_like, shape (blocks,)
        Answers "yes" (right answers in 2AFC), and all answers.
    model
        From `make_model`; 2AFC with a cumulative normal unless given.

    Notes
    -----
    Priors: flat for thresholds within the levels, falling to none half their range outside; flat for the logarithm of
    the width from half the smallest step between levels to the whole range, falling to none at a quarter and at four
    times; Beta(1, 20) for the lapse rate, Beta(1, 5) for the guess rate, Beta(1, 40) for overdispersion. Estimates are
    medians, which mean the same on a level and on its logarithm.

    Examples
    --------
    >>> fit = fit_psychometric([1, 2, 3, 4, 5], [11, 12, 16, 19, 20], [20] * 5)
    >>> round(fit.threshold.value, 1)
    2.7
    """
    check_share(confidence, "confidence")
    data, chosen = tidy(levels, yes, shown), model or make_model()
    reason = why_no_fit(data)
    if reason:
        return reason
    axis = chosen.sigmoid.axis(data.levels)
    rates = [(chosen.lapse, LARGEST_LAPSE), (chosen.guess, LARGEST_GUESS)]
    ranges = posterior_range(axis, data.yes, data.shown, chosen.sigmoid, rates, chosen.overdispersion)
    grid = evaluate(axis, data.yes, data.shown, chosen.sigmoid, ranges, chosen.overdispersion)
    threshold, width, lapse, guess, excess = (
        _estimate(grid, place, confidence, name)
        for place, name in enumerate(("threshold", "width", "lapse rate", "guess rate", "overdispersion"))
    )
    note = _caution(data)
    return PsychometricFit(
        data=data,
        model=chosen,
        threshold=_within_levels(threshold, axis, chosen.sigmoid, note),
        width=_positive(width),
        lapse=lapse,
        guess=guess,
        overdispersion=excess,
        grid=grid,
        confidence=confidence,
        note=note,
    )


def _caution(data: Data) -> str:
    share = data.yes / data.shown
    if (data.yes == data.shown).all():
        return "every answer at every level was right or “yes”: the threshold lies below the levels shown"
    if (data.yes == 0).all():
        return "no answer at any level was right or “yes”: the threshold lies above the levels shown"
    weight = data.shown / data.shown.sum()
    centred = data.levels - (weight * data.levels).sum()
    if float((weight * centred * share).sum()) <= 0:
        return "the proportion does not rise with the level; if it should fall, reverse the sign of the levels"
    return ""


def _estimate(grid: Grid, place: int, confidence: float, name: str) -> Estimate:
    """Posterior median and marginal interval of one axis of the grid."""
    nodes, mass = grid.nodes[place], grid.marginals[place]
    if len(nodes) == 1:
        value = float(nodes[0])
        return Estimate(value, Interval(value, value, confidence))
    edges = OVERDISPERSION_EDGES if name == "overdispersion" else even_edges(nodes)
    low, median, high = quantiles(edges, mass, ((1 - confidence) / 2, 0.5, (1 + confidence) / 2))
    ends = (None if grid.open_ends[place][0] else low, None if grid.open_ends[place][1] else high)
    note = f"the data leave the {name} open on one side" if None in ends else ""
    return Estimate(median, Interval(*ends, confidence), note=note)


def even_edges(nodes: FloatArray) -> FloatArray:
    """Return the edges of the cells around evenly spaced nodes."""
    step = nodes[1] - nodes[0]
    return np.concatenate([[nodes[0] - step / 2], nodes + step / 2])


def quantiles(edges: FloatArray, mass: FloatArray, shares: Sequence[float]) -> list[float]:
    """Return quantiles of a distribution given by the mass between edges."""
    cumulated = np.concatenate([[0.0], np.cumsum(mass)])
    return [float(value) for value in np.interp(shares, cumulated / cumulated[-1], edges)]


def _within_levels(found: Estimate, axis: FloatArray, sigmoid: Sigmoid, note: str) -> Estimate:
    """The threshold in the unit of the levels; none where it lies outside them."""

    def back(value: float | None) -> float | None:
        return None if value is None else float(sigmoid.levels(np.array(value)))

    low, high = found.interval.low, found.interval.high
    interval = Interval(back(low), back(high), found.interval.confidence)
    if note:
        return Estimate(None, interval, "not estimable", note)
    if found.value is None or not axis.min() <= found.value <= axis.max():
        first, last = sigmoid.levels(axis.min()), sigmoid.levels(axis.max())
        return Estimate(None, interval, "not reached", f"outside the levels shown ({first:g} to {last:g})")
    return Estimate(back(found.value), interval, "reached", found.note)


def _positive(found: Estimate) -> Estimate:
    """The width from its logarithm."""

    def back(value: float | None) -> float | None:
        return None if value is None else math.exp(value)

    interval = Interval(back(found.interval.low), back(found.interval.high), found.interval.confidence)
    return Estimate(back(found.value), interval, found.status, found.note)


def threshold_at(fit: PsychometricFit, share: float) -> Estimate:
    """Return the level at which a share of the answers is "yes", guesses and lapses included.

    Parameters
    ----------
    fit
        From `fit_psychometric`.
    share
        Between 0 and 1; where part of the posterior never reaches it, the interval is open.
    """
    thresholds, widths, lapses, guesses = np.meshgrid(*fit.grid.nodes[:4], indexing="ij")
    target = (share - guesses) / (1 - guesses - lapses)
    check_share(share, "share")
    sigmoid, mass = fit.model.sigmoid, fit.grid.density.sum(axis=4)
    with np.errstate(invalid="ignore", divide="ignore"):
        place = thresholds + np.exp(widths) * (sigmoid.inverse(target) - sigmoid.half) / sigmoid.span
    place = np.where(target <= 0, -np.inf, np.where(target >= 1, np.inf, place)).ravel()
    order = np.argsort(place)
    cumulated, ordered = np.cumsum(mass.ravel()[order]), place[order]
    tails = ((1 - fit.confidence) / 2, 0.5, (1 + fit.confidence) / 2)
    low, middle, high = ordered[np.minimum(np.searchsorted(cumulated, tails), len(ordered) - 1)]
    ends = [None if edge or not np.isfinite(end) else float(sigmoid.levels(end))
            for end, edge in zip((low, high), fit.grid.open_ends[0], strict=True)]  # fmt: skip
    interval = Interval(ends[0], ends[1], fit.confidence)
    axis = sigmoid.axis(fit.data.levels)
    if fit.note or not axis.min() <= middle <= axis.max():
        return Estimate(None, interval, "not reached", fit.note or f"{100 * share:g}% lies outside the levels shown")
    return Estimate(float(sigmoid.levels(middle)), interval)


def curve_of(fit: PsychometricFit, points: int = 101) -> tuple[tuple[float, float], ...]:
    """Return the posterior mean of the psychometric function over the levels, for drawing: level, share."""
    sigmoid = fit.model.sigmoid
    axis = sigmoid.axis(fit.data.levels)
    line = np.linspace(axis.min(), axis.max(), points)
    thresholds, log_widths, lapses, guesses, _ = fit.grid.nodes
    shape = sigmoid.at(line[:, None, None], thresholds[None, :, None], np.exp(log_widths)[None, None])
    mass = fit.grid.density.sum(axis=4)
    scale = 1 - lapses[:, None] - guesses[None]
    rises = np.einsum("xtw,twlg,lg->x", shape, mass, scale, optimize=True)
    floor = float((mass.sum(axis=(0, 1, 2)) * guesses).sum())
    return tuple((float(x), float(y)) for x, y in zip(sigmoid.levels(line), floor + rises, strict=True))
