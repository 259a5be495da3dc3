"""The mixed differencing model: the median observer is found where one curve for all is bent, and doubt is said."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import chi2, norm

from study.analysis.same_different.analyse import analyse_jnd
from study.analysis.same_different.counts import Counts, count_answers
from study.analysis.same_different.mixed import MixedThresholds, fit_mixed_thresholds
from study.analysis.same_different.model import ModelFit, fit_model
from study.models.differencing import criterion_free_delta

LEVELS = np.array([-15.0, -10, -5, 0, 5, 10, 20])


def share_of(scale: float, criterion: float, lapse: float = 0.02) -> np.ndarray:
    """P("different") where d-prime a frame is 0.4 times `scale` for shorter, 0.45 times `scale` for longer."""
    delta = scale * np.where(LEVELS < 0, -0.4 * LEVELS, 0.45 * LEVELS)
    far = norm.sf(criterion, delta, np.sqrt(2)) + norm.cdf(-criterion, delta, np.sqrt(2))
    return lapse / 2 + (1 - lapse) * far


def crossing(slope: float, criterion: float = 2.0, lapse: float = 0.02) -> float:
    """Where the curve of one observer crosses 75%, by a fine grid."""
    frames = np.linspace(0, 20, 200001)
    far = norm.sf(criterion, slope * frames, np.sqrt(2)) + norm.cdf(-criterion, slope * frames, np.sqrt(2))
    return float(np.interp(0.75, lapse / 2 + (1 - lapse) * far, frames))


def people(rng: np.random.Generator, count: int, spread: float, answers: int) -> Counts:
    shares = [share_of(np.exp(spread * rng.normal()), 2.0 * np.exp(0.1 * rng.normal())) for _ in range(count)]
    different = rng.binomial(answers, shares).astype(float)
    names = tuple(f"p{place}" for place in range(count))
    return Counts(names, LEVELS, different, np.full(different.shape, float(answers)))


def fitted(counts: Counts) -> MixedThresholds:
    found = fit_mixed_thresholds(counts)
    assert isinstance(found, MixedThresholds), found
    return found


def test_the_median_observer_is_found_where_people_differ() -> None:
    found = fitted(people(np.random.default_rng(3), 400, 0.35, 30))
    assert found.sensitivity_spread == pytest.approx(0.35, abs=0.04)
    assert found.criterion_spread == pytest.approx(0.1, abs=0.04)
    for side, slope in (("shorter", 0.4), ("longer", 0.45)):
        threshold = found.typical[side]
        assert threshold.frames == pytest.approx(crossing(slope), rel=0.04)
        assert (found.population[side].frames or 0) > (threshold.frames or 0)
    assert found.alike_p_value < 1e-6


def test_the_population_is_where_percentages_cross_and_one_curve_lies_further_out() -> None:
    """Against the mean of many observers' curves, which the model does not see."""
    rng = np.random.default_rng(4)
    counts = people(rng, 600, 0.4, 40)
    found, one = fitted(counts), fit_model(counts)
    assert isinstance(one, ModelFit)
    scales = np.exp(0.4 * rng.normal(size=4000))
    criteria = 2.0 * np.exp(0.1 * rng.normal(size=4000))
    frames = np.linspace(3, 12, 91)
    delta = 0.45 * frames * scales[:, None]
    far = norm.sf(criteria[:, None], delta, 2**0.5) + norm.cdf(-criteria[:, None], delta, 2**0.5)
    truth = float(np.interp(0.75, 0.01 + 0.98 * far.mean(axis=0), frames))
    assert found.population["longer"].frames == pytest.approx(truth, rel=0.03)
    assert (one.jnd["longer"].frames or 0) > (found.typical["longer"].frames or 0)


def test_the_marginal_likelihood_is_the_integral() -> None:
    """Three participants, by Gauss-Hermite quadrature over both standard scores."""
    counts = people(np.random.default_rng(5), 3, 0.3, 12)
    found = fitted(counts)
    slopes = {}
    for side in ("shorter", "longer"):
        frames = found.typical[side].frames
        assert frames is not None
        low, high = 0.01, 5.0
        while high - low > 1e-10:
            middle = (low + high) / 2
            low, high = (middle, high) if crossing_at(frames, middle, found) < 0.75 else (low, middle)
        slopes[side] = low
    nodes, weights = np.polynomial.hermite_e.hermegauss(60)
    weights = weights / weights.sum()
    total = 0.0
    for different, shown in zip(counts.different, counts.shown, strict=True):
        mean = 0.0
        for first, weight in zip(nodes, weights, strict=True):
            factor = np.exp(found.sensitivity_spread * first)
            delta = factor * np.where(LEVELS < 0, -slopes["shorter"] * LEVELS, slopes["longer"] * LEVELS)
            criteria = found.criterion * np.exp(found.criterion_spread * nodes)[:, None]
            far = norm.sf(criteria, delta, 2**0.5) + norm.cdf(-criteria, delta, 2**0.5)
            share = np.clip(found.lapse / 2 + (1 - found.lapse) * far, 1e-12, 1 - 1e-12)
            logs = (different * np.log(share) + (shown - different) * np.log1p(-share)).sum(axis=1)
            mean += weight * float(weights @ np.exp(logs))
        total += np.log(mean)
    assert found.log_likelihood == pytest.approx(total, abs=2e-3)


