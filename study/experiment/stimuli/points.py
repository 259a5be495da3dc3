"""Transition points: the frames at which a blend starts and ends, and the blend length of each method there.

A protocol's conditions and the methods of a study come in; two clips, a start frame, an end frame and lengths go out.
Points are drawn at random, "to make the study independent of a particular transition metric" (2004 section 4.3), and
kept where the lengths that follow meet the conditions. Methods can have points of their own instead (2003 section 4.2).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from study.counting import counted, noun
from study.errors import MotionError, StimulusError, TransitionError
from study.experiment.chance import generator
from study.experiment.protocol.stimuli import Points, TransitionSpec
from study.experiment.protocol.whole import Protocol, StudySpec
from study.experiment.stimuli.supply import Needs, Supply, supply
from study.motion.clip import retarget
from study.transitions.methods.method import CANDIDATES, Method, OwnPoints, Room
from study.transitions.timewarp import WarpLength

if TYPE_CHECKING:
    from study.motion.library import Library
    from study.transitions.blend_length import BlendLength

ONE_FILM = "with one film for both methods"


@dataclass(frozen=True, eq=False)
class Settled:
    """A transition with its points and the blend length of each method; `optima` are points of methods' own."""

    transition: TransitionSpec
    source: Supply
    destination: Supply
    start_frame: int
    end_frame: int
    lengths: Mapping[str, BlendLength | WarpLength]
    tried: int
    optima: Mapping[str, tuple[int, int]] = field(default_factory=dict)

    def at(self, method: str) -> Settled:
        """The same with the points of one method, where methods have their own (`optima`)."""
        if method not in self.optima:
            return self
        start, end = self.optima[method]
        return replace(self, start_frame=start, end_frame=end)


@dataclass(frozen=True, eq=False)
class _Asked:
    """A transition of a study whose points are looked for: its conditions, methods and motions."""

    protocol: Protocol
    study: StudySpec
    transition: TransitionSpec
    points: Points
    methods: Mapping[str, Method]
    source: Supply
    destination: Supply

    @property
    def judged(self) -> Method:
        """The method whose length the conditions are about: the first whose length follows from the points."""
        following = (method for method in self.methods.values() if method.length.follows)
        return next(following, self.methods[self.study.reference])

    def settled(self, start: int, end: int, lengths: Mapping[str, BlendLength | WarpLength], tried: int = 1) -> Settled:
        """The transition at two points."""
        return Settled(self.transition, self.source, self.destination, start, end, lengths, tried)

    def lengths(self, methods: Iterable[Method], start: int, end: int) -> dict[str, BlendLength | WarpLength]:
        """The blend length of each of some methods at two points."""
        return {each.name: each.length_at(self.source.clip, self.destination.clip, start, end) for each in methods}


Alike = Callable[[StudySpec, "Settled"], bool]
"""Whether the two methods of a study would show one film at some points; see `films.alike`."""


def settle(
    protocol: Protocol, study: StudySpec, transition: TransitionSpec, library: Library, alike: Alike | None = None
) -> Settled:
    """Find the points of one transition of a study.

    With `alike`, points at which both methods would show one film are drawn again, and given ones are refused.

    Raises
    ------
    StimulusError
        Where motions are missing or too short (with the number of frames that are missing), where given points leave
        a level below one frame, or where no drawn points meet the conditions.
    """
    points, methods = protocol.points_for(study, transition), protocol.methods_of(study)
    source_needs, destination_needs = _needs(protocol, study, points, methods.values())
    source = supply(library, protocol.fps, transition.source, source_needs, points.source_within)
    destination = supply(library, protocol.fps, transition.destination, destination_needs, points.destination_within)
    destination = _on_rig_of(source, destination, transition)
    asked = _Asked(protocol, study, transition, points, methods, source, destination)
    if transition.name == study.example_transition and transition.source == transition.destination:
        return _at_itself(asked)
    if isinstance(methods[study.reference].points, OwnPoints):
        return _at_optima(asked, alike)
    return _drawn(asked, alike) if points.choose == "random" else _given(asked, alike)


def _on_rig_of(source: Supply, destination: Supply, transition: TransitionSpec) -> Supply:
    """The destination with the source's joints, and a note of what retargeting it changes."""
    try:
        moved = retarget(destination.clip, source.clip.skeleton)
    except MotionError as error:
        raise StimulusError(f"transition {transition.name!r}: {error}") from error
    said = moved.history[len(destination.clip.history) :]
    if source.clip.skeleton.matches(destination.clip.skeleton):
        return replace(destination, notes=(*destination.notes, *said))
    return replace(destination, clip=moved)


def _room(methods: Iterable[Method], fps: float, longest_frames: int | None) -> Room:
    """What some methods need together around their points."""
    rooms = [method.room(fps, longest_frames) for method in methods]
    return Room(*(max(getattr(room, key) for room in rooms) for key in ("blend", "search", "entry", "stay", "after")))


