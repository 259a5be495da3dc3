"""How a cycle, a step or a standstill is carried on beyond a clip's end; `cycles` decides which and how long.

In: a clip and the period that ends it. Out: the frames that follow. Frame `t` of the continuation is an isometry `S`
of the floor applied to frame `t - period`: for a whole cycle a shift (and a turn, round a bend), for a single step the
reflection about the line of travel, which makes a right step of a left one.

The body at the period's end is never quite `S` of the body at its beginning. What it differs by is spread over the
period: a cubic (Hermite) starts with the difference in pose and in velocity, and ends with neither, so that every
repeat joins the one before in both. Hips that face elsewhere take the path along with them. Feet stay where they
bear weight, and make up the difference while they swing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from study.arrays import BoolArray, FloatArray, runs
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, moved, picked
from study.motion.feet import heading, stance
from study.motion.legs import knee_bend, knee_hinge, lowered, reach
from study.motion.mirror import mirror

# Velocities at the seam are slopes over this time, seconds: longer than the noise of markers, shorter than a movement.
_SLOPE_S = 0.04
# A difference in velocity dies away over this, or over the period where that is shorter: a slope carried on through a
# whole cycle would swing a leg by tenths of a metre.
_SETTLE_S = 0.2
# A knee bent by less counts as straight, radians.
_STRAIGHT_KNEE = 0.035
# A foot that is in the air for less than this is taken to stay on the floor.
_SHORTEST_SWING_S = 0.1
# Steps a frame in which the path is summed.
_FINE = 8
# Standing: the drawn-out part is gone through once in no less than this, and the last velocity dies away over this.
_SLOWEST_SWAY_S, _COME_TO_REST_S = 1.2, 0.7


def linger(clip: Clip, still_frames: float, frames: int) -> Clip:
    """The frames that follow a clip which ends standing still: its sway, back and forth.

    The still part is played backwards and forwards, slowing down to nothing where the direction changes; the velocity
    at the clip's end dies away over 0.7 s. Poses are captured ones, so the feet stand where they stood.
    """
    span = max(still_frames - 1.0, 1.0)
    sweep = max(0.5 * np.pi * span, _SLOWEST_SWAY_S * clip.fps)
    after = np.arange(1, frames + 1, dtype=np.float64)
    back = 0.5 * span * (1.0 - np.cos(np.pi * after / sweep))
    added = smooth_sample(clip, clip.frames - 1.0 - back)
    rest = _COME_TO_REST_S * clip.fps
    share = np.clip(after / rest, 0.0, 1.0)
    fading = rest * share * (1.0 - share) ** 2
    return replace(
        added,
        root_positions=added.root_positions + fading[:, None] * _slope(clip.root_positions, clip.fps),
        rotations=quat.normalise(
            quat.multiply(added.rotations, quat.exp(fading[:, None, None] * _slope(_since_end(clip), clip.fps)))
        ),
    )


def _since_end(clip: Clip) -> FloatArray:
    """The rotations of the last frames as half-angle vectors from the last one."""
    near = clip.rotations[-_slope_frames(clip.fps, clip.frames) :]
    return quat.log(quat.multiply(quat.conjugate(clip.rotations[-1]), near))


@dataclass(frozen=True, eq=False)
class _Isometry:
    """A reflection in the plane `x = 0`, or none, then a turn about the vertical; the shift comes apart."""

    reflect: bool
    yaw: float

    def inverse(self) -> _Isometry:
        return self if self.reflect else _Isometry(False, -self.yaw)

    def of(self, clip: Clip) -> Clip:
        """A clip moved; a reflected one keeps its own body, which need not be quite symmetrical."""
        if self.reflect:
            clip = replace(mirror(clip), skeleton=clip.skeleton)
        return moved(clip, self.yaw, np.zeros(3))

    def of_points(self, points: FloatArray) -> FloatArray:
        if self.reflect:
            points = points * np.array([-1.0, 1.0, 1.0])
        return quat.rotate(quat.yaw(self.yaw), points)


def carry_on(clip: Clip, period: float, frames: int, *, reflect: bool, turn: float, curving: bool) -> Clip:
    """The frames that follow a clip which ends in gait.

    Parameters
    ----------
    clip
        It holds more than one period.
    period
        Frames of the cycle, or of the step where `reflect`; need not be whole.
    frames
        How many to make.
    reflect
        Whether the next period is the mirror image of the last.
    turn
        Radians that each period turns against the one before; not where `reflect`.
    curving
        Whether the clip was turning, so that its line of travel is that of its very end.
    """
    isometry = _Isometry(reflect, 2.0 * _line_of_travel(clip, period, curving) if reflect else turn)
    base = _base_period(clip, period, isometry)
    after = np.arange(1, frames + 1, dtype=np.float64)
    repeats = np.ceil(after / period - 1e-9).astype(np.int64)
    within = after - (repeats - 1) * period
    added = _with_planted_feet(base, within)
    shift = clip.root_positions[-1] - isometry.of_points(base.path[0])
    shift[1] = 0.0
    positions, rotations = added.root_positions.copy(), added.rotations.copy()
    for repeat in range(1, int(repeats[-1]) + 1):
        # The k-th repeat is S applied k times: all later frames go through it once more.
        later = repeats >= repeat
        part = isometry.of(replace(added, root_positions=positions[later], rotations=rotations[later]))
        positions[later], rotations[later] = part.root_positions + shift, part.rotations
    return replace(added, root_positions=positions, rotations=rotations)


def _line_of_travel(clip: Clip, step: float, curving: bool) -> float:
    """The direction, radians from +Z towards +X, about which left and right steps are mirror images."""
    facing = heading(clip)
    at = np.arange(clip.frames)
    if not curving:
        near = clip.frames - 1.0 - np.linspace(0.0, min(0.25 * step, clip.frames - 1.0 - step), 9)
        return float(np.mean(np.interp(near, at, facing) + np.interp(near - step, at, facing)) / 2.0)
    back = max(2, round(0.4 * step))
    pelvis = joint_positions(clip)[:, clip.skeleton.role("pelvis")]
    go = pelvis[-1] - pelvis[-1 - back]
    travel = float(np.arctan2(go[0], go[2]))
    # Within half a turn of the way the hips face, so that the angle is the same branch.
    return travel + 2.0 * np.pi * round(float(facing[-1] - travel) / (2.0 * np.pi))


@dataclass(frozen=True, eq=False)
class _Period:
    """The corrected period, in the clip's own world, where its end is the clip's end.

    `at` gives its frames at any time within; `path` is its root's way over the floor on a fine grid.
    """

    clip: Clip
    period: float
    path: FloatArray
    height: FloatArray
    yaw: FloatArray
    turns: tuple[FloatArray, FloatArray]
    hinges: tuple[FloatArray, FloatArray]

    def at(self, within: FloatArray) -> Clip:
        """Frames at times `(n,)`, in frames since the period's beginning."""
        template = smooth_sample(self.clip, self.clip.frames - 1.0 - self.period + within)
        grid = np.linspace(0.0, self.period, len(self.path))
        positions = np.stack([np.interp(within, grid, self.path[:, axis]) for axis in range(3)], axis=1)
        fade, slope = _fading(within, self.period, self.clip.fps)
        positions[:, 1] = template.root_positions[:, 1] + fade * self.height[0] + slope * self.height[1]
        turned = fade[:, None, None] * self.turns[0] + slope[:, None, None] * self.turns[1]
        rotations = quat.multiply(template.rotations, quat.exp(turned))
        yaw = fade * self.yaw[0] + slope * self.yaw[1]
        rotations[:, 0] = quat.multiply(quat.yaw(yaw), rotations[:, 0])
        corrected = replace(template, root_positions=positions, rotations=quat.normalise(rotations))
        for side, hinge in zip("LR", self.hinges, strict=True):
            corrected = _knee_forward(corrected, template, side, hinge)
        return corrected


