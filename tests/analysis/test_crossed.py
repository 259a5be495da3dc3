"""A share over participants and motions: against textbook formulas, other programs' least squares, and simulation."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from study.analysis.crossed import FEW_GROUPS, OVER_BOTH, between_motions, crossed, general_test
from study.analysis.preference.default_test import p_values_of_studies
from study.analysis.preference.participants import default_p_values


def mean_squares(shares: np.ndarray) -> tuple[float, float, float]:
    """Of participants, motions and the rest of a complete table, by the textbook's sums of squares."""
    people, motions = shares.shape
    rows, columns, mean = shares.mean(axis=1), shares.mean(axis=0), shares.mean()
    rest = sum(
        (shares[i, j] - rows[i] - columns[j] + mean) ** 2 for i in range(people) for j in range(motions)
    )  # fmt: skip
    return (
        motions * sum((row - mean) ** 2 for row in rows) / (people - 1),
        people * sum((column - mean) ** 2 for column in columns) / (motions - 1),
        rest / ((people - 1) * (motions - 1)),
    )


def test_a_complete_table_gives_the_quasi_f_of_clark() -> None:
    rng = np.random.default_rng(4)
    lean = 0.9 * rng.standard_normal((20, 1)) + 0.9 * rng.standard_normal((1, 6))
    chosen = rng.binomial(4, 1 / (1 + np.exp(-lean - 0.4)))
    own, other, rest = mean_squares(chosen / 4)
    assert min(own, other) > 1.5 * rest, "both components are kept"
    found = crossed(chosen, 4)
    variance = own + other - rest
    parts = [
        ((1 + FEW_GROUPS / one * np.sqrt(rest / square)) * square) ** 2 / one for square, one in ((own, 19), (other, 5))
    ]
    freedom = variance**2 / (sum(parts) + rest**2 / 95)
    assert found.mean == pytest.approx(chosen.mean() / 4)
    assert found.error == pytest.approx(np.sqrt(variance / 120))
    assert found.freedom == pytest.approx(freedom)
    expected = 2 * stats.t.sf(abs(chosen.mean() / 4 - 0.5) / np.sqrt(variance / 120), freedom)
    assert found.p_values() == pytest.approx(expected)


def test_components_below_chance_join_the_rest() -> None:
    """Participants who all answer alike over motions that differ: only the motions' variance is left."""
    chosen = np.tile([[3, 1, 4, 0], [1, 3, 0, 4]], (8, 1)) * 1.0
    own, other, rest = mean_squares(chosen / 4)
    assert own < rest
    assert other < rest
    found = crossed(chosen, 4)
    pooled = (own * 15 + other * 3 + rest * 45) / 63
    assert found.error == pytest.approx(np.sqrt(pooled / 64))
    assert found.freedom == pytest.approx(63)


def test_without_a_rest_both_components_are_kept() -> None:
    """Participants and motions add up exactly: no rest, and the variance of the mean is that of both."""
    shares = np.array([[0.0], [0.25], [0.5]]) + np.array([[0.0, 0.125, 0.375, 0.5]])
    own, other, rest = mean_squares(shares)
    assert rest == pytest.approx(0, abs=1e-15)
    assert crossed(8 * shares, 8).error == pytest.approx(np.sqrt((own + other) / 12))


def test_missing_answers_are_met_by_least_squares() -> None:
    rng = np.random.default_rng(8)
    shown = rng.integers(0, 4, (15, 5)).astype(float)
    chosen = rng.binomial(shown.astype(int), 0.6).astype(float)
    there = shown > 0
    person, motion = np.nonzero(there)
    design = np.zeros((len(person), 20))
    design[np.arange(len(person)), person] = 1
    design[np.arange(len(person)), 15 + motion] = 1
    root = np.sqrt(shown[there])
    fit, *_ = np.linalg.lstsq(root[:, None] * design, root * chosen[there] / shown[there], rcond=None)
    left = shown[there] * (chosen[there] / shown[there] - design @ fit)
    answers, share = shown.sum(), chosen.sum() / shown.sum()
    apart = chosen - shown * share
    freedom = int(there.sum()) - 19
    rest = (left**2).sum() * there.sum() / freedom / answers**2
    sums = [(apart.sum(axis=axis) ** 2).sum() * count / (count - 1) / answers**2 for axis, count in ((1, 15), (0, 5))]
    least = {15: 0.25, 5: 0.3}  # from 0.5 for three groups to 0.25 for six and more
    keep = [stats.f.sf(one / rest, count - 1, freedom) < least[count] for one, count in zip(sums, (15, 5), strict=True)]
    pooled = (rest * freedom + sum(s * d for s, d, k in zip(sums, (14, 4), keep, strict=True) if not k)) / (
        freedom + sum(d for d, k in zip((14, 4), keep, strict=True) if not k)
    )
    variance = sum(s for s, k in zip(sums, keep, strict=True) if k) + (1 - sum(keep)) * pooled
    assert crossed(chosen, shown).error == pytest.approx(np.sqrt(max(variance, pooled)), rel=1e-8)


