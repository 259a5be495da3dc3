"""The unit of a file, found from the body in it."""

from __future__ import annotations

import numpy as np
import pytest

from study.motion.units import CMU_UNIT, INCH, find_scale

NAMES = ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot")
PARENTS = np.array([-1, 0, 1, 2, 0, 4, 5])
METRES = np.array([[0, 0, 0], [0.1, 0, 0], [0, -0.42, 0], [0, -0.40, 0], [-0.1, 0, 0], [0, -0.42, 0], [0, -0.40, 0]])


@pytest.mark.parametrize("unit", [1.0, CMU_UNIT, INCH, 0.01, 0.001])
@pytest.mark.parametrize("stature", [0.75, 1.0, 1.2])
def test_the_legs_tell_the_unit(unit: float, stature: float) -> None:
    scale = find_scale(NAMES, PARENTS, METRES * stature / unit)
    assert scale.metres_per_unit == unit
    assert scale.plausible
    assert scale.by_legs
    assert "the leg measures" in scale.note


def test_a_rig_without_named_legs_is_judged_by_its_extent() -> None:
    scale = find_scale([f"joint{k}" for k in range(7)], PARENTS, METRES * 100)
    assert scale.metres_per_unit == 0.01
    assert not scale.by_legs
    assert "longest chain of bones" in scale.note


def test_bodies_of_no_human_size_are_not_plausible() -> None:
    assert not find_scale(NAMES, PARENTS, METRES * 4).plausible
    nothing = find_scale(["a"], np.array([-1]), np.zeros((1, 3)))
    assert nothing.metres_per_unit == 1.0
    assert not nothing.plausible
