"""Cumulative-link mixed models: against direct integration and known groups; what can't be estimated is said."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import expit
from scipy.stats import norm

from study.analysis.regression.ordinal import OrdinalFit, fit_ordinal


def drawn(rng: np.random.Generator, people: int, effect: float, spread: float) -> tuple[np.ndarray, ...]:
    """Five points, two ratings of each of two methods a participant."""
    who, method = np.repeat(np.arange(people), 4), np.tile([0.0, 0, 1, 1], people)
    lean = effect * method + spread * rng.normal(size=people)[who]
    noise = np.log(1 / rng.random(len(who)) - 1)
    return np.searchsorted([-2.0, -0.7, 0.7, 2.0], lean + noise).astype(float), method[:, None], who


def test_the_likelihood_is_the_one_that_direct_integration_gives() -> None:
    ratings, design, who = drawn(np.random.default_rng(1), 10, 1.0, 1.2)
    fit = fit_ordinal(design, ratings, who, nodes=15)
    assert isinstance(fit, OrdinalFit)
    edges = np.array([-np.inf, *fit.thresholds, np.inf])
    code = np.searchsorted(fit.points, ratings)
    total = 0.0
    for person in range(10):
        rows = who == person

        def density(b: float, rows: np.ndarray = rows) -> float:
            eta = fit.effects[0].value * design[rows, 0] + b
            chance = expit(edges[code[rows] + 1] - eta) - expit(edges[code[rows]] - eta)
            return float(chance.prod() * norm.pdf(b, scale=fit.spread))

        total += np.log(quad(density, -12, 12, epsabs=1e-15)[0])
    assert fit.log_likelihood == pytest.approx(total, abs=1e-4)


def test_a_known_group_is_found_again() -> None:
    ratings, design, who = drawn(np.random.default_rng(2), 300, 1.0, 1.2)
    fit = fit_ordinal(design, ratings, who, names=("method",))
    assert isinstance(fit, OrdinalFit)
    effect = fit.effects[0]
    assert effect.interval.low is not None
    assert effect.interval.high is not None
    assert effect.interval.low < 1.0 < effect.interval.high
    assert fit.spread == pytest.approx(1.2, abs=0.25)
    assert fit.thresholds == pytest.approx((-2.0, -0.7, 0.7, 2.0), abs=0.3)


def test_without_spread_it_is_the_proportional_odds_model_of_statsmodels() -> None:
    from statsmodels.miscmodels.ordinal_model import OrderedModel

    ratings, design, who = drawn(np.random.default_rng(3), 60, 0.8, 0.0)
    fit = fit_ordinal(design, ratings, who)
    assert isinstance(fit, OrdinalFit)
    expected = OrderedModel(ratings, design, distr="logit").fit(method="bfgs", disp=False)
    assert fit.spread < 0.05
    assert fit.effects[0].value == pytest.approx(expected.params[0], abs=2e-3)
    assert fit.log_likelihood == pytest.approx(expected.llf, abs=1e-3)


def test_points_that_nobody_chose_have_no_threshold() -> None:
    ratings, design, who = drawn(np.random.default_rng(4), 30, 0.5, 0.5)
    ratings[ratings == 2] = 3
    fit = fit_ordinal(design, ratings, who)
    assert isinstance(fit, OrdinalFit)
    assert fit.points == (0.0, 1.0, 3.0, 4.0)
    assert len(fit.thresholds) == 3


def test_separated_ratings_have_no_standard_error() -> None:
    fit = fit_ordinal(np.tile([[0.0], [1.0]], (10, 1)), np.tile([1.0, 4.0], 10), np.repeat(np.arange(10), 2))
    assert isinstance(fit, OrdinalFit)
    assert fit.effects[0].standard_error is None
    assert fit.effects[0].p_value is None
    assert fit.note


@pytest.mark.parametrize(
    ("ratings", "who", "says"),
    [
        ([], [], "no answers"),
        ([1, 2, 3], [0, 0, 0], "one participant"),
        ([2, 2, 2], [0, 1, 2], "all ratings alike"),
        ([1, 2, 3], [0, 1, 2], "can't be separated"),
    ],
)
def test_hopeless_ratings_are_said(ratings: list[int], who: list[int], says: str) -> None:
    assert says in str(fit_ordinal(np.ones((len(ratings), 1)), ratings, who))
