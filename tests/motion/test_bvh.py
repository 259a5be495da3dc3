"""BVH: what real tools write is read as they meant it, what can't be read is refused with its place."""

from __future__ import annotations

import doctest
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from study.errors import MotionFileError, MotionWarning
from study.motion import quaternions as quat
from study.motion.clip import joint_positions
from study.motion.readers import numbers
from study.motion.readers.bvh import read_bvh
from study.motion.readers.bvh_writing import write_bvh
from study.motion.readers.frame_times import frame_rate
from study.motion.readers.gltf_writing import write_glb
from study.motion.readers.numbers import parse_numbers
from study.motion.readers.registry import read_clip
from study.motion.skeleton import Skeleton
from study.motion.units import CMU_UNIT
from tests.walks import make_walk

Bvh = Callable[[str | bytes], Path]

HIERARCHY = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
  JOINT Left Arm
  {
    OFFSET 0 1 0
    CHANNELS 3 Xrotation Yrotation Zrotation
    End Site
    {
      OFFSET 0 0.5 0
    }
  }
}
MOTION
"""
ROWS = "Frames: 2\nFrame Time: 0.0083333\n1 2 3 10 20 30 40 50 60\n1 2 4 11 21 31 41 51 61\n"


@pytest.fixture
def bvh(tmp_path: Path) -> Bvh:
    def write(text: str | bytes) -> Path:
        path = tmp_path / "clip.bvh"
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path

    return write


def refusal(path: Path) -> str:
    with pytest.raises(MotionFileError) as caught:
        read_bvh(path)
    return str(caught.value)


def test_channels_turn_in_the_order_in_which_each_joint_lists_them(bvh: Bvh) -> None:
    clip = read_bvh(bvh(HIERARCHY + ROWS), metres_per_unit=1.0)
    assert clip.skeleton.names == ("Hips", "Left Arm")
    assert clip.fps == 120.0
    assert clip.name == "clip"
    root = Rotation.from_euler("ZYX", [10, 20, 30], degrees=True)
    arm = Rotation.from_euler("XYZ", [40, 50, 60], degrees=True)
    assert np.allclose(quat.to_matrix(clip.rotations[0]), [root.as_matrix(), arm.as_matrix()], rtol=0, atol=1e-12)
    tip = np.array([1, 2, 3]) + root.apply(np.array([0, 1, 0]) + arm.apply([0, 0.5, 0]))
    assert np.allclose(joint_positions(clip, ends=True)[0, 2], tip, rtol=0, atol=1e-12)


@pytest.mark.parametrize("newline", ["\r\n", "\r"])
def test_line_ends_marks_tabs_and_blank_lines_change_nothing(bvh: Bvh, newline: str) -> None:
    plain = read_bvh(bvh(HIERARCHY + ROWS))
    messy = HIERARCHY.replace("  ", "\t") + ROWS.replace(" 20", "\t 2.0E+1 ").replace(
        "Frame Time: ", "\n\nFrame Time:\t"
    )
    messy = messy.replace("\n1 2 4", "\n \n\n1 2 4").replace("\n", newline) + newline * 3
    for raw in (messy.encode("utf-8-sig"), messy.encode("utf-16")):
        clip = read_bvh(bvh(raw))
        assert np.array_equal(clip.rotations, plain.rotations)
        assert np.array_equal(clip.root_positions, plain.root_positions)


def test_a_hierarchy_on_one_line_is_read(bvh: Bvh) -> None:
    clip = read_bvh(bvh(HIERARCHY.replace("\n", " ").replace("Left Arm", "Arm") + ROWS))
    assert clip.skeleton.names == ("Hips", "Arm")
    assert len(clip.skeleton.end_parents) == 1


def test_position_channels_replace_the_offset_wherever_they_stand(bvh: Bvh) -> None:
    text = HIERARCHY.replace(
        "6 Xposition Yposition Zposition Zrotation Yrotation Xrotation",
        "6 Zrotation Xposition Yrotation Yposition Xrotation Zposition",
    ).replace("OFFSET 0 0 0", "OFFSET 7 8 9")
    rows = "Frames: 1\nFrame Time: 0.01\n10 1 20 2 30 3 40 50 60\n"
    clip = read_bvh(bvh(text + rows), metres_per_unit=1.0)
    assert clip.root_positions.tolist() == [[1.0, 2.0, 3.0]]
    expected = Rotation.from_euler("ZYX", [10, 20, 30], degrees=True).as_matrix()
    assert np.allclose(quat.to_matrix(clip.rotations[0, 0]), expected, rtol=0, atol=1e-12)


def test_a_root_without_position_or_with_one_axis_stands_at_its_offset(bvh: Bvh) -> None:
    text = HIERARCHY.replace("6 Xposition Yposition Zposition", "4 Yposition").replace("OFFSET 0 0 0", "OFFSET 7 8 9")
    clip = read_bvh(bvh(text + "Frames: 1\nFrame Time: 0.01\n5 0 0 0 0 0 0\n"), metres_per_unit=1.0)
    assert clip.root_positions.tolist() == [[7.0, 5.0, 9.0]]
    text = text.replace("4 Yposition", "3")
    clip = read_bvh(bvh(text + "Frames: 1\nFrame Time: 0.01\n0 0 0 0 0 0\n"), metres_per_unit=1.0)
    assert clip.root_positions.tolist() == [[7.0, 8.0, 9.0]]


def test_a_joint_that_keeps_its_place_gives_a_bone_of_that_length(bvh: Bvh) -> None:
    text = HIERARCHY.replace(
        "3 Xrotation Yrotation Zrotation", "6 Xposition Yposition Zposition Xrotation Yrotation Zrotation"
    )
    rows = "Frames: 2\nFrame Time: 0.01\n" + "0 0 0 0 0 0 {} 2 0 0 0 0\n" * 2
    clip = read_bvh(
        bvh(
            text.replace("ROOT Hips", "ROOT A").replace("  JOINT", "  End Site { OFFSET 1 0 0 }\n  JOINT")
            + rows.format(0, 0)
        ),
        metres_per_unit=1.0,
    )
    assert clip.skeleton.offsets[1].tolist() == [0.0, 2.0, 0.0]
    assert clip.skeleton.end_parents.tolist() == [0, 1]


def test_a_joint_that_moves_in_its_parent_is_warned_of(bvh: Bvh) -> None:
    text = HIERARCHY.replace("3 Xrotation", "4 Xposition Xrotation").replace(
        "  JOINT", "  End Site { OFFSET 1 0 0 }\n  JOINT"
    )
    rows = "Frames: 3\nFrame Time: 0.01\n" + "".join(f"0 0 0 0 0 0 {x} 0 0 0\n" for x in (0.4, 0.1, 0.1))
    with pytest.warns(
        MotionWarning, match=r"'Left Arm' changes its place in its parent by up to 30\.00 cm \(frame 0\)"
    ):
        clip = read_bvh(bvh(text + rows), metres_per_unit=1.0)
    # Neither the first frame, which may be a pose of its own, nor the mean: the median.
    assert clip.skeleton.offsets[1].tolist() == [0.1, 1.0, 0.0]


def test_a_root_that_only_carries_a_moving_joint_is_folded_into_it(bvh: Bvh) -> None:
    text = HIERARCHY.replace("CHANNELS 3 ", "CHANNELS 6 Xposition Yposition Zposition ").replace(
        "OFFSET 0 0 0", "OFFSET 9 9 9"
    )
    rows = "Frames: 2\nFrame Time: 0.01\n1 2 3 10 20 30 4 5 6 40 50 60\n1 2 3 10 20 30 7 8 9 40 50 60\n"
    clip = read_bvh(bvh(text + rows), metres_per_unit=1.0)
    assert clip.skeleton.names == ("Left Arm",)
    outer = Rotation.from_euler("ZYX", [10, 20, 30], degrees=True)
    inner = Rotation.from_euler("XYZ", [40, 50, 60], degrees=True)
    assert np.allclose(
        clip.root_positions, np.array([1, 2, 3]) + outer.apply([[4, 5, 6], [7, 8, 9]]), rtol=0, atol=1e-12
    )
    assert np.allclose(quat.to_matrix(clip.rotations[1, 0]), (outer * inner).as_matrix(), rtol=0, atol=1e-12)
    assert "folded into 'Left Arm'" in " ".join(clip.history)


def test_the_rows_are_trusted_where_frames_disagrees(bvh: Bvh) -> None:
    with pytest.warns(MotionWarning, match=r"says Frames: 7, but holds 2 rows"):
        clip = read_bvh(bvh(HIERARCHY + ROWS.replace("Frames: 2", "Frames: 7")))
    assert clip.frames == 2
    assert read_bvh(bvh(HIERARCHY + ROWS.replace("Frames: 2\n", ""))).frames == 2


def test_joints_of_one_name_are_told_apart(bvh: Bvh) -> None:
    with pytest.warns(MotionWarning, match="two joints are called 'Hips'"):
        clip = read_bvh(bvh(HIERARCHY.replace("Left Arm", "Hips") + ROWS))
    assert clip.skeleton.names == ("Hips", "Hips_2")


@pytest.mark.parametrize(
    ("old", "new", "place", "message"),
    [
        ("Frame Time: 0.0083333\n", "", ":18:1", "Expected 'Frame Time:' before the data rows"),
        ("0.0083333", "0", ":18:13", "Expected a Frame Time above 0"),
        ("0.0083333", "-0.01", ":18:13", "Expected a Frame Time above 0"),
        ("0.0083333", "0,0083", ":18:13", "decimals with a point"),
        ("10 20 30", "10 20.5-30.5 7", ":19:10", "glued together"),
        ("10 20 30", "10 20.5.30 7", ":19:10", "glued together"),
        ("10 20 30", "10 20,5 30", ":19:10", "decimals with a point"),
        ("10 20 30", "10 nan 30", ":19:10", "holds no measurement"),
        ("10 20 30", "10 -inf 30", ":19:10", "holds no measurement"),
        ("10 20 30", "10 1e999 30", ":19:10", "Expected a number in frame 0, value 5 of 9"),
        ("10 20 30", "10 1_0 30", ":19:10", "found '1_0'"),
        ("41 51 61", "41 51", ":20:21", "Expected 9 values in frame 1, found 8"),
        ("41 51 61", "41 51 61 71", ":20:25", "Expected 9 values in frame 1, found 10"),
        ("50 60\n1 2 4", "50\n60 1 2 4", ":19:21", "Expected 9 values in frame 0, found 8"),
        ("Yrotation Zrotation", "Yrotation Wrotation", ":9:36", "Did you mean"),
        ("CHANNELS 3", "CHANNELS 4", ":10:5", "found 'End'"),
        ("CHANNELS 3", "CHANNELS 2", ":9:36", "found 'Zrotation'"),
        ("CHANNELS 3", "CHANNELS x", ":9:14", "Expected the number of channels"),
        ("Xposition Yposition", "Xposition Xposition", ":5:24", "found Xposition twice"),
        ("OFFSET 0 1 0", "OFFSET 0 1", ":9:5", "Expected a length in the OFFSET of 'Left Arm'"),
        ("    OFFSET 0 1 0\n", "", ":13:3", "Expected an OFFSET in joint 'Left Arm'"),
        ("  }\n}\nMOTION", "  }\nMOTION", ":15:1", "Expected '}' to close joint 'Hips'"),
        ("  }\n}\nMOTION", "  }\n}\n}\nMOTION", ":16:1", "closes nothing"),
        ("ROOT Hips\n{", "ROOT Hips\n", ":4:3", "Expected {"),
        ("MOTION\n", "", ":16:1", "Expected ROOT or MOTION"),
        ("HIERARCHY\n", "", ":1:1", "Expected HIERARCHY"),
        ("MOTION\n", "ROOT Other\n{\nOFFSET 0 0 0\n}\nMOTION\n", ":16:1", "file of its own"),
        ("Frames: 2", "Frames: two", ":17:9", "Expected the number of frames"),
    ],
)
def test_what_cannot_be_read_is_refused_with_its_place(bvh: Bvh, old: str, new: str, place: str, message: str) -> None:
    text = HIERARCHY + ROWS
    assert old in text
    found = refusal(bvh(text.replace(old, new, 1)))
    assert f"clip.bvh{place}: " in found
    assert message in found


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (b"", "is empty"),
        (b"\xef\xbb\xbf \r\n", "is empty"),
        (b"\x89PNG\x00\x01", "binary data"),
        (HIERARCHY.split("MOTION")[0].encode(), "found the end of the file"),
        (HIERARCHY.encode(), "Expected 'Frame Time:', found the end of the file"),
        ((HIERARCHY + "Frames: 0\nFrame Time: 0.01\n").encode(), "Expected data rows after 'Frame Time:', found none"),
    ],
)
def test_files_that_hold_no_motion_are_refused(bvh: Bvh, raw: bytes, message: str) -> None:
    assert message in refusal(bvh(raw))


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    assert "No such file" in refusal(tmp_path / "none.bvh")


def test_the_place_is_right_with_other_line_ends_and_a_mark(bvh: Bvh) -> None:
    text = (HIERARCHY + ROWS).replace("41 51 61", "41 5x 61")
    assert "clip.bvh:20:19: " in refusal(bvh(text.replace("\n", "\r\n").encode("utf-8-sig")))
    assert "clip.bvh:20:19: " in refusal(bvh(text.replace("\n", "\r").encode()))


PRINTED = {
    120.0: "0.0083333 .0083333 8.33333e-03 0.008333333333333333 0.0083",
    60.0: "0.01666667",
    30.0: "0.033333 0.033 0.03333333333333333",
    24.0: "0.041666666666666664",
    30000 / 1001: "0.0333667",
    24000 / 1001: "0.0417083",
    40.0: "0.025000",
    25.0: "0.04",
    70.0: "0.0142857",
    81.0: "0.0123",
    32.0: "0.03125",
    1 / 0.01234: "0.01234",
    1 / 0.0331: "0.0331",
}


@pytest.mark.parametrize(("printed", "fps"), [(each, fps) for fps, words in PRINTED.items() for each in words.split()])
def test_a_printed_frame_time_means_the_rate_that_its_digits_allow(printed: str, fps: float) -> None:
    assert frame_rate(printed) == pytest.approx(fps, rel=1e-15)


def test_the_examples_in_the_docstrings_run() -> None:
    result = doctest.testmod(sys.modules[frame_rate.__module__])
    assert result.attempted > 0
    assert result.failed == 0


def test_fast_numbers_are_the_doubles_that_float_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)
    formats = ["%.4f", "%.6f", "%g", "%.10g", "%.15g", "%.17g", "%e", "%+.3f", "%.0f", "%.12f", "%.3E"]
    values = np.concatenate([rng.uniform(-200, 200, 4000), rng.normal(0, 1e-3, 4000), rng.normal(0, 1e8, 4000)])
    words = [formats[k % len(formats)] % value for k, value in enumerate(values)]
    words += [".5", "-.5", "5.", "-0", "+1", "1E5", "00012.50", "123456789.012345", "12345.67890123456"]
    words += ["1e-300", "2.2250738585072011e-308"]
    for large in (0, 1_000_000):
        monkeypatch.setattr(numbers, "_LARGE", large)
        table = parse_numbers(" ".join(words).encode())
        assert table is not None
        assert table.tolist() == [[float(word) for word in words]]


NO_NUMBERS = (
    "- . -. 1.2.3 1-2 --1 1_0 nan NaN inf Infinity 1e e5 0x10 1.2345678.9 1/2 1: 1.. +-1 1e+-5 1e1.5 True 1e10 NA '1'"
)


@pytest.mark.parametrize("word", NO_NUMBERS.split())
def test_fast_numbers_know_what_is_none(monkeypatch: pytest.MonkeyPatch, word: str) -> None:
    for large in (0, 1_000_000):
        monkeypatch.setattr(numbers, "_LARGE", large)
        assert parse_numbers(f"1.5 {word} 2.5".encode()) is None
        assert parse_numbers(f"1.5 1 2.5\n1.5 {word} 2.5\n".encode()) is None


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_large_and_small_tables_are_read_alike(monkeypatch: pytest.MonkeyPatch, newline: str) -> None:
    for large in (0, 1_000_000):
        monkeypatch.setattr(numbers, "_LARGE", large)
        table = parse_numbers(newline.join(["", " 1\t2 ", "", "3  4", "  "]).encode())
        assert table is not None
        assert table.tolist() == [[1.0, 2.0], [3.0, 4.0]]
        for ragged in ("1 2", "3"), ("1", "2 3"), ("1 2", "3 4 5"):
            assert parse_numbers(newline.join(ragged).encode()) is None


def test_writing_and_reading_gives_the_same_motion(tmp_path: Path, bvh: Bvh) -> None:
    clip = read_bvh(bvh(HIERARCHY + ROWS), metres_per_unit=1.0)
    path = tmp_path / "out.bvh"
    write_bvh(clip, path, metres_per_unit=0.01)
    again = read_bvh(path, metres_per_unit=0.01)
    assert again.skeleton.names == clip.skeleton.names
    assert again.fps == clip.fps
    assert np.allclose(joint_positions(again, ends=True), joint_positions(clip, ends=True), rtol=0, atol=1e-9)
    assert [p.name for p in tmp_path.iterdir() if p.name != "clip.bvh"] == ["out.bvh"]


@pytest.mark.parametrize("suffix", [".bvh", ".glb"])
def test_joints_that_stand_level_by_level_are_written_as_the_tree_that_they_are(tmp_path: Path, suffix: str) -> None:
    walk = make_walk(10)
    rig = walk.skeleton
    order = np.concatenate([[0], *(joints for joints, _ in rig.levels)])
    number = np.argsort(order)
    level = Skeleton(
        tuple(rig.names[joint] for joint in order),
        np.array([-1, *number[rig.parents[order[1:]]]]),
        rig.offsets[order],
        number[rig.end_parents],
        rig.end_offsets,
    )
    assert np.any(np.diff(order) < 0), "in another order than depth first"
    clip = replace(walk, skeleton=level, rotations=walk.rotations[:, order])
    path = tmp_path / f"walk{suffix}"
    if suffix == ".bvh":
        write_bvh(clip, path)
    else:
        write_glb({"walk": clip}, path)
    again = read_clip(path)
    same = [again.skeleton.names.index(name) for name in rig.names]
    np.testing.assert_allclose(joint_positions(again)[:, same], joint_positions(walk), atol=1e-6)


@pytest.mark.parametrize("unit", [1.0, 0.01, 0.0254, CMU_UNIT])
def test_a_file_is_written_in_the_unit_that_it_was_read_in(tmp_path: Path, bvh: Bvh, unit: float) -> None:
    write_bvh(read_bvh(bvh(HIERARCHY + ROWS), metres_per_unit=unit), tmp_path / "out.bvh")
    assert "OFFSET 0 0.5 0" in (tmp_path / "out.bvh").read_text()


@pytest.mark.parametrize(
    ("stated", "fps", "words"),
    [
        ("30", 30.0, "30 frames a second"),
        ("120.0", 120.0, "frames a second"),
        ("59.94", 60000 / 1001, "frames a second"),
        ("250", 250.0, "frames a second"),
        ("33.3333", 30.0, "milliseconds"),
        ("8.3333", 120.0, "8.3333 milliseconds"),
        ("16", 60.0, "milliseconds"),
    ],
)
def test_a_frame_time_that_is_none_is_read_as_what_it_must_be(bvh: Bvh, stated: str, fps: float, words: str) -> None:
    path = bvh(HIERARCHY + ROWS.replace("0.0083333", stated))
    with pytest.warns(MotionWarning, match=rf"Frame Time:', found {stated}; read as .*{words}, so at {fps:g} fps"):
        assert read_bvh(path).fps == fps
    assert read_bvh(path, fps=25.0).fps == 25.0, "whoever says it is not warned"


@pytest.mark.parametrize("stated", ["1", "2", "10", "20", "40"])
def test_a_frame_time_that_may_be_anything_is_refused(bvh: Bvh, stated: str) -> None:
    said = refusal(bvh(HIERARCHY + ROWS.replace("0.0083333", stated)))
    assert f"Expected the seconds between frames after 'Frame Time:', found {stated}" in said
    assert "`fps` in library.toml" in said


def test_an_interrupted_write_leaves_the_old_file(tmp_path: Path, bvh: Bvh, monkeypatch: pytest.MonkeyPatch) -> None:
    clip = read_bvh(bvh(HIERARCHY + ROWS))
    path = tmp_path / "out.bvh"
    path.write_text("old")

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_bvh(clip, path)
    assert path.read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["clip.bvh", "out.bvh"]


def test_a_folder_that_is_not_there_is_made(tmp_path: Path, bvh: Bvh) -> None:
    clip = read_bvh(bvh(HIERARCHY + ROWS))
    write_bvh(clip, tmp_path / "none" / "out.bvh")
    assert read_bvh(tmp_path / "none" / "out.bvh").frames == clip.frames


# -- Real files -----------------------------------------------------------------------------------------------------


@pytest.mark.mocap
@pytest.mark.parametrize("name", ["cmu_bvh/05_06.bvh", "cmu_bvh/09_02.bvh", "perfume/perfume_B_test.bvh"])
def test_kinematics_agree_with_an_independent_reader(mocap: Path, name: str) -> None:
    pybvh = pytest.importorskip("pybvh")
    other = pybvh.read_bvh_file(mocap / name)
    clip = read_bvh(mocap / name, metres_per_unit=1.0)
    assert list(clip.skeleton.names) == list(other.joint_names)
    assert np.max(np.abs(joint_positions(clip) - other.joint_positions())) < 1e-9
    assert np.max(np.abs(joint_positions(clip, ends=True).sum(axis=1) - other.node_positions().sum(axis=1))) < 1e-7


@pytest.mark.mocap
def test_six_channels_on_every_joint_agree_with_plain_matrices(mocap: Path) -> None:
    """No other reader takes these files, so the oracle is written out: places and matrices, joint by joint."""
    path = mocap / "bandai" / "dataset-1_run_active_001.bvh"
    text = path.read_text()
    values = np.array(text.split("Frame Time:")[1].split()[1:], dtype=float).reshape(72, -1)
    head = text.split("MOTION")[0].split("\n")
    world: dict[str, tuple[np.ndarray, Rotation]] = {}
    stack: list[str] = []
    column = 0
    for line in (line.split() for line in head if line.strip()):
        if line[0] in ("ROOT", "JOINT", "End"):
            stack.append(line[1])
        elif line[0] == "}":
            stack.pop()
        elif line[0] == "CHANNELS":
            place, turn = (
                values[:, column : column + 3],
                Rotation.from_euler("ZXY", values[:, column + 3 : column + 6], degrees=True),
            )
            column += 6
            if len(stack) > 1:
                parent_place, parent_turn = world[stack[-2]]
                place, turn = parent_place + parent_turn.apply(place), parent_turn * turn
            world[stack[-1]] = (place, turn)
    clip = read_bvh(path, metres_per_unit=1.0)
    expected = np.stack([world[name][0] for name in clip.skeleton.names], axis=1)
    assert set(world) - set(clip.skeleton.names) == {"joint_Root"}
    # The clip's bones are rigid; the file's lengths vary in their last printed digit.
    assert np.max(np.abs(joint_positions(clip) - expected)) < 2e-3
    assert np.max(np.abs(clip.root_positions - expected[:, 0])) < 1e-9


@pytest.mark.mocap
def test_real_files_come_back_from_writing(mocap: Path, tmp_path: Path) -> None:
    clip = read_bvh(mocap / "cmu_bvh" / "02_03.bvh")
    write_bvh(clip, tmp_path / "02_03.bvh")
    again = read_bvh(tmp_path / "02_03.bvh")
    assert again.fps == 120.0
    assert again.metres_per_unit == clip.metres_per_unit == CMU_UNIT
    assert np.max(np.abs(joint_positions(again, ends=True) - joint_positions(clip, ends=True))) < 1e-7
