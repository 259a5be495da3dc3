"""Plays a state machine: clips as states, triggers as its input, one clip as its output.

In: clips, a one-hop table, a first state and a list of triggers. Out: the motion that a character would show, by
optimal one-hop transitions or by the direct transitions of the paper's baseline (Koyama & Goto 2019, section 4.1).
At run time each transition costs one look-up and two blends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from study.counting import counted
from study.errors import TransitionError
from study.motion.clip import Clip, joint_positions, moved, retarget, trim
from study.transitions.blending import blend_weights, slerp_one_way
from study.transitions.one_hop.problem import Alignment, check_clips
from study.transitions.one_hop.table import Entry, OneHopTable
from study.transitions.point_cloud import alignment as align

METHODS = ("one-hop", "direct")


@dataclass(frozen=True)
class Trigger:
    """The wish to be in another state."""

    frame: int
    """The frame of the output at which it comes."""
    destination: int
    """The number of the clip to go to."""


@dataclass(frozen=True)
class Segment:
    """A stretch of the output."""

    kind: str
    """`"state"`, `"hop"`, or `"blend"`."""
    clip: int
    """The clip that plays, in a blend the one that is blended into."""
    start: int
    stop: int
    """Frames of the output, as a slice counts them."""
    clip_start: int
    """The clip's frame at `start`."""


@dataclass(frozen=True)
class Step:
    """One leg of a transition: a stay in the clip that plays, then a blend into another clip."""

    stay: int
    """Frames to stay first."""
    clip: int
    """The number of the clip to blend into."""
    offset: int
    """The frame of the transition's source that coincides with that clip's frame 0."""
    blend_frames: int
    """Frames of the blend."""


@dataclass(frozen=True, eq=False)
class Played:
    """What the state machine showed."""

    clip: Clip
    """The motion."""
    segments: tuple[Segment, ...]
    """What it is made of, in order."""
    entries: tuple[Entry | None, ...] = ()
    """The table's entry for each trigger; None for a direct transition."""


@dataclass(eq=False)
class _Tape:
    """Frames as they are recorded, with the clip that plays now and where it was placed."""

    clips: tuple[Clip, ...]
    number: int
    frame: int
    placed: Clip
    recorded: list[Clip] = field(default_factory=list)
    segments: list[Segment] = field(default_factory=list)
    length: int = 0

    def play_to(self, frame: int, kind: str) -> None:
        """The current clip on to one of its frames, that one not included."""
        if frame > self.frame:
            self._record(trim(self.placed, self.frame, frame), kind, self.frame)
            self.frame = frame

    def blend_into(self, number: int, frame: int, blend_frames: int) -> None:
        """A blend from here into another clip at one of its frames, placed where it fits best on the floor."""
        ours = trim(self.placed, self.frame, self.frame + blend_frames)
        whole = self.clips[number]
        theirs = trim(whole, frame, frame + blend_frames)
        yaw, translation, _ = align(joint_positions(ours), joint_positions(theirs))
        self.placed = moved(whole, yaw, translation)
        self._record(crossfade(ours, moved(theirs, yaw, translation)), "blend", frame, number)
        self.number, self.frame = number, frame + blend_frames

    def _record(self, part: Clip, kind: str, clip_start: int, number: int | None = None) -> None:
        clip = self.number if number is None else number
        stop = self.length + part.frames
        last = self.segments[-1] if self.segments else None
        if last is not None and (last.kind, last.clip) == (kind, clip) and kind != "blend":
            self.segments[-1] = replace(last, stop=stop)  # a stay goes on where the clip already played
        else:
            self.segments.append(Segment(kind, clip, self.length, stop, clip_start))
        self.recorded.append(part)
        self.length += part.frames


def crossfade(a: Clip, b: Clip) -> Clip:
    """Pose by pose from one stretch of motion into another of the same length, that was placed on it.

    The paper's pose-space linear blend: slerp of every joint, the root by linear interpolation.
    """
    share = blend_weights(a.frames)
    rotations = slerp_one_way(a.rotations, b.rotations, np.tile(share[:, None], (1, a.skeleton.joints)))
    positions = a.root_positions + share[:, None] * (b.root_positions - a.root_positions)
    return replace(a, root_positions=positions, rotations=rotations)


def play(
    clips: Sequence[Clip],
    table: OneHopTable,
    triggers: Sequence[Trigger],
    *,
    first: int = 0,
    method: str = "one-hop",
) -> Played:
    """The motion of a state machine.

    Parameters
    ----------
    clips
        The table's clips, in its order.
    table
        The transitions; also what says where each destination stands on its source's timeline.
    triggers
        In the order of their frames.
    first
        The clip that plays at the start, from its first frame on; the last one plays to its end.
    method
        `"one-hop"`, or `"direct"`: a blend into the destination from the triggered frame on.

    Raises
    ------
    TransitionError
        For clips that are not the table's, a trigger during a transition, after the end of the clip, or at a frame for
        which no transition fits.

    Notes
    -----
    Each clip is placed by the alignment over the frames of its blend that the point cloud distance measures, so what is
    seen is what was weighed.
    """
    if method not in METHODS:
        raise TransitionError(f"Expected a method of {' or '.join(METHODS)}, got {method!r}.")
    check_clips(clips)
    _check_table(clips, table)
    same_body = tuple(retarget(clip, clips[0].skeleton) for clip in clips)
    tape = _Tape(same_body, first, 0, same_body[first])
    entries: list[Entry | None] = []
    for trigger in triggers:
        frame = tape.frame + trigger.frame - tape.length
        _check_trigger(tape, trigger, frame)
        alignment = table.row(tape.number, trigger.destination).alignment
        entry = None
        if method == "direct":
            steps = _direct_steps(tape, table, trigger.destination, alignment, frame)
        else:
            entry = table.look_up(tape.number, trigger.destination, frame)
            if entry is None:
                names = table.clips[tape.number], table.clips[trigger.destination]
                raise TransitionError(
                    f"Expected a frame of {names[0]} with a transition to {names[1]}, got {frame}, where none fits "
                    "in the clips. Trigger it earlier."
                )
            steps = entry_steps(table, entry, trigger.destination, alignment.offset_at(frame))
        entries.append(entry)
        _follow(tape, frame, steps)
    tape.play_to(tape.clips[tape.number].frames, "state")
    return Played(_joined(tape, method), tuple(tape.segments), tuple(entries))


