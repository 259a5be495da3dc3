"""Sensitivity at each level of a same-different task: hits and false alarms in, d-prime out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from study.analysis.same_different.counts import Counts
from study.analysis.same_different.fits import d_prime_interval
from study.counting import counted
from study.errors import AnalysisError
from study.models.differencing import ROOT_TWO, detected


@dataclass(frozen=True)
class DPrime:
    """Sensitivity, answers taken as independent; None where there are no pairs of a kind.

    `d_prime` is by the differencing rule, and 0 where hits do not exceed false alarms. Its error is by the delta
    method, `low` and `high` are by profile likelihood; `high` is None where the answers set no upper end.
    `d_prime_independent` is that of the same rates under the rule of independent observations.
    """

    d_prime: float | None
    criterion: float | None
    standard_error: float | None
    low: float | None
    high: float | None
    d_prime_independent: float | None


@dataclass(frozen=True)
class LevelDPrime(DPrime):
    """Sensitivity at one difference in blend length, against the pairs with none; a `note` on what can't be."""

    difference_frames: float
    note: str


def d_prime(hits: float, different_pairs: float, alarms: float, same_pairs: float, confidence: float = 0.95) -> DPrime:
    """Return d-prime and criterion under the differencing rule, for a table of hits and false alarms.

    Parameters
    ----------
    hits, different_pairs
        Answers "different" of all answers where there was a difference.
    alarms, same_pairs
        The same where there was none.

    Raises
    ------
    AnalysisError
        For counts that can't be.

    Notes
    -----
    One half is added to each count of answers, one to each count of pairs (Hautus 1995), so that 0 and 100% stay
    finite; this pulls d-prime towards 0 where there are few answers. The interval is that of the counts as they are.
    """
    from scipy.optimize import brentq
    from scipy.special import ndtri

    for yes, pairs in ((hits, different_pairs), (alarms, same_pairs)):
        if not 0 <= yes <= pairs < np.inf:
            raise AnalysisError(
                f"expected counts with 0 <= different <= pairs, found {yes} of {counted(pairs, 'pair')}; count again"
            )
    if different_pairs == 0 or same_pairs == 0:
        return DPrime(None, None, None, None, None, None)
    hit, alarm = (hits + 0.5) / (different_pairs + 1), (alarms + 0.5) / (same_pairs + 1)

    def solve(hit: float, alarm: float) -> float:
        criterion = np.full(1, -ROOT_TWO * ndtri(alarm / 2))
        if hit <= alarm:
            return 0.0
        found = brentq(lambda delta: float(detected(np.full(1, delta), criterion)[0]) - hit, 0.0, 40.0)
        return float(found)

    value, step = solve(hit, alarm), 1e-5
    error = None
    if value > 0:
        by_hit = (solve(hit + step, alarm) - solve(hit - step, alarm)) / (2 * step)
        by_alarm = (solve(hit, alarm + step) - solve(hit, alarm - step)) / (2 * step)
        variance = by_hit**2 * hit * (1 - hit) / different_pairs + by_alarm**2 * alarm * (1 - alarm) / same_pairs
        error = float(np.sqrt(variance))
    low, high = d_prime_interval(hits, different_pairs, alarms, same_pairs, confidence)
    criterion = float(-ROOT_TWO * ndtri(alarm / 2))
    return DPrime(value, criterion, error, low, high, independent_d_prime(hit, alarm))


def independent_d_prime(hit: float, alarm: float) -> float:
    """Return d-prime under the rule of independent observations; 0 where hits do not exceed false alarms.

    Each of the two stimuli is judged by itself, and the answer is "different" where the judgements are. An unbiased
    observer is then right in a share p = Phi(d' / 2)^2 + Phi(-d' / 2)^2 of the pairs, and an observer with these rates
    would be in Phi((z(hit) - z(alarm)) / 2) of them without bias (Macmillan & Creelman 2005, chapter 9).

    Parameters
    ----------
    hit, alarm
        Shares of "different" at a difference and at none, above 0 and below 1.
    """
    from scipy.special import ndtr, ndtri

    correct = max(float(ndtr((ndtri(hit) - ndtri(alarm)) / 2)), 0.5)
    return float(2 * ndtri((1 + math.sqrt(2 * correct - 1)) / 2))


OPEN = "no more “different” than without a difference, or no upper end: the rest cannot be estimated"


def d_prime_table(counts: Counts, confidence: float = 0.95) -> tuple[LevelDPrime, ...]:
    """Return d-prime at every level against the pairs with no difference, answers pooled over participants."""
    same = counts.differences == 0
    alarms, same_pairs = float(counts.different[:, same].sum()), float(counts.shown[:, same].sum())
    rows = []
    for level in np.flatnonzero(~same):
        hits, pairs = float(counts.different[:, level].sum()), float(counts.shown[:, level].sum())
        found = d_prime(hits, pairs, alarms, same_pairs, confidence)
        ends = vars(found)
        note = "" if None not in ends.values() else "no pairs to tell it by" if found.d_prime is None else OPEN
        rows.append(LevelDPrime(**ends, difference_frames=float(counts.differences[level]), note=note))
    return tuple(rows)
