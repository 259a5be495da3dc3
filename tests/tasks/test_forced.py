"""Oddity and 2AFC: percepts against the closed form, and a whole study from its protocol to its report."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from study.analysis.oddity.analyse import Oddity, TwoAlternatives, analyse_forced
from study.analysis.study_result import Settings
from study.errors import ProtocolError
from study.experiment.observers import truth
from study.experiment.plan import Plan, draw_plan
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.session import advanced, answered, current, open_session
from study.experiment.simulation import simulate
from study.experiment.store.export import export
from study.experiment.store.frames import answers_frame, export_csv
from study.experiment.store.responses import open_responses
from study.experiment.store.sessions import session_by_id
from study.models.forced import FORCED, oddity_correct
from study.report.sections.oddity.section import KIND
from study.report.sections.section import About
from study.tasks.observer import default_observer
from study.tasks.registry import answer_columns, right_answer
from study.tasks.trial import Pair

ODD = FORCED["oddity"]

TEXT = """
name = "odd"
title = "Which one differs?"
fps = 30
seed = 5

[texts]
welcome = "{standard}"

[[transitions]]
name = "slow_quick"
category = "walking"
source = "slow"
destination = "quick"

[[transitions]]
name = "quick_slow"
category = "walking"
source = "quick"
destination = "slow"

