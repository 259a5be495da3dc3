"""How large an effect of an analysis of variance is: an F and its degrees of freedom in, shares of variance out.

Partial eta squared describes the sample and is too large on average; partial omega squared is less biased. Both
estimate one number, the share of variance that the effect explains beside the error, so one interval serves both: that
of the noncentrality which makes the observed F just too large or too small (Steiger 2004, Psychological Methods 9).
"""

from __future__ import annotations

from dataclasses import dataclass

from study.analysis.estimates import Interval

LARGEST = 1e6


@dataclass(frozen=True)
class EffectSize:
    """Shares of variance, 0 to 1.

    Attributes
    ----------
    partial_eta_squared
        Sum of squares of the effect over itself and the error's.
    partial_omega_squared
        The same with the part that chance puts into the effect taken out; not below 0.
    interval
        Of the share in the population, of 1 - 2 alpha (90% for alpha .05): it holds 0 exactly where F is not
        significant at alpha.
    """

    partial_eta_squared: float
    partial_omega_squared: float
    interval: Interval


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """The columns of a table that say how large an effect is; None where there is no F. The interval is of both."""

    partial_eta_squared: float | None = None
    partial_omega_squared: float | None = None
    effect_low: float | None = None
    effect_high: float | None = None


def sizes(f: float | None, degrees: float, error_degrees: float, alpha: float) -> Sizes:
    """Return the columns of an effect, see `effect_size`."""
    if f is None:
        return Sizes()
    found = effect_size(f, degrees, error_degrees, alpha)
    return Sizes(
        partial_eta_squared=found.partial_eta_squared,
        partial_omega_squared=found.partial_omega_squared,
        effect_low=found.interval.low,
        effect_high=found.interval.high,
    )


def effect_size(f: float, degrees: float, error_degrees: float, alpha: float = 0.05) -> EffectSize:
    """Return the size of an effect.

    Parameters
    ----------
    f, degrees, error_degrees
        The statistic, and its degrees of freedom.
    alpha
        Error rate at each end of the interval.

    Examples
    --------
    >>> round(effect_size(6.39, 1, 48).partial_eta_squared, 3)
    0.117
    """
    f = max(f, 0.0)
    omega = degrees * (f - 1) / (degrees * f + error_degrees + 1)
    low = _noncentrality(f, degrees, error_degrees, 1 - alpha)
    high = _noncentrality(f, degrees, error_degrees, alpha)
    total = degrees + error_degrees + 1
    ends = [None if end is None else end / (end + total) for end in (low, high)]
    return EffectSize(
        degrees * f / (degrees * f + error_degrees),
        max(omega, 0.0),
        Interval(ends[0], ends[1], 1 - 2 * alpha),
    )


def _noncentrality(f: float, degrees: float, error_degrees: float, probability: float) -> float | None:
    """The noncentrality under which a smaller F has this probability; 0 where none does; None where it is endless."""
    from scipy.optimize import brentq
    from scipy.special import ncfdtr

    def excess(noncentrality: float) -> float:
        return float(ncfdtr(degrees, error_degrees, noncentrality, f)) - probability

    if excess(0.0) <= 0:
        return 0.0
    high = 1.0
    while excess(high) > 0:
        high *= 2
        if high > LARGEST:
            return None
    return float(brentq(excess, 0.0, high, xtol=1e-8))
