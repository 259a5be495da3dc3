"""The posterior of a psychometric function on a grid: counts in, masses at grid points and marginals out.

A coarse pass finds where the posterior is, a fine one sums it there. Axes: threshold, logarithm of the width, lapse,
guess, overdispersion. The beta-binomial likelihood is looked up from a table over the probability of "yes", one a
level, so that the many points of the grid cost no gamma functions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from study.arrays import FloatArray
from study.models.sigmoids import SIGMOIDS, Sigmoid

Range = tuple[float, float]

COARSE = (25, 15, 4, 5)
FINE = (31, 17, 8, 6)
# Square roots of the correlation of answers at a level, each standing for a stretch of their prior.
OVERDISPERSION = np.array([0.0, 0.06, 0.13, 0.25])
OVERDISPERSION_EDGES = np.array([0.0, 0.03, 0.095, 0.19, 0.999])
KNOTS = 200
# Priors Beta(1, power). Lapse rate: half of it lies below 3.4%, nineteen in twenty parts below 14%. Guess rate: a
# yes-no observer may well say "yes" to every fourth nothing. Overdispersion, the root of the correlation: less than 2%
# for a correlation of more than 0.01, with which 100 answers are worth 50.
LAPSE_POWER = 20
GUESS_POWER = 5
OVERDISPERSION_POWER = 40
# The coarse pass looks at the likelihood to this power, so that overdispersion, left out there, can't fall outside.
TEMPER = 0.4
NEGLIGIBLE = 2e-4
OPEN = 0.05


@dataclass(frozen=True, eq=False)
class Grid:
    """A posterior."""

    nodes: tuple[FloatArray, ...]
    """Points of the five axes, evenly spaced but the last."""
    density: FloatArray
    """`(thresholds, widths, lapses, guesses, overdispersions)`: mass at each point; adds to one."""
    marginals: tuple[FloatArray, ...]
    """Mass along each axis."""
    open_ends: tuple[tuple[bool, bool], ...]
    """For each axis, whether the posterior still has mass at its lower and upper limit, which the prior set."""


@dataclass(frozen=True)
class Ranges:
    """Where to look along the first four axes, how far the prior goes, and its threshold and width limits."""

    ends: tuple[Range, ...]
    limits: tuple[Range, ...]
    flat: tuple[Range, Range]


def prior_limits(axis: FloatArray) -> tuple[tuple[Range, Range], tuple[Range, Range]]:
    """Return the limits of threshold and log width, and the part within which their prior is flat."""
    first, last = float(axis.min()), float(axis.max())
    span, step = last - first, float(np.diff(axis).min())
    outer = ((first - span / 2, last + span / 2), (float(np.log(step / 4)), float(np.log(4 * span))))
    inner = ((first, last), (float(np.log(step / 2)), float(np.log(span))))
    return outer, inner


def _taper(nodes: FloatArray, limits: Range, flat: Range) -> FloatArray:
    """A prior that is flat inside and falls to nothing, as a cosine, at the limits."""
    below = np.clip((flat[0] - nodes) / max(flat[0] - limits[0], 1e-12), 0, 1)
    above = np.clip((nodes - flat[1]) / max(limits[1] - flat[1], 1e-12), 0, 1)
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.maximum(below, above)), dtype=np.float64)


def _nodes(ends: Range, count: int) -> FloatArray:
    if ends[0] == ends[1]:
        return np.array([ends[0]])
    step = (ends[1] - ends[0]) / count
    return np.asarray(ends[0] + step * (np.arange(count) + 0.5), dtype=np.float64)


@lru_cache(maxsize=64)
def _coarse_tables(
    axis: tuple[float, ...], sigmoid: str, rates: tuple[tuple[float | None, float], ...]
) -> tuple[list[FloatArray], FloatArray, FloatArray, FloatArray]:
    """Nodes, log p, log(1 - p) and log prior of the coarse pass; the same for all data at the same levels."""
    place = np.array(axis)
    outer, inner = prior_limits(place)
    ends = [*outer, *((0.0, largest) if held is None else (held, held) for held, largest in rates)]
    nodes = [_nodes(end, count) for end, count in zip(ends, COARSE, strict=True)]
    share = _shares(place, SIGMOIDS[sigmoid], nodes)
    share = np.clip(share, 1e-9, 1 - 1e-9).reshape(len(place), -1)
    return nodes, np.log(share), np.log1p(-share), _log_prior(nodes, outer, inner)


def _log_prior(nodes: Sequence[FloatArray], outer: tuple[Range, Range], inner: tuple[Range, Range]) -> FloatArray:
    parts = [_taper(nodes[axis], outer[axis], inner[axis]) for axis in range(2)]
    for rate, power in zip(nodes[2:4], (LAPSE_POWER, GUESS_POWER), strict=True):
        parts.append((1 - rate) ** (power - 1) if len(rate) > 1 else np.ones(1))
    with np.errstate(divide="ignore"):
        logs = [np.log(part) for part in parts]
    shape = logs[0][:, None, None, None] + logs[1][:, None, None] + logs[2][:, None] + logs[3]
    return np.asarray(shape, dtype=np.float64)


def _shares(axis: FloatArray, sigmoid: Sigmoid, nodes: Sequence[FloatArray]) -> FloatArray:
    """P("yes") at every level and grid point, shape (levels, thresholds, widths, lapses, guesses)."""
    shape = sigmoid.at(axis[:, None, None], nodes[0][:, None], np.exp(nodes[1]))
    scale = 1 - nodes[2][:, None] - nodes[3]
    return np.asarray(shape[..., None, None] * scale + nodes[3], dtype=np.float64)


def posterior_range(
    axis: FloatArray,
    yes: FloatArray,
    shown: FloatArray,
    sigmoid: Sigmoid,
    rates: Sequence[tuple[float | None, float]],
    overdispersion: bool,
) -> Ranges:
    """Find where the posterior is, on a coarse grid.

    Parameters
    ----------
    axis, yes, shown : ndarray, shape (levels,)
    rates
        Lapse and guess: the value held, or None, and the largest one sought.
    overdispersion
        Whether the posterior may be wider than the binomial one.
    """
    nodes, log_yes, log_no, log_prior = _coarse_tables(tuple(axis), sigmoid.name, tuple(rates))
    outer, inner = prior_limits(axis)
    limits = (*outer, *((0.0, largest) if held is None else (held, held) for held, largest in rates))
    value = (yes @ log_yes + (shown - yes) @ log_no).reshape(log_prior.shape)
    value = (TEMPER if overdispersion else 0.7) * value + log_prior
    mass = np.exp(value - value.max())
    ends = []
    for place, points in enumerate(nodes):
        if len(points) == 1:
            ends.append((float(points[0]), float(points[0])))
            continue
        others = tuple(other for other in range(4) if other != place)
        marginal = mass.sum(axis=others)
        kept = np.flatnonzero(marginal > NEGLIGIBLE * marginal.max())
        half = (points[1] - points[0]) / 2
        low, high = points[kept[0]] - 2 * half, points[kept[-1]] + 2 * half
        ends.append((max(float(low), limits[place][0]), min(float(high), limits[place][1])))
    return Ranges(tuple(ends), limits, inner)


def _log_beta_binomial(yes: FloatArray, shown: FloatArray, overdispersion: FloatArray) -> FloatArray:
    """Log likelihood of each level over knots of arcsin sqrt p, shape (levels, knots, overdispersions).

    Constants that do not depend on p or overdispersion are omitted.
    """
    from scipy.special import gammaln

    share = np.sin(np.linspace(0, np.pi / 2, KNOTS)) ** 2
    share = np.clip(share, 2e-6, 1 - 2e-6)[None, :, None]
    table = np.empty((len(yes), KNOTS, len(overdispersion)))
    hits, total = yes[:, None, None], shown[:, None, None]
    plain = overdispersion == 0
    table[:, :, plain] = hits * np.log(share) + (total - hits) * np.log1p(-share)
    if not plain.all():
        size = 1 / overdispersion[~plain] ** 2 - 1
        first, second = share * size, (1 - share) * size
        value = gammaln(hits + first) + gammaln(total - hits + second) - gammaln(first) - gammaln(second)
        table[:, :, ~plain] = value + gammaln(size) - gammaln(total + size)
    return table


def _log_likelihood(shares: FloatArray, table: FloatArray) -> FloatArray:
    """Sum over levels of the table at these shares, shape (points, overdispersions)."""
    place = np.arcsin(np.sqrt(shares)) * ((KNOTS - 1) / (np.pi / 2))
    knot = np.minimum(place.astype(np.intp), KNOTS - 2)
    part = place - knot
    total = np.zeros((shares.shape[1], table.shape[2]))
    steps = np.diff(table, axis=1)
    for level in range(len(table)):
        total += table[level].take(knot[level], axis=0)
        total += steps[level].take(knot[level], axis=0) * part[level][:, None]
    return total


def evaluate(
    axis: FloatArray, yes: FloatArray, shown: FloatArray, sigmoid: Sigmoid, ranges: Ranges, overdispersion: bool
) -> Grid:
    """Sum the posterior over the fine grid within these ranges."""
    nodes = [_nodes(end, count) for end, count in zip(ranges.ends, FINE, strict=True)]
    excess = OVERDISPERSION if overdispersion else OVERDISPERSION[:1]
    shares = np.clip(_shares(axis, sigmoid, nodes), 0.0, 1.0).reshape(len(axis), -1)
    value = _log_likelihood(shares, _log_beta_binomial(yes, shown, excess))
    prior = _log_prior(nodes, (ranges.limits[0], ranges.limits[1]), ranges.flat)
    value = value.reshape(*prior.shape, len(excess)) + prior[..., None]
    if overdispersion:
        value += np.log(-np.diff((1 - OVERDISPERSION_EDGES) ** OVERDISPERSION_POWER))
    density = np.exp(value - value.max())
    density /= density.sum()
    plane = density.sum(axis=4)
    marginals = [plane.sum(axis=tuple(other for other in range(4) if other != place)) for place in range(4)]
    marginals.append(density.reshape(-1, len(excess)).sum(axis=0))
    ends = tuple(_open_ends(nodes[place], marginals[place], ranges, place) for place in range(2))
    return Grid((*nodes, excess), density, tuple(marginals), (*ends, *((False, False),) * 3))


def _open_ends(nodes: FloatArray, mass: FloatArray, ranges: Ranges, place: int) -> tuple[bool, bool]:
    """Whether a notable part of the posterior lies where only the prior's fall ends it."""
    low, high = ranges.flat[place]
    return bool(mass[nodes < low].sum() > OPEN / 2), bool(mass[nodes > high].sum() > OPEN / 2)
