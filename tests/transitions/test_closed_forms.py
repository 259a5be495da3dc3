"""Blends against closed forms: poses between, and value and rate where the source is left and the destination reached.

A joint that turns about one axis is blended as its angles are, so that a blend of turns that are polynomials in time is
a polynomial: six frames determine it, and its derivatives are then exact.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from scipy.spatial.transform import Rotation, Slerp

from study.arrays import FloatArray
from study.motion import quaternions as quat
from study.motion.clip import Clip, trim
from study.transitions.blending import blend, blend_weights, slerp_one_way
from study.transitions.registration import registration
from study.transitions.timewarp import warped_blend
from tests.walks import make_walk

AXIS = np.array([0.48, -0.6, 0.64])
SOURCE, DESTINATION = Polynomial([0.2, 0.9, -0.5]), Polynomial([1.1, -0.7, 0.8])


def turned(angle: FloatArray) -> FloatArray:
    return quat.from_axis_angle(AXIS, angle)[:, None]


def angle_of(poses: FloatArray) -> FloatArray:
    return np.asarray(2.0 * np.arctan2(poses[..., 1:] @ AXIS, poses[..., 0]))


@pytest.mark.parametrize("weight", ["linear", "sigmoid"])
def test_a_blend_of_turns_is_the_blend_of_their_angles_and_ends_with_their_rates(weight: str) -> None:
    frames = 40
    times, share = np.arange(1, frames + 1) / (frames + 1), blend_weights(frames, weight)
    poses = slerp_one_way(turned(SOURCE(times)), turned(DESTINATION(times)), share[:, None])
    found = Polynomial.fit(times, angle_of(poses)[:, 0], 5).convert()
    ramp = Polynomial([0, 1]) if weight == "linear" else Polynomial([0, 0, 3, -2])
    apart = DESTINATION - SOURCE
    expected = SOURCE + ramp * apart
    assert angle_of(poses)[:, 0] == pytest.approx(expected(times), abs=1e-12)
    # A sigmoid ramp is level at its ends; a linear one adds its slope times the way to the destination.
    slope = 1.0 if weight == "linear" else 0.0
    for end, clip in ((0, SOURCE), (1, DESTINATION)):
        assert found(end) == pytest.approx(clip(end), abs=1e-9)
        assert found.deriv()(end) == pytest.approx(clip.deriv()(end) + slope * apart(end), abs=1e-9)


def test_poses_between_are_those_of_another_program() -> None:
    rng = np.random.default_rng(3)
    a, b = (quat.positive(quat.normalise(rng.normal(size=(1, 30, 4)))) for _ in range(2))
    share = rng.random(30)
    mixed = slerp_one_way(a, b, share[None])[0]
    for joint in range(30):
        ends = Rotation.from_quat([a[0, joint], b[0, joint]], scalar_first=True)
        apart = Slerp([0, 1], ends)(share[joint]).inv() * Rotation.from_quat(mixed[joint], scalar_first=True)
        assert apart.magnitude() < 1e-9


def clock(walk: Clip, joint: int, rate: float, start: float) -> Clip:
    """The walk, with a joint that turns evenly: between two frames, slerp gives the very same turn."""
    rotations = walk.rotations.copy()
    rotations[:, joint] = turned(start + rate * np.arange(walk.frames))[:, 0]
    return replace(walk, rotations=rotations)


@pytest.mark.parametrize("windows", [(30, 30), (30, 20), (18, 36)])
@pytest.mark.parametrize("weight", ["linear", "sigmoid"])
def test_warped_blends_and_registration_curves_follow_their_closed_forms(windows: tuple[int, int], weight: str) -> None:
    start, end = 40, 90
    in_step = windows[0] == windows[1]
    plain = make_walk(120), make_walk(120, cadence=1.3, phase=0.8)
    joint = plain[0].skeleton.role("elbow.L")
    source, destination = clock(plain[0], joint, 0.02, 0.1), clock(plain[1], joint, -0.013, 0.9)
    made = warped_blend(source, destination, start, end, *windows, weight=weight, in_step=in_step)
    count = max(windows)
    even, share = np.arange(1, count + 1) / count, blend_weights(count, weight)
    ahead = np.zeros(count)
    if in_step:
        both = trim(source, start - 1, start + count), trim(destination, end - count, end + 1)
        ahead = registration(*both).at(even)
        assert np.abs(ahead).max() > 0.01, "the curve is none to begin with"
    angles = (
        0.1 + 0.02 * (start - 1 + windows[0] * (even - 0.5 * ahead)),
        0.9 - 0.013 * (end - windows[1] + windows[1] * (even + 0.5 * ahead)),
    )
    found = angle_of(made.clip.rotations[made.blend_start : made.blend_stop, joint])
    assert found == pytest.approx((1.0 - share) * angles[0] + share * angles[1], abs=1e-9)


@pytest.mark.parametrize("fps", [30.0, 60.0, 120.0])
def test_a_blend_of_even_turns_is_the_same_at_every_frame_rate(fps: float) -> None:
    """Joints and the root's way, at the moments that all three rates have."""
    step, seconds = round(fps / 30), 1.0
    walk = make_walk(round(4 * fps), fps, swing=0.0, speed=1.0)
    slow = make_walk(round(4 * fps), fps, swing=0.0, speed=0.4)
    joint, frames = walk.skeleton.role("elbow.L"), round(seconds * fps) - 1
    source, destination = clock(walk, joint, 0.6 / fps, 0.1), clock(slow, joint, -0.4 / fps, 0.9)
    made = blend(source, destination, round(fps) + 1, round(2 * fps) - 1, frames)
    at = slice(made.blend_start - 1 + step, made.blend_stop, step)
    share = np.arange(1, 30) / 30
    expected = (1 - share) * (0.1 + 0.6 * (1 + share)) + share * (0.9 - 0.4 * (1 + share))
    assert angle_of(made.clip.rotations[at, joint]) == pytest.approx(expected, abs=1e-9)
    # Speed falls evenly from 1 to 0.4 metres a second, so the way is a parabola.
    way = made.clip.root_positions[at, 2] - made.clip.root_positions[made.blend_start - 1, 2]
    assert way == pytest.approx(share - 0.3 * share**2, abs=1e-9)
