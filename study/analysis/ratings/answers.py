"""Answers of a rating task: a table of all answers in, those that were given out, as numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

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

    part = answers[answers["task"].isin(("rating", "parallel-rating"))] if "task" in answers.columns else answers
    part = part[part["answer"].notna()].copy()
    part["rating"] = pd.to_numeric(part["answer"].astype(str).str.strip(), errors="coerce").astype(float)
    strange = ~(part["rating"].abs() <= estimates.LARGEST)
    if strange.any():
        found = part.loc[strange, "answer"].iloc[0]
        raise AnalysisError(f"expected ratings as numbers, found {str(found)!r}; recode the column `answer`")
    part["item"] = part["item"].fillna("").astype(str) if "item" in part.columns else ""
    return part


def of_pairs(answers: pd.DataFrame) -> bool:
    """Whether pairs were rated in a rating study, not single stimuli."""
    return "method_b" in answers.columns and bool((answers["method_b"].fillna("").astype(str) != "").any())


def first_seen(answers: pd.DataFrame) -> pd.Series[str]:
    """Return the method that each participant saw first, by the participant's name."""
    shown = answers.sort_values("trial", kind="stable") if "trial" in answers.columns else answers
    return shown.groupby(shown["participant"].astype(str))["method_a"].first().astype(str)
