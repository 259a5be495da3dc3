from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from walks import make_walk

from study.errors import MotionError, TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, moved
from study.motion.skeleton import Skeleton
from study.transitions.blending import blend, blend_weights, cut, facing, slerp_one_way
from study.transitions.windows import SPECIFICATIONS


def speeds(clip: Clip) -> Any:
    """Floor speed of the root between frames, m/s."""
    return np.linalg.norm(np.diff(clip.root_positions[:, [0, 2]], axis=0), axis=1) * clip.fps


@pytest.mark.parametrize("weight", ["linear", "sigmoid"])
@pytest.mark.parametrize("count", [1, 2, 9, 60])
def test_weights_are_symmetric_and_rise_between_zero_and_one(weight: str, count: int) -> None:
    share = blend_weights(count, weight)
    assert share.shape == (count,)
    np.testing.assert_allclose(share + share[::-1], 1.0, atol=1e-15)
    assert np.all(np.diff(np.concatenate([[0.0], share, [1.0]])) > 0)


def test_linear_weights_go_in_equal_steps_from_the_frame_before_to_the_frame_after() -> None:
    np.testing.assert_allclose(np.diff(np.concatenate([[0.0], blend_weights(4), [1.0]])), 0.2)
    with pytest.raises(TransitionError, match="'linear' or 'sigmoid', got 'cubic'"):
        blend_weights(4, "cubic")


def test_facing_follows_a_turn_and_not_the_counter_rotation() -> None:
    walk = make_walk(90, heading=0.3)
    assert np.max(np.abs(facing(walk) - 0.3)) < 0.05
    np.testing.assert_allclose(facing(moved(walk, 1.0, np.zeros(3))) - facing(walk), 1.0, atol=1e-12)
    turn = make_walk(300, turn_rate=1.0)
    # Ten seconds at one radian a second: more than once around, and no jump at the half turn.
    assert facing(turn)[-1] - facing(turn)[0] == pytest.approx(299 / 30, abs=0.1)


@pytest.mark.parametrize("blend_frames", [1, 2, 10, 45, 60])
@pytest.mark.parametrize("weight", ["linear", "sigmoid"])
def test_blending_a_clip_with_itself_in_phase_gives_the_clip(blend_frames: int, weight: str) -> None:
    walk = make_walk(150, turn_rate=0.4)
    result = blend(walk, walk, 45, 45 + blend_frames - 1, blend_frames, weight=weight)
    assert result.clip.frames == walk.frames
    np.testing.assert_allclose(result.clip.root_positions, walk.root_positions, atol=1e-12)
    np.testing.assert_allclose(np.abs(np.sum(result.clip.rotations * walk.rotations, axis=-1)), 1.0, atol=1e-13)
    assert result.alignment.yaw == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("specification", SPECIFICATIONS)
def test_frames_outside_the_blend_are_the_clips_own(specification: str) -> None:
    source, destination = make_walk(120, speed=1.0), make_walk(140, phase=2.0, speed=2.5, heading=2.0)
    result = blend(source, destination, 50, 70, 20, specification=specification)
    first, last = result.source_frames[0], result.destination_frames[1]
    np.testing.assert_array_equal(result.clip.root_positions[: result.blend_start], source.root_positions[:first])
    np.testing.assert_array_equal(result.clip.rotations[: result.blend_start], source.rotations[:first])
    tail = moved(destination, result.alignment.yaw, np.array(result.alignment.translation))
    np.testing.assert_allclose(result.clip.root_positions[result.blend_stop :], tail.root_positions[last:], atol=1e-13)
    same = np.abs(np.sum(result.clip.rotations[result.blend_stop :] * tail.rotations[last:], axis=-1))
    np.testing.assert_allclose(same, 1.0, atol=1e-13)
    assert result.blend_stop - result.blend_start == result.blend_frames == 20
    assert result.clip.frames == first + 20 + 140 - last
    assert result.alignment.translation[1] == 0.0


