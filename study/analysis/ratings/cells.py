"""Ratings by method and by order of presentation: answers of a rating task in, the cells of the 2 x 2 table out.

Wang & Bodenheimer 2003, section 4.2: cost function by presentation order. The order is the method that a participant
saw first.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from study.analysis import estimates
from study.analysis.ratings.table import rated

if TYPE_CHECKING:
    import pandas as pd


def rating_cells(answers: pd.DataFrame, confidence: float = 0.95) -> list[dict[str, Any]]:
    """Return one entry a question, method and order of presentation; none where one method was rated, or one order.

    Parameters
    ----------
    answers
        Of one rating study: `participant`, `method_a`, `answer`, and where they are known `item` and `trial`.
    confidence
        Of the intervals.

    Returns
    -------
    list of dict
        `item`, `method`, `order` (the method seen first), `answers`, `participants`, `mean` (over participants of their
        means), `standard_error`, `low`, `high` (Student's t over participants), `note`.

    Raises
    ------
    AnalysisError
        When an answer is not a number.
    """
    part = rated(answers)
    if part.empty or "method_a" not in part.columns:
        return []
    shown = answers.sort_values("trial", kind="stable") if "trial" in answers.columns else answers
    first_seen = shown.groupby(shown["participant"].astype(str))["method_a"].first().astype(str)
    who, method = part["participant"].astype(str), part["method_a"].astype(str)
    order = who.map(first_seen)
    if method.nunique() < 2 or order.nunique() < 2:
        return []
    rows = []
    for (item, name, first), values in part.groupby([part["item"], method, order], sort=False)["rating"]:
        means = values.groupby(who.loc[values.index]).mean().to_numpy(dtype=np.float64)
        test = estimates.mean_test(means, 0.0, confidence)
        row: dict[str, Any] = {"item": item, "method": name, "order": first, "answers": len(values)}
        row |= {"participants": test.participants, "mean": test.mean, "standard_error": test.standard_error}
        rows.append(row | {"low": test.interval.low, "high": test.interval.high, "note": test.note})
    return [dict(estimates.plain(row)) for row in rows]
