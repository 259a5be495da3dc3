"""Preferences: exact values by hand, participants against answers, order of presentation, and one-sided data."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from study.analysis import estimates
from study.analysis.confirmatory import confirmatory
from study.analysis.preference.analyse import Preference, compare, strengths
from study.analysis.preference.bradley_terry import BradleyTerry
from study.analysis.preference.motions import motions_as_sample
from study.analysis.preference.participants import default_p_values, participant_tests
from study.analysis.preference.published import published_test
from study.errors import AnalysisError


def test_wilson_interval_against_the_quadratic_it_solves() -> None:
    interval = estimates.wilson_interval(184, 280)
    z = stats.norm.ppf(0.975)
    for end in (interval.low, interval.high):
        assert end is not None
        assert abs(184 / 280 - end) == pytest.approx(z * np.sqrt(end * (1 - end) / 280), rel=1e-9)


def test_published_test_against_scipy() -> None:
    test = published_test(43, 80)
    expected = stats.chisquare([43, 37])
    assert test.chi_square == pytest.approx(expected.statistic)
    assert test.p_value == pytest.approx(expected.pvalue)
    assert test.exact_p_value == pytest.approx(stats.binomtest(43, 80).pvalue)


def test_impossible_counts_are_refused() -> None:
    with pytest.raises(AnalysisError, match="found 9 of 8"):
        published_test(9, 8)


def test_no_answers() -> None:
    test = published_test(0, 0)
    assert (test.percent, test.chi_square, test.p_value) == (None, None, None)


def test_participants_against_scipy() -> None:
    rng = np.random.default_rng(3)
    chosen = rng.binomial(8, 0.6, 20).astype(float)
    result = participant_tests(chosen, np.full(20, 8.0))
    expected = stats.ttest_1samp(chosen / 8, 0.5)
    assert result.t == pytest.approx(expected.statistic)
    assert result.p_value == pytest.approx(expected.pvalue)
    assert result.mean_percent == pytest.approx(100 * chosen.mean() / 8)


def test_wilcoxon_is_exact_with_ties() -> None:
    """Against all assignments of signs, written out."""
    chosen = np.array([7.0, 6, 6, 3, 8, 2, 5])
    lean = chosen / 8 - 0.5
    ranks = stats.rankdata(np.abs(lean))
    sums = np.array([ranks[np.array(signs)].sum() for signs in product([False, True], repeat=len(lean))])
    observed = ranks[lean > 0].sum()
    expected = np.mean(np.abs(sums - ranks.sum() / 2) >= abs(observed - ranks.sum() / 2) - 1e-9)
    found = participant_tests(chosen, np.full(7, 8.0)).wilcoxon_p_value
    assert found == pytest.approx(expected)


def test_intraclass_correlation_is_recovered() -> None:
    rng = np.random.default_rng(8)
    own = rng.beta(0.5 * 4, 0.5 * 4, size=4000)  # correlation 1 / (1 + 4)
    found = estimates.clustering(rng.binomial(8, own), np.full(4000, 8))
    assert found.intraclass_correlation == pytest.approx(0.2, abs=0.02)
    assert found.design_effect == pytest.approx(1 + 7 * 0.2, abs=0.15)


@pytest.mark.parametrize("correlation", [0.0, 0.2])
def test_the_participants_test_keeps_its_level_where_the_pooled_one_does_not(correlation: float) -> None:
    rng = np.random.default_rng(11)
    studies, people = 600, np.zeros(600)
    pooled = np.zeros(studies)
    for study in range(studies):
        own = rng.beta(2, 2, size=35) if correlation else np.full(35, 0.5)
        chosen = rng.binomial(8, own).astype(float)
        tests = participant_tests(chosen, np.full(35, 8.0))
        people[study] = tests.p_value
        pooled[study] = published_test(int(chosen.sum()), 280).p_value or 0
    assert np.mean(people < 0.05) == pytest.approx(0.05, abs=0.027)
    if correlation:
        assert np.mean(pooled < 0.05) > 0.12


def test_a_preference_study_end_to_end(preference_study: Callable[..., pd.DataFrame]) -> None:
    (result,) = compare(preference_study(np.random.default_rng(1), share=0.8, correlation=0.1))
    assert (result.method_a, result.method_b) == ("geodesic", "fixed")
    assert result.published.answers == 280
    assert result.participants.p_value < 0.001
    assert result.participants.low < 80 < result.participants.high
    assert len(result.motions) == 8
    assert all(row.low < row.percent <= row.high for row in result.motions)
    assert "favoured geodesic over fixed" in result.answer


def test_order_of_presentation_is_found_and_taken_out(preference_study: Callable[..., pd.DataFrame]) -> None:
    answers = preference_study(np.random.default_rng(2), participants=200, share=0.6, first_bonus=0.15)
    (result,) = compare(answers)
    order = result.order
    assert order.first_percent == pytest.approx(65, abs=3)
    assert order.p_value < 1e-6
    assert order.balanced_percent == pytest.approx(60, abs=3)


def test_everybody_of_one_mind(preference_study: Callable[..., pd.DataFrame]) -> None:
    (result,) = compare(preference_study(np.random.default_rng(2), participants=12, share=1.0))
    people = result.participants
    assert (people.t, people.low) == (None, None)
    assert people.test == "exact sign test"
    assert people.p_value == pytest.approx(2 * 0.5**12)
    assert result.published.interval.low < 0.97


def test_one_participant(preference_study: Callable[..., pd.DataFrame]) -> None:
    (result,) = compare(preference_study(np.random.default_rng(2), participants=1))
    assert result.participants.p_value is None
    assert "one participant" in result.answer
    assert result.clustering.design_effect is None


def test_missed_answers_are_left_out(preference_study: Callable[..., pd.DataFrame]) -> None:
    answers = preference_study(np.random.default_rng(2), participants=10).astype({"chose_a": object})
    answers.loc[:9, "chose_a"] = None
    (result,) = compare(answers)
    assert result.published.answers == 70


def test_holm_by_hand() -> None:
    assert estimates.holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])


def test_missing_columns_are_named() -> None:
    with pytest.raises(AnalysisError, match="found none named method_a, method_b"):
        compare(pd.DataFrame({"participant": ["a"], "chose_a": [True]}))


def test_the_default_test_of_many_studies_at_once_is_that_of_each() -> None:
    """Against scipy; with people who gave no answers, with all alike, with too few."""
    rng = np.random.default_rng(5)
    chosen, shown = rng.binomial(8, 0.6, (40, 12)).astype(float), np.full((40, 12), 8.0)
    shown[:5, 3] = chosen[:5, 3] = 0
    chosen[5] = 8
    chosen[6] = 4
    shown[7, 1:] = chosen[7, 1:] = 0
    found = default_p_values(chosen, shown)
    for study in [*range(5), *range(8, 40)]:
        there = shown[study] > 0
        expected = stats.ttest_1samp(chosen[study][there] / shown[study][there], 0.5).pvalue
        assert found[study] == pytest.approx(expected)
    assert found[5] == pytest.approx(2 * 0.5**12)
    assert found[6] == 1
    assert np.isnan(found[7])


def test_ties_count_half_and_leave_the_pooled_test(preference_study: Callable[..., pd.DataFrame]) -> None:
    answers = preference_study(np.random.default_rng(2), participants=10).astype({"chose_a": object})
    answers.loc[answers.index % 8 == 0, "chose_a"] = 0.5
    (result,) = compare(answers)
    clear = answers[answers["chose_a"] != 0.5]
    assert result.ties == 10
    assert (result.published.answers, result.published.favouring) == (70, int(clear["chose_a"].sum()))
    shares = answers.assign(chose_a=answers["chose_a"].astype(float)).groupby("participant")["chose_a"].mean()
    assert result.participants.mean_percent == pytest.approx(100 * shares.mean())
    assert result.order.answers == 80
    answers.loc[3, "chose_a"] = "geodesic"
    with pytest.raises(AnalysisError, match=r"or 0\.5 for a tie .* found 'geodesic'"):
        compare(answers)


def test_motions_that_differ_widen_what_holds_for_other_motions() -> None:
    """Motions alone decide: over participants that looks certain, over motions it does not."""
    rng = np.random.default_rng(9)
    chance = np.tile([0.95, 0.9, 0.85, 0.8, 0.75, 0.2, 0.15, 0.1], (35, 1))
    chosen = (rng.random((35, 8)) < chance).astype(float)
    part = pd.DataFrame(
        {
            "participant": np.repeat(np.arange(35), 8),
            "motion": np.tile(np.arange(8), 35),
            "chose_a": chosen.ravel(),
        }
    )
    found = motions_as_sample(part)
    people = participant_tests(chosen.sum(axis=1), np.full(35, 8.0))
    assert people.p_value < 0.001
    assert found.both.p_value > 0.1
    assert 1 < found.both.degrees_of_freedom < 7
    assert found.both.percent == pytest.approx(people.mean_percent)


def test_what_holds_for_other_people_and_motions_keeps_its_level() -> None:
    """Missing answers, people and motions that both differ: errors near the nominal 5%."""
    rng = np.random.default_rng(10)
    wrong = []
    for _ in range(400):
        lean = 0.6 * rng.normal(size=(35, 1)) + 0.5 * rng.normal(size=(1, 8))
        chosen = (rng.random((35, 8)) < 1 / (1 + np.exp(-lean))).astype(float)
        part = pd.DataFrame(
            {"participant": np.repeat(np.arange(35), 8), "motion": np.tile(np.arange(8), 35), "chose_a": chosen.ravel()}
        )
        wrong.append(motions_as_sample(part[rng.random(280) > 0.05]).both.p_value < 0.05)
    assert 0.015 <= np.mean(wrong) <= 0.08


def test_one_motion_can_stand_for_no_other(preference_study: Callable[..., pd.DataFrame]) -> None:
    answers = preference_study(np.random.default_rng(2), participants=9)
    (result,) = compare(answers[answers["motion"] == "motion 0"])
    assert result.motions_as_sample.both is None
    assert "fewer than two motions" in result.motions_as_sample.note
    (alone,) = compare(answers[answers["participant"] == "p00"])
    assert alone.motions_as_sample.both is None
    assert "one participant" in alone.motions_as_sample.note


def test_only_the_declared_family_is_adjusted(preference_study: Callable[..., pd.DataFrame]) -> None:
    rng = np.random.default_rng(3)
    found = {name: Preference(compare(preference_study(rng, share=0.6)), None) for name in ("main", "second", "extra")}
    everything, declared = confirmatory(found), confirmatory(found, ["main", "second"])
    assert [row.study for row in declared] == ["main", "second"]
    assert [row.p_value for row in declared] == [row.p_value for row in everything[:2]]
    smallest = min(row.p_value for row in declared)
    assert min(row.holm_p_value for row in declared) == pytest.approx(2 * smallest)


def test_strengths_rest_on_who_answered(preference_study: Callable[..., pd.DataFrame]) -> None:
    rng = np.random.default_rng(4)
    parts = [
        preference_study(rng, participants=12, share=share).assign(method_a=one, method_b=other)
        for one, other, share in (("a", "b", 0.7), ("b", "c", 0.6), ("a", "c", 0.8))
    ]
    found = strengths(pd.concat(parts))
    assert isinstance(found, BradleyTerry)
    assert found.participants == 12
    assert [row.method for row in found.strengths] == ["a", "b", "c"]
