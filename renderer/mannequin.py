"""The mannequin: a full body on any rig with whole limbs.

Lengths between joints are the rig's own. What lies around them is in proportion to stature: breadths, depths and girths
of the body are those of people (the 1,774 men of the 1988 survey of the US Army: Gordon et al. 1989, Natick/TR-89/044),
made a little slimmer. Each limb and the trunk are put together from several capsules that are lit as one surface. The
limbs begin in the trunk's colour, as under a shirt and shorts: whether a limb is painted before or behind the trunk can
change from one frame to the next, and is then hardly seen.

Positions say neither where a head looks nor how a hand is turned: the face follows the shoulders, hands have no thumb.
"""

from __future__ import annotations

from collections.abc import Mapping

from renderer.body import Body, Parts
from renderer.capsules import Way
from renderer.colour import RGB

WHOLE = frozenset(f"{part}.{side}" for part in ("hip", "knee", "ankle", "shoulder", "elbow") for side in "LR")
"""Joints that a mannequin needs."""


def mannequin(body: Body, paint: Mapping[str, RGB]) -> Parts:
    """Trunk, head, arms and legs."""
    maker = _Maker(body, paint)
    maker.trunk()
    maker.head()
    for side, name in (("L", "left"), ("R", "right")):
        maker.arm(side, paint[name])
        maker.leg(side, paint[name])
    return maker.made


