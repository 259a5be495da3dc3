"""Pairs of limbs in a skeleton: like chains that branch off one joint, and the three joints that matter in each.

In: a `Tree` (bones, names, poses). Out: `Pair`s, each read as legs or as arms, with a score. A limb is a chain of which
two successive parts are long and about equal (thigh and shank, upper arm and forearm); every choice of three joints
along it is weighed by that, by where fingers or toes fan out, by how much joints bend, and by what names say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from study.arrays import BoolArray, FloatArray, IntArray
from study.motion.joint_names import NamedJoint

LEG, ARM = ("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist")
# Natural logarithm of thigh to shank, upper arm to forearm (Winter 2009, Figure 4.1: 0.245 to 0.246, 0.186 to 0.146).
_RATIO = {LEG: 0.0, ARM: 0.2}

# Chains shorter than this share of the longest are fingers and faces; those with more joints than this are no limbs.
_SHORTEST_SHARE = 0.2
_LONGEST_CHAIN = 14
_MOST_BRANCHES = 12
_MOST_PAIRS = 24
# Two chains are no pair when their lengths differ by more than this factor, as a logarithm.
_UNLIKE = 0.35
# What a choice of joints loses: by a ratio that is off (its logarithm), a joint that hardly bends, bones beyond a fan
# of fingers, an end site in place of the third joint, mere bits for bones, parts that are not straight; a pair, by a
# third chain like it.
_RATIO_COST, _STIFF_COST, _FAN_COST, _TIP_COST, _UNFIT_COST = 2.0, 0.6, 1.0, 1.0, 3.0
_CROWD_COST, _BENT_COST = 1.0, 5.0
_STIFF_RAD = 0.035
# Bones within this of each other, as a logarithm, are the same on two sides.
_SAME = 0.15
_FAN_SHARE = 0.4
_WRONG_NAME, _BESIDE = -2.0, -4.0


@dataclass(frozen=True, eq=False)
class Tree:
    """A skeleton as the search for limbs sees it."""

    parents: IntArray
    """`(joints,)`: each joint's parent, -1 for the root."""
    children: tuple[tuple[int, ...], ...]
    """Each joint's children, in an order that doesn't depend on that of the file."""
    lengths: FloatArray
    """`(joints,)`: from each joint to its parent, in the file's unit."""
    reach: FloatArray
    """`(joints,)`: the longest way down from each joint, end sites included."""
    depths: IntArray
    """`(joints,)`: joints above each joint."""
    named: tuple[NamedJoint, ...]
    """What the names say."""
    bodily: BoolArray
    """`(joints,)`: whether a joint, or one below it, is more than a finger, a twist or a skirt, by the names."""
    rest: FloatArray
    """`(points, 3)`: joints and then end sites with no rotations."""
    poses: FloatArray
    """`(poses, points, 3)`: the same in some frames; none where there are no frames."""
    ends: dict[int, list[int]]
    """The end sites of each joint that has some, as points."""
    weighed: dict[tuple[int, ...], tuple[IntArray, FloatArray, FloatArray, FloatArray]] = field(default_factory=dict)
    """What was worked out for a chain: see `_weigh_bones`."""

    def length(self, joint: int) -> float:
        """From a joint's parent to the farthest tip below the joint."""
        return float(self.lengths[joint] + self.reach[joint])

    def ancestors(self, joint: int) -> list[int]:
        """Parents from the nearest to the root."""
        line = []
        while (joint := int(self.parents[joint])) >= 0:
            line.append(joint)
        return line

    def within(self, joint: int, above: int) -> bool:
        """Whether a joint is another or hangs below it."""
        while joint >= 0 and self.depths[joint] > self.depths[above]:
            joint = int(self.parents[joint])
        return joint == above

    def meet(self, a: int, b: int) -> int:
        """The nearest joint above both, or one of them."""
        while a != b:
            a, b = (int(self.parents[a]), b) if self.depths[a] >= self.depths[b] else (a, int(self.parents[b]))
        return a

    def way(self, joint: int, above: int) -> float:
        """Length along the bones from a joint up to another."""
        total = 0.0
        while joint != above:
            total += float(self.lengths[joint])
            joint = int(self.parents[joint])
        return total


