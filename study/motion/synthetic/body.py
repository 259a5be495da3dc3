"""The synthetic figure: one skeleton of 22 joints for a stature of 1.75 m.

Segment lengths are shares of stature after Drillis & Contini 1966, as printed in Winter 2009, Figure 4.1: hip
0.530, knee 0.285 and ankle 0.039 above the floor, upper arm 0.186, forearm 0.146, foot 0.152, shoulder
0.818 above the floor. In rest (identity rotations) it stands upright, arms hanging, facing +Z, its left at +X.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from study.motion.skeleton import Skeleton

STATURE = 1.75
THIGH = (0.530 - 0.285) * STATURE
SHANK = (0.285 - 0.039) * STATURE
LEG = THIGH + SHANK
ANKLE_HEIGHT = 0.039 * STATURE
UPPER_ARM = 0.186 * STATURE
FOREARM = 0.146 * STATURE
# To the knuckles, half of the hand's 0.108: hands are half closed here.
HAND = 0.054 * STATURE

# Hip joint centres lie 0.17 m apart (from pelvic width, Bell et al. 1990), shoulder joints 0.36 m.
HIP_HALF_WIDTH = 0.085
SHOULDER_HALF_WIDTH = 0.18
# The root stands a little above the line through the hips.
HIPS_ABOVE_JOINTS = 0.05

# The sole in the ankle's frame: the heel's contact point, and the joint of the toes 2 cm above the floor.
HEEL_BACK = 0.05
TOE_FORWARD = 0.130
TOE_HEIGHT = 0.020
TOE_LENGTH = 0.065

JOINTS = (
    # name, parent, offset from the parent in metres
    ("Hips", "", (0.0, 0.0, 0.0)),
    ("LeftUpLeg", "Hips", (HIP_HALF_WIDTH, -HIPS_ABOVE_JOINTS, 0.0)),
    ("LeftLeg", "LeftUpLeg", (0.0, -THIGH, 0.0)),
    ("LeftFoot", "LeftLeg", (0.0, -SHANK, 0.0)),
    ("LeftToeBase", "LeftFoot", (0.0, TOE_HEIGHT - ANKLE_HEIGHT, TOE_FORWARD)),
    ("RightUpLeg", "Hips", (-HIP_HALF_WIDTH, -HIPS_ABOVE_JOINTS, 0.0)),
    ("RightLeg", "RightUpLeg", (0.0, -THIGH, 0.0)),
    ("RightFoot", "RightLeg", (0.0, -SHANK, 0.0)),
    ("RightToeBase", "RightFoot", (0.0, TOE_HEIGHT - ANKLE_HEIGHT, TOE_FORWARD)),
    ("Spine", "Hips", (0.0, 0.075, -0.012)),
    ("Spine1", "Spine", (0.0, 0.125, -0.004)),
    ("Chest", "Spine1", (0.0, 0.130, -0.008)),
    ("Neck", "Chest", (0.0, 0.190, -0.008)),
    ("Head", "Neck", (0.0, 0.085, 0.018)),
    ("LeftShoulder", "Chest", (0.025, 0.125, 0.020)),
    ("LeftArm", "LeftShoulder", (SHOULDER_HALF_WIDTH - 0.025, 0.0, -0.016)),
    ("LeftForeArm", "LeftArm", (0.0, -UPPER_ARM, 0.0)),
    ("LeftHand", "LeftForeArm", (0.0, -FOREARM, 0.0)),
    ("RightShoulder", "Chest", (-0.025, 0.125, 0.020)),
    ("RightArm", "RightShoulder", (-SHOULDER_HALF_WIDTH + 0.025, 0.0, -0.016)),
    ("RightForeArm", "RightArm", (0.0, -UPPER_ARM, 0.0)),
    ("RightHand", "RightForeArm", (0.0, -FOREARM, 0.0)),
)

ENDS = (
    ("LeftToeBase", (0.0, 0.0, TOE_LENGTH)),
    ("RightToeBase", (0.0, 0.0, TOE_LENGTH)),
    ("Head", (0.0, 0.165, 0.0)),
    ("LeftHand", (0.0, -HAND, 0.0)),
    ("RightHand", (0.0, -HAND, 0.0)),
)

INDEX = {name: index for index, (name, _, _) in enumerate(JOINTS)}


@cache
def skeleton() -> Skeleton:
    """The one skeleton of every synthetic motion (the same object each time, so clips join without retargeting)."""
    return Skeleton(
        names=tuple(name for name, _, _ in JOINTS),
        parents=np.array([INDEX.get(parent, -1) for _, parent, _ in JOINTS]),
        offsets=np.array([offset for _, _, offset in JOINTS]),
        end_parents=np.array([INDEX[name] for name, _ in ENDS]),
        end_offsets=np.array([offset for _, offset in ENDS]),
    )
