from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from walks import make_walk

from study.errors import TransitionError
from study.motion.clip import Clip, moved, resample, sample
from study.transitions import cost_matrix as cm
from study.transitions.blending import facing
from study.transitions.distances import distance_matrix
from study.transitions.weights import LEE2002, WANG2003, joint_weights


def half_angles(rotations: Rotation) -> np.ndarray:
    return 0.5 * rotations.as_rotvec()


def plain_cost(
    source: Clip, destination: Clip, i: int, j: int, weights: dict[str, float], nu: float, root: str = "matched"
) -> float:
    """2003 Eqs. 1 and 2 for one pair of frames in the middle of clips at 30 fps, by scipy's rotations."""
    total = 0.0
    poses, speeds = [], []
    for clip, frame in ((source, i), (destination, j)):
        turn = Rotation.from_euler("y", -facing(clip)[frame])
        by_joint = {}
        velocity_by_joint = {}
        for role, weight in weights.items():
            if weight == 0:
                continue
            k = clip.skeleton.role(role)
            now, before, after = (
                Rotation.from_quat(clip.rotations[at, k], scalar_first=True) for at in (frame, frame - 1, frame + 1)
            )
            by_joint[role] = turn * now if k == 0 else now
            velocity_by_joint[role] = half_angles(before.inv() * after) / 2
        step = (clip.root_positions[frame + 1] - clip.root_positions[frame - 1]) / 2
        poses.append((clip.root_positions[frame], by_joint))
        speeds.append((turn.apply(step) if root == "matched" else step, velocity_by_joint))
    for role, weight in weights.items():
        if weight == 0:
            continue
        total += weight * (0.5 * (poses[1][1][role].inv() * poses[0][1][role]).magnitude()) ** 2
        total += nu * weight * float(np.sum((speeds[0][1][role] - speeds[1][1][role]) ** 2))
    if root != "none":
        gap = poses[0][0] - poses[1][0]
        total += float(gap[1] ** 2 if root == "matched" else gap @ gap)
        total += nu * float(np.sum((speeds[0][0] - speeds[1][0]) ** 2))
    return total


@pytest.fixture(scope="module")
def pair() -> Any:
    return (
        make_walk(40, phase=0.3, turn_rate=0.4, heading=1.0),
        make_walk(50, phase=2.0, swing=0.8, speed=2.0, cadence=1.4),
    )


@pytest.mark.parametrize("weights", ["wang2003", "lee2002"])
@pytest.mark.parametrize("root", cm.ROOTS)
@pytest.mark.parametrize("nu", [0.0, 1.0, 10.0])
def test_agrees_with_the_equations_by_scipy(pair: Any, weights: str, root: str, nu: float) -> None:
    source, destination = pair
    by_role = dict(WANG2003 if weights == "wang2003" else LEE2002)
    found = cm.cost_matrix(source, destination, weights=weights, nu=nu, root=root)
    assert found.shape == (40, 50)
    for i, j in ((1, 1), (7, 30), (20, 11), (38, 48)):
        assert found[i, j] == pytest.approx(
            plain_cost(source, destination, i, j, by_role, nu, root), rel=1e-9, abs=1e-12
        )


def test_single_precision_is_good_to_a_millionth(pair: Any) -> None:
    exact = cm.cost_matrix(*pair, weights="lee2002")
    single = cm.cost_matrix(*pair, weights="lee2002", precision="single")
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, exact, atol=4e-6, rtol=2e-6)


@pytest.mark.parametrize(("precision", "within"), [("double", 1e-12), ("single", 2e-6)])
@pytest.mark.parametrize("spread", [0.1, 0.6, 5.0])
def test_either_sign_of_a_quaternion_is_the_same_rotation(
    pair: Any, precision: str, within: float, spread: float
) -> None:
    """Joints that turn little, further than a right angle, and anyhow; half of the quaternions with the other sign."""
    rng = np.random.default_rng(3)
    around = Rotation.from_rotvec(spread * rng.normal(size=(60 * pair[0].skeleton.joints, 3)))
    every = (around * Rotation.from_rotvec([1.0, 2.0, -1.0])).as_quat(scalar_first=True)
    every = (every * rng.choice([-1.0, 1.0], (len(every), 1))).reshape(60, -1, 4)
    clips = [replace(pair[0], rotations=part, root_positions=np.zeros((30, 3))) for part in (every[:30], every[30:])]
    found = cm.cost_matrix(*clips, nu=0.0, root="none", precision=precision)
    apart = np.zeros((30, 30))
    for k, weight in enumerate(joint_weights(clips[0].skeleton, "wang2003")):
        one, other = (Rotation.from_quat(clip.rotations[:, k], scalar_first=True) for clip in clips)
        for i in range(30):
            apart[i] += weight * (0.5 * (one[i].inv() * other).magnitude()) ** 2
    np.testing.assert_allclose(found, apart, atol=within * joint_weights(clips[0].skeleton, "wang2003").sum())


