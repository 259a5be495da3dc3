"""Transitions made at another rate pass through the poses of the one that they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from study.motion.clip import Clip, joint_positions, resample
from study.motion.synthetic import synthesize
from study.transitions.blending import blend
from study.transitions.rates import remade
from study.transitions.timewarp import warped_blend


@pytest.fixture(scope="module")
def clips() -> tuple[Clip, Clip]:
    return synthesize("walk", seconds=5.0, fps=120.0), synthesize("run", seconds=5.0, fps=120.0)


def test_every_fourth_frame_is_the_transition_at_a_quarter_of_the_rate(clips: tuple[Clip, Clip]) -> None:
    source, destination = clips
    made = blend(resample(source, 30.0), resample(destination, 30.0), 60, 80, 10)
    fine = remade(made, source, destination)
    assert fine.clip.fps == 120.0
    assert (fine.blend_start, fine.blend_stop) == (4 * 59 + 1, 4 * 70)
    coarse = joint_positions(fine.clip)[::4]
    count = min(len(coarse), made.clip.frames)
    apart = np.linalg.norm(coarse[:count] - joint_positions(made.clip)[:count], axis=-1)
    assert apart[:60].max() < 1e-9
    assert apart.max() < 0.01, "rates of the root are added up over smaller steps"


def test_a_rate_that_is_no_multiple_takes_the_nearest_frames(clips: tuple[Clip, Clip]) -> None:
    source, destination = (resample(clip, 40.0) for clip in clips)
    made = blend(resample(source, 30.0), resample(destination, 30.0), 60, 80, 10, joint_frames={"elbow.L": 4})
    fine = remade(made, source, destination, joint_frames={"elbow.L": 4})
    assert fine.blend_start == pytest.approx(60 * 4 / 3, abs=1)
    assert fine.blend_frames == pytest.approx(11 * 4 / 3 - 1, abs=1)


def test_at_the_ends_of_the_clips_no_frame_is_missed(clips: tuple[Clip, Clip]) -> None:
    source, destination = (resample(clip, 30.0) for clip in clips)
    made = blend(source, destination, 0, destination.frames - 1, 10)
    fine = remade(made, *clips)
    assert fine.blend_start == 0
    assert fine.clip.frames == fine.blend_frames


def test_warped_windows_keep_their_lengths(clips: tuple[Clip, Clip]) -> None:
    source, destination = (resample(clip, 30.0) for clip in clips)
    made = warped_blend(source, destination, 60, 80, 12, 8)
    fine = remade(made, *clips)
    assert fine.source_frames == (4 * 59 + 1, 4 * 72)
    assert fine.destination_frames[1] - fine.destination_frames[0] == 4 * 9 - 1


def test_a_registration_curve_brings_the_same_poses_into_step_at_every_rate(clips: tuple[Clip, Clip]) -> None:
    source, destination = (resample(clip, 30.0) for clip in clips)
    made = warped_blend(source, destination, 60, 100, 29, 29, in_step=True)
    plain = blend(source, destination, 60, 100, 29)
    coarse, even = joint_positions(made.clip), joint_positions(plain.clip)
    apart = []
    for rate in (60.0, 120.0):
        fine = remade(made, *(resample(clip, rate) for clip in clips), in_step=True)
        positions = joint_positions(fine.clip)[:: round(rate / 30)]
        count = min(len(positions), len(coarse))
        apart.append(np.linalg.norm(positions[:count] - coarse[:count], axis=-1).max())
    assert max(apart) < 0.3 * np.linalg.norm(coarse - even, axis=-1).max(), "the warp is the same"
