"""Thresholds of staircases against runs made here, whose reversals are noted as they happen."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd
import pytest

from study.analysis.same_different.staircases import staircase_thresholds
from study.models.up_down import UpDown

RULE = UpDown(start=20, steps=(4, 2), least=1, most=40, down=2, reversals=8, trials=60, averaged=6)


def run(
    rng: np.random.Generator, middle: float, width: float, missed: float = 0.0, most: int = 60
) -> tuple[list[tuple[int, str | None]], list[int]]:
    """A 1-up/2-down run of an observer with a logistic curve: levels with answers, and the levels where it turned."""
    level, direction, rights = 20, 0, 0
    rows: list[tuple[int, str | None]] = []
    turns: list[int] = []
    while len(turns) < 8 and len(rows) < most:
        if rng.random() < missed:
            rows.append((level, None))
            continue
        different = bool(rng.random() < 1 / (1 + math.exp(-(level - middle) / width)))
        rows.append((level, "different" if different else "same"))
        rights = rights + 1 if different else 0
        if different and rights < 2:
            continue
        step = -1 if different else 1
        if direction == -step:
            turns.append(level)
        direction, rights = step, 0
        level = min(max(level + step * (4 if not turns else 2), 1), 40)
    return rows, turns


def table_of(runs: dict[tuple[str, str, int], list[tuple[int, str | None]]]) -> pd.DataFrame:
    """Answers of runs by participant, motion and sign of the difference, interleaved trial by trial."""
    rows: list[dict[str, Any]] = []
    for (participant, motion, sign), own in runs.items():
        for place, (level, answer) in enumerate(own):
            rows.append(
                {
                    "participant": participant, "motion": motion, "repeat": 1, "trial": 3 * place + (sign > 0),
                    "difference_frames": sign * level, "answer": answer,
                    "correct": None if answer is None else answer == "different",
                }
            )  # fmt: skip
        rows.append({**rows[-1], "trial": 1, "difference_frames": 0, "answer": "different", "correct": False})
    table = pd.DataFrame(rows).sample(frac=1.0, random_state=1)
    return table.astype({"difference_frames": "Int64", "correct": "boolean"})


@pytest.mark.parametrize("missed", [0.0, 0.1])
def test_reversals_are_those_that_happened(missed: float) -> None:
    rng = np.random.default_rng(3)
    made = {
        (name, motion, sign): run(rng, 10.0, 2.0, missed)
        for name in ("p1", "p2", "p3")
        for motion in ("walk", "run")
        for sign in (-1, 1)
    }
    found = staircase_thresholds(table_of({key: rows for key, (rows, _) in made.items()}), RULE)
    assert len(found.runs) == 12
    for one in found.runs:
        rows, turns = made[one.participant, one.motion, 1 if one.side == "longer" else -1]
        assert (one.trials, one.reversals) == (len(rows), len(turns))
        assert one.levels == tuple(level for level, _ in rows)
        assert [one.levels[turn - 1] for turn in one.turns] == turns
        assert one.frames == pytest.approx(float(np.mean(turns[-6:])))
        assert one.spread == pytest.approx(float(np.std(turns[-6:], ddof=1)))
    for side, sign in (("longer", 1), ("shorter", -1)):
        means = [
            np.mean([np.mean(made[name, motion, sign][1][-6:]) for motion in ("walk", "run")])
            for name in ("p1", "p2", "p3")
        ]
        threshold = found.thresholds[side]
        assert threshold.frames == pytest.approx(float(np.mean(means)))
        assert threshold.standard_error == pytest.approx(float(np.std(means, ddof=1) / math.sqrt(3)))
        # Student's t of two degrees of freedom: 4.303.
        assert threshold.interval.high == pytest.approx(threshold.frames + 4.302653 * threshold.standard_error)
    assert found.target == pytest.approx(math.sqrt(0.5))
    assert found.in_words().startswith("By the staircases, 70.7% of the responses are “different” at k + ")


def test_the_threshold_is_where_the_observer_has_the_target() -> None:
    rng = np.random.default_rng(8)
    made = {(f"p{n}", "walk", 1): run(rng, 12.0, 2.5)[0] for n in range(120)}
    found = staircase_thresholds(table_of(made), RULE).thresholds["longer"]
    expected = 12.0 + 2.5 * math.log(math.sqrt(0.5) / (1 - math.sqrt(0.5)))
    assert found.frames is not None
    assert found.standard_error is not None
    # Reversals of short runs lie a little high: they start high.
    assert abs(found.frames - expected) < 3 * found.standard_error + 0.5


def test_excluded_answers_are_bridged() -> None:
    """Without some answers the levels that were shown tell where the staircase was."""
    rng = np.random.default_rng(5)
    whole = table_of({(f"p{n}", "walk", 1): run(rng, 12.0, 2.5)[0] for n in range(20)})
    left = whole.drop(whole.sample(frac=0.08, random_state=2).index)
    all_, some = (staircase_thresholds(one, RULE).thresholds["longer"].frames for one in (whole, left))
    assert all_ is not None
    assert some == pytest.approx(all_, abs=0.6)


def test_runs_that_stopped_early_have_no_threshold_and_it_is_said() -> None:
    rng = np.random.default_rng(2)
    runs = {("p1", "walk", 1): run(rng, 12.0, 2.5)[0], ("p2", "walk", 1): [(20, "different"), (20, "different")]}
    found = staircase_thresholds(table_of(runs), RULE)
    assert [one.frames is None for one in found.runs].count(True) == 1
    threshold = found.thresholds["longer"]
    assert (threshold.status, threshold.standard_error) == ("reached", None)
    early = "stopped too early for the mean of the last 6 reversals"
    assert threshold.note == f"one participant: no spread to estimate; 1 of 2 staircases {early}"
    none = staircase_thresholds(table_of({("p2", "walk", 1): [(20, "different")] * 3}), RULE)
    assert none.thresholds["longer"].frames is None
    assert f"nothing (1 of 1 staircase {early})" in none.in_words()