@dataclass(frozen=True, eq=False)
class Pair:
    """Two chains read as legs or arms."""

    parts: tuple[str, str, str]
    """`LEG` or `ARM`."""
    at: int
    """The joint that both branch off."""
    chains: tuple[tuple[int, ...], tuple[int, ...]]
    """The joints of each, from the branch outwards."""
    picks: tuple[tuple[int, ...], tuple[int, ...]]
    """For each chain, which of its joints play the three parts; a third part one beyond the last joint is a mere tip.
    """
    tips: tuple[int, int]
    """The end site of each chain, as a point; the last joint itself where it has none."""
    score: float
    """How well they do."""
    spoken: float
    """How strongly names speak for them, a joint; 3 is sure."""
    lengths: FloatArray
    """`(2, 2)`: upper and lower part of each limb."""

    def joint(self, limb: int, part: int) -> int:
        """The joint of one limb (0 or 1) that plays a part (0 to 2), or the tip in its place."""
        return (*self.chains[limb], self.tips[limb])[self.picks[limb][part]]

    @property
    def length(self) -> float:
        """Mean length from the first part to the third."""
        return float(np.mean(self.lengths.sum(axis=1)))


def find_pairs(tree: Tree) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Like chains that branch off one joint, the longest first."""
    found: list[tuple[int, int]] = []
    longest = 0.0
    forks = [joint for joint, children in enumerate(tree.children) if len(children) > 1]
    for joint in sorted(forks, key=lambda joint: -tree.reach[joint]):
        shortest = _SHORTEST_SHARE * longest
        branches = [c for c in tree.children[joint] if tree.bodily[c] and tree.length(c) >= shortest]
        for a, b in combinations(branches[:_MOST_BRANCHES], 2):
            sides = {tree.named[a].side, tree.named[b].side}
            if unlikeness(tree.length(a), tree.length(b)) <= _UNLIKE or sides == {"L", "R"} or _begin_alike(tree, a, b):
                found.append((a, b))
                longest = max(longest, min(tree.length(a), tree.length(b)))
    found.sort(key=lambda pair: tree.length(pair[0]) + tree.length(pair[1]), reverse=True)
    return [(_chain(tree, a), _chain(tree, b)) for a, b in found[:_MOST_PAIRS]]


def _begin_alike(tree: Tree, a: int, b: int) -> bool:
    """Whether the first bones of two branches have the same lengths: what hangs on one hand may make it longer."""
    places = [_places(tree, _chain(tree, branch))[:4] for branch in (a, b)]
    count = min(len(own) for own in places)
    return bool(np.all(unlikeness(places[0][:count], places[1][:count]) < _SAME))


def _chain(tree: Tree, joint: int) -> tuple[int, ...]:
    """From a branch outwards, always the longer way; twists, fingers and what is worn are passed by."""
    chain = [joint]
    while len(chain) < _LONGEST_CHAIN:
        onward = [child for child in tree.children[chain[-1]] if tree.bodily[child]]
        if not onward:
            break
        chain.append(max(onward, key=tree.length))
    return tuple(chain)


def read_pair(tree: Tree, chains: tuple[tuple[int, ...], tuple[int, ...]], parts: tuple[str, str, str]) -> Pair | None:
    """The best reading of two chains as legs or arms; None where they are too short for any."""
    tables = [_weigh(tree, chain, parts) for chain in chains]
    if any(not len(combos) for combos, _, _ in tables):
        return None
    at = int(tree.parents[chains[0][0]])
    others = [c for c in tree.children[at][:_MOST_BRANCHES] if c not in (chains[0][0], chains[1][0])]
    crowd = any(_begin_alike(tree, other, chains[0][0]) for other in others)
    tips = (tree.ends.get(chains[0][-1], chains[0][-1:])[0], tree.ends.get(chains[1][-1], chains[1][-1:])[0])
    readings = []
    for best in _choices(tables):
        picks = (tuple(tables[0][0][best[0]].tolist()), tuple(tables[1][0][best[1]].tolist()))
        lengths = np.array(
            [np.diff(_places(tree, chain)[list(pick)]) for chain, pick in zip(chains, picks, strict=True)]
        )
        score = float(tables[0][1][best[0]] + tables[1][1][best[1]]) / 2.0
        score -= float(np.sum(unlikeness(lengths[0], lengths[1]))) + _CROWD_COST * crowd
        spoken = float(tables[0][2][best[0]] + tables[1][2][best[1]]) / 6.0
        readings.append(Pair(parts, at, chains, picks, tips, score, spoken, lengths))
    return max(readings, key=lambda pair: pair.score)


def _choices(tables: Sequence[tuple[IntArray, FloatArray, FloatArray]]) -> list[tuple[int, int]]:
    """The rows to look at in two chains' tables: the best joints at equal places; and the best of each by itself."""
    rows = [{tuple(choice): row for row, choice in enumerate(choices.tolist())} for choices, _, _ in tables]
    both = [(rows[0][choice], rows[1][choice]) for choice in rows[0] if choice in rows[1]]
    best = [max(both, key=lambda pair: tables[0][1][pair[0]] + tables[1][1][pair[1]])] if both else []
    if len(rows[0]) != len(rows[1]):
        best.append((int(np.argmax(tables[0][1])), int(np.argmax(tables[1][1]))))
    return best


