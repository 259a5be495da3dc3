"""Answers of a same-different task counted by participant and difference, percentages, and what a threshold is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from study.analysis import estimates
from study.arrays import FloatArray
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

Side = Literal["shorter", "longer"]
SIDES: tuple[Side, Side] = ("shorter", "longer")
SIGNS: Mapping[Side, int] = {"longer": 1, "shorter": -1}
PRINTED: Mapping[Side, str] = {"longer": "+", "shorter": "−"}
"""How a difference on a side is written after k."""
Status = Literal["reached", "not reached", "above", "not estimable"]

FEWEST_FOR_INTERVAL = 2

NEEDED_COLUMNS = ("participant", "difference_frames", "answer")


@dataclass(frozen=True)
class Counts:
    """Answers counted by participant and level."""

    participants: tuple[str, ...]
    """In the order of the rows below."""
    differences: FloatArray
    """`(levels,)`: signed difference in blend length, frames, rising: comparison minus reference."""
    different: FloatArray
    shown: FloatArray
    """`different`, `shown`: `(participants, levels)`: answers "different", and all answers given; trials without a
    response are in neither."""
    motions: tuple[str, ...] = ()
    """The motion of each level, where a level is a difference of one motion (and empty where that is none, since all
    motions share these pairs); empty where levels are of all motions."""


@dataclass(frozen=True)
class Threshold:
    """A threshold on one side."""

    side: Side
    """Either "shorter" or "longer" than the reference."""
    frames: float | None
    """Size of the difference, always positive; None unless `status` is "reached"."""
    standard_error: float | None
    """Frames."""
    interval: estimates.Interval
    """Frames; an open end lies outside the levels shown, or can't be determined."""
    status: Status
    """One of "reached"; "not reached" within the levels shown; "above": the curve is above the level at the smallest
    difference shown; "not estimable"."""
    method: str
    """How it was found, and what its interval rests on."""
    note: str = ""
    """In words, where the status is not "reached" or the estimate needs a caution."""


def log_threshold(
    side: Side, found: float, error: float | None, times: float, largest: float, method: str, confidence: float
) -> Threshold:
    """Return a threshold with Student's interval of its logarithm, none where it lies beyond the levels shown.

    Parameters
    ----------
    found
        Frames.
    error, times
        Standard error of the logarithm, None where it can't be determined; and how many of them the interval reaches.
    largest
        The largest difference shown on this side, frames.
    """
    interval = estimates.Interval(None, None, confidence)
    if error is not None:
        low, high = found * math.exp(-times * error), found * math.exp(min(times * error, 50.0))
        interval = estimates.Interval(min(low, largest), high if high <= largest else None, confidence)
    if found > largest:
        note = f"not reached within the levels shown (largest {largest:g} frames)"
        return Threshold(side, None, None, interval, "not reached", method, note)
    if error is None:
        note = "hangs on single participants: no interval"
        return Threshold(side, found, None, interval, "reached", method, note)
    note = "" if interval.high is not None else f"the interval reaches beyond the levels shown ({largest:g} frames)"
    return Threshold(side, found, found * error, interval, "reached", method, note)


def sides_in_words(thresholds: Mapping[Side, Threshold]) -> str:
    """Return thresholds of both sides in words: k + 7.1 ± 0.8 frames and k − 8.0 ± 0.7 frames."""
    parts = []
    for side, sign in PRINTED.items():
        found = thresholds.get(side)
        if found is None:
            continue
        if found.frames is None:
            parts.append(f"nothing where the blend is {side} ({found.note})")
            continue
        error = f" ± {found.standard_error:.1f}" if found.standard_error is not None else ""
        parts.append(f"k {sign} {found.frames:.1f}{error} frames")
    return " and ".join(parts)


@dataclass(frozen=True)
class PercentDifferent:
    """How often a difference was seen (a point of 2004 Figure 6).

    `percent` is the mean over participants of their percentages, with its standard error; `low` and `high` are Wilson's
    interval of the answers as if independent, in percent: it says something even where all answers agree.
    """

    difference_frames: float
    participants: int
    answers: int
    different: int
    percent: float
    standard_error: float | None
    low: float | None
    high: float | None
    note: str


