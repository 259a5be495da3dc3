"""Plays a state machine: clips as states, triggers as its input, one clip as its output.

In: clips, a one-hop table, a first state and a list of triggers. Out: the motion that a character would show, by
optimal one-hop transitions or by the direct transitions of the paper's baseline (Koyama & Goto 2019, section 4.1).
At run time each transition costs one look-up and two blends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from study.errors import TransitionError
from study.motion.clip import Clip, joint_positions, moved, retarget, trim
from study.transitions.blending import blend_weights, slerp_one_way
from study.transitions.one_hop.problem import Alignment, check_clips
from study.transitions.one_hop.table import Entry, OneHopTable
from study.transitions.point_cloud import alignment as align

METHODS = ("one-hop", "direct")

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Trigger:
    """The wish to be in another state.

    Parameters
    ----------
    frame
        The frame of the output at which it comes.
    destination
        The number of the clip to go to.
    """

    frame: int
    destination: int


@dataclass(frozen=True)
class Segment:
    """A stretch of the output.

    Parameters
    ----------
    kind
        `"state"`, `"hop"`, or `"blend"`.
    clip
        The clip that plays, in a blend the one that is blended into.
    start, stop
        Frames of the output, as a slice counts them.
    clip_start
        The clip's frame at `start`.
    """

    kind: str
    clip: int
    start: int
    stop: int
    clip_start: int


@dataclass(frozen=True, eq=False)
class Played:
    """What the state machine showed.

    Parameters
    ----------
    clip
        The motion.
    segments
        What it is made of, in order.
    entries
        The table's entry for each trigger; None for a direct transition.
    """

    clip: Clip
    segments: tuple[Segment, ...]
    entries: tuple[Entry | None, ...] = ()


@dataclass(eq=False)
class _Tape:
    """Frames as they are recorded, with the clip that plays now and where it was placed."""

    clips: tuple[Clip, ...]
    weight: str
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
        self._record(crossfade(ours, moved(theirs, yaw, translation), self.weight), "blend", frame, number)
        self.number, self.frame = number, frame + blend_frames

    def _record(self, part: Clip, kind: str, clip_start: int, number: int | None = None) -> None:
        clip = self.number if number is None else number
        self.segments.append(Segment(kind, clip, self.length, self.length + part.frames, clip_start))
        self.recorded.append(part)
        self.length += part.frames


def crossfade(a: Clip, b: Clip, weight: str = "linear") -> Clip:
    """Pose by pose from one stretch of motion into another of the same length, that was placed on it.

    The paper's pose-space linear blend: slerp of every joint, the root on the straight line between both.
    """
    share = blend_weights(a.frames, weight)
    rotations = slerp_one_way(a.rotations, b.rotations, np.tile(share[:, None], (1, a.skeleton.joints)))
    positions = a.root_positions + share[:, None] * (b.root_positions - a.root_positions)
    return replace(a, root_positions=positions, rotations=rotations)


def play(
    clips: Sequence[Clip],
    table: OneHopTable,
    triggers: Sequence[Trigger],
    *,
    first: int = 0,
    first_frame: int = 0,
    frames: int | None = None,
    method: str = "one-hop",
    weight: str = "linear",
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
    first, first_frame
        The clip that plays at the start, and its frame then.
    frames
        Frames of output; to the end of the last clip unless given.
    method
        `"one-hop"`, or `"direct"`: a blend into the destination from the triggered frame on.
    weight
        `"linear"` or `"sigmoid"`; see `blend_weights`.

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
    tape = _Tape(same_body, weight, first, first_frame, same_body[first])
    entries: list[Entry | None] = []
    for trigger in triggers:
        frame = tape.frame + trigger.frame - tape.length
        _check_trigger(tape, trigger, frame)
        alignment = table.row(tape.number, trigger.destination).alignment
        if method == "direct":
            entries.append(None)
            _go_direct(tape, table, trigger.destination, alignment, frame)
        else:
            entries.append(_go_by_hop(tape, table, trigger.destination, alignment, frame))
    wanted = tape.clips[tape.number].frames if frames is None else tape.frame + frames - tape.length
    if wanted > tape.clips[tape.number].frames or (frames is not None and frames < tape.length):
        longest = tape.length + tape.clips[tape.number].frames - tape.frame
        raise TransitionError(f"Expected {tape.length} to {longest} frames of output for these triggers, got {frames}.")
    tape.play_to(wanted, "state")
    return Played(_joined(tape, table, method), tuple(tape.segments), tuple(entries))


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


def _go_direct(tape: _Tape, table: OneHopTable, destination: int, alignment: Alignment, frame: int) -> None:
    """The baseline: at once into the destination."""
    into = frame - alignment.offset_at(frame)
    lengths = tape.clips[tape.number].frames, tape.clips[destination].frames
    if frame + table.blend_frames > lengths[0] or not 0 <= into <= lengths[1] - table.blend_frames:
        raise TransitionError(
            f"Expected {table.blend_frames} frames for a direct transition at frame {frame} of "
            f"{table.clips[tape.number]} and frame {into} of {table.clips[destination]}, which have {lengths[0]} and "
            f"{lengths[1]} frames. Trigger it at another frame."
        )
    tape.play_to(frame, "state")
    tape.blend_into(destination, into, table.blend_frames)


def _go_by_hop(tape: _Tape, table: OneHopTable, destination: int, alignment: Alignment, frame: int) -> Entry:
    entry = table.look_up(tape.number, destination, frame)
    if entry is None:
        raise TransitionError(
            f"Expected a frame of {table.clips[tape.number]} with a transition to {table.clips[destination]}, got "
            f"{frame}, where none fits in the clips. Trigger it earlier."
        )
    offset = alignment.offset_at(frame)
    start = frame + entry.stay_source
    tape.play_to(start, "state")
    tape.blend_into(entry.hop, start - entry.offset, table.blend_frames)
    if entry.hop == destination and entry.offset == offset and entry.stay_hop == 0:
        return entry  # a direct transition: there is nothing left to blend
    second = start + table.blend_frames + entry.stay_hop
    tape.play_to(second - entry.offset, "hop")
    tape.blend_into(destination, second - offset, table.blend_frames)
    return entry


def _joined(tape: _Tape, table: OneHopTable, method: str) -> Clip:
    source = tape.recorded[0]
    words = ", ".join(f"{s.kind} {table.clips[s.clip]} from its frame {s.clip_start}" for s in tape.segments)
    return Clip(
        source.skeleton,
        np.concatenate([part.root_positions for part in tape.recorded]),
        np.concatenate([part.rotations for part in tape.recorded]),
        source.fps,
        f"{table.clips[tape.segments[0].clip]} to {table.clips[tape.number]}, {method}",
        (f"played {method}: {words}",),
        any(clip.synthetic for clip in tape.clips),
    )
