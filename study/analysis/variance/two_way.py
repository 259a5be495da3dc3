"""Two-way analysis of variance between subjects: values and the levels of two factors in, a table out.

Wang & Bodenheimer 2003, section 4.2: "two-way between-subjects analyses of variance", 2 x 2, cost function by
presentation order. The paper prints F = 6.39, MS = 6.94, p = 0.01 and no degrees of freedom; with 26 participants and
two sequences each they would be 1 and 48. The same values in a design within participants: `repeated_measures`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from study.analysis import estimates
from study.analysis.variance.effect_sizes import Sizes, sizes
from study.arrays import FloatArray, IntArray
from study.errors import AnalysisError


@dataclass(frozen=True)
class VarianceRow:
    """A row of the table."""

    source: str
    sum_of_squares: float
    degrees_of_freedom: int
    mean_square: float


@dataclass(frozen=True)
class VarianceEffect(VarianceRow, Sizes):
    """A factor or the interaction; `f` is None where nothing varies that it could be judged by."""

    f: float | None
    error_degrees_of_freedom: int
    p_value: float | None


TwoWay = tuple[VarianceEffect, VarianceEffect, VarianceEffect, VarianceRow]
"""The two factors, their interaction, and the residual."""


def two_way(
    values: ArrayLike,
    first: ArrayLike,
    second: ArrayLike,
    names: tuple[str, str],
    alpha: float = 0.05,
) -> TwoWay:
    """Between-subjects analysis of variance with two factors and their interaction.

    Parameters
    ----------
    values : (answers,)
        What was measured.
    first, second : (answers,)
        Levels of the two factors.
    names
        What the factors are called.
    alpha
        Of the intervals of effect sizes, see `effect_sizes`.

    Raises
    ------
    AnalysisError
        Where a factor has one level, a combination of levels has no answers, or nothing is left for the residual.

    Notes
    -----
    Sums of squares of type III are those of each effect beside all others, factors coded to sum to zero: they compare
    means of cells that count alike, however many answers are in each. With equally many answers in each combination
    they are the textbook's.
    """
    y = np.asarray(values, dtype=np.float64)
    levels, codes = zip(
        *(np.unique(np.asarray(factor), return_inverse=True) for factor in (first, second)), strict=True
    )
    counts = np.zeros((len(levels[0]), len(levels[1])), dtype=np.int64)
    np.add.at(counts, codes, 1)
    for name, found in zip(names, levels, strict=True):
        if len(found) < 2:
            raise AnalysisError(f"expected at least two levels of {name}, found {', '.join(map(str, found)) or 'none'}")
    if (counts == 0).any():
        row, column = (int(index) for index in np.argwhere(counts == 0)[0])
        raise AnalysisError(
            f"expected answers for every combination of {names[0]} and {names[1]}, found none for {levels[0][row]} "
            f"with {levels[1][column]}; let more people take part, in all groups"
        )
    left = len(y) - counts.size
    if left < 1:
        raise AnalysisError(
            f"expected more answers than the {counts.size} combinations of {names[0]} and {names[1]}, found {len(y)}"
        )
    main = [sum_to_zero(code, len(found)) for code, found in zip(codes, levels, strict=True)]
    together = (main[0][:, :, None] * main[1][:, None, :]).reshape(len(y), -1)
    effects = {names[0]: main[0], names[1]: main[1], f"{names[0]} x {names[1]}": together}
    residual = _left_over(y, list(effects.values()))
    rows = []
    for name, columns in effects.items():
        beside = [other for key, other in effects.items() if key != name]
        rows.append(_effect(name, _left_over(y, beside) - residual, columns.shape[1], residual, left, alpha))
    return rows[0], rows[1], rows[2], VarianceRow("residual", residual, left, residual / left)


def _effect(name: str, squares: float, degrees: int, residual: float, left: int, alpha: float) -> VarianceEffect:
    squares = max(squares, 0.0)
    mean_square = squares / degrees
    # Where every answer of a combination is the same, nothing is left to compare with.
    f = mean_square / (residual / left) if residual > 1e-12 * max(squares, 1.0) else None
    p_value = None if f is None else estimates.f_probability(f, degrees, left)
    of = sizes(f, degrees, left, alpha)
    return VarianceEffect(name, squares, degrees, mean_square, f, left, p_value, **vars(of))


def sum_to_zero(code: IntArray, levels: int) -> FloatArray:
    """Columns that code a factor so that effects sum to zero, shape (rows, levels - 1): the last level is minus one."""
    rows = np.vstack([np.eye(levels - 1), -np.ones(levels - 1)])
    return rows[code]


def _left_over(y: FloatArray, columns: list[FloatArray]) -> float:
    """Sum of squares that a linear model with a constant leaves."""
    design = np.column_stack([np.ones(len(y)), *columns])
    fitted = design @ np.linalg.lstsq(design, y, rcond=None)[0]
    return float(np.sum((y - fitted) ** 2))
