from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from walks import make_walk

from study.errors import TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, global_rotations, joint_positions, moved, trim
from study.motion.feet import toes
from study.motion.legs import lowered, reach
from study.motion.synthetic import synthesize
from study.transitions.blending import Transition, blend, cut
from study.transitions.flaws import find_flaws
from study.transitions.footskate import plant_feet
from study.transitions.support import find_support
from study.transitions.timewarp import warped_blend


@pytest.fixture(scope="module")
def slider() -> Clip:
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


def still(slider: Clip, ahead_m: float = 0.0) -> Clip:
    """The bent legs at rest, with the left foot so much further ahead (and the right one behind)."""
    rotations = np.tile(slider.rotations[:1], (90, 1, 1))
    for side, sign in (("L", 1.0), ("R", -1.0)):
        hip = slider.skeleton.role(f"hip.{side}")
        rotations[:, hip] = quat.from_axis_angle([1.0, 0.0, 0.0], -0.4 - sign * ahead_m / 2 / 0.8)
    positions = np.tile([0.0, 0.85, 0.0], (90, 1))
    clip = replace(slider, root_positions=positions, rotations=rotations)
    # Both stances stand on one floor.
    return replace(clip, root_positions=positions - [0.0, toes(clip)[0, :, 1].min() - toes(slider)[0, 0, 1], 0.0])


def with_root(made: Transition, moves: Any) -> Transition:
    """The transition with its root moved by `moves (blend_frames, 3)`, and what follows as the last of them."""
    positions = made.clip.root_positions.copy()
    positions[made.blend_start : made.blend_stop] += moves
    positions[made.blend_stop :] += moves[-1] * [1.0, 0.0, 1.0]
    return replace(made, clip=replace(made.clip, root_positions=positions))


def speeds(clip: Clip) -> Any:
    return np.linalg.norm(np.diff(toes(clip)[..., [0, 2]], axis=0), axis=-1) * clip.fps


@pytest.mark.parametrize("blend_frames", [1, 10, 30])
def test_a_blend_of_a_walk_with_itself_in_phase_needs_nothing(blend_frames: int) -> None:
    walk = synthesize("walk", seconds=5.0)
    made = blend(walk, walk, 60, 59 + blend_frames, blend_frames)
    np.testing.assert_allclose(joint_positions(plant_feet(made, walk, walk).clip), joint_positions(walk), atol=1e-9)


def test_feet_that_stand_in_both_clips_are_not_moved() -> None:
    stand = synthesize("stand", seconds=4.0)
    made = blend(stand, stand, 40, 90, 20)
    planted = joint_positions(plant_feet(made, stand, stand).clip)
    np.testing.assert_allclose(planted, joint_positions(made.clip), atol=0.004)


def test_a_root_that_glides_over_standing_feet_is_brought_back(slider: Clip) -> None:
    """Both clips stand; the blend drifts by 0.3 m. Least squares have it stand where it stood, and what follows too."""
    stance = still(slider)
    made = blend(stance, stance, 40, 60, 20)
    moves = np.outer(np.linspace(0.0, 0.3, 21)[1:] ** 2 / 0.3, [0.0, 0.0, 1.0])
    planted = plant_feet(with_root(made, moves), stance, stance)
    np.testing.assert_allclose(toes(planted.clip), np.tile(toes(stance)[:1], (planted.clip.frames, 1, 1)), atol=0.006)
    np.testing.assert_allclose(planted.clip.root_positions[-1], stance.root_positions[0], atol=0.006)


def test_the_floor_holds(slider: Clip) -> None:
    """The blend sinks by 6 cm and comes up again; feet stay at their height, and the figure neither pops nor floats."""
    stance = still(slider)
    made = blend(stance, stance, 40, 60, 20)
    moves = np.outer(-0.06 * np.sin(np.linspace(0, np.pi, 20)) ** 2, [0.0, 1.0, 0.0])
    planted = plant_feet(with_root(made, moves), stance, stance)
    np.testing.assert_allclose(toes(planted.clip)[..., 1], toes(stance)[0, 0, 1], atol=0.002)


