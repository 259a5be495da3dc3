"""The differencing model: textbook values, recovery of known thresholds, coverage, and data that say nothing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import minimize
from scipy.stats import norm

from study.analysis.same_different import fits
from study.analysis.same_different.counts import Counts, count_answers
from study.analysis.same_different.d_prime import d_prime
from study.analysis.same_different.interpolation import crossings
from study.analysis.same_different.model import ModelFit, fit_model
from study.models.differencing import criterion_free_delta, detected

LEVELS = np.array([-15.0, -10, -5, 0, 5, 10, 20])
CRITERION, LAPSE = 2.2, 0.02


def shares_of_group(shorter: float, longer: float, criterion: float = CRITERION, lapse: float = LAPSE) -> np.ndarray:
    """Share of "different" at each level, from scipy's normal distribution and a root search of its own."""

    def share(delta: float) -> float:
        inside = norm.cdf(criterion, delta, np.sqrt(2)) - norm.cdf(-criterion, delta, np.sqrt(2))
        return lapse / 2 + (1 - lapse) * (1 - inside)

    low, high = 0.0, 30.0
    while high - low > 1e-12:
        middle = (low + high) / 2
        low, high = (middle, high) if share(middle) < 0.75 else (low, middle)
    return np.array([share(low * (-level / shorter if level < 0 else level / longer)) for level in LEVELS])


def draw(rng: np.random.Generator, shares: np.ndarray, participants: int, answers: int = 6) -> Counts:
    different = rng.binomial(answers, shares, size=(participants, len(LEVELS))).astype(float)
    names = tuple(f"p{i}" for i in range(participants))
    return Counts(names, LEVELS, different, np.full(different.shape, float(answers)))


def fitted(counts: Counts) -> ModelFit:
    fit = fit_model(counts)
    assert isinstance(fit, ModelFit), fit
    return fit


def test_the_model_is_the_published_one() -> None:
    """Macmillan & Creelman 2005, chapter 9: false alarms are 2 Phi(-k / sqrt 2); hits the two tails about d'."""
    criterion = np.array([1.5])
    assert detected(np.zeros(1), criterion)[0] == pytest.approx(2 * norm.cdf(-1.5 / np.sqrt(2)))
    expected = norm.cdf((2 - 1.5) / np.sqrt(2)) + norm.cdf((-2 - 1.5) / np.sqrt(2))
    assert detected(np.array([2.0]), criterion)[0] == pytest.approx(expected)


def test_d_prime_of_a_table_inverts_the_model() -> None:
    pairs, criterion, delta = 1e7, 1.8, 2.3
    alarm = 2 * norm.cdf(-criterion / np.sqrt(2))
    hit = norm.cdf((delta - criterion) / np.sqrt(2)) + norm.cdf((-delta - criterion) / np.sqrt(2))
    found = d_prime(hit * pairs, pairs, alarm * pairs, pairs)
    assert found.d_prime == pytest.approx(delta, abs=1e-4)
    assert found.criterion == pytest.approx(criterion, abs=1e-4)


@pytest.mark.parametrize(
    ("hits", "alarms", "expected"), [(8, 2, None), (2, 8, 0.0), (10, 0, None)], ids=["usual", "below chance", "perfect"]
)
def test_d_prime_stays_finite(hits: int, alarms: int, expected: float | None) -> None:
    value = d_prime(hits, 10, alarms, 10).d_prime
    assert value is not None
    assert np.isfinite(value)
    assert expected is None or value == expected
    assert d_prime(3, 10, 0, 0).d_prime is None


def test_the_criterion_free_threshold_is_where_the_best_criterion_gives_three_in_four() -> None:
    delta = criterion_free_delta(0.75)
    criteria = np.linspace(0, 8, 40001)
    gained = norm.sf(criteria, delta, np.sqrt(2)) + norm.cdf(-criteria, delta, np.sqrt(2))
    correct = 0.5 * gained + 0.5 * (1 - 2 * norm.sf(criteria / np.sqrt(2)))
    assert correct.max() == pytest.approx(0.75, abs=1e-6)


