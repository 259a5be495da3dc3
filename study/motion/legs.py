"""Two-bone inverse kinematics of the legs.

In: a clip and how far each foot is to move. Out: the clip with hips, knees and ankles turned so that it does,
feet keeping their rotation in the world; knees bend the way they bend, and legs stretch no further than they can.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from study.arrays import FloatArray
from study.motion import quaternions as quat
from study.motion.clip import Clip, global_rotations, joint_positions, picked

# A leg may reach this share of its length, or as far as it reached before.
FULL_REACH = 0.995
LARGEST_DROP_M = 0.03
# Heel to buttock, radians from straight.
LARGEST_BEND = 2.6
# Sine of the bend under which a knee bends about its usual axis rather than in the plane of the leg.
_STRAIGHT = 0.35
# Cosines between that plane's normal and the usual axis: a knee that bends aside is not overstretched, one against is,
# if it bends little (radians): no knee is overstretched far.
_ASIDE_AGAINST, _FAR_LITTLE = (-0.5, -0.9), (0.6, 0.35)
# An overstretched knee is brought round over a correction of this size.
_COME_ROUND_M = 0.01
_PASSES = 3


def reach(clip: Clip, shifts: FloatArray) -> Clip:
    """Move the feet by `shifts (frames, 2, 3)`, metres, left then right, as far as the legs reach.

    Frames without a shift stay as they are.
    """
    rotations = clip.rotations.copy()
    frames = np.flatnonzero(np.any(shifts != 0.0, axis=(1, 2)))
    if len(frames):
        part = picked(clip, frames)
        positions, world = joint_positions(part), global_rotations(part)
        for foot, side in enumerate("LR"):
            leg = [clip.skeleton.role(f"{joint}.{side}") for joint in ("hip", "knee", "ankle")]
            moved = np.flatnonzero(np.any(shifts[frames, foot] != 0.0, axis=1))
            turned = _reach_one(
                positions[moved][:, leg],
                [world[moved, joint] for joint in leg],
                [world[moved, clip.skeleton.parents[joint]] for joint in leg],
                knee_hinge(clip, side),
                shifts[frames[moved], foot],
            )
            for joint, rotation in zip(leg, turned, strict=True):
                rotations[frames[moved], joint] = rotation
    return replace(clip, rotations=rotations)


def lowered(clip: Clip, shifts: FloatArray) -> tuple[Clip, FloatArray]:
    """The clip with its root let down, smoothly and by at most 3 cm, to where both feet are within reach of their
    shifts.

    Returns
    -------
    Clip
        The lower clip.
    ndarray (frames, 2, 3)
        The shifts that move its feet to the same places, metres.
    """
    drop = np.zeros(clip.frames)
    positions = joint_positions(clip)
    for foot, side in enumerate("LR"):
        hip, knee, ankle = (positions[:, clip.skeleton.role(f"{part}.{side}")] for part in ("hip", "knee", "ankle"))
        length = np.linalg.norm(knee - hip, axis=1) + np.linalg.norm(ankle - knee, axis=1)
        limit = np.maximum(FULL_REACH * length, np.linalg.norm(ankle - hip, axis=1))
        away = hip - ankle - shifts[:, foot]
        height = np.sqrt(np.maximum(limit**2 - np.sum(away[:, [0, 2]] ** 2, axis=1), 0.0))
        needed = np.where(np.any(shifts[:, foot] != 0.0, axis=1), away[:, 1] - height, 0.0)
        drop = np.maximum(drop, np.clip(needed, 0.0, LARGEST_DROP_M))
    # Under a micrometre is rounding.
    if np.max(drop) < 1e-6:
        return clip, shifts
    down = np.outer(_envelope(drop, max(1, round(0.1 * clip.fps))), [0.0, 1.0, 0.0])
    return replace(clip, root_positions=clip.root_positions - down), shifts + down[:, None]


def _envelope(values: FloatArray, half: int) -> FloatArray:
    """A smooth curve over the values: their running maximum, averaged over a window of the same width."""
    padded = np.pad(values, 2 * half)
    highest = np.max(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=1)
    kernel = np.hanning(2 * half + 3)[1:-1]
    return np.convolve(highest, kernel / kernel.sum(), mode="valid")


def _reach_one(
    leg: FloatArray, world: list[FloatArray], above: list[FloatArray], hinge: FloatArray, shifts: FloatArray
) -> list[FloatArray]:
    """Rotations of hip, knee and ankle that move the ankle by `shifts (frames, 3)`, the foot turning no more.

    `leg (frames, 3, 3)` are the three joints; `world` and `above` the rotations of each and of its parent, in the
    world.
    """
    thigh, shank = leg[:, 1] - leg[:, 0], leg[:, 2] - leg[:, 1]
    target = thigh + shank + shifts
    before = np.linalg.norm(thigh + shank, axis=1)
    # How much of a change there is at all: an overstretched knee comes round as the change grows, not at once.
    change = np.clip(np.linalg.norm(shifts, axis=1) / _COME_ROUND_M, 0.0, 1.0)
    swing = bend = np.tile(quat.IDENTITY, (len(leg), 1))
    axis = quat.rotate(world[0], hinge)
    against = _overstretched(thigh, shank, axis)
    for _ in range(_PASSES):
        wanted = np.linalg.norm(target, axis=1)
        turn = _bend(thigh, shank, quat.rotate(swing, axis), wanted, before, against, change)
        shank = quat.rotate(turn, shank)
        # The knee turns within the thigh, so its turns are kept as they are before the thigh swings.
        bend = quat.multiply(quat.conjugate(swing), quat.multiply(turn, quat.multiply(swing, bend)))
        turn = _between(thigh + shank, target)
        thigh, shank = quat.rotate(turn, thigh), quat.rotate(turn, shank)
        swing = quat.multiply(turn, swing)
    both = quat.multiply(swing, bend)
    return [
        quat.normalise(quat.multiply(quat.conjugate(parent), rotation))
        for parent, rotation in (
            (above[0], quat.multiply(swing, world[0])),
            (above[1], quat.multiply(bend, world[1])),
            (quat.multiply(both, above[2]), world[2]),
        )
    ]


def knee_hinge(clip: Clip, side: str) -> FloatArray:
    """The axis about which the knee bends, in the thigh's frame: the mean over the clip, by how far it is bent."""
    positions, world = joint_positions(clip), global_rotations(clip)
    hip, knee, ankle = (clip.skeleton.role(f"{part}.{side}") for part in ("hip", "knee", "ankle"))
    normal = np.cross(positions[:, knee] - positions[:, hip], positions[:, ankle] - positions[:, knee])
    # Where no knee bends at all, the line of the hips, from right to left, is the axis.
    line = positions[:, clip.skeleton.role("hip.L")] - positions[:, clip.skeleton.role("hip.R")]
    axes = quat.rotate(quat.conjugate(world[:, hip]), normal * np.linalg.norm(normal, axis=1, keepdims=True))
    axis = np.sum(axes, axis=0) + 1e-9 * quat.rotate(quat.conjugate(world[0, hip]), line[0])
    return np.asarray(axis / np.linalg.norm(axis))


