"""Mixed models: against direct integration and known groups; what can't be estimated is said."""

from __future__ import annotations

import time

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import quad
from scipy.special import expit
from scipy.stats import norm

from study.analysis.psychometric.mixed import psychometric_mixed
from study.analysis.regression.mixed import MixedFit, fit_mixed


def group(rng: np.random.Generator, people: int, answers: int, mean: float, spread: float) -> np.ndarray:
    return rng.binomial(answers, expit(mean + spread * rng.normal(size=people))).astype(float)


def test_the_likelihood_is_the_one_that_direct_integration_gives() -> None:
    yes = group(np.random.default_rng(1), 12, 8, 0.6, 1.0)
    fit = fit_mixed(np.ones((12, 1)), np.ones((12, 1)), yes, np.full(12, 8.0), range(12))
    assert isinstance(fit, MixedFit)
    mean, spread = fit.effects[0].value, fit.spread[0]

    def integrated(mean: float, spread: float) -> float:
        total = 0.0
        for count in yes:

            def density(b: float, count: float = count) -> float:
                p = expit(mean + b)
                return float(p**count * (1 - p) ** (8 - count) * norm.pdf(b, scale=spread))

            total += np.log(quad(density, -12, 12, epsabs=1e-14)[0])
        return total

    assert fit.log_likelihood == pytest.approx(integrated(mean, spread), abs=1e-5)
    for moved in ((0.02, 0.0), (-0.02, 0.0), (0.0, 0.02), (0.0, -0.02)):
        assert integrated(mean + moved[0], spread + moved[1]) < fit.log_likelihood
    error = fit.effects[0].standard_error
    assert error is not None
    assert error == pytest.approx(np.sqrt(spread**2 + 1 / (8 * 0.22)) / np.sqrt(12), rel=0.2)


def test_a_known_group_is_found_again_by_random_intercept_and_slope() -> None:
    rng = np.random.default_rng(2)
    levels = np.tile(np.arange(7.0), 60)
    who = np.repeat(np.arange(60), 7)
    own = rng.multivariate_normal([-3.0, 1.0], [[0.16, 0.02], [0.02, 0.04]], size=60)
    chance = norm.cdf(own[who, 0] + own[who, 1] * levels)
    trials = pd.DataFrame({"participant": who, "level": levels, "yes": rng.binomial(40, chance), "shown": 40})
    found = psychometric_mixed(trials)
    assert found.threshold == pytest.approx(3.0, abs=0.2)
    assert found.low < 3.0 < found.high
    assert found.slope == pytest.approx(1.0, abs=0.12)
    assert found.slope_spread == pytest.approx(0.2, abs=0.07)


@pytest.mark.parametrize(
    ("yes", "people", "says"),
    [([8, 8, 8], 3, "all answers are the same"), ([0, 0], 2, "all answers are the same"), ([4], 1, "one participant")],
)
def test_degenerate_groups_are_said(yes: list[int], people: int, says: str) -> None:
    found = fit_mixed(np.ones((people, 1)), np.ones((people, 1)), yes, np.full(people, 8.0), range(people))
    assert isinstance(found, str)
    assert says in found


def test_missing_cells_and_empty_data() -> None:
    design = np.column_stack([np.ones(4), np.zeros(4)])
    assert "can't be separated" in str(fit_mixed(design, np.ones((4, 1)), [1, 2, 3, 2], [4] * 4, range(4)))
    assert "no answers" in str(fit_mixed(design, np.ones((4, 1)), [0] * 4, [0] * 4, range(4)))
    everyone_the_same = fit_mixed(np.ones((6, 1)), np.ones((6, 1)), [4] * 6, [8] * 6, range(6))
    assert isinstance(everyone_the_same, MixedFit)
    assert "spread" in everyone_the_same.note


def test_eight_participants_are_fast() -> None:
    """Ten times what benchmarks/calibration.py measures would still pass."""
    rng = np.random.default_rng(6)
    levels, who = np.tile(np.linspace(-1.5, 1.5, 7), 8), np.repeat(np.arange(8), 7)
    design = np.column_stack([np.ones(56), levels])
    own = rng.normal(size=(8, 2)) * 0.4 + [0.3, 1.5]
    yes = rng.binomial(30, norm.cdf((own[who] * design).sum(axis=1)))
    start = time.perf_counter()
    fit = fit_mixed(design, design, yes, np.full(56, 30), who, link="probit")
    assert time.perf_counter() - start < 2.0
    assert isinstance(fit, MixedFit)
