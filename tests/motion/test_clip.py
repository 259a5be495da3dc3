"""Clips: what they refuse, kinematics against plain matrices, resampling, trimming, retargeting."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from study.errors import MotionError
from study.motion import quaternions as quat
from study.motion.clip import (
    Clip,
    file_frame,
    global_rotations,
    joint_positions,
    moved,
    resample,
    retarget,
    sample,
    trim,
)
from study.motion.skeleton import Skeleton

NAMES = ("Hips", "LeftUpLeg", "LeftLeg", "LeftFoot", "RightUpLeg", "RightLeg", "RightFoot", "Spine")
PARENTS = np.array([-1, 0, 1, 2, 0, 4, 5, 0])


def body(scale: float = 1.0) -> Skeleton:
    rng = np.random.default_rng(2)
    return Skeleton(
        NAMES, PARENTS, rng.normal(size=(8, 3)) * scale, np.array([3, 7, 7]), rng.normal(size=(3, 3)) * scale
    )


@pytest.fixture
def clip() -> Clip:
    rng = np.random.default_rng(1)
    keys = Rotation.random(3 * 8, rng=rng)
    rotations = np.stack(
        [Slerp([0, 20, 40], keys[j * 3 : j * 3 + 3])(np.arange(41)).as_quat(scalar_first=True) for j in range(8)],
        axis=1,
    )
    return Clip(body(), np.cumsum(rng.normal(size=(41, 3)), axis=0), rotations, 120.0, name="walk")


def test_kinematics_agree_with_plain_matrices(clip: Clip) -> None:
    turns = [Rotation.from_quat(clip.rotations[:, j].copy(), scalar_first=True) for j in range(8)]
    world, places = [turns[0]], [clip.root_positions]
    for joint in range(1, 8):
        parent = int(PARENTS[joint])
        places.append(places[parent] + world[parent].apply(clip.skeleton.offsets[joint].copy()))
        world.append(world[parent] * turns[joint])
    ends = [places[p] + world[p].apply(o.copy()) for p, o in zip((3, 7, 7), clip.skeleton.end_offsets, strict=True)]
    found = joint_positions(clip, ends=True)
    assert np.allclose(found, np.stack([*places, *ends], axis=1), rtol=0, atol=1e-12)
    assert np.array_equal(joint_positions(clip), found[:, :8])
    assert found.flags.c_contiguous
    expected = np.stack([w.as_matrix() for w in world], axis=1)
    assert np.allclose(quat.to_matrix(global_rotations(clip)), expected, rtol=0, atol=1e-12)


def test_signs_are_continuous_and_start_positive(clip: Clip) -> None:
    signs = np.random.default_rng(3).choice([-1.0, 1.0], size=(41, 8, 1))
    shuffled = replace(clip, rotations=clip.rotations * signs)
    assert np.array_equal(shuffled.rotations, clip.rotations)
    assert (clip.rotations[0, :, 0] >= 0).all()
    assert (np.sum(clip.rotations[1:] * clip.rotations[:-1], axis=-1) >= 0).all()


def test_a_clip_is_frozen_and_keeps_no_one_elses_array() -> None:
    rotations = np.tile(quat.IDENTITY, (2, 8, 1))
    path = np.zeros((2, 3))
    clip = Clip(body(), path, rotations, 30)
    rotations[:] = 7.0
    path[:] = 7.0
    assert clip.rotations[0, 0].tolist() == [1, 0, 0, 0]
    assert not clip.root_positions.any()
    for array in (clip.rotations, clip.root_positions):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    assert isinstance(clip.fps, float)
    assert clip.seconds == pytest.approx(2 / 30)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"root_positions": np.zeros((41, 2))}, r"root positions of shape \(frames, 3\).*'walk', got \(41, 2\)"),
        ({"root_positions": np.zeros((0, 3))}, r"frames >= 1"),
        ({"rotations": np.zeros((41, 8, 3))}, r"rotations of shape \(41, 8, 4\)"),
        ({"rotations": np.zeros((40, 8, 4))}, r"rotations of shape \(41, 8, 4\)"),
        ({"rotations": np.full((41, 8, 4), 0.4)}, "Expected unit quaternions in clip 'walk'"),
        ({"rotations": np.full((41, 8, 4), np.nan)}, "Expected finite rotations in clip 'walk'.*frame 0"),
        ({"root_positions": np.full((41, 3), np.inf)}, "Expected finite root positions.*frame 0"),
        ({"fps": 0.0}, "Expected a frame rate above 0"),
        ({"fps": float("nan")}, "Expected a frame rate above 0"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(clip: Clip, change: dict[str, object], message: str) -> None:
    with pytest.raises(MotionError, match=message):
        replace(clip, **change)  # type: ignore[arg-type]


@pytest.mark.parametrize("fps", [30.0, 60.0, 24.0, 29.97, 240.0, 100.0])
def test_resampling_agrees_with_slerp_and_keeps_the_first_frame(clip: Clip, fps: float) -> None:
    again = resample(clip, fps)
    times = np.arange(again.frames) / fps
    assert times[-1] <= 40 / 120 + 1e-9 < times[-1] + 1 / fps + 1e-9
    for joint in (0, 3, 7):
        expected = Slerp(np.arange(41) / 120, Rotation.from_quat(clip.rotations[:, joint], scalar_first=True))
        error = expected(np.minimum(times, 40 / 120)).inv() * Rotation.from_quat(
            again.rotations[:, joint], scalar_first=True
        )
        assert np.max(error.magnitude()) < 1e-9
    assert np.array_equal(again.rotations[0], clip.rotations[0])
    assert again.fps == fps
    assert again.history == (f"resampled from 120 to {fps:g} fps",)


def test_frames_on_frames_of_the_original_come_back_exactly(clip: Clip) -> None:
    assert np.array_equal(resample(clip, 30.0).rotations, clip.rotations[::4])
    assert np.array_equal(resample(clip, 240.0).root_positions[::2], clip.root_positions)
    assert resample(clip, 120.0) is clip
    with pytest.raises(MotionError, match="above 0 to resample"):
        resample(clip, -1.0)


@pytest.mark.parametrize(
    ("fps", "other"), [(120.0, 30.0), (30.0, 120.0), (0.1, 0.3), (0.3, 0.1), (29.97, 59.94), (0.7, 0.1)]
)
def test_the_last_frame_survives_rounding(clip: Clip, fps: float, other: float) -> None:
    """Whole numbers of frames by exact fractions, where a quotient of floats may fall short of them."""
    ratio = Fraction(str(fps)) / Fraction(str(other))
    for frames in range(2, 42):
        short = replace(trim(clip, 0, frames), fps=fps)
        again = resample(short, other)
        assert again.frames == (frames - 1) // ratio + 1
        for frame in range(again.frames):
            if (frame * ratio).denominator == 1:
                assert np.array_equal(again.rotations[frame], short.rotations[int(frame * ratio)])


def test_samples_between_frames_and_their_limits(clip: Clip) -> None:
    half = sample(clip, [1.5])
    assert np.allclose(half.root_positions[0], clip.root_positions[1:3].mean(axis=0))
    with pytest.raises(MotionError, match="frame numbers from 0 to 40 in walk, got 0 to 41"):
        sample(clip, [0.0, 41.0])


def test_trimming_is_a_slice_and_is_written_down(clip: Clip) -> None:
    part = trim(clip, 3, 10)
    assert np.array_equal(joint_positions(part), joint_positions(clip)[3:10])
    assert part.history == ("trimmed to frames 3 to 9 of 41",)
    assert trim(clip, 0, 41) is clip
    for start, stop in ((-1, 5), (5, 5), (0, 42)):
        with pytest.raises(MotionError, match="Expected 0 <= start < stop <= 41 frames in walk"):
            trim(clip, start, stop)


def test_moving_turns_and_shifts_every_joint(clip: Clip) -> None:
    turn = Rotation.from_euler("y", 0.7)
    expected = turn.apply(joint_positions(clip).reshape(-1, 3)).reshape(41, 8, 3) + np.array([1, 2, 3])
    assert np.allclose(joint_positions(moved(clip, 0.7, np.array([1.0, 2.0, 3.0]))), expected, rtol=0, atol=1e-12)


def test_retargeting_scales_the_path_by_leg_length(clip: Clip) -> None:
    larger = retarget(clip, body(2.0))
    assert np.allclose(joint_positions(larger), 2.0 * joint_positions(clip))
    assert "root path times 2.000" in larger.history[-1]
    same = body()
    assert retarget(clip, same).skeleton is same
    assert retarget(clip, same).history == clip.history
    renamed = replace(body(), names=(*NAMES[:2], "LeftShin", *NAMES[3:]))
    with pytest.raises(
        MotionError, match=r"Expected walk on the rig of the other clip.*'LeftLeg', a joint of the body"
    ):
        retarget(clip, renamed)


def test_a_frame_is_found_in_the_clips_own_file() -> None:
    """Frame 10 at 30 fps, of a clip cut at frame 8 of a file of 120 fps, is frame 8 + 40 of the file."""
    rotations = np.tile(quat.IDENTITY, (200, 1, 1))
    skeleton = Skeleton(("Hips",), np.array([-1]), np.zeros((1, 3)), np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
    whole = Clip(skeleton, np.zeros((200, 3)), rotations, 120.0)
    assert file_frame(whole, 17) == 17
    part = trim(resample(trim(whole, 8, 200), 30.0), 3, 40)
    assert file_frame(part, 7) == pytest.approx(8 + 4 * 10)
    assert part.start_s == pytest.approx(8 / 120 + 3 / 30)
