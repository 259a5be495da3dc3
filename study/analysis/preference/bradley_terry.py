"""Strengths of several methods from answers to pairs of them, with an effect of the order (Bradley & Terry 1952).

    P(a) : P(b) : P(neither) = exp(d / 2) : exp(-d / 2) : nu,   d = strength a - strength b + order where a comes first

`nu` is how readily people say that two are equal (Davidson 1970); without ties it is 0, and d the logit of P(a).

Answers come in, strengths with standard errors go out (Davidson & Beaver 1977; Agresti 2013, section 11.6). Where it is
known who answered, standard errors are those of participants (the sandwich of Liang & Zeger 1986), not of answers. If
the motions are known too, participants and motions both are samples (Cameron, Gelbach & Miller 2011: the sandwich of
either, less that of their cells). Estimates are those of maximum likelihood. Where a method never loses, the likelihood
has no maximum; linear programs find which differences are finite (Konis 2007), and those are estimated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from study.analysis.crossed import FEWEST_MOTIONS
from study.analysis.estimates import Interval, chi_square_probability, normal_quantile, t_quantile
from study.analysis.scoring import maximise
from study.arrays import BoolArray, FloatArray
from study.counting import counted
from study.errors import AnalysisError

WIDEST = 15.0


@dataclass(frozen=True)
class Strength:
    """A method's strength beside the reference, on the logit scale; None where it can't be determined."""

    method: str
    value: float | None
    standard_error: float | None
    interval: Interval


@dataclass(frozen=True)
class BradleyTerry:
    """Strengths of methods."""

    strengths: tuple[Strength, ...]
    """Of every method, strongest first; the reference's is 0."""
    reference: str
    """The reference method."""
    order: Strength | None
    """What coming first (or playing at home) adds, on the logit scale; None where the order is not known."""
    ties: Strength | None
    """The logarithm of Davidson's nu; None where nobody called two equal."""
    log_likelihood: float
    deviance: float
    degrees_of_freedom: int
    p_value: float | None
    """`log_likelihood`, `deviance`, `degrees_of_freedom`, `p_value`: goodness of fit against free shares of every
    pair and order."""
    participants: int | None = None
    """Participants behind the standard errors; None where every answer counts as independent."""
    motions: int = 0
    """Motions behind them, where these are taken for a sample too."""
    note: str = ""
    """What can't be estimated, and why."""


def fit_bradley_terry(
    first: Sequence[str],
    second: Sequence[str],
    first_favoured: ArrayLike,
    shown: ArrayLike,
    *,
    tied: ArrayLike = 0.0,
    with_order: bool = True,
    reference: str | None = None,
    confidence: float = 0.95,
    participants: Sequence[str] | None = None,
    motions: Sequence[str] | None = None,
) -> BradleyTerry | str:
    """Fit strengths; a sentence that says why where they can't be fitted.

    Parameters
    ----------
    first, second : sequence of str, shape (rows,)
        The methods of each row, in the order of presentation.
    first_favoured, shown : array_like, shape (rows,)
        How often the first was favoured, half of the ties included, of how many answers.
    tied : array_like, shape (rows,)
        How many of them were ties.
    with_order
        Whether coming first may matter.
    reference
        The method whose strength is 0; unless given, the first by name of those that most others are finitely apart
        from.
    participants : sequence of str, shape (rows,)
        Who answered; if omitted, every answer counts as independent.
    motions : sequence of str, shape (rows,)
        What was shown; taken for a sample too where three or more were.

    Raises
    ------
    AnalysisError
        When the reference is none of the methods.
    """
    yes, total = np.asarray(first_favoured, float), np.asarray(shown, float)
    tied = np.broadcast_to(np.asarray(tied, float), total.shape)
    methods = sorted({*first, *second})
    if len(methods) < 2 or total.sum() == 0:
        return "fewer than two methods were compared"
    if tied.sum() == total.sum():
        return "every answer was a tie: strengths cannot be estimated"
    if reference is not None and reference not in methods:
        raise AnalysisError(f"expected one of the methods {', '.join(methods)} as reference, found {reference!r}")
    design = np.zeros((len(yes), len(methods)))
    for row, names in enumerate(zip(first, second, strict=True)):
        for method, sign in zip(names, (1.0, -1.0), strict=True):
            design[row, methods.index(method)] += sign
    if np.linalg.matrix_rank(design[total > 0]) < len(methods) - 1:
        return "the methods are not linked by comparisons: strengths cannot be estimated"
    note = ""
    if with_order:
        every = np.column_stack([design, np.ones(len(yes))])
        note = _why_no_order(every, yes, total, tied)
        if note == DECIDED:
            return note
        design = design if note else every
    signed = _directions(design, yes, total, tied)
    apart = _differences_finite(signed, len(methods))
    place = int(np.argmax(apart.sum(axis=1))) if reference is None else methods.index(reference)
    groups = [
        np.unique(np.asarray(names), return_inverse=True)[1]
        for names, fewest in ((participants, 1), (motions, FEWEST_MOTIONS))
        if names is not None and len(set(names)) >= fewest
    ]
    besides = np.ones(design.shape[1] - len(methods), dtype=bool)
    told = np.concatenate([np.delete(apart[place], place), besides, _ties_finite(signed, design.shape[1])])
    others = [method for method in methods if method != methods[place]]
    columns = np.delete(design, place, axis=1)
    return _fitted(columns, (yes, total, tied), others, methods[place], groups, confidence, told, note)


