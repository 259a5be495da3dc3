"""Whether limbs belong to a human body, and which way it faces: judged in its rest pose and in its frames.

In: a `Tree`, and pairs of limbs in it. Out: why it is no human, or nothing; which limb of a pair is the left one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from study.arrays import FloatArray
from study.motion.limbs import Pair, Tree

# Cosine of the angle from the legs' direction to the trunk's: -1 where one stands; sitting, crawling people have -0.7.
_UPRIGHT = -0.55
_FOLDED = 0.5
# Names speak when the joints of a limb have, on average, a word that is nearly sure.
SPOKEN = 1.3
# Another pair as long as this share of the legs, with so many joints, is a pair of legs too.
_LEG_LIKE, _LEG_JOINTS = 0.7, 3
# What a body without names must measure, in leg lengths or as ratios: wider than people differ.
_LIMITS = {
    "thigh to shank": (0.65, 1.5),
    "foot to shank": (0.0, 0.6),
    "pelvis to hip": (0.0, 0.35),
    "upper arm to forearm": (0.6, 2.6),
    "arm to leg": (0.4, 1.05),
    "trunk to leg": (0.25, 1.1),
}
# A trunk shorter than this, in leg lengths, is none.
NO_TRUNK = 0.2
# Leg lengths by which toes, knees or steps must lead forward to tell the direction.
_TELLING = 0.02


def why_no_human(tree: Tree, legs: Pair, arms: Pair | None, others: Sequence[Pair]) -> str:
    """Why limbs are no human's, in words; empty where they may be."""
    if arms is not None and _lies_across(tree, legs, arms):
        return "the trunk lies across the legs, as in animals on four legs"
    if arms is None and any(name.animal for name in tree.named):
        return "it has parts that only animals have, and no arms"
    named = legs.spoken >= SPOKEN and (arms is None or arms.spoken >= SPOKEN)
    if not (named and arms is not None) and any(pair.length > _LEG_LIKE * legs.length for pair in others):
        return "it has more than two legs"
    if not named:
        for what, size in _sizes(tree, legs, arms).items():
            low, high = _LIMITS[what]
            if not low <= size <= high:
                return f"{what} measures {size:.2f}, in people {low:g} to {high:g}"
    return ""


def leg_like(tree: Tree, pairs: Sequence[Pair], legs: Pair, arms: Pair | None) -> list[Pair]:
    """Further pairs that could be legs: long chains beside those chosen, not within them or further down."""
    taken = [chain for pair in (legs, arms) if pair is not None for chain in pair.chains]
    return [
        pair
        for pair in pairs
        if min(len(chain) for chain in pair.chains) >= _LEG_JOINTS
        and not any(set(chain) & set(other) for chain in pair.chains for other in taken)
        and not any(tree.within(pair.at, other[0]) for other in taken)
    ]


def _sizes(tree: Tree, legs: Pair, arms: Pair | None) -> dict[str, float]:
    leg = max(legs.length, 1e-9)
    thigh, shank = np.maximum(legs.lengths.mean(axis=0), 1e-9)
    feet = [legs.chains[limb][legs.picks[limb][2] + 1 :][:1] for limb in (0, 1)]
    sizes = {
        "thigh to shank": thigh / shank,
        "foot to shank": float(np.mean([tree.lengths[foot[0]] if foot else 0.0 for foot in feet])) / shank,
        "pelvis to hip": np.mean([tree.way(legs.joint(limb, 0), legs.at) for limb in (0, 1)]) / leg,
    }
    if arms is not None:
        upper, fore = np.maximum(arms.lengths.mean(axis=0), 1e-9)
        sizes |= {
            "upper arm to forearm": upper / fore,
            "arm to leg": arms.length / leg,
            "trunk to leg": trunk_length(tree, legs, arms) / leg,
        }
    return {what: float(size) for what, size in sizes.items()}


def trunk_length(tree: Tree, legs: Pair, arms: Pair) -> float:
    """From where the legs branch off to where the arms do, along the bones."""
    top = tree.meet(arms.at, legs.at)
    return tree.way(arms.at, top) + tree.way(legs.at, top)


