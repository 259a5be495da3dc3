"""What models with random effects share: quadrature, and fixed effects with their standard errors and tests.

Points and weights, a loss and its gradient come in; effects with intervals go out, and notes on what cannot be
estimated.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from study.analysis.estimates import Interval, t_probability, t_quantile
from study.arrays import FloatArray

NO_SPREAD = 1e-3
LARGEST_EFFECT = 12.0
LARGEST_ERROR = 4.0


@dataclass(frozen=True)
class Effect:
    """A fixed effect: estimate, standard error, Student's interval and test with participants less one."""

    name: str
    value: float
    standard_error: float | None
    interval: Interval
    p_value: float | None


def quadrature(nodes: int, size: int) -> tuple[FloatArray, FloatArray]:
    """Points of the standard normal in `size` dimensions, and logs of weight times exp(|z|^2 / 2)."""
    points, weights = np.polynomial.hermite_e.hermegauss(nodes)
    grid = np.array(list(product(points, repeat=size)))
    logs = np.log(np.array(list(product(weights, repeat=size)))).sum(axis=1)
    return grid, logs + 0.5 * (grid**2).sum(axis=1)


def covariance_of(point: FloatArray, loss: Any, effects: int) -> FloatArray:
    """Covariance of the fixed effects: inverse of the differences of the gradient, without a spread that is zero."""
    step = 1e-4
    rows = []
    for place in range(len(point)):
        moved = np.zeros(len(point))
        moved[place] = step
        rows.append((loss(point + moved)[1] - loss(point - moved)[1]) / (2 * step))
    matrix = (np.array(rows) + np.array(rows).T) / 2
    keep = np.flatnonzero((np.arange(len(point)) < effects) | (np.diag(matrix) > 1e-3))
    try:
        inverse = np.linalg.inv(matrix[np.ix_(keep, keep)])
    except np.linalg.LinAlgError:
        return np.full((effects, effects), np.nan)
    return np.asarray(inverse[:effects, :effects], dtype=np.float64)


def effects_of(
    values: FloatArray, covariance: FloatArray, names: Sequence[str], people: int, confidence: float
) -> tuple[Effect, ...]:
    """Fixed effects from estimates and their covariance; without an error where that would say nothing."""
    found = []
    times = t_quantile(confidence, people - 1)
    for place, value in enumerate(values):
        name = names[place] if place < len(names) else f"effect {place + 1}"
        variance = covariance[place, place]
        # An error as large as that says nothing: the answers nearly separate, or the spread can't be determined.
        if not np.isfinite(variance) or not 0 < variance < LARGEST_ERROR**2 or abs(value) >= LARGEST_EFFECT - 1e-6:
            found.append(Effect(name, float(value), None, Interval(None, None, confidence), None))
            continue
        error = math.sqrt(variance)
        interval = Interval(float(value - times * error), float(value + times * error), confidence)
        found.append(Effect(name, float(value), error, interval, t_probability(float(value) / error, people - 1)))
    return tuple(found)


def caution(values: FloatArray, covariance: FloatArray, spread: FloatArray, settled: bool) -> str:
    """What to be careful about in a fit, in words; empty where nothing is amiss."""
    notes = []
    if (np.abs(values) >= LARGEST_EFFECT - 1e-6).any():
        notes.append("an effect grows without end: the answers separate perfectly, and it can't be estimated")
    elif not np.isfinite(covariance).all() or (np.diag(covariance) <= 0).any():
        notes.append("the likelihood is flat: standard errors can't be given")
    elif (np.diag(covariance) > LARGEST_ERROR**2).any():
        notes.append("the answers nearly separate: an effect is large, and its size can't be estimated")
    if (spread < NO_SPREAD).any():
        notes.append("a spread between participants is estimated as none; it may only not have been seen")
    if not settled:
        notes.append("the search for the maximum did not converge")
    return "; ".join(notes)
