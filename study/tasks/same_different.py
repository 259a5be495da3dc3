"""Same or different: two transitions, and whether they are the same (2004 section 4.2)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from study.models.differencing import best_correct
from study.models.population import SameDifferentObserver, crossing, population_different, probability_different
from study.tasks.levels import level_conditions, level_practice, level_problems, levels_in_words
from study.tasks.observer import ObserverSettings, Person
from study.tasks.task import Asked, Shortcut, Task
from study.tasks.trial import Trial


def _right(trial: Trial) -> str:
    return "different" if trial.difference_frames else "same"


def _judge(who: Person, trial: Trial, _legal: Sequence[str], rng: np.random.Generator) -> tuple[str, float]:
    different = float(probability_different(who.settings.same_different, float(trial.difference_frames or 0)))
    return ("different" if rng.random() < different else "same"), abs(2 * different - 1)


def _truth(settings: ObserverSettings, asked: Asked, level: float, _seen: Sequence[float]) -> dict[str, Any]:
    """Where the population says "different" this often, and what linear interpolation between the levels gives."""
    observer = settings.same_different
    return {
        "level": level,
        "threshold_shorter_frames": -round(crossing(observer, level, observer.d_prime_shorter), 6),
        "threshold_longer_frames": round(crossing(observer, level, observer.d_prime_longer), 6),
        "false_alarms": round(float(population_different(observer, 0.0)), 6),
        **_interpolated(observer, asked.differences_frames, level),
    }


def _interpolated(observer: SameDifferentObserver, levels: Sequence[int], level: float) -> dict[str, float | None]:
    """With endless data; it lies off the true threshold where the curve bends between levels."""
    found: dict[str, float | None] = {}
    for side, sign in (("shorter", -1), ("longer", 1)):
        x = np.sort([abs(d) for d in levels if d * sign >= 0]).astype(float)
        chances = population_different(observer, sign * x) if len(x) else x
        reached = len(x) > 0 and chances[0] < level <= chances[-1]
        found[f"interpolated_{side}_frames"] = round(sign * float(np.interp(level, chances, x)), 6) if reached else None
    return found


def _in_words(asked: Asked, blends: Callable[[str], str]) -> str:
    return f"judged whether two transitions were the same or different: {levels_in_words(asked, blends)}"


SAME_DIFFERENT = Task(
    name="same-different",
    asked_as="same-different",
    decides="whether two transitions are the same",
    layout="one after another",
    kind="word",
    orders=((0, 1), (1, 0)),
    timed=True,
    tested=False,
    keys=frozenset({"differences_frames", "confidence_points"}),
    instructions="same-different",
    question="question_same-different",
    welcome="welcome_pairs",
    legal=lambda _: ("same", "different"),
    right=_right,
    columns=lambda trial, _answer: {"reference_first": trial.a_first},
    problems=level_problems,
    conditions=level_conditions,
    practice=level_practice,
    judge=_judge,
    truth=_truth,
    in_words=_in_words,
    shortcut=Shortcut("right", best_correct, chance=0.5),
)
