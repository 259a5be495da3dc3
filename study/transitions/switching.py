"""Transitions as game engines make them: the source ends at the switch, and only its last pose and velocity stay.

In: a source and a destination clip of one rig at one frame rate, a start and an end frame, and how what is left of the
source fades. Out: a `Transition`. The destination plays from the switch on. Inertialization adds to it what it lacked
at the switch, which decays to nothing (Bollo 2018); dead blending cross-fades from the source's pose, moved on by its
decaying velocity (Holden 2023). At run time a game evaluates one clip instead of two, and for each joint a polynomial
or an exponential, an axis-angle rotation and a product: here 4 to 8 microseconds a pose of 22 joints,
where a plain blend takes 5 (`benchmarks/poses.py`).

Joints are turned by rotation vectors. The root has a height, a lean (what is left of its rotation without the facing)
and, over the floor, its steps as seen in its own facing (`blending`): as the destination is placed where the source
stood at the switch, no distance has to decay, but a difference of speed and of turning does. It is added to the steps,
so the figure's speed has no jump, and the destination goes on from where it then is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from study.arrays import FloatArray
from study.counting import counted
from study.errors import TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, picked, retarget
from study.transitions.blending import (
    Transition,
    alignment_of,
    assemble,
    blend_weights,
    facing,
    slerp_one_way,
    steps_of,
)
from study.transitions.windows import Window, joined_at, shortfall, window

Decay = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]
"""What is left of offsets `(..., n)` with rates `(..., n)` a second after times `(t,)`, seconds: `(t, ..., n)`."""

SPRING_LEFT = 0.01
"""The share of the offset at which a spring's decay is ended: it would go on indefinitely."""

SPRING_TIMES = 6.6384
"""`y t` at which `(1 + y t) exp(-y t)` is `SPRING_LEFT`."""


def quintic(seconds: float) -> Decay:
    """Decay by Bollo's polynomial of fifth degree, along the direction of the offset.

    From the offset and its rate to zero, with no velocity and no acceleration left at the end. An offset that grows is
    taken as one that rests, and one that falls quickly has less time (`5 x0 / |v0|`), so that it never overshoots.
    Without a rate what is left is that of a blend as long, on average over its time: one half.
    """

    def left(offset: FloatArray, rate: FloatArray, times: FloatArray) -> FloatArray:
        size = np.linalg.norm(offset, axis=-1)
        along = offset / np.maximum(size, 1e-12)[..., None]
        speed = np.minimum(np.sum(along * rate, axis=-1), 0.0)
        falls = speed < -1e-9
        until = np.where(falls, np.minimum(seconds, 5.0 * size / np.where(falls, -speed, 1.0)), seconds)
        until = np.maximum(until, 1e-9)
        bend = np.maximum(-(8.0 * speed * until + 20.0 * size) / until**2, 0.0)
        part = np.clip(times.reshape(-1, *(1,) * size.ndim) / until, 0.0, 1.0)
        x, v, a = size, speed * until, bend * until**2
        fifth, fourth = -(a + 6 * v + 12 * x) / 2, (3 * a + 16 * v + 30 * x) / 2
        third = -(3 * a + 12 * v + 20 * x) / 2
        value = ((((fifth * part + fourth) * part + third) * part + a / 2) * part + v) * part + x
        return np.asarray(np.where(part < 1.0, value, 0.0)[..., None] * along)

    return left


def spring(halflife_s: float, seconds: float) -> Decay:
    """Decay by a critically damped spring: `exp(-y t) (x0 + (v0 + y x0) t)` with `y = 2 ln 2 / halflife_s`.

    Value and rate at the switch are the offset's own. A spring never ends: what is left of value and rate after
    `seconds` is taken away by the cubic that is zero at the switch, with its rate.
    """
    stiffness = 2.0 * math.log(2.0) / halflife_s

    def left(offset: FloatArray, rate: FloatArray, times: FloatArray) -> FloatArray:
        slope = rate + stiffness * offset
        at = times.reshape(-1, *(1,) * offset.ndim)
        value = np.exp(-stiffness * at) * (offset + slope * at)
        end = np.exp(-stiffness * seconds) * (offset + slope * seconds)
        end_rate = np.exp(-stiffness * seconds) * slope - stiffness * end
        part = np.clip(at / seconds, 0.0, 1.0)
        rest = part * part * ((3.0 - 2.0 * part) * end + (part - 1.0) * seconds * end_rate)
        return np.asarray(np.where(part < 1.0, value - rest, 0.0))

    return left


