"""Rating of a pair: two methods' transitions, and how the second compares with the first, on a scale."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from study.models.choice import lean
from study.models.ordinal import mean_score
from study.tasks.methods import CHOICE, any_practice, both_methods, two_methods
from study.tasks.observer import ObserverSettings, Person
from study.tasks.rating import points, rated_point, scale_in_words, scale_problems
from study.tasks.task import Asked, Problem, Task
from study.tasks.trial import Trial


def _problems(asked: Asked) -> Iterator[Problem]:
    yield from two_methods(asked)
    yield from scale_problems(asked)
    if asked.slider:
        who = f"the {asked.task} study {asked.name!r}"
        yield "slider", f"expected points of a scale in {who}, where pairs are rated, found a slider; remove it"


def _judge(who: Person, trial: Trial, legal: Sequence[str], rng: np.random.Generator) -> tuple[str, float]:
    reference, comparison = trial.methods
    apart = lean(who.settings.preference, comparison, reference)
    higher = who.sees(trial.pair) * (who.settings.rating.utility_weight * apart + who.leniency)
    return rated_point(who, higher if trial.a_first else -higher, legal, rng)


def _truth(settings: ObserverSettings, asked: Asked, _level: float, seen: Sequence[float]) -> dict[str, Any]:
    apart = lean(settings.preference, asked.comparison or asked.reference, asked.reference)
    scores = [mean_score(settings.rating, apart, asked.scale_points, sees) for sees in seen]
    return {"mean_score": round(float(np.mean(scores)), 6)}


PAIR_RATING = Task(
    name="pair-rating",
    asked_as="rating",
    decides="points of a scale for the second of a pair compared with the first",
    layout="one after another",
    kind="point",
    orders=((0, 1), (1, 0)),
    timed=False,
    tested=False,
    keys=frozenset({"items", "show", "slider"}),
    instructions="rating_pairs",
    question="",
    welcome="welcome_pairs",
    legal=points,
    right=lambda _: None,
    columns=lambda trial, _answer: {"a_first": trial.a_first},
    problems=_problems,
    conditions=both_methods,
    practice=any_practice,
    judge=_judge,
    truth=_truth,
    in_words=lambda asked, blends: (
        f"compared the second of two transitions with the first, {scale_in_words(asked, blends)}"
    ),
    shortcut=CHOICE,
)
