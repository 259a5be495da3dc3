"""Estimating equations against statsmodels' (BSD), and on data from which nothing can be estimated."""

from __future__ import annotations

import numpy as np
import pytest

from study.analysis.regression.estimating_equations import estimating_equations
from study.errors import AnalysisError


def answers_of(people: int, most: int, spread: float, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Answers of participants who differ, in unequal numbers."""
    rng = np.random.default_rng(seed)
    who = np.repeat(np.arange(people), rng.integers(1, most + 1, people))
    order = rng.choice([-0.5, 0.5], len(who))
    logit = 0.4 + 0.3 * order + spread * rng.standard_normal(people)[who]
    return np.column_stack([np.ones(len(who)), order]), (rng.random(len(who)) < 1 / (1 + np.exp(-logit))) * 1.0, who


@pytest.mark.parametrize(("people", "most", "spread", "seed"), [(35, 8, 1.0, 1), (12, 20, 2.0, 2), (60, 4, 0.0, 3)])
def test_the_same_numbers_as_statsmodels(people: int, most: int, spread: float, seed: int) -> None:
    from statsmodels.genmod.cov_struct import Exchangeable
    from statsmodels.genmod.families import Binomial
    from statsmodels.genmod.generalized_estimating_equations import GEE

    design, yes, who = answers_of(people, most, spread, seed)
    ours = estimating_equations(design, yes, who)
    structure = Exchangeable()
    theirs = GEE(yes, design, who, family=Binomial(), cov_struct=structure).fit(cov_type="bias_reduced")
    np.testing.assert_allclose(ours.values, theirs.params, atol=1e-5)
    np.testing.assert_allclose(ours.errors, theirs.bse, rtol=1e-4)
    assert ours.correlation == pytest.approx(float(structure.dep_params), abs=1e-4)


def test_names_of_participants_may_be_text_in_any_order() -> None:
    design, yes, who = answers_of(20, 6, 1.0, 4)
    shuffled = np.random.default_rng(0).permutation(len(who))
    names = np.array([f"p{number:03}" for number in who])[shuffled]
    np.testing.assert_allclose(
        estimating_equations(design[shuffled], yes[shuffled], names).errors,
        estimating_equations(design, yes, who).errors,
        rtol=1e-9,
    )


@pytest.mark.parametrize("answer", [0.0, 1.0])
def test_answers_all_alike_are_refused(answer: float) -> None:
    design, yes, who = answers_of(10, 5, 1.0, 5)
    with pytest.raises(AnalysisError, match="expected"):
        estimating_equations(design, np.full_like(yes, answer), who)


def test_answers_less_alike_than_a_working_correlation_can_be() -> None:
    """Each of four answers twice, once each way: the correlation is -1, which would divide by zero."""
    who, yes = np.repeat(np.arange(4), 2), np.array([0.0, 1, 1, 0, 0, 1, 1, 1])
    found = estimating_equations(np.ones((8, 1)), yes, who)
    assert -1 < found.correlation < 0
    assert found.values[0] == pytest.approx(np.log(5 / 3))
    plain = estimating_equations(np.ones((4, 1)), np.array([1.0, 1, 1, 0]), np.arange(4))
    assert plain.correlation == 0.0
    assert np.isfinite(found.errors).all()


def test_participants_who_never_waver_count_as_one_answer_each() -> None:
    """Every participant gives one answer throughout: six times as many answers say no more."""
    who = np.repeat(np.arange(8), 6)
    many = estimating_equations(np.ones((len(who), 1)), (who < 5) * 1.0, who)
    single = estimating_equations(np.ones((8, 1)), (np.arange(8) < 5) * 1.0, np.arange(8))
    assert many.values[0] == pytest.approx(np.log(5 / 3))
    assert many.errors[0] == pytest.approx(single.errors[0])