[[studies]]
name = "odd"
task = "oddity"
differences_frames = [-20, -15, -10, -5, 5, 10, 15, 20]
order = "both"
practice = 3
"""


@pytest.fixture
def protocol() -> Protocol:
    return parse_protocol(TEXT)


def pairs_of(protocol: Protocol) -> tuple[Pair, ...]:
    return tuple(
        Pair(
            f"odd/{motion.name}/{level:+d}", "odd", "oddity", motion.name, motion.category,
            (f"{motion.name}-k", f"{motion.name}{level:+d}"), ("geodesic", "geodesic"), level,
        )
        for motion in protocol.transitions
        for level in protocol.studies[0].differences_frames
    )  # fmt: skip


def plan_of(protocol: Protocol, name: str = "p01") -> Plan:
    return draw_plan(protocol, pairs_of(protocol), name)


@pytest.mark.parametrize("d_prime", [0.0, 0.5, 1.0, 2.0, 3.5])
def test_the_chance_to_be_right_is_that_of_percepts_drawn_one_by_one(d_prime: float) -> None:
    percepts = np.random.default_rng(7).standard_normal((3, 400_000))
    percepts[2] += d_prime
    apart = np.abs(percepts - (percepts.sum(axis=0) - percepts) / 2)
    right = float((apart.argmax(axis=0) == 2).mean())
    assert float(oddity_correct(d_prime)) == pytest.approx(right, abs=0.0032)  # four standard errors


def test_chance_is_one_third_and_the_inverse_leads_back() -> None:
    assert float(oddity_correct(0.0)) == pytest.approx(1 / 3, abs=1e-12)
    # The published table of the triangle test (Ennis 1993) has 0.418 at d' of 1 and 0.605 at 2.
    assert oddity_correct(np.array([1.0, 2.0])) == pytest.approx([0.418, 0.605], abs=0.001)
    for d_prime in (0.3, 1.0, 4.0):
        assert ODD.d_prime_of(float(oddity_correct(d_prime))) == pytest.approx(d_prime, abs=1e-6)
    assert ODD.d_prime_of(0.2) == 0.0
    assert ODD.d_prime_of(1.0) is None


def test_the_odd_one_stands_in_each_place_equally_often(protocol: Protocol) -> None:
    trials = [trial for trial in plan_of(protocol).trials if trial.role == "trial"]
    assert protocol.trials_of(protocol.studies[0]) == len(trials) == 2 * 8 * 3
    places = Counter(right_answer(trial) for trial in trials)
    assert places == {"first": 16, "second": 16, "third": 16}
    for trial in trials:
        odd = trial.members.index(1)
        others = [name for place, name in enumerate(trial.stimuli) if place != odd]
        assert others == [f"{trial.motion}-k"] * 2
        assert trial.stimuli[odd] == f"{trial.motion}{trial.difference_frames:+d}"
    for order in ("random", "balanced", "by-group"):
        other = parse_protocol(TEXT.replace('order = "both"', f'order = "{order}"'))
        drawn = [trial.members for trial in plan_of(other).trials if trial.role == "trial"]
        assert len(drawn) == 16
        assert len(set(drawn)) == (1 if order == "by-group" else 3)


def test_a_session_shows_three_and_asks_which_differed(protocol: Protocol) -> None:
    session = open_session(protocol, plan_of(protocol))
    assert "three short films" in current(session).text
    seen = []
    while (step := current(session)).kind != "feedback":
        seen.append(step)
        if step.kind == "answer":
            assert step.legal == ("first", "second", "third")
            assert step.duration_s == protocol.timing.answer_s
            session, answer = answered(session, "third", 1.0)
        else:
            session = advanced(session)
    shown = [step.place for step in seen if step.trial == 1]
    assert shown == ["first", "gap", "second", "gap", "third", "answer"]
    trial = session.trial(1)
    row = answer_columns(trial, answer)
    assert row["correct"] == (trial.members == (0, 0, 1))
    assert (row["first"], row["second"], row["a_first"]) == (*trial.stimuli[:2], None)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("[-20,", "[0, -20,", "expected no 0 in the oddity study 'odd', where one of three has to differ"),
        ("differences_frames = [-20, -15, -10, -5, 5, 10, 15, 20]\n", "", "expected differences_frames"),
        ('order = "both"', 'comparison = "fixed"', "expected no comparison in the oddity study"),
    ],
)
def test_what_does_not_fit_is_refused(old: str, new: str, expected: str) -> None:
    with pytest.raises(ProtocolError, match=expected):
        parse_protocol(TEXT.replace(old, new))


def simulated(protocol: Protocol, folder: Path, people: int) -> Oddity:
    class Stimuli:
        pairs, library, synthetic, records = pairs_of(protocol), "toy", True, ()

    with open_responses(folder) as responses:
        simulate(protocol, Stimuli(), responses, people, seed=3)
        answers = answers_frame(responses)
    return analyse_forced(Oddity, answers, "odd", Settings())


def test_a_simulated_study_finds_the_known_thresholds(protocol: Protocol, tmp_path: Path) -> None:
    found = simulated(parse_protocol(TEXT.replace("practice = 3", "practice = 3\nrepeats = 4")), tmp_path, 24)
    known = truth(protocol, default_observer())["studies"]["odd"]
    assert known["level"] == pytest.approx(2 / 3, abs=1e-6)
    for side, threshold in found.thresholds.items():
        assert threshold.value == pytest.approx(abs(known[f"threshold_{side}_frames"]), rel=0.12)
    observer = default_observer().same_different
    level = next(one for one in found.levels if one.difference_frames == 10)
    people = np.exp(observer.log_sensitivity_sd * np.random.default_rng(1).standard_normal(4000))
    right = float(oddity_correct(10 * observer.d_prime_longer * people).mean())
    assert level.percent == pytest.approx(100 * (observer.lapse / 3 + (1 - observer.lapse) * right), abs=4)
    assert level.d_prime == pytest.approx(ODD.d_prime_of(level.percent / 100))
    assert level.answers == pytest.approx(24 * 2 * 3 * 4, rel=0.02)
    section = KIND.section(found, About("odd", "Odd"))
    assert section is not None
    assert "67% right" in section.headlines[0].statement
    assert [table.name for table in section.tables] == ["odd_right", "odd_thresholds"]
    assert "<svg" in section.drawings[0].picture.svg


def test_every_export_has_all_three_stimuli_and_says_what_they_are(protocol: Protocol, tmp_path: Path) -> None:
    class Stimuli:
        pairs, library, synthetic, records = pairs_of(protocol), "toy", True, ()

    with open_responses(tmp_path / "results") as responses:
        simulate(protocol, Stimuli(), responses, 1, seed=3)
        plan = session_by_id(responses, 1).plan
        export(protocol, responses, "psych-ds", tmp_path / "psych-ds", {})
        export(protocol, responses, "bids", tmp_path / "bids", {})
        export_csv(responses, tmp_path / "answers.csv", {}, {})
    shown = {trial.trial: trial.stimuli for trial in plan.trials}
    files = [
        tmp_path / "answers.csv",
        *(tmp_path / "psych-ds").rglob("task-*.csv"),
        *(tmp_path / "bids").rglob("*_beh.tsv"),
    ]
    assert len(files) == 3
    for file in files:
        table = pd.read_csv(file, sep=None, engine="python")
        assert {row.trial: (row.first, row.second, row.third) for row in table.itertuples()} == shown
    described = json.loads((tmp_path / "psych-ds" / "dataset_description.json").read_text())["variableMeasured"]
    assert "third" in {one["name"] for one in described}
    assert "third" in json.loads(files[2].with_suffix(".json").read_text())


TWO = (
    TEXT.replace('task = "oddity"', 'task = "2afc"')
    .replace("practice = 3", "practice = 3\nrepeats = 4")
    .replace("[-20, -15, -10, -5, 5, 10, 15, 20]", "[-8, -4, -2, -1, 1, 2, 4, 8]")
)
FORCED_TWO = FORCED["2afc"]


@pytest.mark.parametrize("d_prime", [0.0, 0.5, 1.0, 2.0, 3.5])
def test_the_chance_to_be_right_of_two_is_that_of_percepts_drawn_one_by_one(d_prime: float) -> None:
    percepts = np.random.default_rng(8).standard_normal((2, 400_000))
    right = float((percepts[1] + d_prime > percepts[0]).mean())
    assert float(FORCED_TWO.correct(d_prime)) == pytest.approx(right, abs=0.0032)  # four standard errors


def test_the_threshold_is_at_the_published_d_prime() -> None:
    # Macmillan & Creelman 2005, Table A5.2: 75% right in 2AFC is d' = 0.954.
    assert FORCED_TWO.at_threshold == pytest.approx(0.954, abs=5e-4)
    assert (FORCED_TWO.chance, FORCED_TWO.halfway) == (0.5, 0.75)


def test_the_longer_one_is_right_in_either_place_and_to_either_side() -> None:
    protocol = parse_protocol(TWO)
    pairs = [type(pair)(**{**vars(pair), "task": "2afc"}) for pair in pairs_of(protocol)]
    trials = [trial for trial in draw_plan(protocol, pairs, "p01").trials if trial.role == "trial"]
    assert len(trials) == 2 * 8 * 2 * 4
    for trial in trials:
        longer = f"{trial.motion}-k" if trial.difference_frames < 0 else f"{trial.motion}{trial.difference_frames:+d}"
        assert trial.stimuli[("first", "second").index(right_answer(trial))] == longer
    assert {right_answer(trial) for trial in trials if trial.difference_frames == 4} == {"first", "second"}
    with pytest.raises(ProtocolError, match="expected no 0 in the 2afc study 'odd', where one of two has to be longer"):
        parse_protocol(TWO.replace("[-8,", "[0, -8,"))


def test_a_simulated_study_of_two_finds_the_known_thresholds(tmp_path: Path) -> None:
    protocol = parse_protocol(TWO)

    class Stimuli:
        pairs = tuple(type(pair)(**{**vars(pair), "task": "2afc"}) for pair in pairs_of(protocol))
        library, synthetic, records = "toy", True, ()

    with open_responses(tmp_path) as responses:
        simulate(protocol, Stimuli(), responses, 30, seed=3)
        found = analyse_forced(TwoAlternatives, answers_frame(responses), "odd", Settings())
    known = truth(protocol, default_observer())["studies"]["odd"]
    for side, threshold in found.thresholds.items():
        assert threshold.value == pytest.approx(abs(known[f"threshold_{side}_frames"]), rel=0.15)
    section = KIND.section(found, About("odd", "Odd"))
    assert section is not None
    assert "finding the longer one of two, 75% right" in section.headlines[0].statement
    assert "chance gives 50% right" in section.headlines[0].detail
    assert "two percepts of which the larger one is named" in KIND.methods([found], None)  # type: ignore[arg-type]
