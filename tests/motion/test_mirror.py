"""Mirroring: positions are the mirror image, twice is nothing, lopsided rigs and odd axes included."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.errors import MotionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions
from study.motion.mirror import find_partners, mirror, mirror_map
from study.motion.readers.registry import read_clip
from study.motion.skeleton import Skeleton

_NAMES = ("Hips", "Spine", "Head", "LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot")
_PARENTS = np.array([-1, 0, 1, 0, 3, 4, 0, 6, 7])


def _offsets(right_shin: float = 0.4) -> np.ndarray:
    left = [[0.1, 0, 0], [0, -0.4, 0], [0, -0.4, 0]]
    right = [[-0.1, 0, 0], [0, -0.4, 0], [0, -right_shin, 0]]
    return np.array([[0, 0, 0], [0, 0.5, 0], [0, 0.2, 0], *left, *right])


def _skeleton(right_shin: float = 0.4, names: tuple[str, ...] = _NAMES, parents: np.ndarray = _PARENTS) -> Skeleton:
    ends = np.array([2, 5, 8])
    return Skeleton(names, parents, _offsets(right_shin), ends, np.array([[0, 0.1, 0], [0, 0, 0.2], [0, 0, 0.2]]))


def _random_clip(skeleton: Skeleton, spread: float = 0.4, seed: int = 1) -> Clip:
    rng = np.random.default_rng(seed)
    rotations = quat.exp(rng.normal(scale=spread, size=(20, skeleton.joints, 3)))
    return Clip(skeleton, rng.normal(size=(20, 3)), rotations, 30.0, name="random")


@pytest.mark.parametrize("right_shin", [0.4, 0.45])
def test_positions_are_the_mirror_image(right_shin: float) -> None:
    clip = _random_clip(_skeleton(right_shin))
    mirrored = mirror(clip)
    partners = find_partners(clip.skeleton)
    expected = joint_positions(clip)[:, partners] * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(joint_positions(mirrored), expected, atol=1e-12)
    left, right = mirrored.skeleton.role("ankle.L"), mirrored.skeleton.role("ankle.R")
    assert mirrored.skeleton.offsets[left, 1] == -right_shin
    assert mirrored.skeleton.offsets[right, 1] == -0.4


def test_twice_gives_the_clip_back() -> None:
    clip = _random_clip(_skeleton(0.45))
    again = mirror(mirror(clip))
    np.testing.assert_allclose(again.rotations, clip.rotations, atol=1e-12)
    np.testing.assert_allclose(again.root_positions, clip.root_positions, atol=1e-12)
    np.testing.assert_array_equal(again.skeleton.offsets, clip.skeleton.offsets)
    assert again.history == clip.history


def test_a_symmetrical_rig_keeps_its_skeleton() -> None:
    clip = _random_clip(_skeleton())
    assert mirror(clip).skeleton is clip.skeleton
    assert mirror(clip).history == ("mirrored left to right",)


def test_a_left_turn_becomes_a_right_turn() -> None:
    skeleton = _skeleton()
    turn = np.linspace(0.0, 1.2, 20)
    rotations = np.tile(quat.IDENTITY, (20, skeleton.joints, 1))
    rotations[:, 0] = quat.yaw(turn)
    clip = Clip(skeleton, np.zeros((20, 3)), rotations, 30.0)
    np.testing.assert_allclose(mirror(clip).rotations[:, 0], quat.yaw(-turn), atol=1e-12)


def test_axes_that_follow_the_bones() -> None:
    """A rig like those of game engines: bones along +x on the left and -x on the right, sideways is z."""
    names = ("Hips", "Thigh_L", "Calf_L", "Foot_L", "Thigh_R", "Calf_R", "Foot_R")
    offsets = np.array([[0, 0, 0], [0, 0, 0.1], [0.4, 0, 0], [0.4, 0, 0], [0, 0, -0.1], [-0.4, 0, 0], [-0.4, 0, 0]])
    skeleton = Skeleton(names, np.array([-1, 0, 1, 2, 0, 4, 5]), offsets, np.array([3, 6]), np.zeros((2, 3)))
    # At rest the pelvis frame is turned; the same turn of both thighs about z bends both legs downwards.
    rotations = np.tile(quat.IDENTITY, (10, 7, 1))
    bend = quat.from_axis_angle([0.0, 0.0, 1.0], np.full(10, -1.5))
    rotations[:, 1] = quat.multiply(quat.exp(np.full((10, 3), 0.05)), bend)
    rotations[:, 4] = quat.multiply(bend, quat.from_axis_angle([0.0, 0.0, 1.0], np.full(10, np.pi)))
    clip = Clip(skeleton, np.zeros((10, 3)), rotations, 30.0)
    mirrored = mirror(clip)
    expected = joint_positions(clip)[:, find_partners(skeleton)] * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(joint_positions(mirrored), expected, atol=1e-12)
    np.testing.assert_allclose(mirror(mirrored).rotations, clip.rotations, atol=1e-12)


def test_a_joint_without_counterpart_is_refused() -> None:
    names = (*_NAMES[:3], "LeftProp", *_NAMES[4:])
    with pytest.raises(MotionError, match="'LeftProp' has no counterpart on the other side"):
        mirror(_random_clip(_skeleton(names=names)))


def test_counterparts_on_different_parents_are_refused() -> None:
    parents = np.array([-1, 0, 1, 0, 3, 4, 1, 6, 7])
    with pytest.raises(MotionError, match="hang on 'Hips' and 'Spine'"):
        mirror(_random_clip(_skeleton(parents=parents)))


@pytest.mark.mocap
@pytest.mark.parametrize(
    "file",
    [
        "cmu/subjects/16/16_41.amc",
        "cmu_bvh/02_01.bvh",
        "bandai/dataset-1_walk_normal_001.bvh",
        "bandai/dataset-1_run_active_001.bvh",
        "perfume/perfume_A_test.bvh",
    ],
)
@pytest.mark.filterwarnings("ignore::study.errors.MotionWarning")
def test_captured_rigs(mocap: Path, file: str) -> None:
    clip = read_clip(mocap / file)
    mirrored = mirror(clip)
    expected = joint_positions(clip)[:, find_partners(clip.skeleton)] * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(joint_positions(mirrored), expected, atol=1e-12)
    np.testing.assert_allclose(mirror(mirrored).rotations, clip.rotations, atol=1e-12)
    # On the clip's own body the difference is the body's asymmetry and no more: the local axes were matched.
    turned = np.degrees(2.0 * quat.half_angle_between(mirrored.rotations, clip.rotations)).mean(axis=0)
    assert turned[1:].max() < 60.0
    asymmetry = np.linalg.norm(mirror_map(clip).skeleton.offsets - clip.skeleton.offsets, axis=1)
    assert asymmetry[1:].max() < 0.06


def test_limbs_without_sides_in_their_names_are_paired_by_their_roles() -> None:
    clip = _random_clip(_skeleton())
    silent = replace(clip, skeleton=_skeleton(names=tuple(f"joint_{k}" for k in range(len(_NAMES)))))
    np.testing.assert_array_equal(find_partners(silent.skeleton), find_partners(clip.skeleton))
    np.testing.assert_array_equal(mirror(silent).rotations, mirror(clip).rotations)
