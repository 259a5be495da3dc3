"""`segue power`: against closed forms, against whole sessions, and with answers that are missed or left out."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binom, f, nct, t

from study.analysis.analyse import Analysis
from study.analysis.exclusions import Rules
from study.apps.cli import run
from study.apps.cli.shared import load, prepare_stimuli
from study.power import preference as preferences
from study.power import ratings, same_different
from study.power.design import Design, Effect
from study.power.planned import plans_of
from study.power.sessions import whole_sessions
from study.report.power import power_sentence, read_power


@pytest.fixture(scope="module")
def preference() -> Design:
    """2004's study two, 35 real plans, nobody misses anything."""
    protocol = load("geodesic_vs_fixed")
    study = protocol.studies[0]
    settings = preferences.preference_observer(study, 0.65, 0.0, 0.0, 0.0)
    settings = replace(settings, response_log_sd=0.0)
    return Design(protocol, study, plans_of(protocol, prepare_stimuli(protocol, None).pairs, 35), settings, Rules())


def share_found(run_of: Any, size: int, studies: int = 4000, seed: int = 1) -> float:
    return float(run_of(np.random.default_rng(seed), studies, [size]).mean())


def quasi_f(rng: np.random.Generator, people: int, studies: int, alpha: float) -> float:
    """How often the textbook's quasi-F finds 65% in one answer to each of eight motions, by sums of squares."""
    share = (rng.random((studies, people, 8)) < 0.65).astype(float)
    mean = share.mean(axis=(1, 2))
    rows, columns = share.mean(axis=2) - mean[:, None], share.mean(axis=1) - mean[:, None]
    rest = share - mean[:, None, None] - rows[:, :, None] - columns[:, None, :]
    squares = np.stack([8 * (rows**2).sum(axis=1), people * (columns**2).sum(axis=1), (rest**2).sum(axis=(1, 2))])
    freedom = np.array([people - 1, 7, 7 * (people - 1)])
    middle = squares / freedom[:, None]
    keep = np.stack([f.sf(middle[k] / middle[2], freedom[k], freedom[2]) < 0.25 for k in range(2)])
    joined = np.stack([*~keep, np.ones(studies, dtype=bool)])
    pool_freedom = (joined * freedom[:, None]).sum(axis=0)
    pool = (joined * squares).sum(axis=0) / pool_freedom
    times = 1.0 - keep.sum(axis=0)
    variance = (keep * middle[:2]).sum(axis=0) + times * pool
    wide = (1 + 0.9 / freedom[:2, None] * np.sqrt(np.minimum(pool / middle[:2], 1))) * middle[:2]
    spread = (keep * wide**2 / freedom[:2, None]).sum(axis=0) + (times * pool) ** 2 / pool_freedom
    variance = np.maximum(variance, pool)
    statistic = (mean - 0.5) / np.sqrt(variance / (8 * people))
    return float((t.sf(statistic, np.maximum(variance**2 / spread, 1)) < alpha / 2).mean())


def test_without_correlation_power_is_that_of_the_textbook(preference: Design) -> None:
    """Independent answers at 65%: by a quasi-F of our own; the exact test, which knows no motions, finds more."""
    for people in (12, 35):
        found = share_found(preferences.preference_study(preference, 0.001, 0.65), people)
        assert found == pytest.approx(quasi_f(np.random.default_rng(7), people, 4000, 0.001), abs=0.03)
    counts = np.arange(281)
    critical = next(k for k in counts if 2 * binom.sf(k - 1, 280, 0.5) < 0.001)
    exact = binom.sf(critical - 1, 280, 0.65)
    assert found < exact


def test_two_motions_are_no_sample_and_power_is_that_of_closed_forms(preference: Design) -> None:
    """Over participants alone: Student's t by the noncentral t."""
    names = sorted({trial.motion for trial in preference.trials()[0]})
    as_two = {name: names[place % 2] for place, name in enumerate(names)}
    plans = tuple(
        replace(plan, trials=tuple(replace(one, motion=as_two.get(one.motion, one.motion)) for one in plan.trials))
        for plan in preference.plans
    )
    for size in (12, 35):
        found = share_found(preferences.preference_study(replace(preference, plans=plans), 0.001, 0.65), size)
        noncentrality = 0.15 / np.sqrt(0.65 * 0.35 / 8) * np.sqrt(size)
        theory = nct.sf(t.ppf(1 - 0.001 / 2, size - 1), size - 1, noncentrality)
        assert found == pytest.approx(theory, abs=0.03)


