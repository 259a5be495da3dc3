"""Oddity: three transitions, and which of them differs from the other two (Macmillan & Creelman 2005, chapter 9).

Two slots show the reference, one the comparison, in any of the three places. An observer's sensitivity a frame is that
of `same-different`; there is no criterion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from study.models.oddity import CHANCE, HALFWAY, oddity_correct
from study.models.population import probability_odd_found
from study.tasks.levels import level_conditions, level_practice, level_problems, levels_in_words
from study.tasks.observer import ObserverSettings, Person
from study.tasks.task import Asked, Problem, Shortcut, Task
from study.tasks.trial import PLACES, Trial


def _right(trial: Trial) -> str:
    return PLACES[trial.members.index(1)]


def _problems(asked: Asked) -> Iterator[Problem]:
    yield from level_problems(asked)
    if 0 in asked.differences_frames:
        who = f"the {asked.task} study {asked.name!r}"
        yield (
            "differences_frames",
            f"expected no 0 in {who}, where one of three has to differ; remove it, or write catch_every = 0",
        )


def _judge(who: Person, trial: Trial, legal: Sequence[str], rng: np.random.Generator) -> tuple[str, float]:
    chance = float(probability_odd_found(who.settings.same_different, float(trial.difference_frames or 0)))
    wrong = [place for place in legal if place != _right(trial)]
    answer = _right(trial) if rng.random() < chance else wrong[int(rng.integers(len(wrong)))]
    return answer, max((chance - CHANCE) / (1 - CHANCE), 0.0)


def _truth(settings: ObserverSettings, _asked: Asked, _level: float, _seen: Sequence[float]) -> dict[str, Any]:
    """The differences at which participants without lapses are right halfway between chance and always."""
    from scipy.optimize import brentq

    observer = settings.same_different
    nodes, weights = np.polynomial.hermite_e.hermegauss(31)
    sensitivity = np.exp(observer.log_sensitivity_sd * nodes)

    def above(delta: float) -> float:
        return float((oddity_correct(delta * sensitivity) * weights).sum() / weights.sum()) - HALFWAY

    delta = float(brentq(above, 0.0, 20.0, xtol=1e-10))
    return {
        "level": round(HALFWAY, 6),
        "threshold_shorter_frames": -round(delta / observer.d_prime_shorter, 6),
        "threshold_longer_frames": round(delta / observer.d_prime_longer, 6),
    }


def _in_words(asked: Asked, blends: Callable[[str], str]) -> str:
    return f"said which of three transitions differed from the other two: {levels_in_words(asked, blends)}"


ODDITY = Task(
    name="oddity",
    asked_as="oddity",
    decides="which of three transitions differs from the other two",
    layout="one after another",
    kind="word",
    orders=((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    timed=True,
    tested=False,
    keys=frozenset({"differences_frames", "confidence_points"}),
    instructions="oddity",
    question="question_oddity",
    welcome="welcome_triples",
    legal=lambda _: PLACES[:3],
    right=_right,
    columns=lambda _trial, _answer: {},
    problems=_problems,
    conditions=level_conditions,
    practice=level_practice,
    judge=_judge,
    truth=_truth,
    in_words=_in_words,
    shortcut=Shortcut("right", lambda apart, _: float(oddity_correct(np.abs(apart)).mean()), CHANCE, HALFWAY),
)
