"""How long a blend should be: fixed, by geodesic distance, or by joint velocity.

In: two clips of one rig at one frame rate, a start frame in the source and an end frame in the destination. Out:
a `BlendLength`. Wang & Bodenheimer 2004, section 3.1: the geodesic method (Eqs. 1 and 2) for cyclic motions,
the velocity method (Eqs. 3 and 4) for motions that don't repeat, and the fixed 0.33 s that both are compared to.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from study.arrays import FloatArray, IntArray
from study.counting import counted
from study.errors import TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, trim
from study.transitions.distances import frame_distance, half_angle_squares
from study.transitions.weights import MAJOR_ROLES, joint_weights
from study.transitions.windows import held, joined_at, longest_available, shortfall, window

# 2004: blends normally take 0.03 to 2 s, 1 to 60 frames at 30 fps; the fixed one 0.33 s, 10 frames.
SHORTEST_S, LONGEST_S, FIXED_S = 1.0 / 30.0, 2.0, 1.0 / 3.0


@dataclass(frozen=True)
class BlendLength:
    """A blend length and what it rests on."""

    blend_frames: int
    blend_s: float
    """The length, in frames of the clips and in seconds."""
    cost: float
    """2004 Eq. 1 at this length; NaN where the clips don't supply the frames to know it."""
    lengths: IntArray | None = None
    costs: FloatArray | None = None
    """The candidate lengths in frames and the cost of each (Figure 3); None except by geodesic distance."""
    joint: str | None = None
    """The role with the largest joint difference, by which the velocity method goes."""
    unclipped_s: float | None = None
    """What Eq. 4 gave, before it was held to the shortest and longest length."""
    note: str = ""
    """What a reader should know: that the length was clipped, or candidates were excluded."""

    @property
    def windows(self) -> tuple[int, int]:
        """Frames of the source and of the destination in the blend, which are as many."""
        return self.blend_frames, self.blend_frames


def default_frames(fps: float, seconds: float) -> int:
    """A duration of the paper in whole frames, at least one."""
    return max(1, round(seconds * fps))


def length_range(fps: float, longest: int | None) -> tuple[int, int]:
    """The shortest and the longest length to consider, frames: 0.03 and 2 s (1 and 60 frames at 30 fps) unless given.

    Raises
    ------
    TransitionError
        Where the longest is below the shortest.
    """
    low = default_frames(fps, SHORTEST_S)
    high = default_frames(fps, LONGEST_S) if longest is None else longest
    if high < low:
        raise TransitionError(f"Expected a longest blend of at least {counted(low, 'frame')}, got {high}.")
    return low, high


def geodesic_length(
    source: Clip,
    destination: Clip,
    start_frame: int,
    end_frame: int,
    *,
    longest: int | None = None,
    weights: str | Mapping[str, float] = "wang2003",
    specification: str = "start-end",
) -> BlendLength:
    """The length whose window costs least by geodesic distance (2004 Eqs. 1, 2); of equals the shortest.

    Lengths that the clips don't supply at these frames are not considered; the note says so.

    Parameters
    ----------
    source, destination
        Clips of one rig at one frame rate.
    start_frame, end_frame
        The frame of the source at which the blend starts, and the frame of the destination at which it ends.
    longest
        The longest length in frames; see `length_range`.
    weights
        As `joint_weights` takes them.
    specification
        What the two frames mean; see `study.transitions.windows`.

    Raises
    ------
    TransitionError
        Where the clips don't supply even the shortest blend (the message counts the frames), differ in rig or frame
        rate, or an option is not known.
    MotionError
        Where the rig lacks a joint that the weights need.
    """
    destination = joined_at(source, destination, start_frame, end_frame)
    low, high = length_range(source.fps, longest)
    frames, weight = (start_frame, end_frame), joint_weights(source.skeleton, weights)
    high, note = held(longest_available(source, destination, *frames, specification), low, high)
    costs = geodesic_costs(source, destination, *frames, high, weight, specification)[low - 1 :]
    best = low + int(np.argmin(costs))
    return BlendLength(best, best / source.fps, float(costs[best - low]), np.arange(low, high + 1), costs, note=note)


