"""What every analysis shares: intervals for proportions, tests of participants, and clustering.

Arrays of counts come in, estimates with their uncertainty go out. Answers of one participant are not independent of
each other, so whatever pools answers also says how alike the answers of a participant were (intraclass correlation)
and how much that costs (design effect).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from study.arrays import BoolArray, FloatArray
from study.counting import counted, noun
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd


LARGEST = 1e12
"""Levels, differences and ratings beyond this are slips, and their squares are past what a computer counts with."""


@dataclass(frozen=True)
class Interval:
    """A confidence interval; an end that the data leave open is None."""

    low: float | None
    high: float | None
    confidence: float = 0.95


@dataclass(frozen=True)
class NotFitted:
    """What stands where a model could not be fitted: why not."""

    note: str


@dataclass(frozen=True)
class Mean:
    """The mean over participants, with Student's interval; None where there are too few, and `note` says why."""

    participants: int
    mean: float | None
    standard_error: float | None
    low: float | None
    high: float | None
    note: str


@dataclass(frozen=True)
class MeanTest(Mean):
    """The mean against an expected value; `t` is None where the participants are all alike and it can't be formed."""

    t: float | None
    degrees_of_freedom: float | None
    p_value: float | None


@dataclass(frozen=True)
class Clustering:
    """How alike the answers of one participant are."""

    intraclass_correlation: float | None
    """One-way analysis of variance estimator; below zero where participants are more alike than chance would have
    it."""
    answers_per_participant: float | None
    """The mean number of answers, adjusted for unequal numbers."""
    design_effect: float | None
    """1 + (answers - 1) x correlation: by how much the variance of a pooled percentage exceeds the one of as many
    independent answers."""
    effective_answers: float | None
    """The answers divided by the design effect."""
    note: str = ""
    """Why nothing can be given; empty where all can."""


def normal_quantile(confidence: float) -> float:
    """Return z such that a standard normal lies within +-z with this probability."""
    from scipy.special import ndtri

    return float(ndtri(0.5 + confidence / 2))


def t_quantile(confidence: float, degrees_of_freedom: float) -> float:
    """Return t such that Student's t lies within +-t with this probability."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees_of_freedom, 0.5 + confidence / 2))


def t_probability(statistic: float, degrees_of_freedom: float) -> float:
    """Return the two-sided p-value of Student's t."""
    from scipy.special import stdtr

    return float(2 * stdtr(degrees_of_freedom, -abs(statistic)))


def chi_square_probability(statistic: float, degrees_of_freedom: int) -> float:
    """Return the upper tail of the chi-square distribution."""
    from scipy.special import chdtrc

    return float(chdtrc(degrees_of_freedom, max(statistic, 0.0)))


def f_probability(statistic: float, numerator: float, denominator: float) -> float:
    """Return the upper tail of the F distribution."""
    from scipy.special import fdtrc

    return float(fdtrc(numerator, denominator, max(statistic, 0.0)))


def wilson_interval(successes: float, trials: float, confidence: float = 0.95) -> Interval:
    """Return Wilson's score interval of a proportion (E. B. Wilson 1927), each answer taken as independent.

    Open at both ends where there were no trials.
    """
    if trials <= 0:
        return Interval(None, None, confidence)
    z = normal_quantile(confidence)
    share = successes / trials
    centre = (share + z * z / (2 * trials)) / (1 + z * z / trials)
    half = z / (1 + z * z / trials) * math.sqrt(share * (1 - share) / trials + z * z / (4 * trials * trials))
    return Interval(max(0.0, centre - half), min(1.0, centre + half), confidence)


def binomial_probability(successes: int, trials: int, expected: float = 0.5) -> float | None:
    """Return the exact two-sided binomial p-value, of all counts no likelier than this one; None without trials."""
    if trials <= 0:
        return None
    from scipy.special import gammaln, xlog1py, xlogy  # scipy.stats takes half a second to import

    counts = np.arange(trials + 1)
    ways = gammaln(trials + 1) - gammaln(counts + 1) - gammaln(trials - counts + 1)
    logarithms = ways + xlogy(counts, expected) + xlog1py(trials - counts, -expected)
    as_rare = logarithms <= logarithms[successes] + 1e-7  # equally likely counts differ by rounding
    return min(1.0, float(np.exp(logarithms[as_rare]).sum()))


