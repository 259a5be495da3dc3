"""Tests of a preference by each participant's percentage against 50%: counts in, p-values and intervals out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from study.analysis import estimates
from study.analysis.crossed import STUDENT
from study.analysis.rank_tests import NO_RANKS, signed_rank
from study.arrays import FloatArray

SIGN = "exact sign test"


@dataclass(frozen=True)
class ParticipantTests:
    """The preference with one number a participant; `note` says why something can't be given.

    `test` and `p_value` are those of `default_p_values`.
    """

    participants: int
    mean_percent: float | None
    standard_error: float | None
    low: float | None
    high: float | None
    t: float | None
    degrees_of_freedom: float | None
    p_value: float | None
    test: str
    wilcoxon_p_value: float | None
    for_a: int
    for_b: int
    undecided: int
    note: str


def default_p_values(chosen: ArrayLike, shown: ArrayLike) -> FloatArray:
    """Return the p-value of the default test of many studies at once.

    Parameters
    ----------
    chosen, shown : array_like, shape (..., participants)
        How often each participant favoured the first method, of how many answers; ignored where `shown` is 0.

    Returns
    -------
    ndarray, shape (...)
        Student's t of the participants' shares against one half; the exact sign test where all shares are the same;
        NaN with fewer than two participants.
    """
    yes, total = np.broadcast_arrays(np.asarray(chosen, dtype=np.float64), np.asarray(shown, dtype=np.float64))
    there = total > 0
    share = np.where(there, yes / np.where(there, total, 1.0), 0.0)
    student = estimates.student_p_values(share, there, 0.5)
    people = there.sum(axis=-1)
    mean = share.sum(axis=-1) / np.maximum(people, 1)
    sign = np.where(np.abs(mean - 0.5) <= 1e-12, 1.0, np.minimum(1.0, 2.0 * 0.5**people))
    return np.asarray(np.where((people > 1) & np.isnan(student), sign, student), dtype=np.float64)


def participant_tests(chosen: ArrayLike, shown: ArrayLike, confidence: float = 0.95) -> ParticipantTests:
    """Test the preference with one number a participant.

    Parameters
    ----------
    chosen, shown : array_like, shape (participants,)
        How often each favoured the first method, of how many answers.
    """
    yes, total = np.asarray(chosen, dtype=np.float64), np.asarray(shown, dtype=np.float64)
    share = yes[total > 0] / total[total > 0]
    test = estimates.in_percent(estimates.mean_test(share, 0.5, confidence))
    p_value = float(default_p_values(yes, total)) if test.participants > 1 else None
    by_ranks = signed_rank(share - 0.5)
    return ParticipantTests(
        participants=test.participants,
        mean_percent=test.mean,
        standard_error=test.standard_error,
        low=None if test.low is None else max(test.low, 0.0),
        high=None if test.high is None else min(test.high, 100.0),
        t=test.t,
        degrees_of_freedom=test.degrees_of_freedom,
        p_value=p_value,
        test="none" if p_value is None else SIGN if test.p_value is None else STUDENT,
        wilcoxon_p_value=by_ranks,
        for_a=int((share > 0.5).sum()),
        for_b=int((share < 0.5).sum()),
        undecided=int((share == 0.5).sum()),
        note="; ".join(filter(None, (test.note, NO_RANKS if by_ranks is None else ""))),
    )
