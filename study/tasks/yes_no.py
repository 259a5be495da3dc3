"""Yes or no: one transition, and whether something was wrong with it (Macmillan & Creelman 2005, chapter 1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from study.models.population import probability_yes
from study.tasks.levels import level_conditions, level_practice, level_problems, levels_in_words
from study.tasks.observer import ObserverSettings, Person
from study.tasks.task import Asked, Condition, Problem, Task
from study.tasks.trial import Trial


def _right(trial: Trial) -> str:
    return "yes" if trial.difference_frames else "no"


def _problems(asked: Asked) -> Iterator[Problem]:
    yield from level_problems(asked)
    if asked.differences_frames and 0 not in asked.differences_frames:
        who = f"the yes-no study {asked.name!r}"
        yield (
            "differences_frames",
            f"expected 0 among the differences of {who}: false alarms tell the criterion; add it, or set catch_every",
        )


def _conditions(asked: Asked, for_practice: bool) -> tuple[Condition, ...]:
    """The comparisons alone."""
    return tuple(
        replace(pair, methods=pair.methods[1:], added_frames=pair.added_frames[1:])
        for pair in level_conditions(asked, for_practice)
    )


def _judge(who: Person, trial: Trial, _legal: Sequence[str], rng: np.random.Generator) -> tuple[str, float]:
    yes = float(probability_yes(who.settings.same_different, float(trial.difference_frames or 0)))
    return ("yes" if rng.random() < yes else "no"), abs(2 * yes - 1)


def _truth(settings: ObserverSettings, _asked: Asked, level: float, _seen: Sequence[float]) -> dict[str, Any]:
    """Of the typical participant: false alarms, d' a frame, and where this share of the answers is "yes"."""
    from scipy.special import ndtri

    observer = settings.same_different
    free = (level - observer.lapse / 2) / (1 - observer.lapse)
    d_prime = float(ndtri(free)) + observer.criterion / 2 if 0 < free < 1 else None
    slopes = {"shorter": observer.d_prime_shorter, "longer": observer.d_prime_longer}
    signs = {"shorter": -1, "longer": 1}
    return {
        "level": level,
        "false_alarms": round(float(probability_yes(observer, 0.0)), 6),
        **{f"d_prime_{side}": slope for side, slope in slopes.items()},
        **{
            f"threshold_{side}_frames": None if d_prime is None else round(signs[side] * max(d_prime, 0) / slope, 6)
            for side, slope in slopes.items()
        },
    }


YES_NO = Task(
    name="yes-no",
    asked_as="yes-no",
    decides="whether something was wrong with one transition",
    layout="one after another",
    kind="word",
    orders=((0,),),
    timed=True,
    tested=False,
    keys=frozenset({"differences_frames", "confidence_points"}),
    instructions="yes-no",
    question="question_yes-no",
    welcome="welcome_films",
    legal=lambda _: ("yes", "no"),
    right=_right,
    columns=lambda _trial, _answer: {},
    problems=_problems,
    conditions=_conditions,
    practice=level_practice,
    judge=_judge,
    truth=_truth,
    in_words=lambda asked, blends: (
        f"said of single transitions whether something was wrong with the passage: {levels_in_words(asked, blends)}"
    ),
    shortcut=None,
)