def _knee_forward(clip: Clip, captured: Clip, side: str, hinge: FloatArray) -> Clip:
    """A corrected clip whose knee bends no further the wrong way than straight, or than it was captured."""
    least = np.minimum(knee_bend(captured, side, hinge), _STRAIGHT_KNEE)
    spare = knee_bend(clip, side, hinge) - least
    # The greater of `spare` and 0, with its corner rounded.
    rounded = np.where(spare < _STRAIGHT_KNEE, np.clip(spare + _STRAIGHT_KNEE, 0.0, None) ** 2, 0.0)
    bend = np.where(spare < _STRAIGHT_KNEE, rounded / (4.0 * _STRAIGHT_KNEE), spare)
    knee = clip.skeleton.role(f"knee.{side}")
    rotations = clip.rotations.copy()
    rotations[:, knee] = quat.multiply(quat.from_axis_angle(hinge, bend - spare), rotations[:, knee])
    return replace(clip, rotations=quat.normalise(rotations))


def _with_planted_feet(base: _Period, within: FloatArray) -> Clip:
    """Frames of the period at times `(n,)`, with feet held in place by inverse kinematics while they bear weight.

    What the corrections move an ankle by is known from the captured period: while the captured foot bears weight, that
    is held constant, and it changes while the foot swings.
    """
    frames = base.at(within)
    grid = np.linspace(0.0, base.period, 2 * int(np.ceil(base.period)) + 1)
    times = base.clip.frames - 1.0 - base.period + grid
    captured, corrected = joint_positions(smooth_sample(base.clip, times)), joint_positions(base.at(grid))
    planted = stance(base.clip)[np.round(times).astype(np.int64)]
    shortest = int(np.ceil(_SHORTEST_SWING_S * base.clip.fps * (len(grid) - 1) / base.period))
    shifts = np.empty((len(within), 2, 3))
    for foot, side in enumerate("LR"):
        ankle = base.clip.skeleton.role(f"ankle.{side}")
        shift = _held(corrected[:, ankle] - captured[:, ankle], _contacts(planted[:, foot], shortest), shortest)
        shifts[:, foot] = np.stack([np.interp(within, grid, shift[:, axis]) for axis in range(3)], axis=1)
    return reach(*lowered(frames, shifts))


