"""Files in which another axis than Y is up: the same motion whichever way its program wrote it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions
from study.motion.defects import find_defects
from study.motion.readers.bvh_writing import write_bvh
from study.motion.readers.registry import read_clip
from study.motion.synthetic import synthesize
from study.motion.upright import lying_axis, put_upright

AXES = ("X", "-X", "Z", "-Z")


def written_with(axis: str, clip: Clip) -> Clip:
    """The clip as a program writes it that calls Y by another name: rest pose, path and rotations in its axes."""
    turn = {
        "X": quat.from_axis_angle([0.0, 0, 1], -np.pi / 2),
        "-X": quat.from_axis_angle([0.0, 0, 1], np.pi / 2),
        "Z": quat.from_axis_angle([1.0, 0, 0], np.pi / 2),
        "-Z": quat.from_axis_angle([1.0, 0, 0], -np.pi / 2),
    }[axis]
    offsets, ends = (quat.rotate(turn, o) for o in (clip.skeleton.offsets, clip.skeleton.end_offsets))
    return replace(
        clip,
        skeleton=replace(clip.skeleton, offsets=offsets, end_offsets=ends),
        root_positions=quat.rotate(turn, clip.root_positions),
        rotations=quat.multiply(quat.multiply(turn, clip.rotations), quat.conjugate(turn)),
    )


@pytest.fixture(scope="module")
def walk() -> Clip:
    return synthesize("walk", seconds=2.0)


@pytest.mark.parametrize("axis", AXES)
def test_a_file_with_another_axis_up_gives_the_same_motion(walk: Clip, tmp_path: Path, axis: str) -> None:
    path = tmp_path / "walk.bvh"
    write_bvh(written_with(axis, walk), path)
    read = read_clip(path)
    assert f"turned from {axis} up to Y up" in read.history[-1]
    found, true = joint_positions(read, ends=True), joint_positions(walk, ends=True)
    np.testing.assert_allclose(found, true, atol=1e-4)
    assert not [d for d in find_defects(read) if d.kind == "not-upright"]


def test_y_up_stays_as_it_is(walk: Clip) -> None:
    assert put_upright(walk) is walk


def test_somebody_who_lies_is_not_put_upright(walk: Clip) -> None:
    turn = quat.from_axis_angle([1.0, 0, 0], np.pi / 2)
    rotations = walk.rotations.copy()
    rotations[:, 0] = quat.multiply(turn, rotations[:, 0])
    lying = replace(walk, rotations=rotations, root_positions=quat.rotate(turn, walk.root_positions))
    assert lying_axis(lying) == "Z"
    assert put_upright(lying) is lying


@pytest.mark.mocap
def test_captured_files_have_y_up(mocap: Path) -> None:
    files = sorted([*mocap.rglob("*.bvh"), *mocap.rglob("*.amc")])
    assert files
    for path in files[:: max(1, len(files) // 8)]:
        assert not any("up to Y up" in note for note in read_clip(path).history)