def mean_of(values: ArrayLike, confidence: float = 0.95) -> Mean:
    """Return the mean of one value a participant, with Student's interval.

    Parameters
    ----------
    values : array_like, shape (participants,)
        One number a participant; NaN is ignored.

    Notes
    -----
    Where all participants give the same value, the spread is not known to be zero, it was only not seen: the interval
    stays open.
    """
    data = np.asarray(values, dtype=np.float64)
    data = data[np.isfinite(data)]
    count = len(data)
    if count == 0:
        return Mean(0, None, None, None, None, "no answers")
    mean = float(data.mean())
    if count == 1:
        return Mean(1, mean, None, None, None, "one participant: no spread to estimate")
    spread = float(data.std(ddof=1))
    if spread <= 1e-12:
        people = counted(count, "participant")
        note = f"all {people} gave the same value: the spread between participants can't be estimated"
        return Mean(count, mean, 0.0, None, None, note)
    error = spread / math.sqrt(count)
    half = t_quantile(confidence, count - 1) * error
    return Mean(count, mean, error, mean - half, mean + half, "")


def mean_test(values: ArrayLike, expected: float = 0.5, confidence: float = 0.95) -> MeanTest:
    """Test the mean of one value a participant (see `mean_of`) against `expected`, by Student's t."""
    found = mean_of(values, confidence)
    freedom = found.participants - 1
    if not found.standard_error or found.mean is None:
        return MeanTest(**vars(found), t=None, degrees_of_freedom=freedom if freedom > 0 else None, p_value=None)
    t = (found.mean - expected) / found.standard_error
    return MeanTest(**vars(found), t=t, degrees_of_freedom=freedom, p_value=t_probability(t, freedom))


def in_percent(test: MeanTest) -> MeanTest:
    """Return the test of a share as one of a percentage."""
    values = {name: getattr(test, name) for name in ("mean", "standard_error", "low", "high")}
    return MeanTest(**vars(test) | {name: None if value is None else 100 * value for name, value in values.items()})


def student_p_values(values: FloatArray, there: BoolArray, expected: float) -> FloatArray:
    """Return the p-values of Student's t of many samples at once; NaN where a sample has no spread to judge by.

    Parameters
    ----------
    values, there : ndarray, shape (..., participants)
        One number a participant, and the participants.
    expected
        The mean where there is no effect.

    Returns
    -------
    ndarray, shape (...)
    """
    from scipy.special import stdtr

    count = there.sum(axis=-1)
    people = np.where(count > 1, count, 2)
    mean = np.where(there, values, 0.0).sum(axis=-1) / np.maximum(count, 1)
    variance = np.where(there, (values - mean[..., None]) ** 2, 0.0).sum(axis=-1) / (people - 1)
    known = (count > 1) & (variance > 1e-24)
    statistic = np.abs(mean - expected) / np.sqrt(np.where(known, variance, 1.0) / people)
    return np.asarray(np.where(known, 2 * stdtr(people - 1, -statistic), np.nan), dtype=np.float64)