def _weigh(tree: Tree, chain: tuple[int, ...], parts: tuple[str, str, str]) -> tuple[IntArray, FloatArray, FloatArray]:
    """All choices of three joints along a chain `(choices, 3)`, the score of each, and the names' part in it."""
    if chain not in tree.weighed:
        tree.weighed[chain] = _weigh_bones(tree, chain)
    combos, upper, lower, scores = tree.weighed[chain]
    names = np.array([*([_speaks(tree.named[joint], part) for part in parts] for joint in chain), [0.0, 0.0, 0.0]])
    spoken = names[combos, [0, 1, 2]].sum(axis=1)
    scores = scores - _RATIO_COST * unlikeness(upper, lower * np.exp(_RATIO[parts]))
    return combos, scores + spoken, spoken


def _weigh_bones(tree: Tree, chain: tuple[int, ...]) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """All choices of three joints along a chain, the lengths between them, and what speaks against each on any limb."""
    combos = np.array(list(combinations(range(len(chain) + 1), 3)), dtype=np.int64).reshape(-1, 3)
    places = _places(tree, chain)
    whole = places[-1] - places[0]
    upper, lower = np.diff(places[combos], axis=1).T
    scores = -np.minimum(unlikeness(upper + lower, whole), 1.0)
    # A limb's first joint lies beside the one that it branches off, not in it; its two parts are no mere bits.
    scores -= _UNFIT_COST * ((np.minimum(upper, lower) < 0.05 * whole) | (places[combos[:, 0]] <= 1e-6 * whole))
    scores -= _STIFF_COST * _stiff(tree, chain)[combos].sum(axis=1) + _TIP_COST * (combos[:, 2] == len(chain))
    bent = _bent(tree, chain, places)
    scores -= _BENT_COST * (bent[combos[:, 0], combos[:, 1]] + bent[combos[:, 1], combos[:, 2]])
    fans = np.array([*(fans_out(tree, joint) for joint in chain), False])
    within = np.concatenate([[0], np.cumsum(fans)])
    scores += _FAN_COST * (0.5 * fans[combos[:, 2]] - (within[combos[:, 2]] - within[combos[:, 0]]))
    return combos, upper, lower, scores


