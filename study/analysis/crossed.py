"""Means that hold for other participants and other motions: values by participant and motion in, tests out.

Participants and motions are both samples (Clark 1973): the variance of the mean is that between participants plus
that between motions less what both contain of the rest, and Student's t takes the degrees of freedom of Satterthwaite
1946. With three to eight motions the share of variance between them is hardly known, which two rules allow for:

- A variance component that chance alone gives often is taken as none, and its sum of squares joins the rest: often is
  in half of all samples where there are three groups, in a quarter where there are six or more, whose F tells more.
  Otherwise the interval is far too wide where motions do not differ.
- A variance from few groups is small by chance just where it also makes the t value large, so Satterthwaite's
  degrees of freedom are too many; here they are counted as if that variance were `1 + 0.9 / (groups - 1) / root F`
  times itself. Where motions decide all (F is large), what is left is Student's t of their means.

Both were settled by simulation (`benchmarks/group_tests.py crossed`), which gives the error rates.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from study.analysis import estimates
from study.analysis.headline import holds_for
from study.analysis.rank_tests import signed_rank
from study.arrays import FloatArray, IntArray

if TYPE_CHECKING:
    import pandas as pd

FEWEST_MOTIONS = 3
"""Two can't say how far motions differ."""

OVER_BOTH, STUDENT = "Student's t over participants and motions", "Student's t over participants"
BOTH = "participants and motions"

KEPT_BELOW, KEPT_OF_FEW, GROUPS_OF_FEW = 0.25, 0.5, 3
"""The p-value of its F test below which a variance component is kept: of few groups, and of twice as many or more."""

FEW_GROUPS = 0.9

_ROUNDS = 60
"""Rounds in which the means of participants and motions are found where answers are missing; far more than needed."""


@dataclass(frozen=True)
class GeneralTest(estimates.MeanTest):
    """The mean against an expected value by the test that generalises furthest.

    `test` is Student's t over participants and motions, or with fewer than three motions over participants; the exact
    sign test where all values are the same. `generalises_to` is what it then holds for.
    """

    test: str
    generalises_to: str


def general_test(values: pd.Series[float], expected: float = 0.0, confidence: float = 0.95) -> GeneralTest:
    """Test the mean of values that are indexed by participant, and by motion where motions are known."""
    data = values.dropna()
    own = data.groupby(level=0).mean()
    people = estimates.mean_test(own, expected, confidence)
    if data.index.nlevels > 1 and people.participants > 1 and data.index.unique(1).size >= FEWEST_MOTIONS:
        table = data.groupby(level=[0, 1]).mean().unstack()
        found = crossed(table.fillna(0.0), table.notna())
        mean, error, freedom = (float(value) for value in (found.mean, found.error, found.freedom))
        if error > 1e-9:
            half, t = estimates.t_quantile(confidence, freedom) * error, (mean - expected) / error
            p_value = estimates.t_probability(t, freedom)
            return GeneralTest(
                people.participants, mean, error, mean - half, mean + half, "", t, freedom, p_value, OVER_BOTH, BOTH
            )
    sign = signed_rank(own - expected) if people.p_value is None else None
    test = "exact sign test" if sign is not None else "none" if people.p_value is None else STUDENT
    told = vars(people) | {"p_value": people.p_value if sign is None else sign}
    return GeneralTest(**told, test=test, generalises_to=holds_for(people.participants))


@dataclass(frozen=True, eq=False)
class Crossed:
    """Means of many studies, each with its standard error and degrees of freedom; shape (...) each.

    The error is 0 where all answers are the same, and NaN with fewer than two participants or motions.
    """

    mean: FloatArray
    error: FloatArray
    freedom: FloatArray

    def p_values(self, expected: float = 0.5) -> FloatArray:
        """Two-sided p-values against an expected mean; NaN where there is no spread."""
        from scipy.special import stdtr

        with np.errstate(divide="ignore", invalid="ignore"):
            statistic = np.abs(self.mean - expected) / self.error
        known = self.error > 1e-9
        return np.asarray(np.where(known, 2 * stdtr(self.freedom, -np.where(known, statistic, 0.0)), np.nan))


