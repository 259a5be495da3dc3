"""Figures: what a body looks like, apart from how it moves.

Bones, sides and the roles of points come in; a `Figure` goes out, a list of capsules that hang on points. The
style matters to a study: what people can tell about a motion depends on how it is drawn (Hodgins, O'Brien and
Tumblin 1998, taken up in Wang and Bodenheimer 2004), so the manifest of a study names it.

Left and right limbs differ in hue and in lightness: orange and blue out of the colour-blind-safe set of
Okabe and Ito (2008), the right side also clearly darker.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.body import Body, Parts
from renderer.capsules import BACKGROUND, Figure
from renderer.colour import RGB, check_colour
from renderer.errors import RendererError
from renderer.mannequin import WHOLE, mannequin

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

# Radii in metres for a body of REFERENCE_HEIGHT_M, at the start and the end of the bone below a role's joint; of bones
# below none under "". The full ones are those of bodies that lack limbs; whole bodies are mannequins.
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
    "": (0.032, 0.028),
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
    "": (0.045, 0.040),
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
    body = Body(tree, tuple(sides), dict(parts or {}), height / REFERENCE_HEIGHT_M)
    styles: dict[str, tuple[Callable[[Body, Mapping[str, RGB]], Parts], Mapping[str, RGB], RGB]] = {
        "stick": (_bones, COLOURS, BACKGROUND),
        "points": (_points, dict.fromkeys(SIDES, POINT_COLOUR), POINT_BACKGROUND),
        "mannequin": (_full, {**COLOURS, "centre": MANNEQUIN_CENTRE}, BACKGROUND),
    }
    make, own, ground = styles[style]
    if unknown := sorted(set(colours or {}) - set(SIDES)):
        raise RendererError(f"Expected colours for {', '.join(SIDES)}, got {', '.join(map(repr, unknown))}.")
    paint = {**own, **{side: check_colour(c, f"{side} colour") for side, c in (colours or {}).items()}}
    if background is not None:
        ground = check_colour(background, "background colour")
    return replace(make(body, paint).figure(style, ground, lit=style != "points"), floor_m=floor_m)


def _full(body: Body, paint: Mapping[str, RGB]) -> Parts:
    """A mannequin, or full bones for a body that lacks limbs."""
    return mannequin(body, paint) if body.parts.keys() >= WHOLE else _bones(body, paint, _FULL_RADII)


def _bones(body: Body, paint: Mapping[str, RGB], thickness: Mapping[str, tuple[float, float]] = _STICK_RADII) -> Parts:
    """A capsule for each bone, one for each hand, and a head."""
    made = Parts(len(body.sides))
    hidden = body.below("head", "wrist.L", "wrist.R")
    for start, end in body.bones.tolist():
        if start in hidden:
            continue  # the head covers its bone, and a hand is one piece
        role, _ = body.role_of(start)
        radii = body.scaled(thickness.get(role, thickness[""]))
        made.add((start, end), radii, paint[body.side_of(start, end)], body.reach_to(end))
    for side, name in (("L", "left"), ("R", "right")):
        wrist = body.parts.get(f"wrist.{side}")
        # One capsule from the wrist to the tip of the longest finger: the fingers are held together.
        if wrist is not None and (tip := body.tip_of(wrist)) != wrist:
            made.add((wrist, tip), body.scaled(thickness["wrist"]), paint[name])
    if "head" in body.parts:
        # An egg from chin to crown; where the head has no bone of its own, its joint is at the end of the line.
        line, radii, reach = body.head_line(), body.scaled(_HEAD_RADII), body.scaled(_HEAD_REACH)
        share = 0.0 if line[0] == body.parts["head"] else 1.0
        made.add(line, radii, paint["centre"], (share, share), reach, rounded=True)
    return made


def _points(body: Body, paint: Mapping[str, RGB]) -> Parts:
    """Discs on the joints of Johansson's walker; on every point of a rig without roles."""
    made = Parts(len(body.sides))
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
