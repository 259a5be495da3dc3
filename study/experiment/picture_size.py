"""How large the picture of a stimulus is on a screen: `[screen]` of a protocol in, pixels and degrees out.

A visual angle `a` at the distance `d` spans `2 d tan(a / 2)` on the screen. `pages/sizes.js` computes the same in the
browser, where a participant has measured the screen against a bank card (Li, Joo, Yeatman & Reinecke 2020: Controlling
for participants' viewing distance in large-scale, psychophysical online experiments using a virtual chinrest,
Scientific Reports 10, 904).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from study.errors import SessionError
from study.experiment.protocol.stimuli import Screen


@dataclass(frozen=True)
class Sight:
    """A screen as somebody sees it: its height in pixels, pixels a centimetre, and how far away the eyes are.

    The last two are None where they are not known.
    """

    screen_px: float
    px_per_cm: float | None = None
    distance_cm: float | None = None


def wanted_px(screen: Screen, sight: Sight) -> float:
    """Height of the picture in pixels, as the protocol states it.

    Raises
    ------
    SessionError
        Where degrees are asked for and the screen's pixels a centimetre, or the distance, are not known.
    """
    if screen.height_degrees is None:
        return screen.height_share * sight.screen_px
    if sight.px_per_cm is None or sight.distance_cm is None:
        missing = "the width of the screen" if sight.px_per_cm is None else "the viewing distance"
        option = "--screen-cm" if sight.px_per_cm is None else "--distance-cm"
        raise SessionError(
            f"Expected {missing}, since the protocol shows stimuli {screen.height_degrees:g} degrees high, found none; "
            f"measure it and name it in centimetres with {option}."
        )
    half = math.radians(screen.height_degrees) / 2
    return 2.0 * sight.distance_cm * math.tan(half) * sight.px_per_cm


def seen_degrees(height_px: float, sight: Sight) -> float | None:
    """Height of the picture in degrees of visual angle; None where screen or distance are not known."""
    if sight.px_per_cm is None or sight.distance_cm is None:
        return None
    return math.degrees(2.0 * math.atan(height_px / sight.px_per_cm / 2.0 / sight.distance_cm))


def size_shown(wide_px: int, high_px: int, sight: Sight) -> dict[str, Any]:
    """How large a picture is shown, for the record (`store.variables.SIZE_SHOWN`)."""
    degrees = seen_degrees(high_px, sight)
    return {
        "width_px": wide_px,
        "height_px": high_px,
        "height_degrees": None if degrees is None else round(degrees, 3),
        "screen_height_px": sight.screen_px,
        "px_per_cm": None if sight.px_per_cm is None else round(sight.px_per_cm, 4),
        "distance_cm": sight.distance_cm,
    }
