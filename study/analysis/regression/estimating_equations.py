"""Generalised estimating equations: yes-no answers of participants in, effects on the population's mean out.

Logistic, answers of one participant equally correlated (exchangeable): Liang & Zeger 1986, *Longitudinal data analysis
using generalized linear models*. The covariance is the sandwich with residuals widened by their leverage (Mancl &
DeRouen 2001, eq. 5), as the plain one is too small where participants are few.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from study.errors import AnalysisError

FloatArray = NDArray[np.float64]

MOST_ROUNDS = 60
CLOSE_ENOUGH = 1e-6
ADMISSIBLE = 0.99


@dataclass(frozen=True, eq=False)
class Estimated:
    """Effects on the logit of the population's mean.

    Attributes
    ----------
    values, errors : ndarray, shape (effects,)
        Effects and their standard errors.
    correlation
        Of two answers of one participant, as the equations estimate it.
    """

    values: FloatArray
    errors: FloatArray
    correlation: float


def estimating_equations(design: ArrayLike, yes: ArrayLike, who: ArrayLike) -> Estimated:
    """Solve the estimating equations.

    Parameters
    ----------
    design : array_like, shape (answers, effects)
        The terms of the model.
    yes : array_like, shape (answers,)
        0 or 1.
    who : array_like, shape (answers,)
        Whose answer it is.

    Raises
    ------
    AnalysisError
        When the equations have no solution, as where all answers are alike.

    Notes
    -----
    Scale and correlation are moment estimates with the number of effects taken off the numbers of answers and of pairs
    of answers. The correlation is kept where all answers of a participant can have it: above -1 / (answers - 1) of the
    participant with most answers, and below 1. The standard errors hold whatever the correlation.
    """
    rows, answers = np.asarray(design, dtype=np.float64), np.asarray(yes, dtype=np.float64)
    people = np.asarray(who)
    groups = [np.flatnonzero(people == name) for name in np.unique(people)]
    with np.errstate(all="ignore"):  # what can't be divided is not finite, which `_solved` refuses
        return _solution(rows, answers, groups)


def _solution(rows: FloatArray, answers: FloatArray, groups: list[NDArray[np.intp]]) -> Estimated:
    values = _independent(rows, answers)
    for _ in range(MOST_ROUNDS):
        correlation = _correlation(values, rows, answers, groups)
        bread, score, _ = _sums(values, correlation, rows, answers, groups)
        step = _solved(bread, score)
        values = values + step
        if np.abs(step).max() < CLOSE_ENOUGH:
            break
    else:
        raise AnalysisError("expected estimating equations that settle, found none; the answers vary too little")
    correlation = _correlation(values, rows, answers, groups)
    bread, _, meat = _sums(values, correlation, rows, answers, groups)
    covariance = _solved(bread, _solved(bread, meat).T)
    return Estimated(values, np.sqrt(np.diag(covariance)), correlation)


def _solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    try:
        found = np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        found = np.full_like(right, np.nan)
    if not np.isfinite(found).all():
        raise AnalysisError("expected answers that vary with participants, found too few that do; collect more")
    return np.asarray(found)


def _mean(values: FloatArray, rows: FloatArray) -> FloatArray:
    from scipy.special import expit

    # Kept off 0 and 1, where a residual could not be scaled.
    return np.asarray(expit((rows @ values).clip(-25, 25)), dtype=np.float64)


def _independent(rows: FloatArray, answers: FloatArray) -> FloatArray:
    """Where to start: a logistic regression that treats all answers as independent."""
    values = np.zeros(rows.shape[1])
    for _ in range(25):
        mean = _mean(values, rows)
        step = _solved(rows.T @ (rows * (mean * (1 - mean))[:, None]), rows.T @ (answers - mean))
        values = values + step
        if np.abs(step).max() < CLOSE_ENOUGH:
            break
    return values


def _correlation(values: FloatArray, rows: FloatArray, answers: FloatArray, groups: list[NDArray[np.intp]]) -> float:
    """The mean product of two scaled residuals of one participant, over the mean of their squares."""
    mean = _mean(values, rows)
    residuals = (answers - mean) / np.sqrt(mean * (1 - mean))
    products = sum((residuals[own].sum() ** 2 - (residuals[own] ** 2).sum()) / 2 for own in groups)
    pairs = sum(len(own) * (len(own) - 1) / 2 for own in groups) - rows.shape[1]
    scale = float((residuals**2).sum()) / max(len(answers) - rows.shape[1], 1)
    if pairs <= 0 or scale <= 0:
        return 0.0
    most = max(len(own) for own in groups)
    return float(np.clip(products / pairs / scale, -ADMISSIBLE / max(most - 1, 1), ADMISSIBLE))


def _sums(
    values: FloatArray, correlation: float, rows: FloatArray, answers: FloatArray, groups: list[NDArray[np.intp]]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sums over participants: the information, the score, and the outer products of corrected scores."""
    mean = _mean(values, rows)
    deviation = np.sqrt(mean * (1 - mean))
    effects = rows.shape[1]
    bread, score, meat = np.zeros((effects, effects)), np.zeros(effects), np.zeros((effects, effects))
    parts = []
    for own in groups:
        slope = rows[own] * (deviation[own] ** 2)[:, None]
        weighted = _unscaled(slope, deviation[own], correlation)
        bread += slope.T @ weighted
        residual = answers[own] - mean[own]
        score += weighted.T @ residual
        parts.append((slope, weighted, residual))
    for slope, weighted, residual in parts:
        leverage = slope @ _solved(bread, weighted.T)
        corrected = weighted.T @ _solved(np.eye(len(residual)) - leverage, residual)
        meat += np.outer(corrected, corrected)
    return bread, score, meat


def _unscaled(slope: FloatArray, deviation: FloatArray, correlation: float) -> FloatArray:
    """The inverse of one participant's working covariance times `slope`, in closed form for equal correlations."""
    scaled = slope / deviation[:, None]
    shared = correlation / (1 + (len(slope) - 1) * correlation)
    return np.asarray((scaled - shared * scaled.sum(axis=0)) / ((1 - correlation) * deviation[:, None]))