def test_the_fit_is_the_maximum_that_a_general_search_finds() -> None:
    counts = draw(np.random.default_rng(2), shares_of_group(8, 7), 12)
    different, shown = counts.different.sum(axis=0), counts.shown.sum(axis=0)
    frames = np.column_stack([np.maximum(-LEVELS, 0), np.maximum(LEVELS, 0)])
    best = fits.fit(frames, different[None], shown[None])

    def loss(point: np.ndarray) -> float:
        delta, criterion, lapse = frames @ np.exp(point[2:]), np.exp(point[0]), point[1]
        tails = norm.sf(criterion, delta, np.sqrt(2)) + norm.cdf(-criterion, delta, np.sqrt(2))
        share = np.clip(lapse / 2 + (1 - lapse) * tails, 1e-9, 1 - 1e-9)
        return -float((different * np.log(share) + (shown - different) * np.log1p(-share)).sum())

    start = [np.log(2.0), 0.02, np.log(0.3), np.log(0.3)]
    bounds = [(-6, 2.2), (0, 0.1), (-6, 2), (-6, 2)]
    found = minimize(loss, start, bounds=bounds, method="L-BFGS-B", options={"maxiter": 2000, "ftol": 1e-14})
    assert best.settled[0]
    assert best.log_likelihood[0] >= -found.fun - 1e-6
    assert best.criterion[0] == pytest.approx(np.exp(found.x[0]), rel=1e-2)
    assert best.slopes[0] == pytest.approx(np.exp(found.x[2:]), rel=1e-2)


def test_true_percentages_give_back_the_thresholds_exactly() -> None:
    shares = shares_of_group(8, 7)
    shown = np.full((4, 7), 1e4)
    fit = fitted(Counts(tuple("abcd"), LEVELS, shares * shown, shown))
    assert fit.jnd["shorter"].frames == pytest.approx(8.0, abs=1e-3)
    assert fit.jnd["longer"].frames == pytest.approx(7.0, abs=1e-3)
    assert fit.criterion == pytest.approx(CRITERION, abs=1e-3)
    assert fit.lapse == pytest.approx(LAPSE, abs=1e-3)


def test_straight_lines_are_biased_where_the_curve_is_bent_and_the_model_is_not() -> None:
    shares = shares_of_group(8, 7)
    shown = np.full((4, 7), 1e4)
    lines = crossings(Counts(tuple("abcd"), LEVELS, shares * shown, shown), resamples=10)
    assert (lines["longer"].frames or 0) > 7.3
    assert (lines["shorter"].frames or 0) > 8.1


@pytest.mark.slow
@pytest.mark.parametrize("participants", [8, 35])
def test_known_thresholds_are_recovered_and_intervals_cover(participants: int) -> None:
    """250 studies: no bias beyond 0.1 frame, standard errors that say how far estimates scatter, 95% that means it."""
    rng = np.random.default_rng(participants)
    shares, studies = shares_of_group(8, 7), 250
    found = np.zeros((studies, 2))
    errors, inside = np.zeros_like(found), np.zeros_like(found)
    for study in range(studies):
        jnd = fitted(draw(rng, shares, participants)).jnd
        for place, (side, truth) in enumerate((("shorter", 8.0), ("longer", 7.0))):
            low, high = jnd[side].interval.low, jnd[side].interval.high
            found[study, place] = jnd[side].frames or np.nan
            errors[study, place] = jnd[side].standard_error or np.nan
            inside[study, place] = (low or 0) <= truth <= (high or np.inf)
    assert np.isfinite(found).all()
    assert np.abs(found.mean(axis=0) - [8, 7]).max() < 0.1
    assert errors.mean(axis=0) / found.std(axis=0) == pytest.approx([1, 1], abs=0.2)
    assert 0.915 <= inside.mean() <= 0.985


def test_simulated_observers_are_recovered_within_their_standard_errors(
    same_different_study: Callable[..., pd.DataFrame],
) -> None:
    """2004's study one, 35 observers, several seeds: most estimates within one standard error, all within 3.5."""
    distances = []
    for seed in range(8):
        answers = same_different_study(np.random.default_rng(seed), criterion=CRITERION, lapse=LAPSE, missed=0.02)
        jnd = fitted(count_answers(answers)).jnd
        for side, truth in (("shorter", 8.0), ("longer", 7.0)):
            frames, error = jnd[side].frames, jnd[side].standard_error
            assert frames is not None
            assert error is not None
            distances.append((frames - truth) / error)
    assert np.abs(distances).max() < 3.5
    assert np.mean(np.abs(distances) < 1) > 0.4


