"""Tests that use the order of values alone, ties included: values in, statistics and p-values out.

For one difference a participant: Wilcoxon's signed ranks, exact. For several values a participant: Friedman's test in
the form of Iman & Davenport 1980.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from study.analysis import estimates
from study.arrays import FloatArray

LARGEST_EXACT = 50
FRIEDMAN = "Friedman's test (F by Iman and Davenport)"
NO_RANKS = "fewer than two participants lean either way: no test by ranks"


@dataclass(frozen=True)
class RankTest:
    """A test on ranks, by name."""

    test: str
    p_value: float


@dataclass(frozen=True)
class Friedman(RankTest):
    """Friedman's test; `f` is None where all rank alike.

    The p-value is of F (Iman & Davenport 1980): the chi-square is too careful with few participants.
    """

    chi_square: float
    f: float | None
    degrees_of_freedom: int
    error_degrees_of_freedom: int


def mid_ranks(values: ArrayLike) -> FloatArray:
    """Return ranks from 1 on, in the order given; tied values (to 12 decimals) share the mean of their ranks."""
    _, place, ties = np.unique(np.round(np.asarray(values, float), 12), return_inverse=True, return_counts=True)
    return np.asarray((np.cumsum(ties) - (ties - 1) / 2)[place], dtype=np.float64)


def signed_rank(differences: ArrayLike) -> float | None:
    """Wilcoxon's signed-rank test against zero, two-sided; None where fewer than two differ from zero.

    Parameters
    ----------
    differences : array_like, shape (participants,)
        One a participant. Zeros are ignored, as by Wilcoxon.

    Notes
    -----
    Exact to 50 participants, over all assignments of signs to the ranks that there are; normal beyond.
    """
    lean = np.asarray(differences, dtype=np.float64)
    lean = lean[np.isfinite(lean) & (np.abs(lean) > 1e-12)]
    if len(lean) < 2:
        return None
    ranks = mid_ranks(np.abs(lean))
    positive, mean = float(ranks[lean > 0].sum()), float(ranks.sum()) / 2
    if len(lean) <= LARGEST_EXACT:
        return _exact_signed_rank(ranks, positive)
    deviation = math.sqrt(float((ranks**2).sum()) / 4)
    return estimates.chi_square_probability(((positive - mean) / deviation) ** 2, 1)


def _exact_signed_rank(ranks: FloatArray, positive: float) -> float:
    """Two-sided probability over all assignments of signs, ties included (ranks are multiples of one half)."""
    doubled = np.round(2 * ranks).astype(int)
    ways = np.zeros(int(doubled.sum()) + 1)
    ways[0] = 1.0
    for rank in doubled:
        shifted = np.zeros_like(ways)
        shifted[rank:] = ways[: len(ways) - rank]
        ways = (ways + shifted) / 2
    distance = np.abs(np.arange(len(ways)) - doubled.sum() / 2)
    return float(min(1.0, ways[distance >= abs(2 * positive - doubled.sum() / 2) - 1e-9].sum()))


def friedman(values: ArrayLike) -> Friedman | None:
    """Friedman's test of several values a participant; None where every participant gives all of them alike.

    Parameters
    ----------
    values : array_like, shape (participants, levels)
        No value missing.
    """
    table = np.asarray(values, dtype=np.float64)
    people, levels = table.shape
    if people < 2 or levels < 2:
        return None
    ranks = np.array([mid_ranks(row) for row in table])
    between = people * float(((ranks.mean(axis=0) - (levels + 1) / 2) ** 2).sum())
    total = float(((ranks - (levels + 1) / 2) ** 2).sum())
    if total <= 0:
        return None
    chi_square = people * (levels - 1) * between / total
    left = people * (levels - 1) - chi_square
    degrees = (levels - 1, (levels - 1) * (people - 1))
    # Where all rank alike, nothing is left over: then the chance of just that is known.
    alike = left <= 1e-9
    f = math.inf if alike else (people - 1) * chi_square / left
    p_value = math.factorial(levels) ** (1 - people) if alike else estimates.f_probability(f, *degrees)
    return Friedman(FRIEDMAN, float(p_value), chi_square, None if alike else f, *degrees)
