"""Psychometric functions: known observers are found again, nothing is made up where the data don't tell."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import betabinom, gumbel_l, logistic, norm

from study.analysis.psychometric.likelihood import LikelihoodFit, fit_likelihood
from study.analysis.psychometric.model import make_model
from study.analysis.psychometric.posterior import PsychometricFit, curve_of, fit_psychometric, threshold_at
from study.errors import AnalysisError
from study.models import posterior_grid

LEVELS = np.arange(1.0, 8.0)
PEERS = {"normal": norm, "logistic": logistic, "gumbel": gumbel_l}


def share(sigmoid: str, threshold: float, width: float, guess: float, lapse: float) -> np.ndarray:
    """P("yes") by scipy's distributions."""
    peer = PEERS["gumbel" if sigmoid == "weibull" else sigmoid]
    axis, place = (np.log(LEVELS), np.log(threshold)) if sigmoid == "weibull" else (LEVELS, threshold)
    scale = width / (peer.ppf(0.95) - peer.ppf(0.05))
    return guess + (1 - guess - lapse) * peer.cdf((axis - place) / scale + peer.ppf(0.5))


def fitted(yes: np.ndarray, shown: np.ndarray, model: object = None) -> PsychometricFit:
    fit = fit_psychometric(LEVELS, yes, shown, model)  # type: ignore[arg-type]
    assert isinstance(fit, PsychometricFit)
    return fit


@pytest.mark.parametrize("sigmoid", ["normal", "logistic", "gumbel", "weibull"])
@pytest.mark.parametrize("task", ["2afc", "yes-no"])
def test_a_known_observer_is_found_again(sigmoid: str, task: str) -> None:
    width = 0.9 if sigmoid == "weibull" else 3.0
    guess = 0.5 if task == "2afc" else 0.08
    shown = np.full(7, 4000.0)
    yes = np.round(share(sigmoid, 4.2, width, guess, 0.03) * shown)
    model = make_model(task, sigmoid=sigmoid)
    fit, best = fitted(yes, shown, model), fit_likelihood(LEVELS, yes, shown, model)
    assert isinstance(best, LikelihoodFit)
    assert best.threshold == pytest.approx(4.2, abs=0.02)
    assert best.width == pytest.approx(width, rel=0.03)
    assert best.lapse == pytest.approx(0.03, abs=0.005)
    assert best.guess == pytest.approx(guess, abs=0.01)
    assert fit.threshold.value == pytest.approx(4.2, abs=0.06)
    assert fit.width.value == pytest.approx(width, rel=0.1)
    assert fit.threshold.interval.low is not None
    assert fit.threshold.interval.high is not None
    assert fit.threshold.interval.low < 4.2 < fit.threshold.interval.high


def test_the_grid_gives_the_posterior_that_a_plain_sum_gives() -> None:
    """Against a sum over a finer grid with scipy's beta-binomial and the same priors."""
    rng = np.random.default_rng(4)
    shown = np.full(7, 30.0)
    yes = rng.binomial(30, share("normal", 4, 3, 0.5, 0.02)).astype(float)
    fit = fitted(yes, shown)
    thresholds, widths, lapses = np.linspace(-1.9, 9.9, 119), np.linspace(np.log(0.25), np.log(24), 61), None
    lapses = (np.arange(25) + 0.5) / 100
    scale = np.exp(widths) / (norm.ppf(0.95) - norm.ppf(0.05))
    seen = norm.cdf((LEVELS[:, None, None] - thresholds[:, None]) / scale)
    p = 0.5 + (0.5 - lapses) * seen[..., None]
    edges = posterior_grid.OVERDISPERSION_EDGES
    mass = np.zeros(p.shape[1:])
    for excess, prior in zip(
        posterior_grid.OVERDISPERSION,
        -np.diff((1 - edges) ** posterior_grid.OVERDISPERSION_POWER),
        strict=True,
    ):
        size = 1 / max(excess, 1e-4) ** 2 - 1
        logs = betabinom.logpmf(yes[:, None, None, None], 30, p * size, (1 - p) * size).sum(axis=0)
        mass += prior * np.exp(logs + 100)
    outer, inner = posterior_grid.prior_limits(LEVELS)
    for axis, nodes in enumerate((thresholds, widths)):
        below = np.clip((inner[axis][0] - nodes) / (inner[axis][0] - outer[axis][0]), 0, 1)
        above = np.clip((nodes - inner[axis][1]) / (outer[axis][1] - inner[axis][1]), 0, 1)
        taper = 0.5 + 0.5 * np.cos(np.pi * np.maximum(below, above))
        mass *= taper.reshape((-1, 1, 1) if axis == 0 else (-1, 1))
    mass *= (1 - lapses) ** (posterior_grid.LAPSE_POWER - 1)
    marginal = mass.sum(axis=(1, 2)) / mass.sum()
    low, median, high = np.interp([0.025, 0.5, 0.975], np.cumsum(marginal), thresholds + 0.05)
    assert fit.threshold.value == pytest.approx(median, abs=0.03)
    assert fit.threshold.interval.low == pytest.approx(low, abs=0.08)
    assert fit.threshold.interval.high == pytest.approx(high, abs=0.08)


