"""Rank tests against scipy, against each other, and where there is nothing to rank."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from study.analysis.rank_tests import friedman, signed_rank


def test_signed_ranks_against_scipy() -> None:
    rng = np.random.default_rng(1)
    few, many = rng.normal(0.3, 1, 14), rng.normal(0.2, 1, 90)
    assert signed_rank(few) == pytest.approx(stats.wilcoxon(few, method="exact").pvalue)
    assert signed_rank(many) == pytest.approx(stats.wilcoxon(many, method="asymptotic", correction=False).pvalue)
    assert signed_rank([0.0, 0.0, 0.5]) is None


def test_friedman_against_scipy() -> None:
    values = np.random.default_rng(2).integers(0, 5, (18, 4)).astype(float)
    found = friedman(values)
    assert found is not None
    assert found.chi_square == pytest.approx(stats.friedmanchisquare(*values.T).statistic)
    assert (found.degrees_of_freedom, found.error_degrees_of_freedom) == (3, 51)


def test_friedman_keeps_its_level() -> None:
    rng = np.random.default_rng(3)
    p_values = []
    for _ in range(1500):
        found = friedman(rng.integers(0, 5, (12, 3)))
        p_values.append(1.0 if found is None else found.p_value)
    assert np.mean(np.array(p_values) < 0.05) == pytest.approx(0.05, abs=0.02)


def test_friedman_where_all_rank_alike_or_not_at_all() -> None:
    alike = friedman(np.tile([1.0, 2.0, 3.0], (5, 1)))
    assert alike is not None
    assert alike.f is None
    assert alike.p_value == pytest.approx(6.0**-4)
    assert friedman(np.ones((5, 3))) is None
    assert friedman(np.array([[1.0, 2.0]])) is None
