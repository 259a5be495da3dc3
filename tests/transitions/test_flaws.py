from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest

from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions
from study.motion.synthetic import synthesize
from study.transitions.flaws import Flaws, find_flaws


@pytest.fixture(scope="module")
def stand() -> Clip:
    """Sixty frames of one pose."""
    clip = synthesize("stand", seconds=2.0)
    frames = np.zeros(60, dtype=int)
    return replace(clip, root_positions=clip.root_positions[frames], rotations=clip.rotations[frames])


def moving(clip: Clip, path: Any) -> Clip:
    """The clip on a path `(frames, 3)`."""
    return replace(clip, root_positions=clip.root_positions + path)


def ahead(values: Any) -> Any:
    return np.outer(values, [0.0, 0.0, 1.0])


@pytest.mark.parametrize("name", ["walk", "run", "dance_modern", "stand"])
def test_a_motion_beside_itself_has_no_flaws(name: str) -> None:
    clip = synthesize(name, seconds=6.0)
    flaws = find_flaws(clip, (60, 90), [clip])
    assert not list(flaws.told())
    assert flaws.sink_m <= 0.0
    assert max(flaws.toe_acceleration_times, flaws.joint_velocity_change_times, flaws.root_velocity_change_times) <= 1.0


def test_gliding_is_skating_of_both_feet(stand: Clip) -> None:
    # A third of the blended frames at 1 m/s; a frame with a slow step on either side still stands.
    speed = np.zeros(59)
    speed[25:35] = 1.0 / 30
    flaws = find_flaws(moving(stand, ahead(np.concatenate([[0.0], np.cumsum(speed)]))), (20, 47), [stand])
    assert (
        flaws.unsupported_share
        == flaws.left.skating_share
        == flaws.right.skating_share
        == pytest.approx(9 / 27, abs=1e-6)
    )
    assert flaws.own_unsupported_share == flaws.airborne_share == 0.0
    assert "no foot stands in 33% of the blended frames" in next(iter(flaws.told()))


def test_a_foot_that_sinks_and_one_that_floats(stand: Clip) -> None:
    down = np.zeros((60, 3))
    down[30:34, 1] = -0.05
    sunk = find_flaws(moving(stand, down), (25, 40), [stand])
    assert sunk.sink_m == pytest.approx(0.05)
    assert any("sinks 5 cm" in told for told in sunk.told())
    up = np.zeros((60, 3))
    up[30:36, 1] = 0.05
    assert find_flaws(moving(stand, up), (28, 40), [stand]).airborne_share == pytest.approx(6 / 12)


def test_accelerations_and_changes_of_velocity_in_closed_form(stand: Clip) -> None:
    seconds = np.arange(60) / 30
    steady = find_flaws(moving(stand, ahead(0.5 * 2.0 * seconds**2)), (20, 40), [stand])
    assert steady.left.toe_acceleration_m_per_s2 == pytest.approx(2.0, abs=1e-5)
    assert steady.root_velocity_change_m_per_s == pytest.approx(2.0 / 30, abs=1e-5)
    hop = find_flaws(moving(stand, ahead(0.05 * (np.arange(60) >= 30))), (20, 40), [stand])
    assert hop.root_velocity_change_m_per_s == pytest.approx(0.05 * 30, abs=1e-5)
    rotations = stand.rotations.copy()
    elbow = stand.skeleton.role("elbow.L")
    rotations[30:, elbow] = quat.multiply(rotations[30:, elbow], quat.from_axis_angle([0.0, 0.0, 1.0], 0.2))
    turned = find_flaws(replace(stand, rotations=rotations), (20, 40), [stand])
    assert turned.joint_velocity_change_rad_per_s == pytest.approx(0.2 * 30, abs=1e-4)
    assert turned.own_joint_velocity_change_rad_per_s == 0.0


def test_swinging_low_is_skating_in_the_motion_too() -> None:
    walk = synthesize("walk", seconds=6.0)
    flaws = find_flaws(walk, (60, 120), [walk])
    assert 0.05 < flaws.left.own_skating_share < 0.4
    assert flaws.left.skating_share == pytest.approx(flaws.left.own_skating_share, abs=0.1)
    assert flaws.own_unsupported_share < 0.02


def test_where_the_figure_stands_and_what_it_is_made_from_in_which_order_do_not_matter() -> None:
    walk, run = synthesize("walk", seconds=5.0), synthesize("run", seconds=5.0)
    here = find_flaws(walk, (40, 60), [walk, run])
    there = find_flaws(moving(walk, np.array([5.0, 0.0, -3.0])), (40, 60), [run, walk])
    for key, value in asdict(here).items():
        assert asdict(there)[key] == pytest.approx(value, abs=2e-6)


def test_a_cut_has_no_share_of_frames_but_its_jump_is_seen(stand: Clip) -> None:
    flaws = find_flaws(moving(stand, ahead(0.05 * (np.arange(60) >= 30))), (30, 30), [stand])
    assert flaws.unsupported_share == flaws.airborne_share == 0.0
    assert flaws.root_velocity_change_m_per_s == pytest.approx(1.5, abs=1e-5)
    assert flaws.severity > 1


def test_figures_of_the_measure_itself_are_those_of_plain_arithmetic() -> None:
    """Heights of the toes point by point, without the module's own code."""
    walk = synthesize("walk", seconds=4.0)
    lowered = replace(walk, root_positions=walk.root_positions - [0.0, 0.01, 0.0])
    flaws: Flaws = find_flaws(lowered, (0, walk.frames), [walk])
    positions = joint_positions(walk, ends=True)
    assert flaws.left.sink_m == pytest.approx(0.01, abs=1e-6)
    toe = positions[:, walk.skeleton.role("toe.L")]
    largest = max(np.linalg.norm(toe[f + 1] - 2 * toe[f] + toe[f - 1]) * 900 for f in range(1, len(toe) - 1))
    assert flaws.left.toe_acceleration_m_per_s2 == pytest.approx(largest, abs=1e-4)
