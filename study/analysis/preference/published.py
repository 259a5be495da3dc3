"""The pooled test of a preference as 2004 Table 2 has it: answers in, percentages and chi-square out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from study.analysis import estimates
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Published:
    """The pooled test of 2004 Table 2."""

    favouring: int
    answers: int
    percent: float | None
    """`favouring`, `answers`, `percent`: how many of how many answers favoured the first method."""
    chi_square: float | None
    degrees_of_freedom: int
    p_value: float | None
    """`chi_square`, `degrees_of_freedom`, `p_value`: against an even split, every answer taken as independent."""
    exact_p_value: float | None
    """Two-sided binomial test of the same."""
    interval: estimates.Interval
    """Wilson's interval of the share (0 to 1)."""
    note: str = ""
    """Why nothing can be given; empty where all can."""


@dataclass(frozen=True)
class MotionPreference:
    """How often the first method was favoured in one motion pair; percent with Wilson's interval."""

    motion: str
    favouring: int
    answers: int
    percent: float | None
    low: float | None
    high: float | None
    note: str


def published_test(favouring: int, answers: int, confidence: float = 0.95) -> Published:
    """Test a count against an even split, as 2004 section 5.2 does.

    Parameters
    ----------
    favouring, answers
        How many of how many answers favoured the first method.
    confidence
        Of Wilson's interval.

    Raises
    ------
    AnalysisError
        When the counts are impossible.

    Examples
    --------
    >>> round(published_test(270, 280).chi_square, 1)
    241.4
    """
    if not 0 <= favouring <= answers:
        raise AnalysisError(f"expected 0 <= favouring <= answers, found {favouring} of {answers}; check the counts")
    interval = estimates.wilson_interval(favouring, answers, confidence)
    if answers == 0:
        return Published(0, 0, None, None, 1, None, None, interval, "no answer chose between the two")
    chi_square = (2 * favouring - answers) ** 2 / answers
    return Published(
        favouring=favouring,
        answers=answers,
        percent=100 * favouring / answers,
        chi_square=chi_square,
        degrees_of_freedom=1,
        p_value=estimates.chi_square_probability(chi_square, 1),
        exact_p_value=estimates.binomial_probability(favouring, answers),
        interval=interval,
    )


def without_ties(part: pd.DataFrame, confidence: float) -> Published:
    """Return the pooled test of the answers that chose; like a sign test, it excludes those that did not."""
    clear = part["chose_a"] != 0.5
    return published_test(int(part.loc[clear, "chose_a"].sum()), int(clear.sum()), confidence)


def by_motion(part: pd.DataFrame, confidence: float = 0.95) -> tuple[MotionPreference, ...]:
    """Return the preference in every motion; one motion's answers are independent where each participant gave one."""
    column = "motion" if "motion" in part.columns else "pair" if "pair" in part.columns else None
    groups = part.groupby(part[column].astype(str) if column else np.full(len(part), "all"), sort=False)
    found = []
    for motion, answers in groups:
        test = without_ties(answers, confidence)
        low, high = (None if end is None else 100 * end for end in (test.interval.low, test.interval.high))
        found.append(MotionPreference(str(motion), test.favouring, test.answers, test.percent, low, high, test.note))
    return tuple(found)
