"""The oddity task with three intervals: two stimuli are alike, one differs; sensitivity in, chances out.

Each stimulus leaves a percept with unit normal noise, d' apart for the one that differs, and the observer names the
percept that lies farthest from the mean of the other two, which is the one outside the closest pair (Macmillan &
Creelman 2005, chapter 9; Frijters 1979). By chance alone one of three answers is right.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from study.arrays import FloatArray

CHANCE = 1.0 / 3.0
HALFWAY = (1.0 + CHANCE) / 2
"""Share of right answers at threshold: half of the way from chance to never wrong."""

WIDEST_D_PRIME = 20.0
NODES = 80
WIDEST_U = 9.0


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


def d_prime_of(correct: float) -> float | None:
    """Return the d' at which this share of the answers is right; 0 at chance or below, None where all are right."""
    from scipy.optimize import brentq

    if correct <= CHANCE:
        return 0.0
    if correct >= float(oddity_correct(WIDEST_D_PRIME)):
        return None
    return float(brentq(lambda d_prime: float(oddity_correct(d_prime)) - correct, 0.0, WIDEST_D_PRIME, xtol=1e-10))
