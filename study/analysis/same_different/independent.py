"""Other readings of a same-different task: counts in; the rule of independent observations, profiles and tests out.

Under the differencing rule (`differencing`) a participant judges the difference of two impressions. Under the rule of
independent observations each transition by itself is judged to be odd or usual, and the answer is "different" where
one of two is odd (Macmillan & Creelman 2005, chapter 9):

    P(odd) = Phi(delta - c) + Phi(-delta - c),   P("different") = lapse / 2 + (1 - lapse) (p0 (1 - p) + p (1 - p0))

with p0 for the reference (delta 0) and p for the comparison. The pairs without a difference tell `c`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.analysis import estimates
from study.analysis.same_different import fits as differencing
from study.analysis.same_different.interpolation import SIDES, Counts
from study.analysis.scoring import Maxima, maximise
from study.models.differencing import probability_different, threshold_delta

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]

LARGEST_LAPSE = differencing.LARGEST_LAPSE
PROFILE_POINTS = 41
WIDEST_PROFILE = 4.0
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


def frames_by_side(differences: FloatArray) -> tuple[FloatArray, list[int]]:
    """Return sizes of the differences in a column a side, and the sides that were shown."""
    both = np.column_stack([np.maximum(-differences, 0.0), np.maximum(differences, 0.0)])
    sides = [index for index in range(2) if both[:, index].any()]
    return both[:, sides], sides


def _odd(delta: FloatArray, criterion: FloatArray) -> FloatArray:
    from scipy.special import ndtr

    return np.asarray(ndtr(delta - criterion) + ndtr(-delta - criterion), dtype=np.float64)


def _density(value: FloatArray) -> FloatArray:
    return np.asarray(np.exp(-0.5 * value * value) / np.sqrt(2 * np.pi), dtype=np.float64)


def _parts(point: FloatArray, frames: FloatArray) -> tuple[FloatArray, FloatArray]:
    """P("different") and its derivatives by log criterion, lapse and log slopes."""
    criterion, lapse, slopes = np.exp(point[:, :1]), point[:, 1:2], np.exp(point[:, 2:])
    delta = slopes @ frames.T
    usual, odd = _odd(np.zeros((1, 1)), criterion), _odd(delta, criterion)
    share = usual * (1 - odd) + odd * (1 - usual)
    above, below = _density(delta - criterion), _density(delta + criterion)
    by_odd = (1 - lapse) * (1 - 2 * usual)
    by_usual = (1 - lapse) * (1 - 2 * odd) * -2 * _density(criterion)
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


def compare_rules(independent: Independent | None, differencing_log_likelihood: float | None) -> dict[str, Any]:
    """Return which rule the answers speak for; both have as many parameters, so the likelihoods stand as they are."""
    if independent is None or differencing_log_likelihood is None:
        text = "No rule can be fitted."
        return {"independent": None, "log_likelihood_gain": None, "answer": text, "note": text}
    gain = differencing_log_likelihood - independent.log_likelihood
    if abs(gain) < DECIDED:
        text = "The answers do not tell the two rules apart"
    else:
        better = "differencing" if gain > 0 else "independent observations"
        text = f"The answers speak for {better}"
    text += f" (log likelihood of differencing less that of independent observations: {gain:+.1f})."
    unreached = [side for side, frames in independent.thresholds.items() if frames is None]
    note = f"not reached within the levels by that of independent observations: {', '.join(unreached)}"
    found = {"independent": estimates.plain(independent), "log_likelihood_gain": gain, "answer": text}
    return {**found, "note": note if unreached else ""}


# Does the order matter?


def order_test(given: pd.DataFrame) -> dict[str, Any]:
    """Test that a pair is answered alike in both orders, as both rules have it.

    Parameters
    ----------
    given
        Answers with `participant`, `difference_frames`, `reference_first`, `answer`; pairs without a difference have
        no order.

    Returns
    -------
    dict
        `difference_percent` (share "different" where the reference came first, less where second, mean over
        participants and levels), `low`, `high`, `t`, `degrees_of_freedom`, `p_value` (over participants), `chi_square`,
        `chi_square_degrees_of_freedom`, `chi_square_p_value` (likelihood ratio over levels, answers as independent),
        `note`.
    """
    names = ("difference_percent", "low", "high", "t", "degrees_of_freedom", "p_value", "chi_square")
    result: dict[str, Any] = dict.fromkeys((*names, "chi_square_degrees_of_freedom", "chi_square_p_value"))
    if "reference_first" not in given.columns or given["reference_first"].isna().all():
        return {**result, "note": "the order of presentation is not known"}
    known = given[given["reference_first"].notna() & (given["difference_frames"] != 0)]
    different = (known["answer"] == "different").astype(float)
    first = known["reference_first"].astype(bool)
    if first.all() or not first.any():
        return {**result, "note": "every pair came in one and the same order"}
    keys = [known["participant"].astype(str), known["difference_frames"], first]
    shares = different.groupby(keys).mean().unstack().dropna()
    gaps = (shares[True] - shares[False]).groupby(level=0).mean().to_numpy(dtype=np.float64)
    test = estimates.mean_test(gaps, 0.0)
    low, high = test.interval.low, test.interval.high
    return {
        **result,
        "difference_percent": None if test.mean is None else 100 * test.mean,
        "low": None if low is None else 100 * low,
        "high": None if high is None else 100 * high,
        "t": test.statistic,
        "degrees_of_freedom": test.degrees_of_freedom,
        "p_value": test.p_value,
        **_order_ratio(different, known["difference_frames"], first),
        "note": test.note,
    }


def _order_ratio(different: pd.Series[float], levels: pd.Series[float], first: pd.Series[bool]) -> dict[str, Any]:
    """Likelihood ratio of a share a level and order against one a level."""

    def log_likelihood(keys: list[pd.Series[Any]]) -> tuple[float, int]:
        from scipy.special import xlogy

        sums = different.groupby(keys).agg(["sum", "count"])
        yes, shown = sums["sum"].to_numpy(dtype=np.float64), sums["count"].to_numpy(dtype=np.float64)
        return float((xlogy(yes, yes / shown) + xlogy(shown - yes, 1 - yes / shown)).sum()), len(yes)

    (free, cells), (held, fewer) = log_likelihood([levels, first]), log_likelihood([levels])
    freedom = cells - fewer
    if freedom < 1:
        return {}
    ratio = max(2 * (free - held), 0.0)
    return {
        "chi_square": ratio,
        "chi_square_degrees_of_freedom": freedom,
        "chi_square_p_value": estimates.chi_square_probability(ratio, freedom),
    }


# Profile likelihood of the differencing model


def profile_intervals(counts: Counts, level: float = 0.75, confidence: float = 0.95) -> dict[str, estimates.Interval]:
    """Return intervals of the just noticeable difference by profile likelihood, by side; all answers as independent.

    Where participants differ these are too narrow: the jackknife's stand beside them. An end beyond the levels shown
    is open.
    """
    present = counts.shown.sum(axis=0) > 0
    differences = counts.differences[present]
    frames, sides = frames_by_side(differences)
    different, shown = counts.different[:, present].sum(axis=0), counts.shown[:, present].sum(axis=0)
    if not sides or not (differences == 0).any() or different.sum() in (0, shown.sum()):
        return {}
    best = differencing.fit(frames, different[None], shown[None])
    found = differencing.threshold_frames(best, "different", level)[0]
    return {
        SIDES[side]: _profile(frames, different, shown, best, place, float(found[place]), level, confidence)
        for place, side in enumerate(sides)
    }


def _profile(
    frames: FloatArray,
    different: FloatArray,
    shown: FloatArray,
    best: differencing.Fits,
    place: int,
    found: float,
    level: float,
    confidence: float,
) -> estimates.Interval:
    largest = float(frames[:, place].max())
    if not math.isfinite(found) or found <= 0 or best.held[0, 2 + place]:
        return estimates.Interval(None, None, confidence)
    reach = estimates.normal_quantile(confidence)
    line = np.exp(np.linspace(math.log(found / WIDEST_PROFILE), math.log(found * WIDEST_PROFILE), PROFILE_POINTS))
    for _ in range(2):
        value = _held_at(line, frames, different, shown, best, place, level)
        root = np.sqrt(np.maximum(2 * (max(float(best.log_likelihood[0]), float(value.max())) - value), 0.0))
        below, above = line <= found, line >= found
        low = _end(line[below][::-1], root[below][::-1], reach)
        high = _end(line[above], root[above], reach)
        inner = [low / 1.1 if low else line[0], high * 1.1 if high else line[-1]]
        line = np.exp(np.linspace(math.log(inner[0]), math.log(inner[1]), PROFILE_POINTS))
    return estimates.Interval(low, high if high is not None and high <= largest else None, confidence)


def _end(line: FloatArray, root: FloatArray, reach: float) -> float | None:
    """Where the root of the likelihood ratio first exceeds `reach`, going outwards; None where it does not."""
    beyond = np.flatnonzero(root > reach)
    if not len(beyond):
        return None
    at = int(beyond[0])
    if at == 0:
        return float(line[0])
    part = (reach - root[at - 1]) / (root[at] - root[at - 1])
    return float(line[at - 1] + part * (line[at] - line[at - 1]))


def _held_at(
    line: FloatArray,
    frames: FloatArray,
    different: FloatArray,
    shown: FloatArray,
    best: differencing.Fits,
    place: int,
    level: float,
) -> FloatArray:
    """The largest log likelihood with the threshold of one side held at each point of a line."""
    others = [other for other in range(frames.shape[1]) if other != place]

    def whole(point: FloatArray, rows: NDArray[np.intp]) -> FloatArray:
        criterion, lapse = np.exp(point[:, 0]), point[:, 1]
        delta = threshold_delta(criterion, lapse, "different", level)
        slopes = np.empty((len(point), frames.shape[1]))
        slopes[:, others] = point[:, 2:]
        slopes[:, place] = np.log(np.clip(delta, 1e-6, 1e3) / line[rows])
        return np.column_stack([point[:, :2], slopes])

    def share(point: FloatArray, rows: NDArray[np.intp]) -> FloatArray:
        full = whole(point, rows)
        found = probability_different(frames, np.exp(full[:, 0]), full[:, 1], np.exp(full[:, 2:]))
        return np.clip(found, 1e-9, 1 - 1e-9)

    def value(point: FloatArray, rows: NDArray[np.intp]) -> FloatArray:
        p = share(point, rows)
        return np.asarray((different * np.log(p) + (shown - different) * np.log1p(-p)).sum(axis=1), dtype=np.float64)

    def scores(point: FloatArray, rows: NDArray[np.intp]) -> tuple[FloatArray, FloatArray]:
        p, step = share(point, rows), 1e-5
        by = np.empty((*p.shape, point.shape[1]))
        for axis in range(point.shape[1]):
            moved = np.zeros(point.shape[1])
            moved[axis] = step
            by[:, :, axis] = (share(point + moved, rows) - share(point - moved, rows)) / (2 * step)
        variance = p * (1 - p)
        gradient = np.einsum("bl,blp->bp", (different - shown * p) / variance, by)
        return gradient, np.einsum("bl,blp,blq->bpq", shown / variance, by, by)

    start = np.concatenate([np.log(best.criterion[:1]), best.lapse[:1], np.log(best.slopes[0, others])])
    largest = frames.max(axis=0)[others]
    low = np.concatenate([[math.log(1e-3), 0.0], np.log(0.02 / largest)])
    high = np.concatenate([[math.log(9.0), LARGEST_LAPSE], np.log(40.0 / largest)])
    return maximise(value, scores, np.tile(start, (len(line), 1)), low, high, steps=60).value