def test_a_destination_that_ends_with_the_blend_is_placed_by_its_last_frame() -> None:
    source, destination = make_walk(120, speed=2.0, turn_rate=0.5), make_walk(90, phase=2.0, speed=1.0, heading=1.0)
    result = blend(source, destination, 50, 89, 20)
    tail = moved(destination, result.alignment.yaw, np.array(result.alignment.translation))
    np.testing.assert_allclose(tail.root_positions[-1, [0, 2]], result.clip.root_positions[-1, [0, 2]], atol=1e-12)
    assert facing(tail)[-1] == pytest.approx(facing(result.clip)[-1], abs=0.1)


def test_start_and_end_frames_say_where_the_blend_starts_and_ends() -> None:
    result = blend(make_walk(100), make_walk(100, phase=2.0), 40, 60, 15)
    assert (result.blend_start, result.blend_stop) == (40, 55)
    assert result.source_frames == (40, 55)
    assert result.destination_frames == (46, 61)


@pytest.mark.parametrize("blend_frames", [1, 2, 7, 30, 60])
def test_the_root_runs_over_from_one_speed_to_the_other_without_a_jump(blend_frames: int) -> None:
    slow, fast = make_walk(150, speed=1.0), make_walk(150, speed=3.0, phase=1.0, heading=-2.5)
    result = blend(slow, fast, 70, 80, blend_frames)
    speed = speeds(result.clip)
    changes = np.diff(speed)
    # The ramp has b + 1 equal steps but for halves at its ends (a blend of one frame: a quarter, a half, a quarter).
    assert changes.max() < 1.02 * 2.0 / (blend_frames + 1)
    assert changes.min() > -0.02
    assert speed[:60] == pytest.approx(1.0)
    assert speed[-10:] == pytest.approx(3.0)


def test_straight_ahead_stays_straight_ahead() -> None:
    """Two straight walks: the blended root leaves the source's line by no more than the bodies sway."""
    source, destination = make_walk(150, speed=1.0, heading=0.7), make_walk(150, speed=2.5, phase=2.0, heading=-2.0)
    result = blend(source, destination, 60, 90, 30)
    across = np.array([np.cos(0.7), 0.0, -np.sin(0.7)])
    sideways = (result.clip.root_positions[: result.blend_stop] - result.clip.root_positions[0]) @ across
    assert np.max(np.abs(sideways)) < 0.02
    velocity = np.diff((result.clip.root_positions - result.clip.root_positions[0]) @ across) * 30
    assert np.max(np.abs(velocity)) < 0.15


def test_a_turning_destination_goes_on_turning() -> None:
    source, destination = make_walk(150, speed=2.0), make_walk(150, speed=2.0, turn_rate=1.5, heading=1.0)
    result = blend(source, destination, 60, 90, 30)
    rate = np.diff(facing(result.clip)) * 30
    blended = rate[result.blend_start : result.blend_stop]
    assert blended.min() > -0.6
    assert blended.max() < 2.1
    assert np.mean(blended) == pytest.approx(0.75, abs=0.1)


@pytest.mark.parametrize("angle", [0.4, 2 * np.pi / 3, np.radians(170), -3.0])
def test_turning_either_clip_on_the_floor_moves_the_result_rigidly(angle: Any) -> None:
    source, destination = make_walk(120, turn_rate=0.5), make_walk(120, phase=2.0, speed=2.0)
    shift = np.array([3.0, 0.0, -7.0])
    plain = joint_positions(blend(source, destination, 50, 80, 25).clip)
    with_destination = blend(source, moved(destination, angle, shift), 50, 80, 25)
    np.testing.assert_allclose(joint_positions(with_destination.clip), plain, atol=1e-12)
    with_source = blend(moved(source, angle, shift), destination, 50, 80, 25)
    expected = quat.rotate(quat.yaw(angle), plain) + shift
    np.testing.assert_allclose(joint_positions(with_source.clip), expected, atol=1e-12)


