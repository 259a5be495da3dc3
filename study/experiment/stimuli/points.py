"""Transition points: motions long enough for entry, blend and exit, and the frames at which a blend starts and ends.

Motions of a library and a protocol's conditions come in; two clips, a start frame, an end frame and the blend length
of each method go out. Points are drawn at random, "to make the study independent of a particular transition metric"
(2004 section 4.3), and kept where the lengths that follow meet the conditions. A cyclic motion that is too short is
extended by whole cycles; points are always drawn within the part that the library supplied. Cuts can stand where a
metric is least instead (2003 section 4.2).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from study.counting import counted, noun
from study.errors import MotionError, StimulusError, TransitionError
from study.experiment.chance import generator
from study.experiment.protocol.whole import OPTIMUM_CUTS, Points, Protocol, StudySpec, TransitionSpec
from study.motion.clip import Clip, resample, retarget
from study.transitions.blend_length import BlendLength, blend_length
from study.transitions.candidates import APART_S, frame_costs
from study.transitions.timewarp import WarpLength, warp_length

if TYPE_CHECKING:
    from study.motion.library import Library

CANDIDATES = 2000
"""So many pairs of frames are tried before a transition is refused."""

WARPS = 150
"""So many of them at most with all of their time-warped blends, which take a hundred times longer to cost."""

HOPS = 20
"""So many with a search for the hop, each."""

ONE_FILM = "with one film for both methods"

_FOLLOWING = ("geodesic", "velocity", "timewarp")

LONGEST_BLEND_S = 2.0
FREEDOM_S = 1.0
"""Points are drawn within a second or more of motion: a whole cycle of a gait."""


@dataclass(frozen=True)
class Needs:
    """Frames around a point: `before` it, and `after` (the point itself counted), with the least that will do.

    With `whole`, a synthetic motion is made as long as it is by itself, so that the best point can be looked for in it.
    """

    before: int
    after: int
    least_before: int
    least_after: int
    words: str
    whole: bool = False


@dataclass(frozen=True, eq=False)
class Supply:
    """A motion as it is used.

    `first` and `stop` bound the frames that the library supplied, as a slice counts them; those before and after
    were added by extension. `window` are the frames in which a point may lie.
    """

    name: str
    clip: Clip
    first: int
    stop: int
    window: tuple[int, int]
    file: str
    notes: tuple[str, ...] = ()

    @property
    def added_before(self) -> int:
        """Frames added before the captured ones."""
        return self.first

    @property
    def added_after(self) -> int:
        """Frames added after the captured ones."""
        return self.clip.frames - self.stop


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
    points = protocol.points_for(study, transition)
    source_needs, destination_needs = _needs(protocol, study, points)
    source = _supply(protocol, library, transition.source, source_needs, points.source_within)
    destination = _supply(protocol, library, transition.destination, destination_needs, points.destination_within)
    destination = _on_rig_of(source, destination, transition)
    if study.reference in OPTIMUM_CUTS:
        return _at_optima(study, transition, source, destination)
    if points.choose == "random":
        return _drawn(protocol, study, transition, points, source, destination, alike)
    settled = _given(protocol, study, transition, points, source, destination)
    if alike is not None and alike(study, settled):
        raise StimulusError(
            f"transition {transition.name!r}: expected two films by the methods {study.reference!r} and "
            f"{study.comparison!r} of the study {study.name!r}, found one at these points, where both make the same "
            "blend; give other points, or change a method or fixed_frames."
        )
    return settled


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


def _needs(protocol: Protocol, study: StudySpec, points: Points) -> tuple[Needs, Needs]:
    """What the source needs around its point, and the destination around its."""
    entry = round(protocol.stimuli.entry_s * protocol.fps)
    after_exit = round(protocol.stimuli.exit_s * protocol.fps)
    search = round(LONGEST_BLEND_S * protocol.fps)
    longest = min(points.longest_frames or search, search) + max((0, *study.differences_frames))
    fixed = protocol.fixed_frames_of(study)
    if "fixed" in study.methods:
        longest = max(longest, fixed + max((0, *study.differences_frames)))
    if all(method.startswith("cut") for method in study.methods):
        longest = search = 1
    if "timewarp" in study.methods:
        # A warped pose lies between two frames, of which one may be the frame before the window (2004 Eqs. 5, 6).
        entry, longest, search = max(entry, 1), longest + 1, search + 1
    if "one-hop" in study.methods:
        # The source plays on for a stay, the destination for both stays and a second blend.
        stay = round(study.one_hop.stay_s * protocol.fps)
        longest = max(longest, fixed) if len(study.methods) > 1 else fixed
        longest, after_exit = longest + stay, after_exit + 2 * stay + fixed
    room = max(longest, search)
    blend, whole = f"blends of up to {counted(longest, 'frame')}", study.reference in OPTIMUM_CUTS
    return (
        Needs(entry, room, entry, longest, f"{counted(entry, 'frame')} of entry and {blend}", whole),
        Needs(
            room - 1,
            after_exit + 1,
            longest - 1,
            after_exit + 1,
            f"{blend} and {counted(after_exit, 'frame')} of exit",
            whole,
        ),
    )


def _supply(
    protocol: Protocol, library: Library, name: str, needs: Needs, within: tuple[float, float] | None
) -> Supply:
    """A motion of the library, extended where it is too short and cyclic."""
    freedom = round(FREEDOM_S * protocol.fps)
    # Captured motions come as they are, so that what is added to them is known.
    made = library.synthetic and not needs.whole
    seconds = (needs.before + needs.after + 4 * freedom) / protocol.fps if made else None
    try:
        clip = library.clip(name, fps=protocol.fps, min_seconds=seconds)
        entry = library.entry(name)
    except MotionError as error:
        raise StimulusError(f"motion {name!r}: {error}") from error
    span = within or (0.0, 1.0)
    low = min(int(np.ceil(span[0] * clip.frames)), clip.frames - 1)
    motion = _Motion(
        clip,
        lambda: library.clip(name, min_seconds=seconds),
        (low, max(int(span[1] * clip.frames), low + 1)),
        (bool(entry.cyclic_start), bool(entry.cyclic_end)),
    )
    why = ""
    for before, after in ((needs.before, needs.after), (needs.least_before, needs.least_after)):
        try:
            longer, first, window, notes = _extended(motion, before, after, freedom)
        except MotionError as error:
            why = str(error)
            continue
        return Supply(name, longer, first, first + clip.frames, window, library.where(entry), notes)
    missing = _missing(motion, needs.least_before, needs.least_after)
    raise StimulusError(
        f"motion {name!r}: expected {counted(needs.least_before + needs.least_after, 'frame')} at "
        f"{protocol.fps:g} fps around a transition point ({needs.words}), found {clip.frames} in {library.name}: "
        f"{counted(missing, 'frame is', 'frames are')} missing. {why} Or lower entry_s, exit_s or longest_frames."
    )


@dataclass(frozen=True, eq=False)
class _Motion:
    """A motion as the library has it: at the protocol's frame rate, at its own, and what may be done with it.

    `wanted` are the frames in which a point may lie, `cyclic` whether it can be continued before its start and after
    its end.
    """

    clip: Clip
    captured: Callable[[], Clip]
    wanted: tuple[int, int]
    cyclic: tuple[bool, bool]


def _missing(motion: _Motion, before: int, after: int) -> int:
    """Frames that lack around the best point."""
    points = np.arange(*motion.wanted)
    lacking = np.maximum(before - points, 0) + np.maximum(points + after - motion.clip.frames, 0)
    return int(lacking.min())


def _extended(
    motion: _Motion, before: int, after: int, freedom: int
) -> tuple[Clip, int, tuple[int, int], tuple[str, ...]]:
    """The clip with room around its points: the clip, its first captured frame, the points' window, notes.

    `MotionError` where it has no room and can't be given any.
    """
    clip, (low, high) = motion.clip, motion.wanted
    enough = min(freedom, high - low)
    legal = (max(low, before), min(high, clip.frames - after + 1))
    if legal[1] - legal[0] >= enough:
        return clip, 0, legal, ()
    target = _target(clip.frames, motion.wanted, before, after, enough, motion.cyclic)
    if target is None:
        raise MotionError(f"It can't be continued{_where(motion.cyclic)}: use a longer motion.")
    missing_before = max(0, before - target[0])
    missing_after = max(0, target[1] - 1 + after - clip.frames)
    if missing_before == missing_after == 0:
        return clip, 0, target, ()
    return _continued(motion, target, missing_before, missing_after)


def _continued(
    motion: _Motion, target: tuple[int, int], before: int, after: int
) -> tuple[Clip, int, tuple[int, int], tuple[str, ...]]:
    """Extended at the motion's own frame rate, which shows its cycles best, then at the protocol's."""
    from study.motion.cycles import extend

    captured = motion.captured()
    ratio = captured.fps / motion.clip.fps
    # One frame more behind, since the last one may fall between two.
    extension = extend(
        captured,
        frames_before=int(np.ceil(before * ratio)),
        frames_after=int(np.ceil((after + 1) * ratio)) if after else 0,
    )
    clip = resample(extension.clip, motion.clip.fps)
    first = int(np.ceil(extension.added_before / ratio - 1e-6))
    return clip, first, (target[0] + first, target[1] + first), (extension.note,)


def _where(cyclic: tuple[bool, bool]) -> str:
    sides = [side for side, can in zip(("before its start", "after its end"), cyclic, strict=True) if not can]
    return f" {' or '.join(sides)}" if sides else ""


def _target(
    frames: int, wanted: tuple[int, int], before: int, after: int, enough: int, ends: tuple[bool, bool]
) -> tuple[int, int] | None:
    """The stretch of frames to draw points from: about the middle of what is wanted, moved off ends that are fixed."""
    low = wanted[0] if ends[0] else max(wanted[0], before)
    high = wanted[1] if ends[1] else min(wanted[1], frames - after + 1)
    if low >= high:
        return None
    middle = (wanted[0] + wanted[1] - enough) // 2
    first = min(max(middle, low), max(high - enough, low))
    return first, min(first + enough, high)


def _at_optima(study: StudySpec, transition: TransitionSpec, source: Supply, destination: Supply) -> Settled:
    """Each method's cut where its metric is least over all frames that leave room (2003 section 4.2)."""
    rows, columns = slice(*source.window), slice(*destination.window)
    optima: dict[str, tuple[int, int]] = {}
    for method in study.methods:
        costs = frame_costs(source.clip, destination.clip, OPTIMUM_CUTS[method])[rows, columns].copy()
        if transition.source == transition.destination:
            # From a frame to itself is no transition, nor to its neighbours.
            own = np.arange(*source.window)[:, None] - source.first, np.arange(*destination.window) - destination.first
            costs[np.abs(own[0] - own[1]) < APART_S * source.clip.fps] = np.inf
        row, column = np.unravel_index(int(np.argmin(costs)), costs.shape)
        optima[method] = (rows.start + int(row), columns.start + int(column))
    if len(set(optima.values())) < len(optima):
        start, end = optima[study.reference]
        raise StimulusError(
            f"transition {transition.name!r}: expected {' and '.join(optima)} to cut at different points, found both "
            f"from frame {start} to {end}, so that the stimuli would be the same; choose other motions, or another "
            "part of them with source_within and destination_within."
        )
    none: dict[str, BlendLength | WarpLength] = {method: BlendLength(method, 0, 0.0, float("nan")) for method in optima}
    return Settled(transition, source, destination, *optima[study.reference], none, 1, optima)


