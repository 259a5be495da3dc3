from __future__ import annotations

import numpy as np
import pytest
from walks import make_rig

from study.errors import MotionError, TransitionError
from study.motion.skeleton import Skeleton
from study.transitions.weights import joint_weights


def test_the_root_weighs_nothing_unless_asked_for() -> None:
    skeleton = make_rig()
    weights = joint_weights(skeleton, "lee2002")
    assert weights[skeleton.role("pelvis")] == 0.0
    assert weights[skeleton.role("spine")] == 1.0
    assert weights.sum() == 9.0
    assert joint_weights(skeleton, "lee2002", with_root=True)[skeleton.role("pelvis")] == 1.0


def test_a_mapping_by_role_is_taken_as_it_is() -> None:
    skeleton = make_rig()
    weights = joint_weights(skeleton, {"wrist.L": 0.25, "head": 2.0, "hip.L": 0.0})
    assert weights[skeleton.role("wrist.L")] == 0.25
    assert weights[skeleton.role("head")] == 2.0
    assert np.count_nonzero(weights) == 2


def test_a_rig_without_a_needed_joint_is_refused_by_role() -> None:
    armless = Skeleton(
        ("Hips", "LeftUpLeg", "LeftLeg", "RightUpLeg", "RightLeg"),
        np.array([-1, 0, 1, 0, 3]),
        np.zeros((5, 3)),
        np.zeros(0, dtype=int),
        np.zeros((0, 3)),
    )
    with pytest.raises(MotionError, match=r"shoulder\.L, shoulder\.R, elbow\.L, elbow\.R|shoulder\.L"):
        joint_weights(armless)
    # A weight of zero asks for no joint.
    assert joint_weights(armless, {"hip.L": 1.0, "elbow.L": 0.0}).sum() == 1.0


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ("wang2004", "'wang2003' or 'lee2002'.*got 'wang2004'"),
        ({"thigh": 1.0}, "by role, got 'thigh'"),
        ({"hip.L": -1.0}, "zero or more for the role 'hip.L', got -1"),
        ({"hip.L": np.nan}, "zero or more"),
        ({"pelvis": 1.0}, "other than the root"),
    ],
)
def test_weights_that_make_no_sense_are_refused(weights: dict[str, float] | str, message: str) -> None:
    with pytest.raises(TransitionError, match=message):
        joint_weights(make_rig(), weights)
