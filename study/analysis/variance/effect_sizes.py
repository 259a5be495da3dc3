"""How large an effect of an analysis of variance is: an F and its degrees of freedom in, shares of variance out.

Partial eta squared is the share of variance that the effect explains beside the error. It describes the sample and is
too large on average; its interval is that of the noncentrality which makes the observed F just too large or too small
(Steiger 2004, Psychological Methods 9).
"""

from __future__ import annotations

from dataclasses import dataclass

LARGEST = 1e6


@dataclass(frozen=True, kw_only=True)
class Sizes:
    """How large an effect is, as shares of variance, 0 to 1; None where there is no F."""

    partial_eta_squared: float | None = None
    """Sum of squares of the effect over itself and the error's."""
    effect_low: float | None = None
    effect_high: float | None = None
    """`effect_low`, `effect_high`: interval of the share in the population, of 1 - 2 alpha (90% for alpha .05): it
    holds 0 exactly where F is not significant at alpha."""


def sizes(f: float | None, degrees: float, error_degrees: float, alpha: float = 0.05) -> Sizes:
    """Return the size of an effect.

    Parameters
    ----------
    f, degrees, error_degrees
        The statistic, and its degrees of freedom.
    alpha
        Error rate at each end of the interval.

    Examples
    --------
    >>> round(sizes(6.39, 1, 48).partial_eta_squared, 3)
    0.117
    """
    if f is None:
        return Sizes()
    f, total = max(f, 0.0), degrees + error_degrees + 1
    low, high = (_noncentrality(f, degrees, error_degrees, share) for share in (1 - alpha, alpha))
    return Sizes(
        partial_eta_squared=degrees * f / (degrees * f + error_degrees),
        effect_low=None if low is None else low / (low + total),
        effect_high=None if high is None else high / (high + total),
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
