"""The mixed design: against statsmodels, against sums over cells, and against a second way to epsilon."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from study.analysis.variance.repeated_measures import mixed_design


def rows_of(values: np.ndarray, groups: list[int], names: list[str]) -> dict[str, dict[str, float]]:
    found = mixed_design(values, groups, names)
    assert not isinstance(found, str)
    return {row.source: row for row in found}


def test_two_factors_within_against_statsmodels() -> None:
    from statsmodels.stats.anova import AnovaRM

    values = np.random.default_rng(1).normal(size=(10, 3, 4)) + np.arange(4) * 0.3
    found = rows_of(values, [0] * 10, ["method", "motion"])
    index = pd.MultiIndex.from_product([range(10), range(3), range(4)], names=["who", "method", "motion"])
    long = pd.DataFrame({"y": values.ravel()}, index=index).reset_index()
    expected = AnovaRM(long, "y", "who", within=["method", "motion"]).fit().anova_table
    for name, row in zip(["method", "motion", "method x motion"], expected.itertuples(), strict=True):
        assert found[name].f == pytest.approx(row[1])
        assert (found[name].degrees_of_freedom, found[name].error_degrees_of_freedom) == (row[2], row[3])
        assert found[name].p_value == pytest.approx(row[4])


def test_unequal_groups_against_contrasts_of_participants() -> None:
    """With two values a participant the tests are t tests of sums and differences, groups counting alike."""
    rng = np.random.default_rng(2)
    values, groups = rng.normal([0, 0.6], size=(17, 2)), [0] * 6 + [1] * 11
    found = rows_of(values, groups, ["method"])
    total, apart = values.sum(axis=1), values[:, 1] - values[:, 0]
    pooled = stats.ttest_ind(total[:6], total[6:])
    assert found["group"].f == pytest.approx(pooled.statistic**2)
    assert found["group"].p_value == pytest.approx(pooled.pvalue)
    crossed = stats.ttest_ind(apart[:6], apart[6:])
    assert found["method x group"].f == pytest.approx(crossed.statistic**2)
    means, error = [apart[:6].mean(), apart[6:].mean()], found["method"].error_sum_of_squares / 15 * 2
    unweighted = np.mean(means) / np.sqrt(error * (1 / 6 + 1 / 11) / 4)
    assert found["method"].f == pytest.approx(unweighted**2)
    assert found["method"].epsilon == 1


def test_epsilon_against_box_1954() -> None:
    """Box's formula from the covariances of the levels; independent of any choice of contrasts."""
    rng = np.random.default_rng(3)
    values = rng.normal(size=(14, 5)) @ rng.normal(size=(5, 5))
    found = rows_of(values, [0] * 14, ["method"])["method"]
    s = np.cov(values.T)
    top = 25 * (np.diag(s).mean() - s.mean()) ** 2
    below = 4 * ((s**2).sum() - 10 * (s.mean(axis=1) ** 2).sum() + 25 * s.mean() ** 2)
    assert found.epsilon == pytest.approx(top / below)
    expected = stats.f.sf(found.f, 4 * found.epsilon, 52 * found.epsilon)
    assert found.corrected_p_value == pytest.approx(expected)
    assert found.epsilon <= 1


def test_the_corrected_test_keeps_its_level_where_the_plain_one_does_not() -> None:
    rng = np.random.default_rng(4)
    shape = np.diag([0.3, 0.5, 1.0, 4.0])
    plain, corrected = [], []
    for _ in range(1000):
        row = rows_of(rng.normal(size=(12, 4)) @ shape, [0] * 12, ["method"])["method"]
        plain.append(row.p_value < 0.05)
        corrected.append(row.corrected_p_value < 0.05)
    assert np.mean(corrected) == pytest.approx(0.05, abs=0.022)
    assert np.mean(plain) > 0.075


def test_what_can_not_be_analysed_is_said() -> None:
    assert "too few" in mixed_design(np.ones((2, 2)), [0, 1], ["method"])
    assert "one level" in mixed_design(np.ones((6, 1)), [0] * 6, ["method"])
    same = rows_of(np.tile([1.0, 2.0], (6, 1)), [0, 0, 0, 1, 1, 1], ["method"])
    assert all(row.f is None and row.p_value is None for row in same.values())
