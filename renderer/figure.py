"""Figures: what a body looks like, apart from how it moves.

Bones, sides and the roles of points come in; a `Figure` goes out, a list of capsules that hang on points. The
style matters to a study: what people can tell about a motion depends on how it is drawn (Hodgins, O'Brien and
Tumblin 1998, taken up in Wang and Bodenheimer 2004), so the manifest of a study names it.

Left and right limbs differ in hue and in lightness: orange and blue out of the colour-blind-safe set of
Okabe and Ito (2008), the right side also clearly darker.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.capsules import BACKGROUND, Figure
from renderer.colour import RGB, check_colour
from renderer.errors import RendererError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

__all__ = ["BACKGROUND", "COLOURS", "POINT_BACKGROUND", "POINT_COLOUR", "STYLES", "Figure", "make_figure"]

STYLES = ("stick", "points", "mannequin")
SIDES = ("left", "right", "centre")

COLOURS: Mapping[str, RGB] = {"left": (230, 152, 40), "right": (0, 98, 168), "centre": (84, 86, 92)}
POINT_BACKGROUND: RGB = (24, 25, 28)
POINT_COLOUR: RGB = (236, 236, 232)
MANNEQUIN_CENTRE: RGB = (134, 136, 142)

REFERENCE_HEIGHT_M = 1.72

# Radii in metres for a body of REFERENCE_HEIGHT_M, at the start and the end of the bone below a role's joint.
_STICK_RADII = {
    "hip": (0.044, 0.036),
    "knee": (0.036, 0.028),
    "ankle": (0.030, 0.028),
    "toe": (0.028, 0.022),
    "collar": (0.036, 0.036),
    "shoulder": (0.034, 0.029),
    "elbow": (0.029, 0.023),
    "wrist": (0.024, 0.018),
    "pelvis": (0.044, 0.044),
    "spine": (0.044, 0.044),
    "chest": (0.044, 0.038),
    "neck": (0.032, 0.032),
    "head": (0.032, 0.032),
}
_FULL_RADII = {
    "hip": (0.084, 0.056),
    "knee": (0.054, 0.036),
    "ankle": (0.040, 0.036),
    "toe": (0.036, 0.026),
    "collar": (0.052, 0.054),
    "shoulder": (0.056, 0.042),
    "elbow": (0.042, 0.028),
    "wrist": (0.034, 0.022),
    "pelvis": (0.085, 0.085),
    "spine": (0.095, 0.100),
    "chest": (0.090, 0.050),
    "neck": (0.048, 0.048),
}
_POINT_ROLES = tuple(
    f"{part}.{side}" for part in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle") for side in "LR"
)
_POINT_RADIUS = 0.030
_HEAD_REACH, _HEAD_RADII = (0.020, 0.095), (0.074, 0.092)


def make_figure(
    bones: ArrayLike,
    sides: Sequence[str],
    parts: Mapping[str, int] | None = None,
    style: str = "stick",
    height_m: float | None = None,
    colours: Mapping[str, Sequence[int]] | None = None,
    background: Sequence[int] | None = None,
    floor_m: float | None = None,
) -> Figure:
    """A figure for any skeleton.

    Parameters
    ----------
    bones : (bones, 2)
        Pairs of points, parent first, each point the child of one bone at most.
    sides
        `"left"`, `"right"` or `"centre"` for every point.
    parts
        Points by role (`hip.L`, `knee.R`, `ankle.L`, `toe.R`, `collar.L`, `shoulder.R`, `elbow.L`, `wrist.R`,
        `pelvis`, `spine`, `chest`, `neck`, `head`): a bone is as thick as the role of the joint that it hangs on.
        Without them all bones are alike, and there is no head.
    style
        `"stick"`: bones as sticks and a head. `"points"`: lights on head, shoulders, elbows, wrists, hips, knees
        and ankles, as Johansson (1973) attached them. `"mannequin"`: full, tapered limbs, a trunk, feet, a head with
        a nose.
    height_m
        The person's height, which scales thickness and head; 1.72 m where None.
    colours, background
        8-bit RGB instead of the style's own, by side (`left`, `right`, `centre`).
    floor_m
        Height of a floor to draw, with the figure's shadow on it; none where None.

    Raises
    ------
    RendererError
        For bones, sides, roles or styles that are not as said.
    """
    tree = _check_bones(bones, sides, parts or {})
    if style not in STYLES:
        raise RendererError(f"Expected a style of {', '.join(STYLES)}, got {style!r}.")
    height = REFERENCE_HEIGHT_M if height_m is None else float(height_m)
    if not 0.1 <= height <= 10.0:
        raise RendererError(f"Expected a height from 0.1 to 10 metres, got {height}.")
    body = _Body(tree, tuple(sides), dict(parts or {}), height / REFERENCE_HEIGHT_M)
    make, own, ground = {
        "stick": (_stick, COLOURS, BACKGROUND),
        "points": (_points, dict.fromkeys(SIDES, POINT_COLOUR), POINT_BACKGROUND),
        "mannequin": (_mannequin, {**COLOURS, "centre": MANNEQUIN_CENTRE}, BACKGROUND),
    }[style]
    if unknown := sorted(set(colours or {}) - set(SIDES)):
        raise RendererError(f"Expected colours for {', '.join(SIDES)}, got {', '.join(map(repr, unknown))}.")
    paint = {**own, **{side: check_colour(c, f"{side} colour") for side, c in (colours or {}).items()}}
    if background is not None:
        ground = check_colour(background, "background colour")
    return replace(make(body, paint).figure(style, len(sides), ground, lit=style != "points"), floor_m=floor_m)


@dataclass(frozen=True)
class _Body:
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


@dataclass
class _Parts:
    """Capsules in the making."""

    ends: list[tuple[int, int]] = field(default_factory=list)
    along: list[tuple[float, float]] = field(default_factory=list)
    beyond: list[tuple[float, float]] = field(default_factory=list)
    radii: list[tuple[float, float]] = field(default_factory=list)
    colours: list[RGB] = field(default_factory=list)
    forward: list[tuple[float, float]] = field(default_factory=list)
    rounded: list[tuple[bool, bool]] = field(default_factory=list)
    facing: tuple[int, int, int, int] | None = None

    def add(
        self,
        ends: tuple[int, int],
        radii: tuple[float, float],
        colour: RGB,
        along: tuple[float, float] = (0.0, 1.0),
        beyond: tuple[float, float] = (0.0, 0.0),
        forward: tuple[float, float] = (0.0, 0.0),
        *,
        rounded: bool = False,
    ) -> None:
        self.ends.append(ends)
        self.along.append(along)
        self.beyond.append(beyond)
        self.radii.append(radii)
        self.colours.append(colour)
        self.forward.append(forward)
        self.rounded.append((rounded, rounded))

    def _round_ends(self) -> NDArray[np.bool_]:
        """Ends that are round by themselves, and tips where no other capsule goes on."""
        uses = Counter(point for pair in self.ends for point in set(pair))
        tips = [
            (False, uses[end] == 1 and along[1] == 1.0) for (_, end), along in zip(self.ends, self.along, strict=True)
        ]
        return np.logical_or(self.rounded, tips)

    def figure(self, style: str, points: int, background: RGB, *, lit: bool) -> Figure:
        return Figure(
            style,
            points,
            np.array(self.ends),
            np.array(self.along),
            np.array(self.beyond),
            np.array(self.radii),
            np.array(self.colours),
            background,
            lit,
            self._round_ends(),
            np.array(self.forward) if self.facing else None,
            self.facing,
        )


def _stick(body: _Body, paint: Mapping[str, RGB]) -> _Parts:
    made = _Parts()
    hidden = _below(body, "head", "wrist.L", "wrist.R")
    for start, end in body.bones.tolist():
        if start in hidden:
            continue  # the head covers its bone, and a hand is one piece
        role, _ = body.role_of(start)
        radii = body.scaled(_STICK_RADII.get(role, (0.032, 0.028)))
        made.add((start, end), radii, paint[body.side_of(start, end)], body.reach_to(end))
    for side, name in (("L", "left"), ("R", "right")):
        _add_hand(made, body, f"wrist.{side}", _STICK_RADII["wrist"], paint[name])
    _add_head(made, body, paint["centre"])
    return made


def _points(body: _Body, paint: Mapping[str, RGB]) -> _Parts:
    """Discs on the joints of Johansson's walker; on every point of a rig without roles."""
    made = _Parts()
    radius = (_POINT_RADIUS * body.scale,) * 2
    for role in _POINT_ROLES:
        if role in body.parts:
            point = body.parts[role]
            side = {"L": "left", "R": "right"}.get(role.partition(".")[2], "centre")
            made.add((point, point), radius, paint[side])
    if "head" in body.parts:
        made.add(body.head_line(), radius, paint["centre"], (0.0, 0.0), (0.075 * body.scale,) * 2)
    if not made.ends:
        for point, side in enumerate(body.sides):
            made.add((point, point), radius, paint[side])
    return made