def matching_halflife_s(blend_s: float) -> float:
    """The half-life at which a spring leaves as much of an offset, on average over time, as a blend of a length does.

    A linear blend leaves `blend_s / 2` (offset times seconds), a spring that starts at rest `2 / y`: `y = 4 / blend_s`.
    """
    return math.log(2.0) / 2.0 * blend_s


def matched_blend_s(halflife_s: float) -> float:
    """The length of the blend that a half-life matches (`matching_halflife_s`), seconds."""
    return 2.0 * halflife_s / math.log(2.0)


def spring_s(halflife_s: float) -> float:
    """Seconds until a spring that starts at rest has `SPRING_LEFT` of its offset left."""
    return SPRING_TIMES * halflife_s / (2.0 * math.log(2.0))


@dataclass(frozen=True)
class Extrapolation:
    """How dead blending moves the source on: velocities halve in a time of their own, about each axis of each joint.

    It is the seconds in which the velocity would cover the way to the destination, within `shortest_s` and `longest_s`:
    long where the source already goes there, short where it goes elsewhere or quickly.
    """

    shortest_s: float = 0.05
    longest_s: float = 1.0

    def halflives(self, offset: FloatArray, velocity: FloatArray) -> FloatArray:
        """Seconds, for ways to the destination and velocities of one shape."""
        quick = np.where(np.abs(velocity) < 1e-6, np.where(velocity < 0.0, -1e-6, 1e-6), velocity)
        return np.clip(offset / quick, self.shortest_s, self.longest_s)

    def moved(self, offset: FloatArray, velocity: FloatArray, times: FloatArray) -> FloatArray:
        """How far the source has moved on `(t, ..., n)`: `v / c (1 - exp(-c t))` with `c = ln 2 / halflife`."""
        decay = math.log(2.0) / self.halflives(offset, velocity)
        at = times.reshape(-1, *(1,) * offset.ndim)
        return np.asarray(velocity / decay * -np.expm1(-decay * at))


def inertialized(
    source: Clip,
    destination: Clip,
    start_frame: int,
    end_frame: int,
    blend_frames: int,
    decay: Decay,
    *,
    placed_frames: int | None = None,
) -> Transition:
    """Source, then the destination with a decaying offset, then the destination.

    Parameters
    ----------
    start_frame
        The first frame after the switch; the source's last frame is the one before.
    end_frame
        The destination frame that ends a blend of `placed_frames`; at the switch it is that many frames earlier.
    blend_frames
        Frames with an offset.
    decay
        `quintic` or `spring`; its time should end one frame after the last of `blend_frames`.
    placed_frames
        `blend_frames` unless given.

    Raises
    ------
    TransitionError
        Where the clips don't supply the frames, or differ in rig or frame rate.
    """
    seam = _seam(source, destination, start_frame, end_frame, blend_frames, placed_frames or blend_frames)
    turned = quat.exp(0.5 * decay(seam.offset, seam.offset_rate, seam.times))
    height = decay(np.array([seam.drop]), np.array([seam.drop_rate]), seam.times)[:, 0]
    still = np.zeros_like(seam.step_offset)
    steps = seam.steps + decay(seam.step_offset, still, seam.step_times)
    return seam.made(quat.multiply(turned, seam.poses), seam.heights + height, steps, "inertialized")


