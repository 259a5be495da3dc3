"""Yes-no: percepts drawn one by one against the model, and a whole study from its protocol to its report."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm

from study.analysis.study_result import Settings
from study.analysis.yes_no.analyse import YesNo, analyse_yes_no
from study.errors import AnalysisError, ProtocolError
from study.experiment.observers import truth
from study.experiment.plan import draw_plan
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.session import advanced, answered, current, open_session
from study.experiment.simulation import simulate
from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import open_responses
from study.models.detection import BEST_D_PRIME, said_yes
from study.report.sections.section import About
from study.report.sections.yes_no.section import KIND
from study.tasks.observer import default_observer
from study.tasks.registry import answer_columns, right_answer, task_of
from study.tasks.trial import Pair

TEXT = """
name = "seen"
title = "Is something wrong?"
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
name = "seen"
task = "yes-no"
differences_frames = [-15, -10, -5, 0, 5, 10, 15]
repeats = 6
practice = 3
"""


@pytest.fixture
def protocol() -> Protocol:
    return parse_protocol(TEXT)


def pairs_of(protocol: Protocol) -> tuple[Pair, ...]:
    study = protocol.studies[0]
    return tuple(
        Pair(
            f"seen/{motion.name}/{condition.name}", "seen", "yes-no", motion.name, motion.category,
            (f"{motion.name}{condition.added_frames[0]:+d}",), condition.methods, condition.difference_frames,
        )
        for motion in protocol.transitions
        for condition in task_of(study).conditions(study, False)
    )  # fmt: skip


@pytest.mark.parametrize(("d_prime", "criterion", "lapse"), [(0.0, 2.0, 0.0), (1.0, 2.0, 0.1), (2.5, 0.6, 0.02)])
def test_the_chance_of_yes_is_that_of_percepts_drawn_one_by_one(d_prime: float, criterion: float, lapse: float) -> None:
    rng = np.random.default_rng(4)
    yes = rng.standard_normal(400_000) + d_prime > criterion / 2
    blind = rng.random(400_000) < lapse
    yes[blind] = rng.random(int(blind.sum())) < 0.5
    assert float(said_yes(np.array(d_prime), criterion, lapse)) == pytest.approx(float(yes.mean()), abs=0.0032)


def test_the_best_criterion_is_right_in_three_of_four_trials() -> None:
    criteria = np.linspace(-2, 4, 6001)
    right = (norm.sf(criteria - BEST_D_PRIME) + norm.cdf(criteria)) / 2
    assert right.max() == pytest.approx(0.75, abs=1e-6)


def test_a_trial_shows_one_film_and_asks_yes_or_no(protocol: Protocol) -> None:
    plan = draw_plan(protocol, pairs_of(protocol), "p01")
    trials = [trial for trial in plan.trials if trial.role == "trial"]
    assert len(trials) == 2 * 7 * 6
    assert Counter(right_answer(trial) for trial in trials) == {"no": 12, "yes": 72}
    assert all(trial.stimuli == (f"{trial.motion}{trial.difference_frames:+d}",) for trial in trials)
    session = open_session(protocol, plan)
    assert "short films" in current(session).text
    seen = []
    while (step := current(session)).kind != "feedback":
        seen.append(step)
        if step.kind == "answer":
            assert step.legal == ("yes", "no")
            assert step.duration_s == protocol.timing.answer_s
            session, answer = answered(session, "yes", 1.0)
        else:
            session = advanced(session)
    assert [step.place for step in seen if step.trial == 1] == ["first", "answer"]
    row = answer_columns(session.trial(1), answer)
    assert row["correct"] == bool(session.trial(1).difference_frames)
    assert row["second"] == ""


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("-5, 0, 5", "-5, 5", "expected 0 among the differences of the yes-no study 'seen'"),
        ("differences_frames = [-15, -10, -5, 0, 5, 10, 15]\n", "", "expected differences_frames"),
        ("repeats = 6", 'comparison = "fixed"', "expected no comparison in the yes-no study"),
    ],
)
def test_what_does_not_fit_is_refused(old: str, new: str, expected: str) -> None:
    with pytest.raises(ProtocolError, match=expected):
        parse_protocol(TEXT.replace(old, new))


def test_two_keys_may_not_be_one() -> None:
    with pytest.raises(ProtocolError, match="expected two keys for yes and no"):
        parse_protocol(TEXT.replace("[texts]", '[keys]\nno = "y"\n\n[texts]'))


def drawn(seed: int, people: int = 30, repeats: int = 10, without: bool = True) -> pd.DataFrame:
    """Answers of people who share no code with the model, with percepts and criteria: d' 0.1 and 0.2 a frame."""
    rng, rows = np.random.default_rng(seed), []
    for who in range(people):
        sees, strict = np.exp(0.15 * rng.standard_normal()), 1.0 + 0.2 * rng.standard_normal()
        for difference in (-30, -20, -10, -5, 0, 0, 5, 10, 15):
            for _ in range(repeats):
                percept = sees * abs(difference) * (0.1 if difference < 0 else 0.2) + rng.standard_normal()
                answer = (
                    ("yes" if percept > strict else "no") if rng.random() > 0.03 else str(rng.choice(["yes", "no"]))
                )
                rows.append({"participant": f"p{who}", "difference_frames": difference, "answer": answer})
    table = pd.DataFrame(rows).assign(motion="walk")
    return table if without else table[table["difference_frames"] != 0]