DECIDED = "every answer went to the same position: this says nothing about the methods"


def _why_no_order(design: FloatArray, yes: FloatArray, total: FloatArray, tied: FloatArray) -> str:
    """Why the effect of the order, the last column, can't be estimated beside strengths; empty where it can."""
    if np.linalg.matrix_rank(design[total > 0]) < design.shape[1] - 1:
        return "the orders shown cannot separate an effect of order from the strengths: it is omitted"
    if yes.sum() in (0.0, total.sum()):
        return DECIDED
    signed = _directions(design, yes, total, tied)
    if not _finite(signed, np.eye(signed.shape[1])[[design.shape[1] - 1]])[0]:
        return "these answers cannot separate the effect of order from the strengths: it is omitted"
    return ""


def _directions(design: FloatArray, yes: FloatArray, total: FloatArray, tied: FloatArray) -> FloatArray:
    """Steps of the effects, and of log nu where there are ties, along which no answer that was given becomes rarer.

    They are those with `rows @ step >= 0`: an answer stays as frequent where neither of the others gains on it.
    """
    won, lost = design[yes - tied / 2 > 0], design[total - yes - tied / 2 > 0]
    if not tied.any():
        return np.unique(np.concatenate([won, -lost]), axis=0)
    level = design[tied > 0]
    rows = [(won, 0.0), (won / 2, -1.0), (-lost, 0.0), (-lost / 2, -1.0), (level / 2, 1.0), (-level / 2, 1.0)]
    return np.unique(np.concatenate([np.insert(part, part.shape[1], nu, axis=1) for part, nu in rows]), axis=0)


def _differences_finite(signed: FloatArray, methods: int) -> BoolArray:
    """Which strengths are finitely apart, shape (methods, methods)."""
    pairs = np.array(np.triu_indices(methods, 1)).T
    contrasts = np.zeros((len(pairs), signed.shape[1]))
    contrasts[np.arange(len(pairs)), pairs[:, 0]], contrasts[np.arange(len(pairs)), pairs[:, 1]] = 1.0, -1.0
    found = np.eye(methods, dtype=bool)
    found[pairs[:, 0], pairs[:, 1]] = found[pairs[:, 1], pairs[:, 0]] = _finite(signed, contrasts)
    return found


def _ties_finite(signed: FloatArray, effects: int) -> BoolArray:
    """Whether nu has a finite maximum of likelihood; empty without ties."""
    return _finite(signed, np.eye(signed.shape[1])[effects:])


