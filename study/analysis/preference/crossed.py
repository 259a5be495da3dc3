"""A mean share that holds for other participants and other motions: counts in; estimate, error and freedom out.

Participants and motions are both samples (Clark 1973): the variance of the mean share is that between participants plus
that between motions less what both contain of the rest, and Student's t takes the degrees of freedom of Satterthwaite
1946. With three to eight motions the share of variance between them is hardly known, which two rules allow for:

- A variance component that is smaller than chance gives in half of all samples (F below its median) is taken as none,
  and its sum of squares joins the rest. Otherwise the interval is far too wide where motions do not differ.
- A variance from few groups is small by chance just where it also makes the t value large, so Satterthwaite's
  degrees of freedom are too many; here they are counted as if that variance were `1 + 0.6 / (groups - 1)` times itself.

Both were settled by simulation (`benchmarks/group_tests.py crossed`), which gives the error rates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from study.arrays import FloatArray, IntArray

KEPT_BELOW = 0.5
"""The p-value of its F test below which a variance component is kept."""

FEW_GROUPS = 0.6

_ROUNDS = 60
"""Rounds in which the means of participants and motions are found where answers are missing; far more than needed."""


@dataclass(frozen=True, eq=False)
class Crossed:
    """Mean shares of many studies, each with its standard error and degrees of freedom; shape (...) each.

    The error is 0 where all answers are the same, and NaN with fewer than two participants or motions.
    """

    share: FloatArray
    error: FloatArray
    freedom: FloatArray

    def p_values(self, expected: float = 0.5) -> FloatArray:
        """Two-sided p-values against an expected share; NaN where there is no spread."""
        from scipy.special import stdtr

        with np.errstate(divide="ignore", invalid="ignore"):
            statistic = np.abs(self.share - expected) / self.error
        known = self.error > 1e-9
        return np.asarray(np.where(known, 2 * stdtr(self.freedom, -np.where(known, statistic, 0.0)), np.nan))


def crossed(chosen: ArrayLike, shown: ArrayLike) -> Crossed:
    """Estimate a share over participants and motions.

    Parameters
    ----------
    chosen, shown : array_like, shape (..., participants, motions)
        How often each participant favoured the first method in each motion (a tie is one half), of how many answers.
    """
    yes, total = np.broadcast_arrays(np.asarray(chosen, dtype=np.float64), np.asarray(shown, dtype=np.float64))
    there = total > 0
    answers = np.maximum(total.sum(axis=(-1, -2)), 1.0)
    share = np.where(there, yes, 0.0).sum(axis=(-1, -2)) / answers
    apart = np.where(there, yes - total * share[..., None, None], 0.0)
    cells = there.sum(axis=(-1, -2))
    sums, groups = [], []
    for axis in (-1, -2):
        count = there.any(axis=axis).sum(axis=-1)
        few = np.maximum(count - 1, 1)
        sums.append((apart.sum(axis=axis) ** 2).sum(axis=-1) * count / few / answers**2)
        groups.append(count)
    rest_freedom = np.maximum(cells - groups[0] - groups[1] + 1, 0)
    left = apart - total * _means(apart, total)
    rest = (left**2).sum(axis=(-1, -2)) * cells / np.maximum(rest_freedom, 1) / answers**2
    error, freedom = _combined(sums, [np.maximum(count - 1, 1) for count in groups], rest, rest_freedom)
    known = (groups[0] > 1) & (groups[1] > 1)
    return Crossed(share, np.where(known, error, np.nan), np.where(known, freedom, np.nan))


def _means(apart: FloatArray, total: FloatArray) -> FloatArray:
    """What means of participants and of motions make of each cell, by least squares; shape as `total`.

    Each in turn is the mean of what the other leaves, which ends at once if nobody misses an answer.
    """
    rows, columns = np.zeros(total.shape[:-1]), np.zeros((*total.shape[:-2], total.shape[-1]))
    by_row, by_column = (np.maximum(total.sum(axis=axis), 1e-12) for axis in (-1, -2))
    for _ in range(_ROUNDS):
        rows = (apart - total * columns[..., None, :]).sum(axis=-1) / by_row
        new = (apart - total * rows[..., :, None]).sum(axis=-2) / by_column
        done = np.max(np.abs(new - columns), initial=0.0) < 1e-12
        columns = new
        if done:
            break
    return np.asarray(rows[..., :, None] + columns[..., None, :])


def _combined(
    sums: list[FloatArray], freedoms: list[IntArray], rest: FloatArray, rest_freedom: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Standard error and degrees of freedom from the variances of participants, of motions, and of the rest."""
    from scipy.special import fdtrc

    has_rest = rest_freedom > 0
    kept = []
    for variance, freedom in zip(sums, freedoms, strict=True):
        ratio = variance / np.where(rest > 0, rest, 1.0)
        chance = np.where(rest > 0, fdtrc(freedom, np.maximum(rest_freedom, 1), ratio), 0.0)
        kept.append(~has_rest | ((chance < KEPT_BELOW) & (variance > 0)))
    pooled, count = rest * rest_freedom, rest_freedom.astype(np.float64)
    for variance, freedom, keep in zip(sums, freedoms, kept, strict=True):
        pooled = pooled + np.where(keep, 0.0, variance * freedom)
        count = count + np.where(keep, 0, freedom)
    pooled = np.where(count > 0, pooled / np.maximum(count, 1), 0.0)
    # Each kept variance contains the rest once; all of them together should, once.
    share_of_rest = 1.0 - kept[0] - kept[1]
    variance = share_of_rest * pooled
    spread = (share_of_rest * pooled) ** 2 / np.maximum(count, 1)
    for own, freedom, keep in zip(sums, freedoms, kept, strict=True):
        variance = variance + np.where(keep, own, 0.0)
        spread = spread + np.where(keep, ((1 + FEW_GROUPS / freedom) * own) ** 2 / freedom, 0.0)
    variance = np.maximum(variance, pooled)
    freedom_of_all = np.where(spread > 0, variance**2 / np.where(spread > 0, spread, 1.0), 1.0)
    return np.sqrt(variance), np.maximum(freedom_of_all, 1.0)