def _half(methods: Iterable[Method], longest: int) -> int:
    """Frames of the longest blend on either side of points that meet in its middle; 0 if no method has them so."""
    return (longest + 1) // 2 if any(method.make.centred for method in methods) else 0


def _needs(protocol: Protocol, study: StudySpec, points: Points, methods: Iterable[Method]) -> tuple[Needs, Needs]:
    """What the source needs around its point, and the destination around its."""
    methods = tuple(methods)
    room = _room(methods, protocol.fps, points.longest_frames)
    entry, after = max(protocol.entry_frames, room.entry), protocol.exit_frames + room.after
    longest = room.blend + max((0, *study.differences_frames)) + room.stay
    half = _half(methods, longest)
    entry, after = entry + half, after + half
    plenty = max(longest, room.search)
    blend = f"blends of up to {counted(longest, 'frame')}"
    whole = any(isinstance(method.points, OwnPoints) for method in methods)
    return (
        Needs(entry, plenty, entry, longest, f"{counted(entry, 'frame')} of entry and {blend}", whole),
        Needs(plenty - 1, after + 1, longest - 1, after + 1, f"{blend} and {counted(after, 'frame')} of exit", whole),
    )


def _at_optima(asked: _Asked, alike: Alike | None) -> Settled:
    """Each method at points of its own, such as a cut where its metric is least (2003 section 4.2)."""
    source, destination = asked.source, asked.destination
    same = asked.transition.source == asked.transition.destination
    shift = destination.first - source.first if same else None
    windows = source.window, destination.window
    optima: dict[str, tuple[int, int]] = {}
    lengths: dict[str, BlendLength | WarpLength] = {}
    for name, method in asked.methods.items():
        assert isinstance(method.points, OwnPoints), "a study whose methods differ in this is refused"
        optima[name] = method.points.best(source.clip, destination.clip, windows, shift)
        lengths |= asked.lengths([method], *optima[name])
    start, end = optima[asked.study.reference]
    settled = replace(asked.settled(start, end, lengths), optima=optima)
    _check_levels(asked, settled)
    if alike is not None and alike(asked.study, settled):
        raise StimulusError(
            f"transition {asked.transition.name!r}: expected {' and '.join(optima)} to cut at different points, found "
            f"both from frame {start} to {end}, so that the stimuli would be the same; choose other motions, or "
            "another part of them with source_within and destination_within."
        )
    return settled


def _at_itself(asked: _Asked) -> Settled:
    """From a motion to itself at one moment, so that a cut shows it as it is."""
    shift = asked.destination.first - asked.source.first
    first, stop = asked.source.window
    low, high = (frame - shift for frame in asked.destination.window)
    start = (max(first, low) + min(stop, high)) // 2
    if not max(first, low) <= start < min(stop, high):
        raise StimulusError(
            f"transition {asked.transition.name!r}: expected a moment of {asked.source.name!r} with entry and exit "
            "around it, found none; use a longer motion, or lower entry_s or exit_s."
        )
    return asked.settled(start, start + shift, asked.lengths(asked.methods.values(), start, start + shift))


def _check_levels(asked: _Asked, settled: Settled) -> None:
    """Refuse points at which a level of the study would fall below one frame."""
    study, length = asked.study, settled.lengths[asked.study.reference].blend_frames
    shortest = length + min((0, *study.differences_frames))
    if study.differences_frames and shortest < 1:
        raise StimulusError(
            f"transition {asked.transition.name!r}: a level below one frame: the {study.reference} blend here takes "
            f"{counted(length, 'frame')}, the difference {min(study.differences_frames)} leaves {shortest}. Choose "
            "other points, or other differences_frames."
        )


def _given(asked: _Asked, alike: Alike | None) -> Settled:
    """The points that the protocol gives, counted in the motion as the library supplies it."""
    study, name = asked.study, asked.transition.name
    start = _given_frame(asked, "source", asked.source)
    end = _given_frame(asked, "destination", asked.destination)
    try:
        lengths = asked.lengths(asked.methods.values(), start, end)
    except TransitionError as error:
        raise StimulusError(f"transition {name!r}: {error}") from error
    settled = asked.settled(start, end, lengths)
    _check_levels(asked, settled)
    if problem := _room_problem(asked, settled):
        raise StimulusError(f"transition {name!r}: {problem}")
    if alike is not None and alike(study, settled):
        raise StimulusError(
            f"transition {name!r}: expected two films by the methods {' and '.join(map(repr, study.methods))} of "
            f"the study {study.name!r}, found one at these points, where both make the same blend; give other points, "
            "or change a method or fixed_frames."
        )
    return settled


def _given_frame(asked: _Asked, end: str, motion: Supply) -> int:
    """The point that the protocol gives in the source or in the destination."""
    seconds, frame = getattr(asked.points, f"{end}_s"), getattr(asked.points, f"{end}_frame")
    given: int = round(seconds * asked.protocol.fps) if frame is None else frame
    at = given + motion.first
    if not motion.first <= at < motion.stop:
        raise StimulusError(
            f"transition {asked.transition.name!r}: expected {end}_frame from 0 to {motion.stop - motion.first - 1}, "
            f"the frames of {motion.name!r}, found {given}; choose another point."
        )
    return at


