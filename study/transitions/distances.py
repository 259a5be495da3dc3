"""How far two poses are apart: the weighted joint geodesic of Wang & Bodenheimer 2004, Eq. 2.

In: joint rotations `(..., joints, 4)` and weights `(joints,)`. Out: costs. The logarithm is the half angle, so a
joint that differs by a straight angle is pi/2 away. Everything here compares local rotations only: turning or
moving either figure on the floor changes nothing as long as the root weighs nothing (`joint_weights`).
"""

from __future__ import annotations

import numpy as np

from study.arrays import AnyFloat, FloatArray
from study.errors import MotionError, TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, retarget


def frame_distance(a: FloatArray, b: FloatArray, weights: FloatArray) -> FloatArray:
    """The difference of two frames (2004 Eq. 2): sums `(...)` over the joints of weight times squared half angle.

    `a` and `b (..., joints, 4)` are joint rotations, whose leading axes broadcast, `weights (joints,)` those of
    `joint_weights`.
    """
    used = np.flatnonzero(weights)
    differences = quat.half_angle_between(a[..., used, :], b[..., used, :])
    return np.asarray((differences**2) @ weights[used])


def half_angle_squares(dots: AnyFloat) -> AnyFloat:
    """Squared half angles, of any shape, from the dot products of unit quaternions; overwrites what it is given.

    Notes
    -----
    The arccosine loses half of the digits at small angles, but its square is smooth there, so the result is good
    to about 1e-15 absolute, whatever its size. `frame_distance`, from the chord, keeps the digits of the smallest
    angles as well.
    """
    np.abs(dots, out=dots)
    np.minimum(dots, 1.0, out=dots)
    np.arccos(dots, out=dots)
    return np.asarray(np.square(dots, out=dots))


def distance_matrix(source: Clip, destination: Clip, weights: FloatArray) -> FloatArray:
    """The difference (2004 Eq. 2) of all source frames from all destination frames, `(frames, frames)`."""
    destination = on_joints_of(source, destination)
    used = np.flatnonzero(weights)
    total = np.zeros((source.frames, destination.frames))
    for joint in used:
        total += weights[joint] * half_angle_squares(source.rotations[:, joint] @ destination.rotations[:, joint].T)
    return total


def on_joints_of(source: Clip, destination: Clip) -> Clip:
    """The destination with the source's joints in their order: itself where it has them, else retargeted.

    Raises
    ------
    TransitionError
        Where the clips are on different rigs (`study.motion.clip.retarget` says what may differ) or at different rates.
    """
    if not np.isclose(source.fps, destination.fps, rtol=1e-9):
        raise TransitionError(
            f"Expected {source.name or 'the source'} and {destination.name or 'the destination'} at one frame rate, "
            f"got {source.fps:g} and {destination.fps:g} fps; resample one of them."
        )
    if source.skeleton.matches(destination.skeleton):
        return destination
    try:
        return retarget(destination, source.skeleton)
    except MotionError as error:
        raise TransitionError(str(error)) from error
