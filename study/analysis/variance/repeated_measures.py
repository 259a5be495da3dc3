"""Analysis of variance within participants, groups between them: a table of values a participant in, effects out.

A mixed (split-plot) design: every participant gives a value for every combination of the factors within, such as method
and motion, and belongs to one group, such as an order of presentation. Participants are random: each effect within is
judged by how much it varies between them. Where an effect has several degrees of freedom, its test needs sphericity,
and is corrected by how far that fails (Greenhouse & Geisser 1959; Huynh & Feldt 1976 as mended by Lecoutre 1991).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from study.analysis import estimates
from study.analysis.variance.two_way import sizes, sum_to_zero
from study.counting import counted

FloatArray = NDArray[np.float64]


def mixed_design(
    values: ArrayLike,
    groups: Sequence[Any] | NDArray[Any],
    names: Sequence[str],
    *,
    between: str = "group",
    alpha: float = 0.05,
) -> list[dict[str, Any]] | str:
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

    Returns
    -------
    list of dict
        One entry an effect: `source`, `sum_of_squares`, `degrees_of_freedom`, `mean_square`, `error` (what it is judged
        by), `error_sum_of_squares`, `error_degrees_of_freedom`, `f`, `p_value`, `epsilon` (Greenhouse-Geisser's; 1 with
        one degree of freedom within), `huynh_feldt_epsilon`, `corrected_p_value` (by Greenhouse-Geisser),
        `huynh_feldt_p_value`, `partial_eta_squared`, `partial_omega_squared`, `effect_low`, `effect_high`,
        `generalized_eta_squared` (Olejnik & Algina 2003: comparable with a design between participants).

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
        return f"{counted(people, 'participant')} in {counted(count, 'group')}: too few to see how participants differ"
    if min(levels) < 2:
        return "a factor with one level: nothing to compare"
    design = np.column_stack([np.ones(people), sum_to_zero(code, count)])
    flat = table.reshape(people, -1)
    rows = []
    for which in _subsets(len(levels)):
        scores = flat @ _contrasts(levels, which)
        within = " x ".join(names[axis] for axis in which)
        rows += _stratum(scores, design, within, between, left)
    errors = float(sum(row["error_sum_of_squares"] for row in rows if row["leads"]))
    return [_finished(row, errors, alpha) for row in rows if row["source"]]


def likeness(values: ArrayLike, groups: Sequence[Any] | NDArray[Any]) -> dict[str, float | None]:
    """Return how alike the values of one participant are, and what that does to tests that take them for independent.

    Parameters
    ----------
    values : array_like, shape (participants, ...)
        As `mixed_design` takes them.
    groups : sequence, shape (participants,)

    Returns
    -------
    dict
        `intraclass_correlation` (consistency, groups and columns taken out; below zero where people are more alike
        than chance would have it), `between_effect` and `within_effect`: by how much the error variance of a comparison
        between groups is larger, and of one within participants smaller, than that of independent values.
        None where that can't be told.
    """
    table = np.asarray(values, dtype=np.float64)
    people, columns = len(table), math.prod(table.shape[1:])
    table = table.reshape(people, columns)
    _, code = np.unique(np.asarray(groups).astype(str), return_inverse=True)
    count = int(code.max()) + 1 if people else 0
    nothing = dict.fromkeys(("intraclass_correlation", "between_effect", "within_effect"))
    if people - count < 1 or columns < 2:
        return nothing
    means = np.array([table[code == group].mean(axis=0) for group in range(count)])
    apart = table - means[code]
    own = apart.mean(axis=1)
    between = columns * float((own**2).sum()) / (people - count)
    within = float(((apart - own[:, None]) ** 2).sum()) / ((people - count) * (columns - 1))
    spread = between + (columns - 1) * within
    if spread <= 1e-12:
        return nothing
    correlation = (between - within) / spread
    return {
        "intraclass_correlation": correlation,
        "between_effect": 1 + (columns - 1) * correlation,
        "within_effect": 1 - correlation,
    }


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


def _stratum(scores: FloatArray, design: FloatArray, within: str, between: str, left: int) -> list[dict[str, Any]]:
    """Effects that are judged by one error: that within itself, and how the groups differ in it."""
    apart = scores - design @ np.linalg.lstsq(design, scores, rcond=None)[0]
    error, dimensions = float((apart**2).sum()), scores.shape[1]
    epsilon = _epsilons(apart.T @ apart, left, design.shape[1])
    groups = list(range(1, design.shape[1]))
    tested = [(f"{within} x {between}" if within else between, groups)] if groups else []
    if within:
        tested.insert(0, (within, [0]))
    rows: list[dict[str, Any]] = []
    for name, columns in tested:
        others = np.delete(design, columns, axis=1)
        kept = scores - others @ np.linalg.lstsq(others, scores, rcond=None)[0] if others.shape[1] else scores
        squares = max(float((kept**2).sum()) - error, 0.0)
        rows.append(
            {
                "source": name,
                "sum_of_squares": squares,
                "degrees_of_freedom": dimensions * len(columns),
                "error": f"{within} x participants" if within else "participants",
                "error_sum_of_squares": error,
                "error_degrees_of_freedom": dimensions * left,
                "epsilon": epsilon[0],
                "huynh_feldt_epsilon": epsilon[1],
                "leads": not rows,
            }
        )
    # One group alone leaves no effect between, but its error still counts in generalized eta squared.
    return rows or [{"source": "", "error_sum_of_squares": error, "leads": True}]


def _epsilons(products: FloatArray, left: int, groups: int) -> tuple[float, float]:
    """Greenhouse-Geisser's and Huynh-Feldt's epsilon from the residuals' sums of products."""
    dimensions = len(products)
    squares = float((products**2).sum())
    if dimensions == 1 or squares <= 0:
        return 1.0, 1.0
    greenhouse = float(np.trace(products)) ** 2 / (dimensions * squares)
    people = left + groups
    below = dimensions * (left - dimensions * greenhouse)
    huynh = ((people - groups + 1) * dimensions * greenhouse - 2) / below if below > 0 else 1.0
    return greenhouse, float(min(max(huynh, greenhouse), 1.0))


def _finished(row: dict[str, Any], errors: float, alpha: float) -> dict[str, Any]:
    """An effect with its F, tests and sizes; F is None where nothing varies that it could be judged by."""
    del row["leads"]
    squares, degrees = row["sum_of_squares"], row["degrees_of_freedom"]
    error, error_degrees = row["error_sum_of_squares"], row["error_degrees_of_freedom"]
    f = squares / degrees / (error / error_degrees) if error > 1e-12 * max(squares, 1.0) else None
    tests = {
        key: None if f is None else estimates.f_probability(f, degrees * share, error_degrees * share)
        for key, share in (
            ("p_value", 1.0),
            ("corrected_p_value", row["epsilon"]),
            ("huynh_feldt_p_value", row["huynh_feldt_epsilon"]),
        )
    }
    return {
        **row,
        "mean_square": squares / degrees,
        "f": f,
        **tests,
        **sizes(f, degrees, error_degrees, alpha),
        "generalized_eta_squared": None if f is None else squares / (squares + errors),
    }
