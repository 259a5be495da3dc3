"""Numbers of the same-different task that others have published.

- sensR 1.5 (an R package; the model of Christensen & Brockhoff 2009, Food Quality and Preference 20, 514): its
  documented example `samediff(8, 5, 4, 9)` and the same with ten times the counts. Read off a table of results that
  the package gave, which aigorahub/sensR keeps as tests/fixtures/golden_sensr.json.
- psyphy (Knoblauch, an R package): its documented examples of `dprime.SD` are one sensitivity under two rules, at 30%
  false alarms: 64.2% hits by differencing, 75% by independent observations. The formula of the second is that of
  Macmillan & Creelman 2005, chapter 9.
- 6.93 is the d-prime of 99% hits and 1% false alarms under differencing, where 4.65 is that of yes-no: ceilings that
  studies of speech quote from the tables of Kaplan, Macmillan & Creelman 1978 (recalled, not looked up).
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import norm

from study.analysis.same_different import fits
from study.analysis.same_different.d_prime import d_prime, independent_d_prime
from study.models.differencing import criterion_free_delta

FRAMES = np.array([[0.0], [1.0]])


@pytest.mark.parametrize(
    ("times", "log_likelihood", "criterion_error", "delta_error"),
    [(1, -16.6857627579, 0.34900448096, 0.70351563805), (10, -166.8576275789, 0.11036490734, 0.22247117858)],
)
def test_sensr_example(times: int, log_likelihood: float, criterion_error: float, delta_error: float) -> None:
    """8 of 13 same pairs "same", 9 of 13 different pairs "different"."""
    different, shown = times * np.array([5.0, 9.0]), times * np.array([13.0, 13.0])
    found = fits.fit(FRAMES, different[None], shown[None], lapse=0.0)
    assert found.criterion[0] == pytest.approx(1.2295508916, abs=1e-6)
    assert found.slopes[0, 0] == pytest.approx(1.8849964801, abs=1e-6)
    assert found.log_likelihood[0] == pytest.approx(log_likelihood, abs=1e-6)
    spread = np.sqrt(np.diagonal(fits.covariance(found, FRAMES, different, shown)))
    assert found.criterion[0] * spread[0] == pytest.approx(criterion_error, abs=1e-5)
    assert found.slopes[0, 0] * spread[2] == pytest.approx(delta_error, abs=1e-5)


def test_sensr_example_where_every_difference_was_seen() -> None:
    """`samediff(8, 5, 0, 9)`: d-prime has no bound above, and that is said."""
    low, high = fits.d_prime_interval(9, 9, 5, 13)
    assert high is None
    assert low > 1.0
    assert math.isfinite(d_prime(9, 9, 5, 13).d_prime or math.nan)


def test_the_interval_is_where_the_likelihood_has_fallen_by_1_92() -> None:
    def profile(delta: float) -> float:
        def at(criterion: float) -> float:
            alarm = 2 * norm.sf(criterion / math.sqrt(2))
            hit = norm.sf(criterion, delta, math.sqrt(2)) + norm.cdf(-criterion, delta, math.sqrt(2))
            return float(5 * np.log(alarm) + 8 * np.log1p(-alarm) + 9 * np.log(hit) + 4 * np.log1p(-hit))

        return max(at(criterion) for criterion in np.linspace(0.2, 4, 1501))

    low, high = fits.d_prime_interval(9, 13, 5, 13)
    assert high is not None
    assert 2 * (-16.6857627579 - profile(high)) == pytest.approx(norm.ppf(0.975) ** 2, abs=0.02)
    assert low == 0.0
    assert 2 * (-16.6857627579 - profile(0.0)) < norm.ppf(0.975) ** 2


def test_one_sensitivity_under_two_rules() -> None:
    pairs = 1e8
    differenced = d_prime(0.642 * pairs, pairs, 0.3 * pairs, pairs).d_prime
    independent = d_prime(0.75 * pairs, pairs, 0.3 * pairs, pairs).d_prime_independent
    assert differenced == pytest.approx(independent, abs=0.01)
    assert differenced == pytest.approx(1.95, abs=0.005)


def test_independent_observations_are_right_as_often_as_two_single_judgements_agree_with_the_pair() -> None:
    """psyphy gives 2.2655 for 80% hits and 25% false alarms; backwards by the unbiased observer's share of right."""
    found = independent_d_prime(0.8, 0.25)
    assert found == pytest.approx(2.2655, abs=5e-5)
    one = norm.cdf(found / 2)
    assert one**2 + (1 - one) ** 2 == pytest.approx(norm.cdf((norm.ppf(0.8) - norm.ppf(0.25)) / 2), abs=1e-9)
    assert independent_d_prime(0.2, 0.25) == 0.0


def test_ceiling_of_the_tables() -> None:
    pairs = 1e8
    assert d_prime(0.99 * pairs, pairs, 0.01 * pairs, pairs).d_prime == pytest.approx(6.93, abs=0.005)


def test_intervals_of_d_prime_cover_as_often_as_they_say() -> None:
    """60 pairs of each kind, d-prime 1.5; about 95% within what 150 tables tell."""
    rng, criterion, delta = np.random.default_rng(11), 1.4, 1.5
    hit = norm.sf(criterion, delta, math.sqrt(2)) + norm.cdf(-criterion, delta, math.sqrt(2))
    alarm = 2 * norm.sf(criterion / math.sqrt(2))
    inside = []
    for hits, alarms in zip(rng.binomial(60, hit, 150), rng.binomial(60, alarm, 150), strict=True):
        low, high = fits.d_prime_interval(hits, 60, alarms, 60)
        inside.append(low <= delta and (high is None or delta <= high))
    assert 0.9 <= np.mean(inside) <= 0.99


def test_the_criterion_free_threshold_is_that_of_the_best_proportion_correct() -> None:
    """Macmillan & Creelman 2005, chapter 9: an unbiased differencing observer, by a search of its own."""

    def best(delta: float) -> float:
        criteria = np.linspace(0, 6, 6001)
        hit = norm.sf(criteria, delta, math.sqrt(2)) + norm.cdf(-criteria, delta, math.sqrt(2))
        return float((0.5 + 0.5 * (hit - 2 * norm.sf(criteria / math.sqrt(2)))).max())

    assert criterion_free_delta(0.9) == pytest.approx(brentq(lambda d: best(d) - 0.9, 0.5, 8), abs=1e-4)
