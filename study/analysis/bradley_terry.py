"""Strengths of several methods from answers to pairs of them, with an effect of the order (Bradley & Terry 1952).

    logit P(a is favoured over b) = strength a - strength b + order effect where a comes first

Answers come in, strengths with standard errors go out (Davidson & Beaver 1977; Agresti 2013, section 11.6). Where it is
known who answered, standard errors are those of participants (the sandwich of Liang & Zeger 1986), not of answers. A
tie counts half for each side.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from study.analysis.estimates import Interval, chi_square_probability, normal_quantile, t_quantile
from study.analysis.scoring import maximise
from study.counting import counted
from study.errors import AnalysisError

FloatArray = NDArray[np.float64]

WIDEST = 15.0


@dataclass(frozen=True)
class Strength:
    """A method's strength beside the reference, on the logit scale; None where it can't be told."""

    method: str
    value: float | None
    standard_error: float | None
    interval: Interval


@dataclass(frozen=True)
class BradleyTerry:
    """Strengths of methods.

    Attributes
    ----------
    strengths
        Of every method, strongest first; the reference's is 0.
    reference
        The method that the others stand beside.
    order
        What coming first (or playing at home) adds, on the logit scale; None where the order is not known.
    log_likelihood, deviance, degrees_of_freedom, p_value
        Goodness of fit against free shares of every pair and order.
    participants
        Whose answers stand behind the standard errors; None where every answer counts as independent.
    note
        What can't be estimated, and why.
    """

    strengths: tuple[Strength, ...]
    reference: str
    order: Strength | None
    log_likelihood: float
    deviance: float
    degrees_of_freedom: int
    p_value: float | None
    participants: int | None = None
    note: str = ""


def fit_bradley_terry(
    first: Sequence[str],
    second: Sequence[str],
    first_favoured: ArrayLike,
    shown: ArrayLike,
    *,
    with_order: bool = True,
    reference: str | None = None,
    confidence: float = 0.95,
    participants: Sequence[str] | None = None,
) -> BradleyTerry | str:
    """Fit strengths; a sentence that says why where they can't be fitted.

    Parameters
    ----------
    first, second : sequence of str, shape (rows,)
        The methods of each row, in the order of presentation.
    first_favoured, shown : array_like, shape (rows,)
        How often the first was favoured, of how many answers.
    with_order
        Whether coming first may matter.
    reference
        The method whose strength is 0; the first by name unless given.
    participants : sequence of str, shape (rows,)
        Who answered; every answer counts as independent where left out.

    Raises
    ------
    AnalysisError
        When the reference is none of the methods.
    """
    yes, total = np.asarray(first_favoured, float), np.asarray(shown, float)
    methods = sorted({*first, *second})
    if len(methods) < 2 or total.sum() == 0:
        return "fewer than two methods were compared"
    held = methods[0] if reference is None else reference
    if held not in methods:
        raise AnalysisError(f"expected one of the methods {', '.join(methods)} as reference, found {held!r}")
    others = [method for method in methods if method != held]
    design = np.zeros((len(yes), len(others) + with_order))
    for row, (one, other) in enumerate(zip(first, second, strict=True)):
        for method, sign in ((one, 1.0), (other, -1.0)):
            if method != held:
                design[row, others.index(method)] += sign
    if with_order:
        design[:, -1] = 1.0
    if np.linalg.matrix_rank(design[total > 0]) < design.shape[1]:
        return "the methods are not linked by comparisons, or the order never changed: strengths can't be told"
    groups = None if participants is None else np.unique(np.asarray(participants), return_inverse=True)[1]
    return _fitted(design, yes, total, others, held, groups, confidence)


def _fitted(
    design: FloatArray,
    yes: FloatArray,
    total: FloatArray,
    others: Sequence[str],
    held: str,
    groups: NDArray[np.intp] | None,
    confidence: float,
) -> BradleyTerry:
    from scipy.special import expit, xlogy

    def share(point: FloatArray) -> FloatArray:
        return np.clip(np.asarray(expit(point @ design.T), dtype=np.float64), 1e-12, 1 - 1e-12)

    def value(point: FloatArray, _: NDArray[np.intp]) -> FloatArray:
        p = share(point)
        return np.asarray((yes * np.log(p) + (total - yes) * np.log1p(-p)).sum(axis=1), dtype=np.float64)

    def scores(point: FloatArray, _: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        p = share(point)
        return (yes - total * p) @ design, np.einsum("bl,lp,lq->bpq", total * p * (1 - p), design, design)

    size = design.shape[1]
    best = maximise(value, scores, np.zeros((1, size)), np.full(size, -WIDEST), np.full(size, WIDEST))
    point = best.point[0]
    _, information = scores(point[None], np.zeros(1, dtype=np.intp))
    errors = _errors(information[0], (yes - total * share(point[None])[0])[:, None] * design, groups)
    people = None if groups is None else int(groups.max()) + 1
    times = normal_quantile(confidence) if people is None else t_quantile(confidence, max(people - 1, 1))
    # By place, not by name: a method may well be called "order".
    found = [
        _strength(name, float(at), float(error), times, confidence)
        for name, at, error in zip([*others, "order"], point, errors, strict=False)
    ]
    order = found.pop() if size > len(others) else None
    ranked = [*zip(point, found, strict=False), (0.0, Strength(held, 0.0, None, Interval(0.0, 0.0, confidence)))]
    ranked.sort(key=lambda pair: -pair[0])
    every = (*found, *([order] if order else []))
    endless = [row.method for row in every if row.value is None]
    notes = [f"always or never favoured, so without a finite strength: {', '.join(endless)}"] if endless else []
    if any(row.value is not None and row.standard_error is None for row in every):
        notes.append(f"{counted(people or 0, 'participant')}: too few, or too much alike, for standard errors")
    # Rows may hold single answers: the saturated model is one share for every pair and order.
    cells = np.unique(design, axis=0, return_inverse=True)[1].ravel()
    favoured, seen = np.bincount(cells, yes), np.bincount(cells, total)
    rate = favoured / np.maximum(seen, 1e-12)
    full = float((xlogy(favoured, rate) + xlogy(seen - favoured, 1 - rate)).sum())
    deviance = max(2 * (full - float(best.value[0])), 0.0)
    freedom = int((seen > 0).sum()) - size
    return BradleyTerry(
        strengths=tuple(row for _, row in ranked),
        reference=held,
        order=order,
        log_likelihood=float(best.value[0]),
        deviance=deviance,
        degrees_of_freedom=max(freedom, 0),
        p_value=chi_square_probability(deviance, freedom) if freedom > 0 else None,
        participants=people,
        note="; ".join(notes),
    )


def _errors(information: FloatArray, scores: FloatArray, groups: NDArray[np.intp] | None) -> FloatArray:
    """Standard errors: of independent answers, or of participants; NaN where these are no more than the strengths."""
    inverse = np.linalg.pinv(information)
    single = np.sqrt(np.maximum(np.diag(inverse), 0.0))
    if groups is None:
        return np.asarray(single, dtype=np.float64)
    people = int(groups.max()) + 1
    if people <= len(inverse):
        return np.full(len(inverse), np.nan)
    sums = np.zeros((people, scores.shape[1]))
    np.add.at(sums, groups, scores)
    spread = np.diag(inverse @ (sums.T @ sums) @ inverse) * people / (people - 1)
    # Where strengths grow without end the scores vanish, and with them what would show it.
    return np.asarray(np.where(single > 50, single, np.sqrt(np.maximum(spread, 0.0))), dtype=np.float64)


def _strength(name: str, value: float, error: float, times: float, confidence: float) -> Strength:
    """A strength, or none where it grows without end; without a standard error where nothing tells it."""
    if abs(value) > 0.9 * WIDEST or error > 50:
        return Strength(name, None, None, Interval(None, None, confidence))
    # Participants who answer just alike leave no spread that could be judged by.
    if not np.isfinite(error) or error < 1e-9:
        return Strength(name, value, None, Interval(None, None, confidence))
    return Strength(name, value, error, Interval(value - times * error, value + times * error, confidence))