def test_joints_move_no_faster_than_clips_and_ramp_together_allow() -> None:
    source, destination = make_walk(120), make_walk(120, phase=2.0, cadence=1.4, swing=0.8)
    count = 20
    result = blend(source, destination, 50, 80, count)
    own = [np.max(quat.half_angle_between(c.rotations[1:], c.rotations[:-1]), axis=0) for c in (source, destination)]
    apart = np.max(
        quat.half_angle_between(source.rotations[50 : 50 + count], destination.rotations[81 - count : 81]), axis=0
    )
    steps = quat.half_angle_between(result.clip.rotations[1:], result.clip.rotations[:-1])
    assert np.all(steps[:, 1:] <= (np.maximum(*own) + apart / (count + 1))[1:] + 1e-9)


def test_reversing_time_and_roles_reverses_the_pose_blend() -> None:
    """Symmetric weights: destination to source, backwards, is the same blend of the joints."""
    source, destination = make_walk(100), make_walk(100, phase=2.0)
    there = blend(source, destination, 40, 60, 15)
    back = blend(
        *(
            replace(c, root_positions=c.root_positions[::-1], rotations=c.rotations[::-1])
            for c in (destination, source)
        ),
        99 - 60,
        99 - 40,
        15,
    )
    a = there.clip.rotations[there.blend_start : there.blend_stop, 1:]
    b = back.clip.rotations[back.blend_start : back.blend_stop, 1:][::-1]
    np.testing.assert_allclose(quat.half_angle_between(a, b), 0.0, atol=1e-7)


def test_slerp_keeps_its_way_round_where_the_shorter_way_would_swap() -> None:
    angle = np.linspace(0.9 * np.pi, 1.02 * np.pi, 12)  # crosses half a turn apart
    a = np.tile(quat.IDENTITY, (12, 1, 1))
    b = quat.from_axis_angle([0.0, 0.0, 1.0], angle)[:, None]
    mixed = slerp_one_way(a, b, np.full((12, 1), 0.5))
    assert np.max(quat.half_angle_between(mixed[1:], mixed[:-1])) < 0.02
    np.testing.assert_allclose(2 * quat.half_angle_between(mixed[:, 0], a[:, 0]), angle / 2, atol=1e-9)


def test_slerp_agrees_with_the_shorter_way_where_there_is_no_doubt() -> None:
    rng = np.random.default_rng(3)
    a = quat.normalise(np.array([1.0, 0, 0, 0]) + 0.15 * rng.normal(size=(6, 4, 4)))
    b = quat.normalise(np.array([1.0, 0, 0, 0]) + 0.15 * rng.normal(size=(6, 4, 4)))
    share = np.linspace(0, 1, 6)
    np.testing.assert_allclose(slerp_one_way(a, -b, share[:, None]), quat.slerp(a, b, share[:, None]), atol=1e-12)
    same = np.tile(quat.IDENTITY, (6, 1, 1))
    np.testing.assert_array_equal(slerp_one_way(same, -same, share[:, None]), same)


def test_blends_reach_to_the_very_ends_of_the_clips() -> None:
    """No frame before the source's window, none after the destination's, none on the far side of either."""
    source, destination = make_walk(20), make_walk(20, phase=1.0)
    whole = blend(source, destination, 0, 19, 20)
    assert (whole.blend_start, whole.blend_stop, whole.clip.frames) == (0, 20, 20)
    np.testing.assert_allclose(whole.clip.root_positions[0, [0, 2]], source.root_positions[0, [0, 2]], atol=1e-12)
    assert np.max(np.abs(np.diff(speeds(whole.clip)))) < 0.05
    left = blend(source, destination, 5, 0, 15, specification="left")
    assert left.clip.frames == 25
    assert np.max(np.abs(np.diff(speeds(left.clip)))) < 0.05


