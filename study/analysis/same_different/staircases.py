"""Thresholds of staircases and of QUEST+: what the tracks of each participant found by themselves.

The answers of a study and the rule of its tracks come in; a threshold a side goes out. Each participant has a track for
each motion and side; the participant's threshold is the mean over these. A staircase's is the mean of its last
reversals, without a model (Levitt 1971, section IV): where right responses have the probability that the rule aims at,
not the level of the just noticeable difference. QUEST+ tells the median of its posterior.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from study.analysis import estimates
from study.analysis.same_different.counts import PRINTED, SIGNS, Side, Threshold
from study.counting import counted
from study.models.tracks import Rule
from study.models.up_down import UpDown

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class StaircaseRun:
    """One track."""

    participant: str
    motion: str
    side: Side | Literal["both"]
    repeat: int
    """`participant`, `motion`, `side`, `repeat`: whose it is, and what it asked."""
    trials: int
    reversals: int
    """`trials`, `reversals`: how many there were."""
    frames: float | None
    spread: float | None
    """`frames`, `spread`: its threshold and how far it is off, as `Found` says; None where it is too short for one."""
    low: float | None
    high: float | None
    """`low`, `high`: ends of the interval of this track alone; None for staircases."""
    levels: tuple[int, ...]
    """The difference that each trial showed, in frames without a sign."""
    turns: tuple[int, ...]
    """The trials, from 1, at which the direction changed."""
    posterior: tuple[float, ...] = ()
    """The probability of each of `Staircases.grid`; none for staircases."""


@dataclass(frozen=True)
class Staircases:
    """The tracks of a study."""

    title: str
    """What a track is called."""
    target: float
    """The share of right responses at which the rule aims."""
    averaged: int | None
    """How many reversals a threshold is the mean of; None for QUEST+."""
    estimate: str
    """How the threshold of a track is found."""
    meaning: str
    """What holds at the threshold, as a clause."""
    thresholds: dict[Side, Threshold]
    """Mean over participants of their mean thresholds, by side."""
    spread: dict[Side, float]
    """Mean spread of a track, in frames, by side."""
    runs: tuple[StaircaseRun, ...]
    """Each track."""
    grid: tuple[float, ...] = ()
    """Thresholds in frames that posteriors are about."""

    def in_words(self) -> str:
        """Return the thresholds in a sentence."""
        parts = []
        for side, found in self.thresholds.items():
            error = "" if found.standard_error is None else f" ± {found.standard_error:.1f}"
            if found.frames is None:
                parts.append(f"nothing ({found.note})")
            else:
                parts.append(f"k {PRINTED[side]} {found.frames:.1f}{error} frames")
        return f"By the {self.title}s, {self.meaning} at {' and '.join(parts)} ({self.estimate})."


def staircase_thresholds(
    answers: pd.DataFrame, rule: Rule, confidence: float = 0.95, right: str = "“different”"
) -> Staircases:
    """Estimate the thresholds of a study that was run with staircases or QUEST+.

    Parameters
    ----------
    answers
        Of one study, missed ones among them: `participant`, `trial`, `motion`, `repeat`, `difference_frames`, `answer`,
        `correct`.
    rule
        By which the tracks went on.
    confidence
        Of the intervals (Student's t over participants).
    right
        What right responses are called.
    """
    runs = tuple(_runs(answers, rule))
    thresholds: dict[Side, Threshold] = {}
    spread: dict[Side, float] = {}
    for side in SIGNS:
        own = [run for run in runs if run.side in (side, "both")]
        if own:
            thresholds[side] = _threshold(side, own, rule, confidence)
            spreads = [run.spread for run in own if run.spread is not None]
            if spreads:
                spread[side] = float(np.mean(spreads))
    averaged = rule.averaged if isinstance(rule, UpDown) else None
    meaning, grid = rule.meaning(right), rule.posterior(rule.begin())[0]
    return Staircases(rule.title, rule.target, averaged, rule.estimate, meaning, thresholds, spread, runs, grid)


def _runs(answers: pd.DataFrame, rule: Rule) -> Iterator[StaircaseRun]:
    answers = answers.sort_values("trial", kind="stable")
    differs = answers["difference_frames"].fillna(0) != 0
    moved_rows = answers[differs]
    beside = answers[~differs & answers["answer"].notna()].groupby(answers["participant"].astype(str))["correct"]
    same = {str(participant): [bool(right) for right in own] for participant, own in beside}
    longer = (moved_rows["difference_frames"] > 0) & (not rule.shared)
    keys = [moved_rows["participant"].astype(str), moved_rows["motion"].astype(str), longer, moved_rows["repeat"]]
    for (participant, motion, _, _), part in moved_rows.groupby(keys, sort=False):
        track = rule.begin()
        right = part["correct"].astype(object).where(part["answer"].notna(), None)
        levels = tuple(int(level) for level in part["difference_frames"].abs())
        turns: list[int] = []
        for number, (level, answer) in enumerate(zip(levels, right, strict=True), start=1):
            # Where answers were excluded, the level that was shown tells where the track had come to.
            before = rule.turns(track)
            track = rule.after(track, level, None if answer is None else bool(answer))
            turns += [number] * (rule.turns(track) - before)
        for correct in same.get(str(participant), ()):
            track = rule.beside(track, correct)
        found = rule.found(track)
        yield StaircaseRun(
            str(participant),
            str(motion),
            "both" if rule.shared else "longer" if part["difference_frames"].iloc[0] > 0 else "shorter",
            int(part["repeat"].iloc[0]),
            len(part),
            rule.turns(track),
            found.frames if found else None,
            found.spread if found else None,
            found.low if found else None,
            found.high if found else None,
            levels,
            tuple(turns),
            rule.posterior(track)[1],
        )


def _threshold(side: Side, runs: list[StaircaseRun], rule: Rule, confidence: float) -> Threshold:
    """The mean over participants, each with the mean of the own tracks that came to a threshold."""
    own: dict[str, list[float]] = {}
    for run in runs:
        if run.frames is not None:
            own.setdefault(run.participant, []).append(run.frames)
    open_ = sum(run.frames is None for run in runs)
    note = f"{open_} of {counted(len(runs), rule.title)} stopped too early for the {rule.estimate}" if open_ else ""
    method = f"{rule.estimate}, Student's t over participants"
    if not own:
        return Threshold(side, None, None, estimates.Interval(None, None, confidence), "not reached", method, note)
    mean = estimates.mean_of([float(np.mean(frames)) for frames in own.values()], confidence)
    interval = estimates.Interval(mean.low, mean.high, confidence)
    said = "; ".join(filter(None, (mean.note, note)))
    return Threshold(side, mean.mean, mean.standard_error, interval, "reached", method, said)
