"""Mixed models of yes-no answers: counts by participant in, effects of a typical participant and their spread out.

    p = guess + (1 - guess - lapse) link(X beta + Z b),   b ~ Normal(0, L L')

with one `b` a participant: an intercept, or an intercept and a slope that may go together. The integral over `b` is
adaptive Gauss-Hermite quadrature (Pinheiro & Bates 1995): nodes are laid where each participant's own answers put the
mass. The link is probit or logit; guess and lapse rate are held.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from study.analysis.regression.random_effects import (
    LARGEST_EFFECT,
    NO_SPREAD,
    Effect,
    caution,
    covariance_of,
    effects_of,
    quadrature,
)
from study.arrays import FloatArray
from study.models.sigmoids import SIGMOIDS

Link = Literal["probit", "logit"]
LINKS = {"probit": SIGMOIDS["normal"], "logit": SIGMOIDS["logistic"]}

NODES = 9
MODE_STEPS = 12


@dataclass(frozen=True, eq=False)
class MixedFit:
    """A mixed model's fit."""

    effects: tuple[Effect, ...]
    """Fixed effects: those of a typical participant."""
    spread: tuple[float, ...]
    """Standard deviations of the random effects."""
    correlation: float | None
    """Between random intercept and slope; None for an intercept alone, or where one of them does not spread."""
    covariance: FloatArray
    """`(effects, effects)`: of the fixed effects."""
    log_likelihood: float
    """Without binomial coefficients."""
    participants: int
    answers: int
    """`participants`, `answers`: what it rests on."""
    link: Link
    guess: float
    lapse: float
    """`link`, `guess`, `lapse`: of the model."""
    note: str = ""
    """What to be careful about."""


@dataclass(frozen=True, eq=False)
class _Problem:
    """Rows of all participants as one block each, filled up with rows of no answers."""

    fixed: FloatArray
    random: FloatArray
    yes: FloatArray
    shown: FloatArray
    link: Link
    guess: float
    lapse: float


def fit_mixed(
    fixed: ArrayLike,
    random: ArrayLike,
    yes: ArrayLike,
    shown: ArrayLike,
    participants: Sequence[Any] | NDArray[Any],
    *,
    names: Sequence[str] = (),
    link: Link = "logit",
    guess: float = 0.0,
    lapse: float = 0.0,
    nodes: int = NODES,
    confidence: float = 0.95,
) -> MixedFit | str:
    """Fit a mixed model by maximum likelihood; a sentence that says why where it can't be fitted.

    Parameters
    ----------
    fixed : array_like, shape (rows, effects)
        The design; bring columns to about unit size.
    random : array_like, shape (rows, 1 or 2)
        Columns for which each participant has a coefficient: ones, or ones and a level.
    yes, shown : array_like, shape (rows,)
        Counts.
    participants : sequence, shape (rows,)
        Whose row it is.
    link, guess, lapse
        The curve; rates are held.
    nodes
        Quadrature points an axis.
    """
    problem, people, answers = _problem(fixed, random, yes, shown, participants, link, guess, lapse)
    reason = _why_no_fit(problem, people)
    if reason:
        return reason
    from scipy.optimize import minimize

    effects, random_size = problem.fixed.shape[2], problem.random.shape[2]
    grid, log_weights = quadrature(nodes, random_size)
    memory: dict[str, FloatArray] = {"mode": np.zeros((people, random_size))}

    def loss(point: FloatArray) -> tuple[float, FloatArray]:
        value, gradient = _marginal(point, problem, grid, log_weights, memory)
        return -value, -gradient

    start = np.concatenate([_pooled(problem), _start_spread(random_size)])
    limits = [(-LARGEST_EFFECT, LARGEST_EFFECT)] * effects + [(-8.0, 8.0)] * (len(start) - effects)
    found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=limits, options={"maxiter": 300, "ftol": 1e-11})
    covariance = covariance_of(found.x, loss, effects)
    root = _factor(found.x[effects:], random_size)
    spread = np.sqrt((root**2).sum(axis=1))
    return MixedFit(
        effects=effects_of(found.x[:effects], covariance, names, people, confidence),
        spread=tuple(float(value) for value in spread),
        correlation=_correlation(root, spread),
        covariance=covariance,
        log_likelihood=-float(found.fun),
        participants=people,
        answers=answers,
        link=link,
        guess=guess,
        lapse=lapse,
        note=caution(found.x[:effects], covariance, spread, bool(found.success)),
    )


def _problem(
    fixed: ArrayLike,
    random: ArrayLike,
    yes: ArrayLike,
    shown: ArrayLike,
    participants: Sequence[Any] | NDArray[Any],
    link: Link,
    guess: float,
    lapse: float,
) -> tuple[_Problem, int, int]:
    design, own = np.atleast_2d(np.asarray(fixed, float)), np.atleast_2d(np.asarray(random, float))
    right, total = np.asarray(yes, float), np.asarray(shown, float)
    kept = total > 0
    _, index = np.unique(np.asarray(participants).astype(str)[kept], return_inverse=True)
    people = int(index.max()) + 1 if len(index) else 0
    place = np.zeros(len(index), dtype=np.intp)
    for person in range(people):
        rows = np.flatnonzero(index == person)
        place[rows] = np.arange(len(rows))
    longest = int(place.max()) + 1 if len(place) else 0
    blocks = []
    for part in (design, own, right[:, None], total[:, None]):
        block = np.zeros((people, longest, part.shape[1]))
        block[index, place] = part[kept]
        blocks.append(block)
    problem = _Problem(blocks[0], blocks[1], blocks[2][..., 0], blocks[3][..., 0], link, guess, lapse)
    return problem, people, int(total.sum())