def test_joints_may_blend_for_less_long_than_the_figure() -> None:
    source, destination = make_walk(100), make_walk(100, phase=2.0)
    shoulder, hip = (source.skeleton.role(role) for role in ("shoulder.L", "hip.L"))
    whole = blend(source, destination, 40, 60, 20).clip.rotations[40:60]
    result = blend(source, destination, 40, 60, 20, joint_frames={"shoulder.L": 10}).clip.rotations[40:60]
    np.testing.assert_array_equal(result[:, hip], whole[:, hip])
    apart = quat.half_angle_between(result[:, shoulder], source.rotations[40:60, shoulder])
    np.testing.assert_allclose(apart[:5], 0.0, atol=1e-7)
    assert np.all(apart[5:] > 0)
    there = quat.half_angle_between(result[:, shoulder], destination.rotations[41:61, shoulder])
    np.testing.assert_allclose(there[15:], 0.0, atol=1e-7)
    with pytest.raises(TransitionError, match=r"1 to 20 frames for the role 'knee\.R', got 21"):
        blend(source, destination, 40, 60, 20, joint_frames={"knee.R": 21})


def test_a_cut_matches_facing_and_floor_position() -> None:
    source, destination = make_walk(100, heading=1.0), make_walk(100, phase=2.0, heading=-2.0)
    result = cut(source, destination, 40, 60)
    assert (result.blend_start, result.blend_stop, result.blend_frames) == (40, 40, 0)
    assert result.clip.frames == 40 + 40
    np.testing.assert_allclose(result.clip.root_positions[40, [0, 2]], source.root_positions[40, [0, 2]], atol=1e-12)
    assert result.clip.root_positions[40, 1] == destination.root_positions[60, 1]
    assert facing(result.clip)[40] == pytest.approx(facing(source)[40], abs=1e-12)
    same = cut(source, source, 40, 40).clip
    np.testing.assert_allclose(same.root_positions, source.root_positions, atol=1e-12)


def test_the_destination_is_put_on_the_sources_skeleton() -> None:
    result = blend(make_walk(100), make_walk(100, scale=1.5, speed=3.0), 40, 60, 10)
    assert result.clip.skeleton.leg_length == pytest.approx(0.84)
    assert speeds(result.clip)[-1] == pytest.approx(2.0)


def test_rigs_that_differ_in_leaf_joints_alone_are_blended() -> None:
    source, destination = make_walk(100), make_walk(100, toes=False)
    result = blend(source, destination, 40, 60, 10).clip
    np.testing.assert_allclose(result.rotations, blend(source, make_walk(100), 40, 60, 10).clip.rotations, atol=1e-12)
    assert "joints at rest LeftToe, RightToe" in " ".join(result.history)
    back = blend(destination, source, 40, 60, 10).clip
    assert back.skeleton is destination.skeleton
    assert "removed joints LeftToe, RightToe" in " ".join(back.history)


def test_what_was_done_is_on_record() -> None:
    source, destination = (
        make_walk(100, name="walk").noting("mended"),
        replace(make_walk(100, name="run"), synthetic=True),
    )
    result = blend(source, destination, 40, 60, 10, weight="sigmoid")
    assert result.clip.name == "walk to run"
    assert result.clip.synthetic
    assert result.clip.history[0] == "walk: mended"
    assert "sigmoid blend of 10 frames, start-end, from source frame 40 to destination frame 60" in result.note
    assert result.clip.history[-1] == result.note


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        ((95, 60, 10), "source walk lacks 5 frames after its last"),
        ((40, 5, 10), "destination walk lacks 4 frames before its first"),
        ((40, 60, 0), "at least 1 frame, got 0"),
        ((40, 100, 1), "end frame from 0 to 99"),
    ],
)
def test_frames_that_are_not_there_are_refused(frames: tuple[int, ...], message: str) -> None:
    walk = make_walk(100, name="walk")
    with pytest.raises(TransitionError, match=message):
        blend(walk, walk, *frames)


def test_a_figure_without_hips_or_shoulders_has_no_facing() -> None:
    rope = Skeleton(("a", "b"), np.array([-1, 0]), np.ones((2, 3)), np.zeros(0, dtype=int), np.zeros((0, 3)))
    with pytest.raises(MotionError, match="role 'hip"):
        facing(Clip(rope, np.zeros((5, 3)), np.tile([1.0, 0, 0, 0], (5, 2, 1)), 30.0))