def velocity_length(
    source: Clip,
    destination: Clip,
    start_frame: int,
    end_frame: int,
    *,
    weights: str | Mapping[str, float] = "wang2003",
    specification: str = "start-end",
) -> BlendLength:
    """The largest joint difference over that joint's speed (2004 Eqs. 3, 4), within 0.03 to 2 s.

    Parameters and errors are those of `geodesic_length`; the weights serve the cost alone.

    Notes
    -----
    `|v|` of Eq. 4 is the mean of the two speeds, since opposite velocities would cancel in a mean of vectors.
    """
    destination = joined_at(source, destination, start_frame, end_frame)
    low, high = length_range(source.fps, None)
    differences = major_joint_differences(source, destination, start_frame, end_frame)
    role = max(differences, key=differences.__getitem__)
    joint = source.skeleton.role(role)
    speed = 0.5 * (joint_speed(source, start_frame, joint) + joint_speed(destination, end_frame, joint))
    # A joint that differs but doesn't move would need infinite time; equal poses need none.
    seconds = differences[role] / speed if speed > 0 else (np.inf if differences[role] > 0 else 0.0)
    length = round(min(max(seconds * source.fps, low), high))
    note = ""
    if not low - 0.5 <= seconds * source.fps <= high + 0.5:
        note = (
            f"the velocity method gave {seconds:.3f} s ({seconds * source.fps:.1f} frames), outside {low} to {high} "
            f"frames; clipped to {length}"
        )
    found = BlendLength(length, length / source.fps, np.nan, joint=role, unclipped_s=float(seconds), note=note)
    return _supplied(found, source, destination, (start_frame, end_frame), weights, specification)


def fixed_length(
    source: Clip,
    destination: Clip,
    start_frame: int,
    end_frame: int,
    frames: int | None = None,
    *,
    weights: str | Mapping[str, float] = "wang2003",
    specification: str = "start-end",
) -> BlendLength:
    """A length of so many frames, 0.33 s (10 at 30 fps) unless given, with its cost.

    Parameters and errors are those of `geodesic_length`; the weights serve the cost alone.
    """
    destination = joined_at(source, destination, start_frame, end_frame)
    length = default_frames(source.fps, FIXED_S) if frames is None else frames
    found = BlendLength(length, length / source.fps, np.nan)
    return _supplied(found, source, destination, (start_frame, end_frame), weights, specification)


def geodesic_costs(
    source: Clip,
    destination: Clip,
    start_frame: int,
    end_frame: int,
    longest: int,
    weights: FloatArray,
    specification: str = "start-end",
) -> FloatArray:
    """The cost of each blend length 1 to `longest` frames (2004 Eqs. 1 and 2), `(longest,)`.

    See `joint_costs`, of which this is the weighted sum.
    """
    used = np.flatnonzero(weights)
    return np.asarray(
        weights[used] @ joint_costs(source, destination, start_frame, end_frame, longest, used, specification)
    )


def joint_costs(
    source: Clip,
    destination: Clip,
    start_frame: int,
    end_frame: int,
    longest: int,
    joints: IntArray,
    specification: str = "start-end",
) -> FloatArray:
    """The unweighted geodesic cost of each joint for each blend length (2004 Figure 5).

    Parameters
    ----------
    source, destination, start_frame, end_frame, specification
        As in `geodesic_length`; both clips supply `longest` frames, or `TransitionError`.
    longest
        The longest blend in frames.
    joints : (n,)
        Indices of the joints.

    Returns
    -------
    (n, longest) mean squared half angles over the blend window; column `b - 1` for length `b`.

    Notes
    -----
    Eq. 2 prints the source index as `i-t-1`; `i+t-1` is meant, as Eqs. 5 and 6 show. With start and end frames the
    window of length b pairs source frame `i+s` with destination frame `j-e` wherever `s+e = b-1`: the pairs of
    each length are one anti-diagonal of a square table, so one matrix product gives the dot products of all
    lengths at once. Good to about 1e-15 absolute.
    """
    frames = window(start_frame, end_frame, longest, specification)
    if lacking := shortfall(source, destination, frames):
        raise TransitionError(
            f"Expected clips with frames for blends of up to {counted(longest, 'frame')} at source frame "
            f"{start_frame} and destination frame {end_frame}, but {lacking}. Choose other frames, or use longer clips."
        )
    a = source.rotations[frames.source_start : frames.source_stop, joints]
    b = destination.rotations[frames.destination_start : frames.destination_stop, joints]
    if specification == "start-end":
        dots = np.matmul(a.transpose(1, 0, 2), b[::-1].transpose(1, 2, 0)).reshape(len(joints), -1)
        order, starts = _anti_diagonals(longest)
        sums = np.add.reduceat(half_angle_squares(dots.take(order, axis=1)), starts, axis=1)
        return np.asarray(sums / np.arange(1, longest + 1))
    running = np.zeros((len(joints), longest + 1))
    np.cumsum(half_angle_squares(np.sum(a * b, axis=-1).T), axis=1, out=running[:, 1:])
    lengths = np.arange(1, longest + 1)
    # Shorter windows lie within the longest one, each around the frame where the clips meet.
    first = longest // 2 - lengths // 2 if specification == "centre" else np.zeros(longest, dtype=np.int64)
    return np.asarray((running[:, first + lengths] - running[:, first]) / lengths)


