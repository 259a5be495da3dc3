from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from study.errors import MotionError, TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, global_rotations, joint_positions, moved
from study.motion.legs import reach
from study.motion.synthetic import synthesize
from study.transitions.blending import blend, cut
from study.transitions.footskate import (
    find_contacts,
    foot_slide,
    plant_feet,
    planted_points,
    remove_foot_slide,
    transition_contacts,
)
from study.transitions.timewarp import warped_blend


@pytest.fixture(scope="module")
def slider(make_walk: Callable[..., Clip]) -> Clip:
    """Ninety frames of bent legs that glide along at 0.2 m/s without lifting the feet."""
    walk = make_walk(90, speed=0.2, swing=0.0)
    rotations = walk.rotations.copy()
    rotations[:, 0] = quat.IDENTITY
    for side in "LR":
        rotations[:, walk.skeleton.role(f"hip.{side}")] = quat.from_axis_angle([1.0, 0.0, 0.0], -0.4)
        rotations[:, walk.skeleton.role(f"knee.{side}")] = quat.from_axis_angle([1.0, 0.0, 0.0], 0.8)
    positions = walk.root_positions.copy()
    positions[:, 1] = 0.85
    return replace(walk, root_positions=positions, rotations=rotations)


def knee_bend(clip: Clip, side: Any) -> Any:
    """Signed angle of the knee, radians, positive where it bends the way knees do (about the line of the hips)."""
    positions = joint_positions(clip)
    hip, knee, ankle = (positions[:, clip.skeleton.role(f"{part}.{side}")] for part in ("hip", "knee", "ankle"))
    left = positions[:, clip.skeleton.role("hip.L")] - positions[:, clip.skeleton.role("hip.R")]
    normal = np.cross(knee - hip, ankle - knee)
    return np.arctan2(
        np.sign(np.sum(normal * left, axis=1)) * np.linalg.norm(normal, axis=1),
        np.sum((knee - hip) * (ankle - knee), axis=1),
    )


def test_contacts_start_low_and_slow_and_last_while_fairly_so(slider: Clip) -> None:
    speed = np.zeros(90)
    speed[20:30], speed[30:40], speed[40:] = 0.2, 0.5, 0.9  # m/s: planted, held, swinging
    positions = slider.root_positions.copy()
    positions[:, 2] = np.concatenate([[0.0], np.cumsum(speed[1:])]) / 30
    gliding = replace(slider, root_positions=positions)
    contacts = find_contacts(gliding)
    assert contacts[:39].all()
    assert not contacts[42:].any()
    # Fairly slow alone starts no contact.
    positions[:, 2] = np.arange(90) * 0.5 / 30
    assert not find_contacts(replace(slider, root_positions=positions)).any()


def test_a_foot_that_is_high_is_not_planted(slider: Clip) -> None:
    rotations = slider.rotations.copy()
    raised = slice(40, 60)
    rotations[raised, slider.skeleton.role("hip.L")] = quat.from_axis_angle([1.0, 0.0, 0.0], -1.0)
    contacts = find_contacts(replace(slider, rotations=rotations))
    assert not contacts[raised, 0].any()
    assert contacts[raised, 1].all()


def test_slide_is_the_way_that_planted_feet_go(slider: Clip) -> None:
    contacts = np.ones((90, 2), dtype=bool)
    slide, seconds = foot_slide(slider, contacts)
    assert slide == pytest.approx(2 * 89 * 0.2 / 30)
    assert seconds == pytest.approx(2 * 89 / 30)
    contacts[45] = False  # two steps fewer, of each foot
    assert foot_slide(slider, contacts)[0] == pytest.approx(2 * 87 * 0.2 / 30)


def test_planted_feet_stand_still_and_nothing_pops(slider: Clip) -> None:
    contacts = np.zeros((90, 2), dtype=bool)
    contacts[20:50, 0] = contacts[45:70, 1] = True
    result = remove_foot_slide(slider, contacts)
    assert result.slide_before_m == pytest.approx((29 + 24) * 0.2 / 30)
    assert result.slide_after_m < 1e-4
    assert result.slide_after_m_per_s < 1e-4
    points = planted_points(result.clip)
    np.testing.assert_allclose(points[20:50, 0, [0, 2]], np.tile(points[20, 0, [0, 2]], (30, 1)), atol=2e-5)
    # The foot moves 10 cm back to its course over the release: at a smoothstep's 1.5 times the mean speed, no more.
    speed = np.linalg.norm(np.diff(points, axis=0), axis=-1) * 30
    assert speed.max() < 0.2 + 1.6 * 0.1 / 0.2
    steps = quat.half_angle_between(result.clip.rotations[1:], result.clip.rotations[:-1])
    assert np.max(np.abs(np.diff(steps, axis=0))) < 0.05
    # Frames away from contacts and their easing are untouched; so is every joint but those of the legs.
    np.testing.assert_array_equal(result.clip.rotations[:14], slider.rotations[:14])
    legs = {slider.skeleton.role(f"{part}.{side}") for part in ("hip", "knee", "ankle") for side in "LR"}
    others = [joint for joint in range(slider.skeleton.joints) if joint not in legs]
    np.testing.assert_array_equal(result.clip.rotations[:, others], slider.rotations[:, others])
    assert "foot slide reduced from" in result.clip.history[-1]


