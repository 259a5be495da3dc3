"""Analysis of variance within participants, groups between them: a table of values a participant in, effects out.

A mixed (split-plot) design: every participant gives a value for every combination of the factors within, such as method
and motion, and belongs to one group, such as an order of presentation. Participants are random: each effect within is
judged by how much it varies between them. Where an effect has several degrees of freedom, its test needs sphericity,
and is corrected by how far that fails (Greenhouse & Geisser 1959).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from study.analysis import estimates
from study.analysis.variance.effect_sizes import Sizes, sizes
from study.analysis.variance.two_way import sum_to_zero
from study.arrays import FloatArray
from study.counting import counted


@dataclass(frozen=True)
class WithinEffect(Sizes):
    """An effect of a mixed design; F and tests are None where nothing varies that it could be judged by.

    `epsilon` is Greenhouse & Geisser's, by which `corrected_p_value` is corrected.
    """

    source: str
    sum_of_squares: float
    degrees_of_freedom: int
    error: str
    error_sum_of_squares: float
    error_degrees_of_freedom: int
    epsilon: float
    mean_square: float
    f: float | None
    p_value: float | None
    corrected_p_value: float | None


@dataclass(frozen=True)
class _Stratum:
    """Effects that are judged by one error: name, sum of squares and degrees of freedom of each."""

    effects: tuple[tuple[str, float, int], ...]
    error: str
    error_squares: float
    error_degrees: int
    epsilon: float


def mixed_design(
    values: ArrayLike,
    groups: Sequence[Any] | NDArray[Any],
    names: Sequence[str],
    *,
    between: str = "group",
    alpha: float = 0.05,
) -> tuple[WithinEffect, ...] | str:
    """Analyse a table in which no value is missing; a sentence that says why where it can't be.

    Parameters
    ----------
    values : array_like, shape (participants, levels of the first factor[, of the second, ...])
        One number a combination.
    groups : sequence, shape (participants,)
        Which group each belongs to; one group for all means a design within participants alone.
    names
        Of the factors within, one an axis.
    between
        What the groups are called.
    alpha
        Of the intervals of effect sizes.

    Notes
    -----
    Sums of squares are of type III: groups of different sizes count alike.
    """
    table = np.asarray(values, dtype=np.float64)
    people, levels = len(table), table.shape[1:]
    _, code = np.unique(np.asarray(groups).astype(str), return_inverse=True)
    count = int(code.max()) + 1 if people else 0
    left = people - count
    if left < 1:
        return f"{counted(people, 'participant')} in {counted(count, 'group')}: too few to estimate differences"
    if min(levels) < 2:
        return "a factor with one level: nothing to compare"
    design = np.column_stack([np.ones(people), sum_to_zero(code, count)])
    flat = table.reshape(people, -1)
    strata = []
    for which in _subsets(len(levels)):
        scores = flat @ _contrasts(levels, which)
        strata.append(_stratum(scores, design, " x ".join(names[axis] for axis in which), between, left))
    return tuple(_finished(*effect, stratum, alpha) for stratum in strata for effect in stratum.effects)


def _subsets(factors: int) -> list[tuple[int, ...]]:
    return [chosen for size in range(factors + 1) for chosen in combinations(range(factors), size)]


def _contrasts(levels: Sequence[int], which: Sequence[int]) -> FloatArray:
    """Orthonormal contrasts of the factors in `which`, the mean over all others."""
    found = np.ones((1, 1))
    for axis, count in enumerate(levels):
        mean = np.full((count, 1), 1 / np.sqrt(count))
        own = np.linalg.qr(np.column_stack([mean, np.eye(count)[:, :-1]]))[0][:, 1:] if axis in which else mean
        found = np.kron(found, own)
    return found


def _stratum(scores: FloatArray, design: FloatArray, within: str, between: str, left: int) -> _Stratum:
    """What is judged by one error: the effect within itself, and how the groups differ in it.

    One group alone leaves no effect between.
    """
    apart = scores - design @ np.linalg.lstsq(design, scores, rcond=None)[0]
    error, dimensions = float((apart**2).sum()), scores.shape[1]
    groups = list(range(1, design.shape[1]))
    tested = [(f"{within} x {between}" if within else between, groups)] if groups else []
    if within:
        tested.insert(0, (within, [0]))
    effects = []
    for name, columns in tested:
        others = np.delete(design, columns, axis=1)
        kept = scores - others @ np.linalg.lstsq(others, scores, rcond=None)[0] if others.shape[1] else scores
        effects.append((name, max(float((kept**2).sum()) - error, 0.0), dimensions * len(columns)))
    judge = f"{within} x participants" if within else "participants"
    return _Stratum(tuple(effects), judge, error, dimensions * left, _epsilon(apart.T @ apart))


def _epsilon(products: FloatArray) -> float:
    """Greenhouse-Geisser's epsilon from the residuals' sums of products."""
    squares = float((products**2).sum())
    return 1.0 if len(products) == 1 or squares <= 0 else float(np.trace(products)) ** 2 / (len(products) * squares)


def _finished(name: str, squares: float, degrees: int, stratum: _Stratum, alpha: float) -> WithinEffect:
    """An effect with its F, tests and sizes."""
    error, error_degrees = stratum.error_squares, stratum.error_degrees
    f = squares / degrees / (error / error_degrees) if error > 1e-12 * max(squares, 1.0) else None
    p_value, corrected = (
        None if f is None else estimates.f_probability(f, degrees * share, error_degrees * share)
        for share in (1.0, stratum.epsilon)
    )
    return WithinEffect(
        source=name,
        sum_of_squares=squares,
        degrees_of_freedom=degrees,
        error=stratum.error,
        error_sum_of_squares=error,
        error_degrees_of_freedom=error_degrees,
        epsilon=stratum.epsilon,
        mean_square=squares / degrees,
        f=f,
        p_value=p_value,
        corrected_p_value=corrected,
        **vars(sizes(f, degrees, error_degrees, alpha)),
    )