def dead_blended(
    source: Clip,
    destination: Clip,
    start_frame: int,
    end_frame: int,
    blend_frames: int,
    extrapolation: Extrapolation,
) -> Transition:
    """Source, then a cross-fade (sigmoid) from its pose, moved on by its decaying velocity, to the destination.

    Parameters
    ----------
    start_frame, end_frame, blend_frames
        As in `blending.blend` with the specification `"start-end"`.
    extrapolation
        How the source's velocity decays.

    Raises
    ------
    TransitionError
        Where the clips don't supply the frames, or differ in rig or frame rate.
    """
    seam = _seam(source, destination, start_frame, end_frame, blend_frames, blend_frames)
    on = quat.exp(0.5 * extrapolation.moved(-seam.offset, seam.velocity, seam.times))
    share = blend_weights(blend_frames, "sigmoid")
    shares = np.repeat(share[:, None], len(seam.pose), axis=1)
    poses = slerp_one_way(quat.continuous(quat.multiply(on, seam.pose)), seam.poses, shares)
    way, speed = np.array([-seam.drop]), np.array([seam.height_rate])
    height = seam.height + extrapolation.moved(way, speed, seam.times)[:, 0]
    # The steps have no way to go, only a speed: they keep it as long as any.
    kept = 0.5 ** (seam.step_times / extrapolation.longest_s)
    step_share = np.convolve(np.concatenate([[0.0], share, [1.0]]), [0.5, 0.5], mode="valid")[:, None]
    steps = (1.0 - step_share) * kept[:, None] * seam.step + step_share * seam.steps
    return seam.made(poses, (1.0 - share) * height + share * seam.heights, steps, "dead blended")


@dataclass(frozen=True, eq=False)
class _Seam:
    """A switch: the source's last pose with its velocities, and the destination from there on.

    Times are seconds after the source's last frame. `pose (joints, 4)` is the source's, with the root's lean in the
    first place; `velocity (joints, 3)` radians a second, `height` and `height_rate` metres; `poses (frames, joints, 4)`
    and `heights (frames,)` the destination's at `times`. `offset` is the rotation vector from the destination's pose to
    the source's at the switch, `drop` the same of the height, with their rates. `steps (frames + 1, 3)` are the
    destination's turn (radians) and step over the floor (metres) to the next frame, at `step_times`; `step` is the
    source's at the switch, and `step_offset` what it has more than the destination's.
    """

    source: Clip
    destination: Clip
    start_frame: int
    first: int
    times: FloatArray
    step_times: FloatArray
    pose: FloatArray
    velocity: FloatArray
    height: float
    height_rate: float
    poses: FloatArray
    heights: FloatArray
    offset: FloatArray
    offset_rate: FloatArray
    drop: float
    drop_rate: float
    steps: FloatArray
    step: FloatArray
    step_offset: FloatArray

    def made(self, poses: FloatArray, heights: FloatArray, steps: FloatArray, how: str) -> Transition:
        """The transition with these poses, heights and steps between the two clips."""
        count, start = len(poses), self.start_frame
        last = self.source.root_positions[start - 1]
        own_facing = float(facing(picked(self.source, [start - 1]))[0])
        headings = own_facing + np.concatenate([[0.0], np.cumsum(steps[:, 0])])
        strides = np.stack([steps[:, 1], np.zeros(count + 1), steps[:, 2]], axis=1)
        strides = quat.rotate(quat.yaw(0.5 * (headings[1:] + headings[:-1])), strides)
        path = last + np.concatenate([np.zeros((1, 3)), np.cumsum(strides, axis=0)])
        path[1:-1, 1] = heights
        stop = self.first + count
        after = min(stop, self.destination.frames - 1)
        at = count + 1 - (stop - after)
        turn = headings[at] - float(facing(picked(self.destination, [after]))[0])
        alignment = alignment_of(turn, path[at], self.destination.root_positions[after])
        rotations = poses.copy()
        rotations[:, 0] = quat.multiply(quat.yaw(headings[1:-1]), poses[:, 0])
        blended = replace(self.source, root_positions=path[1:-1], rotations=rotations)
        note = (
            f"{how} over {counted(count, 'frame')}, switched after source frame {start - 1} to destination frame "
            f"{self.first}"
        )
        clip = assemble(self.source, start, blended, self.destination, stop, alignment, note)
        return Transition(
            clip,
            start,
            start + count,
            (start, min(start + count, self.source.frames)),
            (self.first, stop),
            count,
            alignment,
            note,
        )


