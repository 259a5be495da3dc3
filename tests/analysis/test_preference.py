"""Preferences: exact values by hand, participants against answers, order of presentation, and one-sided data."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from study.analysis import estimates
from study.analysis.preference import compare, participant_tests, published_test
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
    assert result["t"] == pytest.approx(expected.statistic)
    assert result["p_value"] == pytest.approx(expected.pvalue)
    assert result["mean_percent"] == pytest.approx(100 * chosen.mean() / 8)


def test_wilcoxon_is_exact_with_ties() -> None:
    """Against all assignments of signs, written out."""
    chosen = np.array([7.0, 6, 6, 3, 8, 2, 5])
    lean = chosen / 8 - 0.5
    ranks = stats.rankdata(np.abs(lean))
    sums = np.array([ranks[np.array(signs)].sum() for signs in product([False, True], repeat=len(lean))])
    observed = ranks[lean > 0].sum()
    expected = np.mean(np.abs(sums - ranks.sum() / 2) >= abs(observed - ranks.sum() / 2) - 1e-9)
    found = participant_tests(chosen, np.full(7, 8.0))["wilcoxon_p_value"]
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
    pooled, robust = np.zeros(studies), np.zeros(studies)
    for study in range(studies):
        own = rng.beta(2, 2, size=35) if correlation else np.full(35, 0.5)
        chosen = rng.binomial(8, own).astype(float)
        tests = participant_tests(chosen, np.full(35, 8.0))
        people[study], robust[study] = tests["p_value"], tests["robust_p_value"]
        pooled[study] = published_test(int(chosen.sum()), 280).p_value or 0
    for p_values in (people, robust):
        assert np.mean(p_values < 0.05) == pytest.approx(0.05, abs=0.027)
    if correlation:
        assert np.mean(pooled < 0.05) > 0.12


def test_a_preference_study_end_to_end(preference_study: Callable[..., pd.DataFrame]) -> None:
    (result,) = compare(preference_study(np.random.default_rng(1), share=0.8, correlation=0.1))
    assert (result["method_a"], result["method_b"]) == ("geodesic", "fixed")
    assert result["published"]["answers"] == 280
    assert result["participants"]["p_value"] < 0.001
    assert result["participants"]["low"] < 80 < result["participants"]["high"]
    assert len(result["motions"]) == 8
    assert all(row["holm_p_value"] >= row["exact_p_value"] for row in result["motions"])
    assert "favoured geodesic over fixed" in result["answer"]


def test_order_of_presentation_is_found_and_taken_out(preference_study: Callable[..., pd.DataFrame]) -> None:
    answers = preference_study(np.random.default_rng(2), participants=200, share=0.6, first_bonus=0.15)
    (result,) = compare(answers)
    order = result["order"]
    assert order["first_percent"] == pytest.approx(65, abs=3)
    assert order["p_value"] < 1e-6
    assert order["balanced_percent"] == pytest.approx(60, abs=3)


def test_everybody_of_one_mind(preference_study: Callable[..., pd.DataFrame]) -> None:
    (result,) = compare(preference_study(np.random.default_rng(2), participants=12, share=1.0))
    people = result["participants"]
    assert (people["t"], people["low"]) == (None, None)
    assert people["test"] == "exact sign test"
    assert people["p_value"] == pytest.approx(2 * 0.5**12)
    assert result["published"]["interval"]["low"] < 0.97


def test_one_participant(preference_study: Callable[..., pd.DataFrame]) -> None:
    (result,) = compare(preference_study(np.random.default_rng(2), participants=1))
    assert result["participants"]["p_value"] is None
    assert "one participant" in result["answer"]
    assert result["clustering"]["design_effect"] is None


def test_missed_answers_are_left_out(preference_study: Callable[..., pd.DataFrame]) -> None:
    answers = preference_study(np.random.default_rng(2), participants=10).astype({"chose_a": object})
    answers.loc[:9, "chose_a"] = None
    (result,) = compare(answers)
    assert result["published"]["answers"] == 70


def test_holm_by_hand() -> None:
    assert estimates.holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])


def test_missing_columns_are_named() -> None:
    with pytest.raises(AnalysisError, match="found none named method_a, method_b"):
        compare(pd.DataFrame({"participant": ["a"], "chose_a": [True]}))
