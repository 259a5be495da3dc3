"""Up-down rules: how a staircase moves from answer to answer, and the probability that it aims at.

A rule and answers (right, wrong, none) come in; the level of the next trial goes out, with the levels at which the
direction changed. Transformed rules step after several right or wrong answers in a row (Levitt 1971, section IV);
weighted rules make steps up and down of different sizes (Kaernbach 1991). Levels are whole numbers, harder downwards.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from study.models.tracks import Found, Rule


@dataclass(frozen=True)
class UpDown(Rule):
    """A rule. A trial that shows no difference moves no staircase."""

    title: ClassVar[str] = "staircase"

    start: int
    """Level of the first trial."""
    steps: tuple[int, ...]
    """Sizes of the steps down: the first until the first reversal, the next until the second, the last from then on."""
    least: int
    most: int
    """`least`, `most`: levels that are never passed."""
    down: int = 1
    up: int = 1
    """`down`, `up`: right answers in a row before a step down, and wrong ones before a step up."""
    up_times: int = 1
    """How many times as large as steps down the steps up are."""
    reversals: int = 8
    trials: int = 50
    """`reversals`, `trials`: a staircase stops after so many changes of direction, or after so many trials."""
    averaged: int = 6
    """Its threshold is the mean of so many reversals, the last ones."""
    shared: bool = False

    @property
    def target(self) -> float:
        """The probability of a right answer at the level around which a staircase settles."""
        return target(self)

    @property
    def estimate(self) -> str:
        """How a staircase's threshold is found."""
        return f"mean of the last {self.averaged} reversals"

    def begin(self) -> Track:
        """A staircase at its start."""
        return Track(self.start)

    def due(self, track: Track) -> int:
        """Where it stands."""
        return track.level

    def after(self, track: Track, level: int, right: bool | None) -> Track:
        """One step from the level that was shown, or none."""
        return moved(replace(track, level=level), self, right)

    def over(self, track: Track) -> bool:
        """After its reversals, or its most trials."""
        return stopped(track, self)

    def asked(self, track: Track) -> int:
        """All trials so far."""
        return track.trials

    def found(self, track: Track) -> Found | None:
        """Mean and standard deviation of the last reversals, once there are as many."""
        last = track.reversals[-self.averaged :]
        if len(last) < self.averaged:
            return None
        return Found(float(np.mean(last)), float(np.std(last, ddof=1)) if len(last) > 1 else None)

    def turns(self, track: Track) -> int:
        """Its reversals."""
        return len(track.reversals)


@dataclass(frozen=True)
class Track:
    """Where a staircase stands."""

    level: int
    """Of the next trial."""
    trials: int = 0
    """Trials so far, those without an answer among them."""
    reversals: tuple[int, ...] = ()
    """The levels at which the direction changed, in order."""
    direction: int = 0
    """Of the last step: -1 down, 1 up, 0 before there was one."""
    right: int = 0
    wrong: int = 0
    """`right`, `wrong`: answers of a kind in a row since the last step."""


def moved(track: Track, rule: UpDown, right: bool | None) -> Track:
    """A staircase after one more answer; after none (None) the level is asked again.

    A step that a limit cuts short counts as a step: the direction is that of the answers.
    """
    trials = track.trials + 1
    if right is None:
        return Track(track.level, trials, track.reversals, track.direction, track.right, track.wrong)
    rights, wrongs = (track.right + 1, 0) if right else (0, track.wrong + 1)
    if rights < rule.down and wrongs < rule.up:
        return Track(track.level, trials, track.reversals, track.direction, rights, wrongs)
    direction = -1 if right else 1
    turned = track.direction not in (0, direction)
    reversals = (*track.reversals, track.level) if turned else track.reversals
    return Track(_stepped(rule, track.level, direction, len(reversals)), trials, reversals, direction)


def folded(rule: UpDown, answers: Iterable[bool | None]) -> Track:
    """A staircase after all of its answers."""
    track = Track(rule.start)
    for right in answers:
        track = moved(track, rule, right)
    return track


def stopped(track: Track, rule: UpDown) -> bool:
    """Whether a staircase is over."""
    return len(track.reversals) >= rule.reversals or track.trials >= rule.trials


def reachable(rule: UpDown) -> tuple[int, ...]:
    """The levels that may come, whatever is answered, from the least."""
    found: set[tuple[int, int, int]] = set()
    ahead = [(rule.start, 0, 0)]
    while ahead:
        place = ahead.pop()
        if place in found:
            continue
        found.add(place)
        level, reversals, direction = place
        for towards in (-1, 1):
            turns = reversals + (direction not in (0, towards))
            after = _stepped(rule, level, towards, turns)
            ahead.append((after, min(turns, len(rule.steps) - 1), towards))
    return tuple(sorted({level for level, _, _ in found}))


def _stepped(rule: UpDown, level: int, direction: int, reversals: int) -> int:
    """The level after a step in a direction (-1 or 1), where the direction has changed so many times."""
    step = rule.steps[min(reversals, len(rule.steps) - 1)] * (rule.up_times if direction > 0 else 1)
    return min(max(level + direction * step, rule.least), rule.most)


def fewest_trials(rule: UpDown) -> int:
    """The trials of a staircase that reaches its reversals as soon as it can."""
    steps = rule.reversals + 1  # in turn one way and the other, starting with the one that takes fewer answers
    answers = (steps + 1) // 2 * min(rule.down, rule.up) + steps // 2 * max(rule.down, rule.up)
    return min(rule.trials, answers)


def target(rule: UpDown) -> float:
    """The probability of a right answer at the level around which a staircase settles.

    There, steps down and up weigh the same: `P down = (1 - P) up`, where `P` is the probability that `down` right
    answers in a row come before `up` wrong ones (Levitt 1971, Table I; Kaernbach 1991, Eq. 1). `P` is `p` to the power
    of `down` where one wrong answer steps up.
    """
    from scipy.optimize import brentq

    wanted = rule.up_times / (1.0 + rule.up_times)

    def above(p: float) -> float:
        q = 1.0 - p
        runs, misses = p ** (rule.down - 1), q ** (rule.up - 1)
        return runs * (1.0 - q**rule.up) / (runs + misses - runs * misses) - wanted

    return float(brentq(above, 1e-12, 1.0 - 1e-12, xtol=1e-12))