def test_more_motions_do_what_more_people_can_not(preference: Design) -> None:
    """Where motions differ: the level is kept, and power is bounded by the motions whoever looks at them."""
    design = replace(preference, settings=preferences.preference_observer(preference.study, 0.5, 0.0, 0.0, 0.0, 0.7))
    assert share_found(preferences.preference_study(design, 0.05, 0.5, 0.7), 35) == pytest.approx(0.05, abs=0.015)
    design = replace(preference, settings=preferences.preference_observer(preference.study, 0.65, 0.0, 0.0, 0.0, 0.7))

    def power(motions: int, people: int) -> float:
        return share_found(preferences.preference_study(design, 0.05, 0.65, 0.7, motions), people, 1500)

    assert power(8, 34) < power(8, 17) + 0.15
    assert power(16, 17) > power(8, 34) + 0.2
    own = share_found(preferences.preference_study(design, 0.05, 0.65, 0.7), 34)
    assert power(8, 34) == pytest.approx(own, abs=0.05)


def test_motions_that_differ_leave_the_mean_share_as_stated(preference: Design) -> None:
    settings = preferences.preference_observer(preference.study, 0.7, 0.1, 0.2, 0.0, 0.8)
    _, own = preferences.logit_normal(0.7, 0.1, 0.2)
    assert settings.preference.participant_sd == pytest.approx(own)
    leaning = settings.preference.utility["geodesic"] + np.hypot(own, 0.8) * np.random.default_rng(2).normal(size=10**6)
    shares = [1 / (1 + np.exp(-leaning - bias)) for bias in (0.2, -0.2)]
    assert np.mean(shares) == pytest.approx(0.7, abs=0.001)


def test_without_an_effect_power_is_the_level(preference: Design) -> None:
    settings = preferences.preference_observer(preference.study, 0.5, 0.2, 0.1, 0.02)
    found = share_found(preferences.preference_study(replace(preference, settings=settings), 0.05, 0.5), 24)
    assert found == pytest.approx(0.05, abs=0.015)


def test_missed_answers_and_exclusions_cost_power(preference: Design) -> None:
    settings = preferences.preference_observer(preference.study, 0.7, 0.1, 0.1, 0.3)
    missing = replace(preference, settings=settings)
    strict = replace(missing, rules=Rules(most_missed=0.3))
    complete = replace(preference, settings=replace(settings, missed=0.0))
    powers = [
        share_found(preferences.preference_study(design, 0.01, 0.7), 20, 1500) for design in (complete, missing, strict)
    ]
    assert powers[0] > powers[1] + 0.03
    assert powers[1] > powers[2] + 0.03


def test_answers_too_soon_are_left_out_as_the_protocol_says(preference: Design) -> None:
    settings = replace(preference.settings, response_median_s=0.2)
    none_left = replace(preference, settings=settings, rules=Rules(fastest_s=1.0))
    assert share_found(preferences.preference_study(none_left, 0.05, 0.65), 35, 200) == 0


def both_ways(design: Design, fast: Any, verdict: Any, size: int, studies: int) -> tuple[float, float]:
    slow = whole_sessions(design, finding(design, verdict))
    return share_found(fast, size, 2000), share_found(slow, size, studies)


def finding(design: Design, verdict: Any) -> Effect:
    """An effect that is found where the whole analysis says so."""
    return Effect(design.settings, {}, None, "", "", study=lambda _: never, found=verdict)


def never(*_: Any) -> Any:
    raise AssertionError("studies drawn at once are not asked for")


@pytest.mark.slow
def test_preferences_at_once_are_those_of_whole_sessions(preference: Design) -> None:
    settings = preferences.preference_observer(preference.study, 0.72, 0.1, 0.1, 0.15)
    design = replace(preference, settings=settings, rules=Rules(most_missed=0.4, fastest_s=0.6))
    fast = preferences.preference_study(design, 0.01, 0.72)
    found = both_ways(
        design, fast, lambda analysis: preferences.preference_found(analysis, design.study.name, 0.72, 0.01), 12, 100
    )
    assert found[0] == pytest.approx(found[1], abs=3.5 * 0.5 / np.sqrt(100))
    assert 0.2 < found[0] < 0.95


@pytest.mark.slow
def test_ratings_at_once_are_those_of_whole_sessions() -> None:
    protocol = load("transition_points")
    study = protocol.studies[0]
    protocol = protocol.model_copy(update={"studies": (study.model_copy(update={"items": study.items[:1]}),)})
    settings = ratings.rating_observer(study, 1.0, 0.2, 0.0)
    design = Design(
        protocol, protocol.studies[0], plans_of(protocol, prepare_stimuli(protocol, None).pairs, 12), settings, Rules()
    )
    fast = ratings.rating_study(design, 0.05, 1.0)
    found = both_ways(design, fast, lambda analysis: ratings.rating_found(analysis, study, 1.0, 0.05), 12, 60)
    assert found[0] == pytest.approx(found[1], abs=3.5 * 0.5 / np.sqrt(60))