def _bent(tree: Tree, chain: tuple[int, ...], places: FloatArray) -> FloatArray:
    """How much nearer to each other points of a chain are than along it, as a mean share `(points, points)`.

    Nothing for a bone, or one in several pieces; much for a shank with the foot, or a collar with the upper arm.
    """
    points = [*chain, tree.ends.get(chain[-1], chain[-1:])[0]]
    poses = np.concatenate([tree.rest[None, points], tree.poses[:, points]])
    straight = np.linalg.norm(poses[:, :, None] - poses[:, None], axis=-1).mean(axis=0)
    along = np.abs(places[:, None] - places)
    bent = 1.0 - straight / np.maximum(along, 1e-12)
    if points[-1] == chain[-1]:
        bent[-1] = bent[:, -1] = 0.0
    return np.asarray(np.where(along > 0.0, np.clip(bent, 0.0, 1.0), 0.0))


def unlikeness(a: FloatArray | float, b: FloatArray | float) -> FloatArray:
    """How unlike two lengths are: the logarithm of their ratio, without its sign; 3 at most."""
    low, high = np.minimum(a, b), np.maximum(a, b)
    return np.asarray(np.log(np.maximum(high, 1e-12) / np.maximum(low, 0.05 * np.maximum(high, 1e-12))))


def _places(tree: Tree, chain: tuple[int, ...]) -> FloatArray:
    """How far along a chain its joints lie, and then its tip, from the joint that it branches off."""
    places = np.cumsum(tree.lengths[list(chain)])
    # A chain of two joints without an end site leaves the third place open; it is taken to be as far again.
    beyond = tree.reach[chain[-1]] or (tree.lengths[chain[-1]] if len(chain) == 2 else 0.0)
    return np.append(places, places[-1] + beyond)


def _speaks(name: NamedJoint, part: str) -> float:
    if name.beside:
        return _BESIDE
    if part in name.speaks:
        return name.speaks[part]
    return _WRONG_NAME if max(name.speaks.values(), default=0.0) > 1.0 else 0.0


def fans_out(tree: Tree, joint: int) -> bool:
    """Whether several chains of like length go on from a joint, as from a hand; a twist lies along its bone."""
    children = sorted(tree.children[joint], key=tree.length, reverse=True)
    if len(children) < 2:
        return False
    first, second = children[:2]
    if not tree.children[second] and second not in tree.ends:
        along = float((tree.rest[first] - tree.rest[joint]) @ (tree.rest[second] - tree.rest[joint]))
        if along >= 0.97 * float(tree.lengths[first] * tree.lengths[second]):
            return False
    return tree.length(second) > _FAN_SHARE * tree.length(first)


def _stiff(tree: Tree, chain: tuple[int, ...]) -> FloatArray:
    """For each joint of a chain, from 0 to 1, how much less than the others it bends in the poses."""
    bends = np.full(len(chain) + 1, np.nan)
    if len(tree.poses) < 2:
        return np.zeros(len(bends))
    points = [int(tree.parents[chain[0]]), *chain, *tree.ends.get(chain[-1], [])[:1]]
    for k in range(len(chain)):
        here = tree.poses[:, chain[k]]
        before, after = (_direction(tree.poses, here, side) for side in (points[k::-1], points[k + 2 :]))
        if before is not None and after is not None:
            angles = np.arccos(np.clip(np.sum(before * after, axis=1), -1.0, 1.0))
            bends[k] = float(np.ptp(angles))
    most = float(np.nanmax(bends, initial=0.0))
    if most < _STIFF_RAD:  # a pigtail that hangs, or an arm in a T-pose
        return np.full(len(bends), 0.5)
    return np.asarray(np.clip(1.0 - 2.0 * np.nan_to_num(bends, nan=most) / most, 0.0, 1.0))


def _direction(poses: FloatArray, here: FloatArray, points: Sequence[int]) -> FloatArray | None:
    """Unit vectors `(poses, 3)` to the first of some points that lies elsewhere."""
    for point in points:
        away = poses[:, point] - here
        distance = np.linalg.norm(away, axis=1, keepdims=True)
        if np.all(distance > 1e-9):
            return np.asarray(away / distance)
    return None
