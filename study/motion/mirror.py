"""Left-right mirroring of a clip on any rig whose limbs come in pairs.

In: a `Clip`. Out: the same motion as a mirror would show it, in the world's plane `x = 0`: a left turn becomes a
right turn, and what the left hand did the right hand does. Wang & Bodenheimer need the mirror image for nothing;
Segue uses it to balance left and right, and to complete a gait cycle of which only one step was captured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from study.arrays import FloatArray, IntArray
from study.errors import MotionError
from study.motion import quaternions as quat
from study.motion.clip import Clip
from study.motion.joint_names import split_side
from study.motion.skeleton import Skeleton

# Reflections of a joint's own axes, as signs, in the order of preference. Most rigs have x to the side everywhere; rigs
# whose axes follow the bones have it elsewhere; the last one is for bones that point along +x left and -x right.
_REFLECTIONS: FloatArray = np.array([[-1.0, 1.0, 1.0], [1.0, 1.0, -1.0], [1.0, -1.0, 1.0], [-1.0, -1.0, -1.0]])

# Two reflections fit the rest offsets equally well when they differ by less than this, as a share of the offsets.
_SAME_FIT = 0.15

_QUARTER_TURN = np.pi / 4  # as a half angle


@dataclass(frozen=True, eq=False)
class MirrorMap:
    """How a rig maps onto its mirror image."""

    partners: IntArray
    """`(joints,)`: each joint's counterpart on the other side; joints of the trunk are their own."""
    signs: FloatArray
    """`(joints, 3)`: the reflection of each joint's own axes."""
    skeleton: Skeleton
    """The mirrored body: the same names, the rest offsets of the other side reflected."""


def mirror(clip: Clip) -> Clip:
    """The clip as seen in a mirror standing in the plane `x = 0` of the world.

    Joint positions of the result are the mirror image of the clip's, with left and right exchanged. The result's
    skeleton has the same names; its rest offsets are those of the other side, so that a body with one longer leg
    has the other leg longer. On a symmetrical rig it is the same skeleton. Mirroring twice gives the clip back.

    Raises
    ------
    MotionError
        Where a joint of one side has no counterpart on the other, or hangs on another joint than its counterpart.
    """
    plan = mirror_map(clip)
    parents = clip.skeleton.parents
    above = np.vstack([_REFLECTIONS[:1], plan.signs[parents[1:]]])
    rotations = _reflected(clip.rotations[:, plan.partners], above, plan.signs)
    history = clip.history[:-1] if clip.history[-1:] == (_NOTE,) else (*clip.history, _NOTE)
    return replace(
        clip,
        skeleton=plan.skeleton,
        root_positions=clip.root_positions * _REFLECTIONS[0],
        rotations=rotations,
        history=history,
    )


_NOTE = "mirrored left to right"


def mirror_map(clip: Clip) -> MirrorMap:
    """Counterparts, axis reflections and the mirrored body of a clip's rig; see `mirror` for what is refused."""
    skeleton = clip.skeleton
    partners = find_partners(skeleton)
    signs = _axis_reflections(skeleton, partners, _mean_rotations(clip.rotations))
    above = np.vstack([_REFLECTIONS[:1], signs[skeleton.parents[1:]]])
    offsets = above * skeleton.offsets[partners]
    offsets[0] = skeleton.offsets[0]  # not used in motion
    end_partners = _end_partners(skeleton, partners)
    end_offsets = signs[skeleton.end_parents] * skeleton.end_offsets[end_partners]
    if np.array_equal(offsets, skeleton.offsets) and np.array_equal(end_offsets, skeleton.end_offsets):
        return MirrorMap(partners, signs, skeleton)
    return MirrorMap(partners, signs, replace(skeleton, offsets=offsets, end_offsets=end_offsets))


def find_partners(skeleton: Skeleton) -> IntArray:
    """Each joint's counterpart on the other side `(joints,)`; joints of the trunk are their own.

    By name, where names tell the sides; else limb by limb, the joints of each in the order of their lengths.
    """
    sides = [split_side(name) for name in skeleton.names]
    index = {side: joint for joint, side in enumerate(sides) if side[0]}
    partners = np.arange(skeleton.joints)
    for (side, rest), joint in index.items():
        other = index.get(("R" if side == "L" else "L", rest))
        if other is None:
            raise MotionError(
                f"Expected joints in pairs of left and right to mirror them; {skeleton.names[joint]!r} has no "
                "counterpart on the other side. Rename the joint, or leave the clip as it is."
            )
        partners[joint] = other
    for part in ("hip", "shoulder"):
        if skeleton.has(part):
            left, right = (skeleton.roles[f"{part}.{side}"] for side in "LR")
            if partners[left] == left:
                _pair_limbs(skeleton, left, right, partners)
    for joint in range(1, skeleton.joints):
        parent, other = int(skeleton.parents[joint]), int(skeleton.parents[partners[joint]])
        if partners[parent] != other:
            raise MotionError(
                f"Expected {skeleton.names[joint]!r} and {skeleton.names[partners[joint]]!r} to hang on counterparts; "
                f"they hang on {skeleton.names[parent]!r} and {skeleton.names[other]!r}. The rig can't be mirrored."
            )
    return partners


