"""The rule of independent observations: counts of a same-different task in, its fit out.

Under the differencing rule (`fits`) a participant judges the difference of two impressions. Under the rule of
independent observations each transition by itself is judged to be odd or usual, and the answer is "different" where
one of two is odd (Macmillan & Creelman 2005, chapter 9):

    P(odd) = Phi(delta - c) + Phi(-delta - c),   P("different") = lapse / 2 + (1 - lapse) (p0 (1 - p) + p (1 - p0))

with p0 for the reference (delta 0) and p for the comparison. The pairs without a difference tell `c`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.analysis.same_different.counts import SIDES, Counts, frames_by_side
from study.analysis.same_different.fits import LARGEST_LAPSE
from study.analysis.scoring import Maxima, maximise
from study.models.differencing import density

FloatArray = NDArray[np.float64]

DECIDED = 4.0


@dataclass(frozen=True)
class Independent:
    """The rule of independent observations, fitted to all answers.

    Attributes
    ----------
    criterion
        From where on a single transition counts as odd, in standard deviations of an impression.
    lapse
        Share of answers given blindly.
    slopes, thresholds
        d-prime a frame, and frames at the share of "different" asked for, by side; None where it is never reached.
    log_likelihood
        To compare with the differencing rule, which has as many parameters.
    """

    criterion: float
    lapse: float
    slopes: dict[str, float]
    thresholds: dict[str, float | None]
    log_likelihood: float


@dataclass(frozen=True)
class Rules:
    """Which rule the answers speak for: the log likelihood of differencing less that of the other, and in words."""

    independent: Independent | None
    log_likelihood_gain: float | None
    answer: str
    note: str


def _odd(delta: FloatArray, criterion: FloatArray) -> FloatArray:
    from scipy.special import ndtr

    return np.asarray(ndtr(delta - criterion) + ndtr(-delta - criterion), dtype=np.float64)


def _parts(point: FloatArray, frames: FloatArray) -> tuple[FloatArray, FloatArray]:
    """P("different") and its derivatives by log criterion, lapse and log slopes."""
    criterion, lapse, slopes = np.exp(point[:, :1]), point[:, 1:2], np.exp(point[:, 2:])
    delta = slopes @ frames.T
    usual, odd = _odd(np.zeros((1, 1)), criterion), _odd(delta, criterion)
    share = usual * (1 - odd) + odd * (1 - usual)
    above, below = density(delta - criterion), density(delta + criterion)
    by_odd = (1 - lapse) * (1 - 2 * usual)
    by_usual = (1 - lapse) * (1 - 2 * odd) * -2 * density(criterion)
    by_criterion = (by_usual - by_odd * (above + below)) * criterion
    by_slopes = (by_odd * (above - below))[:, :, None] * frames[None] * slopes[:, None, :]
    by = np.concatenate([by_criterion[:, :, None], (0.5 - share)[:, :, None], by_slopes], axis=2)
    return np.clip(lapse / 2 + (1 - lapse) * share, 1e-9, 1 - 1e-9), by


def maximum_independent(frames: FloatArray, different: FloatArray, shown: FloatArray) -> Maxima:
    """Fit many data sets; shapes as in `differencing.fit`."""

    def value(point: FloatArray, rows: NDArray[np.intp]) -> FloatArray:
        share, _ = _parts(point, frames)
        total = different[rows] * np.log(share) + (shown[rows] - different[rows]) * np.log1p(-share)
        return np.asarray(total.sum(axis=1), dtype=np.float64)

    def scores(point: FloatArray, rows: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        share, by = _parts(point, frames)
        variance = share * (1 - share)
        gradient = np.einsum("bl,blp->bp", (different[rows] - shown[rows] * share) / variance, by)
        return gradient, np.einsum("bl,blp,blq->bpq", shown[rows] / variance, by, by)

    largest = frames.max(axis=0)
    low = np.concatenate([[math.log(0.7), 0.0], np.log(0.02 / largest)])
    high = np.concatenate([[math.log(6.0), LARGEST_LAPSE], np.log(40.0 / largest)])
    start = np.tile(np.concatenate([[math.log(1.6), 0.02], np.log(4.0 / largest)]), (len(different), 1))
    return maximise(value, scores, start, low, high)


def fit_independent(counts: Counts, level: float = 0.75) -> Independent | None:
    """Fit the rule of independent observations to all answers; None where neither rule can be fitted."""
    present = counts.shown.sum(axis=0) > 0
    differences = counts.differences[present]
    frames, sides = frames_by_side(differences)
    different, shown = counts.different[:, present].sum(axis=0), counts.shown[:, present].sum(axis=0)
    if not sides or not (differences == 0).any() or different.sum() in (0, shown.sum()):
        return None
    best = maximum_independent(frames, different[None], shown[None])
    point = best.point[0]
    thresholds: dict[str, float | None] = {}
    for place, side in enumerate(sides):
        line = np.linspace(0, float(frames[:, place].max()), 4001)
        alone = np.zeros((len(line), len(sides)))
        alone[:, place] = line
        curve = _parts(point[None], alone)[0][0]
        reached = np.flatnonzero(curve >= level)
        inside = len(reached) and reached[0] > 0
        thresholds[SIDES[side]] = float(line[reached[0]]) if inside else None
    slopes: dict[str, float] = {SIDES[side]: float(np.exp(point[2 + place])) for place, side in enumerate(sides)}
    return Independent(float(np.exp(point[0])), float(point[1]), slopes, thresholds, float(best.value[0]))


def compare_rules(independent: Independent | None, differencing_log_likelihood: float | None) -> Rules:
    """Return which rule the answers support; both have as many parameters, so the likelihoods are comparable."""
    if independent is None or differencing_log_likelihood is None:
        text = "No rule can be fitted."
        return Rules(None, None, text, text)
    gain = differencing_log_likelihood - independent.log_likelihood
    if abs(gain) < DECIDED:
        text = "The answers do not distinguish the two rules"
    else:
        better = "differencing" if gain > 0 else "independent observations"
        text = f"The answers support {better}"
    text += f" (log likelihood of differencing less that of independent observations: {gain:+.1f})."
    unreached = [side for side, frames in independent.thresholds.items() if frames is None]
    note = f"not reached within the levels by that of independent observations: {', '.join(unreached)}"
    return Rules(independent, gain, text, note if unreached else "")
