"""Ratings of naturalness on a scale: answers of a rating task in, a table by method out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from study.analysis import estimates
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd


def rated(answers: pd.DataFrame) -> pd.DataFrame:
    """Return the answers given in rating tasks with the columns `rating` (a number) and `item` (empty where none).

    Raises
    ------
    AnalysisError
        When an answer is not a number.
    """
    import pandas as pd

    part = answers[answers["task"] == "rating"] if "task" in answers.columns else answers
    part = part[part["answer"].notna()].copy()
    part["rating"] = pd.to_numeric(part["answer"].astype(str).str.strip(), errors="coerce").astype(float)
    strange = ~(part["rating"].abs() <= estimates.LARGEST)
    if strange.any():
        found = part.loc[strange, "answer"].iloc[0]
        raise AnalysisError(f"expected ratings as numbers, found {str(found)!r}; recode the column `answer`")
    part["item"] = part["item"].fillna("").astype(str) if "item" in part.columns else ""
    return part


def rating_table(answers: pd.DataFrame, confidence: float = 0.95) -> list[dict[str, Any]]:
    """Return one entry a question and method: how it was rated.

    Returns
    -------
    list of dict
        `item`, `method`, `answers`, `participants`, `mean` (over participants of their means), `standard_error`,
        `low`, `high` (Student's t over participants), `standard_deviation` (of all answers), `median`, `note`,
        `distribution` (answers a value).

    Raises
    ------
    AnalysisError
        When an answer is not a number.
    """
    import pandas as pd

    part = rated(answers)
    method = part["method_a"].astype(str) if "method_a" in part.columns else pd.Series("all", index=part.index)
    rows = []
    for (question, name), values in part["rating"].groupby([part["item"], method], sort=True):
        means = values.groupby(part.loc[values.index, "participant"].astype(str)).mean().to_numpy(dtype=np.float64)
        test = estimates.mean_test(means, 0.0, confidence)
        rows.append(
            {
                "item": str(question),
                "method": str(name),
                "answers": len(values),
                "participants": test.participants,
                "mean": test.mean,
                "standard_error": test.standard_error,
                "low": test.interval.low,
                "high": test.interval.high,
                "standard_deviation": float(values.std(ddof=1)) if len(values) > 1 else math.nan,
                "median": float(values.median()),
                "note": test.note,
                "distribution": {
                    f"{value:g}": int(count) for value, count in values.value_counts().sort_index().items()
                },
            }
        )
    return [dict(estimates.plain(row)) for row in rows]
