"""Answers: what a participant did at one question, and what that means: the columns of a table of answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from study.tasks.trial import Trial


@dataclass(frozen=True, slots=True)
class Answer:
    """What a participant did at one question.

    `value` is None where the answer window closed first. `item` is empty but for ratings. `response_s` runs from the
    end of the last stimulus. `shown_well` is False where the presentation was faulty, so that the trial is repeated.
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


def right_answer(trial: Trial) -> str | None:
    """What the right answer to a trial is; None where none is right."""
    if trial.role == "check":
        return trial.expected
    if trial.task == "same-different":
        return "different" if trial.difference_frames else "same"
    return None


def answer_columns(trial: Trial, answer: Answer) -> dict[str, Any]:
    """A row of the table of answers: the trial, what was answered, and what that means.

    `reference_first` and `correct` belong to same-different trials, `a_first` and `chose_a` to methods that are
    compared; all are None elsewhere.
    """
    right, same_different = right_answer(trial), trial.task == "same-different"
    chosen = answer.value is not None and trial.task == "preference" and trial.role != "check"
    second = len(trial.stimuli) > 1
    return {
        "trial": trial.trial,
        "item": answer.item,
        "attempt": answer.attempt,
        "study": trial.study,
        "task": trial.task,
        "repeat": trial.repeat,
        "pair": trial.pair,
        "motion": trial.motion,
        "category": trial.category,
        "first": trial.stimuli[0],
        "second": trial.stimuli[1] if second else "",
        "difference_frames": trial.difference_frames,
        "reference_first": trial.a_first if same_different else None,
        "method_a": trial.methods[0],
        "method_b": trial.methods[1] if second else "",
        "a_first": trial.a_first if second and not same_different else None,
        "answer": answer.value,
        "missed": answer.missed,
        "correct": None if answer.missed or right is None else answer.value == right,
        "chose_a": (answer.value == "first") == trial.a_first if chosen else None,
        "response_s": answer.response_s,
        "shown_well": answer.shown_well,
        "role": trial.role,
        "expected": trial.expected,
    }
