"""Evidence for no preference: shares of participants in, an equivalence test out.

A test that does not find a difference has not shown that there is none (2004's study four found none between geodesic
and time-warped blend lengths). Equivalence is shown where the interval lies within a margin stated beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from study.analysis.estimates import Interval, mean_test, t_quantile

MARGIN = 0.1


@dataclass(frozen=True)
class NoEffect:
    """How far the data speak for no preference."""

    margin: float
    """Difference from an even split that still counts as none (0.1 is 40 to 60%)."""
    equivalence_p_value: float | None
    """The larger of two one-sided t tests (Schuirmann 1987); small where the share lies within the margin."""
    interval: Interval
    """Of the mean share, of twice the error rate (90% for alpha .05): equivalent where it lies within the margin."""
    note: str = ""
    """Why something can't be given."""


def no_preference(shares: ArrayLike, margin: float = MARGIN, alpha: float = 0.05) -> NoEffect:
    """Weigh the evidence for an even split.

    Parameters
    ----------
    shares : array_like, shape (participants,)
        Each participant's share of answers for the first method, 0 to 1.
    alpha
        Error rate of the equivalence test.
    """
    from scipy.special import stdtr

    test = mean_test(shares, 0.5, 1 - 2 * alpha)
    if test.t is None or test.standard_error is None or test.mean is None or test.degrees_of_freedom is None:
        return NoEffect(margin, None, Interval(None, None, 1 - 2 * alpha), test.note)
    freedom, error = test.degrees_of_freedom, test.standard_error
    above = float(stdtr(freedom, -(test.mean - (0.5 - margin)) / error))
    below = float(stdtr(freedom, (test.mean - (0.5 + margin)) / error))
    half = t_quantile(1 - 2 * alpha, freedom) * error
    interval = Interval(test.mean - half, test.mean + half, 1 - 2 * alpha)
    return NoEffect(margin, max(above, below), interval)
