"""Films: which ones a study shows of a transition and how long they take, before any of them is made.

A study, settled points and the hops come in; pairs of `Film`s go out. Two films that are equal look the same, so this
is also where it shows that two methods would make one film.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from study.errors import SegueError
from study.experiment.protocol.whole import Protocol, StudySpec
from study.experiment.stimuli.hops import METHOD as HOP_METHOD
from study.experiment.stimuli.hops import Hop, Hops
from study.experiment.stimuli.points import Settled, settle
from study.transitions.timewarp import WarpLength

if TYPE_CHECKING:
    from study.motion.library import Library


@dataclass(frozen=True)
class Film:
    """What makes two stimuli the same: transition, points, blend, and nothing else.

    Parameters
    ----------
    transition, start_frame, end_frame, blend_frames
        Which transition, where, and how long.
    added
        Frames that were added in front of the two motions.
    hop
        The way by another motion; None for a direct blend.
    frames_on
        How long the destination goes on, so that both films of a pair end together.
    windows
        Source and destination frames of a time-warped blend; None where they are as many.
    """

    transition: str
    start_frame: int
    end_frame: int
    blend_frames: int
    added: tuple[int, int]
    hop: Hop | None = None
    frames_on: int = 0
    windows: tuple[int, int] | None = None

    def frames(self, protocol: Protocol) -> int:
        """Frames in all: entry, blend or hop, and exit."""
        entry, after = (round(s * protocol.fps) for s in (protocol.stimuli.entry_s, protocol.stimuli.exit_s))
        return entry + (self.blend_frames if self.hop is None else self.hop.frames) + self.frames_on + after


@dataclass(frozen=True, eq=False)
class Showing:
    """One film, or two that are compared: by `method_a`, and by `method_b` with so many frames of difference."""

    settled: Settled
    a: Film
    b: Film | None
    method_a: str
    method_b: str
    difference_frames: int | None

    @property
    def films(self) -> tuple[Film, ...]:
        """What is seen, in a trial."""
        return (self.a,) if self.b is None else (self.a, self.b)


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
    protocol: Protocol, library: Library, hops: Hops, progress: Callable[[int, int], None] | None = None
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
            settled = settle(protocol, study, transition, library, lambda one, points: alike(one, points, hops))
            planned.append(Planned(study, settled, tuple(showings(study, settled, hops))))
        except SegueError as error:
            problems[str(error)] = None
        if progress:
            progress(done, len(todo))
    return planned, list(problems)


def showings(study: StudySpec, settled: Settled, hops: Hops) -> Iterator[Showing]:
    """The pairs of one transition in one study, or its single films where they are rated one by one."""
    hop = hops.find(study, settled) if HOP_METHOD in study.methods else None
    a = _film(settled, study.reference, 0, hop)
    if study.task == "same-different":
        for difference in study.levels_of(settled.transition.name):
            other = _film(settled, study.reference, difference, hop)
            yield Showing(settled, a, other, study.reference, study.reference, difference)
    elif study.paired:
        method = study.comparison or study.reference
        yield Showing(settled, a, _film(settled, method, 0, hop), study.reference, method, None)
    else:
        for method in study.methods:
            yield Showing(settled, _film(settled, method, 0, hop), None, method, method, None)


def alike(study: StudySpec, settled: Settled, hops: Hops) -> bool:
    """Whether the two methods of a study would show one film at these points."""
    if study.comparison is None:
        return False
    hop = hops.find(study, settled) if HOP_METHOD in study.methods else None
    return _film(settled, study.reference, 0, hop) == _film(settled, study.comparison, 0, hop)


def _film(settled: Settled, method: str, difference: int, hop: Hop | None) -> Film:
    own, length = settled.at(method), settled.lengths[method]
    frames = length.blend_frames + difference
    # What stands beside a one-hop transition is shown for as long as that one takes.
    on = 0 if hop is None or method == HOP_METHOD else max(hop.frames - frames, 0)
    return Film(
        settled.transition.name,
        own.start_frame,
        own.end_frame,
        frames,
        (settled.source.added_before, settled.destination.added_before),
        hop if hop is not None and method == HOP_METHOD and not hop.at_once else None,
        on,
        (length.source_frames, length.destination_frames)
        if isinstance(length, WarpLength) and length.source_frames != length.destination_frames
        else None,
    )
