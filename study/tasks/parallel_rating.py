"""Parallel rating: several methods' transitions at once, and a slider for each (HEMVIP: Jonell et al. 2021).

A trial shows the transition by every method of the study, together and in any places; one of them may be a hidden
reference, which nothing tells from the others. The answer has a value for each slot, from 0 to 100.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from study.tasks.methods import any_practice
from study.tasks.observer import Person
from study.tasks.rating import rated_point, scale_problems
from study.tasks.task import SLIDER_POINTS, Asked, Condition, Problem, Task, scale
from study.tasks.trial import PLACES, Trial


def _problems(asked: Asked) -> Iterator[Problem]:
    who = f"the {asked.task} study {asked.name!r}"
    yield from scale_problems(asked)
    if len(asked.items) > 1:
        yield "items", f"expected one [[studies.items]] in {who}, found {len(asked.items)}; make a study of each"
    if not 2 <= len(asked.methods) <= len(PLACES):
        yield (
            "others",
            f"expected two to {len(PLACES)} methods in {who}, found {len(asked.methods)}; name them in comparison and "
            "others",
        )
    if len(set(asked.methods)) < len(asked.methods):
        yield "others", f"expected each method once in {who}, found {', '.join(asked.methods)}; remove one"
    if asked.order == "both":
        yield "order", f"expected 'random', 'balanced' or 'by-group' in {who}, found 'both'; change it"


def _conditions(asked: Asked, _for_practice: bool) -> tuple[Condition, ...]:
    return (Condition("", asked.methods, (0,) * len(asked.methods)),)


def _judge(who: Person, trial: Trial, legal: Sequence[str], rng: np.random.Generator) -> tuple[str, float]:
    weight, utility = who.settings.rating.utility_weight, who.settings.preference.utility
    shown = (trial.methods[member] for member in trial.members)
    given = [rated_point(who, weight * utility.get(name, 0.0) + who.leniency, legal, rng)[0] for name in shown]
    return " ".join(given), 0.5


def _in_words(asked: Asked, blends: Callable[[str], str]) -> str:
    named = [blends(name) for name in asked.methods]
    hidden = f" ({blends(asked.hidden_reference)} as a hidden reference)" if asked.hidden_reference else ""
    return (
        f"rated {len(named)} transitions shown at once, {', '.join(named[:-1])} and {named[-1]}{hidden}, with a slider "
        f"of 0 to {SLIDER_POINTS - 1} for each"
    )


PARALLEL_RATING = Task(
    name="parallel-rating",
    asked_as="parallel-rating",
    decides="a value from 0 to 100 for each of several transitions shown at once",
    layout="side by side",
    kind="slider",
    orders=(),
    timed=False,
    tested=False,
    keys=frozenset({"items", "others", "slider", "replays", "hidden_reference"}),
    instructions="parallel-rating",
    question="",
    welcome="welcome_together",
    legal=lambda _: scale(SLIDER_POINTS),
    right=lambda _: None,
    columns=lambda _trial, _answer: {},
    problems=_problems,
    conditions=_conditions,
    practice=any_practice,
    judge=_judge,
    truth=lambda _settings, _asked, _level, _seen: None,
    in_words=_in_words,
    shortcut=None,
)