def crossing_at(frames: float, slope: float, found: MixedThresholds) -> float:
    far = norm.sf(found.criterion, slope * frames, 2**0.5) + norm.cdf(-found.criterion, slope * frames, 2**0.5)
    return float(found.lapse / 2 + (1 - found.lapse) * far)


def test_people_who_are_alike_are_not_told_apart() -> None:
    found = fitted(people_alike(np.random.default_rng(6), 20))
    assert found.alike_p_value > 0.05
    ratio = 2 * (found.log_likelihood - found.alike_log_likelihood)
    expected = 0.5 * chi2.sf(ratio, 1) + 0.25 * chi2.sf(ratio, 2) if ratio > 0 else 1.0
    assert found.alike_p_value == pytest.approx(expected)
    for side in ("shorter", "longer"):
        typical, population = found.typical[side].frames, found.population[side].frames
        assert typical == pytest.approx(population, rel=0.02)


def people_alike(rng: np.random.Generator, count: int) -> Counts:
    different = rng.binomial(6, np.tile(share_of(1.0, 2.0), (count, 1))).astype(float)
    return Counts(tuple(map(str, range(count))), LEVELS, different, np.full(different.shape, 6.0))


def test_order_of_participants_and_empty_rows_do_not_matter() -> None:
    counts = people(np.random.default_rng(7), 6, 0.3, 8)
    turned = replace(counts, different=counts.different[::-1], shown=counts.shown[::-1])
    idle = Counts(
        (*counts.participants, "idle"),
        LEVELS,
        np.vstack([counts.different, np.zeros(7)]),
        np.vstack([counts.shown, np.zeros(7)]),
    )
    first = fitted(counts).typical["longer"]
    for other in (turned, idle):
        assert fitted(other).typical["longer"].frames == pytest.approx(first.frames, rel=1e-4)


@pytest.mark.parametrize(
    ("counts", "says"),
    [
        (people_alike(np.random.default_rng(1), 2), "2 participants are too few"),
        (replace(people_alike(np.random.default_rng(1), 5), different=np.zeros((5, 7))), 'every answer was "same"'),
        (replace(people_alike(np.random.default_rng(1), 5), differences=LEVELS + 1), "no pairs without a difference"),
        (Counts((), np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0))), "no answers"),
    ],
    ids=["two people", "all the same", "no zero", "nobody"],
)
def test_what_cannot_be_estimated_is_said(counts: Counts, says: str) -> None:
    found = fit_mixed_thresholds(counts)
    assert isinstance(found, str)
    assert says in found


def test_a_study_reports_the_median_observer(same_different_study: Callable[..., pd.DataFrame]) -> None:
    answers = same_different_study(np.random.default_rng(8), participants=10, spread=0.3)
    result = analyse_jnd(answers, resamples=50)
    expected = fitted(count_answers(answers, by_motion=True))
    assert result.mixed.typical["longer"].frames == pytest.approx(expected.typical["longer"].frames)
    assert "the median observer's just noticeable difference is k +" in result.answer
    alone = analyse_jnd(answers[answers["participant"] == "p00"], resamples=50)
    assert alone.mixed is None
    assert "too few to estimate individual differences" in alone.mixed_note


def several_motions(rng: np.random.Generator, scales: list[float], count: int, answers: int) -> Counts:
    """Counts by motion, each with its own sensitivity, of people who differ by 0.3."""
    own = np.exp(0.3 * rng.normal(size=count))
    shares = np.array([[share_of(one * scale, 2.0) for scale in scales] for one in own]).reshape(count, -1)
    different = rng.binomial(answers, shares).astype(float)
    names = tuple(np.repeat([f"m{place}" for place in range(len(scales))], len(LEVELS)))
    shown = np.full(different.shape, float(answers))
    return Counts(tuple(map(str, range(count))), np.tile(LEVELS, len(scales)), different, shown, names)


def test_motions_that_differ_do_not_flatten_the_curve() -> None:
    """The median observer's threshold is the geometric mean over motions; one curve for all lies further out."""
    counts = several_motions(np.random.default_rng(8), [0.5, 1.0, 2.0], 150, 12)
    summed = (tables.reshape(150, 3, -1).sum(axis=1) for tables in (counts.different, counts.shown))
    found, together = fitted(counts), fitted(Counts(counts.participants, LEVELS, *summed))
    for side, slope in (("shorter", 0.4), ("longer", 0.45)):
        assert found.these_motions[side].frames == pytest.approx(crossing(slope), rel=0.05)
        assert found.typical[side].frames == found.these_motions[side].frames
        assert (together.typical[side].frames or 0) > 1.1 * crossing(slope)
    assert found.sensitivity_spread == pytest.approx(0.3, abs=0.05)
    assert found.motion_spread["longer"] == pytest.approx(np.std(np.log([0.5, 1, 2]), ddof=1), rel=0.1)
    assert found.generalises_to == "participants and motions"


