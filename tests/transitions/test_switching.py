"""Inertialization and dead blending: decays by closed form, and transitions whose pose and speed have no jump."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.polynomial import Chebyshev, Polynomial
from scipy.integrate import quad, solve_ivp
from walks import make_walk

from study.errors import TransitionError
from study.motion.clip import Clip, joint_positions, moved
from study.transitions.blending import Transition, blend_weights, cut, facing
from study.transitions.switching import (
    SPRING_LEFT,
    Decay,
    Extrapolation,
    dead_blended,
    inertialized,
    matched_blend_s,
    matching_halflife_s,
    quintic,
    spring,
    spring_s,
)

OFFSETS = [(1.0, 0.0), (0.4, -0.3), (0.4, -6.0), (0.02, -3.0), (2.0, 1.5)]


def at(decay: Decay, x: float, v: float, times: np.ndarray) -> np.ndarray:
    return decay(np.array([[x]]), np.array([[v]]), times)[:, 0, 0]


def interpolated(function: Callable[[np.ndarray], np.ndarray], until: float) -> Chebyshev:
    """A smooth function by a polynomial that differs from it by 1e-13 or so, and has derivatives."""
    return Chebyshev.interpolate(function, 24, (0.0, until * (1 - 1e-15)))


@pytest.mark.parametrize(("x", "v"), OFFSETS)
def test_the_quintic_has_the_offset_and_a_falling_rate_at_the_switch_and_rests_at_the_end(x: float, v: float) -> None:
    seconds = 0.5
    until = min(seconds, 5 * x / -v) if v < 0 else seconds
    # Six points determine the polynomial, whose derivatives are then exact.
    times = np.linspace(0, until * (1 - 1e-12), 6)
    found = Polynomial.fit(times / until, at(quintic(seconds), x, v, times), 5).convert()
    assert found(0) == pytest.approx(x, abs=1e-9)
    assert found.deriv(1)(0) / until == pytest.approx(min(v, 0), abs=1e-9)
    assert [found.deriv(order)(1) / until**order for order in (0, 1)] == pytest.approx([0, 0], abs=1e-9)
    assert found.deriv(2)(1) == pytest.approx(0, abs=1e-9)
    path = at(quintic(seconds), x, v, np.linspace(0, 1, 2001))
    assert np.all(path >= -1e-12), "it never goes beyond the destination"
    assert np.all(np.diff(path) <= 1e-12), "and never back"
    assert np.all(path[np.linspace(0, 1, 2001) >= until] == 0)


@pytest.mark.parametrize(("x", "v"), OFFSETS)
def test_the_spring_solves_its_equation_until_its_last_hundredth(x: float, v: float) -> None:
    halflife = 0.1
    stiffness = 2 * np.log(2) / halflife
    seconds = 3.0
    times = np.linspace(0, 0.8, 9)
    motion = solve_ivp(lambda _, s: [s[1], -(stiffness**2) * s[0] - 2 * stiffness * s[1]], (0, 1), [x, v],
                       t_eval=times, rtol=1e-11, atol=1e-12)  # fmt: skip
    assert at(spring(halflife, seconds), x, v, times) == pytest.approx(motion.y[0], abs=1e-8)
    short = spring_s(halflife)
    ended = interpolated(lambda times: at(spring(halflife, short), x, v, times), short)
    assert [ended(0), ended.deriv()(0), ended(short), ended.deriv()(short)] == pytest.approx([x, v, 0, 0], abs=1e-9)
    assert at(spring(halflife, short), x, v, np.array([short, short + 1])).tolist() == [0, 0]
    assert at(spring(halflife, 100.0), 1.0, 0.0, np.array([short]))[0] == pytest.approx(SPRING_LEFT, rel=1e-4)


def test_decays_leave_as_much_as_a_blend_of_their_length_does() -> None:
    blend_s = 0.8
    halflife = matching_halflife_s(blend_s)
    assert matched_blend_s(halflife) == pytest.approx(blend_s)
    left = quad(lambda t: at(spring(halflife, 1000.0), 1.0, 0.0, np.array([t]))[0], 0, 20, limit=200)[0]
    assert left == pytest.approx(blend_s / 2, rel=1e-6)
    left = quad(lambda t: at(quintic(blend_s), 1.0, 0.0, np.array([t]))[0], 0, blend_s)[0]
    assert left == pytest.approx(blend_s / 2, rel=1e-6)


def test_the_source_is_moved_on_by_a_speed_that_halves_and_keeps_to_its_bounds() -> None:
    way, speed = np.array([[1.0, -1.0, 1.0, 0.2]]), np.array([[2.0, 2.0, 0.1, 0.0]])
    on = Extrapolation()
    assert on.halflives(way, speed)[0] == pytest.approx([0.5, 0.05, 1.0, 1.0])
    times = np.array([0.0, 0.25, 0.5, 4.0])
    slowing = [[quad(lambda s, h=h, v=v: v * 0.5 ** (s / h), 0, t)[0] for h, v in
                zip(on.halflives(way, speed)[0], speed[0], strict=True)] for t in times]  # fmt: skip
    assert on.moved(way, speed, times)[:, 0] == pytest.approx(np.array(slowing), abs=1e-9)


@pytest.mark.parametrize(("way", "speed"), [(1.0, 2.0), (-1.0, 2.0), (1.0, 0.1), (0.2, 0.0), (0.3, -4.0)])
def test_a_dead_blend_has_the_source_and_its_rate_at_the_switch_and_the_destination_and_its_rate_at_the_end(
    way: float, speed: float
) -> None:
    """By the product rule from its two factors: the source moved on, and a weight that is level at both ends."""
    ahead = interpolated(
        lambda times: Extrapolation().moved(np.array([[way]]), np.array([[speed]]), times)[:, 0, 0], 0.1
    )
    assert [ahead(0), ahead.deriv()(0)] == pytest.approx([0, speed], abs=1e-9)
    times = np.arange(1, 20) / 20
    share = Polynomial.fit(times, blend_weights(19, "sigmoid"), 3).convert()
    assert [share(0), share.deriv()(0), share(1), share.deriv()(1)] == pytest.approx([0, 0, 1, 0], abs=1e-9)
    assert share(times) == pytest.approx(blend_weights(19, "sigmoid"), abs=1e-12)
    assert share.integ()(1) - share.integ()(0) == pytest.approx(0.5), "as a linear blend, on average over time"


BLEND_S, SWITCH_S, ENTERED_S = 0.8, 2.0, 1.0
KINDS = ("quintic", "spring", "dead")


def made(kind: str, source: Clip, destination: Clip, blend_s: float = BLEND_S) -> Transition:
    """A transition whose last source frame is at `SWITCH_S`, where the destination is at `ENTERED_S`."""
    fps = source.fps
    start, count = round(SWITCH_S * fps) + 1, round(blend_s * fps) - 1
    end = round(ENTERED_S * fps) + count
    if kind == "dead":
        return dead_blended(source, destination, start, end, count, Extrapolation())
    if kind == "quintic":
        return inertialized(source, destination, start, end, count, quintic(blend_s))
    halflife = matching_halflife_s(blend_s)
    frames = round(spring_s(halflife) * fps)
    decay = spring(halflife, (frames + 1) / fps)
    return inertialized(source, destination, start, end, frames, decay, placed_frames=count)


def pair(fps: float) -> tuple[Clip, Clip]:
    """A slow walk and a fast one in another phase that turns, at a frame rate."""
    frames = round(5 * fps)
    return (
        make_walk(frames, fps, speed=1.0, swing=0.4),
        make_walk(frames, fps, speed=2.4, swing=0.7, cadence=1.3, phase=1.9, heading=2.0, turn_rate=0.6),
    )


@pytest.mark.parametrize("kind", ["quintic", "spring"])
def test_switching_to_the_clip_itself_in_phase_gives_the_clip(kind: str) -> None:
    walk = make_walk(150, turn_rate=0.4)
    start, count = 61, 20
    decay = quintic(21 / 30) if kind == "quintic" else spring(0.1, 21 / 30)
    result = inertialized(walk, walk, start, start + count - 1, count, decay)
    np.testing.assert_allclose(result.clip.root_positions, walk.root_positions, atol=1e-9)
    np.testing.assert_allclose(np.abs(np.sum(result.clip.rotations * walk.rotations, axis=-1)), 1.0, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_frames_outside_are_the_clips_own(kind: str) -> None:
    source, destination = pair(30.0)
    result = made(kind, source, destination)
    assert (result.blend_start, result.blend_stop - result.blend_start) == (61, result.blend_frames)
    np.testing.assert_array_equal(result.clip.rotations[:61], source.rotations[:61])
    tail = moved(destination, result.alignment.yaw, np.array(result.alignment.translation))
    after = result.destination_frames[1]
    np.testing.assert_allclose(result.clip.root_positions[result.blend_stop :], tail.root_positions[after:], atol=1e-12)
    ends = joint_positions(result.clip)[result.blend_stop :]
    np.testing.assert_allclose(ends, joint_positions(tail)[after:], atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_neither_poses_nor_speeds_jump_at_either_end(kind: str) -> None:
    source, destination = pair(120.0)
    result = made(kind, source, destination)
    positions = joint_positions(result.clip)
    speeds = np.diff(positions, axis=0) * 120.0
    bends = np.linalg.norm(np.diff(speeds, axis=0), axis=-1).max(axis=1)
    motions = [joint_positions(clip) * 120.0 for clip in (source, destination)]
    own = max(np.linalg.norm(np.diff(motion, n=2, axis=0), axis=-1).max() for motion in motions)
    quickest = sum(np.linalg.norm(np.diff(motion, axis=0), axis=-1).max() for motion in motions)
    for frame in (result.blend_start - 1, result.blend_start, result.blend_stop - 1, result.blend_stop):
        # A quintic drops what of the offset's rate does not fall along the offset, which is a step in speed; a jump of
        # the pose would be eighty metres a second here, as in a cut.
        assert bends[frame - 1] < (quickest if kind == "quintic" and frame <= result.blend_start else 3 * own), frame
    at_cut = np.diff(joint_positions(cut(source, destination, 241, 120).clip), axis=0)
    assert np.linalg.norm(at_cut, axis=-1).max() * 120 > 3 * quickest
    turns = np.diff(facing(result.clip)) * 120.0
    assert np.abs(np.diff(turns)).max() < 0.2


@pytest.mark.parametrize("kind", KINDS)
def test_frame_rates_agree(kind: str) -> None:
    """The same transition sampled at 30, 60 and 120 fps, to what velocities over two frames differ by."""
    fine = joint_positions(made(kind, *pair(240.0)).clip)[::8]
    apart = []
    for fps in (30.0, 60.0, 120.0):
        coarse = joint_positions(made(kind, *pair(fps)).clip)[:: round(fps / 30)]
        frames = min(len(fine), len(coarse), 100)
        apart.append(np.linalg.norm(coarse[:frames] - fine[:frames], axis=-1).max())
    assert apart[0] < 0.03, "metres, at 30 fps"
    assert apart[1] < 0.5 * apart[0]
    assert apart[2] < 0.5 * apart[1]


def test_a_dead_blend_holds_to_a_source_that_goes_where_the_destination_is() -> None:
    """At the first blended frames the pose is the source's own, moved on at its speed."""
    source, destination = make_walk(150), make_walk(150, phase=0.4)
    result = made("dead", source, destination)
    own, mixed = joint_positions(source)[61:64], joint_positions(result.clip)[61:64]
    held = joint_positions(source)[60]
    assert np.linalg.norm(own - mixed, axis=-1).max() < 0.4 * np.linalg.norm(own - held, axis=-1).max()


@pytest.mark.parametrize(("start", "end", "count", "found"), [
    (0, 40, 10, "lacks 1 frame before its first"),
    (20, 9, 10, "lacks 1 frame before its first"),
    (20, 148, 10, "20 frames after it"),
])  # fmt: skip
def test_what_the_clips_lack_is_said(start: int, end: int, count: int, found: str) -> None:
    walk = make_walk(150)
    with pytest.raises(TransitionError, match=found):
        inertialized(walk, walk, start, end, 2 * count, quintic(0.5), placed_frames=count)


def test_a_switch_at_the_beginning_of_a_clip_takes_both_velocities_over_the_same_frames() -> None:
    """A clip that goes on as itself from its second frame has no offset and no rate of one."""
    walk = make_walk(90)
    later = make_walk(89, phase=2 * np.pi / 30)  # the same walk from its second frame on
    result = inertialized(walk, later, 2, 10, 10, quintic(11 / 30))
    assert result.destination_frames == (1, 11)
    np.testing.assert_allclose(joint_positions(result.clip), joint_positions(walk)[: result.clip.frames], atol=1e-9)
