"""Rating: one transition, and points of a scale for it, a question each (2003 section 4.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from study.counting import counted
from study.models.ordinal import stretch
from study.tasks.methods import against, any_practice
from study.tasks.observer import Person
from study.tasks.task import SLIDER_POINTS, Asked, Condition, Problem, Task, scale
from study.tasks.trial import Trial


def points(asked: Asked) -> tuple[str, ...]:
    """The points of the scale, from 0."""
    return scale(SLIDER_POINTS if asked.slider else asked.scale_points)


def scale_problems(asked: Asked) -> Iterator[Problem]:
    """Questions that are missing, and a middle that the scale does not have."""
    who = f"the {asked.task} study {asked.name!r}"
    if not asked.items:
        yield "", f"expected at least one [[studies.items]] in {who}, found none; add one"
    if named := [item.name for item in asked.items if item.middle and len(points(asked)) % 2 == 0]:
        yield (
            "scale_points",
            f"expected an odd number of scale_points in {who}, where {named[0]!r} has words for the middle, found "
            f"{asked.scale_points}; change it, or remove middle",
        )


def rated_point(who: Person, higher: float, legal: Sequence[str], rng: np.random.Generator) -> tuple[str, float]:
    """The point that a person gives to what lies `higher` points above the middle of the scale."""
    from_middle = higher + who.settings.rating.noise_sd * float(rng.standard_normal())
    point = round((len(legal) - 1) / 2 + stretch(len(legal)) * from_middle)
    return legal[int(np.clip(point, 0, len(legal) - 1))], 0.5


def scale_in_words(asked: Asked, blends: Callable[[str], str]) -> str:
    """What is rated, on which scale."""
    asked_items = counted(len(asked.items), "question")
    drawn = f"slider{' with ticks' if asked.slider == 'ticks' else ''}" if asked.slider else "scale"
    return f"{against(asked, blends)}, on a {drawn} of 0 to {len(points(asked)) - 1} in {asked_items}"


def _problems(asked: Asked) -> Iterator[Problem]:
    yield from scale_problems(asked)
    if asked.order in ("both", "balanced"):
        yield (
            "order",
            f"expected 'random' or 'by-group' in the {asked.task} study {asked.name!r}, where stimuli are shown "
            f'singly, found {asked.order!r}; change it, or write show = "pair"',
        )


def _conditions(asked: Asked, _for_practice: bool) -> tuple[Condition, ...]:
    methods = (asked.reference,) if asked.comparison is None else (asked.reference, asked.comparison)
    return tuple(Condition(method, (method,), (0,)) for method in methods)


def _judge(who: Person, trial: Trial, legal: Sequence[str], rng: np.random.Generator) -> tuple[str, float]:
    utility = who.settings.preference.utility.get(trial.methods[0], 0.0)
    return rated_point(who, who.settings.rating.utility_weight * utility + who.leniency, legal, rng)


RATING = Task(
    name="rating",
    asked_as="rating",
    decides="points of a scale for one transition",
    layout="one after another",
    kind="point",
    orders=((0,),),
    timed=False,
    tested=False,
    keys=frozenset({"items", "show", "slider"}),
    instructions="rating",
    question="",
    welcome="welcome_films",
    legal=points,
    right=lambda _: None,
    columns=lambda _trial, _answer: {},
    problems=_problems,
    conditions=_conditions,
    practice=any_practice,
    judge=_judge,
    truth=lambda _settings, _asked, _level, _seen: None,
    in_words=lambda asked, blends: f"rated {scale_in_words(asked, blends)}",
    shortcut=None,
)