def _contacts(planted: BoolArray, shortest: int) -> list[tuple[int, int]]:
    """Stretches of planted rows, as slices count them; shorter gaps between them are closed, shorter ones dropped."""
    contacts: list[tuple[int, int]] = []
    for start, stop in runs(planted):
        if contacts and start - contacts[-1][1] < shortest:
            contacts[-1] = (contacts[-1][0], stop)
        else:
            contacts.append((start, stop))
    return [(start, stop) for start, stop in contacts if stop - start >= shortest or start == 0 or stop == len(planted)]


def _held(change: FloatArray, contacts: list[tuple[int, int]], shortest: int) -> FloatArray:
    """What to add to a change of a foot's place `(n, 3)` so that it is constant while the foot is planted.

    Nothing at both ends. A foot planted at an end keeps what it has there; one planted all along, or again at once,
    has to give way slowly.
    """
    last = len(change) - 1
    added = np.zeros_like(change)
    knots = [] if contacts and contacts[0][0] == 0 else [(0, 0)]
    for start, stop in contacts:
        part = change[start:stop]
        rest = 1.0 - np.linspace(0.0, 1.0, len(part))[:, None]
        giving_way = rest * rest * (3.0 - 2.0 * rest)
        # Too little time to swing into place before, or after: then the foot comes down, or lifts, where it does.
        first = part[0] if start < shortest else part.mean(axis=0)
        final = part[-1] if last - stop < shortest else part.mean(axis=0)
        if start < shortest and last - stop >= shortest:
            final = first
        if last - stop < shortest and start >= shortest:
            first = final
        keep = giving_way * first + (1.0 - giving_way) * final
        # The height is not kept: where it has to differ, it comes to the captured one while the foot stands.
        keep[:, 1] = giving_way[:, 0] * part[0, 1] if start < shortest else 0.0
        added[start:stop] = keep - part
        knots.append((start, stop - 1))
    if not contacts or contacts[-1][1] <= last:
        knots.append((last, last))
    for (_, left), (right, _) in pairwise(knots):
        _bridge(added, left, right)
    return added


def _bridge(values: FloatArray, left: int, right: int) -> None:
    """Fill rows between two given ones by a cubic that leaves and meets them with the slope on their far sides."""
    span = right - left
    if span < 2:
        return
    last = len(values) - 1
    slope_left = values[left] - values[left - 1] if left > 0 else np.zeros(values.shape[1])
    slope_right = values[right + 1] - values[right] if right < last else np.zeros(values.shape[1])
    t = (np.arange(1, span) / span)[:, None]
    values[left + 1 : right] = (
        (1 + 2 * t) * (1 - t) ** 2 * values[left]
        + t**2 * (3 - 2 * t) * values[right]
        + span * (t * (1 - t) ** 2 * slope_left - t**2 * (1 - t) * slope_right)
    )


