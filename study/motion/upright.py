"""Which axis of a file is up, and clips put upright where it isn't Y.

In: a `Clip` as its file has it. Out: the axis that the body stands along, or the clip in coordinates with Y up. BVH
files don't say which axis is up; most have Y, some programs write Z. Where a body stands along another axis both in its
rest pose and in nearly all frames, the file means that axis. Where only the frames say so, it may be somebody who lies.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from study.motion import quaternions as quat
from study.motion.clip import Clip, at_rest, joint_positions, picked, some_frames

# Between legs that are straight in rest and those of somebody in a fighting stance.
_WITHIN = np.cos(np.radians(35.0))
# Frames looked at.
_POSES = 1000
# A turn to Y from each other axis that a body may stand along.
_TURNS = {
    "X": ([0.0, 0.0, 1.0], np.pi / 2),
    "-X": ([0.0, 0.0, 1.0], -np.pi / 2),
    "Z": ([1.0, 0.0, 0.0], -np.pi / 2),
    "-Z": ([1.0, 0.0, 0.0], np.pi / 2),
}


def lying_axis(clip: Clip) -> str | None:
    """The axis other than Y that the legs stretch along, up, in nearly all frames: `"Z"`, `"-X"` ...; else None."""
    return _axis_of_legs(picked(clip, some_frames(clip.frames, _POSES)))


def put_upright(clip: Clip) -> Clip:
    """The clip in coordinates with Y up, where its rest pose and its frames stand along the same other axis.

    Rest pose and motion are turned alike, so rotations mean what they meant; the history says it. Any other clip is
    returned as it is; `study.motion.defects.find_defects` tells of one that lies.
    """
    axis = lying_axis(clip)
    if axis is None or _axis_of_legs(at_rest(clip.skeleton)) != axis:
        return clip
    turn = quat.from_axis_angle(*_TURNS[axis])
    skeleton = replace(
        clip.skeleton,
        offsets=quat.rotate(turn, clip.skeleton.offsets),
        end_offsets=quat.rotate(turn, clip.skeleton.end_offsets),
    )
    return replace(
        clip,
        skeleton=skeleton,
        root_positions=quat.rotate(turn, clip.root_positions),
        rotations=quat.multiply(quat.multiply(turn, clip.rotations), quat.conjugate(turn)),
    ).noting(f"turned from {axis} up to Y up: the body stands along {axis} in rest and in motion")


def _axis_of_legs(clip: Clip) -> str | None:
    if not clip.skeleton.has("hip", "ankle"):
        return None
    positions = joint_positions(clip)
    hip_l, hip_r, ankle_l, ankle_r = (
        positions[:, clip.skeleton.role(f"{part}.{side}")] for part in ("hip", "ankle") for side in "LR"
    )
    up = hip_l + hip_r - ankle_l - ankle_r
    up = up / np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-9)
    along = np.quantile(np.abs(up), 0.1, axis=0)
    axis = int(np.argmax(along))
    if axis == 1 or along[axis] < _WITHIN:
        return None
    return f"{'-' if np.median(up[:, axis]) < 0 else ''}{'XYZ'[axis]}"
