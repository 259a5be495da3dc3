"""The synthetic library's face: names, lengths, frame rates, seeds, refusals, and what every motion must keep."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from study.errors import MotionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions
from study.motion.joint_names import ROLES
from study.motion.synthetic import NAMES, describe, synthesize

SHORT_S = 6.0


@pytest.fixture(scope="module", params=NAMES)
def clip(request: pytest.FixtureRequest) -> Clip:
    return synthesize(request.param, seconds=SHORT_S, fps=60.0, seed=3)


def test_every_role_is_found() -> None:
    skeleton = synthesize("stand", seconds=0.1).skeleton
    assert set(skeleton.roles) == set(ROLES)
    assert skeleton is synthesize("run", seconds=0.1).skeleton
    assert 20 <= skeleton.joints <= 24


def test_clip_says_what_it_is(clip: Clip) -> None:
    assert clip.synthetic
    assert clip.frames == round(SHORT_S * 60.0)
    assert "seed 3" in clip.history[0]
    assert clip.name in clip.history[0]


@pytest.mark.parametrize("name", NAMES)
def test_frame_rate_only_samples_the_motion(name: str) -> None:
    slow, fast = (synthesize(name, seconds=4.0, fps=fps, seed=5) for fps in (30.0, 60.0))
    np.testing.assert_allclose(fast.root_positions[::2], slow.root_positions, atol=1e-9)
    angles = quat.half_angle_between(fast.rotations[::2], slow.rotations)
    assert angles.max() < 1e-6


def test_seed_repeats_and_varies() -> None:
    first, again, other = (synthesize("walk", seconds=3.0, seed=seed) for seed in (7, 7, 8))
    np.testing.assert_array_equal(first.rotations, again.rotations)
    np.testing.assert_array_equal(first.root_positions, again.root_positions)
    assert quat.half_angle_between(first.rotations, other.rotations).max() > 0.01


def test_no_joint_below_the_floor(clip: Clip) -> None:
    assert joint_positions(clip, ends=True)[..., 1].min() > 0.0


def test_knees_and_elbows_bend_one_way(clip: Clip) -> None:
    for role, sign in (("knee", 1.0), ("elbow", -1.0)):
        for side in "LR":
            q = clip.rotations[:, clip.skeleton.roles[f"{role}.{side}"]]
            bend = 2.0 * np.arctan2(sign * q[:, 1], q[:, 0])
            assert bend.min() > 0.0
            assert bend.max() < np.radians(155)


def test_unknown_names_are_refused_with_the_nearest() -> None:
    with pytest.raises(MotionError, match="did you mean 'walk_fast'"):
        synthesize("walk_fasst")
    with pytest.raises(MotionError, match="did you mean 'stand_to_run'"):
        describe("stand_to_runn")


def test_unknown_parameters_are_refused_with_the_nearest() -> None:
    with pytest.raises(MotionError, match="walk has no parameter 'sped' \\(did you mean 'speed'"):
        synthesize("walk", sped=1.0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seconds": 0.0}, "above 0"),
        ({"seconds": float("nan")}, "above 0"),
        ({"fps": 0.0}, "frame rate above 0"),
        ({"speed": 20.0}, "Expected speed from"),
    ],
)
def test_values_out_of_range_are_refused(arguments: dict[str, float], message: str) -> None:
    with pytest.raises(MotionError, match=message):
        synthesize("walk", **arguments)


def test_event_outside_the_motion_is_refused() -> None:
    with pytest.raises(MotionError, match="event_s from 0 to the length of 5 s"):
        synthesize("stand_to_walk", seconds=5.0, event_s=6.0)


def test_every_name_and_parameter_is_documented() -> None:
    page = (Path(__file__).parents[2] / "docs" / "synthetic.md").read_text(encoding="utf-8")
    for name in NAMES:
        assert f"`{name}`" in page, name
        for parameter in describe(name).parameters:
            assert f"`{parameter}`" in page, parameter


def test_library_needs_these_names() -> None:
    """Protocols name these in every library."""
    shared = (
        "walk_slow walk walk_fast jog run run_fast stand idle stand_to_walk stand_to_run walk_to_stop run_to_stop "
        "walk_turn_left walk_turn_right run_turn_left run_turn_right box box_combination dance dance_modern "
        "dance_turns tai_chi tai_chi_slow"
    )
    assert set(shared.split()) <= set(NAMES)


def test_default_lengths_leave_room_around_events() -> None:
    for name in ("stand_to_walk", "walk_to_stop", "run_turn_left", "walk_turn_right"):
        assert describe(name).seconds >= 10.0
