"""Small analytic figures for the transition tests."""

from __future__ import annotations

import numpy as np

from study.motion import quaternions as quat
from study.motion.clip import Clip
from study.motion.skeleton import Skeleton


def make_rig(scale: float = 1.0, toes: bool = True) -> Skeleton:
    """A figure of legs, arms and a spine."""
    names, parents, offsets = ["Hips", "Spine", "Chest", "Neck", "Head"], [-1, 0, 1, 2, 3], [[0.0, 0.0, 0.0]]
    offsets += [[0.0, 0.15, 0.0], [0.0, 0.2, 0.0], [0.0, 0.15, 0.0], [0.0, 0.1, 0.0]]
    for side, sign in (("Left", 1.0), ("Right", -1.0)):
        leg = [("UpLeg", [0.1, -0.05, 0.0]), ("Leg", [0.0, -0.42, 0.0]), ("Foot", [0.0, -0.42, 0.0])]
        leg += [("Toe", [0.0, -0.06, 0.15])] if toes else []
        arm = [("Arm", [0.2, 0.05, 0.0]), ("ForeArm", [0.28, 0.0, 0.0]), ("Hand", [0.25, 0.0, 0.0])]
        for chain, above in ((leg, 0), (arm, 2)):
            for part, (x, y, z) in chain:
                parents.append(above)
                above = len(names)
                names.append(side + part)
                offsets.append([sign * x, y, z])
    ends = [names.index(f"{side}{'Toe' if toes else 'Foot'}") for side in ("Left", "Right")]
    return Skeleton(
        tuple(names),
        np.array(parents),
        scale * np.array(offsets),
        np.array(ends),
        scale * np.array([[0.0, -0.01, 0.06]] * 2),
    )


def make_walk(
    frames: int = 150,
    fps: float = 30.0,
    *,
    speed: float = 1.2,
    cadence: float = 1.0,
    phase: float = 0.0,
    swing: float = 0.5,
    turn_rate: float = 0.0,
    heading: float = 0.0,
    scale: float = 1.0,
    toes: bool = True,
    name: str = "",
) -> Clip:
    """A figure that swings its limbs and goes along a straight or curved path; every joint moves smoothly."""
    rig = make_rig(scale, toes=toes)
    seconds = np.arange(frames) / fps
    cycle = 2 * np.pi * cadence * seconds + phase
    rotations = np.tile(quat.IDENTITY, (frames, rig.joints, 1))
    side_to_side = np.array([1.0, 0.0, 0.0])
    for side, sign in (("L", 1.0), ("R", -1.0)):
        rotations[:, rig.role(f"hip.{side}")] = quat.from_axis_angle(side_to_side, -sign * swing * np.sin(cycle))
        bend = swing * (1.0 + np.cos(cycle + sign * np.pi / 2))
        rotations[:, rig.role(f"knee.{side}")] = quat.from_axis_angle(side_to_side, bend)
        arm = quat.from_axis_angle(side_to_side, sign * swing * np.sin(cycle))
        hang = quat.from_axis_angle(np.array([0.0, 0.0, 1.0]), np.full(frames, -sign * 1.2))
        rotations[:, rig.role(f"shoulder.{side}")] = quat.multiply(arm, hang)
        elbow = quat.from_axis_angle(np.array([0.0, 1.0, 0.0]), -sign * (0.3 + 0.2 * np.sin(cycle)))
        rotations[:, rig.role(f"elbow.{side}")] = elbow
    facing = heading + turn_rate * seconds
    sway = 0.08 * np.sin(cycle)
    rotations[:, 0] = quat.multiply(quat.yaw(facing + sway), quat.from_axis_angle(side_to_side, 0.1 * np.sin(cycle)))
    rotations[:, rig.role("spine")] = quat.yaw(-1.5 * sway)
    steps = np.stack([np.sin(facing), np.zeros(frames), np.cos(facing)], axis=1) * speed / fps
    path = np.concatenate([np.zeros((1, 3)), np.cumsum(steps[:-1], axis=0)])
    path[:, 1] = scale * (0.9 + 0.02 * np.cos(2 * cycle))
    return Clip(rig, path, rotations, fps, name=name)
