"""The unit of a file, found from the body in it."""

from __future__ import annotations

import numpy as np
import pytest

from study.motion.skeleton import Skeleton
from study.motion.units import CMU_UNIT, INCH, find_scale

NAMES = ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot")
PARENTS = np.array([-1, 0, 1, 2, 0, 4, 5])
METRES = np.array([[0, 0, 0], [0.1, 0, 0], [0, -0.42, 0], [0, -0.40, 0], [-0.1, 0, 0], [0, -0.42, 0], [0, -0.40, 0]])


def rig(offsets: np.ndarray, names: tuple[str, ...] = NAMES, parents: np.ndarray = PARENTS) -> Skeleton:
    return Skeleton(names, parents, offsets, np.zeros(0, dtype=np.int64), np.zeros((0, 3)))


@pytest.mark.parametrize("unit", [1.0, CMU_UNIT, INCH, 0.01, 0.001])
@pytest.mark.parametrize("stature", [0.75, 1.0, 1.2])
def test_the_legs_tell_the_unit(unit: float, stature: float) -> None:
    scale = find_scale(rig(METRES * stature / unit))
    assert scale.metres_per_unit == unit
    assert scale.plausible
    assert scale.by_legs
    assert "the leg measures" in scale.note


def test_legs_without_names_tell_the_unit_too() -> None:
    scale = find_scale(rig(METRES * 100, tuple(f"joint{k}" for k in range(7))))
    assert scale.metres_per_unit == 0.01
    assert scale.by_legs


def test_a_rig_without_legs_is_judged_by_its_extent() -> None:
    scale = find_scale(rig(METRES * 100, parents=np.arange(7) - 1))
    assert scale.metres_per_unit == 0.01
    assert not scale.by_legs
    assert "longest chain of bones" in scale.note


def test_bodies_of_no_human_size_are_not_plausible() -> None:
    assert not find_scale(rig(METRES * 4)).plausible
    nothing = find_scale(rig(np.zeros((1, 3)), ("a",), np.array([-1])))
    assert nothing.metres_per_unit == 1.0
    assert not nothing.plausible