def _seam(
    source: Clip, destination: Clip, start_frame: int, end_frame: int, blend_frames: int, placed_frames: int
) -> _Seam:
    destination = joined_at(source, destination, start_frame, end_frame)
    first = window(start_frame, end_frame, placed_frames).destination_start
    # One frame of each before the switch says how fast it moves.
    lacking = shortfall(source, destination, Window(start_frame - 1, first - 1, 1))
    if (beyond := first + blend_frames - destination.frames) > 0:
        lacking = lacking or f"the destination lacks {counted(beyond, 'frame')} after its last"
    if lacking:
        raise TransitionError(
            f"Expected clips with frames for a switch before source frame {start_frame} and "
            f"{counted(blend_frames, 'frame')} after it, but {lacking}. Choose other frames or a shorter blend."
        )
    destination, fps = retarget(destination, source.skeleton), source.fps
    before = min(start_frame - 1, first - 1, 1)
    here, there = _Moment.at(source, start_frame - 1, before), _Moment.at(destination, first - 1, before)
    played = picked(destination, np.arange(first - 1, min(first + blend_frames + 1, destination.frames)))
    facings = facing(played)
    turns, strides = steps_of(played, facings)
    steps = np.column_stack([turns, strides[:, [0, 2]]])
    if len(steps) == blend_frames:  # the destination ends with the blend
        steps = np.concatenate([steps, steps[-1:]])
    poses = _leaning(played, facings)[1 : blend_frames + 1]
    offsets = quat.multiply(here.poses, quat.conjugate(there.poses))
    turned = 2.0 * quat.log(offsets)
    return _Seam(
        source=source,
        destination=destination,
        start_frame=start_frame,
        first=first,
        times=np.arange(1, blend_frames + 1) / fps,
        step_times=np.arange(0.5, blend_frames + 1.0) / fps,
        pose=here.poses[1],
        velocity=2.0 * quat.log(quat.multiply(here.poses[2], quat.conjugate(here.poses[0]))) / here.span_s,
        height=float(here.heights[1]),
        height_rate=float(here.heights[2] - here.heights[0]) / here.span_s,
        poses=poses,
        heights=played.root_positions[1 : blend_frames + 1, 1],
        offset=turned[1],
        offset_rate=_rate(turned, here.span_s),
        drop=float(here.heights[1] - there.heights[1]),
        drop_rate=float(np.diff((here.heights - there.heights)[[0, 2]])[0]) / here.span_s,
        steps=steps,
        step=here.step,
        step_offset=here.step - there.step,
    )


def _rate(vectors: FloatArray, span_s: float) -> FloatArray:
    """The rate of rotation vectors `(3, joints, 3)` at the middle one, each the way round that is nearest to it."""
    near = [_nearest(vectors[side], vectors[1]) for side in (0, 2)]
    return (near[1] - near[0]) / span_s


def _nearest(vectors: FloatArray, to: FloatArray) -> FloatArray:
    """The same rotations as vectors that lie nearest to others: about half a turn there are two ways round."""
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    other = vectors * (1.0 - 2.0 * math.pi / np.maximum(size, 1e-12))
    far, near = (np.linalg.norm(one - to, axis=-1, keepdims=True) for one in (vectors, other))
    return np.where(near < far, other, vectors)


@dataclass(frozen=True, eq=False)
class _Moment:
    """A clip about one frame: poses `(3, joints, 4)` and heights `(3,)` there, one frame before and one after.

    At the beginning of a clip the first is the frame itself, and `span_s` from first to last accordingly shorter.
    `step (3,)` is the turn and the step over the floor to the next frame, on average over the steps on either side.
    """

    poses: FloatArray
    heights: FloatArray
    span_s: float
    step: FloatArray

    @staticmethod
    def at(clip: Clip, frame: int, before: int) -> _Moment:
        """About `frame`, with `before` frames (0 or 1) before it; two clips compared have as many of both."""
        part = picked(clip, np.arange(frame - before, frame + 2))
        own = facing(part)
        turns, strides = steps_of(part, own)
        where = np.array([0, before, before + 1])
        step = np.column_stack([turns, strides[:, [0, 2]]]).mean(axis=0)
        return _Moment(
            quat.continuous(_leaning(part, own))[where],
            part.root_positions[where, 1],
            (before + 1) / clip.fps,
            step,
        )


def _leaning(clip: Clip, facings: FloatArray) -> FloatArray:
    """Rotations with the facing taken out of the root's, `(frames, joints, 4)`."""
    rotations = clip.rotations.copy()
    rotations[:, 0] = quat.multiply(quat.yaw(-facings), rotations[:, 0])
    return quat.continuous(rotations)
