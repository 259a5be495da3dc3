"""Two-way analysis of variance of ratings: method by order of presentation, with its degrees of freedom.

Answers of a rating task in, a table for each question out. Wang & Bodenheimer 2003, section 4.2: "two-way
between-subjects analyses of variance", 2 x 2, cost function by presentation order. The paper prints F = 6.39,
MS = 6.94, p = 0.01 and no degrees of freedom; with 26 participants and two sequences each they would be 1 and 48.

The published test takes the two ratings of one participant for independent. Beside it stands the test that does not:
over participants, the difference of their ratings of the two methods.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from study.analysis import estimates
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]


def two_way(values: ArrayLike, first: ArrayLike, second: ArrayLike, names: tuple[str, str]) -> list[dict[str, Any]]:
    """Between-subjects analysis of variance with two factors and their interaction.

    Parameters
    ----------
    values : (answers,)
        What was measured.
    first, second : (answers,)
        Levels of the two factors.
    names
        What the factors are called.

    Returns
    -------
    list of dict
        For each factor, their interaction, and the residual: `source`, `sum_of_squares`, `degrees_of_freedom`,
        `mean_square`, and but for the residual `f`, `error_degrees_of_freedom`, `p_value`, `partial_eta_squared`.

    Raises
    ------
    AnalysisError
        Where a factor has one level, a combination of levels has no answers, or nothing is left for the residual.

    Notes
    -----
    Sums of squares are of type III: of each effect beside all others, factors coded to sum to zero. With equally many
    answers in each combination they are the textbook's.
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
    main = [_sum_to_zero(code, len(found)) for code, found in zip(codes, levels, strict=True)]
    together = (main[0][:, :, None] * main[1][:, None, :]).reshape(len(y), -1)
    effects = {names[0]: main[0], names[1]: main[1], f"{names[0]} x {names[1]}": together}
    residual = _left_over(y, list(effects.values()))
    rows = []
    for name, columns in effects.items():
        others = [other for key, other in effects.items() if key != name]
        rows.append(_effect(name, _left_over(y, others) - residual, columns.shape[1], residual, left))
    error = {
        "source": "residual",
        "sum_of_squares": residual,
        "degrees_of_freedom": left,
        "mean_square": residual / left,
    }
    return [*rows, error]


def _effect(name: str, squares: float, degrees: int, residual: float, left: int) -> dict[str, Any]:
    squares = max(squares, 0.0)
    mean_square = squares / degrees
    # Where every answer of a combination is the same, nothing is left to compare with.
    f = mean_square / (residual / left) if residual > 1e-12 * max(squares, 1.0) else None
    return {
        "source": name,
        "sum_of_squares": squares,
        "degrees_of_freedom": degrees,
        "mean_square": mean_square,
        "f": f,
        "error_degrees_of_freedom": left,
        "p_value": None if f is None else estimates.f_probability(f, degrees, left),
        "partial_eta_squared": squares / (squares + residual) if squares + residual > 0 else None,
    }


def _sum_to_zero(code: NDArray[np.int64], levels: int) -> FloatArray:
    """Columns that code a factor so that its effects sum to zero: the last level is minus one in each."""
    rows = np.vstack([np.eye(levels - 1), -np.ones(levels - 1)])
    return rows[code]


def _left_over(y: FloatArray, columns: list[FloatArray]) -> float:
    """Sum of squares that a linear model with a constant leaves."""
    design = np.column_stack([np.ones(len(y)), *columns])
    fitted = design @ np.linalg.lstsq(design, y, rcond=None)[0]
    return float(np.sum((y - fitted) ** 2))


def rating_anova(answers: pd.DataFrame, confidence: float = 0.95) -> list[dict[str, Any]]:
    """Analyse each question of a rating study by method and by order of presentation (2003 section 4.2).

    Parameters
    ----------
    answers
        Answers of one rating study: `participant`, `method_a`, `answer`, `trial`, and `item` where there are several
        questions. The order is the method that a participant saw first.
    confidence
        Of the interval of the difference.

    Returns
    -------
    list of dict
        One entry a question: `item`, `participants`, `answers`, `anova` (see `two_way`; empty where it can't be had),
        `difference` (of each participant's mean ratings, where there are two methods: `of`, `mean`, `low`, `high`,
        `t`, `degrees_of_freedom`, `p_value`), `note`.
    """
    import pandas as pd

    part = answers[answers["answer"].notna()].copy()
    if part.empty or "method_a" not in part.columns or part["method_a"].nunique() < 2:
        return []
    part["rating"] = pd.to_numeric(part["answer"])
    part["method_a"] = part["method_a"].astype(str)
    shown = answers.sort_values("trial") if "trial" in answers.columns else answers
    first_seen = shown.groupby(answers["participant"].astype(str))["method_a"].first().astype(str)
    part["order"] = part["participant"].astype(str).map(first_seen) + " first"
    item = part["item"].fillna("").astype(str) if "item" in part.columns else pd.Series("", index=part.index)
    return [
        dict(estimates.plain(_question(str(name), group, confidence))) for name, group in part.groupby(item, sort=False)
    ]


def _question(name: str, part: pd.DataFrame, confidence: float) -> dict[str, Any]:
    note = ""
    try:
        table = two_way(part["rating"], part["method_a"], part["order"], ("method", "order"))
    except AnalysisError as error:
        table, note = [], f"no analysis of variance: {error}"
    return {
        "item": name,
        "participants": int(part["participant"].nunique()),
        "answers": len(part),
        "anova": table,
        "difference": _difference(part, confidence),
        "note": note,
    }


def _difference(part: pd.DataFrame, confidence: float) -> dict[str, Any] | None:
    """The difference of the two methods over participants; None where there are not two."""
    methods = sorted(part["method_a"].unique())
    if len(methods) != 2:
        return None
    means = part.pivot_table(index="participant", columns="method_a", values="rating", aggfunc="mean")
    apart = (means[methods[1]] - means[methods[0]]).dropna().to_numpy(dtype=np.float64)
    test = estimates.mean_test(apart, 0.0, confidence)
    return {
        "of": f"{methods[1]} minus {methods[0]}",
        "mean": test.mean,
        "low": test.interval.low,
        "high": test.interval.high,
        "t": test.statistic,
        "degrees_of_freedom": test.degrees_of_freedom,
        "p_value": test.p_value,
    }


def anova_sentences(questions: list[dict[str, Any]], alpha: float) -> list[str]:
    """Each effect of each question in words, degrees of freedom always with it."""
    found = []
    for question in questions:
        for row in question["anova"]:
            if row.get("f") is None:
                continue
            verdict = "significant" if row["p_value"] < alpha else "not significant"
            found.append(
                f"{question['item'] or 'rating'}: {row['source']} F({row['degrees_of_freedom']}, "
                f"{row['error_degrees_of_freedom']}) = {row['f']:.2f}, MS = {row['mean_square']:.2f}, "
                f"p = {row['p_value']:.3g} ({verdict} at {alpha:g})"
            )
    return found