class _Maker:
    """Puts a body together. Lengths are metres on a body of the reference height, and scaled."""

    def __init__(self, body: Body, paint: Mapping[str, RGB]) -> None:
        self.body, self.paint = body, paint
        self.made = Parts(len(body.sides))
        hips, shoulders = ((body.parts[f"{part}.L"], body.parts[f"{part}.R"]) for part in ("hip", "shoulder"))
        self.low, self.high = self.made.anchor(*hips), self.made.anchor(*shoulders)
        self.up = Way(self.low, self.high)
        self.hips_left, self.left = Way(hips[1], hips[0]), Way(shoulders[1], shoulders[0])
        self.hips_forward, self.forward = Way(self.hips_left, self.up), Way(self.left, self.up)

    def at(self, *mean: int | tuple[int, float], **moved: float) -> int:
        """The mean of points, moved along directions of the body by their names."""
        scale = self.body.scale
        return self.made.anchor(*mean, moved=tuple((getattr(self, way), scale * m) for way, m in moved.items()))

    def add(self, start: int, end: int, radii: tuple[float, float], colour: RGB, **more: object) -> int:
        """A capsule between two points."""
        return self.made.add((start, end), self.body.scaled(radii), colour, **more)  # type: ignore[arg-type]

    def line(self, start: int, end: int, colour: RGB, lift: float = 0.0) -> int:
        """What the capsules of a part are lit along: a thin line within it, which nobody sees."""
        return self.add(start, end, (0.004, 0.004), colour, lift=lift)

    def chain(
        self, points: tuple[int, ...], radii: tuple[float, ...], colour: RGB, part: int, lift: float = 0.0
    ) -> None:
        """Cones from point to point, which go over into one another."""
        for i in range(len(points) - 1):
            self.add(points[i], points[i + 1], (radii[i], radii[i + 1]), colour, part=part, lift=lift)

    def trunk(self) -> None:
        """Hips, waist, chest and shoulders."""
        colour = self.paint["centre"]
        bottom = self.at(self.low, up=-0.050, hips_forward=-0.006)
        trunk = self.trunk_part = self.line(bottom, self.at(self.high, up=0.010), colour)
        for s, side in ((1.0, "L"), (-1.0, "R")):
            thigh = self.at(self.low, hips_left=0.056 * s, up=-0.052, hips_forward=-0.004)
            hip = self.at(self.low, hips_left=0.062 * s, up=0.010, hips_forward=-0.014)
            belt = self.at(self.low, hips_left=0.050 * s, up=0.080, hips_forward=-0.006)
            waist = self.at((self.low, 0.62), (self.high, 0.38), left=0.042 * s)
            chest = self.at((self.low, 0.27), (self.high, 0.73), left=0.060 * s, forward=0.006)
            shoulder = self.at(self.body.parts[f"shoulder.{side}"], left=-0.045 * s, up=-0.002)
            self.chain(
                (thigh, hip, belt, waist, chest, shoulder), (0.074, 0.102, 0.093, 0.086, 0.106, 0.060), colour, trunk
            )
            neck = self.at(self.high, left=0.018 * s, up=0.070, forward=-0.014)
            self.chain(
                (neck, self.at(self.high, left=0.070 * s, up=0.022, forward=-0.010), shoulder),
                (0.044, 0.050, 0.056),
                colour,
                trunk,
            )

    def head(self) -> None:
        """Neck, skull, face and nose."""
        body, colour = self.body, self.paint["centre"]
        if "head" not in body.parts:
            return
        joint = body.parts["head"]
        low, high = body.head_line()
        self.head_up = Way(low, high, self.up) if low != high else self.up
        self.face = Way(self.left, self.head_up)
        base = self.at(self.high, up=0.005, forward=-0.012)
        self.add(base, joint, (0.064, 0.054), colour, part=self.trunk_part)
        crown, jaw = self.at(joint, head_up=0.112, face=0.012), self.at(joint, head_up=0.034, face=0.032)
        skull = self.add(crown, jaw, (0.080, 0.056), colour, rounded=True)
        back = self.at(joint, head_up=0.106, face=-0.020)
        self.add(crown, back, (0.080, 0.080), colour, part=skull)
        self.add(jaw, self.at(joint, head_up=0.008, face=0.052), (0.054, 0.034), colour, part=skull)
        bridge, tip = self.at(joint, head_up=0.090, face=0.090), self.at(joint, head_up=0.062, face=0.100)
        self.add(bridge, tip, (0.011, 0.015), colour, rounded=True)

    def arm(self, side: str, colour: RGB) -> None:
        """Upper arm, forearm and a hand with its fingers together."""
        parts = self.body.parts
        shoulder, elbow = parts[f"shoulder.{side}"], parts[f"elbow.{side}"]
        upper = self.line(shoulder, elbow, colour, 0.04)
        middle = self.at((shoulder, 0.58), (elbow, 0.42))
        self.chain((shoulder, middle, elbow), (0.057, 0.050, 0.038), colour, upper, 0.04)
        sleeve = self.at((shoulder, 0.66), (elbow, 0.34))
        self.add(shoulder, sleeve, (0.059, 0.055), self.paint["centre"], part=upper, lift=0.04)
        wrist = parts.get(f"wrist.{side}", self.body.tip_of(elbow))
        if wrist == elbow:
            return
        fore = self.line(elbow, wrist, colour, 0.02)
        self.chain((elbow, self.at((elbow, 0.74), (wrist, 0.26)), wrist), (0.038, 0.043, 0.026), colour, fore, 0.02)
        tip = self.body.tip_of(wrist)
        self.hand = Way(wrist, tip, Way(elbow, wrist)) if tip != wrist else Way(elbow, wrist)
        knuckles, fingers = self.at(wrist, hand=0.075), self.at(wrist, hand=0.155)
        palm = self.add(wrist, knuckles, (0.027, 0.038), colour, lift=0.02)
        self.add(knuckles, fingers, (0.038, 0.021), colour, part=palm, lift=0.02)

    def leg(self, side: str, colour: RGB) -> None:
        """Thigh, shank and a foot with a heel."""
        parts = self.body.parts
        hip, knee, ankle = (parts[f"{part}.{side}"] for part in ("hip", "knee", "ankle"))
        thigh = self.line(hip, knee, colour, -0.06)
        self.chain((hip, self.at((hip, 0.60), (knee, 0.40)), knee), (0.084, 0.075, 0.053), colour, thigh, -0.06)
        shorts = self.at((hip, 0.70), (knee, 0.30))
        self.add(hip, shorts, (0.087, 0.083), self.paint["centre"], part=thigh, lift=-0.06)
        shank = self.line(knee, ankle, colour)
        calf = self.at((knee, 0.74), (ankle, 0.26), hips_forward=-0.012)
        shin = self.at((knee, 0.36), (ankle, 0.64), hips_forward=-0.004)
        self.chain((knee, calf, shin, ankle), (0.052, 0.056, 0.043, 0.036), colour, shank)
        self.down = Way(knee, ankle)
        bones = [child for parent, child in self.body.bones.tolist() if parent == ankle]
        ball = parts.get(f"toe.{side}", bones[0] if bones else self.at(ankle, hips_forward=0.125, down=0.045))
        toes = [child for parent, child in self.body.bones.tolist() if parent == ball]
        self.foot = Way(ankle, ball, self.hips_forward)
        heel = self.at(ankle, down=0.032, foot=-0.034)
        sole = self.add(heel, ball, (0.034, 0.033), colour)
        self.add(ankle, ball, (0.040, 0.030), colour, part=sole)
        self.add(ankle, heel, (0.039, 0.034), colour, part=sole)
        self.toes = Way(ball, toes[0], self.foot) if toes else self.foot
        self.add(ball, self.at(ball, toes=0.052), (0.033, 0.024), colour, part=sole)