def same_different_answers(answers: pd.DataFrame) -> pd.DataFrame:
    """Return the answers given in same-different tasks, without trials that have no response.

    Raises
    ------
    AnalysisError
        When a column is missing, or an answer is neither "same" nor "different".
    """
    estimates.check_columns(answers, NEEDED_COLUMNS, "a same-different analysis")
    chosen = answers[answers["task"] == "same-different"] if "task" in answers.columns else answers
    given = chosen[chosen["answer"].notna() & chosen["difference_frames"].notna()]
    estimates.check_participants(given)
    strange = sorted(set(given["answer"].astype(str)) - {"same", "different"})
    if strange:
        raise AnalysisError(f'expected the answers "same" and "different", found {strange[0]!r}; recode the column')
    return given


def count_answers(answers: pd.DataFrame, *, by_motion: bool = False) -> Counts:
    """Count answers by participant and signed difference in blend length, and by motion if asked and known."""
    import pandas as pd

    given = same_different_answers(answers)
    if given.empty:
        nothing = np.zeros((0, 0))
        return Counts((), np.zeros(0), nothing, nothing)
    yes = (given["answer"] == "different").astype(float)
    differences = estimates.numbers(given["difference_frames"], "difference_frames")
    if not np.isfinite(differences).all():
        raise AnalysisError("expected finite numbers in difference_frames, found an infinite one; remove that row")
    known = by_motion and "motion" in given.columns
    motion = [given["motion"].astype(str).where(differences != 0, "")] if known else []
    keys = [given["participant"].astype(str), pd.Series(differences, index=given.index), *motion]
    groups, columns = yes.groupby(keys), list(range(1, len(keys)))
    shown, different = groups.size().unstack(columns, fill_value=0), groups.sum().unstack(columns, fill_value=0)
    return Counts(
        tuple(str(name) for name in shown.index),
        shown.columns.get_level_values(0).to_numpy(dtype=np.float64),
        different.to_numpy(dtype=np.float64),
        shown.to_numpy(dtype=np.float64),
        tuple(shown.columns.get_level_values(1)) if motion else (),
    )


def both_sides(differences: FloatArray) -> FloatArray:
    """Return sizes of the differences, shape (levels, 2): where it is shorter, and where longer; 0 elsewhere."""
    return np.column_stack([np.maximum(-differences, 0.0), np.maximum(differences, 0.0)])


def frames_by_side(differences: FloatArray) -> tuple[FloatArray, list[int]]:
    """Return sizes of the differences in a column a side that was shown, and these sides."""
    both = both_sides(differences)
    sides = [index for index in range(2) if both[:, index].any()]
    return both[:, sides], sides


def percentages(counts: Counts) -> FloatArray:
    """Return the share of "different" of every participant and level; NaN where a participant gave no answer."""
    share = np.full(counts.shown.shape, np.nan)
    np.divide(counts.different, counts.shown, out=share, where=counts.shown > 0)
    return share


def percent_different(counts: Counts, confidence: float = 0.95) -> tuple[PercentDifferent, ...]:
    """Return percent "different" by signed difference in blend length (2004 Figure 6)."""
    rows = []
    for share, difference, different, shown in zip(
        percentages(counts).T, counts.differences, counts.different.sum(axis=0), counts.shown.sum(axis=0), strict=True
    ):
        share = share[np.isfinite(share)]
        interval = estimates.wilson_interval(different, shown, confidence)
        rows.append(
            PercentDifferent(
                difference_frames=float(difference),
                participants=len(share),
                answers=int(shown),
                different=int(different),
                percent=100 * float(share.mean()),
                standard_error=100 * float(share.std(ddof=1)) / math.sqrt(len(share)) if len(share) > 1 else None,
                low=None if interval.low is None else 100 * interval.low,
                high=None if interval.high is None else 100 * interval.high,
                note="" if len(share) > 1 else "one participant: no spread to estimate",
            )
        )
    return tuple(rows)