def knee_bend(clip: Clip, side: str, hinge: FloatArray) -> FloatArray:
    """How far a knee is bent in each frame `(frames,)`, radians; below 0 where it is bent the wrong way."""
    positions, world = joint_positions(clip), global_rotations(clip)
    hip, knee, ankle = (clip.skeleton.role(f"{part}.{side}") for part in ("hip", "knee", "ankle"))
    thigh, shank = positions[:, knee] - positions[:, hip], positions[:, ankle] - positions[:, knee]
    normal = np.cross(thigh, shank)
    forward = np.where(np.sum(normal * quat.rotate(world[:, hip], hinge), axis=1) < 0.0, -1.0, 1.0)
    return np.asarray(forward * np.arctan2(np.linalg.norm(normal, axis=1), np.sum(thigh * shank, axis=1)))


def _bend(
    thigh: FloatArray,
    shank: FloatArray,
    axis: FloatArray,
    wanted: FloatArray,
    before: FloatArray,
    against: FloatArray,
    change: FloatArray,
) -> FloatArray:
    """The turn of the knee, `(frames, 4)`, after which the ankle is as far from the hip as wanted, or as the leg
    reaches.

    `thigh`, `shank` and the usual `axis` of the knee `(frames, 3)` are in the world. `before (frames,)` is how far the
    ankle was, metres: what the leg did already it may go on doing. A knee that was overstretched (`against`) goes a
    share `change` of its way.
    """
    a, b = np.linalg.norm(thigh, axis=1), np.linalg.norm(shank, axis=1)
    folded = np.sqrt(a**2 + b**2 + 2 * a * b * np.cos(LARGEST_BEND))
    wanted = np.clip(wanted, np.minimum(folded, before), np.maximum(FULL_REACH * (a + b), before))
    normal = np.cross(thigh, shank) / (a * b)[:, None]
    bent = np.arctan2(np.linalg.norm(normal, axis=1), np.sum(thigh * shank, axis=1) / (a * b))
    goal = np.pi - np.arccos(np.clip((a**2 + b**2 - wanted**2) / (2 * a * b), -1.0, 1.0))
    forward = np.where(np.sum(normal * axis, axis=1) < 0.0, -1.0, 1.0)
    turn = against * change * (goal - forward * bent) + (1.0 - against) * (goal - bent)
    # The plane of the leg where it is bent; the knee's usual axis where it is nearly straight and has no plane.
    axis = normal * (against * forward + 1.0 - against)[:, None] + _STRAIGHT * axis
    return quat.from_axis_angle(axis / np.linalg.norm(axis, axis=1, keepdims=True), turn)


def _overstretched(thigh: FloatArray, shank: FloatArray, axis: FloatArray) -> FloatArray:
    """How much each knee counts as overstretched, `(frames,)` from 0 to 1; vectors as `_bend` has them."""
    normal = np.cross(thigh, shank)
    length = np.linalg.norm(normal, axis=1)
    bent = np.arctan2(length, np.sum(thigh * shank, axis=1))
    along = np.sum(normal * axis, axis=1) / np.maximum(length, 1e-12)
    return ramp(along, _ASIDE_AGAINST) * ramp(bent, _FAR_LITTLE)


def _between(here: FloatArray, there: FloatArray) -> FloatArray:
    """The least turn `(frames, 4)` from one direction `(frames, 3)` to another."""
    here = here / np.linalg.norm(here, axis=1, keepdims=True)
    there = there / np.linalg.norm(there, axis=1, keepdims=True)
    dots = np.sum(here * there, axis=1, keepdims=True)
    return quat.normalise(np.concatenate([1.0 + dots, np.cross(here, there)], axis=1))


def ramp(values: FloatArray, bounds: tuple[float, float]) -> FloatArray:
    """From 0 at the first bound to 1 at the second, smoothly, and level beyond them."""
    x = np.clip((values - bounds[0]) / (bounds[1] - bounds[0]), 0.0, 1.0)
    return np.asarray(x * x * (3.0 - 2.0 * x))
