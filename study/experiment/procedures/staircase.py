"""Staircases: the difference of a trial depends on the answers before it (Levitt 1971; Kaernbach 1991).

Each transition of a study has a staircase of its own, and one for each side where shorter and longer blends are both
asked about; they are interleaved at random. Trials that show no difference can stand among them: they tell how often
"different" is answered where nothing differs, and move no staircase.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Le

from study.experiment.procedures.procedure import Adaptive, Course, Draw, Members
from study.models.up_down import Track, UpDown, fewest_trials, moved, reachable, stopped, target
from study.settings import SettingsError, required, setting
from study.tasks.answer import Answer
from study.tasks.registry import TASKS, right_answer, task_of
from study.tasks.task import Asked
from study.tasks.trial import Pair, Trial, trial_of

SIGNS = {"both": (-1, 1), "shorter": (-1,), "longer": (1,)}


@dataclass(frozen=True)
class Staircase(Adaptive):
    """The keys of `[studies.procedure]` with `name = "staircase"`."""

    name: ClassVar[str] = "staircase"
    title: ClassVar[str] = "adaptive staircases"
    sources: ClassVar[tuple[str, ...]] = (
        "Levitt, H. (1971). Transformed up-down methods in psychoacoustics. Journal of the Acoustical Society of "
        "America, 49, 467–477.",
        "Kaernbach, C. (1991). Simple adaptive testing with the weighted up-down method. Perception & Psychophysics, "
        "49, 227–229.",
    )

    start_frames: Annotated[int, Ge(1), Le(400)] = required("Difference of the first trial. [frames]")
    most_frames: Annotated[int, Ge(1), Le(400)] = required("Largest difference that is shown. [frames]")
    least_frames: Annotated[int, Ge(1), Le(400)] = setting(1, "Smallest difference that is shown. [frames]")
    steps_frames: tuple[Annotated[int, Ge(1), Le(400)], ...] = setting(
        (4, 2, 1),
        "Sizes of the steps down: the first until the first reversal, the second until the second, and so on; the last "
        "one stays. [frames]",
    )
    down: Annotated[int, Ge(1), Le(10)] = setting(
        2, "Right responses in a row after which the difference becomes smaller."
    )
    up: Annotated[int, Ge(1), Le(10)] = setting(1, "Wrong responses in a row after which it becomes larger.")
    up_times: Annotated[int, Ge(1), Le(20)] = setting(
        1, "How many times as large as steps down the steps up are; with `down = 1`, 3 aims at 75% and 4 at 80%."
    )
    side: Literal["both", "shorter", "longer"] = setting("both", "Which blends are compared with the reference.")
    reversals: Annotated[int, Ge(2), Le(100)] = setting(8, "Number of reversals after which a staircase stops.")
    averaged: Annotated[int, Ge(1), Le(100)] = setting(6, "Number of last reversals whose mean is the threshold.")
    most_trials: Annotated[int, Ge(2), Le(1000)] = setting(
        50, "Trials after which a staircase stops in any case. [trials]"
    )
    catch_every: Annotated[int, Ge(0), Le(1000)] = setting(
        5, "One trial in this number shows no difference; 0 for none. [trials]"
    )

    def __post_init__(self) -> None:
        if not self.least_frames <= self.start_frames <= self.most_frames:
            raise SettingsError(
                "start_frames",
                f"expected from least_frames to most_frames, {self.least_frames} to {self.most_frames}, found "
                f"{self.start_frames}; change one",
            )
        if not self.steps_frames:
            raise SettingsError("steps_frames", "expected one step or more, found none; add one")
        if self.averaged > self.reversals:
            raise SettingsError(
                "averaged", f"expected at most the {self.reversals} reversals, found {self.averaged}; lower it"
            )
        if self.catch_every == 1:
            raise SettingsError(
                "catch_every", "expected 0 or 2 and more, found 1, which leaves no other trial; raise it"
            )

    @property
    def rule(self) -> UpDown:
        """The rule by which each staircase moves."""
        return UpDown(
            self.start_frames,
            self.steps_frames,
            self.least_frames,
            self.most_frames,
            self.down,
            self.up,
            self.up_times,
            self.reversals,
            self.most_trials,
            self.averaged,
        )

    def problems(self, asked: Asked) -> Iterator[tuple[str, str]]:
        """What does not fit the study: its task, its order, lists of differences, attention checks."""
        where = f"with staircases in the study {asked.name!r}"
        takers = [task.asked_as for task in TASKS.values() if "differences_frames" in task.keys]
        if asked.task not in takers:
            yield "procedure", f"expected a {' or '.join(takers)} task {where}, found {asked.task!r}; change one"
        elif self.catch_every and any(key == "differences_frames" for key, _ in task_of(asked).problems(asked)):
            yield (
                "procedure",
                f"expected catch_every = 0 {where}: every trial of {asked.task!r} shows a difference; write it",
            )
        if asked.order not in ("random", "by-group"):
            yield "order", f"expected 'random' or 'by-group' {where}, found {asked.order!r}; change it"
        if asked.attention_checks:
            yield "attention_checks", f"expected no attention_checks {where}: catch_every tells who looks; remove it"

    def differences(self) -> tuple[int, ...]:
        """All differences that may come, signed; 0 where trials without one are among them."""
        levels = reachable(self.rule)
        signed = {sign * level for sign in SIGNS[self.side] for level in levels}
        return tuple(sorted(signed | ({0} if self.catch_every else set())))

    def trials(self, transitions: int, repeats: int) -> tuple[int, int]:
        """The fewest and the most trials, those without a difference among them."""
        count = transitions * repeats * len(SIGNS[self.side])
        fewest, most = count * fewest_trials(self.rule), count * self.most_trials
        if not self.catch_every:
            return fewest, most
        between = self.catch_every - 1
        return fewest + (fewest - 1) // between, most + -(-most // between)

    def in_words(self) -> str:
        """The rule, its target, and the differences that may come."""
        weights = f" with steps up {self.up_times} times as large as steps down" if self.up_times > 1 else ""
        levels = [difference for difference in self.differences() if difference]
        return (
            f"{self.up}-up/{self.down}-down staircases{weights}, which aim at {100 * target(self.rule):.1f}% right "
            f"responses, with differences from {_signed(min(levels))} to {_signed(max(levels))} frames"
        )

    def course(self, draw: Draw, first: int) -> Course:
        """All that finds the trials again from the answers."""
        most = self.trials(len({pair.motion for pair in draw.pairs}), draw.repeats)[1]
        orders = draw.arrangements
        if draw.order == "by-group":
            orders = (orders[draw.group % len(orders)],)
        return Course(draw.study, first, most, self, draw.pairs, orders, draw.repeats)

    def begun(self, course: Course, rng: np.random.Generator) -> Staircases:
        """The staircases of a stored course."""
        ladders: dict[_Key, dict[int, Pair]] = {}
        same = [pair for pair in course.pairs if not pair.difference_frames]
        for repeat in range(1, course.repeats + 1):
            for pair in course.pairs:
                if difference := pair.difference_frames:
                    key = _Key(pair.motion, difference > 0, repeat)
                    ladders.setdefault(key, {})[abs(difference)] = pair
        places = self._catch_places(course.most, rng)
        which, members = rng.random(course.most), rng.integers(0, len(course.arrangements), course.most)
        shown = rng.integers(0, max(len(same), 1), course.most)
        turns = tuple(
            _Turn(float(which[n]), course.arrangements[members[n]], same[shown[n]] if n in places and same else None)
            for n in range(course.most)
        )
        right = {
            (pair.name, members): right_answer(trial_of(pair, members, 1))
            for pair in course.pairs
            for members in course.arrangements
        }
        return Staircases(self.rule, course.first, ladders, turns, right)

    def _catch_places(self, count: int, rng: np.random.Generator) -> set[int]:
        """One place, from 0, in each run of `catch_every` trials."""
        if not self.catch_every:
            return set()
        starts = np.arange(0, count, self.catch_every)
        return {int(place) for place in starts + rng.integers(0, self.catch_every, len(starts))}


def _signed(frames: int) -> str:
    return f"{frames}".replace("-", "−")


@dataclass(frozen=True)
class _Key:
    """Which staircase it is."""

    motion: str
    longer: bool
    repeat: int


@dataclass(frozen=True)
class _Turn:
    """What chance decides of a trial beforehand: which of the open staircases it asks (from 0 to 1), the order of its
    stimuli, and the pair that it shows where it shows no difference.
    """

    which: float
    members: Members
    same: Pair | None


Tracks = Mapping[_Key, Track]


@dataclass(frozen=True)
class Staircases:
    """The interleaved staircases of one study (`Procedure`).

    `ladders` has the pairs of each staircase by their level, `turns` what was drawn for each trial, `right` the right
    answer to each pair in each order.
    """

    rule: UpDown
    first: int
    ladders: Mapping[_Key, Mapping[int, Pair]]
    turns: tuple[_Turn, ...]
    right: Mapping[tuple[str, Members], str | None]

    def next(self, answers: Sequence[Answer]) -> tuple[Trial, ...]:
        """The next trial; none once all staircases have stopped."""
        return self._trials(self._tracks(answers), len(answers))

    def candidates(self, answers: Sequence[Answer]) -> tuple[Trial | None, ...]:
        """The trials that may follow the next one: after a right answer, a wrong one, and none."""
        tracks, number = self._tracks(answers), len(answers)
        if not self._running(tracks):
            return (None,)
        key, _ = self._due(tracks, number)
        later = (self._trials(self._moved(tracks, key, right), number + 1) for right in (True, False, None))
        return tuple(dict.fromkeys(trials[0] if trials else None for trials in later))

    def progress(self, answers: Sequence[Answer]) -> tuple[int, int]:
        """Trials, of the most that there may be; what a staircase did not need counts as done once it has stopped."""
        tracks, most = self._tracks(answers), len(self.turns)
        if not self._running(tracks):
            return most, most
        spared = sum(self.rule.trials - track.trials for track in tracks.values() if stopped(track, self.rule))
        return len(answers) + spared, most

    def _tracks(self, answers: Sequence[Answer]) -> Tracks:
        """Where the staircases stand after all answers."""
        tracks: Tracks = {key: Track(self.rule.start) for key in self.ladders}
        for number, answer in enumerate(answers):
            key, pair = self._due(tracks, number)
            right = self.right[pair.name, self.turns[number].members]
            tracks = self._moved(tracks, key, None if answer.value is None else answer.value == right)
        return tracks

    def _running(self, tracks: Tracks) -> list[_Key]:
        return [key for key, track in tracks.items() if not stopped(track, self.rule)]

    def _due(self, tracks: Tracks, number: int) -> tuple[_Key | None, Pair]:
        """What the trial of this place, from 0, shows, and its staircase; None for one without a difference."""
        turn, running = self.turns[number], self._running(tracks)
        if turn.same is not None:
            return None, turn.same
        key = running[int(turn.which * len(running))]
        return key, self.ladders[key][tracks[key].level]

    def _trials(self, tracks: Tracks, number: int) -> tuple[Trial, ...]:
        """The trial of this place; none where all staircases have stopped."""
        if not self._running(tracks):
            return ()
        key, pair = self._due(tracks, number)
        trial = trial_of(pair, self.turns[number].members, key.repeat if key else 1)
        return (replace(trial, trial=self.first + number),)

    def _moved(self, tracks: Tracks, key: _Key | None, right: bool | None) -> Tracks:
        return tracks if key is None else {**tracks, key: moved(tracks[key], self.rule, right)}
