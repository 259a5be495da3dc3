"""Tests of a preference that know who answered what: counts or answers in, p-values and intervals out.

The default takes one share a participant against one half. Where motions are a sample too, a second test lets both
participants and motions vary (Clark 1973 asks for that; the variance is that of Cameron, Gelbach & Miller 2011).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from study.analysis import estimates
from study.analysis.rank_tests import NO_RANKS, signed_rank

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]

STUDENT, SIGN = "Student's t over participants", "exact sign test"


def default_p_values(chosen: ArrayLike, shown: ArrayLike) -> FloatArray:
    """Return the p-value of the default test of many studies at once.

    Parameters
    ----------
    chosen, shown : array_like, shape (..., participants)
        How often each participant favoured the first method, of how many answers; nobody where `shown` is 0.

    Returns
    -------
    ndarray, shape (...)
        Student's t of the participants' shares against one half; the exact sign test where all shares are the same;
        NaN with fewer than two participants.
    """
    yes, total = np.broadcast_arrays(np.asarray(chosen, dtype=np.float64), np.asarray(shown, dtype=np.float64))
    there = total > 0
    share = np.where(there, yes / np.where(there, total, 1.0), 0.0)
    student = student_p_values(share, there, 0.5)
    people = there.sum(axis=-1)
    mean = share.sum(axis=-1) / np.maximum(people, 1)
    sign = np.where(np.abs(mean - 0.5) <= 1e-12, 1.0, np.minimum(1.0, 2.0 * 0.5**people))
    return np.asarray(np.where((people > 1) & np.isnan(student), sign, student), dtype=np.float64)


def student_p_values(values: FloatArray, there: NDArray[np.bool_], expected: float) -> FloatArray:
    """Return the p-values of Student's t of many samples at once; NaN where a sample has no spread to judge by.

    Parameters
    ----------
    values, there : ndarray, shape (..., participants)
        One number a participant, and who is there.
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


def participant_tests(chosen: ArrayLike, shown: ArrayLike, confidence: float = 0.95) -> dict[str, Any]:
    """Test the preference with one number a participant.

    Parameters
    ----------
    chosen, shown : array_like, shape (participants,)
        How often each favoured the first method, of how many answers.
    confidence
        Of the interval.

    Returns
    -------
    dict
        `participants`, `mean_percent`, `standard_error` (percent), `low`, `high` (percent), `t`, `degrees_of_freedom`,
        `p_value` and `test` (see `default_p_values`), `wilcoxon_p_value`, `robust_chi_square`, `robust_p_value` (pooled
        difference over its variance between participants, referred to F(1, participants - 1)), `for_a`, `for_b`,
        `undecided` (participants), `note`.
    """
    yes, total = np.asarray(chosen, dtype=np.float64), np.asarray(shown, dtype=np.float64)
    share = yes[total > 0] / total[total > 0]
    test = estimates.mean_test(share, 0.5, confidence)
    p_value = estimates.finite(float(default_p_values(yes, total)))
    robust = _robust_chi_square(yes, total)
    low, high = test.interval.low, test.interval.high
    by_ranks = signed_rank(share - 0.5)
    return {
        "participants": test.participants,
        "mean_percent": None if test.mean is None else 100 * test.mean,
        "standard_error": None if test.standard_error is None else 100 * test.standard_error,
        "low": None if low is None else 100 * max(low, 0.0),
        "high": None if high is None else 100 * min(high, 1.0),
        "t": test.statistic,
        "degrees_of_freedom": test.degrees_of_freedom,
        "p_value": p_value,
        "test": "none" if p_value is None else SIGN if test.p_value is None else STUDENT,
        "wilcoxon_p_value": by_ranks,
        "robust_chi_square": robust,
        "robust_p_value": None if robust is None else estimates.f_probability(robust, 1, test.participants - 1),
        "for_a": int((share > 0.5).sum()),
        "for_b": int((share < 0.5).sum()),
        "undecided": int((share == 0.5).sum()),
        "note": "; ".join(filter(None, (test.note, NO_RANKS if by_ranks is None else ""))),
    }


