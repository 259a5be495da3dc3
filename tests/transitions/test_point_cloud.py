"""Point cloud distances: the fast matrix against the plain definition, at best alignment found by search."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from study.errors import TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, moved
from study.motion.skeleton import Skeleton
from study.transitions import point_cloud as clouds


def wandering_clip(rng: np.random.Generator, frames: int, joints: int = 5, name: str = "wander") -> Clip:
    """A chain of joints that turns and travels smoothly."""
    parents = np.array([-1, *range(joints - 1)])
    offsets = rng.uniform(-0.4, 0.4, (joints, 3))
    skeleton = Skeleton(
        tuple(f"joint{k}" for k in range(joints)), parents, offsets, np.zeros(0, dtype=np.int64), np.zeros((0, 3))
    )
    steps = 0.1 * np.cumsum(rng.standard_normal((frames, joints, 3)), axis=0)
    path = np.cumsum(rng.standard_normal((frames, 3)) * [0.05, 0.01, 0.05], axis=0) + np.array([0.0, 1.0, 0.0])
    return Clip(skeleton, path, quat.exp(steps), 60.0, name)


def on_skeleton_of(clip: Clip, other: Clip) -> Clip:
    return Clip(other.skeleton, clip.root_positions, clip.rotations, clip.fps, clip.name)


@pytest.fixture
def pair() -> tuple[Clip, Clip]:
    rng = np.random.default_rng(20190601)
    a = wandering_clip(rng, 45, name="a")
    return a, on_skeleton_of(wandering_clip(rng, 60, name="b"), a)


def plain_distances(a: Clip, b: Clip, window: int, weights: np.ndarray | None = None) -> np.ndarray:
    """Window pair by window pair, by the closed form of `alignment`."""
    p, q = joint_positions(a), joint_positions(b)
    return np.array(
        [
            [clouds.alignment(p[i : i + window], q[j : j + window], weights)[2] for j in range(b.frames - window + 1)]
            for i in range(a.frames - window + 1)
        ]
    )


def test_the_closed_form_is_the_least_that_a_search_finds(pair: tuple[Clip, Clip]) -> None:
    p, q = joint_positions(pair[0])[:6], joint_positions(pair[1])[9:15]

    def left_over(turn_and_shift: np.ndarray) -> float:
        yaw, x, z = turn_and_shift
        placed = quat.rotate(quat.yaw(yaw), q) + np.array([x, 0.0, z])
        return float(np.mean(np.sum((p - placed) ** 2, axis=-1)))

    yaw, shift, residual = clouds.alignment(p, q)
    found = min((minimize(left_over, [start, 0.0, 0.0]) for start in (-2.0, 0.0, 2.0)), key=lambda best: best.fun)
    assert residual == pytest.approx(found.fun, abs=1e-8)
    assert left_over(np.array([yaw, shift[0], shift[2]])) == pytest.approx(residual, abs=1e-12)
    assert shift[1] == 0.0


@pytest.mark.parametrize("window", [1, 2, 3, 7, 13, 30])
def test_the_matrix_is_that_of_each_pair_of_windows(pair: tuple[Clip, Clip], window: int) -> None:
    a, b = (clouds.point_cloud(clip) for clip in pair)
    expected = plain_distances(*pair, window)
    assert np.allclose(clouds.window_distances(a, b, window, precision="double"), expected, rtol=0, atol=1e-13)
    assert np.allclose(clouds.window_distances(a, b, window), expected, rtol=0, atol=5e-7)
    counts = clouds.window_counts(a, b, window)
    assert counts.dtype == np.int32
    assert np.allclose(counts / clouds.COUNTS_PER_SQUARE_METRE, expected, rtol=0, atol=5e-7)


def test_single_precision_keeps_the_stated_bound_far_from_the_origin(pair: tuple[Clip, Clip]) -> None:
    far = moved(pair[1], 1.0, np.array([300.0, 0.0, -900.0]))
    a, b = clouds.point_cloud(pair[0]), clouds.point_cloud(far)
    exact = plain_distances(*pair, 8)
    energy = 0.0
    for cloud in (a, b):
        windows = np.lib.stride_tricks.sliding_window_view(cloud.centres, 8)
        spread = np.mean(np.abs(windows - windows.mean(axis=1, keepdims=True)) ** 2, axis=1).max()
        energy += spread + np.max(np.sum(np.abs(cloud.floor) ** 2 + cloud.weights * (cloud.heights - 1.0) ** 2, axis=1))
    bound = (len(a.weights) + 20) * 2.0**-24 * 1.5 * energy
    assert np.max(np.abs(clouds.window_distances(a, b, 8) - exact)) < bound < 1e-4


def test_tiles_do_not_show(pair: tuple[Clip, Clip], monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = (clouds.point_cloud(clip) for clip in pair)
    whole = clouds.window_distances(a, b, 5, precision="double")
    monkeypatch.setattr(clouds, "_TILE_ROWS", 7)
    monkeypatch.setattr(clouds, "_TILE_COLUMNS", 11)
    assert np.allclose(clouds.window_distances(a, b, 5, precision="double"), whole, rtol=0, atol=1e-14)
    part = clouds.window_distances(a, b, 5, rows=range(3, 30), columns=range(10, 56), precision="double")
    assert np.allclose(part, whole[3:30, 10:56], rtol=0, atol=1e-14)


def test_joint_weights_count(pair: tuple[Clip, Clip]) -> None:
    weights = np.array([0.0, 2.0, 1.0, 0.0, 0.5])
    a, b = (clouds.point_cloud(clip, weights) for clip in pair)
    expected = plain_distances(*pair, 4, weights)
    assert np.allclose(clouds.window_distances(a, b, 4, precision="double"), expected, rtol=0, atol=1e-13)


def test_turning_and_moving_a_clip_changes_nothing_and_the_distance_is_symmetric(pair: tuple[Clip, Clip]) -> None:
    elsewhere = clouds.point_cloud(moved(pair[1], 2.5, np.array([4.0, 0.0, -7.0])))
    a, b = (clouds.point_cloud(clip) for clip in pair)
    distances = clouds.window_distances(a, b, 10, precision="double")
    assert np.allclose(clouds.window_distances(a, elsewhere, 10, precision="double"), distances, rtol=0, atol=1e-12)
    assert np.allclose(clouds.window_distances(b, a, 10, precision="double").T, distances, rtol=0, atol=1e-13)


def test_a_window_is_nothing_away_from_itself(pair: tuple[Clip, Clip]) -> None:
    a = clouds.point_cloud(pair[0])
    counts = clouds.window_counts(a, a, 6, rows=range(4, 20), columns=range(2, 33))
    assert (np.diagonal(counts, 2)[:16] == 0).all()
    assert np.count_nonzero(counts == 0) == 16


def test_refusals(pair: tuple[Clip, Clip]) -> None:
    a, b = (clouds.point_cloud(clip) for clip in pair)
    with pytest.raises(TransitionError, match="window of 1 to 45 frames, which a has, got 46"):
        clouds.window_distances(a, b, 46)
    with pytest.raises(TransitionError, match="frames 0 to 55 of b"):
        clouds.window_distances(a, b, 5, columns=range(50, 57))
    with pytest.raises(TransitionError, match="Expected 5 joint weights"):
        clouds.point_cloud(pair[0], np.ones(4))
    other = clouds.point_cloud(pair[1], np.array([1.0, 1.0, 0.0, 0.0, 0.0]))
    with pytest.raises(TransitionError, match="same points, got 5 and 2"):
        clouds.window_distances(a, other, 5)