def lengths_at(
    protocol: Protocol,
    study: StudySpec,
    source: Clip,
    destination: Clip,
    start: int,
    end: int,
    methods: Sequence[str] | None = None,
) -> dict[str, BlendLength | WarpLength]:
    """The blend length of each of a study's methods (or of some) at two points."""
    found: dict[str, BlendLength | WarpLength] = {}
    for method in methods or study.methods:
        if method == "timewarp":
            found[method] = warp_length(source, destination, start, end)
            continue
        if method == "cut":
            found[method] = BlendLength("cut", 0, 0.0, float("nan"))
            continue
        found[method] = blend_length(
            source,
            destination,
            start,
            end,
            method="fixed" if method == "one-hop" else method,
            fixed_frames=protocol.fixed_frames_of(study),
            specification=protocol.stimuli.specification,
        )
    return found


def _given(
    protocol: Protocol,
    study: StudySpec,
    transition: TransitionSpec,
    points: Points,
    source: Supply,
    destination: Supply,
) -> Settled:
    """The points that the protocol gives, counted in the motion as the library supplies it."""
    frames = []
    for end, supply in (("source", source), ("destination", destination)):
        seconds, frame = getattr(points, f"{end}_s"), getattr(points, f"{end}_frame")
        given = round(seconds * protocol.fps) if frame is None else frame
        at = given + supply.first
        if not supply.first <= at < supply.stop:
            raise StimulusError(
                f"transition {transition.name!r}: expected {end}_frame from 0 to {supply.stop - supply.first - 1}, the "
                f"frames of {supply.name!r}, found {given}; choose another point."
            )
        frames.append(at)
    try:
        lengths = lengths_at(protocol, study, source.clip, destination.clip, frames[0], frames[1])
    except TransitionError as error:
        raise StimulusError(f"transition {transition.name!r}: {error}") from error
    shortest = lengths[study.reference].blend_frames + min((0, *study.differences_frames))
    if study.differences_frames and shortest < 1:
        raise StimulusError(
            f"transition {transition.name!r}: a level below one frame: the {study.reference} blend here takes "
            f"{counted(lengths[study.reference].blend_frames, 'frame')}, the difference "
            f"{min(study.differences_frames)} leaves {shortest}. Choose other points, or other differences_frames."
        )
    settled = Settled(transition, source, destination, frames[0], frames[1], lengths, 1)
    if problem := _room_problem(protocol, study, settled):
        raise StimulusError(f"transition {transition.name!r}: {problem}")
    return settled