def test_a_false_alarm_rate_moves_the_raw_threshold_and_not_the_corrected_one() -> None:
    """Two groups with the same sensitivity, d' of 0.4 a frame, one of them readier to say "different"."""
    thresholds = {}
    for criterion in (1.4, 2.6):
        delta = 0.4 * np.abs(LEVELS)
        shares = norm.sf(criterion, delta, np.sqrt(2)) + norm.cdf(-criterion, delta, np.sqrt(2))
        shown = np.full((4, 7), 1e4)
        fit = fitted(Counts(tuple("abcd"), LEVELS, shares * shown, shown))
        thresholds[criterion] = (fit.jnd["longer"].frames or 0, fit.corrected["longer"].frames or 0)
    assert thresholds[2.6][0] - thresholds[1.4][0] > 2
    assert thresholds[2.6][1] == pytest.approx(thresholds[1.4][1], abs=0.01)


def test_observers_who_differ_give_a_wider_interval_than_independent_answers() -> None:
    rng = np.random.default_rng(1)
    people = [shares_of_group(8 * f, 7 * f) for f in np.exp(0.6 * rng.normal(size=20))]
    different = np.array([rng.binomial(6, shares) for shares in people], dtype=float)
    counts = Counts(tuple(map(str, range(20))), LEVELS, different, np.full(different.shape, 6.0))
    together = Counts(("all",), LEVELS, different.sum(axis=0)[None], counts.shown.sum(axis=0)[None])
    by_people, by_answers = fitted(counts).jnd["longer"], fitted(together).jnd["longer"]
    assert by_people.frames == by_answers.frames
    assert (by_people.standard_error or 0) > 1.3 * (by_answers.standard_error or 0)


@pytest.mark.parametrize(
    ("shares", "reason"),
    [
        (np.zeros(7), 'every answer was "same"'),
        (np.ones(7), 'every answer was "different"'),
    ],
)
def test_answers_all_alike_are_not_fitted(shares: np.ndarray, reason: str) -> None:
    answer = fit_model(draw(np.random.default_rng(0), shares, 5))
    assert isinstance(answer, str)
    assert reason in answer


def test_no_pairs_without_a_difference() -> None:
    counts = draw(np.random.default_rng(0), shares_of_group(8, 7), 5)
    kept = LEVELS != 0
    answer = fit_model(Counts(counts.participants, LEVELS[kept], counts.different[:, kept], counts.shown[:, kept]))
    assert isinstance(answer, str)
    assert "criterion and sensitivity cannot be separated" in answer


def test_perfect_observers_have_no_threshold_to_estimate() -> None:
    fit = fitted(draw(np.random.default_rng(0), (LEVELS != 0).astype(float), 5))
    assert {threshold.status for threshold in fit.jnd.values()} == {"not estimable"}
    assert "bound" in fit.note


def test_guessing_observers_have_no_threshold_within_the_levels() -> None:
    fit = fitted(draw(np.random.default_rng(0), np.full(7, 0.4), 20))
    assert all(threshold.frames is None for threshold in fit.jnd.values())


def test_observers_above_threshold_from_the_start() -> None:
    shares = np.array([0.99, 0.97, 0.93, 0.85, 0.93, 0.97, 0.99])
    fit = fitted(draw(np.random.default_rng(0), shares, 30))
    assert {threshold.status for threshold in fit.jnd.values()} == {"above"}


def test_one_participant_gets_an_interval_that_says_what_it_rests_on() -> None:
    fit = fitted(draw(np.random.default_rng(5), shares_of_group(8, 7), 1, answers=30))
    for threshold in fit.jnd.values():
        assert threshold.frames is not None
        assert "one participant, answers treated as independent" in threshold.method


def test_the_same_answers_give_the_same_numbers() -> None:
    counts = draw(np.random.default_rng(5), shares_of_group(8, 7), 10)
    assert fit_model(counts) == fit_model(counts)


def test_the_error_of_d_prime_is_that_of_both_rates() -> None:
    """Delta method by hand: derivatives of the two rates by d' and by the criterion."""
    hits, alarms, pairs = 70, 20, 100
    found = d_prime(hits, pairs, alarms, pairs)
    assert found.d_prime is not None
    assert found.criterion is not None
    rates = np.array([hits + 0.5, alarms + 0.5]) / (pairs + 1)
    above, below = (norm.pdf((found.d_prime + sign * found.criterion) / 2**0.5) / 2**0.5 for sign in (-1, 1))
    by_d_prime, by_criterion = above - below, -(above + below)
    criterion_by_alarm = -1 / (2**0.5 * norm.pdf(found.criterion / 2**0.5))
    slopes = np.array([1 / by_d_prime, -by_criterion / by_d_prime * criterion_by_alarm])
    assert found.standard_error == pytest.approx(np.sqrt((slopes**2 * rates * (1 - rates) / pairs).sum()), rel=1e-3)
