"""Strengths of several methods from answers to pairs of them, with an effect of the order (Bradley & Terry 1952).

    logit P(a is favoured over b) = strength a - strength b + order effect where a comes first

Answers come in, strengths with standard errors go out (Davidson & Beaver 1977; Agresti 2013, section 11.6). Every
answer counts as independent; the tests over participants stand in `preference`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from study.analysis.estimates import Interval, chi_square_probability, normal_quantile
from study.analysis.scoring import maximise

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
    """
    yes, total = np.asarray(first_favoured, float), np.asarray(shown, float)
    methods = sorted({*first, *second})
    if len(methods) < 2 or total.sum() == 0:
        return "fewer than two methods were compared"
    held = reference or methods[0]
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
    return _fitted(design, yes, total, others, held, with_order, confidence)


def _fitted(
    design: FloatArray,
    yes: FloatArray,
    total: FloatArray,
    others: Sequence[str],
    held: str,
    with_order: bool,
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
    errors = np.sqrt(np.diag(np.linalg.pinv(information[0])))
    names = [*others, "order"] if with_order else list(others)
    triples = zip(names, point, errors, strict=True)
    found = {name: _strength(name, float(at), float(error), confidence) for name, at, error in triples}
    endless = [name for name, row in found.items() if row.value is None]
    order = found.pop("order", None) if with_order else None
    rows = [*found.values(), Strength(held, 0.0, None, Interval(0.0, 0.0, confidence))]
    rows.sort(key=lambda row: -(row.value if row.value is not None else point[names.index(row.method)]))
    seen = np.maximum(total, 1e-12)
    full = float((xlogy(yes, yes / seen) + xlogy(total - yes, 1 - yes / seen)).sum())
    deviance = max(2 * (full - float(best.value[0])), 0.0)
    freedom = int((total > 0).sum()) - size
    return BradleyTerry(
        strengths=tuple(rows),
        reference=held,
        order=order,
        log_likelihood=float(best.value[0]),
        deviance=deviance,
        degrees_of_freedom=max(freedom, 0),
        p_value=chi_square_probability(deviance, freedom) if freedom > 0 else None,
        note=f"always or never favoured, so without a finite strength: {', '.join(endless)}" if endless else "",
    )


def _strength(name: str, value: float, error: float, confidence: float) -> Strength:
    """A strength, or none where it grows without end (its standard error then is huge)."""
    if abs(value) > 0.9 * WIDEST or error > 50:
        return Strength(name, None, None, Interval(None, None, confidence))
    half = normal_quantile(confidence) * error
    return Strength(name, float(value), float(error), Interval(float(value - half), float(value + half), confidence))
