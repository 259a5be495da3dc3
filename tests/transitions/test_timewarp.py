from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from walks import make_walk

from study.errors import TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, moved, sample
from study.transitions.blend_length import geodesic_costs
from study.transitions.blending import blend
from study.transitions.timewarp import warp_costs, warp_length, warped_blend
from study.transitions.weights import joint_weights


def plain_cost(source: Clip, destination: Clip, i: int, j: int, b_from: int, b_to: int, weights: Any) -> Any:
    """2004 Eqs. 5 and 6 as printed, pose by pose, with slerp between frames; the sum, not the mean."""
    total = 0.0
    for t in range(1, max(b_from, b_to) + 1):
        if b_from <= b_to:
            at_source, at_destination = i + b_from * t / b_to - 1, j - b_to + t
        else:
            at_source, at_destination = i + t - 1, j - b_to + b_to * t / b_from
        # Where the division rounds, a time that should be whole is made whole.
        times = [round(time) if abs(time - round(time)) < 1e-9 else time for time in (at_source, at_destination)]
        a, b = sample(source, [times[0]]).rotations[0], sample(destination, [times[1]]).rotations[0]
        turn = quat.log(quat.multiply(quat.conjugate(b), a))
        total += float(weights @ np.sum(turn * turn, axis=-1))
    return total


@pytest.fixture(scope="module")
def pair() -> Any:
    return make_walk(60, phase=0.4), make_walk(60, phase=2.1, cadence=1.4, swing=0.7)


@pytest.mark.parametrize("average", [True, False])
def test_costs_are_those_of_the_plain_equations(pair: Any, average: bool) -> None:
    weights = joint_weights(pair[0].skeleton)
    costs = warp_costs(*pair, 20, 40, 9, weights, average=average, steepest=math.inf)
    for b_from in range(1, 10):
        for b_to in range(1, 10):
            expected = plain_cost(*pair, 20, 40, b_from, b_to, weights)
            expected /= max(b_from, b_to) if average else 1
            assert costs[b_from - 1, b_to - 1] == pytest.approx(expected, rel=1e-11, abs=1e-14), (b_from, b_to)


def test_long_windows_agree_at_a_sample_of_lengths() -> None:
    pair = make_walk(90, phase=0.4), make_walk(90, phase=2.1, cadence=1.4)
    weights = joint_weights(pair[0].skeleton)
    costs = warp_costs(*pair, 25, 70, 60, weights, average=False, steepest=math.inf)
    for b_from, b_to in ((60, 60), (1, 60), (60, 1), (37, 59), (59, 37), (47, 13)):
        assert costs[b_from - 1, b_to - 1] == pytest.approx(plain_cost(*pair, 25, 70, b_from, b_to, weights), rel=1e-11)


def test_equal_lengths_cost_what_the_geodesic_method_says(pair: Any) -> None:
    weights = joint_weights(pair[0].skeleton)
    warped = np.diag(warp_costs(*pair, 15, 45, 30, weights))
    np.testing.assert_allclose(warped, geodesic_costs(*pair, 15, 45, 30, weights), rtol=1e-12, atol=1e-15)


def _turned(a: list[float], b: list[float]) -> float:
    """Half the angle between two rotations, from their quaternions' cosine; plain Python."""
    return math.acos(min(1.0, abs(sum(x * y for x, y in zip(a, b, strict=True)))))


def _between(frames: list[list[float]], time: float) -> list[float]:
    """One joint's rotation at a time between two frames, by the formula of Shoemake 1985; plain Python."""
    first = min(math.floor(time + 1e-9), len(frames) - 1)
    share = max(0.0, time - first)
    a, b = frames[first], frames[min(first + 1, len(frames) - 1)]
    dot = sum(x * y for x, y in zip(a, b, strict=True))
    angle, sign = math.acos(min(1.0, abs(dot))), math.copysign(1.0, dot)
    if angle < 1e-9:
        return a
    left, right = math.sin((1 - share) * angle) / math.sin(angle), sign * math.sin(share * angle) / math.sin(angle)
    return [left * x + right * y for x, y in zip(a, b, strict=True)]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("steepest", [1.0, 1.5, 2.0, 12.0])
