from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from programs import program
from walks import make_walk

from study.errors import TransitionError
from study.motion.clip import Clip, moved, resample, trim
from study.transitions.blend_length import (
    BlendLength,
    fixed_length,
    geodesic_costs,
    geodesic_length,
    joint_costs,
    joint_speed,
    major_joint_differences,
    velocity_length,
)
from study.transitions.distances import frame_distance
from study.transitions.weights import joint_weights
from study.transitions.windows import SPECIFICATIONS, longest_available, shortfall, window

LENGTHS = (geodesic_length, velocity_length, fixed_length)


def test_costs_are_those_of_the_plain_equations() -> None:
    oracle = program("benchmarks/blend_length")
    source, destination = make_walk(60, phase=0.4), make_walk(60, phase=2.1, cadence=1.3, swing=0.7)
    weights = joint_weights(source.skeleton)
    fast = geodesic_costs(source, destination, 7, 50, 40, weights)
    plain = oracle.plain_costs(source, destination, 7, 50, 40, weights)
    np.testing.assert_allclose(fast, plain, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(
        oracle.vectorised_costs(source, destination, 7, 50, 40, weights), plain, rtol=1e-12, atol=1e-15
    )


@pytest.mark.parametrize("specification", SPECIFICATIONS)
def test_every_specification_averages_over_its_own_window(specification: str) -> None:
    source, destination = make_walk(80, phase=0.4), make_walk(80, phase=2.1, swing=0.7)
    weights = joint_weights(source.skeleton)
    costs = geodesic_costs(source, destination, 30, 40, 31, weights, specification)
    for length in (1, 2, 7, 30, 31):
        span = window(30, 40, length, specification)
        a = source.rotations[span.source_start : span.source_stop]
        b = destination.rotations[span.destination_start : span.destination_stop]
        assert costs[length - 1] == pytest.approx(float(np.mean(frame_distance(a, b, weights))), rel=1e-12)


def test_one_cycle_in_phase_is_found() -> None:
    """Destination and source are one motion, shifted: the length that brings them into phase costs nothing."""
    walk = make_walk(150, cadence=1.0)
    found = geodesic_length(walk, walk, 40, 60)
    # b = j - i + 1 pairs each frame with itself; a cycle of 30 frames more or less does so as well.
    assert found.blend_frames in (21, 51)
    assert found.cost == pytest.approx(0.0, abs=1e-15)
    assert found.lengths is not None
    assert found.costs is not None
    assert (found.lengths[0], found.lengths[-1], len(found.costs)) == (1, 60, 60)
    assert found.blend_s == found.blend_frames / 30


def test_joint_costs_add_up_to_the_cost() -> None:
    source, destination = make_walk(80), make_walk(80, phase=2.0)
    weights = joint_weights(source.skeleton)
    each = joint_costs(source, destination, 10, 70, 60, np.arange(source.skeleton.joints))
    assert each.shape == (source.skeleton.joints, 60)
    np.testing.assert_allclose(weights @ each, geodesic_costs(source, destination, 10, 70, 60, weights), rtol=1e-12)


def test_lengths_do_not_depend_on_where_the_clips_stand() -> None:
    source, destination = make_walk(100), make_walk(100, phase=2.0)
    turned = moved(destination, np.radians(170), np.array([5.0, 0.0, 2.0]))
    for length in LENGTHS:
        plain, moved_one = (length(source, clip, 20, 80) for clip in (destination, turned))
        assert (plain.blend_frames, plain.cost) == (moved_one.blend_frames, moved_one.cost)


def test_the_range_is_in_seconds_at_any_frame_rate() -> None:
    walk = make_walk(600, fps=120.0)
    at_60 = geodesic_length(resample(walk, 60), resample(walk, 60), 150, 150)
    assert at_60.lengths is not None
    assert (at_60.lengths[0], at_60.lengths[-1]) == (2, 120)
    assert fixed_length(walk, walk, 300, 300).blend_frames == 40
    assert fixed_length(resample(walk, 30), resample(walk, 30), 75, 75).blend_frames == 10


def test_geodesic_and_velocity_give_the_same_seconds_at_twice_the_rate() -> None:
    source, destination = make_walk(600, fps=60.0), make_walk(600, fps=60.0, phase=2.0)
    for length in (geodesic_length, velocity_length):
        fine = length(source, destination, 200, 400)
        coarse = length(resample(source, 30), resample(destination, 30), 100, 200)
        assert coarse.blend_s == pytest.approx(fine.blend_s, abs=1.5 / 30)


def test_velocity_divides_the_largest_difference_by_that_joints_mean_speed() -> None:
    source, destination = make_walk(100, phase=0.2), make_walk(100, phase=2.5, swing=0.8)
    found = velocity_length(source, destination, 30, 70)
    differences = major_joint_differences(source, destination, 30, 70)
    assert found.joint == max(differences, key=lambda role: differences[role])
    joint = source.skeleton.role(found.joint)
    speed = 0.5 * (joint_speed(source, 30, joint) + joint_speed(destination, 70, joint))
    assert found.unclipped_s == pytest.approx(differences[found.joint] / speed)
    assert found.blend_frames == round(found.unclipped_s * 30)


def test_the_velocity_method_says_that_it_clips_only_where_it_does() -> None:
    for frames in (1, 30):  # at rates at which the same seconds are few frames and many
        source, destination = make_walk(100, phase=0.2), make_walk(100, phase=2.5, swing=0.8)
        found = velocity_length(replace(source, fps=frames * 30.0), replace(destination, fps=frames * 30.0), 30, 70)
        low, high = 0.03 * frames * 30, 2.0 * frames * 30
        assert ("clipped" in found.note) == (not low - 0.5 <= found.unclipped_s * frames * 30 <= high + 0.5)


def test_joint_speed_is_half_the_angular_speed() -> None:
    walk = make_walk(301, fps=300.0, cadence=0.5, swing=0.4)
    hip = walk.skeleton.role("hip.L")
    for frame in (0, 150, 300):
        # angle = 0.4 sin(pi t), so its speed is 0.4 pi |cos(pi t)|
        expected = 0.5 * 0.4 * np.pi * abs(np.cos(np.pi * frame / 300))
        assert joint_speed(walk, frame, hip) == pytest.approx(expected, abs=2e-3)


def test_joints_that_stand_still_clip_the_velocity_method_and_it_says_so() -> None:
    walk = make_walk(100)
    still = Clip(
        walk.skeleton, np.tile(walk.root_positions[:1], (100, 1)), np.tile(walk.rotations[:1], (100, 1, 1)), 30
    )
    other = Clip(walk.skeleton, still.root_positions, np.tile(walk.rotations[8:9], (100, 1, 1)), 30)
    long = velocity_length(still, other, 20, 80)
    assert long.blend_frames == 60
    assert "outside 1 to 60 frames; clipped to 60" in long.note
    equal = velocity_length(still, still, 20, 80)
    assert equal.blend_frames == 1
    assert "clipped to 1" in equal.note
    many = 58 * 30.0  # frames a second, at which the shortest blend takes 58
    moving = velocity_length(replace(walk, fps=many), replace(make_walk(100, swing=0.01), fps=many), 20, 80)
    assert moving.blend_frames == 58
    assert "clipped to 58" in moving.note


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        ((50, 90), "the source short lacks 10 frames after its last"),
        ((30, 39), "the destination long lacks 20 frames before its first"),
        ((50, 39), "source short lacks 10 .*; the destination long lacks 20 "),
        ((100, 90), "start frame from 0 to 99 in the source short, got 100"),
        ((50, -1), "end frame from 0 to 99 in the destination long, got -1"),
    ],
)
@pytest.mark.parametrize("length", [geodesic_length, fixed_length])
def test_what_the_clips_cannot_supply_is_counted(
    frames: tuple[int, ...], message: str, length: Callable[..., BlendLength]
) -> None:
    """At 1800 frames a second the shortest blend takes 60 frames."""
    with pytest.raises(TransitionError, match=message):
        length(make_walk(100, 1800.0, name="short"), make_walk(100, 1800.0, name="long"), *frames)


