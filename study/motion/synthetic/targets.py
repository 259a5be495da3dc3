"""What a motion asks of the body at each moment, as plain numbers on a time grid, and the body that follows.

A generator fills `Targets` on a fixed grid; `pose` samples them by cubic splines at the frame times and turns them
into joint rotations: legs and, where asked, arms by two-bone inverse kinematics (so a planted foot stays planted to
the rounding), the trunk by sharing out rotations over the spine. Because the grid does not depend on the frame
rate, every second frame at 60 fps is a frame at 30 fps.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from study.arrays import FloatArray
from study.motion import quaternions as quat
from study.motion.clip import Clip
from study.motion.synthetic import body

LEFT, RIGHT = 0, 1
SIDE_NAMES = ("Left", "Right")
OUTWARD = np.array([1.0, -1.0])
"""The sign of x (to the figure's left) that points outward, for left and right."""

_X = np.array([1.0, 0.0, 0.0])
# A leg or arm this near to straight is held there: beyond, a knee angle changes infinitely fast with distance.
_STRAIGHTEST = np.radians(2.0)
_MOST_BENT = np.radians(150.0)


@dataclass(frozen=True)
class Targets:
    """A motion on the planning grid; every array has the grid points first. Metres and radians.

    Angles come as yaw (to the left), pitch (forward for the trunk, toes up for the feet) and roll (left side up),
    in the world. The side axis is left, right.
    """

    times: FloatArray
    """`(n,)` seconds; frame 0 of the clip is at 0."""
    pelvis_position: FloatArray
    """`(n, 3)` the middle between the hip joints."""
    pelvis_angles: FloatArray
    """`(n, 3)`."""
    chest_angles: FloatArray
    """`(n, 3)`."""
    head_angles: FloatArray
    """`(n, 3)`."""
    ankles: FloatArray
    """`(n, 2, 3)` positions in the world."""
    feet_angles: FloatArray
    """`(n, 2, 3)`."""
    toes: FloatArray
    """`(n, 2)` bend of the toes upward against the foot."""
    knees_out: FloatArray
    """`(n, 2)` by how much a knee points outward of the mean of pelvis and foot."""
    arms: FloatArray
    """`(n, 2, 4)` shoulder flexion, abduction and outward rotation, elbow flexion."""
    wrists: FloatArray
    """`(n, 2, 2)` pronation of the forearm from thumb-forward, flexion of the wrist."""
    collars: FloatArray
    """`(n, 2, 2)` lift and forward swing of the shoulder girdle."""
    hands: FloatArray | None = None
    """`(n, 2, 4)` or None: where the wrist is in the chest's frame from the shoulder at rest, and the angle of the
    elbow outward from straight down; it replaces `arms`."""


def sample_targets(targets: Targets, times: FloatArray) -> Targets:
    """The targets at `times (frames,)`, by cubic splines through the grid."""
    from scipy.interpolate import CubicSpline

    names = [f.name for f in fields(Targets) if f.name != "times" and getattr(targets, f.name) is not None]
    flat = [np.asarray(getattr(targets, name)).reshape(len(targets.times), -1) for name in names]
    curve = CubicSpline(targets.times, np.concatenate(flat, axis=1), bc_type="natural")
    sampled = curve(times)
    parts, start = {}, 0
    for name, columns in zip(names, flat, strict=True):
        stop = start + columns.shape[1]
        parts[name] = sampled[:, start:stop].reshape(len(times), *getattr(targets, name).shape[1:])
        start = stop
    return Targets(times=times, **parts)


def pose(targets: Targets, *, seconds: float, fps: float, name: str, history: tuple[str, ...]) -> Clip:
    """The clip of `round(seconds * fps)` frames (at least one) that follows the targets."""
    frames = max(1, round(seconds * fps))
    at = sample_targets(targets, np.arange(frames) / fps)
    rotations = np.zeros((frames, len(body.JOINTS), 4))
    rotations[..., 0] = 1.0
    pelvis = orientation(at.pelvis_angles)
    chest = orientation(at.chest_angles)
    head = orientation(at.head_angles)
    rotations[:, 0] = pelvis
    _share_out(rotations, ("Spine", "Spine1", "Chest"), quat.multiply(quat.conjugate(pelvis), chest))
    _share_out(rotations, ("Neck", "Head"), quat.multiply(quat.conjugate(chest), head))
    for side in (LEFT, RIGHT):
        _pose_leg(rotations, at, pelvis, side)
        _pose_arm(rotations, at, side)
    up = quat.rotate(pelvis, np.array([0.0, body.HIPS_ABOVE_JOINTS, 0.0]))
    return Clip(
        skeleton=body.skeleton(),
        root_positions=at.pelvis_position + up,
        rotations=quat.normalise(rotations),
        fps=fps,
        name=name,
        history=history,
        synthetic=True,
    )


def orientation(angles: FloatArray) -> FloatArray:
    """Quaternions `(..., 4)` of yaw, pitch (forward) and roll `(..., 3)`, in this order outside in."""
    return quat.from_euler("YXZ", angles)


def foot_orientation(angles: FloatArray) -> FloatArray:
    """As `orientation`, with pitch counted toes up."""
    return quat.from_euler("YXZ", angles * np.array([1.0, -1.0, 1.0]))


def bent_length(first: float, second: float, flexion: FloatArray) -> FloatArray:
    """Distance between the ends of two bones whose joint is bent by `flexion` from straight."""
    return np.sqrt(first**2 + second**2 + 2.0 * first * second * np.cos(flexion))


def bend_for(first: float, second: float, distance: FloatArray) -> FloatArray:
    """The flexion that `bent_length` inverts, held between nearly straight and fully bent."""
    cosine = (distance**2 - first**2 - second**2) / (2.0 * first * second)
    return np.clip(np.arccos(np.clip(cosine, -1.0, 1.0)), _STRAIGHTEST, _MOST_BENT)


def hip_positions(pelvis_position: FloatArray, pelvis_angles: FloatArray) -> FloatArray:
    """Both hip joints `(n, 2, 3)`."""
    across = quat.rotate(orientation(pelvis_angles), _X) * body.HIP_HALF_WIDTH
    return np.stack([pelvis_position + across, pelvis_position - across], axis=1)


def two_bones(
    toward: FloatArray, pole: FloatArray, first: float, second: float, bend_sign: float
) -> tuple[FloatArray, FloatArray]:
    """Rotation of the first bone `(n, 4)` and bend `(n,)` so that the chain, hanging along -Y at rest, spans `toward`.

    Parameters
    ----------
    toward : (n, 3)
        From the chain's start to its end, in the frame in which the rotation is wanted.
    pole : (n, 3)
        The direction to which the middle joint points, as far as it can.
    first, second
        Lengths of the bones.
    bend_sign
        +1 where the second bone turns about +X when it bends (a knee), -1 about -X (an elbow).
    """
    distance = np.linalg.norm(toward, axis=-1)
    bend = bend_for(first, second, distance)
    axis = toward / distance[:, None]
    across = np.cross(pole, axis) * bend_sign
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    inner = np.arctan2(second * np.sin(bend), first + second * np.cos(bend))
    # x across, y against the chain, z to the front: the chain's frame, then the first bone opens by `inner`.
    frame = quat.from_matrix(np.stack([across, -axis, np.cross(across, -axis)], axis=-1))
    return quat.multiply(frame, quat.from_axis_angle(_X, -bend_sign * inner)), bend


def _share_out(rotations: FloatArray, names: tuple[str, ...], whole: FloatArray) -> None:
    part = quat.exp(quat.log(whole) / len(names))
    for name in names:
        rotations[:, body.INDEX[name]] = part


def _pose_leg(rotations: FloatArray, at: Targets, pelvis: FloatArray, side: int) -> None:
    hips = hip_positions(at.pelvis_position, at.pelvis_angles)[:, side]
    # Yaws run on over whole turns, so their difference needs no wrapping; no hip turns much beyond 60 degrees.
    difference = np.tanh(at.feet_angles[:, side, 0] - at.pelvis_angles[:, 0])
    yaw = at.pelvis_angles[:, 0] + 0.5 * difference + OUTWARD[side] * at.knees_out[:, side]
    pole = np.stack([np.sin(yaw), np.zeros_like(yaw), np.cos(yaw)], axis=-1)
    thigh, bend = two_bones(at.ankles[:, side] - hips, pole, body.THIGH, body.SHANK, 1.0)
    knee = quat.from_axis_angle(_X, bend)
    foot = foot_orientation(at.feet_angles[:, side])
    name = SIDE_NAMES[side]
    rotations[:, body.INDEX[f"{name}UpLeg"]] = quat.multiply(quat.conjugate(pelvis), thigh)
    rotations[:, body.INDEX[f"{name}Leg"]] = knee
    rotations[:, body.INDEX[f"{name}Foot"]] = quat.multiply(quat.conjugate(quat.multiply(thigh, knee)), foot)
    rotations[:, body.INDEX[f"{name}ToeBase"]] = quat.from_axis_angle(_X, -at.toes[:, side])


def collar_rotation(collars: FloatArray, side: int) -> FloatArray:
    """Rotation of the shoulder girdle for its lift and forward swing `(n, 2)`."""
    lift, forward = collars.T
    return quat.from_euler("YZ", OUTWARD[side] * np.stack([-forward, lift], axis=-1))


def girdle_shift(collars: FloatArray, side: int) -> FloatArray:
    """By how much the shoulder joint moves in the chest's frame with lift and swing of its girdle, `(n, 3)`."""
    rest = np.array(body.skeleton().offsets[body.INDEX[f"{SIDE_NAMES[side]}Arm"]])
    moved: FloatArray = quat.rotate(collar_rotation(collars, side), rest) - rest
    return moved


def _pose_arm(rotations: FloatArray, at: Targets, side: int) -> None:
    name, outward = SIDE_NAMES[side], OUTWARD[side]
    collar = collar_rotation(at.collars[:, side], side)
    if at.hands is None:
        flexion, abduction, rotation, elbow = at.arms[:, side].T
        upper = quat.from_euler("XZY", np.stack([-flexion, outward * abduction, outward * rotation], axis=-1))
    else:
        upper, elbow = _reach(at.hands[:, side], at.collars[:, side], side)
    pronation, flexion = at.wrists[:, side].T
    rotations[:, body.INDEX[f"{name}Shoulder"]] = collar
    rotations[:, body.INDEX[f"{name}Arm"]] = upper
    rotations[:, body.INDEX[f"{name}ForeArm"]] = quat.multiply(
        quat.from_axis_angle(_X, -elbow), quat.yaw(-outward * pronation)
    )
    rotations[:, body.INDEX[f"{name}Hand"]] = quat.from_axis_angle(_X, -flexion)


def _reach(hand: FloatArray, collars: FloatArray, side: int) -> tuple[FloatArray, FloatArray]:
    """Upper arm rotation against the collar, and elbow bend, to bring the wrist where it is wanted."""
    to_collar = quat.conjugate(collar_rotation(collars, side))
    wanted = quat.rotate(to_collar, hand[:, :3] - girdle_shift(collars, side))
    out = hand[:, 3]
    pole = np.stack([OUTWARD[side] * np.sin(out), -np.cos(out), np.full_like(out, -0.35)], axis=-1)
    return two_bones(wanted, quat.rotate(to_collar, pole), body.UPPER_ARM, body.FOREARM, -1.0)
