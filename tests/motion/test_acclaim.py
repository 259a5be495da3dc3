"""ASF and AMC: each subject's own skeleton, rotations about each bone's axes, refusals with their place."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from study.errors import MotionFileError, MotionWarning
from study.motion import quaternions as quat
from study.motion.clip import global_rotations, joint_positions
from study.motion.readers.amc import read_amc
from study.motion.readers.bvh import read_bvh
from study.motion.readers.registry import with_their_parts

ASF = """# a comment
:version 1.10
:name TEST
:units
  mass 1.0
  length 0.45
  angle deg
:root
   order TX TY TZ RX RY RZ
   axis XYZ
   position 0 0 0
   orientation 0 0 0
:bonedata
  begin
     id 1
     name lfemur
     direction 0 -1 0
     length 7
     axis 10 20 30  XYZ
    dof rx ry rz
    limits (-160.0 20.0)
           (-70.0 70.0)
           (-60.0 70.0)
  end
  begin
     id 2
     name ltibia
     direction 0 -1 0
     length 8
     axis 5 10 20  ZXY
    dof rx
    limits (-10.0 170.0)
  end
  begin
     id 3
     name lfoot
     direction 0 0 2
     length 2
     axis 0 0 0 XYZ
  end
:hierarchy
  begin
    root lfemur
    lfemur ltibia
    ltibia lfoot
  end