def test_many_studies_at_once_are_each_one_alone() -> None:
    rng = np.random.default_rng(5)
    shown = rng.integers(0, 3, (30, 9, 4))
    chosen = rng.binomial(shown, 0.5)
    together = crossed(chosen, shown)
    for place in range(30):
        alone = crossed(chosen[place], shown[place])
        assert together.error[place] == pytest.approx(float(alone.error), rel=1e-9, nan_ok=True)
        assert together.freedom[place] == pytest.approx(float(alone.freedom), rel=1e-9, nan_ok=True)


@pytest.mark.parametrize("motions_sd", [0.0, 0.5, 1.0])
@pytest.mark.parametrize(("people", "motions"), [(12, 3), (35, 4), (20, 8)])
def test_a_test_over_both_keeps_its_size_and_its_interval_covers(people: int, motions: int, motions_sd: float) -> None:
    """With no effect and with one of 0.6 logits, errors at .05 stay below .08, however motions differ."""
    rng = np.random.default_rng([people, motions, int(10 * motions_sd)])
    for effect in (0.0, 0.6):
        size = (2500, people, motions)
        lean = (
            effect + 0.6 * rng.standard_normal((2500, people, 1)) + motions_sd * rng.standard_normal((2500, 1, motions))
        )
        chosen = rng.binomial(2, 1 / (1 + np.exp(-lean)), size=size)
        noise = np.hypot(0.6, motions_sd) * rng.standard_normal(400_000)
        wrong = (crossed(chosen, 2).p_values((1 / (1 + np.exp(-effect - noise))).mean()) < 0.05).mean()
        assert 0.008 < wrong < 0.08, (effect, wrong)


def test_the_default_test_of_many_studies_is_over_both_where_motions_are_enough() -> None:
    rng = np.random.default_rng(6)
    chosen = rng.binomial(2, 0.6, (40, 12, 5))
    np.testing.assert_allclose(p_values_of_studies(chosen, np.full(chosen.shape, 2)), crossed(chosen, 2).p_values())
    few = p_values_of_studies(chosen[..., :2], np.full((40, 12, 2), 2))
    np.testing.assert_allclose(few, default_p_values(chosen[..., :2].sum(axis=-1), np.full((40, 12), 4)))
    alike = np.full((1, 12, 5), 2.0)
    np.testing.assert_allclose(
        p_values_of_studies(alike, alike), default_p_values(alike.sum(axis=-1), alike.sum(axis=-1))
    )
    assert OVER_BOTH.startswith("Student")


@pytest.mark.parametrize("motions_sd", [0.0, 0.4, 1.0])
@pytest.mark.parametrize(("people", "motions"), [(12, 3), (26, 8)])
def test_means_of_ratings_keep_their_size(people: int, motions: int, motions_sd: float) -> None:
    """Where a method suits some motions better (by normal deviates) and nothing else, errors at .05 stay below .08."""
    rng = np.random.default_rng([people, motions, int(10 * motions_sd), 2])
    size = (2500, people, motions)
    lean = 0.3 * rng.standard_normal((2500, people, 1)) + motions_sd * rng.standard_normal((2500, 1, motions))
    wrong = (crossed(lean + 1.3 * rng.standard_normal(size), np.ones(size)).p_values(0.0) < 0.05).mean()
    assert 0.01 < wrong < 0.08


def test_a_table_of_ratings_has_the_test_over_both_or_over_participants() -> None:
    rng = np.random.default_rng(9)
    table = rng.standard_normal((14, 1)) + rng.standard_normal((1, 5)) + 0.5 * rng.standard_normal((14, 5)) + 0.4
    rows = pd.DataFrame(table, index=[f"p{row}" for row in range(14)]).stack()
    found = general_test(rows)
    own, other, rest = mean_squares(table)
    assert found.standard_error == pytest.approx(np.sqrt((own + other - rest) / 70))
    assert (found.test, found.generalises_to) == (OVER_BOTH, "participants and motions")
    two = general_test(rows[rows.index.get_level_values(1) < 2])
    assert two.p_value == pytest.approx(stats.ttest_1samp(table[:, :2].mean(axis=1), 0.0).pvalue)
    assert two.generalises_to == "participants, for these motions"


def test_where_motions_decide_all_the_test_is_students_of_their_means() -> None:
    rng = np.random.default_rng(10)
    lean = 300 * rng.standard_normal((1, 3)) + rng.standard_normal((14, 3))
    found = crossed(lean, np.ones(lean.shape))
    assert found.p_values(0.0) == pytest.approx(stats.ttest_1samp(lean.mean(axis=0), 0.0).pvalue, rel=0.01)
    between = between_motions(lean[0], np.eye(3) * 1e-6)
    assert between.added == pytest.approx(lean[0].var(ddof=1) / 3)
    assert between.added**2 / between.satterthwaite == pytest.approx(2, rel=0.01)


def test_motions_that_differ_as_chance_has_it_add_nothing() -> None:
    """Five motions are kept where their F gives p below .3, whatever participants add to every motion."""
    rng = np.random.default_rng(11)
    covariance = 0.3 * np.eye(5) + 2.0
    drawn = rng.multivariate_normal(np.zeros(5), covariance, size=1000)
    added = np.array([between_motions(one, covariance).added for one in drawn])
    assert (added == 0).mean() == pytest.approx(0.7, abs=0.05)
    assert added.mean() < 0.05
