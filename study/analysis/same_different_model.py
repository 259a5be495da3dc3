"""The differencing model fitted to a group's answers: thresholds that false alarms and straight lines do not bend.

Counts of a same-different task (`same_different.Counts`) come in; criterion, sensitivities, thresholds with intervals
and tests go out (2004 section 5.1, corrected). What the model says stands in `differencing`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.analysis import differencing as model
from study.analysis import estimates
from study.analysis.same_different import FEWEST_FOR_INTERVAL, SIDES, Counts, Side, Threshold, bootstrap_error

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ModelFit:
    """The differencing model fitted to all answers.

    Attributes
    ----------
    criterion, lapse
        Estimates, with standard errors that take the participants as independent.
    false_alarms
        Share of "different" that the model gives to pairs with no difference.
    slopes
        d-prime a frame, by side.
    jnd
        75% "different", by side.
    corrected
        The difference at which an observer with the best criterion is right in 75% of the pairs, by side: what the
        sensitivity allows, whatever the criterion.
    guess_corrected
        75% after Abbott's correction for the false alarms, by side.
    equal_slopes
        Likelihood-ratio test (answers as independent) and Wald test (participants as independent) of one slope.
    fit_deviance, fit_degrees_of_freedom, fit_p_value
        Against free percentages at each level; a small p-value says that the curve does not follow the data.
    curve
        Points (difference in frames, percent) for drawing.
    note
        What to be careful about.
    """

    criterion: float
    criterion_error: float | None
    lapse: float
    false_alarms: float
    slopes: dict[str, float]
    jnd: dict[str, Threshold]
    corrected: dict[str, Threshold]
    guess_corrected: dict[str, Threshold]
    equal_slopes: dict[str, Any] | None
    fit_deviance: float
    fit_degrees_of_freedom: int
    fit_p_value: float | None
    curve: tuple[tuple[float, float], ...]
    note: str = ""


def _frames_by_side(differences: FloatArray) -> FloatArray:
    """Regressors of the model, shape (levels, 2): size of the difference where it is shorter, and where longer."""
    return np.column_stack([np.maximum(-differences, 0.0), np.maximum(differences, 0.0)])


def fit_model(
    counts: Counts,
    *,
    confidence: float = 0.95,
    resamples: int = 1000,
    largest_lapse: float = model.LARGEST_LAPSE,
    rng: np.random.Generator | None = None,
) -> ModelFit | str:
    """Fit the differencing model; a sentence that says why where it can't be fitted.

    Parameters
    ----------
    counts
        Answers.
    confidence, resamples, rng
        Of the bootstrap over participants; seeded with 0 by default.
    largest_lapse
        Upper bound of the lapse rate.

    Notes
    -----
    Maximum likelihood on the answers of all participants together, so the curve is that of the group. Intervals of
    thresholds: Student's t on log thresholds with a sandwich covariance over participants; for one participant,
    that participant's answers as independent. Where participants differ much in sensitivity the curve of the group is
    flatter than anybody's, and its threshold is that of the group, not the mean of theirs.
    """
    reason = _why_no_fit(counts)
    if reason:
        return reason
    present = np.flatnonzero(counts.shown.sum(axis=0) > 0)
    differences, different, shown = counts.differences[present], counts.different[:, present], counts.shown[:, present]
    frames = _frames_by_side(differences)
    sides = [index for index in range(2) if frames[:, index].any()]
    frames = frames[:, sides]
    total = (different.sum(axis=0)[None], shown.sum(axis=0)[None])
    best = model.fit(frames, *total, largest_lapse=largest_lapse)
    rng = rng or np.random.default_rng(0)
    count = len(counts.participants)
    weights = estimates.resampled_weights(count, resamples, rng) if count >= FEWEST_FOR_INTERVAL else np.zeros((0, 1))
    resampled = (
        model.fit(frames, weights @ different, weights @ shown, largest_lapse=largest_lapse) if len(weights) else None
    )
    by_participant = count >= FEWEST_FOR_INTERVAL
    spread = model.covariance(best, frames, different, shown, by_participant=by_participant)
    thresholds = {
        kind: _model_thresholds(best, resampled, spread, frames, sides, count, kind, confidence) for kind in model.KINDS
    }
    saturated = _saturated_log_likelihood(*total)
    deviance = max(2 * (saturated - float(best.log_likelihood[0])), 0.0)
    freedom = len(differences) - 2 - len(sides)
    criterion = float(best.criterion[0])
    line = np.linspace(differences.min(), differences.max(), 201)
    curve = model.probability_different(_frames_by_side(line)[:, sides], best.criterion, best.lapse, best.slopes)[0]
    alarms = model.probability_different(np.zeros((1, len(sides))), best.criterion, best.lapse, best.slopes)[0, 0]
    return ModelFit(
        criterion=criterion,
        criterion_error=estimates.finite(criterion * math.sqrt(max(spread[0, 0], 0.0))),
        lapse=float(best.lapse[0]),
        false_alarms=float(alarms),
        slopes={SIDES[side]: float(best.slopes[0, place]) for place, side in enumerate(sides)},
        jnd=thresholds["different_75"],
        corrected=thresholds["criterion_free_75"],
        guess_corrected=thresholds["guess_corrected_75"],
        equal_slopes=_equal_slopes(best, spread, frames, total, count, largest_lapse) if len(sides) == 2 else None,
        fit_deviance=deviance,
        fit_degrees_of_freedom=freedom,
        fit_p_value=estimates.chi_square_probability(deviance, freedom) if freedom > 0 else None,
        curve=tuple((float(x), 100 * float(y)) for x, y in zip(line, curve, strict=True)),
        note=_caution(best),
    )


def _why_no_fit(counts: Counts) -> str:
    shown, different = counts.shown.sum(axis=0), counts.different.sum(axis=0)
    if not shown.any():
        return "no answers"
    if not shown[counts.differences == 0].any():
        return "no pairs without a difference were answered, so the criterion can't be told from the sensitivity"
    if not shown[counts.differences != 0].any():
        return "no pairs with a difference were answered"
    if different.sum() in (0, shown.sum()):
        kind = "different" if different.any() else "same"
        return f'every answer was "{kind}": neither criterion nor sensitivity can be estimated'
    return ""


def _caution(best: model.Fits) -> str:
    notes = []
    if best.held[0, 0]:
        notes.append("the criterion stands at the bound of its range")
    if best.held[0, 2:].any():
        notes.append(
            "a slope stands at the bound of its range: the answers show no effect of the difference, or no error"
        )
    if not best.settled[0]:
        notes.append("the search for the maximum did not come to rest")
    return "; ".join(notes)


def _saturated_log_likelihood(different: FloatArray, shown: FloatArray) -> float:
    from scipy.special import xlogy

    share = different / shown
    return float((xlogy(different, share) + xlogy(shown - different, 1 - share)).sum())


def _model_thresholds(
    best: model.Fits,
    resampled: model.Fits | None,
    spread: FloatArray,
    frames: FloatArray,
    sides: Sequence[int],
    count: int,
    kind: model.Kind,
    confidence: float,
) -> dict[str, Threshold]:
    """Thresholds of one kind on every side shown, with Student intervals of their logarithms."""
    found = model.threshold_frames(best, kind)[0]
    gradient = model.log_threshold_gradient(best, kind) if (np.isfinite(found) & (found > 0)).all() else None
    result: dict[str, Threshold] = {}
    for place, index in enumerate(sides):
        side, largest = SIDES[index], float(frames[:, place].max())
        threshold = float(found[place])
        held = bool(best.held[0, 2 + place])
        error = None
        if gradient is not None and not held:
            error = math.sqrt(max(float(gradient[place] @ spread @ gradient[place]), 0.0))
        bootstrap = model.threshold_frames(resampled, kind)[:, place] if resampled is not None else None
        result[side] = _model_threshold(side, threshold, largest, error, bootstrap, held, count, confidence)
    return result


def _model_threshold(
    side: Side,
    threshold: float,
    largest: float,
    log_error: float | None,
    resampled: FloatArray | None,
    held: bool,
    count: int,
    confidence: float,
) -> Threshold:
    clustered = count >= FEWEST_FOR_INTERVAL
    who = "participants as independent" if clustered else "one participant, answers as independent"
    method = f"differencing model; Student interval of the logarithm, {who}"
    unknown = estimates.Interval(None, None, confidence)
    if held:
        return Threshold(
            side, None, None, unknown, "not estimable", method, "the slope stands at the bound of its range"
        )
    if threshold <= 0:
        note = "above 75% already where there is no difference"
        return Threshold(side, None, None, unknown, "above", method, note)
    interval = unknown
    if log_error is not None:
        times = estimates.t_quantile(confidence, count - 1) if clustered else estimates.normal_quantile(confidence)
        low, high = threshold * math.exp(-times * log_error), threshold * math.exp(min(times * log_error, 50.0))
        interval = estimates.Interval(min(low, largest), high if high <= largest else None, confidence)
    if threshold > largest:
        note = f"not reached within the levels shown (largest {largest:g} frames)"
        return Threshold(side, None, None, interval, "not reached", method, note)
    error = bootstrap_error(resampled) if resampled is not None else None
    if error is None and log_error is not None:
        error = threshold * log_error
    note = "" if interval.high is not None else f"the interval reaches beyond the levels shown ({largest:g} frames)"
    return Threshold(side, threshold, error, interval, "reached", method, note)


def _equal_slopes(
    best: model.Fits,
    spread: FloatArray,
    frames: FloatArray,
    total: tuple[FloatArray, FloatArray],
    count: int,
    largest_lapse: float,
) -> dict[str, Any]:
    """Tests that shorter and longer blends are told apart equally well."""
    one = model.fit(frames.sum(axis=1, keepdims=True), *total, largest_lapse=largest_lapse)
    ratio = max(2 * float(best.log_likelihood[0] - one.log_likelihood[0]), 0.0)
    difference = float(np.log(best.slopes[0, 1] / best.slopes[0, 0]))
    variance = float(spread[2, 2] + spread[3, 3] - 2 * spread[2, 3])
    statistic = difference / math.sqrt(variance) if variance > 1e-12 and count >= FEWEST_FOR_INTERVAL else None
    return {
        "likelihood_ratio": ratio,
        "degrees_of_freedom": 1,
        "p_value_answers_independent": estimates.chi_square_probability(ratio, 1),
        "slope_ratio_longer_to_shorter": math.exp(difference),
        "t": statistic,
        "t_degrees_of_freedom": count - 1 if statistic is not None else None,
        "p_value_participants_independent": estimates.t_probability(statistic, count - 1)
        if statistic is not None
        else None,
    }