"""
AMC = """#!OML:ASF
:FULLY-SPECIFIED
:DEGREES
1
root 1 2 3 10 20 30
lfemur 40 50 60
ltibia 70
2
root 1 2 4 11 21 31
lfemur 41 51 61
ltibia 7.1e+01
"""

Writer = Callable[[str, str], Path]


@pytest.fixture
def acclaim(tmp_path: Path) -> Writer:
    def write(asf: str = ASF, amc: str = AMC) -> Path:
        (tmp_path / "07.asf").write_bytes(asf.encode())
        (tmp_path / "07_01.amc").write_bytes(amc.encode())
        return tmp_path / "07_01.amc"

    return write


def fixed(order: str, angles: list[float]) -> Rotation:
    return Rotation.from_euler(order.lower(), angles, degrees=True)


def test_bones_turn_about_their_own_axes_and_start_where_their_parents_end(acclaim: Writer) -> None:
    clip = read_amc(acclaim(ASF, AMC), metres_per_unit=1.0)
    assert clip.skeleton.names == ("root", "lfemur", "ltibia", "lfoot")
    assert clip.skeleton.offsets.tolist() == [[0, 0, 0], [0, 0, 0], [0, -7, 0], [0, -8, 0]]
    assert clip.skeleton.end_parents.tolist() == [3]
    assert clip.skeleton.end_offsets.tolist() == [[0, 0, 2]]
    assert clip.fps == 120.0
    axes = fixed("XYZ", [10, 20, 30])
    femur = axes * fixed("XYZ", [40, 50, 60]) * axes.inv()
    axes = fixed("ZXY", [20, 5, 10])  # the numbers stand for x, y and z whatever the order of turning
    tibia = axes * Rotation.from_rotvec([70, 0, 0], degrees=True) * axes.inv()
    root = fixed("XYZ", [10, 20, 30])
    expected = [root.as_matrix(), femur.as_matrix(), tibia.as_matrix(), np.eye(3)]
    assert np.allclose(quat.to_matrix(clip.rotations[0]), expected, rtol=0, atol=1e-12)


def test_line_ends_and_comments_change_nothing(acclaim: Writer) -> None:
    plain = read_amc(acclaim(ASF, AMC))
    other = read_amc(
        acclaim(ASF.replace("\n", "\r\n"), AMC.replace("\n", "\r\n\r\n").replace("1\r\nroot", "1\r\n# x\r\nroot"))
    )
    assert np.array_equal(plain.rotations, other.rotations)


def test_bones_may_come_in_any_order(acclaim: Writer) -> None:
    plain = read_amc(acclaim(ASF, AMC))
    other = read_amc(acclaim(ASF, AMC.replace("lfemur 41 51 61\nltibia 7.1e+01", "ltibia 71\nlfemur 41 51 61")))
    assert np.array_equal(plain.rotations, other.rotations)


def test_radians_and_other_orders_of_the_root_are_honoured(acclaim: Writer) -> None:
    asf = ASF.replace("order TX TY TZ RX RY RZ", "order RZ RY RX TX TY TZ").replace("dof rx ry rz", "dof rz rx")
    amc = ":RADIANS\n1\nroot 0.1 0.2 0.3 4 5 6\nlfemur 0.4 0.5\nltibia 0\n"
    clip = read_amc(acclaim(asf, amc), metres_per_unit=2.0)
    assert clip.root_positions.tolist() == [[8.0, 10.0, 12.0]]
    root = Rotation.from_euler("zyx", [0.1, 0.2, 0.3])
    axes = fixed("XYZ", [10, 20, 30])
    femur = axes * Rotation.from_euler("zx", [0.4, 0.5]) * axes.inv()
    assert np.allclose(quat.to_matrix(clip.rotations[0, :2]), [root.as_matrix(), femur.as_matrix()], rtol=0, atol=1e-12)


def test_lengths_are_in_parts_of_an_inch_unless_told(acclaim: Writer) -> None:
    clip = read_amc(acclaim(ASF, AMC))
    assert clip.skeleton.offsets[2, 1] == pytest.approx(-7 * 0.0254 / 0.45)
    assert "1/0.45 inch" in " ".join(clip.history)
    assert read_amc(acclaim(ASF, AMC), metres_per_unit=0.5).skeleton.offsets[2, 1] == -3.5


def test_a_single_skeleton_in_the_folder_serves(acclaim: Writer, tmp_path: Path) -> None:
    path = acclaim(ASF, AMC)
    (tmp_path / "07.asf").rename(tmp_path / "body.ASF")
    assert read_amc(path).frames == 2
    assert with_their_parts([path]) == [path, tmp_path / "body.ASF"], "stimuli are made anew where it changes"
    (tmp_path / "other.asf").write_text(ASF)
    with pytest.raises(
        MotionFileError, match=r"Expected its skeleton beside it as 07\.asf.*found body\.ASF, other\.asf"
    ):
        read_amc(path)
    assert read_amc(path, asf=tmp_path / "other.asf", fps=60.0).fps == 60.0


def test_gaps_in_the_frame_numbers_are_warned_of(acclaim: Writer) -> None:
    with pytest.warns(MotionWarning, match="frame numbers jump 1 time from 1 to 5"):
        assert read_amc(acclaim(ASF, AMC.replace("\n2\n", "\n5\n"))).frames == 2


@pytest.mark.parametrize(
    ("old", "new", "place", "message"),
    [
        ("ltibia 70\n", "", ":7:1", "Expected all bones in frame 1, found none of ltibia"),
        ("\nltibia 7.1e+01", "", ":10:16", "Expected all bones in frame 2, found none of ltibia"),
        ("ltibia 70", "lshin 70", ":7:1", "Expected a bone of 07.asf, found 'lshin'"),
        ("ltibia 70", "lfoot 70", ":7:7", "Expected 0 values for 'lfoot'"),
        (
            "lfemur 40 50 60",
            "lfemur 40 50",
            ":6:13",
            "Expected 3 values for 'lfemur' in frame 1, as 07.asf says, found 2",
        ),
        ("lfemur 40 50 60", "lfemur 40 50 60 70", ":6:17", "found 4"),
        ("lfemur 40 50 60", "lfemur 40 nan 60", ":6:11", "holds no measurement"),
        ("lfemur 40 50 60", "lfemur 40 5,0 60", ":6:11", "decimals with a point"),
        ("ltibia 70", "lfemur 1 2 3", ":7:1", "Expected each bone once in frame 1"),
        ("1\nroot 1 2 3", "root 1 2 3", ":4:1", "Expected a frame number, found 'root'"),
        (AMC.split("DEGREES")[1], "", ":3:9", "Expected frames, found the end of the file"),
    ],
)
def test_motions_that_cannot_be_read_are_refused(acclaim: Writer, old: str, new: str, place: str, message: str) -> None:
    assert old in AMC
    with pytest.raises(MotionFileError) as caught:
        read_amc(acclaim(ASF, AMC.replace(old, new, 1)))
    assert f"07_01.amc{place}: " in str(caught.value)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "place", "message"),
    [
        ("angle deg", "angle gon", ":7:9", "Expected 'angle deg' or 'angle rad', found 'gon'"),
        ("length 0.45", "length zero", ":6:10", "Expected the length unit, found 'zero'"),
        ("length 0.45", "length 0", ":6:10", "Expected a length unit above 0"),
        ("name ltibia", "name lfemur", ":27:11", "Expected each bone once"),
        ("     name ltibia\n", "", ":26:6", "Expected a name in each bone"),
        ("direction 0 0 2", "direction 0 0 0", ":37:16", "not zero"),
        ("direction 0 0 2", "direction 0 0", ":37:18", "Expected 3 numbers"),
        ("dof rx ry rz", "dof rx ry rq", ":20:15", "found 'rq'"),
        ("20  ZXY", "20  ZYY", ":30:20", "Expected an order of axes"),
        ("    ltibia lfoot\n", "", ":36:11", "Expected bone 'lfoot' to hang on the root"),
        ("ltibia lfoot", "ltibia ltoes", ":45:12", "Expected a bone of :bonedata, found 'ltoes'"),
        ("ltibia lfoot", "ltibia lfemur", ":45:12", "Expected each bone to have one parent"),
        (":hierarchy", ":other", ":46:6", "Expected a section :hierarchy"),
    ],
)
def test_skeletons_that_cannot_be_read_are_refused(
    acclaim: Writer, old: str, new: str, place: str, message: str
) -> None:
    assert old in ASF
    with pytest.raises(MotionFileError) as caught:
        read_amc(acclaim(ASF.replace(old, new, 1), AMC))
    assert f"07.asf{place}: " in str(caught.value)
    assert message in str(caught.value)


def test_stretching_bones_are_warned_of(acclaim: Writer) -> None:
    with pytest.warns(MotionWarning, match="bone 'ltibia' shifts or stretches by up to 2 units"):
        clip = read_amc(
            acclaim(
                ASF.replace("dof rx\n", "dof rx l\n"), AMC.replace("ltibia 70", "ltibia 70 2").replace("e+01", "e+01 0")
            )
        )
    assert clip.frames == 2


# -- Real files -----------------------------------------------------------------------------------------------------


def plain_kinematics(asf: Path, amc: Path) -> dict[str, np.ndarray]:
    """Where each bone starts, `(frames, 3)` in the file's unit: the usual recipe, with nothing shared with ours."""
    blocks = asf.read_text().split(":bonedata")[1].split(":hierarchy")
    bones: dict[str, dict[str, list[str]]] = {}
    for block in blocks[0].split("begin")[1:]:
        entries = {words[0]: words[1:] for words in (line.split() for line in block.splitlines()) if words}
        bones[entries["name"][0]] = entries
    links = [line.split() for line in blocks[1].splitlines() if len(line.split()) > 1]
    parent = {child: words[0] for words in links for child in words[1:]}
    frames: list[dict[str, list[float]]] = []
    for words in (line.split() for line in amc.read_text().splitlines()):
        if len(words) == 1 and words[0].isdigit():
            frames.append({})
        elif frames and words:
            frames[-1][words[0]] = [float(word) for word in words[1:]]
    starts: dict[str, list[np.ndarray]] = {}
    for frame in frames:
        turn = {"root": Rotation.from_euler("xyz", frame["root"][3:], degrees=True).as_matrix()}
        end = {"root": np.array(frame["root"][:3])}
        for words in links:
            for name in words[1:]:
                bone = bones[name]
                c = Rotation.from_euler("xyz", [float(a) for a in bone["axis"][:3]], degrees=True).as_matrix()
                angles = dict(zip(bone.get("dof", []), frame.get(name, []), strict=True))
                m = Rotation.from_euler(
                    "xyz", [angles.get(d, 0.0) for d in ("rx", "ry", "rz")], degrees=True
                ).as_matrix()
                turn[name] = turn[parent[name]] @ c @ m @ c.T
                direction = np.array([float(a) for a in bone["direction"]])
                starts.setdefault(name, []).append(end[parent[name]])
                end[name] = end[parent[name]] + turn[name] @ direction / np.linalg.norm(direction) * float(
                    bone["length"][0]
                )
    return {name: np.array(path) for name, path in starts.items()}


