"""Which joint plays which role, on any rig of a human body: by the shape of the skeleton, helped by names.

In: a skeleton, poses of it where there are frames, and a mapping by hand where there is one. Out: `Roles`. A human body
has two legs that branch off one joint, and two arms that branch off another. Every pair of like chains is tried as legs
and as arms (`study.motion.limbs`); the best two pairs together are taken, unless they are no human's
(`study.motion.body_shape`). Lengths of bones and branches of the tree decide rather than places, as rest poses may be
anything. Left and right are what the names say; else what toes, knees or the way through the room say in the poses.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType

import numpy as np

from study.arrays import FloatArray, IntArray
from study.errors import MotionError
from study.motion.body_shape import NO_TRUNK, SPOKEN, first_is_left, leg_like, trunk_length, why_no_human
from study.motion.joint_names import ROLES, SIDED_ROLES, read_names
from study.motion.limbs import ARM, LEG, Pair, Tree, fans_out, find_pairs, read_pair, unlikeness

# Upper arm and forearm together, of thigh and shank together (Winter 2009, Figure 4.1).
_ARM_TO_LEG = 0.332 / 0.491
# What speaks for a second pair being arms: that it is there; that it branches off further from the root; a head above.
_ARMS, _FURTHER, _HEAD = 2.0, 0.5, 0.5
_HEAD_JOINTS = 6


@dataclass(frozen=True, eq=False)
class Roles:
    """What was found of a human body in a skeleton."""

    joints: Mapping[str, int]
    """Joint index by role, in the order of `ROLES`."""
    missing: Mapping[str, str]
    """For each role that no joint plays, why."""
    notes: tuple[str, ...]
    """How left and right were told where names don't say it, and what contradicts the names."""
    human: bool
    """Whether the skeleton is that of a human body; without, no role is found."""

    def without_first(self, joints: int) -> Roles:
        """The same where the first joints of the skeleton, which only carry the others, are cut off."""
        kept = {role: joint - joints for role, joint in self.joints.items() if joint >= joints}
        missing = {
            **self.missing,
            **dict.fromkeys(self.joints.keys() - kept.keys(), "its joint only carries others"),
        }
        return Roles(MappingProxyType(kept), MappingProxyType(missing), self.notes, self.human)


def find_roles(
    names: Sequence[str],
    parents: IntArray,
    offsets: FloatArray,
    end_parents: IntArray,
    end_offsets: FloatArray,
    *,
    poses: FloatArray | None = None,
    mapping: Mapping[str, str] | None = None,
) -> Roles:
    """The joint of each role.

    Parameters
    ----------
    names, parents, offsets, end_parents, end_offsets
        As a `Skeleton` has them, in any unit.
    poses : (poses, points, 3)
        `joint_positions(..., ends=True)` in some frames, in order of time, in the same unit. They tell a knee from a
        twist, left from right, and people from animals where the rest pose doesn't.
    mapping
        Joint names by role (`{"hip.L": "bone_12"}`), where what is found is wrong or missing: the last word.

    Raises
    ------
    MotionError
        For a role or a joint in the mapping that doesn't exist, and for mapped joints that don't hang on each other.
    """
    tree = _tree(names, parents, offsets, end_parents, end_offsets, poses)
    mapped = _checked(tree, names, mapping or {})
    found, notes, why = _body(tree)
    found = {**found, **mapped}
    for role in [role for role in found if role not in mapped and not _in_order(tree, role, found, mapped)]:
        del found[role]
    if {"hip.L", "hip.R"} <= found.keys():
        found = {**_trunk(tree, found), **found}
        why = ""
    joints = {role: found[role] for role in ROLES if role in found}
    missing = {role: why or _why_missing(role, joints) for role in ROLES if role not in joints}
    return Roles(MappingProxyType(joints), MappingProxyType(missing), tuple(notes), not why)


