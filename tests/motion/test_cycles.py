"""Continuing clips: periods found again, seams without pops, feet that stay, and refusals for what is not cyclic."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from study.errors import MotionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, resample, trim
from study.motion.continuing import smooth_sample
from study.motion.cycles import Extension, extend, find_cycle, reversed_in_time
from study.motion.feet import floor_height, foot_points, heading, stance
from study.motion.library import Library, open_library
from study.motion.mirror import mirror
from study.motion.synthetic import synthesize

FPS = 120.0


def foot_drift(clip: Clip, *, floor: float) -> np.ndarray:
    """How far each planted foot moves over the floor, one number a stance, metres `(stances,)`.

    The greatest distance of the foot's slowest point from where it was, over a run of stance frames.
    """
    planted = stance(clip, floor=floor)
    drifts = []
    for side, points in enumerate(foot_points(clip)):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], planted[:, side].astype(np.int8), [0]])))
        for start, stop in edges.reshape(-1, 2):
            if stop - start >= max(2, round(0.08 * clip.fps)):
                path = points[start:stop][..., [0, 2]]
                spans = np.linalg.norm(path - path[:1], axis=-1).max(axis=0)
                drifts.append(float(spans.min()))
    return np.array(drifts)


@pytest.fixture(scope="module")
def walk() -> Clip:
    return synthesize("walk", seconds=6.0, fps=FPS)


@pytest.fixture(scope="module")
def run() -> Clip:
    return synthesize("run", seconds=6.0, fps=FPS)


def acceleration_jumps(clip: Clip) -> np.ndarray:
    """Largest change of any joint's velocity from frame to frame, m/s, `(frames - 2,)`."""
    velocity = np.diff(joint_positions(clip), axis=0) * clip.fps
    return np.asarray(np.linalg.norm(np.diff(velocity, axis=0), axis=-1).max(axis=1))


def turn_rates(clip: Clip) -> np.ndarray:
    """Largest change of any joint's angular velocity from frame to frame, rad/s, `(frames - 2,)`."""
    turns = quat.log(quat.multiply(quat.conjugate(clip.rotations[:-1]), clip.rotations[1:])) * 2.0 * clip.fps
    return np.asarray(np.linalg.norm(np.diff(turns, axis=0), axis=-1).max(axis=1))


def own_frames(extension: Extension, clip: Clip) -> Clip:
    return trim(extension.clip, extension.added_before, extension.added_before + clip.frames)


def test_finds_the_period_of_a_walk_from_little_more_than_one_cycle(walk: Clip) -> None:
    long = find_cycle(walk)
    assert long is not None
    short = find_cycle(trim(walk, 200, 200 + round(1.2 * long.cycle_frames)))
    assert short is not None
    assert short.kind in ("gait", "step")
    assert short.cycle_frames == pytest.approx(long.cycle_frames, rel=0.03)
    assert short.unlikeness < 0.2


def test_one_step_is_enough_with_its_mirror_image(run: Clip) -> None:
    whole = find_cycle(run)
    assert whole is not None
    part = trim(run, 300, 300 + round(0.75 * whole.cycle_frames))
    cycle = find_cycle(part)
    assert cycle is not None
    assert cycle.kind == "step"
    assert cycle.cycle_frames == pytest.approx(whole.cycle_frames, rel=0.05)


@pytest.mark.parametrize("at", ["start", "end"])
@pytest.mark.parametrize("share", [0.8, 1.3, 2.5])
def test_continues_as_the_walker_would_have(walk: Clip, at: str, share: float) -> None:
    cycle = find_cycle(walk)
    assert cycle is not None
    frames, added = round(share * cycle.cycle_frames), 120
    part = trim(walk, 240, 240 + frames)
    extension = extend(part, **{"frames_before" if at == "start" else "frames_after": added})
    true = trim(walk, 240 - added, 240 + frames) if at == "start" else trim(walk, 240, 240 + frames + added)
    apart = np.linalg.norm(joint_positions(extension.clip) - joint_positions(true), axis=-1)
    # Steps differ by centimetres; a wrong period or direction would be off by decimetres.
    assert apart.max() < 0.12
    assert np.median(apart) < 0.03


