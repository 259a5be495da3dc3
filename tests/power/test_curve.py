"""Power: against the normal theory of a known test; participants' spread as stated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.special import expit
from scipy.stats import nct, t

from study.errors import AnalysisError
from study.power.curve import power_curve
from study.power.preference import logit_normal


def t_tests(rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> np.ndarray:
    """One-sided t tests of a mean of half a standard deviation."""
    drawn = rng.normal(0.5, 1.0, (studies, max(sizes)))
    own = [drawn[:, :size] for size in sizes]
    statistics = [part.mean(axis=1) / part.std(axis=1, ddof=1) * part.shape[1] ** 0.5 for part in own]
    return np.column_stack([s > t.ppf(0.975, size - 1) for s, size in zip(statistics, sizes, strict=True)])


@pytest.mark.parametrize("at_once", [1, 400])
def test_a_t_test_has_the_power_that_theory_gives(at_once: int) -> None:
    found = power_curve(t_tests, [40, 10, 20], studies=1500, target=0.8, seed=1, at_once=at_once)
    for point in found.points:
        size = point.participants
        theory = nct.sf(t.ppf(0.975, size - 1), size - 1, 0.5 * size**0.5)
        assert point.studies == 1500
        assert point.power == pytest.approx(theory, abs=0.04)
    assert found.needed is not None
    assert 29 <= found.needed <= 38
    assert power_curve(t_tests, [5], studies=50).needed is None


@pytest.mark.parametrize(
    ("share", "correlation", "bias"), [(0.5, 0.2, 0), (0.65, 0.1, 0), (0.9, 0.3, 0), (0.65, 0.0, 0), (0.7, 0.1, 0.8)]
)
def test_people_differ_as_stated(share: float, correlation: float, bias: float) -> None:
    mean, spread = logit_normal(share, correlation, bias)
    lean = mean + spread * np.random.default_rng(0).normal(size=400_000)
    own = (expit(lean + bias) + expit(lean - bias)) / 2
    assert own.mean() == pytest.approx(share, abs=0.003)
    assert own.var() / (share * (1 - share)) == pytest.approx(correlation, abs=0.005)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: power_curve(t_tests, []), "participants from 2 on"),
        (lambda: power_curve(t_tests, [5], target=1.5), "a power between 0 and 1"),
        (lambda: logit_normal(1.0, 0.1), "a share between 0 and 1"),
    ],
)
def test_refusals(call: object, message: str) -> None:
    with pytest.raises(AnalysisError, match=message):
        call()  # type: ignore[operator]