def _lies_across(tree: Tree, legs: Pair, arms: Pair) -> bool:
    """Whether neither the rest pose nor most frames show the trunk standing on the legs, and one shows it lying."""
    if trunk_length(tree, legs, arms) < NO_TRUNK * legs.length:
        return False
    seen = [_posture(tree.rest[None], legs, arms), _posture(tree.poses, legs, arms)]
    found = [float(np.median(cosines)) for cosines in seen if len(cosines)]
    # A rest pose with all bones along one axis has the trunk along the legs: that shows nothing.
    telling = [cosine for cosine in found if cosine < _FOLDED]
    return bool(telling) and min(telling) > _UPRIGHT


def _posture(poses: FloatArray, legs: Pair, arms: Pair) -> FloatArray:
    """Cosine from the direction of the legs to that of the trunk, in each pose where the legs go one way."""
    ways = [_unit(poses[:, legs.joint(limb, 2)] - poses[:, legs.joint(limb, 0)]) for limb in (0, 1)]
    down = _unit(ways[0] + ways[1])
    hips, shoulders = (0.5 * (poses[:, p.joint(0, 0)] + poses[:, p.joint(1, 0)]) for p in (legs, arms))
    cosines = np.sum(down * _unit(shoulders - hips), axis=1)
    return np.asarray(cosines[np.sum(ways[0] * ways[1], axis=1) > 0.3])


def first_is_left(tree: Tree, legs: Pair) -> tuple[float, str]:
    """How clearly the first leg is the left one (above 0) or the right one, in leg lengths, and what told it."""
    poses = tree.poses
    if _stands(tree, legs) or not len(poses):
        poses = np.concatenate([tree.rest[None], poses])
    for what, forward in (
        ("the toes", _toes(tree, legs, poses)),
        ("the knees", _knees(legs, poses)),
        ("the way through the room", _way(tree, legs)),
    ):
        sign = float(np.mean(_sided(legs, poses, forward))) / max(legs.length, 1e-9)
        if abs(sign) > _TELLING:
            return sign, what
    return float(np.mean(poses[:, legs.joint(0, 0), 0] - poses[:, legs.joint(1, 0), 0])), "the axis X alone"


def _stands(tree: Tree, legs: Pair) -> bool:
    """Whether the rest pose is that of a body: legs side by side, and feet that lead elsewhere than the legs."""
    legs_down = [_unit(tree.rest[legs.joint(limb, 2)] - tree.rest[legs.joint(limb, 0)]) for limb in (0, 1)]
    feet = [_unit(tree.rest[tip] - tree.rest[legs.joint(limb, 2)]) for limb, tip in enumerate(_tips(tree, legs))]
    bent = all(abs(float(leg @ foot)) < 0.97 for leg, foot in zip(legs_down, feet, strict=True))
    return bool(legs_down[0] @ legs_down[1] > 0.8) and bent


def _tips(tree: Tree, legs: Pair) -> list[int]:
    """The first joint of each foot that doesn't lie in the ankle, else the end of the limb."""
    feet = [chain[pick[2] + 1 :] for chain, pick in zip(legs.chains, legs.picks, strict=True)]
    return [next((j for j in foot if tree.lengths[j] > 0.0), tip) for foot, tip in zip(feet, legs.tips, strict=True)]


def _toes(tree: Tree, legs: Pair, poses: FloatArray) -> FloatArray:
    tips = _tips(tree, legs)
    return np.asarray(np.sum([poses[:, tips[limb]] - poses[:, legs.joint(limb, 2)] for limb in (0, 1)], axis=0))


def _knees(legs: Pair, poses: FloatArray) -> FloatArray:
    hip, knee, ankle = (poses[:, [legs.joint(0, part), legs.joint(1, part)]].sum(axis=1) for part in range(3))
    return np.asarray(knee - 0.5 * (hip + ankle))


def _way(tree: Tree, legs: Pair) -> FloatArray:
    if not len(tree.poses):
        return np.zeros(3)
    hips = tree.poses[[0, -1]][:, [legs.joint(0, 0), legs.joint(1, 0)]].mean(axis=1)
    return np.asarray(hips[1] - hips[0])


def _sided(legs: Pair, poses: FloatArray, forward: FloatArray) -> FloatArray:
    """How far a direction leads forward if the first leg is the left one, in each pose; below 0 if it is the right."""
    across = poses[:, legs.joint(0, 0)] - poses[:, legs.joint(1, 0)]
    hips, ankles = (poses[:, [legs.joint(0, part), legs.joint(1, part)]].sum(axis=1) for part in (0, 2))
    return np.asarray(np.sum(np.cross(_unit(hips - ankles), forward) * _unit(across), axis=1))


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))
