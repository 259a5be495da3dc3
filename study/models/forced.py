"""Forced choices: a stimulus is to be found among others, sensitivity in, chances of a right answer out.

Each stimulus leaves a percept with unit normal noise. In the oddity task two of three are alike and one lies d' apart:
the observer names the percept that lies farthest from the mean of the other two, which is the one outside the closest
pair (Macmillan & Creelman 2005, chapter 9; Frijters 1979). With two alternatives (2AFC) the larger percept is named.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from study.arrays import FloatArray

WIDEST_D_PRIME = 20.0
NODES = 80
WIDEST_U = 9.0


@dataclass(frozen=True)
class Forced:
    """A forced choice."""

    choices: int
    """Answers of which one is right."""
    correct: Callable[[float | FloatArray], FloatArray]
    """The chance of a right answer without lapses, in the shape of the d'."""

    @property
    def chance(self) -> float:
        """Share of right answers where nothing is seen."""
        return 1.0 / self.choices

    @property
    def halfway(self) -> float:
        """Share of right answers at threshold: half of the way from chance to never wrong."""
        return (1.0 + self.chance) / 2

    @cached_property
    def at_threshold(self) -> float:
        """The d' at threshold."""
        found = self.d_prime_of(self.halfway)
        assert found is not None
        return found

    def d_prime_of(self, correct: float) -> float | None:
        """Return the d' at which this share of the answers is right; 0 at chance or below, None where all are right."""
        from scipy.optimize import brentq

        if correct <= self.chance:
            return 0.0
        if correct >= float(self.correct(WIDEST_D_PRIME)):
            return None
        return float(brentq(lambda d: float(self.correct(d)) - correct, 0.0, WIDEST_D_PRIME, xtol=1e-10))

    def with_lapses(self, d_prime: FloatArray, lapse: float | FloatArray) -> FloatArray:
        """Return the chance of a right answer where this share of the answers is given blindly."""
        return np.asarray(lapse * self.chance + (1 - lapse) * self.correct(d_prime))


@cache
def _nodes() -> tuple[FloatArray, FloatArray]:
    """Points from 0 to where the normal density has nothing left, and their weights times twice that density."""
    x, weights = np.polynomial.legendre.leggauss(NODES)
    u = WIDEST_U * (x + 1) / 2
    return u, weights * WIDEST_U * np.exp(-0.5 * u * u) / np.sqrt(2 * np.pi)


def oddity_correct(d_prime: float | FloatArray) -> FloatArray:
    """Return the chance of a right answer without lapses, in the shape of `d_prime`.

    Notes
    -----
    Twice the integral over u > 0 of [Phi(-u sqrt 3 + d' sqrt(2/3)) + Phi(-u sqrt 3 - d' sqrt(2/3))] phi(u), the
    psychometric function of the triangle test (Frijters 1979), by Gauss-Legendre quadrature.
    """
    from scipy.special import ndtr

    u, weights = _nodes()
    apart = np.asarray(d_prime, dtype=np.float64)[..., None] * np.sqrt(2 / 3)
    near = -u * np.sqrt(3)
    return np.asarray(((ndtr(near + apart) + ndtr(near - apart)) * weights).sum(axis=-1))


def two_correct(d_prime: float | FloatArray) -> FloatArray:
    """Return Phi(d' / sqrt 2), the chance that the larger of two percepts is that of the larger stimulus."""
    from scipy.special import ndtr

    return np.asarray(ndtr(np.asarray(d_prime, dtype=np.float64) / np.sqrt(2)))


FORCED: Mapping[str, Forced] = {"oddity": Forced(3, oddity_correct), "2afc": Forced(2, two_correct)}
"""By the task."""