@pytest.mark.parametrize("blend_frames", [10, 20])
def test_from_one_stance_into_another_a_foot_steps(slider: Clip, blend_frames: int) -> None:
    """No root can hold both feet: one stands all the time, the other is lifted and takes its time."""
    source, destination = still(slider), still(slider, 0.24)
    # Clips that only stand allow no acceleration; somewhere else they walk.
    walk = replace(slider, rotations=slider.rotations.copy())
    hips = [slider.skeleton.role(f"hip.{side}") for side in "LR"]
    swing = 0.5 * np.sin(2 * np.pi * np.arange(90) / 25)
    for hip, sign in zip(hips, (1, -1), strict=True):
        walk.rotations.setflags(write=True)
        walk.rotations[:, hip] = quat.from_axis_angle([1.0, 0.0, 0.0], -0.4 + sign * swing)
        walk.rotations.setflags(write=False)
    source, destination = (_followed(clip, walk) for clip in (source, destination))
    made = blend(source, destination, 40, 60, blend_frames)
    planted = plant_feet(made, source, destination)
    assert "1 step" in planted.note
    around = slice(made.blend_start - 1, made.blend_stop + 7)
    speed, height = speeds(planted.clip)[around], toes(planted.clip)[around, :, 1] - toes(source)[0, 0, 1]
    standing = int(np.argmin(speed.max(axis=0)))
    assert speed[:, standing].max() < 0.15
    assert 0.02 < height[:, 1 - standing].max() < 0.1
    assert height.min() > -0.003
    assert np.count_nonzero(speed[:, 1 - standing] > 0.1) / 30 >= 0.25


def _followed(clip: Clip, other: Clip) -> Clip:
    """A clip, and what the other one does after it."""
    arrays = [np.concatenate([getattr(one, name) for one in (clip, other)]) for name in ("root_positions", "rotations")]
    return replace(clip, root_positions=arrays[0], rotations=arrays[1])


CASES = [("stand", "walk", 60, 100, 20), ("walk", "run", 70, 60, 12), ("walk", "walk_turn_left", 40, 80, 25)]


@pytest.mark.parametrize("case", [*CASES, ("dance_modern", "dance", 200, 300, 30)])
def test_blended_motions_stand_on_the_floor_and_start_no_sooner(case: tuple[Any, ...]) -> None:
    source, destination = (synthesize(name, seconds=12.0) for name in case[:2])
    raw = blend(source, destination, *case[2:])
    planted = plant_feet(raw, source, destination)
    before, after = (
        find_flaws(one.clip, (one.blend_start, one.blend_stop), (source, destination)) for one in (raw, planted)
    )
    assert after.unsupported_share <= max(after.own_unsupported_share + 0.1, 0.5 * before.unsupported_share)
    assert after.sink_m < 0.005
    assert after.toe_acceleration_times < 1.5
    assert after.root_velocity_change_times < max(1.0, before.root_velocity_change_times) + 0.15
    # Nothing before the blend, and nothing 0.2 s after it.
    np.testing.assert_array_equal(planted.clip.rotations[: raw.blend_start], source.rotations[: raw.blend_start])
    entry = planted.clip.root_positions[: raw.blend_start]
    np.testing.assert_array_equal(entry, source.root_positions[: raw.blend_start])
    tail = moved(destination, planted.alignment.yaw, np.array(planted.alignment.translation))
    np.testing.assert_allclose(
        joint_positions(planted.clip)[raw.blend_stop + 6 :],
        joint_positions(tail)[raw.destination_frames[1] + 6 :],
        atol=1e-6,
    )


def test_of_two_motions_the_one_with_more_share_says_which_foot_stands() -> None:
    source, destination = synthesize("stand", seconds=4.0), synthesize("walk", seconds=6.0)
    support = find_support(blend(source, destination, 40, 96, 40), source, destination, 6)
    assert support.frames == 46
    assert support.held.shape == (47, 2)
    assert support.held[:10].min() > 0.9, "both feet of the stance"
    alternating = support.held[-12:] > 0.5
    assert alternating.any(axis=1).all()
    assert not alternating.all()


@pytest.mark.parametrize("lengths", [(12, 24), (24, 12)])
def test_time_warped_blends_are_planted_too(lengths: tuple[int, int]) -> None:
    source, destination = synthesize("walk", seconds=5.0), synthesize("walk_fast", seconds=5.0)
    raw = warped_blend(source, destination, 60, 80, *lengths)
    planted = plant_feet(raw, source, destination)
    flaws = find_flaws(planted.clip, (raw.blend_start, raw.blend_stop), (source, destination))
    assert flaws.sink_m < 0.005
    assert flaws.unsupported_share <= flaws.own_unsupported_share + 0.1
    assert planted.source_frames == (60, 60 + lengths[0])


def test_where_the_clips_stand_does_not_matter() -> None:
    source, destination = synthesize("walk", seconds=5.0), synthesize("run", seconds=5.0)
    turn, shift = 2.0, np.array([3.0, 0.0, 1.0])
    here = plant_feet(blend(source, destination, 60, 80, 12), source, destination)
    away = moved(source, turn, shift)
    there = plant_feet(blend(away, destination, 60, 80, 12), away, destination)
    expected = joint_positions(moved(here.clip, turn, shift))
    np.testing.assert_allclose(joint_positions(there.clip), expected, atol=1e-6)


