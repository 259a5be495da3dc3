"""Random small tables through every analysis: no exception, no warning, no number missing without a sentence.

2 to 12 people, 1 to 8 trials each, all degrees of agreement: everybody alike, nobody, perfect separation, an order that
decides everything. `SEGUE_TABLES=20000` asks for more tables than the few hundred of every day.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pandas as pd
import pytest

from study.analysis.analyse import analyse, analysis_json
from study.analysis.foreign.answers import read_preferences, read_ratings
from study.analysis.foreign.columns import Columns
from study.analysis.foreign.trials import read_trials
from study.analysis.psychometric.analyse import analyse_psychometric
from study.analysis.psychometric.model import make_model
from study.analysis.study_result import Settings
from study.analysis.to_json import to_json
from study.errors import AnalysisError

TABLES = int(os.environ.get("SEGUE_TABLES", "300"))
A_TEST = 10

# Said in words where the key is described: nothing was left out; not two methods; a column that the task does not have;
# ends of intervals that the answers leave open; strengths of two methods alone; trials that came by no staircase;
# ties where nobody called two equal.
ELSEWHERE = {"staircases", "without_exclusions", "difference", "quality", "low", "high", "bradley_terry", "ties"}


def people_of(rng: np.random.Generator) -> Iterator[tuple[str, int, float]]:
    """Who answers, how many trials, and how likely one answer rather than the other: one for all, or their own."""
    trials, alike = int(rng.integers(1, 9)), rng.random() < 0.6
    shared = float(rng.choice([0, 0.02, 0.5, 0.9, 1]))
    for person in range(int(rng.integers(1, 13))):
        yield f"p{person}", trials, shared if alike else float(rng.choice([0, 0.02, 0.5, 0.9, 1]))


def sometimes(rng: np.random.Generator, value: str, chance: float = 0.05) -> str:
    return "" if rng.random() < chance else value


def preferences(rng: np.random.Generator) -> dict[str, Any]:
    methods, by_order, rows = int(rng.integers(2, 5)), rng.random() < 0.3, []
    for who, trials, chance in people_of(rng):
        for trial in range(trials):
            a, b = rng.choice(methods, 2, replace=False)
            first = (rng.random() < chance) == (by_order or a < b)
            answer = "tie" if rng.random() < 0.05 else "first" if first else "second"
            rows.append((who, f"m{a}", f"m{b}", f"motion {trial % 3}", sometimes(rng, answer)))
    table = pd.DataFrame(rows, columns=["who", "first", "second", "motion", "answer"])
    motion = "motion" if rng.random() < 0.7 else None
    columns = Columns("answer", "who", first="first", second="second", motion=motion, tie=("tie",))
    return analysis_json(analyse(read_preferences(table, columns).table))


def ratings(rng: np.random.Generator) -> dict[str, Any]:
    methods, apart, noise, rows = int(rng.integers(1, 5)), rng.choice([0, 1, 10]), rng.choice([0, 0.3, 1]), []
    low, high, places = [(1, 5, 0), (0, 100, 2), (0, 1, 3), (3, 3, 0)][int(rng.integers(4))]
    for who, trials, chance in people_of(rng):
        for trial in range(trials):
            method = trial % methods if rng.random() < 0.8 else int(rng.integers(methods))
            value = (low + high) / 2 + (chance - 0.5 + apart * method + noise * rng.normal()) * (high - low) / 4
            rated = round(float(np.clip(value, low, high)), places)
            item = "natural" if rng.random() < 0.9 else "smooth"
            rows.append((who, f"m{method}", f"motion {trial % 2}", item, sometimes(rng, str(rated))))
    table = pd.DataFrame(rows, columns=["who", "method", "motion", "item", "answer"])
    asked = {name: name for name in ("method", "motion", "item") if rng.random() < 0.8}
    return analysis_json(analyse(read_ratings(table, Columns("answer", "who", **asked)).table))


def rated_pairs(rng: np.random.Generator) -> dict[str, Any]:
    points, orders, rows = int(rng.choice([2, 3, 5, 7])), rng.integers(3), []
    for person, (who, trials, chance) in enumerate(people_of(rng)):
        for trial in range(trials):
            a_first = bool([rng.integers(2), person % 2, 1][orders])
            lean = (chance - 0.5) * (1 if a_first else -1) * points + rng.choice([0, 1]) * rng.normal()
            point = int(np.clip(round((points - 1) / 2 + lean), 0, points - 1))
            rows.append(
                (who, "rating", "s", "a", "b", a_first, f"motion {trial % 2}", sometimes(rng, str(point)) or None)
            )
    names = ["participant", "task", "study", "method_a", "method_b", "a_first", "motion", "answer"]
    return analysis_json(analyse(pd.DataFrame(rows, columns=names), Settings(scale_points={"s": points})))


def levels_answered(rng: np.random.Generator, levels: list[float]) -> pd.DataFrame:
    """Answers at levels: as likely at all of them, or rising, falling, or stepping with the level."""
    shown, kind, rows = rng.choice(levels, int(rng.integers(1, 6)), replace=False), rng.integers(4), []
    for who, trials, chance in people_of(rng):
        for _ in range(trials):
            level = float(rng.choice(shown))
            p = (chance, float(abs(level) > 3), 1 - float(abs(level) > 3), 1 / (1 + np.exp(-level / 5)))[kind]
            answer = sometimes(rng, str(int(rng.random() < p)))
            rows.append((who, f"{level:g}", answer, str(rng.choice(["AB", "BA"]))))
    return pd.DataFrame(rows, columns=["who", "level", "answer", "order"])


def psychometric(rng: np.random.Generator) -> dict[str, Any]:
    task, sigmoid = str(rng.choice(["2afc", "yes-no"])), str(rng.choice(["normal", "logistic", "gumbel", "weibull"]))
    levels = [0.001, 0.5, 1, 2, 3, 5, 100, *([] if sigmoid == "weibull" else [0, -4])]
    read = read_trials(levels_answered(rng, levels), Columns("answer", "who", "level"), task)
    return dict(to_json(analyse_psychometric(read.table, make_model(task, sigmoid=sigmoid), simulations=20)))


def same_different(rng: np.random.Generator) -> dict[str, Any]:
    table = levels_answered(rng, [-20, -10, -5, 0, 5, 10, 20])
    read = read_trials(table, Columns("answer", "who", "level", order="order"), "same-different").table
    answers = read.rename(columns={"level": "difference_frames"})
    answers["answer"], answers["task"] = np.where(read["yes"] > 0, "different", "same"), "same-different"
    answers["reference_first"] = read["order"] == "AB"
    if rng.random() < 0.5:
        answers["motion"] = [f"motion {place % 2}" for place in range(len(answers))]
    return analysis_json(analyse(answers, Settings(resamples=30)))


def silent(node: Any, path: str = "", said: bool = False) -> Iterator[str]:
    """Where a number is missing and no note says why: in the same dictionary, for that key, or further out."""
    if isinstance(node, dict):
        said = said or bool(node.get("note"))
        reference = node.get("value") == 0.0  # of Bradley-Terry strengths: 0 by definition
        for key, inner in node.items():
            told = said or bool(node.get(f"{key}_note"))
            if inner is None and not told and not reference and key not in ELSEWHERE:
                yield f"{path}.{key}"
            elif key not in ("quality",) and not (key == "bradley_terry" and None in inner.values()):
                yield from silent(inner, f"{path}.{key}", told)
    elif isinstance(node, list):
        for inner in node:
            yield from silent(inner, f"{path}[]", said)


KINDS: dict[str, Callable[[np.random.Generator], dict[str, Any]]] = {
    "preferences": preferences,
    "ratings": ratings,
    "rated pairs": rated_pairs,
    "psychometric": psychometric,
    "same-different": same_different,
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("start", range(0, TABLES // len(KINDS), A_TEST))
def test_small_tables(kind: str, start: int) -> None:
    for seed in range(start, start + A_TEST):
        try:
            result = KINDS[kind](np.random.default_rng([seed, *kind.encode()]))
        except AnalysisError as refusal:
            if str(refusal).startswith("expected rows with"):  # every answer was missed
                continue
            raise
        json.dumps(result, allow_nan=False)
        assert not [*silent(result)], seed
