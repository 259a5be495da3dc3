"""Figures: what a body looks like, apart from how it moves.

In go bones, sides and the roles of points; out comes a `Figure`, a list of capsules that hang on points. The
style matters to a study: what people can tell about a motion depends on how it is drawn (Hodgins, O'Brien and
Tumblin 1998, taken up in Wang and Bodenheimer 2004), so the manifest of a study names it.

Left and right limbs differ in hue and in lightness: orange and blue out of the colour-blind-safe set of
Okabe and Ito (2008), the right side also clearly darker.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.colour import RGB, check_colour
from renderer.errors import RendererError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

STYLES = ("stick", "points", "mannequin")
SIDES = ("left", "right", "centre")

COLOURS: Mapping[str, RGB] = {"left": (230, 152, 40), "right": (0, 98, 168), "centre": (84, 86, 92)}
BACKGROUND: RGB = (222, 223, 225)
POINT_BACKGROUND: RGB = (24, 25, 28)
POINT_COLOUR: RGB = (236, 236, 232)

REFERENCE_HEIGHT_M = 1.72


@dataclass(frozen=True, eq=False)
class Figure:
    """Capsules on points: cones with round ends, each from one point towards another.

    Parameters
    ----------
    style
        One of `STYLES`, for manifests.
    points
        How many points a pose has.
    ends : (capsules, 2)
        The two points that each capsule hangs on.
    along : (capsules, 2)
        Where its ends lie between them: 0 on the first point, 1 on the second.
    beyond : (capsules, 2)
        Metres added to that along the line, so that a head has its size whatever the rig's head bone.
    radii : (capsules, 2)
        Metres, at each end.
    colours : (capsules, 3)
        8-bit RGB.
    background
        8-bit RGB.
    lit
        Whether capsules are shaded as round; else flat discs of one colour.
    """

    style: str
    points: int
    ends: IntArray
    along: FloatArray
    beyond: FloatArray
    radii: FloatArray
    colours: IntArray
    background: RGB = field(default=BACKGROUND)
    lit: bool = True

    def __post_init__(self) -> None:
        check_colour(self.background, "background colour")
        count = len(self.ends)
        for name, shape in (
            ("ends", (count, 2)),
            ("along", (count, 2)),
            ("beyond", (count, 2)),
            ("radii", (count, 2)),
            ("colours", (count, 3)),
        ):
            array = np.array(getattr(self, name), dtype=np.int64 if name in ("ends", "colours") else np.float64)
            if array.shape != shape or count == 0:
                raise RendererError(
                    f"Expected a figure's {name} of shape {shape}, at least one capsule, got {array.shape}."
                )
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if self.ends.min() < 0 or self.ends.max() >= self.points:
            raise RendererError(
                f"Expected capsules on points 0 to {self.points - 1}, got {self.ends.min()} to {self.ends.max()}."
            )
        if not (np.isfinite(self.radii).all() and (self.radii > 0).all()):
            raise RendererError("Expected capsules with radii above 0 metres.")


def place(figure: Figure, positions: FloatArray) -> FloatArray:
    """The ends of every capsule in the world: `(frames, capsules, 2, 3)` from points `(frames, points, 3)`."""
    if positions.shape[1] != figure.points:
        raise RendererError(
            f"Expected {figure.points} points a frame, as the figure was made for, got {positions.shape[1]}; "
            "bones and positions must come from one skeleton, end sites included."
        )
    first, second = positions[:, figure.ends[:, 0]], positions[:, figure.ends[:, 1]]
    way = second - first
    length = np.sqrt(way[..., 0] ** 2 + way[..., 1] ** 2 + way[..., 2] ** 2)[..., None]
    # A bone of no length points up: heads of rigs without a head bone still sit on the neck.
    unit = np.where(length > 1e-6, way / np.maximum(length, 1e-6), np.array([0.0, 1.0, 0.0]))
    placed: FloatArray = np.stack(
        [first + way * figure.along[:, e, None] + unit * figure.beyond[:, e, None] for e in (0, 1)], axis=2
    )
    return placed


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
_HEAD_REACH, _HEAD_RADII = (0.020, 0.095), (0.074, 0.092)


def make_figure(
    bones: ArrayLike,
    sides: Sequence[str],
    parts: Mapping[str, int] | None = None,
    style: str = "stick",
    height_m: float | None = None,
    colours: Mapping[str, Sequence[int]] | None = None,
    background: Sequence[int] | None = None,
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
        `"stick"`, `"points"` or `"mannequin"`.
    height_m
        The person's height, which scales thickness and head; 1.72 m where None.
    colours, background
        8-bit RGB instead of the style's own, by side.

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
    paint = {**COLOURS, **{side: check_colour(c, f"{side} colour") for side, c in (colours or {}).items()}}
    body = _Body(tree, tuple(sides), dict(parts or {}), height / REFERENCE_HEIGHT_M)
    ground = check_colour(background, "background colour") if background is not None else BACKGROUND
    return _stick(body, paint, ground)


@dataclass(frozen=True)
class _Body:
    bones: IntArray
    sides: tuple[str, ...]
    parts: dict[str, int]
    scale: float

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

    def add(
        self,
        ends: tuple[int, int],
        radii: tuple[float, float],
        colour: RGB,
        along: tuple[float, float] = (0.0, 1.0),
        beyond: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        self.ends.append(ends)
        self.along.append(along)
        self.beyond.append(beyond)
        self.radii.append(radii)
        self.colours.append(colour)

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
        )


def _stick(body: _Body, paint: Mapping[str, RGB], background: RGB) -> Figure:
    made = _Parts()
    hidden = _below(body, "head", "wrist.L", "wrist.R")
    for start, end in body.bones.tolist():
        if start in hidden:
            continue  # the head covers its bone, and a hand is one piece
        role, _ = body.role_of(start)
        first, second = _STICK_RADII.get(role, (0.032, 0.028))
        made.add((start, end), (first * body.scale, second * body.scale), paint[body.side_of(start, end)])
    for side, name in (("L", "left"), ("R", "right")):
        _add_hand(made, body, f"wrist.{side}", paint[name])
    _add_head(made, body, paint["centre"])
    return made.figure("stick", len(body.sides), background, lit=True)


def _below(body: _Body, *roles: str) -> set[int]:
    """The joints with these roles, and all that hang on them."""
    found = {body.parts[role] for role in roles if role in body.parts}
    grown = True
    while grown:
        more = {int(child) for parent, child in body.bones if int(parent) in found} - found
        found |= more
        grown = bool(more)
    return found


def _add_hand(made: _Parts, body: _Body, wrist: str, colour: RGB) -> None:
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
        first, second = _STICK_RADII["wrist"]
        made.add((body.parts[wrist], tip), (first * body.scale, second * body.scale), colour)


def _add_head(made: _Parts, body: _Body, colour: RGB) -> None:
    """An egg from chin to crown, on the line from the head's joint to the end of its bone."""
    if "head" not in body.parts:
        return
    head = body.parts["head"]
    below = [int(child) for parent, child in body.bones if parent == head]
    above = [int(parent) for parent, child in body.bones if child == head]
    reach = (_HEAD_REACH[0] * body.scale, _HEAD_REACH[1] * body.scale)
    radii = (_HEAD_RADII[0] * body.scale, _HEAD_RADII[1] * body.scale)
    if below:
        made.add((head, below[0]), radii, colour, (0.0, 0.0), reach)
    else:
        made.add((above[0] if above else head, head), radii, colour, (1.0, 1.0), reach)


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