def clustering(successes: ArrayLike, trials: ArrayLike) -> Clustering:
    """Estimate how alike the answers of one participant are, from a one-way analysis of variance of yes-no answers.

    Parameters
    ----------
    successes, trials : array_like, shape (participants,)
        Counts a participant.

    Notes
    -----
    Fleiss, Levin & Paik 2003, chapter 15.2; the answers per participant are `n0` there. The design effect is not
    taken below what the estimate says: a value under 1 means that answers pooled are a little better than independent.
    """
    yes, shown = np.asarray(successes, dtype=np.float64), np.asarray(trials, dtype=np.float64)
    yes, shown = yes[shown > 0], shown[shown > 0]
    groups, total = len(shown), float(shown.sum())
    if groups < 2 or total <= groups:
        return Clustering(
            None, None, None, None, "fewer than two participants, or one answer each: it cannot be estimated"
        )
    share, pooled = yes / shown, float(yes.sum()) / total
    between = float((shown * (share - pooled) ** 2).sum()) / (groups - 1)
    within = float((shown * share * (1 - share)).sum()) / (total - groups)
    size = (total - float((shown**2).sum()) / total) / (groups - 1)
    spread = between + (size - 1) * within
    if spread <= 1e-12:
        return Clustering(None, size, None, None, "all answers are the same: there is no variance")
    correlation = (between - within) / spread
    effect = max(1 + (size - 1) * correlation, 0.0)
    if effect <= 0:
        return Clustering(correlation, size, effect, None, "participants are more similar than expected by chance")
    return Clustering(correlation, size, effect, total / effect)


def holm(p_values: Sequence[float | None]) -> list[float | None]:
    """Return p-values adjusted by Holm's step-down method (1979), in the order given; None stays None."""
    known = sorted((p, place) for place, p in enumerate(p_values) if p is not None)
    adjusted: list[float | None] = [None] * len(p_values)
    largest = 0.0
    for rank, (p, place) in enumerate(known):
        adjusted[place] = largest = max(largest, min(1.0, p * (len(known) - rank)))
    return adjusted


def resampled_weights(participants: int, resamples: int, rng: np.random.Generator) -> FloatArray:
    """Return how often each participant is drawn in each bootstrap sample, shape (resamples, participants)."""
    return rng.multinomial(participants, np.full(participants, 1 / participants), size=resamples).astype(np.float64)


def jackknife_error(left_out: FloatArray) -> float | None:
    """Return the standard error of an estimate from its values with each participant omitted in turn.

    None where one of these values is not finite: the estimate then hangs on single participants.
    """
    count = len(left_out)
    if count < 2 or not np.isfinite(left_out).all():
        return None
    return math.sqrt((count - 1) / count * float(((left_out - left_out.mean()) ** 2).sum()))


def check_columns(table: pd.DataFrame, names: Sequence[str], analysis: str) -> None:
    """Refuse a table that lacks columns.

    Raises
    ------
    AnalysisError
        Naming what is missing.
    """
    missing = [name for name in names if name not in table.columns]
    if missing:
        raise AnalysisError(
            f"expected columns {', '.join(names)} for {analysis}, found none named {', '.join(missing)}; name them so "
            "in the table"
        )


def check_participants(table: pd.DataFrame) -> None:
    """Refuse rows without a participant.

    Raises
    ------
    AnalysisError
        When a row has no participant.
    """
    nameless = int(table["participant"].isna().sum())
    if nameless:
        rows = noun(nameless, "row")
        raise AnalysisError(f"expected a participant in every row, found {nameless} {rows} without; remove them")


def check_share(value: float, name: str) -> None:
    """Refuse a confidence or a threshold proportion that is not between 0 and 1.

    Raises
    ------
    AnalysisError
        Unless it lies between 0 and 1, ends excluded.
    """
    if not 0 < value < 1:
        raise AnalysisError(f"expected a {name} between 0 and 1 (0.95, not 95), found {value:g}")


def numbers(values: ArrayLike, name: str) -> FloatArray:
    """Return values as numbers.

    Raises
    ------
    AnalysisError
        Naming the first that is not a number, or too large.
    """
    try:
        found = np.asarray(values, dtype=np.float64)
        large = found[np.isfinite(found) & (np.abs(found) > LARGEST)]
        if not large.size:
            return found
        raise AnalysisError(
            f"expected at most {LARGEST:g} in {name}, found {large[0]:g}; correct it, or change the unit"
        )
    except (TypeError, ValueError):
        pass
    for value in np.asarray(values, dtype=object).ravel():
        try:
            float(value)
        except (TypeError, ValueError):
            raise AnalysisError(f"expected numbers in {name}, found {value!r}; recode or remove that row") from None
    raise AnalysisError(f"expected {name} as an array of numbers, found rows of different lengths")
