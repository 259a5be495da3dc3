"""Answers: what a participant did at one question."""

from __future__ import annotations

from dataclasses import dataclass

CONFIDENCE = "confidence"
"""The item under which the question how sure somebody is of a choice is answered."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a participant did at one question.

    `value` is None where the answer window closed first. `item` is empty except for ratings and `CONFIDENCE`.
    `response_s` runs from the end of the last stimulus. `shown_well` is False where the presentation was faulty; the
    trial is then repeated.
    """

    trial: int
    item: str
    attempt: int
    value: str | None
    response_s: float | None
    shown_well: bool = True

    @property
    def missed(self) -> bool:
        """Whether the answer window closed without an answer."""
        return self.value is None