def _checked(tree: Tree, names: Sequence[str], mapping: Mapping[str, str]) -> dict[str, int]:
    """Joint index by role of a mapping by hand."""
    index = {name: joint for joint, name in enumerate(names)}
    for what, words, known in (("role", mapping.keys(), ROLES), ("joint of the rig", mapping.values(), tuple(index))):
        for word in words:
            if word not in known:
                near = difflib.get_close_matches(word, known, n=1, cutoff=0.0)
                raise MotionError(
                    f"Expected a {what} in the joint mapping, found {word!r}. Did you mean {near[0]!r}?"
                    + (f" The roles are {', '.join(ROLES)}." if what == "role" else "")
                )
    mapped = {role: index[name] for role, name in mapping.items()}
    for upper, lower in _successive(mapped):
        if not tree.within(mapped[lower], mapped[upper]) or mapped[upper] == mapped[lower]:
            raise MotionError(
                f"Expected {lower} below {upper} in the joint mapping, but {mapping[lower]!r} doesn't hang on "
                f"{mapping[upper]!r}. Name other joints."
            )
    return mapped


def _successive(roles: Mapping[str, int]) -> Iterator[tuple[str, str]]:
    """Roles of one limb, each with the next one further out that is there."""
    for side in "LR":
        for parts in (SIDED_ROLES[:4], SIDED_ROLES[4:]):
            there = [f"{part}.{side}" for part in parts if f"{part}.{side}" in roles]
            yield from pairwise(there)


def _in_order(tree: Tree, role: str, found: Mapping[str, int], mapped: Mapping[str, int]) -> bool:
    """Whether a role that was found fits the mapped ones of its limb: it hangs above or below them as it should."""
    pairs = _successive({role: found[role], **mapped})
    return all(tree.within(found[b], found[a]) and found[a] != found[b] for a, b in pairs if role in (a, b))


def _tree(
    names: Sequence[str],
    parents: IntArray,
    offsets: FloatArray,
    end_parents: IntArray,
    end_offsets: FloatArray,
    poses: FloatArray | None,
) -> Tree:
    joints = len(names)
    lengths = np.linalg.norm(offsets, axis=1)
    lengths[0] = 0.0
    reach = np.zeros(joints)
    ends: dict[int, list[int]] = {}
    for end, parent in enumerate(end_parents.tolist()):
        reach[parent] = max(reach[parent], float(np.linalg.norm(end_offsets[end])))
        ends.setdefault(parent, []).append(joints + end)
    named = read_names(names)
    bodily = np.array([not name.beside for name in named])
    children: list[list[int]] = [[] for _ in range(joints)]
    depths = np.zeros(joints, dtype=np.int64)
    rest = np.zeros((joints + len(end_parents), 3))
    for joint, parent in enumerate(parents.tolist()):
        if parent >= 0:
            depths[joint] = depths[parent] + 1
            rest[joint] = rest[parent] + offsets[joint]
            children[parent].append(joint)
    for joint in range(joints - 1, 0, -1):
        parent = int(parents[joint])
        reach[parent] = max(reach[parent], reach[joint] + lengths[joint])
        bodily[parent] |= bodily[joint]
    rest[joints:] = rest[end_parents] + end_offsets
    for own in children:
        own.sort(key=lambda child: (-(reach[child] + lengths[child]), names[child]))
    frames = np.empty((0, len(rest), 3)) if poses is None else poses
    fixed = tuple(tuple(own) for own in children)
    return Tree(parents, fixed, lengths, reach, depths, named, bodily, rest, frames, ends)


def _body(tree: Tree) -> tuple[dict[str, int], list[str], str]:
    """Limbs by role, what is to be said of them, and why there are none."""
    chains = find_pairs(tree)
    legs, arms = ([pair for own in chains if (pair := read_pair(tree, own, parts))] for parts in (LEG, ARM))
    chosen = _best(tree, legs, arms)
    if chosen is None:
        return {}, [], "no two like chains of three joints branch off one joint, as legs do"
    leg, arm = chosen
    notes: list[str] = []
    if leg is None:
        assert arm is not None  # at least one pair was chosen
        order, told = _sides(tree, arm, None)
        notes += [told] if told else []
        return _limb_roles(tree, arm, order), notes, ""
    if why := why_no_human(tree, leg, arm, leg_like(tree, legs, leg, arm)):
        return {}, [], why
    order, told = _sides(tree, leg, None)
    notes += [told] if told else []
    found = _limb_roles(tree, leg, order)
    if arm is not None:
        across = (leg.joint(order, 0), leg.joint(1 - order, 0))
        order, told = _sides(tree, arm, across)
        notes += [told] if told else []
        found |= _limb_roles(tree, arm, order)
    return found, notes, ""


