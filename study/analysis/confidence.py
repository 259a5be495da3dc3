"""How sure participants were of their choices: answers with `confidence` in, means over participants out.

The means of right and of wrong answers, or where none is right of each answer: whoever knows when they are wrong is
surer when right.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from study.analysis.estimates import Mean, mean_of

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class HowSure(Mean):
    """How sure participants were in a study of answers of one kind: the mean over participants of their means."""

    study: str
    answer: str
    """`right` or `wrong`, or the answer."""
    answers: int


def how_sure(answers: pd.DataFrame, confidence: float = 0.95) -> tuple[HowSure, ...]:
    """Return an entry a study and kind of answer; none where nobody was asked."""
    if "confidence" not in answers.columns:
        return ()
    part = answers[answers["confidence"].notna() & answers["answer"].notna()]
    if part.empty:
        return ()
    sure = part["confidence"].astype(float)
    given = part["correct"].astype(object).map({True: "right", False: "wrong"}).fillna(part["answer"])
    found = []
    for (study, kind), own in sure.groupby([part["study"].astype(str), given.astype(str)], sort=True):
        mean = mean_of(own.groupby(part["participant"][own.index].astype(str)).mean(), confidence)
        found.append(HowSure(**vars(mean), study=str(study), answer=str(kind), answers=len(own)))
    return tuple(found)
