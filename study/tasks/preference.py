"""Preference: two methods' transitions, and which is more natural (2004 section 5.2)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from study.models.choice import chance_of_first, chance_of_neither, lean, preference_probability
from study.tasks.answer import Answer
from study.tasks.methods import CHOICE, against, any_practice, both_methods, two_methods
from study.tasks.observer import ObserverSettings, Person
from study.tasks.task import Asked, Problem, Task
from study.tasks.trial import Trial


def _columns(trial: Trial, answer: Answer) -> Mapping[str, Any]:
    counted = answer.value in ("first", "second") and trial.role != "check"
    return {"a_first": trial.a_first, "chose_a": (answer.value == "first") == trial.a_first if counted else None}


def _problems(asked: Asked) -> Iterator[Problem]:
    yield from two_methods(asked)
    if asked.replays and not asked.side_by_side:
        who = f"the {asked.task} study {asked.name!r}"
        yield "replays", f"expected side_by_side = true with replays in {who}; write it, or remove replays"


def _judge(who: Person, trial: Trial, legal: Sequence[str], rng: np.random.Generator) -> tuple[str, float]:
    leaning = who.sees(trial.pair) * (lean(who.settings.preference, *trial.methods) + who.lean)
    towards_first = leaning if trial.a_first else -leaning
    chance = chance_of_first(who.settings.preference, towards_first)
    if "equal" in legal and rng.random() < chance_of_neither(who.settings.preference, towards_first):
        return "equal", 1 - abs(2 * chance - 1)
    return ("first" if rng.random() < chance else "second"), abs(2 * chance - 1)


def _truth(settings: ObserverSettings, asked: Asked, _level: float, seen: Sequence[float]) -> dict[str, Any]:
    if asked.others:
        utility = settings.preference.utility
        first = utility.get(asked.reference, 0.0)
        methods = (asked.reference, asked.comparison or asked.reference, *asked.others)
        return {"strengths": {name: round(utility.get(name, 0.0) - first, 6) for name in methods}}
    methods = asked.reference, asked.comparison or asked.reference
    shares = [preference_probability(settings.preference, *methods, sees) for sees in seen]
    return {"favouring_a": round(float(np.mean(shares)), 6)}


def _in_words(asked: Asked, blends: Callable[[str], str]) -> str:
    neither = f"{', or neither' if asked.ties else ''}{', shown side by side' if asked.side_by_side else ''}"
    if not asked.others:
        return f"chose the more natural of two transitions{neither}, {against(asked, blends)}"
    named = [blends(name) for name in (asked.reference, asked.comparison or "", *asked.others)]
    some = f", each participant one of {asked.sets} balanced sets" if asked.sets else ""
    every = f"all pairs of {', '.join(named[:-1])} and {named[-1]}"
    return f"chose the more natural of two transitions{neither}, of {every}{some}"


PREFERENCE = Task(
    name="preference",
    asked_as="preference",
    decides="which of two transitions is more natural",
    layout="one after another",
    kind="word",
    orders=((0, 1), (1, 0)),
    timed=True,
    tested=True,
    keys=frozenset({"others", "sets", "ties", "confidence_points", "side_by_side", "replays"}),
    instructions="preference",
    question="question_preference",
    welcome="welcome_pairs",
    legal=lambda asked: ("first", "equal", "second") if asked.ties else ("first", "second"),
    right=lambda _: None,
    columns=_columns,
    problems=_problems,
    conditions=both_methods,
    practice=any_practice,
    judge=_judge,
    truth=_truth,
    in_words=_in_words,
    shortcut=CHOICE,
)