def _best(tree: Tree, legs: Sequence[Pair], arms: Sequence[Pair]) -> tuple[Pair | None, Pair | None] | None:
    """The legs and arms that fit best, together; one without the other where nothing else fits."""
    options: list[tuple[float, Pair | None, Pair | None]] = [(leg.score, leg, None) for leg in legs]
    options += [(arm.score - 1.0, None, arm) for arm in arms if arm.spoken >= SPOKEN]
    for leg in legs:
        for arm in arms:
            if not _clash(tree, leg, arm):
                options.append((leg.score + arm.score + _together(tree, leg, arm), leg, arm))
    return max(options, key=lambda option: option[0])[1:] if options else None


def _clash(tree: Tree, leg: Pair, arm: Pair) -> bool:
    """Whether one pair hangs on a limb of the other, or both are the same chains."""
    return any(
        tree.within(one.at, chain[0]) or {chain[0]} & {other[0] for other in one.chains}
        for one, two in ((leg, arm), (arm, leg))
        for chain in two.chains
    )


def _together(tree: Tree, leg: Pair, arm: Pair) -> float:
    """What speaks for two pairs being the legs and arms of one body."""
    score = _ARMS - float(unlikeness(arm.length, leg.length * _ARM_TO_LEG))
    meet = tree.meet(leg.at, arm.at)
    if trunk_length(tree, leg, arm) < NO_TRUNK * leg.length:
        score -= _ARMS
    if meet != arm.at:
        score += _FURTHER
    elif meet != leg.at:
        score -= _FURTHER
    taken = {chain[0] for chain in arm.chains}
    if any(tree.bodily[c] and c not in taken and not tree.within(leg.at, c) for c in tree.children[arm.at]):
        score += _HEAD
    return score


def _sides(tree: Tree, pair: Pair, hips: tuple[int, int] | None) -> tuple[int, str]:
    """Which limb of a pair is the left one, and a note where the names don't say it, or say what the shape denies."""
    says = [sum({"L": 1, "R": -1}.get(tree.named[joint].side, 0) for joint in chain) for chain in pair.chains]
    by_name = int(np.sign(says[0] - says[1])) if says[0] * says[1] <= 0 else 0
    what = "arms" if pair.parts == ARM else "legs"
    if pair.parts == LEG:
        clear, told = first_is_left(tree, pair)
    elif hips is not None:
        poses = tree.poses if len(tree.poses) else tree.rest[None]
        across = poses[:, hips[0]] - poses[:, hips[1]]
        clear = float(np.mean(np.sum((poses[:, pair.joint(0, 0)] - poses[:, pair.joint(1, 0)]) * across, axis=1)))
        told = "the side of the hips"
    else:
        clear, told = 0.0, ""
    by_shape = int(np.sign(clear))
    if not by_name:
        return (0 if by_shape >= 0 else 1), f"left and right of the {what} are told by {told or 'nothing'}"
    if by_shape == -by_name and told != "the axis X alone":
        note = f"the names call those {what} left that lie on the right, told by {told}; the names are followed"
        return (0 if by_name > 0 else 1), note
    return (0 if by_name > 0 else 1), ""


