"""Two-bone inverse kinematics of the legs.

In: a clip and how far each foot is to move. Out: the clip with hips, knees and ankles turned so that it does,
feet keeping their rotation in the world; knees bend the way they bend, and legs stretch no further than they can.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from study.motion import quaternions as quat
from study.motion.clip import Clip, global_rotations, joint_positions

FloatArray = NDArray[np.float64]

# A leg may reach this share of its length, or as far as it reached before.
FULL_REACH = 0.995
LARGEST_DROP_M = 0.03
# Heel to buttock, radians from straight.
LARGEST_BEND = 2.6
# Sine of the bend under which a knee counts as nearly straight.
_STRAIGHT = 0.1
# An overstretched knee is brought round over a correction of this size.
_COME_ROUND_M = 0.01
_PASSES = 3


def reach(clip: Clip, shifts: FloatArray, first: int = 0) -> Clip:
    """Move the feet by `shifts (frames, 2, 3)`, metres, left then right.

    Where a leg is too short the pelvis comes down, by at most 3 cm. Frames without a shift stay as they are, except for
    the pelvis easing down and up around frames that need it, and frames before `first` stay in any case.
    """
    ankles = [clip.skeleton.role(f"ankle.{side}") for side in "LR"]
    targets = joint_positions(clip)[:, ankles] + shifts
    lowered = _lowered(clip, targets, shifts, first)
    dropped = np.any(lowered.root_positions != clip.root_positions, axis=1)
    rotations = clip.rotations.copy()
    for foot, side in enumerate("LR"):
        moved = np.linalg.norm(shifts[:, foot], axis=1)
        frames = np.flatnonzero(dropped | (moved > 0.0))
        if len(frames):
            leg = tuple(clip.skeleton.role(f"{part}.{side}") for part in ("hip", "knee", "ankle"))
            turned = _reach_one(
                _at(clip, frames), _at(lowered, frames), leg, knee_hinge(clip, side), targets[frames, foot]
            )
            for joint in leg:
                rotations[frames, joint] = turned[:, joint]
    return replace(lowered, rotations=rotations)


def beyond_reach(clip: Clip, shifts: FloatArray) -> FloatArray:
    """How far from a place `reach` would leave each ankle, `(frames, 2)`, metres, where a leg is too short for it."""
    positions = joint_positions(clip)
    excess = np.zeros((clip.frames, 2))
    for foot, side in enumerate("LR"):
        thigh, shank, reached = _lengths(clip, side)
        hip, ankle = (positions[:, clip.skeleton.role(f"{part}.{side}")] for part in ("hip", "ankle"))
        away = hip - (ankle + shifts[:, foot])
        away[:, 1] -= np.clip(away[:, 1], 0.0, LARGEST_DROP_M)
        limit = np.maximum(FULL_REACH * (thigh + shank), reached)
        moved = np.any(shifts[:, foot] != 0.0, axis=1)
        excess[:, foot] = np.where(moved, np.maximum(np.linalg.norm(away, axis=1) - limit, 0.0), 0.0)
    return excess


def _at(clip: Clip, frames: NDArray[np.int64]) -> Clip:
    return replace(clip, root_positions=clip.root_positions[frames], rotations=clip.rotations[frames])


def _lengths(clip: Clip, side: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Thigh and shank `(frames,)`, and how far the ankle is from the hip, metres."""
    positions = joint_positions(clip)
    hip, knee, ankle = (positions[:, clip.skeleton.role(f"{part}.{side}")] for part in ("hip", "knee", "ankle"))
    thigh, shank = np.linalg.norm(knee - hip, axis=1), np.linalg.norm(ankle - knee, axis=1)
    return thigh, shank, np.linalg.norm(ankle - hip, axis=1)


def _lowered(clip: Clip, targets: FloatArray, shifts: FloatArray, first: int) -> Clip:
    """The clip with its root let down, smoothly and by at most 3 cm, to where both feet are within reach."""
    drop = np.zeros(clip.frames)
    positions = joint_positions(clip)
    for foot, side in enumerate("LR"):
        thigh, shank, reached = _lengths(clip, side)
        limit = np.maximum(FULL_REACH * (thigh + shank), reached)
        away = positions[:, clip.skeleton.role(f"hip.{side}")] - targets[:, foot]
        floor = np.linalg.norm(away[:, [0, 2]], axis=1)
        height = np.sqrt(np.maximum(limit**2 - floor**2, 0.0))
        needed = np.where(np.any(shifts[:, foot] != 0.0, axis=1), away[:, 1] - height, 0.0)
        drop = np.maximum(drop, np.clip(needed, 0.0, LARGEST_DROP_M))
    # Under a micrometre is rounding.
    if np.max(drop) < 1e-6:
        return clip
    half = max(1, round(0.1 * clip.fps))
    drop = _envelope(drop, half)
    if first > 0:
        start = np.clip((np.arange(clip.frames) - first + 1) / (2 * half), 0.0, 1.0)
        drop = drop * start * start * (3.0 - 2.0 * start)
    return replace(clip, root_positions=clip.root_positions - np.outer(drop, [0.0, 1.0, 0.0]))


