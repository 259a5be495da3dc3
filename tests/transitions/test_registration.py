"""Registration curves: paths by brute force, curves by closed form, and warped walks that come back into step."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.interpolate import BSpline

from study.errors import TransitionError
from study.motion.clip import joint_positions, sample
from study.motion.synthetic import synthesize
from study.transitions.blending import blend
from study.transitions.registration import STEEPEST, least_path, smooth_lead
from study.transitions.timewarp import warped_blend


def cheapest(distances: np.ndarray) -> float:
    """The least mean distance of all paths, by trying every sequence of steps."""
    last, best = len(distances) - 1, np.inf
    for count in range(1, last + 1):
        for steps in itertools.product(((1, 1), (1, 2), (2, 1)), repeat=count):
            places = np.cumsum(steps, axis=0)
            if tuple(places[-1]) == (last, last):
                cost = sum((a + b) * distances[tuple(place)] for (a, b), place in zip(steps, places, strict=True))
                best = min(best, cost)
    return float(best)


def cost_of(path: np.ndarray, distances: np.ndarray) -> float:
    places = np.rint(path * (len(distances) - 1)).astype(int)
    return float(sum((b - a).sum() * distances[tuple(b)] for a, b in itertools.pairwise(places)))


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("poses", [2, 3, 6, 8])
def test_no_path_costs_less(seed: int, poses: int) -> None:
    distances = np.random.default_rng(seed).random((poses, poses))
    path = least_path(distances)
    np.testing.assert_array_equal(path[[0, -1]], [[0, 0], [1, 1]])
    assert cost_of(path, distances) == pytest.approx(cheapest(distances))


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("count", [6, 13, 30, 60])
def test_curves_are_smooth_strictly_increasing_and_level_at_the_ends(seed: int, count: int) -> None:
    lead = smooth_lead(least_path(np.random.default_rng(seed).random((count + 1, count + 1))), count)
    ends, fine = np.array([0.0, 1.0]), np.linspace(0.0, 1.0, 20 * count + 1)
    slope = BSpline.construct_fast(
        np.linspace(0.0, 1.0, len(lead.slopes) + 2)[[0, *range(len(lead.slopes) + 2), -1]],
        np.array([0.0, *lead.slopes, 0.0]),
        1,
    )
    np.testing.assert_allclose(lead.at(fine), slope.antiderivative()(fine), atol=1e-12)
    np.testing.assert_allclose([lead.at(ends), slope(ends)], 0.0, atol=1e-12)
    ahead, behind = 1.0 + 0.5 * slope(fine), 1.0 - 0.5 * slope(fine)
    assert min(ahead.min(), behind.min()) > 0.0
    assert np.max([ahead / behind, behind / ahead]) <= STEEPEST + 1e-12


def test_a_known_warp_is_found() -> None:
    """Two signals, one of which runs ahead by 0.06 sin^2(pi t): the curve's lead is what brings them together."""
    even = np.linspace(0.0, 1.0, 61)
    early = even + 0.06 * np.sin(np.pi * even) ** 2
    lead = smooth_lead(least_path(np.abs(np.subtract.outer(np.sin(7 * even), np.sin(7 * early)))), 60).at(even)
    source, destination = even - 0.5 * lead, even + 0.5 * lead
    np.testing.assert_allclose(source, np.interp(destination, even, early), atol=0.012)


def test_a_walk_and_the_same_walk_out_of_step_are_brought_into_step() -> None:
    walk = synthesize("walk", seconds=6.0)
    times = np.arange(walk.frames, dtype=float)
    uneven = sample(walk, times + 3.0 * np.sin(np.pi * np.clip((times - 59) / 40, 0, 1)) ** 2 * (times < 100))
    fine = sample(walk, np.arange(55.0, 105.0, 0.05))
    own = joint_positions(fine) - fine.root_positions[:, None]
    apart = {}
    for name, made in (
        ("in step", warped_blend(walk, uneven, 60, 99, 40, 40, in_step=True)),
        ("evenly", blend(walk, uneven, 60, 99, 40)),
    ):
        assert (made.blend_start, made.blend_stop, made.clip.frames) == (60, 100, walk.frames)
        positions = joint_positions(made.clip) - made.clip.root_positions[:, None]
        # How far every blended pose is from the nearest pose of the walk, at any time.
        apart[name] = max(np.linalg.norm(own - positions[frame], axis=-1).max(axis=1).min() for frame in range(60, 100))
    assert apart["in step"] < 0.6 * apart["evenly"]


def test_the_rest_is_the_clips_own_and_speeds_run_over_without_a_jump() -> None:
    walk, run = synthesize("walk", seconds=6.0), synthesize("run", seconds=6.0)
    made = warped_blend(walk, run, 60, 100, 30, 30, in_step=True)
    np.testing.assert_array_equal(made.clip.rotations[:60], walk.rotations[:60])
    np.testing.assert_allclose(
        np.abs(np.sum(made.clip.rotations[90:, 1:] * run.rotations[101:, 1:], axis=-1)), 1.0, atol=1e-12
    )
    bends = np.linalg.norm(np.diff(made.clip.root_positions, n=2, axis=0), axis=-1)
    own = max(np.linalg.norm(np.diff(clip.root_positions, n=2, axis=0), axis=-1).max() for clip in (walk, run))
    assert bends[[57, 58, 59, 87, 88, 89]].max() < 1.2 * own


@pytest.mark.parametrize("frames", [1, 2, 5])
def test_short_windows_have_no_room_for_a_curve(frames: int) -> None:
    walk, run = synthesize("walk", seconds=4.0), synthesize("run", seconds=4.0)
    made = warped_blend(walk, run, 40, 60, frames, frames, in_step=True)
    plain = blend(walk, run, 40, 60, frames)
    np.testing.assert_allclose(made.clip.rotations, plain.clip.rotations, atol=1e-9)
    np.testing.assert_allclose(made.clip.root_positions, plain.clip.root_positions, atol=1e-9)


def test_a_window_needs_a_frame_before_it() -> None:
    walk = synthesize("walk", seconds=2.0)
    with pytest.raises(TransitionError, match="lacks 1 frame before its first"):
        warped_blend(walk, walk, 0, 40, 20, 20, in_step=True)