def test_the_search_finds_what_trying_every_pair_of_windows_finds(seed: int, steepest: float) -> None:
    """Every pose of every pair of windows within the slope, in plain Python that shares no code with the search."""
    rng = np.random.default_rng(seed)
    clips = [make_walk(50, phase=float(rng.uniform(0, 6)), cadence=float(rng.uniform(0.6, 1.6))) for _ in range(2)]
    start, end, longest = int(rng.integers(3, 30)), int(rng.integers(14, 45)), 12
    weights = {"hip.L": 1.0, "hip.R": 0.7, "shoulder.L": float(rng.uniform(0, 1)), "knee.R": 0.3}
    joints = {clips[0].skeleton.role(role): weight for role, weight in weights.items()}
    source, destination = ([clip.rotations[:, joint].tolist() for joint in joints] for clip in clips)
    costs = {}
    for b_from in range(1, longest + 1):
        for b_to in range(1, longest + 1):
            longer = max(b_from, b_to)
            if longer > steepest * min(b_from, b_to) + 1e-9:
                continue
            pairs = [(start - 1 + b_from * t / longer, end - b_to + b_to * t / longer) for t in range(1, longer + 1)]
            costs[b_from, b_to] = (
                sum(
                    weight * _turned(_between(a, at_source), _between(b, at_destination)) ** 2
                    for weight, a, b in zip(joints.values(), source, destination, strict=True)
                    for at_source, at_destination in pairs
                )
                / longer
            )
    found = warp_length(*clips, start, end, longest=longest, weights=weights, steepest=steepest)
    assert found.windows == min(costs, key=costs.__getitem__)
    assert found.cost == pytest.approx(min(costs.values()), rel=1e-7, abs=1e-10)
    assert int(np.isfinite(found.costs).sum()) == len(costs)


def test_neither_window_is_more_than_twice_as_long_as_the_other() -> None:
    """Standing meets walking as well in many frames as in few: without a bound it would be drawn out without end."""
    stand, walk = make_walk(100, swing=0.0), make_walk(100, phase=1.0)
    unbounded = warp_length(stand, walk, 20, 80, longest=40, steepest=math.inf)
    assert max(unbounded.windows) > 2 * min(unbounded.windows)
    bounded = warp_length(stand, walk, 20, 80, longest=40)
    assert max(bounded.windows) <= 2 * min(bounded.windows)
    assert bounded.cost >= unbounded.cost
    with pytest.raises(TransitionError, match=r"steepest slope of at least 1, got 0\.5"):
        warp_length(stand, walk, 20, 80, longest=9, steepest=0.5)


@pytest.mark.parametrize("windows", [(9, 18), (18, 9), (12, 17), (17, 12), (10, 10)])
def test_time_runs_on_within_a_warp_at_slopes_within_the_bound(windows: tuple[int, int]) -> None:
    """Two clips whose elbows turn like clocks, one at each side, show which of their moments each blended frame has."""
    rate = np.radians(2.0)
    base = make_walk(70, swing=0.0)
    moments = []
    for side, other, at in (("elbow.L", "elbow.R", 0), ("elbow.R", "elbow.L", 1)):
        joint, still = base.skeleton.role(side), base.skeleton.role(other)
        turned = base.rotations.copy()
        turned[:, still] = [1.0, 0.0, 0.0, 0.0]
        turned[:, joint] = quat.from_axis_angle([1.0, 0.0, 0.0], rate * np.arange(70.0))
        resting = base.rotations.copy()
        resting[:, [joint, still]] = [1.0, 0.0, 0.0, 0.0]
        clock, rest = replace(base, rotations=turned), replace(base, rotations=resting)
        made = warped_blend(*((clock, rest) if at == 0 else (rest, clock)), 25, 45, *windows)
        frames = slice(made.blend_start - 1, made.blend_stop + 1)
        angle = 2 * quat.half_angle_between(made.clip.rotations[frames, joint], resting[0, joint])
        share = np.linspace(0.0, 1.0, made.blend_frames + 2)
        seen = share if at else 1.0 - share
        # The source leaves from the frame before the blend, the destination arrives at the blend's last one.
        own = slice(1, -1) if at else slice(0, -1)
        moments.append(angle[own] / seen[own] / rate)
    slopes = [np.diff(each) for each in moments]
    longer = max(windows)
    for slope, frames in zip(slopes, windows, strict=True):
        assert slope.min() > 0
        np.testing.assert_allclose(slope, frames / longer, atol=1e-6)
    ratio = slopes[0].mean() / slopes[1].mean()
    assert 0.5 - 1e-6 <= ratio <= 2.0 + 1e-6