def level_lengths(study: StudySpec, lengths: Mapping[str, BlendLength | WarpLength]) -> list[int]:
    """All blend lengths that a study shows, in frames."""
    own = [length.blend_frames for length in lengths.values()]
    return own + [lengths[study.reference].blend_frames + d for d in study.differences_frames]


def _room_problem(protocol: Protocol, study: StudySpec, settled: Settled) -> str:
    """What is missing around given points for entry, the longest blend and exit; empty where nothing is."""
    entry, after = (round(s * protocol.fps) for s in (protocol.stimuli.entry_s, protocol.stimuli.exit_s))
    longest = max(level_lengths(study, settled.lengths))
    if "one-hop" in study.methods:
        stay = round(study.one_hop.stay_s * protocol.fps)
        longest, after = longest + stay, after + 2 * stay + protocol.fixed_frames_of(study)
    rooms = (
        ("entry", entry, settled.start_frame, settled.source),
        ("the longest blend", longest, settled.source.clip.frames - settled.start_frame, settled.source),
        ("the longest blend", longest, settled.end_frame + 1, settled.destination),
        ("exit", after, settled.destination.clip.frames - 1 - settled.end_frame, settled.destination),
    )
    return "; ".join(
        f"expected {counted(needed, 'frame')} for {what}, found {there} in {supply.name!r}: {needed - there} "
        f"{noun(needed - there, 'is', 'are')} missing"
        for what, needed, there, supply in rooms
        if there < needed
    )


