"""What analyses share, against SciPy's own distributions."""

from __future__ import annotations

import pytest
from scipy.stats import binomtest

from study.analysis.estimates import binomial_probability


@pytest.mark.parametrize("trials", [1, 2, 7, 35, 280, 2000])
@pytest.mark.parametrize("expected", [0.5, 0.3, 0.91])
def test_exact_binomial_probability(trials: int, expected: float) -> None:
    for successes in range(0, trials + 1, max(1, trials // 13)):
        exact = binomtest(successes, trials, expected).pvalue
        assert binomial_probability(successes, trials, expected) == pytest.approx(exact, rel=1e-8)


def test_no_trials_give_no_probability() -> None:
    assert binomial_probability(0, 0) is None
