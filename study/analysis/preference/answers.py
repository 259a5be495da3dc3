"""Answers of a preference task: a table of all answers in, those that were given out, with `chose_a` as a number."""

from __future__ import annotations

from typing import TYPE_CHECKING

from study.analysis import estimates
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

_TRUTH = {"true": "1", "false": "0"}
NEEDED_COLUMNS = ("participant", "chose_a", "method_a", "method_b")


def preference_answers(answers: pd.DataFrame) -> pd.DataFrame:
    """Return the answers of preference tasks, without missing ones, `chose_a` as 0, 1, or one half for a tie.

    Raises
    ------
    AnalysisError
        When a column is missing, or `chose_a` holds anything else.
    """
    import pandas as pd

    estimates.check_columns(answers, NEEDED_COLUMNS, "a preference analysis")
    chosen = answers[answers["task"] == "preference"] if "task" in answers.columns else answers
    chosen = chosen.astype({"chose_a": object})
    if "answer" in chosen.columns:
        chosen.loc[chosen["answer"] == "equal", "chose_a"] = 0.5
    given = chosen[chosen["chose_a"].notna()].copy()
    numbers = pd.to_numeric(given["chose_a"].astype(object).astype(str).str.lower().replace(_TRUTH), errors="coerce")
    strange = ~numbers.isin([0.0, 0.5, 1.0])
    if strange.any():
        found = given.loc[strange, "chose_a"].iloc[0]
        raise AnalysisError(
            f"expected true, false, or 0.5 for a tie in the column `chose_a`, found {str(found)!r}; recode it"
        )
    given["chose_a"] = numbers.astype(float)
    return given
