"""Bodies: what a figure is made from, bones with sides and roles, and the capsules that are put together on them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from renderer.capsules import Anchor, Figure, Way
from renderer.colour import RGB

IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Body:
    """Bones `(bones, 2)`, the side of each point, points by role, and the size against the reference body."""

    bones: IntArray
    sides: tuple[str, ...]
    parts: dict[str, int]
    scale: float

    def scaled(self, metres: tuple[float, float]) -> tuple[float, float]:
        """Two lengths of the reference body, on this one."""
        return metres[0] * self.scale, metres[1] * self.scale

    def reach_to(self, end: int) -> tuple[float, float]:
        """How much of a bone is drawn: the neck ends under the head, so that it never shows before the chin."""
        return (0.0, 0.6) if end == self.parts.get("head") else (0.0, 1.0)

    def head_line(self) -> tuple[int, int]:
        """The head's joint and the end of its bone; without one, what it hangs on and the joint."""
        head = self.parts["head"]
        below = [child for parent, child in self.bones.tolist() if parent == head]
        above = [parent for parent, child in self.bones.tolist() if child == head]
        return (head, below[0]) if below else (above[0] if above else head, head)

    def role_of(self, point: int) -> tuple[str, str]:
        """Role and side (`"knee"`, `"L"`) of the nearest joint with a role, from a point up its tree; or nothing."""
        roles = {index: role for role, index in self.parts.items()}
        parents = {int(child): int(parent) for parent, child in self.bones}
        while True:
            if point in roles:
                role, _, side = roles[point].partition(".")
                return role, side
            if point not in parents:
                return "", ""
            point = parents[point]

    def side_of(self, start: int, end: int) -> str:
        """The colour group of a bone: limbs take their side, trunk, collars and hip bones are centre."""
        if not self.parts:
            return self.sides[end] if self.sides[start] == self.sides[end] else "centre"
        role, side = self.role_of(start)
        if role in ("hip", "knee", "ankle", "toe", "shoulder", "elbow", "wrist"):
            return {"L": "left", "R": "right"}[side]
        return "centre"

    def below(self, *roles: str) -> set[int]:
        """The joints with these roles, and all that hang on them."""
        found = {self.parts[role] for role in roles if role in self.parts}
        grown = True
        while grown:
            more = {int(child) for parent, child in self.bones if int(parent) in found} - found
            found |= more
            grown = bool(more)
        return found

    def tip_of(self, point: int) -> int:
        """The end of the longest chain of bones on a point; the point itself where none hangs on it."""
        chains = [[point]]
        while longer := [
            [*chain, int(child)] for chain in chains for parent, child in self.bones if parent == chain[-1]
        ]:
            chains = longer
        return chains[0][-1]


@dataclass
class Parts:
    """Capsules in the making."""

    points: int
    ends: list[tuple[int, int]] = field(default_factory=list)
    along: list[tuple[float, float]] = field(default_factory=list)
    beyond: list[tuple[float, float]] = field(default_factory=list)
    radii: list[tuple[float, float]] = field(default_factory=list)
    colours: list[RGB] = field(default_factory=list)
    rounded: list[tuple[bool, bool]] = field(default_factory=list)
    part: list[int] = field(default_factory=list)
    lift: list[float] = field(default_factory=list)
    anchors: list[Anchor] = field(default_factory=list)

    def anchor(self, *mean: int | tuple[int, float], moved: tuple[tuple[Way, float], ...] = ()) -> int:
        """A further point: the mean of points, weighted where they come with weights, and moved; its number."""
        weighted = tuple(one if isinstance(one, tuple) else (one, 1.0 / len(mean)) for one in mean)
        self.anchors.append(Anchor(weighted, moved))
        return self.points + len(self.anchors) - 1

    def add(
        self,
        ends: tuple[int, int],
        radii: tuple[float, float],
        colour: RGB,
        along: tuple[float, float] = (0.0, 1.0),
        beyond: tuple[float, float] = (0.0, 0.0),
        *,
        rounded: bool = False,
        part: int | None = None,
        lift: float = 0.0,
    ) -> int:
        """A capsule, lit as another one where `part` names it; its number."""
        self.ends.append(ends)
        self.along.append(along)
        self.beyond.append(beyond)
        self.radii.append(radii)
        self.colours.append(colour)
        self.rounded.append((rounded, rounded))
        self.part.append(len(self.part) if part is None else part)
        self.lift.append(lift)
        return len(self.ends) - 1

    def _round_ends(self) -> NDArray[np.bool_]:
        """Ends that are round by themselves, and tips where no other capsule goes on."""
        uses = Counter(point for pair in self.ends for point in set(pair))
        tips = [
            (False, uses[end] == 1 and along[1] == 1.0) for (_, end), along in zip(self.ends, self.along, strict=True)
        ]
        return np.logical_or(self.rounded, tips)

    def figure(self, style: str, background: RGB, *, lit: bool) -> Figure:
        """The figure."""
        return Figure(
            style,
            self.points,
            np.array(self.ends),
            np.array(self.along),
            np.array(self.beyond),
            np.array(self.radii),
            np.array(self.colours),
            background,
            lit,
            self._round_ends(),
            tuple(self.anchors),
            np.array(self.part),
            np.array(self.lift),
        )
