"""What forced choices over differences of blend length share: they name a slot, and one of them is right.

An observer's sensitivity a frame is that of `same-different`; there is no criterion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from study.models.forced import FORCED
from study.models.population import probability_found
from study.tasks.levels import level_conditions, level_practice, level_problems, levels_in_words
from study.tasks.observer import ObserverSettings, Person
from study.tasks.task import Asked, Problem, Shortcut, Task
from study.tasks.trial import PLACES, Trial


def forced_choice(
    name: str,
    decides: str,
    orders: tuple[tuple[int, ...], ...],
    right: Callable[[Trial], str],
    alike: str,
    did: str,
    welcome: str,
) -> Task:
    """A task whose answers are its slots.

    Parameters
    ----------
    name, decides, orders, right, welcome
        As `Task` says.
    alike
        Why no pair without a difference fits: "where one of three has to differ".
    did
        What participants did, before the levels are listed.
    """
    forced, legal = FORCED[name], PLACES[: len(orders[0])]

    def problems(asked: Asked) -> Iterator[Problem]:
        yield from level_problems(asked)
        if 0 in asked.differences_frames:
            who = f"the {asked.task} study {asked.name!r}"
            yield "differences_frames", f"expected no 0 in {who}, {alike}; remove it, or write catch_every = 0"

    def judge(who: Person, trial: Trial, legal: Sequence[str], rng: np.random.Generator) -> tuple[str, float]:
        chance = float(probability_found(forced, who.settings.same_different, float(trial.difference_frames or 0)))
        wrong = [place for place in legal if place != right(trial)]
        answer = right(trial) if rng.random() < chance else wrong[int(rng.integers(len(wrong)))]
        return answer, max((chance - forced.chance) / (1 - forced.chance), 0.0)

    def truth(settings: ObserverSettings, _asked: Asked, _level: float, _seen: Sequence[float]) -> dict[str, Any]:
        """Where participants without lapses are right halfway between chance and always."""
        from scipy.optimize import brentq

        observer = settings.same_different
        nodes, weights = np.polynomial.hermite_e.hermegauss(31)
        sensitivity = np.exp(observer.log_sensitivity_sd * nodes)

        def above(delta: float) -> float:
            return float((forced.correct(delta * sensitivity) * weights).sum() / weights.sum()) - forced.halfway

        delta = float(brentq(above, 0.0, 20.0, xtol=1e-10))
        return {
            "level": round(forced.halfway, 6),
            "threshold_shorter_frames": -round(delta / observer.d_prime_shorter, 6),
            "threshold_longer_frames": round(delta / observer.d_prime_longer, 6),
        }

    return Task(
        name=name,
        asked_as=name,
        decides=decides,
        layout="one after another",
        kind="word",
        orders=orders,
        timed=True,
        tested=False,
        keys=frozenset({"differences_frames", "confidence_points"}),
        instructions=name,
        question=f"question_{name}",
        welcome=welcome,
        legal=lambda _: legal,
        right=right,
        columns=lambda _trial, _answer: {},
        problems=problems,
        conditions=level_conditions,
        practice=level_practice,
        judge=judge,
        truth=truth,
        in_words=lambda asked, blends: f"{did}: {levels_in_words(asked, blends)}",
        shortcut=Shortcut(
            "right", lambda apart, _: float(forced.correct(np.abs(apart)).mean()), forced.chance, forced.halfway
        ),
    )