def _room_problem(asked: _Asked, settled: Settled) -> str:
    """What is missing around points for entry, the longest blend and exit; empty where nothing is."""
    room = _room(asked.methods.values(), asked.protocol.fps, asked.points.longest_frames)
    own = [length.blend_frames for length in settled.lengths.values()]
    reference = settled.lengths[asked.study.reference].blend_frames
    longest = max(*own, *(reference + d for d in asked.study.differences_frames), 0) + room.stay
    half = _half(asked.methods.values(), longest)
    entry, after = asked.protocol.entry_frames + half, asked.protocol.exit_frames + room.after + half
    rooms = (
        ("entry", entry, settled.start_frame, settled.source),
        ("the longest blend", longest, settled.source.clip.frames - settled.start_frame, settled.source),
        ("the longest blend", longest, settled.end_frame + 1, settled.destination),
        ("exit", after, settled.destination.clip.frames - 1 - settled.end_frame, settled.destination),
    )
    return "; ".join(
        f"expected {counted(needed, 'frame')} for {what}, found {there} in {motion.name!r}: {needed - there} "
        f"{noun(needed - there, 'is', 'are')} missing"
        for what, needed, there, motion in rooms
        if there < needed
    )


def _drawn(asked: _Asked, alike: Alike | None) -> Settled:
    """Pairs of frames at random, in the order drawn, until one meets the conditions."""
    starts, ends = np.arange(*asked.source.window), np.arange(*asked.destination.window)
    count, judged = len(starts) * len(ends), asked.judged
    others = [method for method in asked.methods.values() if method is not judged]
    # The name alone, so that studies that share a transition and its conditions share its points and stimuli.
    rng = generator(asked.protocol.seed, "points", asked.transition.name)
    reasons: dict[str, int] = {}
    seen: list[int] = []
    for tried, draw in enumerate(rng.choice(count, size=min(count, CANDIDATES), replace=False), start=1):
        start, end = int(starts[draw // len(ends)]), int(ends[draw % len(ends)])
        lengths = asked.lengths([judged], start, end)
        seen.append(lengths[judged.name].blend_frames)
        reason = _unmet(asked, judged, lengths[judged.name])
        if not reason and others:
            lengths |= asked.lengths(others, start, end)
            reason = next(filter(None, (_unmet(asked, each, lengths[each.name]) for each in others)), "")
        settled = asked.settled(start, end, lengths, tried)
        if not reason and _room_problem(asked, settled):
            reason = "no room for the longest blend"
        if not reason and alike is not None and alike(asked.study, settled):
            reason = ONE_FILM
        if not reason:
            return settled
        reasons[reason] = reasons.get(reason, 0) + 1
        if reasons[reason] >= _patience(asked, reason):
            break
    raise StimulusError(_none_found(asked, reasons, seen))


def _patience(asked: _Asked, reason: str) -> int:
    """How many draws may fail for a reason: fewer where it takes long to see."""
    if reason == ONE_FILM:
        return min(asked.judged.length.draws, *(method.make.draws for method in asked.methods.values()))
    slow = any(reason.startswith(f"{name}: ") for name in asked.methods)
    return min(each.length.draws for each in (asked.methods.values() if slow else (asked.judged,)))


def _unmet(asked: _Asked, method: Method, found: BlendLength | WarpLength) -> str:
    """The first condition that the blend of a method doesn't meet at drawn points; empty where all are met.

    The conditions are about all methods whose length follows from the points: none of them is shown outside of them.
    """
    points, length = asked.points, found.blend_frames
    whose = "" if method is asked.judged else f"{method.name}: "
    if length == 0 or (whose and not method.length.follows):
        return ""
    least = max(points.shortest_frames or 1, 1 - min((0, *asked.study.differences_frames)))
    if length < least:
        return f"{whose}shorter than {counted(least, 'frame')}"
    if points.longest_frames is not None and length > points.longest_frames:
        return f"{whose}longer than {counted(points.longest_frames, 'frame')}"
    if points.avoid_frames is not None and abs(length - points.avoid_frames) <= (points.avoid_within_frames or 0):
        return f"{whose}within {counted(points.avoid_within_frames or 0, 'frame')} of {points.avoid_frames}"
    least = points.least_warp_frames or 0
    if isinstance(found, WarpLength) and abs(found.source_frames - found.destination_frames) < least:
        return f"{whose}warped by less than {counted(least, 'frame')}"
    return ""


def _none_found(asked: _Asked, reasons: Mapping[str, int], seen: Sequence[int]) -> str:
    counts = ", ".join(f"{number} {reason}" for reason, number in reasons.items())
    return (
        f"transition {asked.transition.name!r}: expected points whose {asked.judged.name} blend meets the conditions "
        f"of the study {asked.study.name!r}, found none among {len(seen)} drawn ({counts}; lengths from {min(seen)} to "
        f"{counted(max(seen), 'frame')}). Widen the conditions, or choose other motions."
    )