@pytest.mark.parametrize("precision", ["double", "single"])
def test_quaternions_as_far_from_unit_length_as_clips_may_have_them_cost_what_unit_ones_cost(
    pair: Any, precision: str
) -> None:
    long = [replace(clip, rotations=clip.rotations * (1 + 3e-7)) for clip in (pair[0], pair[0])]
    found = cm.cost_matrix(*long, weights="lee2002", nu=0.0, precision=precision)
    expected = cm.cost_matrix(pair[0], pair[0], weights="lee2002", nu=0.0, precision=precision)
    np.testing.assert_allclose(found, expected, atol=1e-8 if precision == "double" else 4e-6)  # they are off by 3e-7


def test_without_velocity_and_root_it_is_the_difference_of_2004(pair: Any) -> None:
    weights = joint_weights(pair[0].skeleton)
    np.testing.assert_allclose(
        cm.cost_matrix(*pair, nu=0.0, root="none"), distance_matrix(*pair, weights), atol=1e-13, rtol=1e-12
    )


@pytest.mark.parametrize("degrees", [120.0, 170.0, -75.0])
@pytest.mark.parametrize("weights", ["wang2003", "lee2002"])
def test_turning_and_moving_either_clip_changes_nothing(pair: Any, degrees: float, weights: str) -> None:
    source, destination = pair
    expected = cm.cost_matrix(source, destination, weights=weights)
    there = moved(destination, np.radians(degrees), np.array([30.0, 0.0, -20.0]))
    np.testing.assert_allclose(cm.cost_matrix(source, there, weights=weights), expected, atol=1e-12)
    np.testing.assert_allclose(
        cm.cost_matrix(moved(source, 2.0, np.zeros(3)), there, weights=weights), expected, atol=1e-12
    )


def test_a_root_in_the_world_counts_where_the_figure_is(pair: Any) -> None:
    source, destination = pair
    far = moved(destination, 0.0, np.array([3.0, 0.0, 4.0]))
    assert cm.cost_matrix(source, far, root="world").min() > cm.cost_matrix(source, far, root="matched").min() + 1.0


def test_a_clip_costs_nothing_to_itself(pair: Any) -> None:
    np.testing.assert_allclose(np.diag(cm.cost_matrix(pair[0], pair[0], weights="lee2002")), 0.0, atol=1e-12)


def test_velocities_mean_the_same_at_another_frame_rate() -> None:
    slow, fast = make_walk(40), make_walk(160, fps=120.0)
    joints = np.flatnonzero(joint_weights(slow.skeleton))
    np.testing.assert_allclose(cm.velocities(fast, joints)[4:150:4], cm.velocities(slow, joints)[1:38], atol=2e-3)


def test_blocks_are_rows_of_the_matrix_in_order() -> None:
    source, destination = make_walk(600), make_walk(90, phase=1.0)
    whole = cm.cost_matrix(source, destination, precision="single")
    at = 0
    for rows, block in cm.joint_blocks(source, destination):
        assert rows.start == at
        at = rows.stop
        np.testing.assert_array_equal(block, whole[rows.start : rows.stop])
    assert at == 600
    found = cm.extremes(cm.joint_blocks(source, destination))
    assert found.argmin == np.unravel_index(int(np.argmin(whole)), whole.shape)
    assert (found.min, found.max, found.shape) == (float(whole.min()), float(whole.max()), whole.shape)


def test_the_least_cost_is_where_the_same_pose_comes_again() -> None:
    walk = make_walk(150, phase=0.3)
    later = sample(walk, np.arange(40, 120))
    found = cm.extremes(cm.joint_blocks(walk, later, precision="double"))
    assert found.min == pytest.approx(0.0, abs=1e-9)
    assert (found.argmin[0] - found.argmin[1] - 40) % 30 == 0, "the walk repeats each 30 frames"


def test_point_clouds_come_in_blocks_too() -> None:
    from study.transitions.point_cloud import point_cloud, window_distances

    source, destination = make_walk(300), make_walk(80, phase=1.0)
    whole = window_distances(point_cloud(source), point_cloud(destination), 10)
    np.testing.assert_allclose(
        np.concatenate([block for _, block in cm.pointcloud_blocks(source, destination)]), whole, atol=1e-6
    )
    assert cm.extremes(cm.pointcloud_blocks(source, destination, window=5)).shape == (296, 76)


def test_what_can_not_be_compared_is_refused(pair: Any) -> None:
    source, destination = pair
    with pytest.raises(TransitionError, match="matched, world, none"):
        cm.cost_matrix(source, destination, root="floor")
    with pytest.raises(TransitionError, match="nu, the weight of velocities, of 0 or more, got -1"):
        cm.cost_matrix(source, destination, nu=-1.0)
    with pytest.raises(TransitionError, match="precision"):
        cm.cost_matrix(source, destination, precision="half")
    with pytest.raises(TransitionError, match="resample"):
        cm.cost_matrix(source, replace(resample(destination, 60.0), name="other"))
    with pytest.raises(TransitionError, match="1 to 40 frames"):
        list(cm.pointcloud_blocks(source, destination, window=41))