def _envelope(values: FloatArray, half: int) -> FloatArray:
    """A smooth curve over the values: their running maximum, averaged over a window of the same width."""
    padded = np.pad(values, 2 * half)
    highest = np.max(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=1)
    kernel = np.hanning(2 * half + 3)[1:-1]
    return np.convolve(highest, kernel / kernel.sum(), mode="valid")


def _reach_one(
    original: Clip, lowered: Clip, leg: tuple[int, ...], hinge: FloatArray, targets: FloatArray
) -> FloatArray:
    """Joint rotations with one leg turned so that its ankle comes to `targets (frames, 3)`; the foot turns no more."""
    hip, _, ankle = leg
    before = joint_positions(original)
    distance = np.linalg.norm(before[:, ankle] - before[:, hip], axis=1)
    # How much of a change there is at all: an overstretched knee comes round as the change grows, not at once.
    change = np.linalg.norm(targets - before[:, ankle], axis=1) + np.abs(
        lowered.root_positions[:, 1] - original.root_positions[:, 1]
    )
    part = lowered
    for _ in range(_PASSES):
        part = _bend(part, leg, hinge, targets, distance, np.clip(change / _COME_ROUND_M, 0.0, 1.0))
        part = _swing(part, leg, targets)
    rotations = part.rotations.copy()
    above = global_rotations(part)[:, original.skeleton.parents[ankle]]
    rotations[:, ankle] = quat.multiply(quat.conjugate(above), global_rotations(original)[:, ankle])
    return quat.normalise(rotations)


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
    clip: Clip, leg: tuple[int, ...], hinge: FloatArray, targets: FloatArray, before: FloatArray, change: FloatArray
) -> Clip:
    """The knee bent so that the ankle is as far from the hip as its target is, or as the leg reaches.

    `before (frames,)` is how far it was, metres: what the leg did already it may go on doing.
    """
    hip, knee, ankle = leg
    positions, world = joint_positions(clip), global_rotations(clip)
    thigh, shank = positions[:, knee] - positions[:, hip], positions[:, ankle] - positions[:, knee]
    a, b = np.linalg.norm(thigh, axis=1), np.linalg.norm(shank, axis=1)
    wanted = np.linalg.norm(targets - positions[:, hip], axis=1)
    folded = np.sqrt(a**2 + b**2 + 2 * a * b * np.cos(LARGEST_BEND))
    wanted = np.clip(wanted, np.minimum(folded, before), np.maximum(FULL_REACH * (a + b), before))
    normal = np.cross(thigh, shank) / (a * b)[:, None]
    axis = quat.rotate(world[:, hip], hinge)
    forward = np.where(np.sum(normal * axis, axis=1) < 0.0, -1.0, 1.0)
    bent = forward * np.arctan2(np.linalg.norm(normal, axis=1), np.sum(thigh * shank, axis=1) / (a * b))
    goal = np.pi - np.arccos(np.clip((a**2 + b**2 - wanted**2) / (2 * a * b), -1.0, 1.0))
    goal = np.where(bent < 0.0, bent + change * (goal - bent), goal)
    # The plane of the leg where it is bent; the knee's usual axis where it is nearly straight and has no plane.
    axis = normal * forward[:, None] + _STRAIGHT * axis
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    return _turned(clip, knee, world, quat.from_axis_angle(axis, goal - bent))


def _swing(clip: Clip, leg: tuple[int, ...], targets: FloatArray) -> Clip:
    """The thigh turned, by the least angle, so that the ankle lies in the direction of its target."""
    hip, _, ankle = leg
    positions = joint_positions(clip)
    here, there = positions[:, ankle] - positions[:, hip], targets - positions[:, hip]
    here /= np.linalg.norm(here, axis=1, keepdims=True)
    there /= np.linalg.norm(there, axis=1, keepdims=True)
    dots = np.sum(here * there, axis=1, keepdims=True)
    turn = quat.normalise(np.concatenate([1.0 + dots, np.cross(here, there)], axis=1))
    return _turned(clip, hip, global_rotations(clip), turn)


def _turned(clip: Clip, joint: int, world: FloatArray, turn: FloatArray) -> Clip:
    """One joint and all below it turned by a rotation in the world, `(frames, 4)`."""
    above = world[:, clip.skeleton.parents[joint]]
    rotations = clip.rotations.copy()
    rotations[:, joint] = quat.multiply(quat.conjugate(above), quat.multiply(turn, world[:, joint]))
    return replace(clip, rotations=quat.normalise(rotations))
