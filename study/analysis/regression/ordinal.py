"""Ordinal regression of points on a scale with participants as random: answers in, odds ratios out.

    logit P(rating <= k) = threshold k - (X beta + b),   b ~ Normal(0, spread^2), one a participant

A cumulative-link (proportional odds) mixed model: it takes the points of a scale as ordered and no more, where a mean
takes them as equally far apart. The integral over `b` is adaptive Gauss-Hermite quadrature, as in `mixed`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from study.analysis.regression.random_effects import (
    LARGEST_EFFECT,
    Effect,
    caution,
    covariance_of,
    effects_of,
    quadrature,
)
from study.arrays import FloatArray

NODES = 9
MODE_STEPS = 15
LARGEST_THRESHOLD = 25.0


@dataclass(frozen=True, eq=False)
class OrdinalFit:
    """A cumulative-link mixed model's fit."""

    effects: tuple[Effect, ...]
    """On the logit scale: above 0 where the column makes ratings higher."""
    thresholds: tuple[float, ...]
    """Between the points that were used, for a participant with b = 0 and a row of zeros."""
    points: tuple[float, ...]
    """The points of the scale that were used, rising."""
    spread: float
    """Standard deviation of `b` between participants."""
    log_likelihood: float
    """At the maximum."""
    participants: int
    answers: int
    """`participants`, `answers`: what it rests on."""
    note: str = ""
    """What to be careful about."""


@dataclass(frozen=True, eq=False)
class _Problem:
    """Rows sorted by participant; `starts` says where each participant's begin."""

    design: FloatArray
    code: NDArray[np.intp]
    person: NDArray[np.intp]
    starts: NDArray[np.intp]
    categories: int


def fit_ordinal(
    design: ArrayLike,
    ratings: ArrayLike,
    participants: Sequence[Any] | NDArray[Any],
    *,
    names: Sequence[str] = (),
    nodes: int = NODES,
    confidence: float = 0.95,
) -> OrdinalFit | str:
    """Fit by maximum likelihood; a sentence that says why where it can't be fitted.

    Parameters
    ----------
    design : array_like, shape (answers, effects)
        Without a constant, which the thresholds hold; no columns for the model without effects.
    ratings : array_like, shape (answers,)
        Points of the scale. Unused points have no threshold.
    participants : sequence, shape (answers,)
        Who answered.
    nodes
        Quadrature points.

    Notes
    -----
    Standard errors come from the curvature at the maximum; tests are Student's with participants less one.
    """
    matrix, values = np.asarray(design, dtype=np.float64), np.asarray(ratings, dtype=np.float64)
    points, code = np.unique(values, return_inverse=True)
    _, person = np.unique(np.asarray(participants).astype(str), return_inverse=True)
    people = int(person.max()) + 1 if len(person) else 0
    reason = _why_no_fit(matrix, len(points), people)
    if reason:
        return reason
    order = np.argsort(person, kind="stable")
    starts = np.searchsorted(person[order], np.arange(people))
    problem = _Problem(matrix[order], code[order], person[order], starts, len(points))
    return _fitted(problem, points, names, nodes, confidence)


def _why_no_fit(design: FloatArray, points: int, people: int) -> str:
    if people == 0:
        return "no answers"
    if people == 1:
        return "one participant: the spread between participants can't be estimated"
    if points < 2:
        return "all ratings alike: effects can't be estimated"
    full = np.column_stack([np.ones(len(design)), design])
    if np.linalg.matrix_rank(full) < full.shape[1]:
        return "the effects can't be separated in these ratings (cells are missing)"
    return ""


def _fitted(
    problem: _Problem, points: FloatArray, names: Sequence[str], nodes: int, confidence: float
) -> OrdinalFit | str:
    from scipy.optimize import minimize

    effects, cuts, people = problem.design.shape[1], problem.categories - 1, len(problem.starts)
    grid, log_weights = quadrature(nodes, 1)
    memory = {"mode": np.zeros(people)}

    def loss(point: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = _marginal(point, problem, grid[:, 0], log_weights, memory)
        return -value, -gradient

    share = np.cumsum(np.bincount(problem.code, minlength=problem.categories))[:-1] / len(problem.code)
    first = np.log(share / (1 - share))
    start = np.concatenate([np.zeros(effects), first[:1], np.log(np.maximum(np.diff(first), 1e-3)), [0.7]])
    limits = [(-LARGEST_EFFECT, LARGEST_EFFECT)] * effects + [(-LARGEST_THRESHOLD, LARGEST_THRESHOLD)]
    limits += [(-9.0, 4.0)] * (cuts - 1) + [(-8.0, 8.0)]
    found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=limits, options={"maxiter": 400, "ftol": 1e-11})
    covariance = covariance_of(found.x, loss, effects)
    spread = abs(float(found.x[-1]))
    return OrdinalFit(
        effects=effects_of(found.x[:effects], covariance, names, people, confidence),
        thresholds=tuple(float(value) for value in _thresholds(found.x[effects:-1])),
        points=tuple(float(value) for value in points),
        spread=spread,
        log_likelihood=-float(found.fun),
        participants=people,
        answers=len(problem.code),
        note=caution(found.x[:effects], covariance, np.array([spread]), bool(found.success)),
    )