def entry_steps(table: OneHopTable, entry: Entry, destination: int, offset: int) -> tuple[Step, ...]:
    """A table's entry as steps; `offset` is the destination's."""
    first, second = (table.blend_frames if own is None else own for own in (entry.blend_first, entry.blend_second))
    return (
        Step(entry.stay_source, entry.hop, entry.offset, first),
        Step(entry.stay_hop, destination, offset, second),
    )


def _check_table(clips: Sequence[Clip], table: OneHopTable) -> None:
    found = tuple(clip.frames for clip in clips)
    if found != table.frames or not np.isclose(clips[0].fps, table.fps):
        raise TransitionError(
            f"Expected the table's clips, {table.frames} frames at {table.fps:g} fps, got {found} at "
            f"{clips[0].fps:g} fps. Build the table from these clips."
        )


def _check_trigger(tape: _Tape, trigger: Trigger, frame: int) -> None:
    name = tape.clips[tape.number].name or f"clip {tape.number}"
    if trigger.frame < tape.length:
        raise TransitionError(
            f"Expected a trigger from output frame {tape.length} on, when {name} plays alone, got {trigger.frame}."
        )
    if frame >= tape.clips[tape.number].frames:
        end = tape.length + tape.clips[tape.number].frames - tape.frame
        raise TransitionError(f"Expected a trigger before output frame {end}, where {name} ends, got {trigger.frame}.")


def _direct_steps(
    tape: _Tape, table: OneHopTable, destination: int, alignment: Alignment, frame: int
) -> tuple[Step, ...]:
    """The baseline: at once into the destination."""
    offset = alignment.offset_at(frame)
    lengths = tape.clips[tape.number].frames, tape.clips[destination].frames
    if frame + table.blend_frames > lengths[0] or not 0 <= frame - offset <= lengths[1] - table.blend_frames:
        raise TransitionError(
            f"Expected {counted(table.blend_frames, 'frame')} for a direct transition at frame {frame} of "
            f"{table.clips[tape.number]} and frame {frame - offset} of {table.clips[destination]}, which have "
            f"{lengths[0]} and {lengths[1]} frames. Trigger it at another frame."
        )
    return (Step(0, destination, offset, table.blend_frames),)


def _follow(tape: _Tape, frame: int, steps: Sequence[Step]) -> None:
    """Plays the current clip to a frame, and from there each step; offsets count from the current clip's frame 0."""
    tape.play_to(frame, "state")
    offset = 0
    for number, step in enumerate(steps):
        start = tape.frame + offset + step.stay
        tape.play_to(start - offset, "hop" if number else "state")
        # The clip that plays, where it plays already: the direct transition, written as a one-hop one.
        if number and (step.clip, step.offset) == (tape.number, offset):
            continue
        tape.blend_into(step.clip, start - step.offset, step.blend_frames)
        offset = step.offset


def play_steps(clips: Sequence[Clip], first: int, frame: int, steps: Sequence[Step]) -> Played:
    """One transition, given step by step, and its last clip to its end.

    Parameters
    ----------
    clips
        Clips of one rig at one frame rate.
    first, frame
        The clip that plays at the start, and its triggered frame.
    steps
        The transition: hops, and the destination last.
    """
    check_clips(clips)
    same_body = tuple(retarget(clip, clips[0].skeleton) for clip in clips)
    tape = _Tape(same_body, first, 0, same_body[first])
    _follow(tape, frame, steps)
    tape.play_to(same_body[tape.number].frames, "state")
    return Played(_joined(tape, "step by step"), tuple(tape.segments))


def _joined(tape: _Tape, how: str) -> Clip:
    source = tape.recorded[0]
    names = [clip.name or f"clip {number}" for number, clip in enumerate(tape.clips)]
    words = ", ".join(f"{s.kind} {names[s.clip]} from its frame {s.clip_start}" for s in tape.segments)
    return Clip(
        source.skeleton,
        np.concatenate([part.root_positions for part in tape.recorded]),
        np.concatenate([part.rotations for part in tape.recorded]),
        source.fps,
        f"{names[tape.segments[0].clip]} to {names[tape.number]}, {how}",
        (f"played {how}: {words}",),
        any(clip.synthetic for clip in tape.clips),
        metres_per_unit=source.metres_per_unit,
    )
