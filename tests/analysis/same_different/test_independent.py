"""The rule of independent observations, the test by order, and profile intervals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import minimize
from scipy.stats import norm

from study.analysis.same_different import fits
from study.analysis.same_different.counts import Counts, count_answers
from study.analysis.same_different.independent import compare_rules, fit_independent
from study.analysis.same_different.order import order_test
from study.analysis.same_different.profiles import profile_intervals
from study.models.differencing import probability_different, threshold_delta

LEVELS = np.array([-15.0, -10, -5, 0, 5, 10, 20])


def odd_counts(answers: float) -> Counts:
    """Exact percentages of an observer who judges each transition by itself."""
    delta = np.where(LEVELS < 0, -0.20 * LEVELS, 0.25 * LEVELS)
    p = norm.sf(1.8 - delta) + norm.cdf(-1.8 - delta)
    usual = 2 * norm.cdf(-1.8)
    share = 0.01 + 0.98 * (usual * (1 - p) + p * (1 - usual))
    return Counts(("a",), LEVELS, (share * answers)[None], np.full((1, 7), float(answers)))


def differencing_log_likelihood(counts: Counts) -> float:
    frames = np.column_stack([np.maximum(-LEVELS, 0), np.maximum(LEVELS, 0)])
    best = fits.fit(frames, counts.different.sum(axis=0)[None], counts.shown.sum(axis=0)[None])
    return float(best.log_likelihood[0])


def test_the_rule_that_made_the_answers_is_found_again() -> None:
    counts = odd_counts(3000)
    found = fit_independent(counts)
    assert found is not None
    assert found.criterion == pytest.approx(1.8, abs=0.01)
    assert found.slopes["shorter"] == pytest.approx(0.20, abs=0.003)
    assert found.slopes["longer"] == pytest.approx(0.25, abs=0.003)
    assert "support independent observations" in compare_rules(found, differencing_log_likelihood(counts)).answer


def test_differencing_answers_speak_for_differencing(same_different_study: Callable[..., pd.DataFrame]) -> None:
    frames = np.abs(LEVELS)
    share = norm.sf((2.2 - 0.35 * frames) / 2**0.5) + norm.cdf((-2.2 - 0.35 * frames) / 2**0.5)
    counts = Counts(("a",), LEVELS, (share * 3000)[None], np.full((1, 7), 3000.0))
    answer = compare_rules(fit_independent(counts), differencing_log_likelihood(counts)).answer
    assert "support differencing" in answer
    few = count_answers(same_different_study(np.random.default_rng(3), participants=2))
    assert compare_rules(fit_independent(few), None).log_likelihood_gain is None


def test_profile_intervals_end_where_the_likelihood_has_fallen_by_1_92() -> None:
    frames = np.abs(LEVELS)
    share = norm.sf((2.2 - 0.35 * frames) / 2**0.5) + norm.cdf((-2.2 - 0.35 * frames) / 2**0.5)
    shown = np.full(7, 120.0)
    different = np.round(share * shown)
    interval = profile_intervals(Counts(("a",), LEVELS, different[None], shown[None]))["longer"]
    both = np.column_stack([np.maximum(-LEVELS, 0), np.maximum(LEVELS, 0)])
    best = fits.fit(both, different[None], shown[None])
    assert interval.low is not None
    assert interval.high is not None
    for end in (interval.low, interval.high):

        def loss(point: np.ndarray, end: float = end) -> float:
            criterion, lapse = np.exp(point[:1]), np.clip(point[1:2], 0, 0.1)
            delta = threshold_delta(criterion, lapse, "different")
            slopes = np.array([[np.exp(point[2]), delta[0] / end]])
            p = np.clip(probability_different(both, criterion, lapse, slopes)[0], 1e-9, 1 - 1e-9)
            return -float((different * np.log(p) + (shown - different) * np.log1p(-p)).sum())

        found = minimize(loss, [np.log(2.2), 0.01, np.log(0.35)], method="Nelder-Mead", options={"maxiter": 2000})
        assert 2 * (best.log_likelihood[0] + found.fun) == pytest.approx(3.84, abs=0.1)


def test_order_is_tested_over_participants(same_different_study: Callable[..., pd.DataFrame]) -> None:
    alike = order_test(same_different_study(np.random.default_rng(1), participants=30))
    assert alike.p_value > 0.01
    assert abs(alike.difference_percent) < 5
    data = same_different_study(np.random.default_rng(2), participants=30)
    flip = data["reference_first"] & (np.random.default_rng(3).random(len(data)) < 0.7)
    data.loc[flip, "answer"] = "different"
    biased = order_test(data)
    assert biased.p_value < 0.001
    assert biased.difference_percent > 5
    assert biased.chi_square_p_value < 0.001


def test_degenerate_answers_are_said() -> None:
    nothing = Counts(("a",), LEVELS, np.zeros((1, 7)), np.full((1, 7), 6.0))
    assert fit_independent(nothing) is None
    assert profile_intervals(nothing) == {}
    one = pd.DataFrame({"participant": ["a"], "difference_frames": [5], "reference_first": [True], "answer": ["same"]})
    assert "same order" in order_test(one).note
    assert "not known" in order_test(one.drop(columns="reference_first")).note
    perfect = Counts(("a",), LEVELS, np.where(LEVELS == 0, 0, 6.0)[None], np.full((1, 7), 6.0))
    assert fit_independent(perfect) is not None
    assert set(profile_intervals(perfect)) == {"shorter", "longer"}
