"""Ratings of naturalness on a scale: answers of a rating task in, a table by method out (2003 section 4.2)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from study.analysis.estimates import Mean, mean_of
from study.analysis.ratings.answers import rated

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class MeanRating(Mean):
    """How a method was rated in one question: the mean over participants of their means."""

    item: str
    method: str
    answers: int


@dataclass(frozen=True)
class MethodRating(MeanRating):
    """How a method was rated in one question; spread, median and distribution are of all answers."""

    standard_deviation: float | None
    median: float
    distribution: dict[str, int]


def rating_table(answers: pd.DataFrame, confidence: float = 0.95) -> tuple[MethodRating, ...]:
    """Return one entry a question and method: how it was rated.

    Raises
    ------
    AnalysisError
        When an answer is not a number.
    """
    import pandas as pd

    part = rated(answers)
    who = part["participant"].astype(str)
    method = part["method_a"].astype(str) if "method_a" in part.columns else pd.Series("all", index=part.index)
    return tuple(
        MethodRating(
            **_mean(str(item), str(name), values, who, confidence),
            standard_deviation=float(values.std(ddof=1)) if len(values) > 1 else None,
            median=float(values.median()),
            distribution={f"{value:g}": int(count) for value, count in values.value_counts().sort_index().items()},
        )
        for (item, name), values in part["rating"].groupby([part["item"], method], sort=True)
    )


def _mean(item: str, method: str, values: pd.Series[float], who: pd.Series[str], confidence: float) -> dict[str, Any]:
    """The fields of a `MeanRating`."""
    mean = mean_of(values.groupby(who.loc[values.index]).mean(), confidence)
    return vars(mean) | {"item": item, "method": method, "answers": len(values)}