@pytest.mark.parametrize("name", ["walk", "run"])
def test_captured_frames_are_kept_and_seams_do_not_pop(name: str, request: pytest.FixtureRequest) -> None:
    clip = trim(request.getfixturevalue(name), 240, 380)
    extension = extend(clip, frames_before=200, frames_after=250)
    assert (extension.added_before, extension.added_after) == (200, 250)
    assert extension.clip.frames == 200 + 140 + 250
    same = own_frames(extension, clip)
    np.testing.assert_array_equal(same.root_positions, clip.root_positions)
    np.testing.assert_allclose(quat.half_angle_between(same.rotations, clip.rotations), 0.0, atol=1e-12)
    for measure in (acceleration_jumps, turn_rates):
        own, all_of_it = measure(clip), measure(extension.clip)
        # A millimetre at the foot of a nearly straight leg is a centimetre at its knee, hence more than 1.
        assert all_of_it.max() < 1.75 * own.max()


def test_straight_stays_straight(walk: Clip, run: Clip) -> None:
    for clip in (trim(walk, 200, 380), trim(run, 200, 330)):
        extended = extend(clip, frames_after=1200).clip
        sideways = extended.root_positions[:, 0] - clip.root_positions[0, 0]
        forward = extended.root_positions[-1, 2] - clip.root_positions[0, 2]
        assert np.abs(sideways).max() < 0.03 * forward
        assert abs(np.degrees(heading(extended)[-240:].mean())) < 4.0


def test_a_bend_is_walked_on() -> None:
    straight = synthesize("walk", seconds=7.0, fps=60.0)
    cycle = find_cycle(straight)
    assert cycle is not None
    # A walk bent by 20 degrees a cycle: headings and steps are turned by a steadily growing angle.
    angle = np.radians(20.0) * np.arange(straight.frames) / cycle.cycle_frames
    rotations = straight.rotations.copy()
    rotations[:, 0] = quat.multiply(quat.yaw(angle), rotations[:, 0])
    steps = np.diff(straight.root_positions, axis=0, prepend=straight.root_positions[:1])
    path = straight.root_positions[0] + np.cumsum(quat.rotate(quat.yaw(angle), steps), axis=0)
    bent = Clip(straight.skeleton, path, rotations, straight.fps)
    found = find_cycle(bent)
    assert found is not None
    assert np.degrees(found.turn) == pytest.approx(20.0, abs=4.0)
    extended = extend(bent, frames_after=round(3 * found.period_frames)).clip
    turned = np.degrees(heading(extended)[-1] - heading(bent)[-1])
    assert turned == pytest.approx(60.0, abs=12.0)


def test_planted_feet_stay_planted_and_on_the_floor(run: Clip) -> None:
    clip = trim(run, 240, 360)
    floor = floor_height(clip)
    extended = extend(clip, frames_before=240, frames_after=240).clip
    own, drift = foot_drift(run, floor=floor), foot_drift(extended, floor=floor)
    assert len(drift) >= 6
    assert np.percentile(drift, 90) < np.percentile(own, 90) + 0.01
    lowest = min(points[..., 1].min() for points in foot_points(clip))
    assert min(points[..., 1].min() for points in foot_points(extended)) > lowest - 0.01


def test_starting_is_ending_backwards(run: Clip) -> None:
    clip = trim(run, 240, 380)
    before = extend(clip, frames_before=100).clip
    after = extend(reversed_in_time(clip), frames_after=100).clip
    np.testing.assert_allclose(before.root_positions[::-1], after.root_positions, atol=1e-9)


def test_mirrored_clips_are_continued_as_the_mirror_image(run: Clip) -> None:
    clip = trim(run, 240, 360)
    one, other = extend(clip, frames_after=150).clip, extend(mirror(clip), frames_after=150).clip
    np.testing.assert_allclose(mirror(one).root_positions, other.root_positions, atol=2e-3)


def test_standing_is_drawn_out() -> None:
    clip = synthesize("stand", seconds=1.0, fps=60.0)
    assert getattr(find_cycle(clip), "kind", None) == "still"
    extension = extend(clip, frames_before=180, frames_after=180)
    assert "of standing" in extension.note
    positions = joint_positions(extension.clip)
    assert np.linalg.norm(np.diff(positions, axis=0), axis=-1).max() * 60.0 < 0.3
    assert acceleration_jumps(extension.clip).max() < 2.0 * acceleration_jumps(clip).max() + 0.02
    feet = foot_points(extension.clip)
    assert max(np.ptp(points, axis=0).max() for points in feet) < 0.01