def _fading(within: FloatArray, period: float, fps: float) -> tuple[FloatArray, FloatArray]:
    """How a difference fades, at frames `(n,)` since the period's beginning: cubics that end in 0 with slope 0.

    The first begins at 1 with slope 0 and spans the period, the second at 0 with slope 1 and spans 0.2 s at most.
    """
    rest = 1.0 - within / period
    settle = min(period, _SETTLE_S * fps)
    share = np.clip(within / settle, 0.0, 1.0)
    return rest * rest * (3.0 - 2.0 * rest), settle * share * (1.0 - share) ** 2


def _base_period(clip: Clip, period: float, isometry: _Isometry) -> _Period:
    """The last period, corrected so that it begins as the inverse of the isometry has the clip's end."""
    count = _slope_frames(clip.fps, int(clip.frames - period))
    ends: FloatArray = clip.frames - 1.0 - np.arange(count, dtype=np.float64)[::-1]
    there = isometry.inverse().of(picked(clip, slice(-count, None)))
    here = smooth_sample(clip, ends - period)
    facing_there, facing_here = heading(there), heading(here)
    turned = facing_there - facing_here
    turned = turned - 2.0 * np.pi * np.round(turned[-1] / (2.0 * np.pi))
    yaw = np.array([turned[-1], _slope(turned, 1.0)])
    straightened = here.rotations.copy()
    straightened[:, 0] = quat.multiply(quat.yaw(turned), straightened[:, 0])
    differences = quat.log(quat.multiply(quat.conjugate(straightened), there.rotations))
    turns = (differences[-1], _slope(differences, 1.0))
    rise = there.root_positions[:, 1] - here.root_positions[:, 1]
    height = np.array([rise[-1], _slope(rise, 1.0)])

    grid = np.linspace(0.0, period, int(np.ceil(period)) * _FINE + 1)
    fade, slope = _fading(grid, period, clip.fps)
    way = smooth_sample(clip, clip.frames - 1.0 - period + grid).root_positions
    turning = quat.yaw(fade * yaw[0] + slope * yaw[1])
    steps = quat.rotate(quat.normalise(turning[1:] + turning[:-1]), np.diff(way, axis=0))
    path = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    velocity = _slope(there.root_positions, 1.0) - quat.rotate(turning[0], _slope(here.root_positions, 1.0))
    path += slope[:, None] * velocity * np.array([1.0, 0.0, 1.0])
    path += clip.root_positions[-1] - path[-1]
    hinges = (knee_hinge(clip, "L"), knee_hinge(clip, "R"))
    return _Period(clip, period, path, height, yaw, turns, hinges)


def _slope_frames(fps: float, available: int) -> int:
    """How many of the last frames give a slope: at least two, where there are."""
    return max(min(2, available), min(available, round(_SLOPE_S * fps) + 1))


def _slope(values: FloatArray, per: float) -> FloatArray:
    """Least-squares slope of the last frames, held to the last value; per frame, whatever `per` says of the rate."""
    count = _slope_frames(per, len(values)) if per > 1.0 else len(values)
    if count < 2:
        return np.zeros_like(values[-1])
    near = values[-count:]
    age = np.arange(1 - count, 1, dtype=np.float64)
    return np.asarray(np.tensordot(age, near - near[-1], axes=(0, 0)) / np.sum(age * age))


def smooth_sample(clip: Clip, times: FloatArray) -> Clip:
    """Poses at fractional frame numbers `(n,)` by cubic convolution (Keys 1981): no corners at the frames.

    Slerp, as `clip.sample` does it, cuts the corners of a fast foot by millimetres at 30 fps, and more between frames
    than on them, which shows as a flicker once a cycle repeats at another phase.
    """
    last = clip.frames - 1
    times = np.clip(times, 0.0, last)
    first = np.minimum(np.floor(times).astype(np.int64), max(last - 1, 0))
    part = times - first
    taps = np.clip(first[:, None] + np.arange(-1, 3), 0, last)
    p, p2, p3 = part, part**2, part**3
    weights = 0.5 * np.stack([2 * p2 - p - p3, 3 * p3 - 5 * p2 + 2, 4 * p2 - 3 * p3 + p, p3 - p2], axis=1)
    positions = np.einsum("nt,ntk->nk", weights, clip.root_positions[taps])
    # Signs are continuous over the frames, so components can be mixed.
    rotations = quat.normalise(np.einsum("nt,ntjk->njk", weights, clip.rotations[taps]))
    return replace(clip, root_positions=positions, rotations=rotations)
