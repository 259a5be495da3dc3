"""Evidence for no preference: shares of participants in, an equivalence test and a Bayes factor out.

A test that does not find a difference has not shown that there is none (2004's study four found none between geodesic
and time-warped blend lengths). Equivalence is shown where the interval lies within a margin stated beforehand; the
Bayes factor weighs no difference against differences of the usual size.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from study.analysis.estimates import Interval, mean_test, t_quantile

MARGIN = 0.1
PRIOR_SCALE = math.sqrt(0.5)


@dataclass(frozen=True)
class NoEffect:
    """How far the data speak for no preference."""

    margin: float
    """Difference from an even split that still counts as none (0.1 is 40 to 60%)."""
    equivalence_p_value: float | None
    """The larger of two one-sided t tests (Schuirmann 1987); small where the share lies within the margin."""
    interval: Interval
    """Of the mean share, of twice the error rate (90% for alpha .05): equivalent where it lies within the margin."""
    bayes_factor_null: float | None
    """How many times likelier the data are without a preference than with one (Rouder et al. 2009, Cauchy prior of
    scale 0.707 on the standardised effect)."""
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
        return NoEffect(margin, None, Interval(None, None, 1 - 2 * alpha), None, test.note)
    freedom, error = test.degrees_of_freedom, test.standard_error
    above = float(stdtr(freedom, -(test.mean - (0.5 - margin)) / error))
    below = float(stdtr(freedom, (test.mean - (0.5 + margin)) / error))
    half = t_quantile(1 - 2 * alpha, freedom) * error
    interval = Interval(test.mean - half, test.mean + half, 1 - 2 * alpha)
    return NoEffect(margin, max(above, below), interval, bayes_factor_null(test.t, test.participants))


def bayes_factor_null(statistic: float, participants: int, scale: float = PRIOR_SCALE) -> float | None:
    """Return the Bayes factor for no effect of a one-sample t (Rouder, Speckman, Sun, Morey & Iverson 2009, eq. 1).

    Parameters
    ----------
    statistic, participants
        Student's t, and how many values it rests on.
    scale
        Of the Cauchy prior on the standardised effect.

    Examples
    --------
    >>> round(bayes_factor_null(2.03, 80, scale=1.0), 2)
    1.56
    """
    from scipy.integrate import quad

    freedom = participants - 1
    if freedom < 1 or not np.isfinite(statistic):
        return None
    null = -(freedom + 1) / 2 * math.log1p(statistic**2 / freedom)

    def alternative(log_g: float) -> float:
        grown = 1 + participants * math.exp(log_g) * scale**2
        likelihood = -0.5 * math.log(grown) - (freedom + 1) / 2 * math.log1p(statistic**2 / (grown * freedom))
        prior = -0.5 * math.log(2 * math.pi) - 1.5 * log_g - 0.5 * math.exp(-log_g)
        return math.exp(likelihood + prior + log_g - null)

    total = quad(alternative, -12.0, 30.0, limit=200)[0]
    return 1 / total if total > 0 else None
