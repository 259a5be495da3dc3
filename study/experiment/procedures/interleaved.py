"""Interleaved tracks: each transition of a study has a track of its own, and one for each side where shorter and longer
blends are both asked about, unless they share it. Which track a trial asks, and which side of a shared one, is drawn at
random, and trials that show no difference can stand among them. A rule (`study.models.tracks`) says which difference a
track shows, and when it stops.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from study.experiment.procedures.procedure import Adaptive, Course, Draw, Members
from study.models.tracks import Rule
from study.tasks.answer import Answer
from study.tasks.registry import TASKS, right_answer, task_of
from study.tasks.task import Asked
from study.tasks.trial import Pair, Trial, trial_of

Side = Literal["both", "shared", "shorter", "longer"]
SIGNS: Mapping[Side, tuple[tuple[int, ...], ...]] = {
    "both": ((-1,), (1,)),
    "shared": ((-1, 1),),
    "shorter": ((-1,),),
    "longer": ((1,),),
}
"""The signs of the differences that each track of a transition shows."""


@dataclass(frozen=True)
class Key:
    """Which track it is."""

    motion: str
    signs: tuple[int, ...]
    repeat: int


@dataclass(frozen=True)
class Turn:
    """What chance decides of a trial beforehand: which of the running tracks it asks and on which side (from 0 to 1),
    the order of its stimuli, and the pair that it shows where it shows no difference.
    """

    which: float
    members: Members
    same: Pair | None


Tracks = Mapping[Key, Any]


class Interleaving(Adaptive):
    """The settings of interleaved tracks. Subclasses are frozen dataclasses with these keys among their own."""

    side: Side
    catch_every: int

    @abstractmethod
    def levels(self) -> tuple[int, ...]:
        """All differences that may come, without their sign."""

    @abstractmethod
    def fewest(self) -> int:
        """The trials of a track that stops as soon as it can."""

    @abstractmethod
    def rule_of(self, task: str) -> Rule:
        """The rule by which its tracks go on."""

    def problems(self, asked: Asked) -> Iterator[tuple[str, str]]:
        """What does not fit the study: its task, its order, lists of differences, attention checks."""
        where = f"with {self.name!r} in the study {asked.name!r}"
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
        signed = {sign * level for signs in SIGNS[self.side] for sign in signs for level in self.levels()}
        return tuple(sorted(signed | ({0} if self.catch_every else set())))

    def trials(self, transitions: int, repeats: int) -> tuple[int, int]:
        """The fewest and the most trials, those without a difference among them."""
        count = transitions * repeats * len(SIGNS[self.side])
        fewest, most = count * self.fewest(), count * self.rule_of("").trials
        if not self.catch_every:
            return fewest, most
        between = self.catch_every - 1
        return fewest + (fewest - 1) // between, most + -(-most // between)

    def range_in_words(self) -> str:
        """The differences that may come, from the least to the largest."""
        shown = [difference for difference in self.differences() if difference]
        return f"differences from {_signed(min(shown))} to {_signed(max(shown))} frames"

    def course(self, draw: Draw, first: int) -> Course:
        """All that finds the trials again from the answers."""
        most = self.trials(len({pair.motion for pair in draw.pairs}), draw.repeats)[1]
        orders = draw.arrangements
        if draw.order == "by-group":
            orders = (orders[draw.group % len(orders)],)
        return Course(draw.study, first, most, self, draw.pairs, orders, draw.repeats)

    def begun(self, course: Course, rng: np.random.Generator) -> Interleaved:
        """The tracks of a stored course."""
        ladders: dict[Key, dict[int, Pair]] = {}
        signs_of = {sign: signs for signs in SIGNS[self.side] for sign in signs}
        same = [pair for pair in course.pairs if not pair.difference_frames]
        for repeat in range(1, course.repeats + 1):
            for pair in course.pairs:
                if difference := pair.difference_frames:
                    key = Key(pair.motion, signs_of[1 if difference > 0 else -1], repeat)
                    ladders.setdefault(key, {})[difference] = pair
        places = self._catch_places(course.most, rng)
        which, members = rng.random(course.most), rng.integers(0, len(course.arrangements), course.most)
        shown = rng.integers(0, max(len(same), 1), course.most)
        turns = tuple(
            Turn(float(which[n]), course.arrangements[members[n]], same[shown[n]] if n in places and same else None)
            for n in range(course.most)
        )
        right = {
            (pair.name, members): right_answer(trial_of(pair, members, 1))
            for pair in course.pairs
            for members in course.arrangements
        }
        return Interleaved(self.rule_of(course.pairs[0].task), course.first, ladders, turns, right)

    def _catch_places(self, count: int, rng: np.random.Generator) -> set[int]:
        """One place, from 0, in each run of `catch_every` trials."""
        if not self.catch_every:
            return set()
        starts = np.arange(0, count, self.catch_every)
        return {int(place) for place in starts + rng.integers(0, self.catch_every, len(starts))}


def _signed(frames: int) -> str:
    return f"{frames}".replace("-", "−")


@dataclass(frozen=True)
class Interleaved:
    """The interleaved tracks of one study (`Procedure`).

    `ladders` has the pairs of each track by their difference, `turns` what was drawn for each trial, `right` the right
    answer to each pair in each order.
    """

    rule: Rule
    first: int
    ladders: Mapping[Key, Mapping[int, Pair]]
    turns: tuple[Turn, ...]
    right: Mapping[tuple[str, Members], str | None]

    def next(self, answers: Sequence[Answer]) -> tuple[Trial, ...]:
        """The next trial; none once all tracks have stopped."""
        return self._trials(self._tracks(answers), len(answers))

    def candidates(self, answers: Sequence[Answer]) -> tuple[Trial | None, ...]:
        """The trials that may follow the next one: after a right answer, a wrong one, and none."""
        tracks, number = self._tracks(answers), len(answers)
        if not self._running(tracks):
            return (None,)
        key, _ = self._due(tracks, number)
        later = (self._trials(self._after(tracks, key, right), number + 1) for right in (True, False, None))
        return tuple(dict.fromkeys(trials[0] if trials else None for trials in later))

    def progress(self, answers: Sequence[Answer]) -> tuple[int, int]:
        """Trials, of the most that there may be; what a track did not need counts as done once it has stopped."""
        tracks, most = self._tracks(answers), len(self.turns)
        if not self._running(tracks):
            return most, most
        over = (track for track in tracks.values() if self.rule.over(track))
        return len(answers) + sum(self.rule.trials - self.rule.asked(track) for track in over), most

    def _tracks(self, answers: Sequence[Answer]) -> Tracks:
        """Where the tracks stand after all answers."""
        tracks: Tracks = {key: self.rule.begin() for key in self.ladders}
        for number, answer in enumerate(answers):
            key, pair = self._due(tracks, number)
            right = self.right[pair.name, self.turns[number].members]
            tracks = self._after(tracks, key, None if answer.value is None else answer.value == right)
        return tracks

    def _running(self, tracks: Tracks) -> list[Key]:
        return [key for key, track in tracks.items() if not self.rule.over(track)]

    def _due(self, tracks: Tracks, number: int) -> tuple[Key | None, Pair]:
        """What the trial of this place, from 0, shows, and its track; None for one without a difference."""
        turn, running = self.turns[number], self._running(tracks)
        if turn.same is not None:
            return None, turn.same
        which, on_side = divmod(turn.which * len(running), 1)
        key = running[int(which)]
        return key, self.ladders[key][key.signs[int(on_side * len(key.signs))] * self.rule.due(tracks[key])]

    def _trials(self, tracks: Tracks, number: int) -> tuple[Trial, ...]:
        """The trial of this place; none where all tracks have stopped."""
        if not self._running(tracks):
            return ()
        key, pair = self._due(tracks, number)
        trial = trial_of(pair, self.turns[number].members, key.repeat if key else 1)
        return (replace(trial, trial=self.first + number),)

    def _after(self, tracks: Tracks, key: Key | None, right: bool | None) -> Tracks:
        if key is not None:
            return {**tracks, key: self.rule.after(tracks[key], self.rule.due(tracks[key]), right)}
        if right is None:
            return tracks
        return {other: self.rule.beside(track, right) for other, track in tracks.items()}