def test_the_interval_over_motions_is_students_where_people_and_answers_are_many() -> None:
    """Nearly all doubt comes from the motions: their log thresholds are then a plain sample of three."""
    counts = several_motions(np.random.default_rng(9), [0.6, 1.0, 1.7], 150, 20)
    found = fitted(counts)
    logs = [np.log(fitted(of_one(counts, motion)).typical["longer"].frames or np.nan) for motion in ("m0", "m1", "m2")]
    error = np.std(logs, ddof=1) / np.sqrt(3)
    here, general = found.these_motions["longer"], found.typical["longer"]
    assert (general.standard_error or 0) / (general.frames or 1) == pytest.approx(error, rel=0.1)
    assert (here.standard_error or 1) < (general.standard_error or 0) / 3


def of_one(counts: Counts, motion: str) -> Counts:
    kept = np.array([name == motion for name in counts.motions])
    return Counts(counts.participants, counts.differences[kept], counts.different[:, kept], counts.shown[:, kept])


def test_two_motions_hold_for_these_alone() -> None:
    two = fitted(several_motions(np.random.default_rng(10), [0.8, 1.2], 20, 6))
    assert (two.generalises_to, two.motion_spread) == ("participants, for these motions", {})
    assert two.typical == two.these_motions


def test_a_motion_that_everybody_tells_stays_in_reach_of_the_others() -> None:
    counts = several_motions(np.random.default_rng(11), [1.0, 1.0, 1.0], 20, 2)
    longer_of_last = np.array(
        [name == "m2" and level > 0 for name, level in zip(counts.motions, [*LEVELS] * 3, strict=False)]
    )
    found = fitted(replace(counts, different=np.where(longer_of_last, counts.shown, counts.different)))
    frames = found.typical["longer"].frames
    assert frames is not None
    assert crossing(0.45) / 3 < frames < crossing(0.45)
    assert found.generalises_to == "participants and motions"
    assert 0.3 < found.motion_spread["longer"] < 1.5


def test_motions_that_are_shown_on_one_side_only_count_there() -> None:
    counts = several_motions(np.random.default_rng(12), [1.0] * 6, 20, 4)
    place = np.array([int(name[1]) for name in counts.motions])
    shown = np.where((np.tile(LEVELS, 6) < 0) == (place < 3), counts.shown, 0.0)
    found = fitted(replace(counts, shown=shown, different=np.minimum(counts.different, shown)))
    for side, slope in (("shorter", 0.4), ("longer", 0.45)):
        assert found.typical[side].frames == pytest.approx(crossing(slope), rel=0.15)
    assert found.generalises_to == "participants and motions"


def test_the_criterion_free_threshold_rests_on_sensitivity_alone() -> None:
    """One sensitivity and three criteria: 75% "different" moves, the best criterion's threshold does not."""
    free, own = [], []
    for place, criterion in enumerate((1.2, 1.9, 2.6)):
        rng = np.random.default_rng([12, place])
        different = rng.binomial(40, [share_of(np.exp(0.1 * rng.normal()), criterion) for _ in range(40)])
        counts = Counts(tuple(map(str, range(40))), LEVELS, different.astype(float), np.full(different.shape, 40.0))
        found = fitted(counts)
        free.append(found.criterion_free["longer"].frames)
        own.append(found.typical["longer"].frames)
    assert free == pytest.approx([criterion_free_delta(0.75) / 0.45] * 3, rel=0.06)
    assert own == pytest.approx([crossing(0.45, criterion) for criterion in (1.2, 1.9, 2.6)], rel=0.06)


def test_a_minority_that_can_not_tell_is_seen_named_and_left_out() -> None:
    """Seven of 35 without sensitivity: their names, and the threshold of the others beside."""
    rng = np.random.default_rng(13)
    counts = people(rng, 28, 0.3, 8)
    blind = rng.binomial(8, np.tile(share_of(0.02, 2.0), (7, 1))).astype(float)
    names = (*counts.participants, *(f"blind {place}" for place in range(7)))
    different = np.vstack([counts.different, blind])
    found = fitted(Counts(names, LEVELS, different, np.full(different.shape, 8.0)))
    assert set(found.unable) >= set(names[28:])
    assert len(found.unable) <= 8
    assert "participants answer as if they could not tell any difference" in found.note
    alone = fitted(counts)
    for side in ("shorter", "longer"):
        assert found.able[side].frames == pytest.approx(alone.typical[side].frames, rel=0.05)
        assert (found.typical[side].frames or 0) > 1.1 * (found.able[side].frames or 99)
    assert not alone.note