def test_the_foot_keeps_its_rotation_in_the_world(slider: Clip) -> None:
    shifts = np.zeros((90, 2, 3))
    shifts[30:40, 0] = [0.02, 0.0, 0.05]
    done = reach(slider, shifts)
    ankle = slider.skeleton.role("ankle.L")
    np.testing.assert_allclose(
        quat.half_angle_between(global_rotations(done)[:, ankle], global_rotations(slider)[:, ankle]), 0.0, atol=1e-9
    )
    expected = joint_positions(slider)[:, ankle] + shifts[:, 0]
    np.testing.assert_allclose(joint_positions(done)[:, ankle], expected, atol=1e-6)


@pytest.mark.parametrize("distance", [0.1, 0.3, 0.6, 3.0])
@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (0.0, 0.5, 0.0)])
def test_knees_are_neither_inverted_nor_overstretched(
    slider: Clip, distance: float, direction: tuple[float, ...]
) -> None:
    shifts = np.zeros((90, 2, 3))
    shifts[:, 0] = distance * np.array(direction) * np.sin(np.linspace(0, np.pi, 90))[:, None]
    done = reach(slider, shifts)
    bend = knee_bend(done, "L")
    assert bend.min() > 0.1  # 0.995 of the leg's length leaves 11 degrees
    assert bend.max() < 2.61
    assert np.max(np.abs(np.diff(bend))) < 0.5
    root_drop = slider.root_positions[:, 1] - done.root_positions[:, 1]
    assert root_drop.min() >= 0.0
    assert root_drop.max() <= 0.03 + 1e-12


def test_a_straight_leg_bends_forward_at_the_knee(make_walk: Callable[..., Clip]) -> None:
    """Knees that are straight in every frame have no plane of their own; the line of the hips gives the axis."""
    still = make_walk(40, speed=0.0, swing=0.0)
    shifts = np.zeros((40, 2, 3))
    shifts[:, 0, 1] = 0.1 * np.sin(np.linspace(0, np.pi, 40)) ** 2
    done = reach(still, shifts)
    assert knee_bend(done, "L").min() > -1e-6
    assert np.degrees(knee_bend(done, "L").max()) > 40
    ankle = still.skeleton.role("ankle.L")
    np.testing.assert_allclose(
        joint_positions(done)[5:35, ankle], (joint_positions(still)[:, ankle] + shifts[:, 0])[5:35], atol=2e-3
    )


def test_a_transition_keeps_the_feet_where_source_and_destination_had_them(make_walk: Callable[..., Clip]) -> None:
    source, destination = make_walk(120, speed=0.9), make_walk(120, speed=1.4, phase=1.0)
    raw = blend(source, destination, 50, 80, 20)
    planted, result = plant_feet(raw, source, destination)
    assert result.slide_after_m <= 0.2 * result.slide_before_m
    assert result.slide_after_m_per_s < 0.01
    assert planted.blend_start == raw.blend_start
    np.testing.assert_array_equal(
        planted.clip.rotations[: raw.blend_start - 7], raw.clip.rotations[: raw.blend_start - 7]
    )
    assert "foot slide reduced" in planted.note
    contacts = transition_contacts(raw, source, destination)
    np.testing.assert_array_equal(contacts[: raw.blend_start], find_contacts(source)[: raw.blend_start])
    after = find_contacts(destination)[raw.destination_frames[1] :]
    np.testing.assert_array_equal(contacts[raw.blend_stop :], after)


