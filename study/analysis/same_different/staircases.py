"""Thresholds of staircases: the mean of the last reversals, without a model (Levitt 1971, section IV).

The answers of a study and the rule of its staircases come in; a threshold a side goes out. Each participant has a
staircase for each motion and side; the participant's threshold is the mean over these. It is where right responses have
the probability that the rule aims at, not the level of the just noticeable difference.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from study.analysis import estimates
from study.analysis.same_different.counts import PRINTED, SIGNS, Side, Threshold
from study.counting import counted
from study.models.up_down import Track, UpDown, moved, target

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class StaircaseRun:
    """One staircase."""

    participant: str
    motion: str
    side: Side
    repeat: int
    """`participant`, `motion`, `side`, `repeat`: whose it is, and what it asked."""
    trials: int
    reversals: int
    """`trials`, `reversals`: how many there were."""
    frames: float | None
    spread: float | None
    """`frames`, `spread`: mean and standard deviation of the last reversals; None where it stopped before it had as
    many."""
    levels: tuple[int, ...]
    """The difference that each trial showed, in frames without a sign."""
    turns: tuple[int, ...]
    """The trials, from 1, at which the direction changed."""


@dataclass(frozen=True)
class Staircases:
    """The staircases of a study."""

    target: float
    """The share of right responses at which the rule aims."""
    averaged: int
    """How many reversals a threshold is the mean of."""
    thresholds: dict[Side, Threshold]
    """Mean over participants of their mean thresholds, by side."""
    spread: dict[Side, float]
    """Mean standard deviation of the averaged reversals within a staircase, in frames, by side."""
    runs: tuple[StaircaseRun, ...]
    """Each staircase."""

    def in_words(self, counted_as: str = "“different”") -> str:
        """Return the thresholds in a sentence; `counted_as` is what right responses are called."""
        parts = []
        for side, found in self.thresholds.items():
            error = "" if found.standard_error is None else f" ± {found.standard_error:.1f}"
            if found.frames is None:
                parts.append(f"nothing ({found.note})")
            else:
                parts.append(f"k {PRINTED[side]} {found.frames:.1f}{error} frames")
        return (
            f"By the staircases, {100 * self.target:.1f}% of the responses are {counted_as} at {' and '.join(parts)} "
            f"(mean of the last {self.averaged} reversals)."
        )


def staircase_thresholds(answers: pd.DataFrame, rule: UpDown, confidence: float = 0.95) -> Staircases:
    """Estimate the thresholds of a study that was run with staircases.

    Parameters
    ----------
    answers
        Of one study, missed ones among them: `participant`, `trial`, `motion`, `repeat`, `difference_frames`, `answer`,
        `correct`.
    rule
        By which the staircases moved.
    confidence
        Of the intervals (Student's t over participants).
    """
    runs = tuple(_runs(answers, rule))
    thresholds: dict[Side, Threshold] = {}
    spread: dict[Side, float] = {}
    for side in SIGNS:
        own = [run for run in runs if run.side == side]
        if own:
            thresholds[side] = _threshold(side, own, rule, confidence)
            spreads = [run.spread for run in own if run.spread is not None]
            if spreads:
                spread[side] = float(np.mean(spreads))
    return Staircases(target(rule), rule.averaged, thresholds, spread, runs)


def _runs(answers: pd.DataFrame, rule: UpDown) -> Iterator[StaircaseRun]:
    moved_rows = answers[answers["difference_frames"].fillna(0) != 0].sort_values("trial", kind="stable")
    longer = moved_rows["difference_frames"] > 0
    keys = [moved_rows["participant"].astype(str), moved_rows["motion"].astype(str), longer, moved_rows["repeat"]]
    for (participant, motion, _, _), part in moved_rows.groupby(keys, sort=False):
        track = Track(rule.start)
        right = part["correct"].astype(object).where(part["answer"].notna(), None)
        levels = tuple(int(level) for level in part["difference_frames"].abs())
        turns: list[int] = []
        for number, (level, answer) in enumerate(zip(levels, right, strict=True), start=1):
            # Where answers were excluded, the level that was shown tells where the staircase had come to.
            before = len(track.reversals)
            track = moved(replace(track, level=level), rule, None if answer is None else bool(answer))
            turns += [number] * (len(track.reversals) - before)
        last = track.reversals[-rule.averaged :]
        enough = len(last) == rule.averaged
        yield StaircaseRun(
            str(participant),
            str(motion),
            "longer" if part["difference_frames"].iloc[0] > 0 else "shorter",
            int(part["repeat"].iloc[0]),
            len(part),
            len(track.reversals),
            float(np.mean(last)) if enough else None,
            float(np.std(last, ddof=1)) if enough and len(last) > 1 else None,
            levels,
            tuple(turns),
        )


def _threshold(side: Side, runs: list[StaircaseRun], rule: UpDown, confidence: float) -> Threshold:
    """The mean over participants, each with the mean of the own staircases that came to enough reversals."""
    own: dict[str, list[float]] = {}
    for run in runs:
        if run.frames is not None:
            own.setdefault(run.participant, []).append(run.frames)
    open_ = sum(run.frames is None for run in runs)
    note = f"{open_} of {counted(len(runs), 'staircase')} stopped before {rule.averaged} reversals" if open_ else ""
    method = f"mean of the last {rule.averaged} reversals, Student's t over participants"
    if not own:
        return Threshold(side, None, None, estimates.Interval(None, None, confidence), "not reached", method, note)
    mean = estimates.mean_of([float(np.mean(frames)) for frames in own.values()], confidence)
    interval = estimates.Interval(mean.low, mean.high, confidence)
    said = "; ".join(filter(None, (mean.note, note)))
    return Threshold(side, mean.mean, mean.standard_error, interval, "reached", method, said)