def test_another_tempo_of_the_same_motion_is_found() -> None:
    """The destination is the source at two thirds of its tempo: two source frames to three of the destination."""
    source, destination = make_walk(150, cadence=1.2), make_walk(150, cadence=0.8)
    # Source frame i - 1 + s is at phase 1.2 (i - 1 + s), destination frame j - b + t at 0.8 (j - b + t): equal for
    # i = 31, j = 90, b_from = 30, b_to = 45, in all frames.
    found = warp_length(source, destination, 31, 90, longest=60)
    assert found.source_frames * 3 == found.destination_frames * 2
    assert found.cost < 1e-5
    assert (found.blend_frames, found.blend_s) == (45, 1.5)


def test_the_printed_sum_favours_short_blends(pair: Any) -> None:
    mean = warp_length(*pair, 20, 40, longest=15)
    printed = warp_length(*pair, 20, 40, longest=15, average=False)
    assert printed.blend_frames <= mean.blend_frames
    assert printed.cost <= mean.cost * mean.blend_frames


def test_where_the_clips_stand_changes_nothing(pair: Any) -> None:
    turned = moved(pair[1], np.radians(170), np.array([1.0, 0.0, 2.0]))
    assert warp_length(*pair, 20, 40, longest=12).cost == warp_length(pair[0], turned, 20, 40, longest=12).cost


def test_equal_lengths_blend_as_without_a_warp(pair: Any) -> None:
    plain, warped = blend(*pair, 20, 40, 12), warped_blend(*pair, 20, 40, 12, 12)
    np.testing.assert_allclose(warped.clip.root_positions, plain.clip.root_positions, atol=1e-12)
    np.testing.assert_allclose(quat.half_angle_between(warped.clip.rotations, plain.clip.rotations), 0, atol=1e-7)
    assert (warped.blend_start, warped.blend_stop) == (plain.blend_start, plain.blend_stop)
    assert warped.source_frames == plain.source_frames
    assert warped.destination_frames == plain.destination_frames


@pytest.mark.parametrize(("b_from", "b_to"), [(10, 20), (20, 10), (1, 15), (15, 1), (18, 28)])
def test_a_warped_blend_takes_the_longer_time_and_keeps_the_rest(b_from: int, b_to: int) -> None:
    source, destination = make_walk(100), make_walk(100, phase=2.0)
    result = warped_blend(source, destination, 40, 60, b_from, b_to, weight="sigmoid")
    assert result.blend_frames == max(b_from, b_to) == result.blend_stop - result.blend_start
    assert result.source_frames == (40, 40 + b_from)
    assert result.destination_frames == (61 - b_to, 61)
    assert result.clip.frames == 40 + result.blend_frames + 39
    np.testing.assert_array_equal(result.clip.rotations[:40], source.rotations[:40])
    tail = moved(destination, result.alignment.yaw, np.array(result.alignment.translation))
    np.testing.assert_allclose(result.clip.root_positions[result.blend_stop :], tail.root_positions[61:], atol=1e-12)
    # A window played slower moves slower; the root never goes back or jumps.
    speed = np.linalg.norm(np.diff(result.clip.root_positions[:, [0, 2]], axis=0), axis=1) * 30
    assert speed.max() < 1.3
    assert speed.min() > 0


def test_frames_that_are_not_there_are_counted(pair: Any) -> None:
    with pytest.raises(TransitionError, match="the source lacks 1 frame before its first"):
        warp_length(*pair, 0, 40, longest=5)
    with pytest.raises(
        TransitionError,
        match=r"the source lacks 5 frames after its last \(needs .*\); the destination lacks 5 frames before its first",
    ):
        warp_length(*(replace(clip, fps=600.0) for clip in pair), 45, 15)
    with pytest.raises(TransitionError, match="lacks 7 frames before its first"):
        warped_blend(*pair, 20, 3, 5, 10)
    with pytest.raises(TransitionError, match="at least 1 frame of each clip in a blend, got 0 and 4"):
        warped_blend(*pair, 20, 40, 0, 4)
    held = warp_length(*pair, 45, 15, longest=20)
    assert held.costs.shape == (15, 15)
    assert "up to 15 frames; 20 were asked for" in held.note
