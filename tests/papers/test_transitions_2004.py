"""Wang & Bodenheimer 2003 and 2004: the numbers and definitions that the transitions rest on."""

from __future__ import annotations

import numpy as np
import pytest

from study.motion import quaternions as quat
from study.motion.clip import Clip
from study.motion.skeleton import Skeleton
from study.transitions.blend_length import (
    FIXED_S,
    LONGEST_S,
    SHORTEST_S,
    default_frames,
    geodesic_length,
    joint_speed,
    major_joint_differences,
    velocity_length,
)
from study.transitions.weights import joint_weights
from study.transitions.windows import window

NAMES = ("Hips", "Spine", *(s + part for s in ("Left", "Right") for part in ("UpLeg", "Leg", "Foot")))
NAMES += tuple(s + part for s in ("Left", "Right") for part in ("Arm", "ForeArm", "Hand"))
PARENTS = (-1, 0, 0, 2, 3, 0, 5, 6, 1, 8, 9, 1, 11, 12)
NO_ENDS = (np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
RIG = Skeleton(NAMES, np.array(PARENTS), np.full((14, 3), 0.1), *NO_ENDS)


def test_2003_table_1() -> None:
    weights = joint_weights(RIG, "wang2003")
    expected = {"hip": 1.0000, "knee": 0.0901, "shoulder": 0.7884, "elbow": 0.0247}
    for part, weight in expected.items():
        for side in "LR":
            assert weights[RIG.role(f"{part}.{side}")] == weight
    assert np.count_nonzero(weights) == 8


def test_2003_section_3_original_weights() -> None:
    weights = joint_weights(RIG, "lee2002", with_root=True)
    ones = {f"{part}.{side}" for part in ("shoulder", "elbow", "hip", "knee") for side in "LR"} | {"pelvis", "spine"}
    assert {role for role, joint in RIG.roles.items() if weights[joint] == 1.0 and role in ones} == ones
    assert weights.sum() == 10


def test_2004_table_1_the_right_shoulder_has_the_largest_difference() -> None:
    table = {
        "hip.R": 0.0352,
        "knee.R": 0.0481,
        "shoulder.R": 0.3029,
        "elbow.R": 0.0167,
        "hip.L": 0.0044,
        "knee.L": 0.0288,
        "shoulder.L": 0.1192,
        "elbow.L": 0.0178,
    }
    rest = np.tile(quat.IDENTITY, (40, 14, 1))
    posed = rest.copy()
    for role, half_angle in table.items():
        posed[:, RIG.role(role)] = quat.from_axis_angle([0.0, 0.6, 0.8], 2 * half_angle)
    # The right shoulder turns at one half-angle radian a second in both clips: Eq. 4 gives 0.3029 s.
    times = (np.arange(40) - 20) / 30
    spin = quat.from_axis_angle([0.0, 0.6, 0.8], 2 * times)
    shoulder = RIG.role("shoulder.R")
    rest[:, shoulder] = spin
    posed[:, shoulder] = quat.multiply(posed[:, shoulder], spin)
    clips = [Clip(RIG, np.zeros((40, 3)), rotations, 30.0) for rotations in (rest, posed)]
    found = velocity_length(*clips, 20, 20)
    differences = major_joint_differences(*clips, 20, 20)
    assert list(differences) == list(table)
    assert differences == pytest.approx(table, rel=1e-12)
    assert found.joint == "shoulder.R"
    assert [joint_speed(clip, 20, shoulder) for clip in clips] == pytest.approx([1.0, 1.0])
    assert found.unclipped_s == pytest.approx(0.3029)
    assert found.blend_frames == 9


def test_2004_section_3_range_and_fixed_length() -> None:
    assert [default_frames(30.0, seconds) for seconds in (SHORTEST_S, FIXED_S, LONGEST_S)] == [1, 10, 60]


def test_2004_eq_2_pairs_source_i_to_i_b_1_with_destination_j_b_1_to_j() -> None:
    """`i-t-1` in print; `i+t-1` is meant, as Eqs. 5 and 6 have it (t = 1 meets frame i, t = b meets frame j)."""
    span = window(100, 200, 10)
    assert (span.source_start, span.source_stop - 1) == (100, 109)
    assert (span.destination_start, span.destination_stop - 1) == (191, 200)


def test_2004_eqs_1_and_2_by_hand() -> None:
    """One hip turned by a fixed angle from frame to frame: the cost of length b is known in closed form."""
    step = 0.02
    hip = RIG.role("hip.L")
    rotations = np.tile(quat.IDENTITY, (100, 14, 1))
    rotations[:, hip] = quat.from_axis_angle([1.0, 0.0, 0.0], step * np.arange(100))
    clip = Clip(RIG, np.zeros((100, 3)), rotations, 30.0)
    found = geodesic_length(clip, clip, 20, 60, longest=30)
    # Frame i+t-1 meets frame j-b+t: j-i-b+1 frames apart for every t, by half of the angle.
    expected = [(0.5 * step * (60 - 20 - b + 1)) ** 2 for b in range(1, 31)]
    np.testing.assert_allclose(found.costs, expected, rtol=1e-12)
    assert found.blend_frames == 30