@pytest.mark.slow
def test_rated_pairs_at_once_are_those_of_whole_sessions() -> None:
    protocol = load("transition_points")
    study = protocol.study("compared")
    protocol = protocol.model_copy(update={"studies": (study.model_copy(update={"items": study.items[:1]}),)})
    settings = ratings.rating_observer(study, 0.6, 0.2, 0.0)
    design = Design(
        protocol, protocol.studies[0], plans_of(protocol, prepare_stimuli(protocol, None).pairs, 12), settings, Rules()
    )
    fast = ratings.rating_study(design, 0.05, 0.6)
    found = both_ways(design, fast, lambda analysis: ratings.pair_rating_found(analysis, study, 0.6, 0.05), 12, 60)
    assert found[0] == pytest.approx(found[1], abs=3.5 * 0.5 / np.sqrt(60))


@pytest.mark.slow
def test_thresholds_are_those_of_whole_sessions() -> None:
    protocol = load("blend_length_jnd")
    study = protocol.studies[0]
    settings = same_different.same_different_observer(8.0, 7.0, 0.15, 0.02)
    design = Design(protocol, study, plans_of(protocol, prepare_stimuli(protocol, None).pairs, 8), settings, Rules())
    fast = same_different.same_different_study(design, 1.7, protocol.analysis.threshold)

    def narrow(analysis: Analysis) -> bool:
        return same_different.thresholds_found(analysis, study.name, 1.7)

    found = share_found(fast, 8, 100), share_found(whole_sessions(design, finding(design, narrow)), 8, 25)
    assert found[0] == pytest.approx(found[1], abs=3.5 * 0.5 / np.sqrt(25))


def test_the_verb_writes_what_the_report_reads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--participants", "4,30", "--studies", "200", "--share", "0.8", "--out", str(tmp_path), "--json"]
    arguments += ["--motions", "16"]
    assert run(["power", "geodesic_vs_fixed", *arguments]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert json.loads((tmp_path / "power_geodesic_vs_fixed.json").read_text(encoding="utf-8")) == printed
    powers = [point["power"] for point in printed["points"]]
    assert powers[0] < powers[1]
    assert powers[1] > 0.8
    assert 4 < printed["needed"] <= 30
    assert (printed["icc"], printed["simulations"], printed["answers_per_participant"]) == (0.1, 200, 8)
    assert "Student's t over participants and motions at 0.01" in printed["test"]
    assert [row["motions"] for row in printed["by_motions"]] == [16]
    (planned,) = read_power(tmp_path)
    assert "With 16 motions" in power_sentence(planned)
    with (tmp_path / "power_geodesic_vs_fixed.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["power"]) for row in rows] == powers
    assert rows[0]["share"] == "0.8"


def test_every_task_has_a_curve(capsys: pytest.CaptureFixture[str]) -> None:
    for name, more in (
        ("transition_points", ["--study", "cuts", "--difference", "1.5"]),
        ("transition_points", ["--study", "compared", "--difference", "0.7"]),
        ("blend_length_jnd", ["--precision", "3"]),
    ):
        assert run(["power", name, "--participants", "5,26", "--studies", "10", *more, "--json"]) == 0
        powers = [point["power"] for point in json.loads(capsys.readouterr().out)["points"]]
        assert powers[0] < powers[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["wang2004_session"], "expected --study with one of"),
        (["geodesic_vs_fixed", "--study", "jnd"], "expected one of the studies geodesic_vs_fixed, found 'jnd'"),
        (["geodesic_vs_fixed", "--participants", "ten"], "expected --participants as numbers"),
        (["geodesic_vs_fixed", "--motions", "0"], "expected --motions as numbers such as 4,8,16, found '0'"),
        (["blend_length_jnd", "--motions", "4"], "expected no --motions for this study"),
    ],
)
def test_refusals(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["power", *arguments]) == 2
    assert message in capsys.readouterr().err


def test_a_study_with_staircases_is_planned(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = load("blend_length_jnd").text
    levels = next(line for line in text.splitlines() if line.startswith("differences_frames"))
    text = text.replace(f"{levels}\n", "").replace('order = "both"\n', "")
    protocol = tmp_path / "staircases.toml"
    protocol.write_text(f'{text}\n[studies.procedure]\nname = "staircase"\nstart_frames = 10\nmost_frames = 15\n')
    assert (
        run(["power", str(protocol), "--participants", "3,12", "--studies", "10", "--precision", "1.5", "--json"]) == 0
    )
    printed = json.loads(capsys.readouterr().out)
    assert printed["points"][0]["power"] < printed["points"][1]["power"]
    assert "staircases" in printed["aim"]
    assert printed["answers_per_participant"] > 100
