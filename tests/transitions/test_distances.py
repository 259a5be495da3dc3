from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from walks import make_rig, make_walk

from study.errors import TransitionError
from study.motion import quaternions as quat
from study.motion.clip import moved
from study.transitions.distances import distance_matrix, frame_distance, on_joints_of
from study.transitions.weights import joint_weights


def test_a_half_turn_of_one_joint_is_half_pi_away() -> None:
    skeleton = make_rig()
    rest = np.tile(quat.IDENTITY, (skeleton.joints, 1))
    turned = rest.copy()
    turned[skeleton.role("knee.L")] = quat.from_axis_angle([1.0, 0.0, 0.0], np.pi)
    assert frame_distance(rest, turned, joint_weights(skeleton)) == pytest.approx(0.0901 * (np.pi / 2) ** 2)


def test_agrees_with_scipy_rotations() -> None:
    source, destination = make_walk(20, phase=0.3), make_walk(20, phase=2.0, swing=0.9)
    weights = joint_weights(source.skeleton)
    expected = np.zeros((20, 20))
    for k in np.flatnonzero(weights):
        a = Rotation.from_quat(source.rotations[:, k], scalar_first=True)
        b = Rotation.from_quat(destination.rotations[:, k], scalar_first=True)
        for j in range(20):
            expected[:, j] += weights[k] * (0.5 * (b[j].inv() * a).magnitude()) ** 2
    np.testing.assert_allclose(distance_matrix(source, destination, weights), expected, atol=1e-14, rtol=1e-12)
    pairs = frame_distance(source.rotations[:, None], destination.rotations[None], weights)
    np.testing.assert_allclose(pairs, expected, atol=1e-14, rtol=1e-12)


def test_signs_of_quaternions_mean_nothing() -> None:
    source, destination = make_walk(5), make_walk(5, phase=1.0)
    weights = joint_weights(source.skeleton)
    np.testing.assert_array_equal(
        frame_distance(source.rotations, destination.rotations, weights),
        frame_distance(-source.rotations, destination.rotations, weights),
    )


def test_turning_and_moving_either_clip_changes_nothing() -> None:
    source, destination = make_walk(10), make_walk(10, phase=1.0)
    weights = joint_weights(source.skeleton, "lee2002")
    expected = distance_matrix(source, destination, weights)
    for angle in (2 * np.pi / 3, np.radians(170)):
        turned = moved(destination, angle, np.array([3.0, 0.0, -1.0]))
        np.testing.assert_array_equal(distance_matrix(source, turned, weights), expected)


def test_clips_of_different_rigs_or_rates_are_refused() -> None:
    walk = make_walk(5)
    other = replace(walk.skeleton, names=tuple(name.replace("LeftLeg", "Prop") for name in walk.skeleton.names))
    with pytest.raises(TransitionError, match="'Prop', a joint of the body itself, in one of them only"):
        on_joints_of(walk, replace(walk, skeleton=other))
    with pytest.raises(TransitionError, match="30 and 120 fps; resample"):
        on_joints_of(walk, replace(walk, fps=120.0))


def test_clips_that_differ_in_leaf_joints_alone_are_compared() -> None:
    walk, other = make_walk(5), make_walk(5, toes=False, phase=1.0)
    weights = joint_weights(walk.skeleton)
    expected = distance_matrix(walk, make_walk(5, phase=1.0), weights)
    np.testing.assert_array_equal(distance_matrix(walk, other, weights), expected)
