"""The sigmoids of psychometric functions, all by threshold (where half is reached) and width (from 5% to 95%).

Two parameters that mean the same for every sigmoid can be compared between them (Schuett, Harmeling, Macke & Wichmann
2016). A Weibull function is the Gumbel one over the logarithm of the level.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from study.arrays import FloatArray
from study.errors import AnalysisError

Curve = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True)
class Sigmoid:
    """One sigmoid in its standard form."""

    name: str
    """As the caller says it."""
    curve: Curve
    slope: Curve
    inverse: Curve
    """`curve`, `slope`, `inverse`: the distribution function, its derivative, and its inverse."""
    logarithmic: bool = False
    """Whether levels enter as logarithms."""

    @property
    def half(self) -> float:
        """Where the standard form reaches one half."""
        return float(self.inverse(np.array(0.5)))

    @property
    def span(self) -> float:
        """The standard form's distance from 5% to 95%."""
        return float(self.inverse(np.array(0.95)) - self.inverse(np.array(0.05)))

    def axis(self, levels: FloatArray) -> FloatArray:
        """Return levels as they enter the curve.

        Raises
        ------
        AnalysisError
            When a level of a Weibull function is not above zero.
        """
        levels = np.asarray(levels, dtype=np.float64)
        if not self.logarithmic:
            return levels
        if (levels <= 0).any():
            raise AnalysisError(
                f"expected levels above 0 for a Weibull function, found {levels.min():g}; choose gumbel, or leave out "
                "the levels at 0 (as catch trials they only tell the guess rate)"
            )
        return np.asarray(np.log(levels), dtype=np.float64)

    def levels(self, axis: FloatArray) -> FloatArray:
        """Return levels from what `axis` gave."""
        return np.asarray(np.exp(axis) if self.logarithmic else axis, dtype=np.float64)

    def at(self, axis: FloatArray, threshold: FloatArray, width: FloatArray) -> FloatArray:
        """Return the sigmoid's value, threshold and width on the axis too."""
        return self.curve((axis - threshold) / width * self.span + self.half)


def _normal(value: FloatArray) -> FloatArray:
    from scipy.special import ndtr

    return np.asarray(ndtr(value), dtype=np.float64)


def _normal_inverse(share: FloatArray) -> FloatArray:
    from scipy.special import ndtri

    return np.asarray(ndtri(share), dtype=np.float64)


def _normal_slope(value: FloatArray) -> FloatArray:
    return np.asarray(np.exp(-0.5 * value * value) / np.sqrt(2 * np.pi), dtype=np.float64)


def logistic(value: FloatArray) -> FloatArray:
    """The logistic distribution function: the chance that goes with log-odds."""
    from scipy.special import expit

    return np.asarray(expit(value), dtype=np.float64)


def _logistic_slope(value: FloatArray) -> FloatArray:
    share = logistic(value)
    return share * (1 - share)


def _gumbel(value: FloatArray) -> FloatArray:
    return np.asarray(-np.expm1(-np.exp(np.minimum(value, 30.0))), dtype=np.float64)


def _gumbel_slope(value: FloatArray) -> FloatArray:
    value = np.minimum(value, 30.0)
    return np.asarray(np.exp(value - np.exp(value)), dtype=np.float64)


def _gumbel_inverse(share: FloatArray) -> FloatArray:
    return np.asarray(np.log(-np.log1p(-share)), dtype=np.float64)


def _logistic_inverse(share: FloatArray) -> FloatArray:
    return np.asarray(np.log(share) - np.log1p(-share), dtype=np.float64)


SIGMOIDS = {
    "normal": Sigmoid("normal", _normal, _normal_slope, _normal_inverse),
    "logistic": Sigmoid("logistic", logistic, _logistic_slope, _logistic_inverse),
    "gumbel": Sigmoid("gumbel", _gumbel, _gumbel_slope, _gumbel_inverse),
    "weibull": Sigmoid("weibull", _gumbel, _gumbel_slope, _gumbel_inverse, logarithmic=True),
}


def sigmoid_named(name: str) -> Sigmoid:
    """Return a sigmoid by its name.

    Raises
    ------
    AnalysisError
        When there is none of that name.
    """
    if name not in SIGMOIDS:
        raise AnalysisError(f"expected one of the sigmoids {', '.join(SIGMOIDS)}, found {name!r}")
    return SIGMOIDS[name]