def crossed(sums: ArrayLike, counts: ArrayLike) -> Crossed:
    """Estimate a mean over participants and motions.

    Parameters
    ----------
    sums, counts : array_like, shape (..., participants, motions)
        The sum of each participant's values in each motion, of how many values. Of a preference: how often the first
        method was favoured (a tie is one half), of how many answers.
    """
    yes, total = np.broadcast_arrays(np.asarray(sums, dtype=np.float64), np.asarray(counts, dtype=np.float64))
    there = total > 0
    answers = np.maximum(total.sum(axis=(-1, -2)), 1.0)
    mean = np.where(there, yes, 0.0).sum(axis=(-1, -2)) / answers
    apart = np.where(there, yes - total * mean[..., None, None], 0.0)
    cells = there.sum(axis=(-1, -2))
    between, groups = [], []
    for axis in (-1, -2):
        count = there.any(axis=axis).sum(axis=-1)
        few = np.maximum(count - 1, 1)
        between.append((apart.sum(axis=axis) ** 2).sum(axis=-1) * count / few / answers**2)
        groups.append(count)
    rest_freedom = np.maximum(cells - groups[0] - groups[1] + 1, 0)
    left = apart - total * _means(apart, total)
    rest = (left**2).sum(axis=(-1, -2)) * cells / np.maximum(rest_freedom, 1) / answers**2
    error, freedom = _combined(between, [np.maximum(count - 1, 1) for count in groups], rest, rest_freedom)
    known = (groups[0] > 1) & (groups[1] > 1)
    return Crossed(mean, np.where(known, error, np.nan), np.where(known, freedom, np.nan))


def _kept_below(groups: IntArray | int) -> FloatArray:
    """The p-value below which a variance between so many groups is kept."""
    return np.asarray(np.clip(KEPT_OF_FEW * GROUPS_OF_FEW / groups, KEPT_BELOW, KEPT_OF_FEW))


def _satterthwaite(own: FloatArray, freedom: IntArray, rest: FloatArray) -> FloatArray:
    """Squared variance over degrees of freedom of a variance between groups, with the allowance for few of them."""
    inverse_f = np.minimum(rest / np.where(own > 0, own, 1.0), 1.0)
    allowance = 1 + FEW_GROUPS / freedom * np.sqrt(inverse_f)
    return np.asarray((allowance * own) ** 2 / freedom)


@dataclass(frozen=True)
class BetweenMotions:
    """What motions that differ add to the variance of a mean over them, beside what is known of these motions."""

    added: float
    satterthwaite: float
    """The part of Satterthwaite's sum, squared variance over degrees of freedom, that comes from motions."""
    deviation: float
    """Standard deviation across motions."""


def between_motions(values: FloatArray, covariance: FloatArray) -> BetweenMotions:
    """Estimate how far estimates of one thing for each motion differ beyond their own errors.

    Parameters
    ----------
    values : ndarray, shape (motions,)
        An estimate for each.
    covariance : ndarray, shape (motions, motions)
        Of their errors; what participants contribute is common to all.
    """
    from scipy.special import chdtrc

    count, freedom = len(values), len(values) - 1
    if count < FEWEST_MOTIONS:
        return BetweenMotions(0.0, 0.0, 0.0)
    own = values.var(ddof=1) / count
    rest = np.maximum((np.trace(covariance) / count - covariance.mean()) / freedom, 1e-12)
    if chdtrc(freedom, freedom * own / rest) >= _kept_below(count):
        return BetweenMotions(0.0, 0.0, 0.0)
    added, part = max(own - rest, 0.0), _satterthwaite(own, np.asarray(freedom), rest)
    return BetweenMotions(float(added), float(part), float(np.sqrt(added * count)))


def general_p_values(alone: FloatArray, sums: FloatArray, counts: FloatArray, expected: float = 0.0) -> FloatArray:
    """Return the p-values of `general_test` of many studies at once, shape (...).

    Parameters
    ----------
    alone : ndarray, shape (...)
        Those over participants, for studies with fewer than three motions.
    sums, counts : ndarray, shape (..., participants, motions)
        As in `crossed`.
    """
    if counts.shape[-1] < FEWEST_MOTIONS:
        return alone
    both = crossed(sums, counts).p_values(expected)
    enough = (counts > 0).any(axis=-2).sum(axis=-1) >= FEWEST_MOTIONS
    return np.asarray(np.where(enough & ~np.isnan(both), both, alone))


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
        kept.append(~has_rest | ((chance < _kept_below(freedom + 1)) & (variance > 0)))
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
        spread = spread + np.where(keep, _satterthwaite(own, freedom, pooled), 0.0)
    variance = np.maximum(variance, pooled)
    freedom_of_all = np.where(spread > 0, variance**2 / np.where(spread > 0, spread, 1.0), 1.0)
    return np.sqrt(variance), np.maximum(freedom_of_all, 1.0)
