"""Skeleton: joints, parents before children, rest offsets in metres, end sites, and the roles that joints play.

Roles are the same on every rig: `pelvis`, `spine`, `chest`, `neck`, `head`, and with `.L` or `.R`: `hip`, `knee`,
`ankle`, `toe`, `collar`, `shoulder`, `elbow`, `wrist`. A role that a rig does not have is missing from the mapping.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from study.arrays import FloatArray, IntArray
from study.errors import MotionError
from study.motion.joint_names import split_side
from study.motion.rigs import Roles, find_roles

MOST_JOINTS = 4000
"""Joints that a skeleton may have: several times those of a body with hands and face."""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A tree of joints, parents before children."""

    names: tuple[str, ...]
    """Joint names as the file has them, unique."""
    parents: IntArray
    """`(joints,)`: index of each joint's parent; -1 for joint 0, the root, alone."""
    offsets: FloatArray
    """`(joints, 3)`: rest position of each joint in its parent's frame, metres; the root's is not used in motion."""
    end_parents: IntArray
    """`(ends,)`: the joints that carry an end site (a bone's tip that has no rotation of its own)."""
    end_offsets: FloatArray
    """`(ends, 3)`: each end site in its joint's frame, metres."""
    known: Roles | None = None
    """Which joints play which roles, where poses or a mapping by hand told it; found from the rest pose unless given.
    """

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
            twice = sorted(name for name, times in Counter(self.names).items() if times > 1)
            raise MotionError(f"Expected unique joint names, found {', '.join(twice)} more than once.")
        if joints == 0 or self.parents[0] != -1 or np.any(self.parents[1:] < 0):
            raise MotionError("Expected joint 0 to be the only root (parent -1).")
        if np.any(self.parents >= np.arange(joints)):
            raise MotionError("Expected every parent before its children.")
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
        by_depth = np.argsort(depths, kind="stable")
        levels = np.split(by_depth, np.cumsum(np.bincount(depths))[:-1])[1:]
        return tuple((joints, self.parents[joints]) for joints in levels)

    @cached_property
    def body(self) -> Roles:
        """What is known of the roles of this rig's joints; see `study.motion.rigs.find_roles`."""
        if self.known is not None:
            return self.known
        return find_roles(self.names, self.parents, self.offsets, self.end_parents, self.end_offsets)

    @property
    def roles(self) -> Mapping[str, int]:
        """Joint index by role, for the roles that this rig has."""
        return self.body.joints

    def role(self, name: str) -> int:
        """The joint that plays a role; `MotionError` where the rig has none."""
        if name not in self.roles:
            raise MotionError(
                f"Expected a joint for the role {name!r}, found none: {self.body.missing.get(name, 'no such role')}. "
                f"Roles found: {', '.join(self.roles) or 'none'}. Map the role to a joint, or use another rig."
            )
        return self.roles[name]

    def has(self, *parts: str) -> bool:
        """Whether the rig has these roles; a part of the limbs, such as `hip`, stands for that of both sides."""
        return all(
            {part, f"{part}.L"} & self.roles.keys() and {part, f"{part}.R"} & self.roles.keys() for part in parts
        )

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
        own = [split_side(name)[0] for name in self.names]
        for role, joint in self.roles.items():
            own[joint] = own[joint] or role.partition(".")[2]
        sides: list[str] = []
        for side, parent in zip(own, self.parents, strict=True):
            inherited = sides[parent] if parent >= 0 else "centre"
            sides.append({"L": "left", "R": "right"}.get(side, inherited))
        return (*sides, *(sides[p] for p in self.end_parents))

    @cached_property
    def leg_length(self) -> float:
        """Mean rest length of hip to knee to ankle over both legs, along all bones between, metres."""
        return float(np.mean([self._way(f"hip.{side}", f"ankle.{side}") for side in "LR"]))

    def _way(self, upper: str, lower: str) -> float:
        joint, total = self.role(lower), 0.0
        while joint != self.role(upper):
            total += float(np.linalg.norm(self.offsets[joint]))
            joint = int(self.parents[joint])
        return total

    def matches(self, other: Skeleton) -> bool:
        """Whether another skeleton has the same joints in the same tree (lengths may differ)."""
        return self.names == other.names and np.array_equal(self.parents, other.parents)