def _pair_limbs(skeleton: Skeleton, left: int, right: int, partners: IntArray) -> None:
    """Make counterparts, in place, of the joints of two limbs, from where they branch off one joint."""
    parents = skeleton.parents
    while parents[left] != parents[right]:
        left, right = int(parents[left]), int(parents[right])
        if min(left, right) < 0:
            return
    lengths = np.linalg.norm(skeleton.offsets, axis=1)
    waiting = [(left, right)]
    while waiting:
        pair = waiting.pop()
        partners[list(pair)] = pair[::-1]
        own = [sorted(np.flatnonzero(parents == joint).tolist(), key=lambda c: lengths[c]) for joint in pair]
        if len(own[0]) != len(own[1]):
            raise MotionError(
                f"Expected as many joints below {skeleton.names[pair[0]]!r} as below {skeleton.names[pair[1]]!r} to "
                f"mirror them, found {len(own[0])} and {len(own[1])}. The rig can't be mirrored."
            )
        waiting += zip(*own, strict=True)


def _axis_reflections(skeleton: Skeleton, partners: IntArray, mean: FloatArray) -> FloatArray:
    """The reflection of each joint's own axes: where it sends what hangs on the counterpart onto what hangs on it.

    The rest offsets often leave a choice (one straight bone fits any plane through it). Then the parent's is taken,
    unless it would turn the joint's mean rotation `(joints, 4)` by more than a quarter turn: people move much the
    same on both sides, so a mirrored joint that far off means that the rig's axes follow the bones.
    """
    end_partners = _end_partners(skeleton, partners)
    signs = np.tile(_REFLECTIONS[0], (skeleton.joints, 1))
    for joint in range(skeleton.joints):
        if partners[joint] < joint:
            signs[joint] = signs[partners[joint]]
            continue
        children = np.flatnonzero(skeleton.parents == joint)
        ends = np.flatnonzero(skeleton.end_parents == joint)
        here = np.concatenate([skeleton.offsets[children], skeleton.end_offsets[ends]])
        there = np.concatenate([skeleton.offsets[partners[children]], skeleton.end_offsets[end_partners[ends]]])
        errors = np.array([float(np.linalg.norm(here - reflection * there)) for reflection in _REFLECTIONS])
        fitting = _REFLECTIONS[errors <= errors.min() + _SAME_FIT * float(np.linalg.norm(here))]
        above = _REFLECTIONS[0] if joint == 0 else signs[skeleton.parents[joint]]
        if joint == 0:
            signs[joint] = above if (fitting == above).all(axis=1).any() else fitting[0]
            continue
        turns = quat.half_angle_between(_reflected(mean[partners[joint]], above, fitting), mean[joint])
        kept = (fitting == above).all(axis=1) & (turns <= _QUARTER_TURN)
        signs[joint] = above if kept.any() else fitting[int(np.argmin(turns))]
    return signs


def _mean_rotations(rotations: FloatArray) -> FloatArray:
    """Each joint's mean rotation over the frames `(joints, 4)`: the main axis of its quaternions."""
    moments = np.einsum("fji,fjk->jik", rotations, rotations)
    return np.asarray(np.linalg.eigh(moments)[1][..., -1])


def _end_partners(skeleton: Skeleton, partners: IntArray) -> IntArray:
    """Each end site's counterpart: the end sites of a joint match those of its counterpart in their order."""
    ends: dict[int, list[int]] = {}
    for joint, group in groupby(np.argsort(skeleton.end_parents, kind="stable"), lambda e: skeleton.end_parents[e]):
        ends[int(joint)] = [int(e) for e in group]
    result = np.arange(len(skeleton.end_parents))
    for joint, own in ends.items():
        other: Sequence[int] = ends.get(int(partners[joint]), ())
        if len(other) != len(own):
            raise MotionError(
                f"Expected as many end sites on {skeleton.names[partners[joint]]!r} as on its counterpart "
                f"{skeleton.names[joint]!r} ({len(own)}), found {len(other)}. The rig can't be mirrored."
            )
        result[own] = other
    return result


def _reflected(q: FloatArray, above: FloatArray, own: FloatArray) -> FloatArray:
    """`A q B` for reflections `A` above and `B` of the joint itself, given as signs `(joints, 3)`.

    `A R A` turns the axis of R into minus its image; what is left, `A B`, is a turn of 0 or 180 degrees about one
    of the axes, which multiplies from the right.
    """
    determinant = np.prod(above, axis=-1, keepdims=True)
    image = np.concatenate([q[..., :1], determinant * above * q[..., 1:]], axis=-1)
    between = above * own
    half_turn = np.zeros((*between.shape[:-1], 4))
    same = (between == 1.0).all(axis=-1)
    half_turn[..., 0] = same
    half_turn[..., 1:] = np.where(same[..., None], 0.0, (between == 1.0))
    return quat.multiply(image, half_turn)
