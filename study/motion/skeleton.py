"""Skeleton: joints in depth-first order, rest offsets in metres, end sites, and joint roles found by name.

Roles are the same on every rig: `pelvis`, `spine`, `chest`, `neck`, `head`, and with `.L` or `.R`: `hip`, `knee`,
`ankle`, `toe`, `collar`, `shoulder`, `elbow`, `wrist`. A role that a rig does not have is missing from the mapping.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from study.errors import MotionError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SIDED_ROLES = ("hip", "knee", "ankle", "toe", "collar", "shoulder", "elbow", "wrist")
CENTRE_ROLES = ("pelvis", "spine", "chest", "neck", "head")
ROLES = CENTRE_ROLES + tuple(f"{role}.{side}" for role in SIDED_ROLES for side in "LR")

# Names of the joint at the *start* of the bone, lower case, side and rig prefix removed, digits kept.
_LEG_NAMES = {
    "hip": ("upleg", "upperleg", "thigh", "femur", "hip"),
    "knee": ("lowerleg", "lowleg", "leg", "calf", "shin", "tibia", "knee"),
    "ankle": ("foot", "ankle"),
    "toe": ("toebase", "toes", "toe", "ball"),
}
_ARM_NAMES = {
    "collar": ("collar", "clavicle", "shoulder"),
    "shoulder": ("uparm", "upperarm", "arm", "humerus", "shoulder"),
    "elbow": ("forearm", "lowerarm", "lowarm", "radius", "elbow"),
    "wrist": ("wrist", "hand"),
}


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A tree of joints, parents before children.

    Parameters
    ----------
    names
        Joint names as the file has them, unique.
    parents : (joints,)
        Index of each joint's parent; -1 for joint 0, the root, alone.
    offsets : (joints, 3)
        Rest position of each joint in its parent's frame, metres; the root's is not used in motion.
    end_parents : (ends,)
        The joints that carry an end site (a bone's tip that has no rotation of its own).
    end_offsets : (ends, 3)
        Each end site in its joint's frame, metres.
    mapping
        Joint names by role, where somebody said which joint plays it; see `find_roles`.
    """

    names: tuple[str, ...]
    parents: IntArray
    offsets: FloatArray
    end_parents: IntArray
    end_offsets: FloatArray
    mapping: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        joints = len(self.names)
        for label, kind, shape in (
            ("parents", np.int64, (joints,)),
            ("offsets", np.float64, (joints, 3)),
            ("end_parents", np.int64, (len(self.end_parents),)),
            ("end_offsets", np.float64, (len(self.end_parents), 3)),
        ):
            array = np.array(getattr(self, label), dtype=kind)
            if array.shape != shape:
                raise MotionError(f"Expected skeleton {label} of shape {shape}, got {array.shape}.")
            array.setflags(write=False)
            object.__setattr__(self, label, array)
        if len(set(self.names)) != joints:
            twice = sorted({name for name in self.names if self.names.count(name) > 1})
            raise MotionError(f"Expected unique joint names, found {', '.join(twice)} more than once.")
        if joints == 0 or self.parents[0] != -1 or np.any(self.parents[1:] < 0):
            raise MotionError("Expected joint 0 to be the only root (parent -1).")
        if np.any(self.parents >= np.arange(joints)):
            raise MotionError("Expected every parent to stand before its children.")
        if np.any(self.end_parents < 0) or np.any(self.end_parents >= joints):
            raise MotionError("Expected every end site to hang on a joint of this skeleton.")

    @property
    def joints(self) -> int:
        """Number of joints, end sites not counted."""
        return len(self.names)

    @cached_property
    def levels(self) -> tuple[tuple[IntArray, IntArray], ...]:
        """Joints by depth below the root, each level with its joints' parents: what can be computed at once."""
        depths = np.zeros(self.joints, dtype=np.int64)
        for joint in range(1, self.joints):
            depths[joint] = depths[self.parents[joint]] + 1
        levels = [np.flatnonzero(depths == depth) for depth in range(1, int(depths.max()) + 1)]
        return tuple((joints, self.parents[joints]) for joints in levels)

    @cached_property
    def roles(self) -> Mapping[str, int]:
        """Joint index by role, for the roles that this rig has; see `find_roles`."""
        return MappingProxyType(find_roles(self.names, self.parents, self.mapping))

    def role(self, name: str) -> int:
        """The joint that plays a role; `MotionError` where the rig has none."""
        if name not in self.roles:
            raise MotionError(
                f"Expected a joint for the role {name!r}; the rig has {', '.join(self.names)}. "
                f"Roles found: {', '.join(self.roles) or 'none'}. Rename the joint, or use another rig."
            )
        return self.roles[name]

    @cached_property
    def bones(self) -> IntArray:
        """Pairs `(bones, 2)` of indices into `joint_positions(..., ends=True)`: joints first, then end sites."""
        joint_bones = [(int(p), j) for j, p in enumerate(self.parents) if p >= 0]
        end_bones = [(int(p), self.joints + e) for e, p in enumerate(self.end_parents)]
        bones = np.array(joint_bones + end_bones, dtype=np.int64).reshape(-1, 2)
        bones.setflags(write=False)
        return bones

    @cached_property
    def sides(self) -> tuple[str, ...]:
        """`"left"`, `"right"` or `"centre"` for each joint, then for each end site, inherited down the tree."""
        sides: list[str] = []
        for name, parent in zip(self.names, self.parents, strict=True):
            own = split_side(name)[0]
            inherited = sides[parent] if parent >= 0 else "centre"
            sides.append({"L": "left", "R": "right"}.get(own, inherited))
        return (*sides, *(sides[p] for p in self.end_parents))

    @cached_property
    def leg_length(self) -> float:
        """Mean rest length of hip to ankle over both legs, metres."""
        lengths = [
            sum(float(np.linalg.norm(self.offsets[self.role(f"{part}.{side}")])) for part in ("knee", "ankle"))
            for side in "LR"
        ]
        return float(np.mean(lengths))

    def matches(self, other: Skeleton) -> bool:
        """Whether another skeleton has the same joints in the same tree (lengths may differ)."""
        return self.names == other.names and np.array_equal(self.parents, other.parents)


