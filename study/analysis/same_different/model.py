"""The differencing model fitted to a group's answers: thresholds free of the bias of interpolation.

Counts of a same-different task (`counts`) come in; criterion, sensitivities, thresholds with intervals
and tests go out (2004 section 5.1, corrected). What the model says stands in `fits`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from study.analysis import estimates
from study.analysis.same_different import fits
from study.analysis.same_different.counts import (
    FEWEST_FOR_INTERVAL,
    SIDES,
    Counts,
    Side,
    Threshold,
    both_sides,
    frames_by_side,
    log_threshold,
)
from study.arrays import FloatArray
from study.counting import counted
from study.models.differencing import Kind, probability_different


@dataclass(frozen=True)
class ModelFit:
    """The differencing model fitted to all answers."""

    criterion: float
    criterion_error: float | None
    """Standard error that takes the participants as independent."""
    lapse: float
    false_alarms: float
    """Share of "different" that the model gives to pairs with no difference."""
    slopes: dict[Side, float]
    """d-prime a frame, by side."""
    slope_errors: dict[Side, float | None]
    """Their standard errors."""
    jnd: dict[Side, Threshold]
    """Where `level` of the answers are "different", by side."""
    corrected: dict[Side, Threshold]
    """The difference at which an observer with the best criterion is right in that share of the pairs, by side:
    what the sensitivity allows, whatever the criterion."""
    curve: tuple[tuple[float, float], ...]
    """Points (difference in frames, percent) for drawing."""
    log_likelihood: float
    """At the maximum, without binomial coefficients."""
    note: str = ""
    """What to be careful about."""


def fit_model(
    counts: Counts, *, level: float = 0.75, confidence: float = 0.95, lapse: float | None = None
) -> ModelFit | str:
    """Fit the differencing model; a sentence that says why where it can't be fitted.

    Parameters
    ----------
    level
        Share of "different", or of right answers, at threshold; above one half.
    lapse
        The lapse rate, held; estimated where it is None, and levels are enough for it.

    Notes
    -----
    Maximum likelihood on the answers of all participants together, so the curve is that of the group. Standard errors
    are the jackknife's over participants, intervals Student's on log thresholds (measured coverage: docs/analysis.md);
    for one participant, that participant's answers as independent. Where participants differ much in sensitivity the
    curve of the group is flatter than anybody's, and its threshold is that of the group, not the mean of theirs.
    """
    reason = why_no_fit(counts)
    if reason:
        return reason
    present = np.flatnonzero(counts.shown.sum(axis=0) > 0)
    differences, different, shown = counts.differences[present], counts.different[:, present], counts.shown[:, present]
    frames, sides = frames_by_side(differences)
    held, note = held_lapse(frames, lapse)
    best = fits.fit(frames, different.sum(axis=0)[None], shown.sum(axis=0)[None], lapse=held)
    spread = _spread_of(level, best, frames, different, shown, held)

    def thresholds(kind: Kind) -> dict[Side, Threshold]:
        largest = frames.max(axis=0)
        return {
            SIDES[side]: _threshold(best, spread, float(largest[place]), place, SIDES[side], kind, confidence)
            for place, side in enumerate(sides)
        }

    line = np.linspace(differences.min(), differences.max(), 201)
    curve = probability_different(both_sides(line)[:, sides], best.criterion, best.lapse, best.slopes)[0]
    alarms = probability_different(np.zeros((1, len(sides))), best.criterion, best.lapse, best.slopes)
    return ModelFit(
        criterion=float(best.criterion[0]),
        criterion_error=spread.criterion_error(best),
        lapse=float(best.lapse[0]),
        false_alarms=float(alarms[0, 0]),
        slopes={SIDES[side]: float(best.slopes[0, place]) for place, side in enumerate(sides)},
        slope_errors={SIDES[side]: spread.slope_error(best, place) for place, side in enumerate(sides)},
        jnd=thresholds("different"),
        corrected=thresholds("criterion_free"),
        curve=tuple((float(x), 100 * float(y)) for x, y in zip(line, curve, strict=True)),
        log_likelihood=float(best.log_likelihood[0]),
        note="; ".join(filter(None, (note, _caution(best, held)))),
    )


@dataclass(frozen=True, eq=False)
class _Spread:
    """How far a fit scatters: fits with each participant omitted in turn, or the covariance for one participant."""

    participants: int
    level: float
    left_out: fits.Fits | None
    covariance: FloatArray

    def log_threshold_error(self, best: fits.Fits, kind: Kind, place: int) -> float | None:
        """Standard error of the log threshold of one slope; None where it can't be determined."""
        if self.left_out is not None:
            others = fits.threshold_frames(self.left_out, kind, self.level)[:, place]
            return estimates.jackknife_error(np.log(others)) if (others > 0).all() else None
        gradient = fits.log_threshold_gradient(best, kind, self.level)[place]
        return math.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0))

    def criterion_error(self, best: fits.Fits) -> float | None:
        """Standard error of the criterion."""
        if self.left_out is not None:
            return estimates.jackknife_error(self.left_out.criterion)
        return float(best.criterion[0]) * math.sqrt(max(float(self.covariance[0, 0]), 0.0))

    def slope_error(self, best: fits.Fits, place: int) -> float | None:
        """Standard error of one slope."""
        if self.left_out is not None:
            return estimates.jackknife_error(self.left_out.slopes[:, place])
        return float(best.slopes[0, place]) * math.sqrt(max(float(self.covariance[2 + place, 2 + place]), 0.0))


