"""Equivalence, Bayes factors, and Bradley-Terry where it can't be fitted."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from study.analysis.bradley_terry import BradleyTerry, fit_bradley_terry
from study.analysis.no_effect import bayes_factor_null, no_preference


def test_bayes_factors_printed_in_rouder_et_al_2009() -> None:
    """Page 232: t = 2.03 from 80 people, Cauchy prior of scale 1, is 1.56 to 1 for the null."""
    found = bayes_factor_null(2.03, 80, scale=1.0)
    assert found == pytest.approx(1.56, abs=0.005)
    assert (bayes_factor_null(0.0, 35) or 0) > 3
    assert (bayes_factor_null(6.0, 35) or 1) < 0.001


def test_equivalence_is_two_one_sided_tests() -> None:
    shares = np.random.default_rng(1).normal(0.52, 0.1, size=35)
    found = no_preference(shares, margin=0.1)
    above = ttest_1samp(shares, 0.4, alternative="greater").pvalue
    below = ttest_1samp(shares, 0.6, alternative="less").pvalue
    assert found.equivalence_p_value == pytest.approx(max(above, below))
    assert found.interval.low is not None
    assert found.interval.high is not None
    assert (found.equivalence_p_value < 0.05) == (found.interval.low > 0.4 and found.interval.high < 0.6)


@pytest.mark.parametrize("shares", [[], [0.5], [0.5] * 10, [1.0] * 10])
def test_no_certainty_without_spread(shares: list[float]) -> None:
    found = no_preference(shares)
    assert found.equivalence_p_value is None
    assert found.bayes_factor_null is None
    assert found.note


def test_methods_that_never_lose_have_no_finite_strength() -> None:
    found = fit_bradley_terry(list("abac"), list("bacb"), [10, 0, 5, 5], [10, 10, 10, 10], with_order=False)
    assert isinstance(found, BradleyTerry)
    always = fit_bradley_terry(list("aab"), list("bcc"), [10, 10, 5], [10] * 3, with_order=False, reference="b")
    assert isinstance(always, BradleyTerry)
    assert always.strengths[0].method == "a"
    assert always.strengths[0].value is None
    assert "a" in always.note


def test_unlinked_methods_are_said() -> None:
    assert "not linked" in str(fit_bradley_terry(list("ac"), list("bd"), [5, 5], [10, 10], with_order=False))
    assert "fewer than two" in str(fit_bradley_terry([], [], [], []))