def test_the_note_says_how_much(walk: Clip) -> None:
    clip = trim(walk, 200, 500)
    extension = extend(clip, frames_before=60, frames_after=120)
    cycle = find_cycle(clip)
    assert cycle is not None
    assert f": {120 / cycle.cycle_frames:.2f} gait cycles" in extension.note
    assert "extended before its start by 60 frames (0.50 s)" in extension.note
    assert "extended after its end by 120 frames (1.00 s)" in extension.note
    assert extension.clip.history[-1] == extension.note


def test_nothing_asked_nothing_done(walk: Clip) -> None:
    extension = extend(walk)
    assert extension.clip is walk
    assert extension.note == ""


@pytest.mark.parametrize("name", ["box", "dance"])
def test_what_is_not_cyclic_is_refused(name: str) -> None:
    clip = trim(synthesize(name, seconds=6.0, fps=60.0), 90, 300)
    assert find_cycle(clip) is None
    with pytest.raises(MotionError, match=r"to end in walking or running steps, or standing still, to extend it there"):
        extend(clip, frames_after=30)


def test_negative_numbers_and_other_ends_are_refused(walk: Clip) -> None:
    with pytest.raises(MotionError, match="from 0 to add, got -1 and 0"):
        extend(walk, frames_before=-1)
    with pytest.raises(MotionError, match="'start' or 'end' of the clip, got 'middle'"):
        find_cycle(walk, "middle")  # type: ignore[arg-type]


def test_smooth_sampling_keeps_frames_and_follows_curves(run: Clip) -> None:
    clip = trim(run, 200, 300)
    np.testing.assert_allclose(smooth_sample(clip, np.arange(100.0)).rotations, clip.rotations, atol=1e-12)
    thirty = resample(clip, 30.0)
    true = joint_positions(clip)[6:90:4]
    between = joint_positions(smooth_sample(thirty, np.arange(1.5, 22.5)))
    assert np.abs(between - true).max() < 0.02


# -- On real capture -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cmu(mocap: Path) -> Library:
    return open_library(mocap / "cmu")


@pytest.mark.mocap
@pytest.mark.parametrize(
    "name", ["walk", "walk_fast", "jog", "run", "run_fast", "run_turn_left", "run_turn_right", "walk_turn_left"]
)
def test_captured_gaits_go_on_without_pops_or_sliding(cmu: Library, name: str) -> None:
    clip = cmu.clip(name)
    extension = extend(clip, frames_before=240, frames_after=240)
    jumps, own = acceleration_jumps(extension.clip), acceleration_jumps(clip)
    for seam in (extension.added_before, extension.added_before + clip.frames):
        assert jumps[seam - 3 : seam + 2].max() <= 1.2 * own.max()
    assert jumps.max() <= 1.6 * own.max()
    floor = floor_height(clip)
    drift = foot_drift(extension.clip, floor=floor)
    assert np.percentile(drift, 90) < np.percentile(foot_drift(clip, floor=floor), 90) + 0.015
    lowest = min(points[..., 1].min() for points in foot_points(clip))
    assert min(points[..., 1].min() for points in foot_points(extension.clip)) > lowest - 0.03


@pytest.mark.mocap
@pytest.mark.parametrize(("name", "turn"), [("run_turn_left", 90.0), ("run_turn_right", -90.0)])
def test_runners_go_straight_on_after_their_turn(cmu: Library, name: str, turn: float) -> None:
    clip = cmu.clip(name)
    extension = extend(clip, frames_before=300, frames_after=300)
    facing = np.degrees(heading(extension.clip))
    assert facing[:150].mean() == pytest.approx(0.0, abs=15.0)
    assert facing[-150:].mean() == pytest.approx(turn, abs=20.0)
    # The way out is a line.
    way = extension.clip.root_positions[-300:][:, [0, 2]]
    centred = way - way.mean(axis=0)
    assert np.linalg.svd(centred, compute_uv=False)[1] / np.sqrt(len(way)) < 0.05


@pytest.mark.mocap
def test_captured_boxing_is_refused(cmu: Library) -> None:
    clip = trim(cmu.clip("box", fps=30.0), 300, 420)
    with pytest.raises(MotionError, match="other motion is not repeated"):
        extend(clip, frames_after=60)