def test_thresholds_and_d_prime_are_found_again() -> None:
    """By 25 studies: in the middle of what is found, and within intervals as often as they say."""
    known = {"shorter": 0.1, "longer": 0.2}
    at = float(norm.ppf((0.75 - 0.015) / 0.97)) + 1.0
    slopes: dict[str, list[float]] = {side: [] for side in known}
    held = []
    for seed in range(25):
        found = analyse_yes_no(drawn(seed, people=16), "seen", Settings())
        for side, own in found.sides.items():
            threshold = own.threshold
            assert threshold.value is not None
            assert own.d_prime is not None
            slopes[side].append(own.d_prime)
            held += [threshold.low <= at / known[side] <= threshold.high, own.low <= known[side] <= own.high]
    for side, slope in known.items():
        assert np.mean(slopes[side]) == pytest.approx(slope, rel=0.05)
    assert 0.87 <= np.mean(held) <= 1  # 100 intervals, two standard errors and more below 95%


def test_false_alarms_d_prime_and_p_of_each_difference() -> None:
    table = drawn(1)
    found = analyse_yes_no(table, "seen", Settings())
    share = {key: float((part["answer"] == "yes").mean()) for key, part in table.groupby("difference_frames")}
    assert found.false_alarms == pytest.approx(100 * share[0])
    level = next(one for one in found.levels if one.difference_frames == 5)
    assert level.percent == pytest.approx(100 * share[5])
    assert level.d_prime == pytest.approx(norm.ppf(share[5]) - norm.ppf(share[0]))
    assert level.p_value is not None
    assert level.p_value < 1e-6
    assert next(one for one in found.levels if not one.difference_frames).d_prime is None


def test_what_cannot_be_known_is_said() -> None:
    blind = analyse_yes_no(drawn(1, without=False), "seen", Settings())
    assert blind.false_alarms is None
    assert all("no trials without a difference" in found.note for found in blind.thresholds.values())
    assert KIND.section(blind, About("seen", "Seen")) is not None
    one = analyse_yes_no(drawn(1, people=1, repeats=60), "seen", Settings())
    assert one.thresholds["longer"].low is None
    assert one.thresholds["longer"].value == pytest.approx(8.6, rel=0.3)
    always = analyse_yes_no(drawn(1).assign(answer="yes"), "seen", Settings())
    assert always.thresholds["longer"].value is None
    assert "found" not in always.sentences(0.05)[0]
    assert KIND.section(always, About("seen", "Seen")) is not None
    nothing = analyse_yes_no(drawn(1).iloc[:1].assign(answer=None), "seen", Settings())
    assert nothing.sentences(0.05) == ["No answers were given."]
    assert KIND.section(nothing, About("seen", "Seen")) is None
    with pytest.raises(AnalysisError, match="difference_frames"):
        analyse_yes_no(drawn(1).drop(columns="difference_frames"), "seen", Settings())


def test_a_simulated_study_finds_the_known_thresholds(protocol: Protocol, tmp_path: Path) -> None:
    class Stimuli:
        pairs, library, synthetic, records = pairs_of(protocol), "toy", True, ()

    with open_responses(tmp_path) as responses:
        simulate(protocol, Stimuli(), responses, 30, seed=3)
        found: YesNo = analyse_yes_no(answers_frame(responses), "seen", Settings())
    known = truth(protocol, default_observer())["studies"]["seen"]
    assert found.false_alarms == pytest.approx(100 * known["false_alarms"], abs=5)
    for side, threshold in found.thresholds.items():
        assert threshold.value == pytest.approx(abs(known[f"threshold_{side}_frames"]), rel=0.12)
        assert found.sides[side].d_prime == pytest.approx(known[f"d_prime_{side}"], rel=0.12)
    section = KIND.section(found, About("seen", "Seen"))
    assert section is not None
    assert "75% “yes”" in section.headlines[0].statement
    assert [table.name for table in section.tables] == ["seen_yes", "seen_thresholds"]
    assert "<svg" in section.drawings[0].picture.svg
    assert "equal-variance signal detection" in KIND.methods([found], None)  # type: ignore[arg-type]
