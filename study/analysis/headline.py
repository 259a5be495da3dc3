"""Headlines: the one estimate of each question that a study asks, with the interval and the test that it claims.

The rule (docs/analysis.md, *Headlines*): the estimate that answers the question asked, the interval that generalises as
the statement says, and the p-value, also adjusted over the family of tests that it belongs to.
"""

from __future__ import annotations

from dataclasses import dataclass

from study.analysis.estimates import Interval, Mean, MeanTest

NO_TEST = "a threshold is estimated, and no hypothesis tested"


@dataclass(frozen=True)
class Headline:
    """What a study found, in a sentence and in numbers; what can't be given is None."""

    study: str
    """Its name."""
    statement: str
    """In words."""
    estimate: float | None
    unit: str
    interval: Interval
    """`estimate`, `unit`, `interval`: a number, what it counts, and its confidence interval."""
    p: float | None
    p_adjusted: float | None
    test: str
    """`p`, `p_adjusted`, `test`: of the null hypothesis; adjusted for the other tests of its family, as it is where
    there are none; and what was done."""
    generalises_to: str
    """What the interval holds for beyond the data."""
    note: str = ""
    """Why something can't be given."""


def holds_for(participants: int) -> str:
    """What an interval over so many participants holds for."""
    return "participants, for these motions" if participants > 1 else "further responses of this participant"


def headline_of(
    found: Mean, study: str, statement: str, unit: str, confidence: float, *, test: str, generalises_to: str,
    adjusted: float | None = None, note: str | None = None,
) -> Headline:  # fmt: skip
    """Return the headline of a mean: its estimate, interval and p-value, `adjusted` where it has a family."""
    p_value = found.p_value if isinstance(found, MeanTest) else None
    return Headline(
        study=study,
        statement=statement,
        estimate=found.mean,
        unit=unit,
        interval=Interval(found.low, found.high, confidence),
        p=p_value,
        p_adjusted=p_value if adjusted is None else adjusted,
        test=test,
        generalises_to=generalises_to,
        note=found.note if note is None else note,
    )
