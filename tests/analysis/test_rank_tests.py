"""Rank tests against scipy, against each other, and where there is nothing to rank."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from study.analysis.rank_tests import anova_type, friedman, signed_rank

TWO_GROUPS = {"group": np.array([[1.0, -1.0]])}


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


def test_two_groups_are_compared_as_welch_compares_ranks() -> None:
    rng = np.random.default_rng(4)
    values = np.concatenate([rng.integers(0, 5, 15), rng.integers(1, 5, 22)]).astype(float)
    cells = np.repeat([0, 1], [15, 22])
    found = anova_type(values, cells, TWO_GROUPS)
    assert not isinstance(found, str)
    ranks = stats.rankdata(values)
    expected = stats.ttest_ind(ranks[:15], ranks[15:], equal_var=False)
    assert found[0].f == pytest.approx(expected.statistic**2)
    assert found[0].error_degrees_of_freedom == pytest.approx(expected.df)
    assert found[0].p_value == pytest.approx(expected.pvalue)


def test_a_two_by_two_design_keeps_its_level_with_unequal_spread() -> None:
    """Points on a scale, more scattered in one cell, with fewer people in it."""
    rng = np.random.default_rng(5)
    a, b = np.array([-1.0, -1, 1, 1]), np.array([-1.0, 1, -1, 1])
    contrasts = {"a": a[None], "b": b[None], "a x b": (a * b)[None]}
    sizes, spreads = (8, 14, 14, 16), (1.6, 0.8, 0.8, 0.8)
    wrong = np.zeros(3)
    for _ in range(1500):
        parts = [
            np.clip(np.round(2 + spread * rng.normal(size=n)), 0, 4) for n, spread in zip(sizes, spreads, strict=True)
        ]
        found = anova_type(np.concatenate(parts), np.repeat(np.arange(4), sizes), contrasts)
        assert not isinstance(found, str)
        wrong += [row.p_value < 0.05 for row in found]
    assert wrong / 1500 == pytest.approx(np.full(3, 0.05), abs=0.022)


def test_groups_without_spread_or_with_one_answer_are_said() -> None:
    assert "all alike" in anova_type([1.0, 1, 2, 2], [0, 0, 1, 1], TWO_GROUPS)
    assert "fewer than two" in anova_type([1.0, 2, 3], [0, 1, 1], TWO_GROUPS)
