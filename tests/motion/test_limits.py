"""Motion files with numbers, sizes and names past what is meant: refused with their place; read in line with size."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from growth import assert_linear

from study.errors import MotionError, MotionFileError, MotionWarning
from study.motion.clip import MOST_POSES, Clip, resample
from study.motion.readers.amc import read_amc
from study.motion.readers.bvh import read_bvh
from study.motion.readers.bvh_writing import write_bvh
from study.motion.readers.registry import read_clip
from study.motion.readers.source import NUMBER
from study.motion.skeleton import MOST_JOINTS, Skeleton

ONE = (
    "HIERARCHY\nROOT a\n{{\nOFFSET {offset}\nCHANNELS {channels}\n}}\n"
    "MOTION\nFrames: {frames}\nFrame Time: {time}\n{row}\n"
)


def one(folder: Path, **parts: str) -> Path:
    """A file of one joint, sound but for what is given."""
    sound = {"offset": "0 0 0", "channels": "1 Xrotation", "frames": "1", "time": "0.03", "row": "0"}
    path = folder / "one.bvh"
    path.write_text(ONE.format(**(sound | parts)), encoding="utf-8")
    return path


def tree(
    path: Path, depths: list[int], names: list[str], channels: str = "CHANNELS 3 Zrotation Xrotation Yrotation"
) -> Path:
    """A file of a tree, depth first: depth and name of each joint."""
    lines = ["HIERARCHY"]
    for number, (depth, name) in enumerate(zip(depths, names, strict=True)):
        lines += [
            f"{'JOINT' if depth else 'ROOT'} {name}",
            "{",
            "OFFSET 0 1 0",
            channels if depth else "CHANNELS 1 Xrotation",
        ]
        following = depths[number + 1] if number + 1 < len(depths) else 0
        lines += ["}"] * (depth + 1 - following)
    columns = 1 + channels.count("rotation") * (len(depths) - 1)
    lines += ["MOTION", "Frames: 2", "Frame Time: 0.03", *[" ".join(["1"] * columns)] * 2]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"frames": "9" * 5000}, r"one.bvh:8:9: Expected the number of frames .* below 1e\+09, found '9{40}'"),
        ({"channels": "9" * 5000 + " Xrotation"}, r"one.bvh:5:10: Expected the number of channels of 'a'"),
        ({"channels": "13 " + "Xrotation " * 13}, r"one.bvh:5:10: Expected at most 12 channels in 'a', found 13"),
        (
            {"time": "1e-309"},
            r"one.bvh:9:13: Expected a Frame Time above 0, in seconds, from 1e-05 to 3600, found '1e-309'",
        ),
        ({"time": "1e300"}, r"one.bvh:9:13: Expected the seconds .* of at most 1e\+09, found '1e300'"),
        ({"time": "1e8"}, r"one.bvh:9:13: Expected a Frame Time .* found '1e8'. Write 1 / fps"),
        ({"time": "0"}, r"one.bvh:9:13: Expected a Frame Time above 0"),
        ({"time": "-0.03"}, r"one.bvh:9:13: Expected a Frame Time above 0"),
        ({"time": "nan"}, r"one.bvh:9:13: Expected the seconds between frames"),
        ({"time": "1e-9999999"}, r"one.bvh:9:13: Expected a Frame Time above 0"),
        ({"offset": "0 1.7e308 0"}, r"one.bvh:4:10: Expected a length in the OFFSET of 'a' of at most 1e\+09"),
        ({"row": "1.7e308"}, r"one.bvh:10:1: Expected a number in frame 0, value 1 of 1 of at most 1e\+09"),
        ({"row": "-2e9"}, r"one.bvh:10:1: Expected a number in frame 0"),
        ({"row": "9" * 5000}, r"one.bvh:10:1: Expected a number in frame 0"),
        ({"row": "1e400"}, r"one.bvh:10:1: Expected a number in frame 0"),
    ],
)
def test_numbers_past_what_is_meant_are_refused_with_their_place(
    tmp_path: Path, parts: dict[str, str], message: str
) -> None:
    with pytest.raises(MotionFileError, match=message):
        read_bvh(one(tmp_path, **parts))


def test_a_frame_time_of_thousands_of_digits_is_read(tmp_path: Path) -> None:
    assert read_bvh(one(tmp_path, time="0.0333333333" + "3" * 5000)).fps == pytest.approx(30.0)


def test_the_largest_numbers_are_read_and_overflow_nothing(tmp_path: Path) -> None:
    clip = read_clip(
        one(tmp_path, offset="1e9 1e9 1e9", channels="3 Xposition Yposition Xrotation", row="1e9 -1e9 1e9")
    )
    assert np.isfinite(clip.root_positions).all()
    assert read_bvh(one(tmp_path, offset="0 1e-320 0")).frames == 1  # a length that is zero but for rounding


def many(folder: Path, shape: str, count: int, name: str = "j{}") -> Path:
    """A file of many joints: each the last one's child, or all the root's."""
    depths = [k if shape == "deep" else min(k, 1) for k in range(count)]
    return tree(folder / f"{count}.bvh", depths, [name.format(k) for k in range(count)])


@pytest.mark.parametrize("shape", ["deep", "wide"])
def test_as_many_joints_as_are_taken_are_read_and_written(tmp_path: Path, shape: str) -> None:
    clip = read_clip(many(tmp_path, shape, MOST_JOINTS))
    assert clip.skeleton.joints == MOST_JOINTS
    assert sys.getrecursionlimit() < MOST_JOINTS
    assert "hip.L" not in clip.skeleton.roles
    write_bvh(clip, tmp_path / "again.bvh")
    again = read_clip(tmp_path / "again.bvh", metres_per_unit=clip.metres_per_unit)
    assert again.skeleton.names == clip.skeleton.names
    assert again.skeleton.parents.tolist() == clip.skeleton.parents.tolist()
    np.testing.assert_allclose(again.skeleton.offsets, clip.skeleton.offsets, atol=1e-9)


@pytest.mark.parametrize("name", ["j{}", "same"])
@pytest.mark.parametrize("shape", ["deep", "wide"])
def test_joints_are_read_in_a_time_by_their_number(tmp_path: Path, shape: str, name: str) -> None:
    def read(count: int) -> Callable[[], object]:
        path = many(tmp_path, shape, count, name)
        return lambda: read_clip(path)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MotionWarning)
        assert_linear(read, MOST_JOINTS)


@pytest.mark.parametrize("most", [5000, 20_000])
def test_more_joints_are_refused_where_the_first_too_many_stands(tmp_path: Path, most: int) -> None:
    # Each joint takes five lines, the root's brace closes last.
    with pytest.raises(
        MotionFileError, match=rf"{most}.bvh:{5 * MOST_JOINTS + 1}:1: Expected at most 4000 joints, found more"
    ):
        read_bvh(many(tmp_path, "wide", most))


def test_thousands_of_joints_of_one_name_are_numbered(tmp_path: Path) -> None:
    path = many(tmp_path, "wide", MOST_JOINTS, "same")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        clip = read_bvh(path)
    assert clip.skeleton.names == ("same", *(f"same_{k}" for k in range(2, MOST_JOINTS + 1)))
    told = [str(each.message) for each in said if issubclass(each.category, MotionWarning)]
    assert "two joints are called 'same'; the second is read as 'same_2'" in told[0]
    assert any(f"{MOST_JOINTS - 4} more joints have the name of another" in each for each in told)


def test_a_numbered_name_that_is_there_already_is_not_taken_twice(tmp_path: Path) -> None:
    path = tree(tmp_path / "names.bvh", [0, 1, 1, 1, 1], ["a", "a_2", "a", "a_2", "a"])
    with pytest.warns(MotionWarning, match="two joints are called"):
        clip = read_bvh(path)
    assert clip.skeleton.names == ("a", "a_2", "a_3", "a_2_2", "a_4")


def test_a_name_of_thousands_of_letters_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MotionFileError, match=r"names.bvh:6:1: Expected a name of at most 1000 letters, found 5000"):
        read_bvh(tree(tmp_path / "names.bvh", [0, 1], ["a", "b" * 5000]))


def test_few_numbers_can_not_ask_for_a_large_clip(tmp_path: Path) -> None:
    path = tree(tmp_path / "few.bvh", [min(k, 1) for k in range(400)], [f"j{k}" for k in range(400)], channels="")
    path.write_text(path.read_text().replace("Frames: 2", "") + "1\n" * 60_000)
    with pytest.raises(
        MotionError, match=r"few\.bvh to move, found 400 joints and 1 numbers a frame\. Leave out the joints"
    ):
        read_bvh(path)


def test_resampling_is_refused_where_the_memory_would_not_do() -> None:
    skeleton = Skeleton(("a",), np.array([-1]), np.zeros((1, 3)), np.array([], dtype=int), np.zeros((0, 3)))
    clip = Clip(skeleton, np.zeros((100, 3)), np.tile([1.0, 0, 0, 0], (100, 1, 1)), 0.01, name="slow")
    with pytest.raises(MotionError, match=f"at most {MOST_POSES:,} frames times joints in slow at 30000 fps"):
        resample(clip, 30_000.0)


@pytest.mark.parametrize("option", [{"fps": 1e308}, {"fps": 1e-320}, {"metres_per_unit": 1e300}, {"fps": float("nan")}])
def test_options_past_what_is_meant_are_refused(tmp_path: Path, option: dict[str, float]) -> None:
    with pytest.raises(MotionError, match=f"Expected {next(iter(option))} above 0, from"):
        read_clip(one(tmp_path), **option)


def test_a_clip_that_moves_too_far_is_not_written(tmp_path: Path) -> None:
    clip = read_clip(one(tmp_path, channels="1 Xposition", row="1e9"), metres_per_unit=1.0)
    with pytest.raises(MotionFileError, match=r"Expected to write no number above 1e\+09"):
        write_bvh(clip, tmp_path / "far.bvh", metres_per_unit=0.01)
    assert not (tmp_path / "far.bvh").exists()


@pytest.mark.parametrize(
    ("first", "more", "last"), [(b"", b"9", b"x"), (b"", b".", b""), (b"1e", b"9", b"x"), (b"", b"-", b"")]
)
def test_long_words_that_are_no_numbers_take_a_time_by_their_length(first: bytes, more: bytes, last: bytes) -> None:
    def words(count: int) -> Callable[[], object]:
        word = first + more * count + last
        assert NUMBER.fullmatch(word) is None
        return lambda: NUMBER.fullmatch(word)

    assert_linear(words, 800_000)


ASF = ":root\norder {order}\n:bonedata\n{bones}:hierarchy\nbegin\nroot {children}\nend\n"


def acclaim(folder: Path, frames: str, order: str = "TX RX", bones: str = "", children: str = "") -> Path:
    (folder / "1.asf").write_text(ASF.format(order=order, bones=bones, children=children), encoding="utf-8")
    (folder / "1_1.amc").write_text(f":DEGREES\n{frames}", encoding="utf-8")
    return folder / "1_1.amc"


@pytest.mark.parametrize(
    ("frames", "parts", "message"),
    [
        ("1\n2\n", {"order": ""}, r"1.asf:1:1: Expected a degree of freedom in the root's order .* nothing moves"),
        ("9" * 5000 + "\nroot 1 2\n", {}, r"1_1.amc:2:1: Expected a frame's number, a whole number below 1e\+09"),
        ("1\nroot 1 1e308\n", {}, r"1_1.amc:3:8: Expected a value of 'root' in frame 1 of at most 1e\+09"),
        ("1\nroot 1 2e9\n", {}, r"1_1.amc:3:8: Expected a value of 'root' in frame 1 of at most 1e\+09"),
        (
            "1\nroot 1 2\n",
            {"bones": "begin\nname b\ndirection 0 1e-200 0\nlength 1\nend\n", "children": "b"},
            r"1.asf:6:11: Expected a direction of 'b' that is not zero",
        ),
        (
            "1\nroot 1 2\n",
            {"bones": "begin\nname b\ndirection 0 1 0\nlength 1e308\nend\n", "children": "b"},
            r"1.asf:7:8: Expected the length of 'b' of at most 1e\+09",
        ),
    ],
)
def test_acclaim_files_past_what_is_meant_are_refused_with_their_place(
    tmp_path: Path, frames: str, parts: dict[str, str], message: str
) -> None:
    with pytest.raises(MotionFileError, match=message):
        read_amc(acclaim(tmp_path, frames, **parts))


def test_more_bones_are_refused(tmp_path: Path) -> None:
    bones = "".join(f"begin\nname b{k}\ndirection 0 1 0\nlength 1\nend\n" for k in range(15_000))
    children = " ".join(f"b{k}" for k in range(15_000))
    with pytest.raises(MotionFileError, match=r"1.asf:\d+:6: Expected at most 4000 bones, found more"):
        read_amc(acclaim(tmp_path, "1\nroot 1 2\n", bones=bones, children=children))