def _robust_chi_square(chosen: FloatArray, shown: FloatArray) -> float | None:
    """Squared pooled difference from an even split over its variance between participants."""
    count = int((shown > 0).sum())
    if count < 2:
        return None
    pooled = chosen.sum() / shown.sum()
    variance = float(((chosen - shown * pooled) ** 2).sum()) * count / (count - 1)
    if variance <= 1e-12:
        return None
    return float((chosen.sum() - shown.sum() / 2) ** 2) / variance


def motions_as_sample(part: pd.DataFrame, confidence: float = 0.95) -> dict[str, Any]:
    """Test the preference with the motions as a sample of all motions that could have been shown.

    Parameters
    ----------
    part
        Columns `participant`, `motion`, `chose_a` (0, 1, or one half for a tie).

    Returns
    -------
    dict
        `by_motion`: one share a motion against one half (Student's t: `motions`, `mean_percent`, `low`, `high`, `t`,
        `degrees_of_freedom`, `p_value`); it takes the participants as they are. `both`: the pooled share with a
        variance that lets participants and motions vary, Student's t with the smaller number of them less one
        (`percent`, `standard_error`, `low`, `high`, `t`, `degrees_of_freedom`, `p_value`). `note` says why something
        can't be given.

    Notes
    -----
    A mixed model with crossed random effects would rest its intervals on a normal approximation over as few motions as
    there are (8 in 2004), so it is not used. The variance in `both` is that of sums over participants, plus that over
    motions, less that of single answers, each corrected for its number of groups; never below the last, so that the
    test errs too seldom rather than too often where neither participants nor motions differ.
    """
    if "motion" not in part.columns or part["motion"].nunique() < 2:
        return {"by_motion": None, "both": None, "note": "fewer than two motions: they can't stand for others"}
    shares = part.groupby(part["motion"].astype(str))["chose_a"].mean().to_numpy(dtype=np.float64)
    test = estimates.mean_test(shares, 0.5, confidence)
    ends = test.interval.low, test.interval.high
    by_motion = {
        "motions": test.participants,
        "mean_percent": 100 * float(shares.mean()),
        "low": None if ends[0] is None else 100 * max(ends[0], 0.0),
        "high": None if ends[1] is None else 100 * min(ends[1], 1.0),
        "t": test.statistic,
        "degrees_of_freedom": test.degrees_of_freedom,
        "p_value": test.p_value,
    }
    both, note = _both_vary(part, confidence)
    return {"by_motion": by_motion, "both": both, "note": note or test.note.replace("participants", "motions")}


def _both_vary(part: pd.DataFrame, confidence: float) -> tuple[dict[str, Any] | None, str]:
    chosen = part["chose_a"].to_numpy(dtype=np.float64)
    names = [part[column].astype(str).to_numpy() for column in ("participant", "motion")]
    groups = [np.unique(name, return_inverse=True)[1] for name in names]
    fewest = min(int(group.max()) + 1 for group in groups)
    if fewest < 2:
        return None, "one participant: nothing can be said about others"
    cells = np.unique(np.column_stack(groups), axis=0, return_inverse=True)[1].ravel()
    apart = chosen - chosen.mean()
    variances = [_variance_of_sums(apart, group) for group in groups]
    # Answers of one participant to one motion count in both sums, and so once too often; by themselves they are the
    # least that there can be.
    single = float((np.bincount(cells, apart) ** 2).sum()) / len(chosen) ** 2
    variance = max(sum(variances) - single, single)
    if variance <= 1e-12:
        return None, "all answers alike: there is no spread to judge by"
    error, mean = math.sqrt(variance), float(chosen.mean())
    half = estimates.t_quantile(confidence, fewest - 1) * error
    found = {
        "percent": 100 * mean,
        "standard_error": 100 * error,
        "low": 100 * max(mean - half, 0.0),
        "high": 100 * min(mean + half, 1.0),
        "t": (mean - 0.5) / error,
        "degrees_of_freedom": fewest - 1,
        "p_value": estimates.t_probability((mean - 0.5) / error, fewest - 1),
    }
    return found, ""


def _variance_of_sums(apart: FloatArray, group: NDArray[np.intp]) -> float:
    count = int(group.max()) + 1
    return float((np.bincount(group, apart) ** 2).sum()) * count / (count - 1) / len(apart) ** 2