@lru_cache(maxsize=32)
def _anti_diagonals(size: int) -> tuple[IntArray, IntArray]:
    """Flat indices of the upper-left triangle of a square table by anti-diagonal, and where each one starts."""
    sums = np.add.outer(np.arange(size), np.arange(size)).ravel()
    order = np.argsort(sums, kind="stable")
    return order[: size * (size + 1) // 2], np.arange(size) * (np.arange(size) + 1) // 2


def major_joint_differences(source: Clip, destination: Clip, start_frame: int, end_frame: int) -> dict[str, float]:
    """Half angle between start and end frame for each major joint, by role (2004 Eq. 3 and Table 1)."""
    joints = [source.skeleton.role(role) for role in MAJOR_ROLES]
    differences = quat.half_angle_between(
        source.rotations[start_frame, joints], destination.rotations[end_frame, joints]
    )
    return {role: float(value) for role, value in zip(MAJOR_ROLES, differences, strict=True)}


def joint_speeds(clip: Clip, joints: IntArray) -> FloatArray:
    """Half-angle speed of joints at each frame, `(frames, joints)`, radians a second.

    Over the frames on either side, where there are both; half angles, so that Eq. 4 divides a half angle by a
    half-angle speed and gives seconds.
    """
    frames = np.arange(clip.frames)
    before, after = np.maximum(frames - 1, 0), np.minimum(frames + 1, clip.frames - 1)
    turned = quat.half_angle_between(clip.rotations[before][:, joints], clip.rotations[after][:, joints])
    return np.asarray(turned * clip.fps / np.maximum(after - before, 1)[:, None])


def joint_speed(clip: Clip, frame: int, joint: int) -> float:
    """`joint_speeds` of one joint at one frame."""
    near = range(max(frame - 1, 0), min(frame + 2, clip.frames))
    return float(joint_speeds(trim(clip, near.start, near.stop), np.array([joint]))[frame - near.start, 0])


def _supplied(
    found: BlendLength,
    source: Clip,
    destination: Clip,
    frames: tuple[int, int],
    weights: str | Mapping[str, float],
    specification: str,
) -> BlendLength:
    """The length with its cost, held to what the clips supply or refused."""
    asked, shortest = found.blend_frames, default_frames(source.fps, SHORTEST_S)
    available = longest_available(source, destination, *frames, specification)
    length, note = held(available, min(shortest, asked), asked)
    span = window(*frames, length, specification)
    if lacking := shortfall(source, destination, span):
        raise TransitionError(
            f"Expected clips with frames for a blend of {counted(length, 'frame')} at source frame {frames[0]} and "
            f"destination frame {frames[1]}, but {lacking}. Choose other frames, or use longer clips."
        )
    a = source.rotations[span.source_start : span.source_stop]
    b = destination.rotations[span.destination_start : span.destination_stop]
    cost = float(np.mean(frame_distance(a, b, joint_weights(source.skeleton, weights))))
    notes = "; ".join(filter(None, (found.note, note)))
    return replace(found, blend_frames=length, blend_s=length / source.fps, cost=cost, note=notes)