def _mannequin(body: _Body, paint: Mapping[str, RGB]) -> _Parts:
    made = _Parts()
    hidden = _below(body, "head", "wrist.L", "wrist.R")
    for start, end in body.bones.tolist():
        if start in hidden:
            continue
        role, _ = body.role_of(start)
        radii = body.scaled(_FULL_RADII.get(role, (0.045, 0.040)))
        made.add((start, end), radii, paint[body.side_of(start, end)], body.reach_to(end))
    for side, name in (("L", "left"), ("R", "right")):
        _add_hand(made, body, f"wrist.{side}", _FULL_RADII["wrist"], paint[name])
        if {f"knee.{side}", f"ankle.{side}"} <= body.parts.keys():
            shin = (body.parts[f"knee.{side}"], body.parts[f"ankle.{side}"])
            made.add(shin, body.scaled((0.056, 0.042)), paint[name], (0.15, 0.55))
        if {f"ankle.{side}", f"toe.{side}"} <= body.parts.keys():
            foot = (body.parts[f"ankle.{side}"], body.parts[f"toe.{side}"])
            made.add(foot, body.scaled((0.040, 0.036)), paint[name], (0.0, 1.0), (-0.035 * body.scale, 0.0))
    for pair, radius in (("hip", 0.092), ("shoulder", 0.062)):
        if {f"{pair}.L", f"{pair}.R"} <= body.parts.keys():
            ends = (body.parts[f"{pair}.L"], body.parts[f"{pair}.R"])
            along = (0.10, 0.90) if pair == "hip" else (0.06, 0.94)
            made.add(ends, body.scaled((radius, radius)), paint["centre"], along)
    if {"pelvis", "chest"} <= body.parts.keys():
        made.add((body.parts["pelvis"], body.parts["chest"]), body.scaled((0.105, 0.128)), paint["centre"], (0.1, 0.85))
    _add_head(made, body, paint["centre"])
    if {"head", "shoulder.L", "shoulder.R"} <= body.parts.keys():
        low, high = body.head_line()
        if low != high:
            made.facing = (body.parts["shoulder.L"], body.parts["shoulder.R"], low, high)
            reach = (0.070 * body.scale, 0.050 * body.scale)
            made.add(
                (low, high),
                body.scaled((0.016, 0.018)),
                paint["centre"],
                _head_start(body),
                reach,
                body.scaled((0.078, 0.092)),
            )
    return made


