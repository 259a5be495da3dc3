"""Films: which ones a study shows of a transition and how long they take, before any of them is made.

A study, settled points and the ways of its methods come in; pairs of `Film`s go out. Two films that are equal look the
same, so this is also where it shows that two methods would make one film.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from study.counting import counted
from study.errors import SegueError, StimulusError
from study.experiment.chance import generator
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
        How much longer the destination is shown than `exit_s`: below 0 where less of it is.
    frames_before
        How much longer the source is shown than `entry_s`, likewise.
    """

    transition: str
    start_frame: int
    end_frame: int
    added: tuple[int, int]
    way: Way
    frames_on: int = 0
    frames_before: int = 0

    def frames(self, protocol: Protocol) -> int:
        """Frames in all: entry, transition and exit."""
        around = protocol.entry_frames + self.frames_before + self.frames_on + protocol.exit_frames
        return around + self.way.frames


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
        films = [
            _film(study, settled, method, added, ways)
            for method, added in zip(condition.methods, condition.added_frames, strict=True)
        ]
        if ways.protocol.stimuli.match == "duration":
            films = [films[0], *(_matched(ways.protocol, film, films[0]) for film in films[1:])]
        yield Showing(settled, condition, tuple(_jittered(ways.protocol, study, settled, condition, films)))


def _jittered(
    protocol: Protocol, study: StudySpec, settled: Settled, condition: Condition, films: Sequence[Film]
) -> Iterator[Film]:
    """Films that end earlier by chance; the two of one pair are drawn apart, also where they show the same blend."""
    most = round(protocol.stimuli.jitter_s * protocol.fps)
    rng = generator(protocol.seed, "jitter", study.name, settled.transition.name, condition.name)
    for film in films:
        yield replace(film, frames_on=film.frames_on - int(rng.integers(0, most + 1))) if most else film


def _matched(protocol: Protocol, film: Film, reference: Film) -> Film:
    """The film with its blend moved so that it has the reference's length and both are in their middle together.

    Where the blend is longer by `d` frames it starts `d / 2` earlier in the source and ends as much later in the
    destination. So both films begin and end with the same frames of the two motions, and run alongside each other all
    the time, in and out of the blend. (Of an odd `d` the second half is one frame longer.)
    """
    longer = film.way.frames - reference.way.frames
    before, after = longer // 2, longer - longer // 2
    if before > protocol.entry_frames or after > protocol.exit_frames:
        raise StimulusError(
            f"transition {film.transition!r}: expected an entry and an exit of {counted(max(before, after), 'frame')} "
            f'or more with match = "duration", which takes half of what a blend is longer from each, found '
            f"{protocol.entry_frames} and {protocol.exit_frames}; raise entry_s and exit_s."
        )
    # The frame after a blend is the one after its end point; after a cut it is the end point itself.
    cut = (film.way.frames == 0) - (reference.way.frames == 0)
    return replace(
        film,
        start_frame=reference.start_frame - before,
        end_frame=reference.end_frame + after + cut,
        frames_before=-before,
        frames_on=film.frames_on - after,
    )


def alike(study: StudySpec, settled: Settled, ways: Ways) -> bool:
    """Whether two methods of a study would show one film at these points."""
    films = [_film(study, settled, method, 0, ways) for method in study.methods]
    return len(set(films)) < len(films)


def _film(study: StudySpec, settled: Settled, method: str, difference: int, ways: Ways) -> Film:
    own, way = settled.at(method), ways.of(study, settled, method, difference)
    methods = ways.methods(study)
    # Beside some makes, the shorter of two transitions is shown for as long as the longer one takes.
    alone = ways.protocol.stimuli.match == "none"
    spans = methods if alone and any(each.make.sets_span for each in methods.values()) else ()
    on = max((ways.of(study, settled, name).frames - way.frames for name in spans), default=0)
    if lacking := way.lacking(ways.protocol.entry_frames, ways.protocol.exit_frames + on):
        raise StimulusError(f"transition {settled.transition.name!r}, {method}: {lacking}.")
    added = (settled.source.added_before, settled.destination.added_before)
    points = methods[method].make.placed(own.start_frame, own.end_frame, way.frames)
    return Film(settled.transition.name, *points, added, way, on)