def split_side(name: str) -> tuple[str, str]:
    """A joint name as `(side, rest)`: `("L", "upleg")` for `mixamorig:LeftUpLeg`, `l_femur`, `UpLeg_L`, `lUpLeg`.

    The side is `"L"`, `"R"` or `""`; the rest is lower case, without rig prefix, separators or the side.
    """
    name = re.split(r"[:|]", name)[-1]
    name = re.sub(r"^(Bip\d*|mixamorig\d*|Character\d*)[ _]", "", name)
    patterns = (
        r"(?P<side>left|right)(?P<rest>.+)",
        r"(?P<rest>.+?)[ _.\-]?(?P<side>left|right)",
        r"(?P<side>[lr])[ _.\-](?P<rest>.+)",
        r"(?P<rest>.+)[ _.\-](?P<side>[lr])",
    )
    for pattern in patterns:
        if found := re.fullmatch(pattern, name, flags=re.IGNORECASE):
            return found["side"][0].upper(), _plain(found["rest"])
    if found := re.fullmatch(r"(?P<side>[lrLR])(?P<rest>[A-Z].*)", name):
        return found["side"].upper(), _plain(found["rest"])
    # Acclaim: lfemur, rhumerus. Only where the rest is a bone's name, so that "leg" and "ribs" stay whole.
    known = {n for names in (*_LEG_NAMES.values(), *_ARM_NAMES.values()) for n in names}
    known |= {"hipjoint", "fingers", "thumb", "toes"}
    if name[:1].lower() in ("l", "r") and _plain(name[1:]) in known:
        return name[0].upper(), _plain(name[1:])
    return "", _plain(name)


