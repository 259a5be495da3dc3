"""A threshold on one side of no difference, however it was found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from study.analysis.estimates import Interval
from study.analysis.same_different.counts import Side

Status = Literal["reached", "not reached", "above", "not estimable"]

FEWEST_FOR_INTERVAL = 2


@dataclass(frozen=True)
class Threshold:
    """A threshold on one side.

    Attributes
    ----------
    side
        "shorter" or "longer" than the reference.
    frames
        Size of the difference, always positive; None unless `status` is "reached".
    standard_error
        Frames.
    interval
        Frames; an open end lies outside the levels shown, or can't be determined.
    status
        "reached"; "not reached" within the levels shown; "above": the curve is above the level at the smallest
        difference shown; "not estimable".
    method
        How it was found, and what its interval rests on.
    note
        In words, where the status is not "reached" or the estimate needs a caution.
    """

    side: Side
    frames: float | None
    standard_error: float | None
    interval: Interval
    status: Status
    method: str
    note: str = ""