def _why_no_fit(problem: _Problem, people: int) -> str:
    if people == 0:
        return "no answers"
    if people == 1:
        return "one participant: the spread between participants can't be estimated"
    total = problem.yes.sum()
    if total in (0, problem.shown.sum()):
        return "all answers are the same: effects cannot be estimated"
    rows = problem.fixed[problem.shown > 0]
    if np.linalg.matrix_rank(rows) < rows.shape[1]:
        return "the effects can't be separated in these answers (cells are missing)"
    return ""


def _start_spread(size: int) -> FloatArray:
    return np.array([0.4]) if size == 1 else np.array([0.4, 0.0, 0.3])


def _factor(values: FloatArray, size: int) -> FloatArray:
    """The lower triangle L."""
    root = np.zeros((size, size))
    root[np.tril_indices(size)] = values
    return root


def _answer_parts(eta: FloatArray, problem: _Problem) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Log likelihood, its slope by eta, and the expected information, for eta of shape (people, rows, points)."""
    curve = LINKS[problem.link]
    scale = 1 - problem.guess - problem.lapse
    share = np.clip(problem.guess + scale * curve.curve(eta), 1e-12, 1 - 1e-12)
    slope = scale * curve.slope(eta)
    yes, shown = problem.yes[:, :, None], problem.shown[:, :, None]
    value = yes * np.log(share) + (shown - yes) * np.log1p(-share)
    variance = share * (1 - share)
    return value, slope * (yes - shown * share) / variance, shown * slope * slope / variance


def _modes(point: FloatArray, problem: _Problem, start: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where each participant's own answers and the spread put `u` (b = L u), and the curvature there."""
    effects, size = problem.fixed.shape[2], problem.random.shape[2]
    base = problem.fixed @ point[:effects]
    own = problem.random @ _factor(point[effects:], size)
    mode = start
    curvature = np.broadcast_to(np.eye(size), (len(mode), size, size))
    for _ in range(MODE_STEPS):
        eta = base + np.einsum("grq,gq->gr", own, mode)
        _, slope, information = (part[..., 0] for part in _answer_parts(eta[..., None], problem))
        gradient = np.einsum("grq,gr->gq", own, slope) - mode
        curvature = np.einsum("grq,gr,grs->gqs", own, information, own) + np.eye(size)
        step = np.linalg.solve(curvature, gradient[..., None])[..., 0]
        mode = mode + np.clip(step, -2.0, 2.0)
        if np.abs(step).max() < 1e-6:
            break
    return mode, curvature


def _marginal(
    point: FloatArray, problem: _Problem, grid: FloatArray, log_weights: FloatArray, memory: dict[str, FloatArray]
) -> tuple[float, FloatArray]:
    """The log likelihood with the participants' own effects integrated out, and its gradient."""
    effects, size = problem.fixed.shape[2], problem.random.shape[2]
    mode, curvature = _modes(point, problem, memory["mode"])
    memory["mode"] = mode
    scale = np.linalg.inv(np.linalg.cholesky(curvature)).transpose(0, 2, 1)
    place = mode[:, None, :] + np.einsum("gqs,ks->gkq", scale, grid)
    own = problem.random @ _factor(point[effects:], size)
    eta = (problem.fixed @ point[:effects])[..., None] + np.einsum("grq,gkq->grk", own, place)
    value, slope, _ = _answer_parts(eta, problem)
    log_size = np.log(np.abs(np.einsum("gqq->gq", scale))).sum(axis=1) - size / 2 * math.log(2 * math.pi)
    logs = value.sum(axis=1) - 0.5 * (place**2).sum(axis=2) + log_weights
    top = logs.max(axis=1, keepdims=True)
    mass = np.exp(logs - top)
    total = mass.sum(axis=1)
    share = mass / total[:, None]
    by_fixed = np.einsum("grk,gk,grp->p", slope, share, problem.fixed, optimize=True)
    by_root = np.einsum("grk,gk,gra,gkb->ab", slope, share, problem.random, place, optimize=True)
    gradient = np.concatenate([by_fixed, by_root[np.tril_indices(size)]])
    return float((np.log(total) + top[:, 0] + log_size).sum()), gradient


def _pooled(problem: _Problem) -> FloatArray:
    """Effects of all answers as one person's, to start from: a few scoring steps."""
    point = np.zeros(problem.fixed.shape[2])
    for _ in range(15):
        _, slope, information = (part[..., 0] for part in _answer_parts((problem.fixed @ point)[..., None], problem))
        gradient = np.einsum("gr,grp->p", slope, problem.fixed)
        matrix = np.einsum("gr,grp,grq->pq", information, problem.fixed, problem.fixed)
        step = np.linalg.solve(matrix + 1e-6 * np.eye(len(point)) * (1 + np.trace(matrix)), gradient)
        point = np.clip(point + np.clip(step, -1.5, 1.5), -LARGEST_EFFECT / 2, LARGEST_EFFECT / 2)
    return point


def _correlation(root: FloatArray, spread: FloatArray) -> float | None:
    if len(root) < 2 or (spread < NO_SPREAD).any():
        return None
    return float(root[0] @ root[1] / (spread[0] * spread[1]))
