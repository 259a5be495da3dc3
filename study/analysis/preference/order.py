"""How far the order of presentation decided a preference: answers in, percentages by place and a test out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from study.analysis.preference.participants import participant_tests

if TYPE_CHECKING:
    import pandas as pd

ONE_ORDER = "the two were always shown in the same order: a preference cannot be separated from an effect of order"


@dataclass(frozen=True)
class OrderEffect:
    """How far the order of presentation decided the answer; `note` says why something can't be given.

    `first_percent` is how often the one shown first was favoured, tested by one share a participant against one half;
    the others are percentages for the first method by its place, and their mean, which is free of the order effect.
    """

    answers: int
    first_percent: float | None = None
    p_value: float | None = None
    percent_a_first: float | None = None
    percent_a_second: float | None = None
    balanced_percent: float | None = None
    note: str = ""


def order_effect(part: pd.DataFrame, confidence: float = 0.95) -> OrderEffect:
    """Return how far the order of presentation decided the answer."""
    if "a_first" not in part.columns or part["a_first"].isna().all():
        return OrderEffect(0, note="the order of presentation is not known")
    known = part[part["a_first"].notna()]
    a_first = known["a_first"].astype(bool)
    chose_first = known["chose_a"].where(a_first, 1 - known["chose_a"])
    shares = chose_first.groupby(known["participant"].astype(str))
    test = participant_tests(shares.sum(), shares.count(), confidence)
    first = 100 * float(known.loc[a_first, "chose_a"].mean()) if a_first.any() else None
    second = 100 * float(known.loc[~a_first, "chose_a"].mean()) if (~a_first).any() else None
    one_order = ONE_ORDER if first is None or second is None else ""
    return OrderEffect(
        answers=len(known),
        first_percent=100 * float(chose_first.mean()),
        p_value=test.p_value,
        percent_a_first=first,
        percent_a_second=second,
        balanced_percent=None if first is None or second is None else (first + second) / 2,
        note="; ".join(filter(None, (one_order, test.note))),
    )