def test_the_maximum_is_the_one_a_general_search_finds() -> None:
    rng = np.random.default_rng(5)
    shown = np.full(7, 40.0)
    yes = rng.binomial(40, share("logistic", 4, 3, 0.1, 0.05)).astype(float)
    best = fit_likelihood(LEVELS, yes, shown, make_model("yes-no", sigmoid="logistic"))
    assert isinstance(best, LikelihoodFit)

    def loss(point: np.ndarray) -> float:
        p = np.clip(share("logistic", point[0], np.exp(point[1]), point[3], point[2]), 1e-9, 1 - 1e-9)
        return -float((yes * np.log(p) + (shown - yes) * np.log1p(-p)).sum())

    bounds = [(0, 8), (-1, 3), (0, 0.25), (0, 0.5)]
    found = minimize(loss, [4, 1, 0.02, 0.05], bounds=bounds, method="L-BFGS-B", options={"ftol": 1e-14})
    assert best.log_likelihood >= -found.fun - 1e-6
    assert best.threshold == pytest.approx(found.x[0], abs=0.01)


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    rng = np.random.default_rng(6)
    yes = rng.binomial(40, share("normal", 4, 3, 0.5, 0.02), size=(150, 7))
    inside = []
    for fit in (fit_psychometric(LEVELS, one, np.full(7, 40)) for one in yes):
        assert isinstance(fit, PsychometricFit)
        low, high = fit.threshold.interval.low, fit.threshold.interval.high
        inside.append((low is None or low < 4) and (high is None or high > 4))
    assert 0.9 <= np.mean(inside) <= 0.995


def test_the_profile_interval_is_where_the_likelihood_falls_by_1_92() -> None:
    shown = np.full(7, 60.0)
    yes = np.round(share("normal", 4, 3, 0.0, 0.0) * shown)
    model = make_model("yes-no", guess=0.0, lapse=0.0)
    best = fit_likelihood(LEVELS, yes, shown, model)
    assert isinstance(best, LikelihoodFit)

    def profiled(threshold: float) -> float:
        def loss(width: np.ndarray) -> float:
            p = np.clip(share("normal", threshold, float(np.exp(width[0])), 0, 0), 1e-9, 1 - 1e-9)
            return -float((yes * np.log(p) + (shown - yes) * np.log1p(-p)).sum())

        return -float(minimize(loss, [1.0], method="Nelder-Mead").fun)

    for end in (best.interval.low, best.interval.high):
        assert end is not None
        assert 2 * (best.log_likelihood - profiled(end)) == pytest.approx(3.84, abs=0.03)


def test_deviance_tells_a_curve_that_does_not_follow() -> None:
    shown = np.full(7, 50.0)
    good = fit_likelihood(LEVELS, np.round(share("normal", 4, 3, 0.5, 0.0) * 50), shown, simulations=200)
    bad = fit_likelihood(LEVELS, [26, 48, 27, 47, 28, 49, 30], shown, simulations=200)
    assert isinstance(good, LikelihoodFit)
    assert isinstance(bad, LikelihoodFit)
    assert good.p_value is not None
    assert bad.p_value is not None
    assert good.p_value > 0.5
    assert bad.p_value < 0.02
    assert bad.dispersion is not None
    assert bad.dispersion > 3


def test_a_threshold_at_another_share() -> None:
    shown = np.full(7, 5000.0)
    fit = fitted(np.round(share("normal", 4, 3, 0.5, 0.0) * shown), shown)
    scale = 3 / (norm.ppf(0.95) - norm.ppf(0.05))
    found = threshold_at(fit, 0.6)
    assert found.value == pytest.approx(4 + scale * norm.ppf(0.2), abs=0.1)
    assert threshold_at(fit, 0.999).value is None
    curve = np.array(curve_of(fit))
    assert np.interp(4, *curve.T) == pytest.approx(0.75, abs=0.02)