@pytest.mark.parametrize("frames", [1, 2, 3, 20])
def test_clips_that_are_no_longer_than_their_blend(frames: int) -> None:
    source, destination = (trim(synthesize(name, seconds=2.0), 0, frames) for name in ("walk", "run"))
    planted = plant_feet(blend(source, destination, 0, frames - 1, frames), source, destination)
    assert planted.clip.frames == frames


def test_a_cut_has_no_feet_to_plant(slider: Clip) -> None:
    with pytest.raises(TransitionError, match="a cut has no blended frames"):
        plant_feet(cut(slider, slider, 20, 40), slider, slider)


def test_what_cannot_be_done_is_said() -> None:
    source, destination = synthesize("walk", seconds=5.0), synthesize("run", seconds=5.0)
    assert "leaves no time for a step" in plant_feet(blend(source, destination, 60, 90, 2), source, destination).note


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
    np.testing.assert_array_equal(done.root_positions, slider.root_positions)
    low, shifts_of_low = lowered(slider, shifts)
    drop = slider.root_positions[:, 1] - low.root_positions[:, 1]
    assert drop.min() >= 0.0
    assert drop.max() <= 0.03 + 1e-12
    np.testing.assert_allclose(shifts_of_low[..., 1] - shifts[..., 1], np.stack([drop, drop], axis=1), atol=1e-12)


def test_a_straight_leg_bends_forward_at_the_knee() -> None:
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


@pytest.mark.parametrize("widest", [130.0, 170.0])
def test_a_knee_that_comes_to_bend_aside_does_not_jump(slider: Clip, widest: float) -> None:
    """The thigh turns about itself while the shank stays where it is, as in blends of figures that are built unlike."""
    angles = np.radians(np.interp(np.arange(slider.frames), [0, 55, 85], [0.0, 0.0, widest]))
    hip, knee = (slider.skeleton.role(f"{joint}.L") for joint in ("hip", "knee"))
    along = slider.skeleton.offsets[knee] / np.linalg.norm(slider.skeleton.offsets[knee])
    turn = quat.from_axis_angle(np.tile(along, (slider.frames, 1)), angles)
    rotations = slider.rotations.copy()
    rotations[:, hip] = quat.multiply(rotations[:, hip], turn)
    rotations[:, knee] = quat.multiply(quat.conjugate(turn), rotations[:, knee])
    turned = replace(slider, rotations=rotations)
    np.testing.assert_allclose(joint_positions(turned), joint_positions(slider), atol=1e-12)
    shifts = np.zeros((slider.frames, 2, 3))
    shifts[:, 0, 1] = 0.06
    done = reach(turned, shifts)
    ankle = turned.skeleton.role("ankle.L")
    np.testing.assert_allclose(
        joint_positions(done)[:, ankle], joint_positions(turned)[:, ankle] + shifts[:, 0], atol=5e-3
    )
    moved = np.linalg.norm(np.diff(joint_positions(done)[:, knee], axis=0), axis=-1)
    own = np.linalg.norm(np.diff(joint_positions(turned)[:, knee], axis=0), axis=-1)
    assert moved.max() < own.max() + 0.03


def test_an_overstretched_knee_comes_round_where_it_must_bend_further_and_not_at_once(slider: Clip) -> None:
    rotations = slider.rotations.copy()
    hip, knee = (slider.skeleton.role(f"{joint}.L") for joint in ("hip", "knee"))
    rotations[30:, hip] = quat.from_axis_angle([1.0, 0.0, 0.0], 0.1)
    rotations[30:, knee] = quat.from_axis_angle([1.0, 0.0, 0.0], -0.2)
    overstretched = replace(slider, rotations=rotations)
    np.testing.assert_allclose(knee_bend(overstretched, "L")[30:], -0.2, atol=1e-12)
    shifts = np.zeros((slider.frames, 2, 3))
    shifts[30:, 0, 1] = np.linspace(0.0, 0.06, 60)
    done = reach(overstretched, shifts)
    bend = knee_bend(done, "L")[30:]
    assert np.abs(np.diff(bend)).max() < 0.15
    assert bend[0] == pytest.approx(-0.2)
    assert bend[-1] > 0.5
    ankle = slider.skeleton.role("ankle.L")
    missed = joint_positions(done)[30:, ankle] - joint_positions(overstretched)[30:, ankle] - shifts[30:, 0]
    assert np.linalg.norm(missed, axis=1).max() < 0.02
    np.testing.assert_allclose(missed[-20:], 0.0, atol=1e-3)
