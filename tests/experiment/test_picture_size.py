"""Sizes on the screen: by closed forms, and by what a protocol refuses."""

from __future__ import annotations

import math

import pytest
from toys import TOY_PROTOCOL

from study.errors import ProtocolError, SessionError
from study.experiment.picture_size import Sight, seen_degrees, wanted_px
from study.experiment.protocol.stimuli import Screen
from study.experiment.protocol.whole import parse_protocol


def test_a_share_is_one_of_the_screens_height() -> None:
    assert wanted_px(Screen(), Sight(1080)) == pytest.approx(756)
    assert wanted_px(Screen(height_share=0.5), Sight(768)) == pytest.approx(384)


def test_a_centimetre_at_57_3_centimetres_is_a_degree() -> None:
    """The rule of thumb of vision laboratories: 57.3 cm is a radian in centimetres."""
    sight = Sight(1080, px_per_cm=40.0, distance_cm=180 / math.pi)
    assert wanted_px(Screen(height_degrees=1.0, distance_cm=57.3), sight) == pytest.approx(40.0, rel=1e-4)
    assert seen_degrees(40.0, sight) == pytest.approx(1.0, rel=1e-4)


def test_ninety_degrees_are_twice_the_distance() -> None:
    sight = Sight(1080, px_per_cm=10.0, distance_cm=50.0)
    assert wanted_px(Screen(height_degrees=90.0, distance_cm=50.0), sight) == pytest.approx(1000.0)
    assert seen_degrees(1000.0, sight) == pytest.approx(90.0)


@pytest.mark.parametrize(
    ("sight", "named"),
    [(Sight(1080, None, 60.0), "the width of the screen.*--screen-cm"), (Sight(1080, 40.0), "distance.*--distance-cm")],
)
def test_degrees_without_a_measured_screen_are_refused(sight: Sight, named: str) -> None:
    with pytest.raises(SessionError, match=named):
        wanted_px(Screen(height_degrees=15.0, distance_cm=60.0), sight)
    assert seen_degrees(500.0, sight) is None


def test_degrees_without_a_distance_are_refused_in_the_protocol() -> None:
    with pytest.raises(ProtocolError, match="expected distance_cm or ask_distance with height_degrees"):
        parse_protocol(TOY_PROTOCOL + "\n[screen]\nheight_degrees = 15.0\n")
    asked = parse_protocol(TOY_PROTOCOL + '\n[screen]\nheight_degrees = 15.0\nask_distance = "typed"\n')
    assert asked.screen.ask_distance == "typed"