@pytest.mark.parametrize("lengths", [(12, 24), (24, 12)])
def test_a_time_warped_blend_knows_its_clips_contacts(make_walk: Callable[..., Clip], lengths: tuple[int, ...]) -> None:
    source, destination = make_walk(120, speed=0.9), make_walk(120, speed=0.9, phase=1.0)
    raw = warped_blend(source, destination, 50, 80, *lengths)
    contacts = transition_contacts(raw, source, destination)
    own = find_contacts(source)[50 : 50 + lengths[0]], find_contacts(destination)[81 - lengths[1] : 81]
    slowed = [np.repeat(known, 24 // len(known), axis=0) for known in own]
    assert np.all(contacts[50:74] >= (slowed[0] & slowed[1]))
    planted, result = plant_feet(raw, source, destination)
    assert result.slide_after_m <= 0.2 * result.slide_before_m
    assert planted.source_frames == (50, 50 + lengths[0])


def test_feet_planted_before_the_region_stay_and_the_frames_before_it_are_untouched(slider: Clip) -> None:
    contacts = np.zeros((90, 2), dtype=bool)
    contacts[10:50, 0] = True
    result = remove_foot_slide(slider, contacts, (30, 60))
    np.testing.assert_array_equal(result.clip.rotations[:30], slider.rotations[:30])
    np.testing.assert_array_equal(result.clip.root_positions[:30], slider.root_positions[:30])
    points = planted_points(result.clip)[:, 0]
    np.testing.assert_allclose(points[30:50, [0, 2]], np.tile(points[29, [0, 2]], (20, 1)), atol=2e-5)
    contacts = np.zeros((90, 2), dtype=bool)
    contacts[40:80, 1] = True
    result = remove_foot_slide(slider, contacts, (30, 60))
    np.testing.assert_array_equal(result.clip.rotations[60:], slider.rotations[60:])
    points = planted_points(result.clip)[:, 1]
    np.testing.assert_allclose(points[40:60, [0, 2]], np.tile(points[60, [0, 2]], (20, 1)), atol=2e-5)


def test_a_foot_that_comes_down_just_after_the_start_stays_where_it_came_down(slider: Clip) -> None:
    contacts = np.zeros((90, 2), dtype=bool)
    contacts[32:70, 0] = True
    result = remove_foot_slide(slider, contacts, (30, 60))
    np.testing.assert_array_equal(result.clip.rotations[:33], slider.rotations[:33])
    points = planted_points(result.clip)[:, 0]
    np.testing.assert_allclose(points[32:70, [0, 2]], np.tile(points[32, [0, 2]], (38, 1)), atol=2e-5)
    assert np.max(np.abs(np.diff(points[:, 2]))) * 30 < 3.0


def test_where_the_clip_stands_does_not_matter(slider: Clip) -> None:
    contacts = np.zeros((90, 2), dtype=bool)
    contacts[20:50, 0] = True
    here = remove_foot_slide(slider, contacts)
    there = remove_foot_slide(moved(slider, 2.0, np.array([3.0, 0.0, 1.0])), contacts)
    expected = moved(here.clip, 2.0, np.array([3.0, 0.0, 1.0]))
    np.testing.assert_allclose(joint_positions(there.clip), joint_positions(expected), atol=1e-9)


def test_what_cannot_be_planted_is_refused(slider: Clip) -> None:
    with pytest.raises(MotionError, match=r"shape \(90, 2\), got \(10, 2\)"):
        remove_foot_slide(slider, np.zeros((10, 2), dtype=bool))
    with pytest.raises(MotionError, match="region within frames 0 to 90, got 60 to 95"):
        remove_foot_slide(slider, region=(60, 95))
    with pytest.raises(TransitionError, match="a cut has no blended frames"):
        plant_feet(cut(slider, slider, 20, 40), slider, slider)


def test_a_foot_that_no_leg_can_hold_takes_a_step() -> None:
    """From standing into a walk over a long blend: the body is away before the feet of the stance may lift."""
    source, destination = synthesize("stand", seconds=4.0), synthesize("walk", seconds=6.0)
    joined = blend(source, destination, 40, 96, 40)
    known = transition_contacts(joined, source, destination)
    planted, found = plant_feet(joined, source, destination)
    assert found.slide_after_m < 0.01
    assert found.slide_after_m_per_s < 0.01
    stepping = known & ~found.contacts
    assert stepping.any(), "a step was put in"
    assert not (found.contacts & ~known).any(), "nothing is planted that was not"
    assert not stepping[: joined.blend_start].any()
    height = planted_points(planted.clip)[..., 1]
    before = planted_points(joined.clip)[..., 1]
    for foot in range(2):
        frames = np.flatnonzero(stepping[:, foot])
        if len(frames):
            assert 0.01 < np.max(height[frames, foot] - before[frames, foot]) < 0.09, "lifted, and not high"
    steps = quat.half_angle_between(planted.clip.rotations[1:], planted.clip.rotations[:-1])
    own = max(
        np.max(quat.half_angle_between(clip.rotations[1:], clip.rotations[:-1])) for clip in (source, destination)
    )
    assert np.max(steps[joined.blend_start - 2 : joined.blend_stop + 2]) < 1.5 * own
