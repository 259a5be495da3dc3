"""Power of oddity and of staircases, against observers and rules that are written here once more."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from study.analysis.exclusions import Rules
from study.analysis.oddity.analyse import Oddity, analyse_forced
from study.analysis.psychometric.analyse import typical_threshold
from study.analysis.psychometric.mixed import TypicalThreshold
from study.analysis.psychometric.model import make_model
from study.analysis.study_result import Settings
from study.errors import AnalysisError
from study.experiment.plan import draw_plan
from study.experiment.procedures.quest_plus import Quest
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.models.forced import FORCED
from study.models.population import probability_found
from study.power import oddity
from study.power.design import Design
from study.power.registry import effect_of
from study.power.same_different import Conditions, level_study
from study.power.sessions import whole_sessions
from study.power.staircases import against_constant, staircase_effect
from study.tasks.registry import task_of
from study.tasks.trial import Pair

PROTOCOL = """
name = "planned"
title = "Planned"
fps = 30
seed = 5

[analysis]
alpha = 0.05

[[transitions]]
name = "slow_quick"
category = "walking"
source = "slow"
destination = "quick"

[[studies]]
name = "odd"
task = "oddity"
"""
LEVELS = "differences_frames = [-16, -8, -4, 4, 8, 16]\nrepeats = 4\n"
STAIRCASES = """
[studies.procedure]
name = "staircase"
start_frames = 12
most_frames = 20
steps_frames = [4, 2]
side = "longer"
reversals = 8
averaged = 6
catch_every = 0
"""
OPTIONS = {"shorter": 8.0, "longer": 6.0, "spread": 0.2, "precision": 1.2, "missed": 0.0}


def design_of(text: str, people: int) -> Design:
    protocol = parse_protocol(text)
    pairs = tuple(
        Pair(f"odd/{one.name}", "odd", study.task, "slow_quick", "walking", ("k", one.name), one.methods,
             one.difference_frames)
        for study in protocol.studies for one in task_of(study).conditions(study, False)
    )  # fmt: skip
    observer = effect_of(protocol.studies[0], OPTIONS, protocol.analysis).observer
    plans = tuple(draw_plan(protocol, pairs, f"power-{place:03}") for place in range(people))
    return Design(protocol, protocol.studies[0], plans, observer, Rules())


def found_odd(rng: np.random.Generator, d_prime: float, trials: int = 1) -> np.ndarray:
    """Three percepts drawn; the one named is farthest from the other two."""
    percepts = rng.standard_normal((3, trials)) + np.array([[d_prime], [0.0], [0.0]])
    return np.abs(percepts - np.roll(percepts, 1, 0) / 2 - np.roll(percepts, 2, 0) / 2).argmax(axis=0) == 0


def d_prime_at_threshold() -> float:
    """Where percepts are right in two thirds, found by drawing them."""
    low, high = 0.5, 5.0
    for _ in range(18):
        middle = (low + high) / 2
        right = found_odd(np.random.default_rng(4), middle, 400_000).mean()
        low, high = (middle, high) if right < 2 / 3 else (low, middle)
    return low


def share(run: Callable[..., np.ndarray], size: int, studies: int) -> float:
    return float(run(np.random.default_rng(1), studies, [size]).mean())


def test_oddity_observers_are_right_as_often_as_percepts_drawn_one_by_one() -> None:
    design, seen, shown_in_all = design_of(PROTOCOL + LEVELS, 30), [], []

    def note(conditions: Conditions, right: np.ndarray, shown: np.ndarray) -> bool:
        assert list(conditions.differences) == [-16, -8, -4, 4, 8, 16]
        seen.append(right.sum(axis=0))
        shown_in_all.append(shown.sum(axis=0))
        return True

    level_study(design, partial(probability_found, FORCED["oddity"]), 1 / 3, note)(np.random.default_rng(0), 60, [30])
    shares = np.sum(seen, axis=0) / np.sum(shown_in_all, axis=0)
    rng, reached = np.random.default_rng(2), d_prime_at_threshold()
    people = np.exp(0.2 * rng.standard_normal(2000))
    for level, found in zip((-16, -8, -4, 4, 8, 16), shares, strict=True):
        d_prime = reached * abs(level) / (8.0 if level < 0 else 6.0)
        right = np.mean([found_odd(rng, d_prime * one, 100).mean() for one in people])
        assert found == pytest.approx(0.02 / 3 + 0.98 * right, abs=0.02)


def test_the_verdict_on_a_study_is_that_of_the_whole_analysis(monkeypatch: pytest.MonkeyPatch) -> None:
    design = design_of(PROTOCOL + LEVELS, 10)
    tables: list[pd.DataFrame] = []

    def kept(trials: pd.DataFrame, *arguments: Any) -> Any:
        tables.append(trials)
        return typical_threshold(trials, *arguments)

    monkeypatch.setattr(oddity, "typical_threshold", kept)
    oddity.forced_study(FORCED["oddity"], design, 9.0, 0.95)(np.random.default_rng(5), 1, [10])
    rows = [
        {"participant": row.participant, "difference_frames": sign * row.level, "correct": right, "answer": "first"}
        for sign, table in zip((-1, 1), tables, strict=True)
        for row in table.itertuples()
        for right, count in ((True, row.yes), (False, row.shown - row.yes))
        for _ in range(int(count))
    ]
    whole = analyse_forced(Oddity, pd.DataFrame(rows), "odd", Settings())
    for side, table in zip(("shorter", "longer"), tables, strict=True):
        fast, slow = typical_threshold(table, make_model("2afc", choices=3), 0.95), whole.functions[side].mixed
        assert isinstance(fast, TypicalThreshold)
        assert slow is not None
        assert (fast.low, fast.high) == pytest.approx((slow.low, slow.high), rel=1e-6)


def replayed(rng: np.random.Generator, slope: float) -> float:
    """A 1-up/2-down staircase from 12 frames, steps of 4 and then 2; the mean of the last six of eight reversals."""
    level, turns, direction, right = 12, [], 0, 0
    for _ in range(50):
        good = bool(found_odd(rng, level * slope)[0]) if rng.random() >= 0.02 else rng.random() < 1 / 3
        right = right + 1 if good else 0
        if good and right < 2:
            continue
        towards = -1 if good else 1
        if direction not in (0, towards):
            turns.append(level)
        direction, right = towards, 0
        level = min(max(level + towards * (4 if not turns else 2), 1), 20)
        if len(turns) == 8:
            break
    return float(np.mean(turns[-6:])) if len(turns) >= 6 else np.nan


def test_staircases_are_as_precise_as_those_replayed_by_hand() -> None:
    people, studies = 8, 150
    design = design_of(PROTOCOL + STAIRCASES, people)
    effect = staircase_effect(design.study, OPTIONS, design.protocol.analysis)
    rng, reached, verdicts = np.random.default_rng(3), d_prime_at_threshold(), []
    for _ in range(studies):
        slopes = reached / 6.0 * np.exp(0.2 * rng.standard_normal(people))
        means = np.array([replayed(rng, slope) for slope in slopes])
        means = means[np.isfinite(means)]
        half = stats.t.ppf(0.975, len(means) - 1) * means.std(ddof=1) / np.sqrt(len(means))
        verdicts.append(half <= OPTIONS["precision"])
    found = share(effect.study(design), people, studies)
    assert 0.1 < found < 0.9
    assert found == pytest.approx(np.mean(verdicts), abs=4 * np.sqrt(0.5 / studies))
    assert 12 < effect.answers(design) < 50


def test_staircases_of_whole_sessions_are_as_precise() -> None:
    design = design_of(PROTOCOL + STAIRCASES, 8)
    effect = staircase_effect(design.study, OPTIONS, design.protocol.analysis)
    slow = share(whole_sessions(design, effect), 8, 6)
    assert slow == pytest.approx(share(effect.study(design), 8, 60), abs=4 * np.sqrt(0.25 / 6))


def test_an_unplanned_task_is_refused() -> None:
    protocol: Protocol = design_of(PROTOCOL + LEVELS, 2).protocol
    unknown = protocol.studies[0].model_copy(update={"task": "guessing"})
    with pytest.raises(AnalysisError, match=r"expected one of the tasks same-different, .*, found 'guessing'"):
        effect_of(unknown, OPTIONS, protocol.analysis)


def test_quest_plus_is_compared_with_constant_stimuli() -> None:
    """Levels far beyond the threshold tell little: the wider their range, the more trials constant stimuli take."""
    base = design_of(PROTOCOL + LEVELS, 2)
    times = []
    for most in (12, 60):
        procedure = Quest(most_frames=most, catch_every=0, narrow=4.0, least_trials=8, most_trials=40)
        said = against_constant(replace(base, study=base.study.model_copy(update={"procedure": procedure})))
        asked, fixed = map(float, re.search(r"after (\d+) trials .* take (\d+):", said).groups())
        assert 8 <= asked <= 40
        share = float(re.search(r"(\d+)%", said).group(1)) / 100
        assert share == pytest.approx(1 - min(asked, fixed) / max(asked, fixed), abs=0.03)
        assert ("QUEST+ saves" if asked < fixed else "constant stimuli saves") in said
        times.append(fixed / asked)
    assert times[1] > 1.5 * times[0]


def test_yes_no_observers_say_yes_as_often_as_percepts_drawn_one_by_one() -> None:
    """At the thresholds asked for in three of four trials, and more precisely the more people there are."""
    text = PROTOCOL.replace('"oddity"', '"yes-no"') + LEVELS.replace("-4, 4", "-4, 0, 4")
    design = design_of(text, 24)
    effect = effect_of(design.study, OPTIONS, design.protocol.analysis)
    own, rng = effect.observer.same_different, np.random.default_rng(2)
    for d_prime in (8.0 * own.d_prime_shorter, 6.0 * own.d_prime_longer):
        yes = rng.standard_normal(400_000) + d_prime > own.criterion / 2
        assert own.lapse / 2 + (1 - own.lapse) * yes.mean() == pytest.approx(0.75, abs=0.003)
    few, many = (share(effect.study(design), people, 8) for people in (4, 24))
    assert few < many