def _finite(signed: FloatArray, contrasts: FloatArray) -> BoolArray:
    """Which contrasts of the effects have a finite maximum of likelihood.

    The likelihood does not fall along a direction that goes with every answer; what changes along one is not finite.
    """
    from scipy.optimize import linprog

    def highest(aim: FloatArray) -> float:
        found = linprog(-aim, A_ub=-signed, b_ub=np.zeros(len(signed)), bounds=(-1, 1)).fun
        assert found is not None, "no step at all is always allowed"
        return -float(found)

    if highest(signed.sum(axis=0)) < 1e-7:
        return np.ones(len(contrasts), dtype=bool)
    return np.array([max(highest(one), highest(-one)) < 1e-7 for one in contrasts], dtype=bool)


def _fitted(
    design: FloatArray,
    counts: tuple[FloatArray, FloatArray, FloatArray],
    others: Sequence[str],
    held: str,
    groups: Sequence[NDArray[np.intp]],
    confidence: float,
    told: BoolArray,
    note: str,
) -> BradleyTerry:
    """The strengths by maximum likelihood, with their covariance over participants where there are groups.

    `design` has a row a comparison and a column a method but the one held at 0; `counts` are answers for the first with
    half of the ties, answers in all, and ties. `told` says of each effect whether the answers tell it.
    """
    yes, total, tied = counts
    effects = design.shape[1]
    with_ties = len(told) > effects

    def parts(point: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Half the logit of each row, log nu, and the logarithm of the sum of the three."""
        half, nu = point[:, :effects] @ design.T / 2, point[:, effects:] if with_ties else np.full((1, 1), -np.inf)
        return half, nu, np.logaddexp(np.logaddexp(half, -half), nu)

    def value(point: FloatArray, _: NDArray[np.intp]) -> FloatArray:
        half, nu, whole = parts(point)
        ties = (tied * nu).sum(axis=1) if with_ties else 0.0
        return np.asarray(((2 * yes - total) * half - total * whole).sum(axis=1) + ties, dtype=np.float64)

    def rows(point: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Of each row the score `(rows, effects)`; the chance of the first, half a tie's included, and of a tie."""
        half, nu, whole = (part[0] for part in parts(point[None]))
        neither = np.exp(nu - whole)
        first = np.exp(half - whole) + neither / 2
        score = (yes - total * first)[:, None] * design
        return (np.column_stack([score, tied - total * neither]) if with_ties else score), first, neither

    def scores(point: FloatArray, _: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        score, first, neither = rows(point[0])
        information = np.zeros((len(told), len(told)))
        information[:effects, :effects] = design.T @ (design * (total * (first - neither / 4 - first**2))[:, None])
        if with_ties:
            information[effects, :effects] = (total * (neither / 2 - first * neither)) @ design
            information[:effects, effects] = information[effects, :effects]
            information[effects, effects] = (total * neither * (1 - neither)).sum()
        return score.sum(axis=0)[None], information[None]

    size = len(told)
    best = maximise(value, scores, np.zeros((1, size)), np.full(size, -WIDEST), np.full(size, WIDEST))
    point = best.point[0]
    _, information = scores(point[None], np.zeros(1, dtype=np.intp))
    errors = np.full(size, np.nan)
    scored = rows(point)[0]
    errors[told] = _errors(information[0][np.ix_(told, told)], scored[:, told], groups)
    sizes = [int(group.max()) + 1 for group in groups]
    times = t_quantile(confidence, max(min(sizes) - 1, 1)) if sizes else normal_quantile(confidence)
    # By place, not by name: a method may well be called "order".
    names = [*others, *(["order"] if effects > len(others) else []), *(["equal"] if with_ties else [])]
    found = [
        _strength(name, float(at) if finite else None, float(error), times, confidence)
        for name, at, finite, error in zip(names, point, told, errors, strict=True)
    ]
    ties = found.pop() if with_ties else None
    order = found.pop() if effects > len(others) else None
    ranked = [*zip(point, found, strict=False), (0.0, Strength(held, 0.0, None, Interval(0.0, 0.0, confidence)))]
    ranked.sort(key=lambda pair: -pair[0])
    every = (*found, *([order] if order else []), *([ties] if ties else []))
    notes = [*filter(None, [note]), *_noted(every, held, sizes)]
    deviance, freedom = _misfit(design, counts, float(best.value[0]), size)
    return BradleyTerry(
        strengths=tuple(row for _, row in ranked),
        reference=held,
        order=order,
        ties=ties,
        log_likelihood=float(best.value[0]),
        deviance=deviance,
        degrees_of_freedom=max(freedom, 0),
        p_value=chi_square_probability(deviance, freedom) if freedom > 0 else None,
        participants=sizes[0] if sizes else None,
        motions=sizes[1] if len(sizes) > 1 else 0,
        note="; ".join(notes),
    )


def _errors(information: FloatArray, scores: FloatArray, groups: Sequence[NDArray[np.intp]]) -> FloatArray:
    """Standard errors: of independent answers, of participants, or of participants and motions; NaN for too few people.

    Where the difference of the sandwiches is no variance, motions do not differ by more than chance: the larger of
    both is taken.
    """
    inverse = np.linalg.pinv(information)
    if not groups:
        return np.asarray(np.sqrt(np.maximum(np.diag(inverse), 0.0)), dtype=np.float64)
    if int(groups[0].max()) + 1 <= len(inverse):
        return np.full(len(inverse), np.nan)

    def spread(group: NDArray[np.intp]) -> FloatArray:
        count = int(group.max()) + 1
        sums = np.zeros((count, scores.shape[1]))
        np.add.at(sums, group, scores)
        return np.asarray(np.diag(inverse @ (sums.T @ sums) @ inverse) * count / (count - 1), dtype=np.float64)

    found = spread(groups[0])
    if len(groups) > 1:
        own, cells = spread(groups[1]), np.unique(np.stack(groups), axis=1, return_inverse=True)[1].ravel()
        found = np.maximum(found + own - spread(cells), np.maximum(found, own))
    return np.asarray(np.sqrt(np.maximum(found, 0.0)), dtype=np.float64)


def _strength(name: str, value: float | None, error: float, times: float, confidence: float) -> Strength:
    """A strength, or none where it has no finite estimate; without a standard error where nothing tells it."""
    # Participants who answer just alike leave no spread that could be judged by.
    if value is None or not np.isfinite(error) or error < 1e-9:
        return Strength(name, value, None, Interval(None, None, confidence))
    return Strength(name, value, error, Interval(value - times * error, value + times * error, confidence))


def _noted(effects: Sequence[Strength], held: str, sizes: Sequence[int]) -> Iterator[str]:
    """What could not be estimated, and why."""
    if endless := [row.method for row in effects if row.value is None]:
        one_way = f"the answers for or against it all go one way, so its distance from {held} has no finite estimate"
        yield f"{', '.join(endless)}: {one_way}"
    if any(row.value is not None and row.standard_error is None for row in effects):
        yield f"{counted(sizes[0] if sizes else 0, 'participant')}: too few, or too similar, for standard errors"


def _misfit(
    design: FloatArray, counts: tuple[FloatArray, FloatArray, FloatArray], log_likelihood: float, size: int
) -> tuple[float, int]:
    """Deviance from the saturated model, which has one share for every pair and order, and its degrees of freedom.

    Rows may hold single answers; those of one pair and order are put together.
    """
    from scipy.special import xlogy

    yes, total, tied = counts
    cells = np.unique(design, axis=0, return_inverse=True)[1].ravel()
    seen, *given = (np.bincount(cells, each) for each in (total, yes - tied / 2, total - yes - tied / 2, tied))
    full = float(sum(xlogy(each, each / np.maximum(seen, 1e-12)).sum() for each in given))
    freedom = int((seen > 0).sum()) * (2 if size > design.shape[1] else 1) - size
    return max(2 * (full - log_likelihood), 0.0), freedom
