"""Skeletons: joint roles on the rigs that people have, sides, bones and levels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.errors import MotionError
from study.motion.joint_names import ROLES, split_side
from study.motion.readers.registry import read_clip
from study.motion.skeleton import Skeleton


def rig(*joints: str) -> Skeleton:
    """A skeleton from `"name < parent"`; the first has no parent."""
    names = tuple(joint.split(" < ")[0] for joint in joints)
    parents = [names.index(joint.split(" < ")[1]) if " < " in joint else -1 for joint in joints]
    offsets = np.tile([0.0, -0.4, 0.0], (len(names), 1))
    return Skeleton(names, np.array(parents), offsets, np.array([len(names) - 1]), np.zeros((1, 3)))


def both(*joints: str) -> list[str]:
    return [joint.replace("*", side) for side in ("Left", "Right") for joint in joints]


MIXAMO = rig(
    "mixamorig:Hips",
    "mixamorig:Spine < mixamorig:Hips",
    "mixamorig:Spine1 < mixamorig:Spine",
    "mixamorig:Neck < mixamorig:Spine1",
    "mixamorig:Head < mixamorig:Neck",
    *both(
        "mixamorig:*Shoulder < mixamorig:Spine1",
        "mixamorig:*Arm < mixamorig:*Shoulder",
        "mixamorig:*ForeArm < mixamorig:*Arm",
        "mixamorig:*Hand < mixamorig:*ForeArm",
        "mixamorig:*UpLeg < mixamorig:Hips",
        "mixamorig:*Leg < mixamorig:*UpLeg",
        "mixamorig:*Foot < mixamorig:*Leg",
        "mixamorig:*ToeBase < mixamorig:*Foot",
    ),
)


def role_names(skeleton: Skeleton) -> dict[str, str]:
    return {role: skeleton.names[joint] for role, joint in skeleton.roles.items()}


def test_the_left_shoulder_is_the_collar_where_an_arm_hangs_below_it() -> None:
    roles = role_names(MIXAMO)
    assert list(roles) == [role for role in ROLES if role in roles]
    assert len(roles) == len(ROLES)
    assert roles["collar.L"] == "mixamorig:LeftShoulder"
    assert roles["shoulder.L"] == "mixamorig:LeftArm"
    assert roles["elbow.R"] == "mixamorig:RightForeArm"
    assert roles["knee.R"] == "mixamorig:RightLeg"


def test_the_left_shoulder_is_the_shoulder_where_the_elbow_hangs_below_it() -> None:
    roles = role_names(
        rig(
            "Root",
            "Chest < Root",
            *both("*Collar < Chest", "*Shoulder < *Collar", "*Elbow < *Shoulder", "*Wrist < *Elbow"),
            *both("*Hip < Root", "*Knee < *Hip", "*Ankle < *Knee"),
        )
    )
    assert roles["shoulder.L"] == "LeftShoulder"
    assert roles["collar.R"] == "RightCollar"
    assert roles["hip.L"] == "LeftHip"
    assert "toe.L" not in roles


def test_the_pelvis_is_the_common_ancestor_of_both_hips() -> None:
    roles = role_names(
        rig(
            "Armature",
            "Anything < Armature",
            *both("*HipJoint < Anything", "*UpLeg < *HipJoint", "*Leg < *UpLeg", "*Foot < *Leg"),
        )
    )
    assert roles["pelvis"] == "Anything"
    assert roles["hip.L"] == "LeftUpLeg"


@pytest.mark.parametrize(
    ("name", "side", "rest"),
    [
        ("mixamorig:LeftUpLeg", "L", "upleg"),
        ("l_femur", "L", "femur"),
        ("UpLeg_R", "R", "upleg"),
        ("lUpLeg", "L", "upleg"),
        ("Bip01 R Thigh", "R", "thigh"),
        ("rhumerus", "R", "humerus"),
        ("LHipJoint", "L", "hipjoint"),
        ("Left Arm", "L", "arm"),
        ("leg", "", "leg"),
        ("ribs", "", "ribs"),
        ("Spine1", "", "spine1"),
    ],
)
def test_sides_are_read_off_names(name: str, side: str, rest: str) -> None:
    assert split_side(name) == (side, rest)


def test_sides_are_inherited_down_the_tree() -> None:
    skeleton = rig("Hips", "LeftHand < Hips", "Thumb < LeftHand")
    assert skeleton.sides == ("centre", "left", "left", "left")


def test_bones_count_joints_first_and_end_sites_after() -> None:
    assert rig("A", "B < A", "C < A").bones.tolist() == [[0, 1], [0, 2], [2, 3]]


def test_levels_hold_every_joint_once_with_its_parent_on_an_earlier_one() -> None:
    skeleton = rig("A", "B < A", "C < B", "D < A", "E < D")
    assert [(j.tolist(), p.tolist()) for j, p in skeleton.levels] == [([1, 3], [0, 0]), ([2, 4], [1, 3])]


def test_leg_length_is_hip_to_ankle() -> None:
    assert MIXAMO.leg_length == pytest.approx(0.8)


def test_a_missing_role_is_refused_with_what_there_is() -> None:
    with pytest.raises(MotionError, match=r"Expected a joint for the role 'hip\.L', found none: no two like chains"):
        rig("A", "B < A").role("hip.L")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"names": ("A", "A")}, "unique joint names, found A"),
        ({"parents": np.array([0, 0])}, "joint 0 to be the only root"),
        ({"parents": np.array([-1, -1])}, "joint 0 to be the only root"),
        ({"parents": np.array([-1, 1])}, "every parent before its children"),
        ({"end_parents": np.array([2])}, "every end site to hang on a joint"),
        ({"offsets": np.zeros((3, 3))}, r"skeleton offsets of shape \(2, 3\), got \(3, 3\)"),
    ],
)
def test_trees_that_are_none_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(MotionError, match=message):
        replace(rig("A", "B < A"), **change)  # type: ignore[arg-type]


@pytest.mark.mocap
@pytest.mark.parametrize(
    ("name", "hip", "shoulder", "collar", "pelvis", "missing"),
    [
        ("cmu_bvh/09_01.bvh", "LeftUpLeg", "LeftArm", "LeftShoulder", "Hips", set()),
        ("cmu/subjects/16/16_35.amc", "lfemur", "lhumerus", "lclavicle", "root", set()),
        ("bandai/dataset-1_run_active_001.bvh", "UpperLeg_L", "UpperArm_L", "Shoulder_L", "Hips", set()),
        ("perfume/perfume_A_test.bvh", "LeftHip", "LeftShoulder", "LeftCollar", "Hips", set()),
    ],
)
def test_roles_of_real_rigs(
    mocap: Path, name: str, hip: str, shoulder: str, collar: str, pelvis: str, missing: set[str]
) -> None:
    roles = role_names(read_clip(mocap / name).skeleton)
    assert set(ROLES) - set(roles) == missing
    assert (roles["hip.L"], roles["shoulder.L"], roles["collar.L"], roles["pelvis"]) == (hip, shoulder, collar, pelvis)