@pytest.mark.parametrize(
    ("yes", "says"),
    [
        ([20] * 7, "below the levels"),
        ([0] * 7, "above the levels"),
        ([20, 18, 15, 10, 8, 4, 1], "does not rise"),
    ],
)
def test_what_the_data_do_not_tell_is_said(yes: list[int], says: str) -> None:
    fit = fitted(np.array(yes), np.full(7, 20), make_model("yes-no"))
    assert fit.threshold.value is None
    assert says in fit.note
    best = fit_likelihood(LEVELS, yes, np.full(7, 20), make_model("yes-no"))
    assert isinstance(best, LikelihoodFit)


def test_degenerate_data_are_said_not_crashed() -> None:
    assert "no answers" in str(fit_psychometric([], [], []))
    assert "one level only" in str(fit_psychometric([3], [10], [20]))
    assert "no answers" in str(fit_likelihood([1, 2], [0, 0], [0, 0]))
    two = fit_psychometric([1, 2], [10, 20], [20, 20])
    assert isinstance(two, PsychometricFit)
    sparse = fit_psychometric([1, 2, 3], [0, 1, 1], [1, 1, 1], make_model("yes-no"))
    assert isinstance(sparse, PsychometricFit)
    assert sparse.threshold.interval.low is None or sparse.threshold.interval.high is None
    chance = fit_psychometric(LEVELS, [10, 11, 9, 10, 10, 9, 11], [20] * 7)
    assert isinstance(chance, PsychometricFit)
    assert chance.threshold.value is None or chance.threshold.interval.high is None


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: fit_psychometric([1, 2], [3, 30], [20, 20]), "found 30 of 20 at level 2"),
        (lambda: fit_psychometric([1, 2, 3], [3, 3], [20, 20]), "one shape"),
        (lambda: fit_psychometric([1, np.nan], [3, 3], [20, 20]), "finite"),
        (lambda: make_model("3afc"), "expected the task 2afc or yes-no, found '3afc'"),
        (lambda: make_model(sigmoid="probit"), "expected one of the sigmoids normal"),
        (lambda: make_model("yes-no", guess=1.5), "guess rate from 0 to below 1"),
        (lambda: fit_psychometric([0, 1], [3, 3], [9, 9], make_model(sigmoid="weibull")), "levels above 0"),
    ],
)
def test_refusals(call: object, message: str) -> None:
    with pytest.raises(AnalysisError, match=message):
        call()  # type: ignore[operator]


def test_speed_is_of_the_right_order() -> None:
    """Far above what benchmarks/calibration.py measures (2 and 20 ms), so that a busy machine does not fail it."""
    rng = np.random.default_rng(7)
    yes = rng.binomial(40, share("normal", 4, 3, 0.5, 0.02), size=(10, 7))
    fit_psychometric(LEVELS, yes[0], [40] * 7)
    start = time.perf_counter()
    for one in yes:
        fit_psychometric(LEVELS, one, np.full(7, 40))
    assert (time.perf_counter() - start) / 10 < 0.03


def test_a_threshold_at_another_share_of_a_sigmoid_that_is_not_symmetric() -> None:
    """Gumbel in closed form: 1 - exp(-exp(x)), by the place of one half and the width from 5% to 95%."""
    shown = np.full(7, 5000.0)
    fit = fitted(
        np.round(share("gumbel", 4, 3, 0.0, 0.0) * shown), shown, make_model("yes-no", sigmoid="gumbel", guess=0.0)
    )
    at = {part: np.log(-np.log(1 - part)) for part in (0.05, 0.5, 0.75, 0.95)}
    expected = 4 + 3 * (at[0.75] - at[0.5]) / (at[0.95] - at[0.05])
    assert threshold_at(fit, 0.75).value == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize(("task", "bound"), [("yes-no", ("guess",)), ("2afc", ())])
def test_a_rate_that_is_held_is_not_told_to_lie_at_its_bound(task: str, bound: tuple[str, ...]) -> None:
    shown = np.full(7, 400.0)
    yes = np.round(share("normal", 4, 3, 0.0 if task == "yes-no" else 0.5, 0.04) * shown)
    best = fit_likelihood(LEVELS, yes, shown, make_model(task))
    assert isinstance(best, LikelihoodFit)
    assert best.at_bound == bound
