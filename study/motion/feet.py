"""Feet on the floor: where the feet are, when they bear weight, how high the floor lies, how much they slide.

In: a `Clip` with ankles (and toes, where the rig has them). Out: arrays, or a clip moved so that its floor is at
`y = 0`. Everything here is measured on joints, so a sole below its joint counts as floor by a constant height.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from study.arrays import BoolArray, FloatArray
from study.motion.clip import Clip, joint_positions, moved

# A foot that bears weight moves slower than this (m/s) ...
_STANCE_SPEED = 0.5
# ... and its lowest point is this near to the floor (metres): captured feet roll and sink by some centimetres.
_STANCE_HEIGHT = 0.05
# About a step: shorter ways are swayed by the hips, longer ones run into the turn.
_SET_OUT_M = 0.9


def foot_points(clip: Clip) -> tuple[FloatArray, FloatArray]:
    """Ankle, toe joint and the end sites below, of the left and the right foot: two `(frames, points, 3)`, metres."""
    skeleton = clip.skeleton
    positions = joint_positions(clip, ends=True)
    feet = []
    for side in "LR":
        joints = {skeleton.role(f"ankle.{side}")}
        for joint in range(skeleton.joints):
            if int(skeleton.parents[joint]) in joints:
                joints.add(joint)
        ends = [skeleton.joints + e for e, p in enumerate(skeleton.end_parents) if int(p) in joints]
        feet.append(positions[:, sorted(joints) + ends])
    return feet[0], feet[1]


def toes(clip: Clip) -> FloatArray:
    """The joint of each foot's toes, `(frames, 2, 3)`, left then right, or the ankle where there is none; metres."""
    roles = clip.skeleton.roles
    found = [roles.get(f"toe.{side}", clip.skeleton.role(f"ankle.{side}")) for side in "LR"]
    positions: FloatArray = joint_positions(clip)[:, found]
    return positions


def horizontal_speeds(points: FloatArray, fps: float) -> FloatArray:
    """Speed over the floor of points `(frames, ..., 3)`, m/s, `(frames, ...)`; zero for a single frame."""
    if len(points) < 2:
        return np.zeros(points.shape[:-1])
    velocity = np.gradient(points[..., [0, 2]], axis=0) * fps
    return np.asarray(np.linalg.norm(velocity, axis=-1))


def floor_height(clip: Clip) -> float:
    """Height of the floor in a clip's world, metres: where the feet's lowest points rest while they are slow.

    The median over the frames in which the lowest point of either foot is slower than a foot in stance; where a clip
    has too few such frames, the second percentile of all lowest points.
    """
    left, right = foot_points(clip)
    points = np.concatenate([left, right], axis=1)
    heights = points[..., 1]
    lowest = np.argmin(heights, axis=1)
    frames = np.arange(clip.frames)
    low = heights[frames, lowest]
    slow = horizontal_speeds(points, clip.fps)[frames, lowest] < _STANCE_SPEED
    # In flight the lowest point may be slow too (a toe swinging back), but then it is far above the usual floor.
    slow &= low < np.percentile(low, 50) + _STANCE_HEIGHT
    if np.count_nonzero(slow) < max(3, clip.frames // 20):
        return float(np.percentile(low, 2))
    return float(np.median(low[slow]))


def stance(clip: Clip, *, floor: float | None = None) -> BoolArray:
    """When each foot bears weight, `(frames, 2)` for left and right: its lowest point is slow and near the floor."""
    floor = floor_height(clip) if floor is None else floor
    planted = np.empty((clip.frames, 2), dtype=np.bool_)
    for side, points in enumerate(foot_points(clip)):
        lowest = np.argmin(points[..., 1], axis=1)
        frames = np.arange(clip.frames)
        near = points[frames, lowest, 1] < floor + _STANCE_HEIGHT
        planted[:, side] = near & (horizontal_speeds(points, clip.fps)[frames, lowest] < _STANCE_SPEED)
    return planted


def heading(clip: Clip) -> FloatArray:
    """Which way the hips face in each frame, radians about the vertical from +Z towards +X, continuous `(frames,)`.

    A left turn makes it grow. From the hip joints' positions, so it is the same on every rig.
    """
    positions = joint_positions(clip)
    across = positions[:, clip.skeleton.role("hip.L")] - positions[:, clip.skeleton.role("hip.R")]
    return np.unwrap(np.arctan2(-across[:, 2], across[:, 0]))


def grounded(clip: Clip) -> Clip:
    """The clip with its floor at `y = 0`."""
    height = floor_height(clip)
    risen = replace(clip, root_positions=clip.root_positions - np.array([0.0, height, 0.0]))
    return risen.noting(f"floor put at 0 (it lay at {height:.3f} m)")


def faced(clip: Clip) -> Clip:
    """The clip turned and shifted over the floor so that it starts over the origin and sets out towards +Z.

    The direction is that of the first 0.9 m, where it goes so far in the first second; else the way the hips face.
    """
    way = np.linalg.norm((clip.root_positions - clip.root_positions[0])[:, [0, 2]], axis=1)
    stop = min(clip.frames - 1, round(clip.fps))
    far = np.flatnonzero(way[: stop + 1] > _SET_OUT_M)
    if len(far):
        gone = clip.root_positions[far[0]] - clip.root_positions[0]
        direction = float(np.arctan2(gone[0], gone[2]))
    else:
        direction = float(np.angle(np.mean(np.exp(1j * heading(clip)[: stop + 1]))))
    turned = moved(clip, -direction, np.zeros(3))
    start = turned.root_positions[0] * [1.0, 0.0, 1.0]
    return replace(turned, root_positions=turned.root_positions - start).noting(
        f"turned by {np.degrees(-direction):.0f} degrees to set out towards +Z, start put over the origin"
    )