def _plain(name: str) -> str:
    return re.sub(r"[ _.\-]", "", name).lower()


def find_roles(names: Sequence[str], parents: IntArray, mapping: Mapping[str, str] | None = None) -> dict[str, int]:
    """Joint index by role, from the names and the tree; `mapping` (role -> joint name) has the last word.

    The traps: `LeftShoulder` is the collar when an arm joint hangs below it; `LHipJoint` is not the hip; the
    pelvis is the nearest common ancestor of both hips, whatever it is called; `Leg` is the knee below `UpLeg`.
    """
    sided = [split_side(name) for name in names]
    roles: dict[str, int] = {}
    for side in "LR":
        for part in (_LEG_NAMES, _ARM_NAMES):
            roles |= _limb(part, side, sided, parents)
    if "hip.L" in roles and "hip.R" in roles:
        roles["pelvis"] = _common_ancestor(roles["hip.L"], roles["hip.R"], parents)
    roles |= _trunk(roles, [rest for _, rest in sided], parents)
    roles |= _mapped(names, mapping or {})
    return {role: roles[role] for role in ROLES if role in roles}


def _mapped(names: Sequence[str], mapping: Mapping[str, str]) -> dict[str, int]:
    for role, name in mapping.items():
        if name not in names:
            near = difflib.get_close_matches(name, names, n=1)
            raise MotionError(
                f"Expected a joint of the rig for the role {role!r}, found {name!r}."
                + (f" Did you mean {near[0]!r}?" if near else f" The rig has {', '.join(names)}.")
            )
    return {role: names.index(name) for role, name in mapping.items()}


def _limb(
    part: Mapping[str, tuple[str, ...]], side: str, sided: Sequence[tuple[str, str]], parents: IntArray
) -> dict[str, int]:
    """The joints of one limb: walks up from its far end, so each name is read with the names below it known."""
    order = list(part)
    found: dict[str, int] = {}
    below: int | None = None
    for depth in range(len(order) - 1, -1, -1):
        role = order[depth]
        candidates = [
            j
            for name in part[role]
            for j, (own, rest) in enumerate(sided)
            if own == side and rest == name and j not in found.values()
        ]
        if below is not None:
            candidates = [j for j in candidates if j in _ancestors(below, parents)]
        if candidates:
            found[role] = below = candidates[0]
    return {f"{role}.{side}": joint for role, joint in found.items()}


def _trunk(roles: Mapping[str, int], names: Sequence[str], parents: IntArray) -> dict[str, int]:
    """Spine, chest, neck and head: the path from the pelvis to where the arms branch, and on to the head."""
    if "pelvis" not in roles:
        return {}
    pelvis = roles["pelvis"]
    trunk: dict[str, int] = {}
    arms = [roles.get(f"collar.{s}", roles.get(f"shoulder.{s}")) for s in "LR"]
    if arms[0] is not None and arms[1] is not None:
        chest = _common_ancestor(arms[0], arms[1], parents)
        path = [j for j in [*_ancestors(chest, parents)[::-1], chest] if pelvis in _ancestors(j, parents)]
        if path:
            trunk["chest"] = path[-1]
            trunk["spine"] = path[0]
    above = [j for j in range(len(names)) if trunk.get("chest", pelvis) in _ancestors(j, parents)]
    heads = [j for j in above if names[j] == "head"]
    if heads:
        trunk["head"] = heads[0]
    necks = [j for j in above if "neck" in names[j] and (not heads or j in _ancestors(heads[0], parents))]
    if necks:
        trunk["neck"] = necks[0]
    return trunk


def _ancestors(joint: int, parents: IntArray) -> list[int]:
    """Parents from the nearest to the root."""
    line = []
    while (joint := int(parents[joint])) >= 0:
        line.append(joint)
    return line


def _common_ancestor(a: int, b: int, parents: IntArray) -> int:
    others = {b, *_ancestors(b, parents)}
    return next(j for j in [a, *_ancestors(a, parents)] if j in others)