@pytest.mark.mocap
@pytest.mark.parametrize("trial", ["09_02", "127_08"])
def test_kinematics_agree_with_plain_matrices(mocap: Path, trial: str) -> None:
    subject = mocap / "cmu" / "subjects" / trial.split("_")[0]
    clip = read_amc(subject / f"{trial}.amc", metres_per_unit=1.0)
    positions = joint_positions(clip)
    for name, path in plain_kinematics(subject / f"{subject.name}.asf", subject / f"{trial}.amc").items():
        assert np.max(np.abs(positions[:, clip.skeleton.names.index(name)] - path)) < 1e-9, name


@pytest.mark.mocap
@pytest.mark.parametrize("trial", ["02_01", "05_01", "05_02", "09_02"])
def test_the_original_and_its_conversion_move_alike(mocap: Path, trial: str) -> None:
    """The conversion adds a frame and leaves out the thorax bone, so arms are compared from the shoulder on."""
    ours = read_amc(mocap / "cmu" / "subjects" / trial.split("_")[0] / f"{trial}.amc")
    converted = read_bvh(mocap / "cmu_bvh" / f"{trial}.bvh")
    assert converted.frames == ours.frames + 1
    a, b = joint_positions(ours), joint_positions(converted)[1:]
    for start, roles in (("pelvis", ("hip", "knee", "ankle", "toe")), ("shoulder", ("elbow", "wrist"))):
        for role in (f"{part}.{side}" for part in roles for side in "LR"):
            origin = start if start == "pelvis" else f"{start}.{role[-1]}"
            limb = [p[:, s.role(role)] - p[:, s.role(origin)] for p, s in ((a, ours.skeleton), (b, converted.skeleton))]
            assert np.max(np.linalg.norm(limb[0] - limb[1], axis=1)) < 0.005, role
    assert np.max(np.abs(ours.root_positions - converted.root_positions[1:])) < 1e-4


@pytest.mark.mocap
def test_identity_rotations_stand_in_the_rest_pose(mocap: Path) -> None:
    clip = read_amc(mocap / "cmu" / "subjects" / "16" / "16_35.amc")
    rest = np.zeros((1, clip.skeleton.joints, 4))
    rest[..., 0] = 1.0
    assert np.allclose(global_rotations(type(clip)(clip.skeleton, np.zeros((1, 3)), rest, 120.0))[0], [1, 0, 0, 0])
    assert clip.skeleton.leg_length == pytest.approx(14.8 * 0.0254 / 0.45, rel=0.01)