def held_lapse(frames: FloatArray, lapse: float | None) -> tuple[float | None, str]:
    """Return the lapse rate to hold, and why: the one given, 0 where levels are too few to estimate it, else none."""
    levels, slopes = frames.shape
    if lapse is not None or levels >= 2 + slopes:
        return lapse, ""
    return 0.0, f"{counted(levels, 'level')} can't tell a lapse rate from criterion and sensitivity: it is taken as 0"


def _spread_of(
    level: float, best: fits.Fits, frames: FloatArray, different: FloatArray, shown: FloatArray, lapse: float | None
) -> _Spread:
    answered = shown.sum(axis=1) > 0
    different, shown = different[answered], shown[answered]
    count = len(shown)
    if count < FEWEST_FOR_INTERVAL:
        return _Spread(count, level, None, fits.covariance(best, frames, different.sum(axis=0), shown.sum(axis=0)))
    others = (different.sum(axis=0) - different, shown.sum(axis=0) - shown)
    return _Spread(count, level, fits.fit(frames, *others, lapse=lapse), np.zeros((0, 0)))


def why_no_fit(counts: Counts) -> str:
    """Return why the differencing model can't be fitted; empty where it can."""
    shown, different = counts.shown.sum(axis=0), counts.different.sum(axis=0)
    if not shown.any():
        return "no answers"
    if not shown[counts.differences == 0].any():
        return "no pairs without a difference were answered, so criterion and sensitivity cannot be separated"
    if not shown[counts.differences != 0].any():
        return "no pairs with a difference were answered"
    if different.sum() in (0, shown.sum()):
        kind = "different" if different.any() else "same"
        return f'every answer was "{kind}": neither criterion nor sensitivity can be estimated'
    return ""


def lapse_caution(lapse: float, held: float | None) -> str:
    """Return what to be careful about where as many answers are lapses as can be; empty else."""
    if held is not None or lapse < fits.LARGEST_LAPSE - 1e-6:
        return ""
    most = f"{100 * fits.LARGEST_LAPSE:g}%"
    return (
        f"the lapse rate is at the bound of its range, {most}: more answers are tossed coins, or the curve does not fit"
    )


def _caution(best: fits.Fits, held: float | None) -> str:
    notes = [lapse_caution(float(best.lapse[0]), held)]
    if best.held[0, 0]:
        notes.append("the criterion is at the bound of its range")
    if best.held[0, 2:].any():
        notes.append("a slope is at the bound of its range: the answers show no effect of the difference, or no error")
    if not best.settled[0]:
        notes.append("the search for the maximum did not converge")
    return "; ".join(filter(None, notes))


def _threshold(
    best: fits.Fits, spread: _Spread, largest: float, place: int, side: Side, kind: Kind, confidence: float
) -> Threshold:
    """One threshold, with Student's interval of its logarithm."""
    clustered = spread.left_out is not None
    who = "jackknife over participants" if clustered else "one participant, answers treated as independent"
    method = f"differencing model; Student interval of the logarithm, {who}"
    found = float(fits.threshold_frames(best, kind, spread.level)[0, place])
    interval = estimates.Interval(None, None, confidence)
    if best.held[0, 2 + place]:
        note = "the slope is at the bound of its range"
        return Threshold(side, None, None, interval, "not estimable", method, note)
    if found <= 0:
        note = f"above {100 * spread.level:g}% even without a difference"
        return Threshold(side, None, None, interval, "above", method, note)
    error = spread.log_threshold_error(best, kind, place) if math.isfinite(found) else None
    student = estimates.t_quantile(confidence, spread.participants - 1) if clustered else None
    times = estimates.normal_quantile(confidence) if student is None else student
    return log_threshold(side, found, error, times, largest, method, confidence)
