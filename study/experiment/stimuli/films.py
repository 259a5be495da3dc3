"""Films: which ones a study shows of a transition and how long they take, before any of them is made.

A study, settled points and the ways of its methods come in; pairs of `Film`s go out. Two films that are equal look the
same, so this is also where it shows that two methods would make one film.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from study.errors import SegueError, StimulusError
from study.experiment.protocol.whole import Protocol, StudySpec
from study.experiment.stimuli.points import Settled, settle
from study.experiment.stimuli.ways import Ways
from study.tasks.registry import task_of
from study.tasks.task import Condition
from study.transitions.methods.method import Way

if TYPE_CHECKING:
    from study.motion.library import Library


@dataclass(frozen=True)
class Film:
    """What makes two stimuli the same: transition, points, the way it is made, and nothing else.

    Parameters
    ----------
    transition, start_frame, end_frame
        Which transition, and where.
    added
        Frames that were added in front of the two motions.
    way
        How it is made, with its length.
    frames_on
        How long the destination continues, so that both films of a pair end together.
    """

    transition: str
    start_frame: int
    end_frame: int
    added: tuple[int, int]
    way: Way
    frames_on: int = 0

    def frames(self, protocol: Protocol) -> int:
        """Frames in all: entry, transition and exit."""
        return protocol.entry_frames + self.way.frames + self.frames_on + protocol.exit_frames


@dataclass(frozen=True, eq=False)
class Showing:
    """The films of one pair: what the task asks for, and how each of them is made."""

    settled: Settled
    condition: Condition
    films: tuple[Film, ...]


@dataclass(frozen=True, eq=False)
class Planned:
    """What one study shows of one transition."""

    study: StudySpec
    settled: Settled
    showings: tuple[Showing, ...]

    @property
    def for_practice(self) -> bool:
        """Whether practice alone shows it."""
        return self.settled.transition.name in self.study.practice_transitions


def plan_all(
    protocol: Protocol, library: Library, ways: Ways, progress: Callable[[int, int], None] | None = None
) -> tuple[list[Planned], list[str]]:
    """What every study shows of every transition, and the problems of what can't be shown, one sentence each."""
    todo = [
        (study, transition)
        for study in protocol.studies
        for transition in (*protocol.transitions_of(study), *protocol.practice_of(study))
    ]
    planned: list[Planned] = []
    problems: dict[str, None] = {}
    for done, (study, transition) in enumerate(todo, start=1):
        try:
            settled = settle(protocol, study, transition, library, lambda one, points: alike(one, points, ways))
            planned.append(Planned(study, settled, tuple(showings(study, settled, ways))))
        except SegueError as error:
            problems[str(error)] = None
        if progress:
            progress(done, len(todo))
    return planned, list(problems)


def showings(study: StudySpec, settled: Settled, ways: Ways) -> Iterator[Showing]:
    """The pairs of one transition in one study, or its single films where they are rated one by one."""
    for condition in task_of(study).conditions(study, settled.transition.name in study.practice_transitions):
        made = zip(condition.methods, condition.added_frames, strict=True)
        yield Showing(settled, condition, tuple(_film(study, settled, *each, ways) for each in made))


def alike(study: StudySpec, settled: Settled, ways: Ways) -> bool:
    """Whether the two methods of a study would show one film at these points."""
    if study.comparison is None:
        return False
    a, b = (_film(study, settled, method, 0, ways) for method in (study.reference, study.comparison))
    return a == b


def _film(study: StudySpec, settled: Settled, method: str, difference: int, ways: Ways) -> Film:
    own, way = settled.at(method), ways.of(study, settled, method, difference)
    # What stands beside a one-hop transition is shown for as long as that one takes.
    spans = [name for name, each in ways.methods(study).items() if each.make.sets_span and name != method]
    on = max(0, *(ways.of(study, settled, name).frames - way.frames for name in spans), 0)
    if lacking := way.lacking(ways.protocol.entry_frames, ways.protocol.exit_frames + on):
        raise StimulusError(f"transition {settled.transition.name!r}, {method}: {lacking}.")
    added = (settled.source.added_before, settled.destination.added_before)
    return Film(settled.transition.name, own.start_frame, own.end_frame, added, way, on)