def _limb_roles(tree: Tree, pair: Pair, left: int) -> dict[str, int]:
    """The roles of both limbs of a pair, with the toe or the collar where there is one."""
    found: dict[str, int] = {}
    for side, limb in (("L", left), ("R", 1 - left)):
        chain, pick = pair.chains[limb], pair.picks[limb]
        # Digits of the foot are no toe where a joint carries them all.
        fan = next((at for at in range(pick[2] + 1, len(chain)) if fans_out(tree, chain[at])), len(chain))
        found |= {f"{part}.{side}": chain[at] for part, at in zip(pair.parts, pick, strict=True) if at < len(chain)}
        extra, beyond = ("toe", chain[pick[2] + 1 : fan + 1]) if pair.parts == LEG else ("collar", chain[: pick[0]])
        beyond = tuple(joint for joint in beyond if not tree.named[joint].beside)
        if beyond:
            found[f"{extra}.{side}"] = max(beyond, key=lambda joint: tree.named[joint].speaks.get(extra, 0.0))
    return found


def _trunk(tree: Tree, roles: Mapping[str, int]) -> dict[str, int]:
    """Pelvis and chest, where the limbs branch off; the first joint of the spine between them; neck and head."""
    pelvis = roles.get("pelvis", tree.meet(roles["hip.L"], roles["hip.R"]))
    trunk = {"pelvis": pelvis}
    arms = [roles.get(f"collar.{side}", roles.get(f"shoulder.{side}")) for side in "LR"]
    chest = pelvis
    if arms[0] is not None and arms[1] is not None:
        trunk["chest"] = chest = roles.get("chest", tree.meet(arms[0], arms[1]))
        meet = tree.meet(pelvis, chest)
        way = [chest, *tree.ancestors(chest)]
        if chest != meet:
            trunk["spine"] = way[way.index(meet) - 1]
        elif pelvis != chest:
            trunk["spine"] = int(tree.parents[pelvis])
        if trunk["chest"] == pelvis:
            del trunk["chest"]
    limbs = [joint for role, joint in roles.items() if "." in role]
    line = _head_line(tree, chest, [*limbs, *trunk.values()])
    return trunk | line


def _head_line(tree: Tree, chest: int, taken: Sequence[int]) -> dict[str, int]:
    """Neck and head: the first and the last joint of what leads up from the chest, where names don't say others."""
    above = [
        branch
        for branch in tree.children[chest]
        if tree.bodily[branch] and not any(tree.within(joint, branch) for joint in taken)
    ]
    if not above:
        return {}
    below = [joint for branch in above for joint in _all_below(tree, branch)]
    heads = [joint for joint in below if "head" in tree.named[joint].speaks]
    if heads:
        line = [heads[0], *tree.ancestors(heads[0])]
        line = line[: line.index(chest)][::-1]
    else:
        line = [max(above, key=tree.length)]
        while len(line) < _HEAD_JOINTS:
            onward = [child for child in tree.children[line[-1]] if tree.bodily[child]]
            if len(onward) != 1:
                break
            line.append(onward[0])
    neck = next((joint for joint in line if "neck" in tree.named[joint].speaks), line[0])
    if neck != line[-1]:
        return {"neck": neck, "head": line[-1]}
    return {"neck": neck} if "neck" in tree.named[neck].speaks else {"head": line[-1]}


def _all_below(tree: Tree, joint: int) -> Iterator[int]:
    """A joint and all below it, each before those that hang on it."""
    waiting = [joint]
    while waiting:
        joint = waiting.pop(0)
        yield joint
        waiting += tree.children[joint]


def _why_missing(role: str, joints: Mapping[str, int]) -> str:
    part, _, side = role.partition(".")
    if part == "toe" and f"ankle.{side}" in joints:
        return "no joint hangs below the ankle"
    if part == "collar" and f"shoulder.{side}" in joints:
        return "the arm hangs on the trunk itself"
    if part in ("hip", "knee", "ankle", "toe", "pelvis"):
        return "no legs were found"
    if part in ("neck", "head"):
        return "no joint of that kind leads up from between the arms"
    if part in ("chest", "spine") and "shoulder.L" in joints:
        return "arms and legs branch off one joint"
    return "no second pair of like chains, as arms are, branches off further up"
