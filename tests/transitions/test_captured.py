"""Transitions between captured clips: what the papers and an animator's eye expect of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, moved, resample, trim
from study.motion.readers.registry import read_clip
from study.transitions.blend_length import geodesic_length, joint_costs
from study.transitions.blending import blend, cut, facing
from study.transitions.flaws import find_flaws
from study.transitions.footskate import plant_feet
from study.transitions.support import footwork
from study.transitions.timewarp import warp_length
from study.transitions.weights import joint_weights

pytestmark = pytest.mark.mocap

# CMU subject 16: walks, a start, a stop, runs and a running turn; source frame and destination frame, at 30 fps.
PAIRS = {
    "walk to walk": ("16_15", "16_21", 40, 60),
    "walk to another walk": ("16_15", "16_16", 35, 75),
    "walk to walking turn": ("16_21", "16_17", 30, 60),
    "start to walk": ("16_31", "16_15", 30, 80),
    "start to run": ("16_31", "16_35", 50, 30),
    "run to running turn": ("16_35", "16_41", 12, 30),
}


@pytest.fixture(scope="module")
def clips(mocap: Path) -> Any:
    names = sorted({name for pair in PAIRS.values() for name in pair[:2]})
    folder = mocap / "cmu" / "subjects" / "16"
    # The first frames of some trials jump in a shoulder.
    loaded = {name: resample(read_clip(folder / f"{name}.amc"), 30.0) for name in names}
    return {name: trim(clip, 1, clip.frames) for name, clip in loaded.items()}


def chosen(clips: Any, name: str) -> Any:
    source, destination, start, end = PAIRS[name]
    length = geodesic_length(clips[source], clips[destination], start, end)
    return clips[source], clips[destination], start, end, length.blend_frames


def local_velocity(clip: Clip) -> Any:
    """Root velocity on the floor in the figure's facing, m/s: `x` to its left, `z` ahead."""
    heading = facing(clip)
    steps = np.diff(clip.root_positions, axis=0) * [1.0, 0.0, 1.0] * clip.fps
    return quat.rotate(quat.yaw(-0.5 * (heading[1:] + heading[:-1])), steps)


@pytest.mark.parametrize("name", PAIRS)
def test_the_root_moves_no_more_abruptly_than_in_the_clips(clips: Any, name: str) -> None:
    source, destination, start, end, length = chosen(clips, name)
    for frames in (length, 10):
        result = blend(source, destination, start, end, frames)
        around = slice(max(0, result.blend_start - 3), result.blend_stop + 2)
        own = [local_velocity(clip) for clip in (source, destination)]
        velocity = local_velocity(result.clip)
        assert np.max(np.abs(velocity[around, 0])) <= max(np.max(np.abs(v[:, 0])) for v in own) + 0.02
        own_change = max(np.max(np.linalg.norm(np.diff(v, axis=0), axis=1)) for v in own)
        change = np.linalg.norm(np.diff(velocity[around], axis=0), axis=1)
        # Beside what the clips do, the ramp from one velocity to the other.
        assert np.max(change) <= own_change + np.max(np.linalg.norm(own[0].mean(0) - own[1].mean(0))) / (frames + 1)


@pytest.mark.parametrize("name", PAIRS)
def test_feet_stand_and_joints_do_not_pop(clips: Any, name: str) -> None:
    source, destination, start, end, length = chosen(clips, name)
    raw = blend(source, destination, start, end, length)
    planted = plant_feet(raw, source, destination)
    before, after = (
        find_flaws(one.clip, (one.blend_start, one.blend_stop), (source, destination)) for one in (raw, planted)
    )
    assert after.unsupported_share <= max(after.own_unsupported_share, 0.3 * before.unsupported_share) + 0.1
    assert after.sink_m < 0.01
    assert after.toe_acceleration_times < 1.5
    assert after.joint_velocity_change_times <= 1.0
    assert after.root_velocity_change_times <= 1.0
    np.testing.assert_array_equal(planted.clip.rotations[: raw.blend_start], raw.clip.rotations[: raw.blend_start])
    np.testing.assert_array_equal(planted.clip.root_positions[: raw.blend_start], source.root_positions[:start])


def test_the_feet_of_a_walk_bear_weight_in_turn(clips: Any) -> None:
    weight = footwork(clips["16_15"]).weight
    assert (weight.max(axis=1) > 0.5).mean() > 0.95
    share = (weight > 0.5).mean(axis=0)
    # A foot bears weight for some 60% of a walking cycle.
    assert np.all((share > 0.45) & (share < 0.8))
    assert (footwork(clips["16_35"]).weight > 0.5).all(axis=1).mean() < 0.05


def test_walking_has_the_cost_curve_of_2004_figures_3_and_5(clips: Any) -> None:
    """One deep minimum a cycle, a little over a second apart, on which hips and knees agree."""
    source, destination, start, end = clips["16_15"], clips["16_16"], 35, 75
    found = geodesic_length(source, destination, start, end)
    assert found.costs is not None
    low = 1 + np.flatnonzero((found.costs[1:-1] < found.costs[:-2]) & (found.costs[1:-1] < found.costs[2:]))
    assert len(low) == 2
    assert 0.9 < (low[1] - low[0]) / 30 < 1.4
    assert found.cost < 0.05 * found.costs.max()
    joints = np.array([source.skeleton.role(f"{part}.{side}") for part in ("hip", "knee") for side in "LR"])
    each = joint_costs(source, destination, start, end, 60, joints)
    assert np.all(each[:, low] < 0.15 * each.max(axis=1, keepdims=True))


def test_a_warp_finds_a_pair_of_lengths_that_costs_no_more(clips: Any) -> None:
    for source, destination, start, end in PAIRS.values():
        pair = clips[source], clips[destination]
        plain = geodesic_length(*pair, start, end, longest=20)
        warped = warp_length(*pair, start, end, longest=20)
        assert warped.cost <= plain.cost + 1e-12


def test_turning_a_clip_on_the_floor_changes_no_length_and_no_pose(clips: Any) -> None:
    source, destination = clips["16_35"], clips["16_41"]
    turned = moved(destination, np.radians(170), np.array([4.0, 0.0, -2.0]))
    lengths = [geodesic_length(source, clip, 12, 30).blend_frames for clip in (turned, destination)]
    assert lengths[0] == lengths[1]
    np.testing.assert_allclose(
        joint_positions(blend(source, turned, 12, 30, 15).clip),
        joint_positions(blend(source, destination, 12, 30, 15).clip),
        atol=1e-11,
    )


def test_a_cut_keeps_place_and_facing(clips: Any) -> None:
    source, destination = clips["16_15"], clips["16_41"]
    result = cut(source, destination, 60, 10)
    np.testing.assert_allclose(result.clip.root_positions[60, [0, 2]], source.root_positions[60, [0, 2]], atol=1e-12)
    assert facing(trim(result.clip, 60, 61))[0] == pytest.approx(facing(trim(source, 60, 61))[0], abs=1e-12)


def test_the_hips_outweigh_the_elbows_on_a_captured_rig(clips: Any) -> None:
    skeleton = clips["16_15"].skeleton
    weights = joint_weights(skeleton)
    named = {skeleton.names[joint]: weights[joint] for joint in np.flatnonzero(weights)}
    assert named == {
        "lfemur": 1.0,
        "rfemur": 1.0,
        "ltibia": 0.0901,
        "rtibia": 0.0901,
        "lhumerus": 0.7884,
        "rhumerus": 0.7884,
        "lradius": 0.0247,
        "rradius": 0.0247,
    }