def _drawn(
    protocol: Protocol,
    study: StudySpec,
    transition: TransitionSpec,
    points: Points,
    source: Supply,
    destination: Supply,
    alike: Alike | None,
) -> Settled:
    """Pairs of frames at random, in the order drawn, until one meets the conditions."""
    starts, ends = np.arange(*source.window), np.arange(*destination.window)
    count = len(starts) * len(ends)
    # The name alone, so that studies that share a transition and its conditions share its points and stimuli.
    rng = generator(protocol.seed, "points", transition.name)
    reasons: dict[str, int] = {}
    seen: list[int] = []
    judged = judged_method(study)
    for tried, draw in enumerate(rng.choice(count, size=min(count, CANDIDATES), replace=False), start=1):
        start, end = int(starts[draw // len(ends)]), int(ends[draw % len(ends)])
        clips = source.clip, destination.clip
        lengths = lengths_at(protocol, study, *clips, start, end, (judged,))
        seen.append(lengths[judged].blend_frames)
        reason = _unmet(study, points, lengths[judged])
        if not reason and study.comparison is not None:
            lengths |= lengths_at(protocol, study, *clips, start, end, [m for m in study.methods if m != judged])
            reason = _unwarped(points, lengths)
        settled = Settled(transition, source, destination, start, end, lengths, tried)
        if not reason and _room_problem(protocol, study, settled):
            reason = "no room for the longest blend"
        if not reason and alike is not None and alike(study, settled):
            reason = ONE_FILM
        if not reason:
            return settled
        reasons[reason] = reasons.get(reason, 0) + 1
        if reasons[reason] >= _patience(study, reason):
            break
    raise StimulusError(_none_found(study, transition, reasons, seen))


def judged_method(study: StudySpec) -> str:
    """The method whose length the conditions are about: the first whose length follows from the points."""
    return next((method for method in study.methods if method in _FOLLOWING), study.reference)


def _patience(study: StudySpec, reason: str) -> int:
    """How many draws may fail for a reason that takes long to see."""
    if reason == ONE_FILM and "one-hop" in study.methods:
        return HOPS
    slow = reason.startswith("warped") or judged_method(study) == "timewarp"
    return WARPS if slow else CANDIDATES


def _unmet(study: StudySpec, points: Points, found: BlendLength | WarpLength) -> str:
    """The first condition that a drawn transition doesn't meet; empty where all are met."""
    length = found.blend_frames
    if length == 0:
        return ""
    least = max(points.shortest_frames or 1, 1 - min((0, *study.differences_frames)))
    if length < least:
        return f"shorter than {counted(least, 'frame')}"
    if points.longest_frames is not None and length > points.longest_frames:
        return f"longer than {counted(points.longest_frames, 'frame')}"
    if points.avoid_frames is not None and abs(length - points.avoid_frames) <= (points.avoid_within_frames or 0):
        return f"within {counted(points.avoid_within_frames or 0, 'frame')} of {points.avoid_frames}"
    return ""


def _unwarped(points: Points, lengths: Mapping[str, BlendLength | WarpLength]) -> str:
    """What a time-warped blend lacks to be accepted; empty where it lacks nothing."""
    least = points.least_warp_frames or 0
    for length in lengths.values():
        if isinstance(length, WarpLength) and abs(length.source_frames - length.destination_frames) < least:
            return f"warped by less than {counted(least, 'frame')}"
    return ""


def _none_found(study: StudySpec, transition: TransitionSpec, reasons: Mapping[str, int], seen: Sequence[int]) -> str:
    counts = ", ".join(f"{number} {reason}" for reason, number in reasons.items())
    return (
        f"transition {transition.name!r}: expected points whose {judged_method(study)} blend meets the conditions "
        f"of the study {study.name!r}, found none among {len(seen)} drawn ({counts}; lengths from {min(seen)} to "
        f"{counted(max(seen), 'frame')}). Widen the conditions, or choose other motions."
    )