def _thresholds(values: FloatArray) -> FloatArray:
    """Rising thresholds from the first one and the logarithms of the steps between them."""
    return np.asarray(values[0] + np.concatenate([[0.0], np.cumsum(np.exp(values[1:]))]), dtype=np.float64)


def _parts(eta: FloatArray, edges: FloatArray, problem: _Problem) -> tuple[FloatArray, ...]:
    """Log chance of each answer, its slope and curvature by eta, and its slopes by the thresholds above and below.

    `eta` is of shape (answers, points).
    """
    from scipy.special import expit

    above = expit(edges[problem.code + 1][:, None] - eta)
    below = expit(edges[problem.code][:, None] - eta)
    chance = np.maximum(above - below, 1e-300)
    slope_above, slope_below = above * (1 - above), below * (1 - below)
    slope = -(slope_above - slope_below) / chance
    bend = (slope_above * (1 - 2 * above) - slope_below * (1 - 2 * below)) / chance - slope**2
    return np.log(chance), slope, bend, slope_above / chance, -slope_below / chance


def _marginal(
    point: FloatArray, problem: _Problem, grid: FloatArray, log_weights: FloatArray, memory: dict[str, FloatArray]
) -> tuple[float, FloatArray]:
    """The log likelihood with participants integrated out, and its gradient."""
    effects, cuts = problem.design.shape[1], problem.categories - 1
    thresholds, spread = _thresholds(point[effects:-1]), point[-1]
    edges = np.concatenate([[-np.inf], thresholds, [np.inf]])
    base = problem.design @ point[:effects]
    mode, scale = _modes(base, spread, edges, problem, memory["mode"])
    memory["mode"] = mode
    place = mode[:, None] + scale[:, None] * grid
    logs, slope, _, up, down = _parts(base[:, None] + spread * place[problem.person], edges, problem)
    total = np.add.reduceat(logs, problem.starts, axis=0) - 0.5 * place**2 + log_weights
    top = total.max(axis=1, keepdims=True)
    mass = np.exp(total - top)
    share = (mass / mass.sum(axis=1, keepdims=True))[problem.person]
    own = (slope * share).sum(axis=1)
    by_threshold = np.bincount(problem.code, (up * share).sum(axis=1), minlength=cuts + 1)[:cuts]
    by_threshold = by_threshold + np.bincount(problem.code, (down * share).sum(axis=1), minlength=cuts + 1)[1:]
    # The first threshold moves all, each step those above it.
    steps = np.cumsum(by_threshold[::-1])[::-1]
    steps = np.concatenate([steps[:1], steps[1:] * np.exp(point[effects + 1 : -1])])
    by_spread = float((slope * share * place[problem.person]).sum())
    value = float((np.log(mass.sum(axis=1)) + top[:, 0] + np.log(scale)).sum()) - len(mode) / 2 * math.log(2 * math.pi)
    return value, np.concatenate([own @ problem.design, steps, [by_spread]])


def _modes(
    base: FloatArray, spread: float, edges: FloatArray, problem: _Problem, start: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Where each participant's answers put `u` (b = spread u), and the width there."""
    mode, curvature = start, np.ones(len(start))
    for _ in range(MODE_STEPS):
        _, slope, bend, _, _ = _parts((base + spread * mode[problem.person])[:, None], edges, problem)
        gradient = spread * np.add.reduceat(slope[:, 0], problem.starts) - mode
        curvature = 1 - spread**2 * np.add.reduceat(bend[:, 0], problem.starts)
        step = gradient / curvature
        mode = mode + np.clip(step, -2.0, 2.0)
        if np.abs(step).max() < 1e-7:
            break
    return mode, 1 / np.sqrt(curvature)