def test_candidates_are_held_to_what_there_is() -> None:
    walk = make_walk(100)
    found = geodesic_length(walk, walk, 80, 90)
    assert found.lengths is not None
    assert found.lengths[-1] == 20
    assert "up to 20 frames; 60 were asked for" in found.note
    fixed = fixed_length(walk, walk, 95, 90)
    assert (fixed.blend_frames, fixed.note) == (5, "the clips supply blends of up to 5 frames; 10 were asked for")
    for length in LENGTHS:
        assert length(walk, walk, 99, 0).blend_frames == 1
    with pytest.raises(TransitionError, match=r"blends of up to 30 frames .* source lacks 10 frames after its last"):
        geodesic_length(*[make_walk(100, 900.0)] * 2, 80, 90)


def test_the_velocity_methods_length_is_held_too_and_says_what_it_gave() -> None:
    source, destination = make_walk(100), make_walk(100, phase=2.0)
    free = velocity_length(source, destination, 40, 67)
    assert 5 < free.blend_frames < 60
    cut = trim(source, 0, 40 + free.blend_frames - 3)
    held = velocity_length(cut, destination, 40, 67)
    assert held.blend_frames == free.blend_frames - 3
    assert held.unclipped_s == pytest.approx(free.unclipped_s)
    assert f"blends of up to {held.blend_frames} frames; {free.blend_frames} were asked for" in held.note


@pytest.mark.parametrize("fps", [24.0, 30.0, 60.0, 120.0])
def test_the_fixed_length_is_a_third_of_a_second_at_any_rate(fps: float) -> None:
    walk = make_walk(400, fps)
    assert fixed_length(walk, walk, 100, 300).blend_frames == round(fps / 3)


@pytest.mark.parametrize("specification", SPECIFICATIONS)
def test_the_longest_available_is_the_longest_without_shortfall(specification: str) -> None:
    source, destination = make_walk(30), make_walk(40)
    for i, j in ((0, 0), (5, 33), (29, 39), (14, 20), (0, 39)):
        longest = longest_available(source, destination, i, j, specification)
        fits = [b for b in range(1, 60) if not shortfall(source, destination, window(i, j, b, specification))]
        assert fits == list(range(1, longest + 1))


def test_options_that_are_not_known_are_refused() -> None:
    walk = make_walk(150)
    with pytest.raises(TransitionError, match="a longest blend of at least 1 frame, got 0"):
        geodesic_length(walk, walk, 70, 80, longest=0)
    with pytest.raises(TransitionError, match="specification of start-end, centre, left, got 'right'"):
        geodesic_length(walk, walk, 70, 80, specification="right")
    with pytest.raises(TransitionError, match="at least 1 frame, got 0"):
        fixed_length(walk, walk, 70, 80, 0)


def test_trimming_away_unused_frames_changes_nothing() -> None:
    source, destination = make_walk(150), make_walk(150, phase=2.0)
    whole = geodesic_length(source, destination, 50, 100)
    part = geodesic_length(trim(source, 50, 110), trim(destination, 41, 101), 0, 59)
    assert whole.costs is not None
    assert part.costs is not None
    np.testing.assert_allclose(whole.costs, part.costs, rtol=1e-13)
