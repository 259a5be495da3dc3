"""Upper and lower body apart: a one-hop transition for each, played at once.

Koyama & Goto 2019, section 5, Separate handling of body parts. Each part has its own distance and so its own table;
both tables end in the same destination at the same place in time, so the parts meet again. Whether that looks
natural is for a study to say.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from study.arrays import BoolArray, FloatArray
from study.errors import TransitionError
from study.motion.clip import Clip
from study.motion.skeleton import Skeleton

PARTS = ("lower", "upper")


def part_joints(skeleton: Skeleton, part: str) -> BoolArray:
    """Which joints belong to a part, `(joints,)`: `"upper"` is the spine and all above it, `"lower"` the rest."""
    if part not in PARTS:
        raise TransitionError(f"Expected a part of the body, {' or '.join(PARTS)}, got {part!r}.")
    upper = np.zeros(skeleton.joints, dtype=bool)
    upper[skeleton.role("spine")] = True
    for joint, parent in enumerate(skeleton.parents):
        if parent >= 0 and upper[parent]:
            upper[joint] = True
    return upper if part == "upper" else ~upper


def part_weights(skeleton: Skeleton, part: str) -> FloatArray:
    """Weights of a `PointCloudDistance` that sees one part only."""
    return part_joints(skeleton, part).astype(np.float64)


def put_together(lower: Clip, upper: Clip) -> Clip:
    """The root and legs of one clip with the trunk, arms and head of another, frame by frame."""
    if lower.frames != upper.frames or not lower.skeleton.matches(upper.skeleton):
        raise TransitionError(
            f"Expected two clips of one rig and length for the parts of one body, got {lower.frames} and "
            f"{upper.frames} frames. Play both parts with the same triggers."
        )
    joints = part_joints(lower.skeleton, "upper")
    rotations = np.where(joints[:, None], upper.rotations, lower.rotations)
    history = (*(f"lower body: {line}" for line in lower.history), *(f"upper body: {line}" for line in upper.history))
    return replace(lower, rotations=rotations, history=history)
