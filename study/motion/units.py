"""How long a unit of a motion file is: found from the body that it describes.

BVH files don't state their unit. A leg of an adult, hip to ankle, is about 0.8 m; the units in use (metres, the
CMU database's 1/0.45 inch, inches, centimetres, millimetres) lie at least a factor of 1.7 apart, so the leg tells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from study.motion.skeleton import Skeleton

INCH = 0.0254
CMU_UNIT = INCH / 0.45

# Metres in a unit, with the name that messages give it.
UNITS = {
    1.0: "metres",
    CMU_UNIT: "1/0.45 inch, as in the CMU database",
    INCH: "inches",
    0.01: "centimetres",
    0.001: "millimetres",
}

# Shorter than this in any unit there is no body to judge by, and a logarithm could fail.
_SMALLEST = 1e-6

_LEG_M = 0.8
_BODY_M = 1.7
# From a toddler's leg to that of the tallest; outside, a unit is a guess.
_PLAUSIBLE_LEG_M = (0.3, 1.3)
_PLAUSIBLE_BODY_M = (0.7, 3.0)


@dataclass(frozen=True)
class Scale:
    """What a unit of a file is taken to be."""

    metres_per_unit: float
    """Metres in a unit of the file."""
    plausible: bool
    """Whether the body that results has a person's size."""
    by_legs: bool
    """Whether legs were found to judge by; anything else is a guess from the whole rig's size."""
    note: str
    """What was assumed and why, in words, for the clip's history."""


def find_scale(skeleton: Skeleton) -> Scale:
    """The unit in which the legs of a rig, itself in the file's unit, or else its body come out as an adult's would."""
    leg = skeleton.leg_length if skeleton.has("hip", "ankle") else 0.0
    if leg > _SMALLEST:
        size, usual, plausible, what = leg, _LEG_M, _PLAUSIBLE_LEG_M, "leg"
    else:
        size, usual, plausible, what = _extent(skeleton), _BODY_M, _PLAUSIBLE_BODY_M, "longest chain of bones"
    if size < _SMALLEST:
        return Scale(1.0, False, False, "lengths taken as metres: the rig has no length to judge by")
    scale = min(UNITS, key=lambda unit: abs(math.log(size * unit / usual)))
    metres = size * scale
    return Scale(
        scale,
        plausible[0] <= metres <= plausible[1],
        leg > 0.0,
        f"lengths taken as {UNITS[scale]} (x {scale:.6g} m): the {what} measures {size:.4g}, so {metres:.2f} m",
    )


def _extent(skeleton: Skeleton) -> float:
    """The longest way from the root along bones, twice if it is in the middle of the body: near the stature."""
    reach = np.zeros(skeleton.joints)
    for joint in range(1, skeleton.joints):
        reach[joint] = reach[skeleton.parents[joint]] + np.linalg.norm(skeleton.offsets[joint])
    return float(2.0 * reach.max())
