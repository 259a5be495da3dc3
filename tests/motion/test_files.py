"""Any motion file by its suffix, and what a caller may overrule."""

from __future__ import annotations

from pathlib import Path

import pytest

from study.errors import MotionError, MotionFileError
from study.motion.readers.registry import read_clip

BVH = """HIERARCHY
ROOT Hips
{
OFFSET 0 0 0
CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
End Site
{
OFFSET 0 10 0
}
}
MOTION
Frames: 1
Frame Time: 0.0333333
0 90 0 0 0 0
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "Clip.BVH"
    path.write_text(BVH)
    return path


def test_the_suffix_decides_in_any_case(path: Path) -> None:
    assert read_clip(path).fps == 30.0


def test_a_given_rate_and_unit_overrule_the_file_and_are_written_down(path: Path) -> None:
    clip = read_clip(path, fps=60, metres_per_unit=0.01)
    assert clip.fps == 60.0
    assert clip.root_positions.tolist() == [[0.0, 0.9, 0.0]]
    assert "taken at 60 fps, as told, and not at the file's 30" in clip.history
    assert "lengths x 0.01 m, as told" in clip.history


@pytest.mark.parametrize("given", [{"fps": 0.0}, {"fps": float("nan")}, {"metres_per_unit": -1.0}])
def test_rates_and_units_that_are_none_are_refused(path: Path, given: dict[str, float]) -> None:
    with pytest.raises(MotionError, match=f"Expected {next(iter(given))} above 0"):
        read_clip(path, **given)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.fbx", r"Expected a motion file \(\.bvh, \.amc, \.glb, \.gltf\), found an FBX file.*Blender"),
        ("a", "no suffix"),
        ("a.asf", r"name the \.amc"),
    ],
)
def test_other_files_are_refused(name: str, message: str) -> None:
    with pytest.raises(MotionFileError, match=message):
        read_clip(name)


@pytest.mark.mocap
def test_every_real_file_is_read_in_a_human_size(mocap: Path) -> None:
    paths = [*mocap.glob("*/*.bvh"), *mocap.glob("cmu/subjects/*/*.amc")]
    assert len(paths) > 50
    for path in paths[::7]:
        clip = read_clip(path)
        assert 0.7 < clip.skeleton.leg_length < 0.95, path
        assert clip.fps in (30.0, 40.0, 120.0), path
