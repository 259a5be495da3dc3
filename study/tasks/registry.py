"""Every task by name. A new one is a module and one line here; everything else asks this registry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import permutations
from typing import Any

from study.models.latin_square import latin_square
from study.tasks.answer import CONFIDENCE, Answer
from study.tasks.oddity import ODDITY
from study.tasks.pair_rating import PAIR_RATING
from study.tasks.parallel_rating import PARALLEL_RATING
from study.tasks.preference import PREFERENCE
from study.tasks.rating import RATING
from study.tasks.same_different import SAME_DIFFERENT
from study.tasks.task import SLIDER_POINTS, Asked, Kind, Layout, Problem, Task
from study.tasks.trial import Trial
from study.tasks.two_alternatives import TWO_ALTERNATIVES
from study.tasks.yes_no import YES_NO

TASKS: Mapping[str, Task] = {
    task.name: task
    for task in (SAME_DIFFERENT, PREFERENCE, RATING, PAIR_RATING, ODDITY, TWO_ALTERNATIVES, YES_NO, PARALLEL_RATING)
}

DECIDES: Mapping[str, str] = {task.name: task.decides for task in TASKS.values() if task.name == task.asked_as}
"""What participants decide, by what a protocol calls the task."""

NAMES: tuple[str, ...] = tuple(DECIDES)


def task_of(asked: Asked) -> Task:
    """The task of a study; of those that are asked as one, a study that shows a `pair` has the one of that name."""
    own = [task for task in TASKS.values() if task.asked_as == asked.task]
    return next((task for task in own if task.name == f"{asked.show}-{asked.task}"), own[0])


def task_of_trial(trial: Trial) -> Task:
    """The task of a trial: of those that are asked as one, the one with as many slots."""
    own = (task for task in TASKS.values() if task.asked_as == trial.task)
    return next(task for task in own if task.slots in (0, len(trial.stimuli)))


def kind_of(asked: Asked) -> Kind:
    """What is answered in a study."""
    return "slider" if asked.slider else task_of(asked).kind


def layout_of(asked: Asked) -> Layout:
    """How the slots of a study's trials are shown."""
    return "side by side" if asked.side_by_side else task_of(asked).layout


def orders_of(asked: Asked) -> tuple[tuple[int, ...], ...]:
    """The orders in which a study's pairs can be shown; of many methods any at random, else those of a Latin square."""
    if fixed := task_of(asked).orders:
        return fixed
    count = len(asked.methods)
    return tuple(permutations(range(count))) if asked.order == "random" else latin_square(count)


def stated_answers(asked: Asked) -> tuple[str, ...]:
    """What an attention check may ask for: any answer, or an end of a slider."""
    legal = task_of(asked).legal(asked)
    return (legal[0], legal[-1]) if kind_of(asked) == "slider" else legal


NEAR = 5
"""How far from the end that an attention check asks for a slider may stand."""


def is_right(trial: Trial, value: str, right: str) -> bool:
    """Whether an answer is the right one; a slider that was asked to an end may stand near it."""
    if trial.role != "check" or value == right or not (right.isdigit() and value.replace(" ", "").isdigit()):
        return value == right
    return int(right) in (0, SLIDER_POINTS - 1) and all(abs(int(one) - int(right)) <= NEAR for one in value.split())


def problems_of(asked: Asked) -> Iterator[Problem]:
    """What does not fit between a study's task and its other keys."""
    task = task_of(asked)
    for key in sorted(frozenset().union(*(one.keys for one in TASKS.values())) - task.keys):
        if getattr(asked, key):
            takers = dict.fromkeys(one.asked_as for one in TASKS.values() if key in one.keys)
            who = f"the {asked.task} study {asked.name!r}"
            yield key, f"expected {key} in {' and '.join(takers)} studies only; remove it from {who}"
    yield from task.problems(asked)


def right_answer(trial: Trial) -> str | None:
    """The right answer to a trial; None where none is right."""
    return trial.expected if trial.role == "check" else task_of_trial(trial).right(trial)


def answer_columns(trial: Trial, answer: Answer) -> dict[str, Any]:
    """A row of the table of answers: the trial, what was answered, and what that means to the task."""
    sure = answer.item == CONFIDENCE
    right = None if sure else right_answer(trial)
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
        "second": trial.stimuli[1] if len(trial.stimuli) > 1 else "",
        "difference_frames": trial.difference_frames,
        "reference_first": None,
        "method_a": trial.methods[0],
        "method_b": trial.methods[1] if len(trial.methods) > 1 else "",
        "a_first": None,
        "answer": answer.value,
        "missed": answer.missed,
        "correct": None if answer.missed or right is None else is_right(trial, answer.value or "", right),
        "chose_a": None,
        "response_s": answer.response_s,
        "shown_well": answer.shown_well,
        "role": trial.role,
        "expected": trial.expected,
        **({} if sure else task_of_trial(trial).columns(trial, answer)),
    }