def _below(body: _Body, *roles: str) -> set[int]:
    """The joints with these roles, and all that hang on them."""
    found = {body.parts[role] for role in roles if role in body.parts}
    grown = True
    while grown:
        more = {int(child) for parent, child in body.bones if int(parent) in found} - found
        found |= more
        grown = bool(more)
    return found


def _add_hand(made: _Parts, body: _Body, wrist: str, radii: tuple[float, float], colour: RGB) -> None:
    """One capsule from the wrist to the tip of the longest chain of bones on it: the fingers are held together."""
    if wrist not in body.parts:
        return
    children: dict[int, list[int]] = {}
    for parent, child in body.bones.tolist():
        children.setdefault(parent, []).append(child)

    def longest(point: int) -> list[int]:
        chains = [longest(child) for child in children.get(point, [])]
        return [point, *max(chains, key=len, default=[])]

    tip = longest(body.parts[wrist])[-1]
    if tip != body.parts[wrist]:
        made.add((body.parts[wrist], tip), body.scaled(radii), colour)


def _head_start(body: _Body) -> tuple[float, float]:
    """Where the head's joint lies on `head_line`: at its start, or at its end where the head has no bone of its own."""
    share = 0.0 if body.head_line()[0] == body.parts["head"] else 1.0
    return share, share


def _add_head(made: _Parts, body: _Body, colour: RGB) -> None:
    """An egg from chin to crown, on the line from the head's joint to the end of its bone."""
    if "head" in body.parts:
        radii, reach = body.scaled(_HEAD_RADII), body.scaled(_HEAD_REACH)
        made.add(body.head_line(), radii, colour, _head_start(body), reach, rounded=True)


def _check_bones(bones: ArrayLike, sides: Sequence[str], parts: Mapping[str, int]) -> IntArray:
    tree = np.asarray(bones)
    if tree.ndim != 2 or tree.shape[1] != 2 or len(tree) == 0 or not np.issubdtype(tree.dtype, np.integer):
        raise RendererError(f"Expected bones as whole numbers of shape (bones, 2), got {tree.dtype} {tree.shape}.")
    if tree.min() < 0 or tree.max() >= len(sides):
        raise RendererError(
            f"Expected bones between points 0 and {len(sides) - 1} (there are {len(sides)} sides), "
            f"got {tree.min()} to {tree.max()}."
        )
    if len(set(tree[:, 1].tolist())) != len(tree):
        raise RendererError("Expected every point to be the far end of one bone at most.")
    if wrong := sorted(set(sides) - set(SIDES)):
        raise RendererError(f"Expected sides of {', '.join(SIDES)}, got {', '.join(map(repr, wrong))}.")
    for role, point in parts.items():
        if not 0 <= point < len(sides):
            raise RendererError(f"Expected the role {role} on a point from 0 to {len(sides) - 1}, got {point}.")
    return tree.astype(np.int64)
