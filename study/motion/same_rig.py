"""Whether two skeletons are one rig: the same body joints on the same tree, standing alike at rest.

In: two `Skeleton`s. Out: which joint is which, or a refusal in one line. Rigs may differ in the order of their joints,
in an actor's name before all names, in lengths, and in leaf joints such as fingers, twists and ends.
"""

from __future__ import annotations

import numpy as np

from study.arrays import IntArray
from study.errors import MotionError
from study.motion.joint_names import bare_names
from study.motion.skeleton import Skeleton

# The body's own joints, which no rig may lack if the other has them.
_BODY = (
    "pelvis",
    "chest",
    *(f"{part}.{side}" for part in ("hip", "knee", "ankle", "shoulder", "elbow") for side in "LR"),
)
# Bones whose directions at rest are compared, by the joint at their end.
_LIMBS = tuple(f"{part}.{side}" for part in ("knee", "ankle", "elbow", "wrist") for side in "LR")
# Rotations mean the same on two rigs while their limbs rest this near to each other.
_LARGEST_REST_RAD = np.radians(40.0)


def shared_joints(own: Skeleton, other: Skeleton, name: str) -> IntArray:
    """For each joint of the other skeleton, the joint of this one that it is, or -1 `(joints of the other,)`.

    Raises
    ------
    MotionError
        Where the skeletons are not one rig; `name` is the clip's.
    """
    if own.matches(other):
        taken = np.arange(own.joints)
    else:
        names = own.names, other.names
        if len(set(names[0]) & set(names[1])) < min(own.joints, other.joints) / 2:
            names = bare_names(own.names), bare_names(other.names)
        index = {joint: k for k, joint in enumerate(names[0])}
        taken = np.array([index.get(joint, -1) for joint in names[1]])
        if problem := _unlike(own, other, taken):
            raise _refusal(name, problem)
    if not np.array_equal(own.offsets, other.offsets) and (problem := _rest_apart(own, other, taken)):
        raise _refusal(name, problem)
    return taken


def _refusal(name: str, problem: str) -> MotionError:
    return MotionError(
        f"Expected {name} on the rig of the other clip, which may differ in lengths and in leaf joints alone; "
        f"found {problem}. Use clips of one rig."
    )


def _unlike(own: Skeleton, other: Skeleton, taken: IntArray) -> str:
    """What keeps two trees from being one rig; empty where nothing does."""
    if len(set(taken[taken >= 0].tolist())) < np.count_nonzero(taken >= 0):
        return "names that belong to several joints"
    lost = sorted(set(range(own.joints)) - set(taken.tolist()))
    if not (own.roles and other.roles):
        odd = [own.names[joint] for joint in lost] + [other.names[k] for k in np.flatnonzero(taken < 0)]
        if odd:
            return f"{odd[0]!r} in one of them only ({len(odd)} such joints), and no human body in both"
    for rig, absent in ((own, lost), (other, np.flatnonzero(taken < 0).tolist())):
        body = [rig.roles[role] for role in _BODY if role in rig.roles]
        inner = [joint for joint in absent if joint in body] + [joint for joint in absent if joint == 0]
        if inner:
            return (
                f"{rig.names[inner[0]]!r}, a joint of the body itself, in one of them only ({len(absent)} such joints)"
            )
    for joint in np.flatnonzero(taken >= 0).tolist():
        above = int(other.parents[joint])
        expected = -1 if above < 0 else int(taken[above])
        if int(own.parents[taken[joint]]) != expected or (above >= 0 and expected < 0):
            return f"{other.names[joint]!r} hanging on another joint"
    return ""


def _rest_apart(own: Skeleton, other: Skeleton, taken: IntArray) -> str:
    for role in _LIMBS:
        if role in own.roles and role in other.roles and taken[other.roles[role]] == own.roles[role]:
            a, b = own.offsets[own.roles[role]], other.offsets[other.roles[role]]
            lengths = float(np.linalg.norm(a) * np.linalg.norm(b))
            angle = float(np.arccos(np.clip(a @ b / lengths, -1.0, 1.0))) if lengths > 0.0 else 0.0
            if angle > _LARGEST_REST_RAD:
                return (
                    f"rest poses in which {other.names[other.roles[role]]!r} lies {np.degrees(angle):.0f} degrees apart"
                )
    return ""
