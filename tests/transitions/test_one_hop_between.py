"""Clips between two of one gait: against the walk that they must be, by closed form, and by the clips' own measures."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.errors import TransitionError
from study.motion.clip import Clip, joint_positions, resample, sample, trim
from study.motion.library import open_library
from study.motion.synthetic import synthesize
from study.transitions.flaws import find_flaws
from study.transitions.one_hop.between import in_step, mixed
from study.transitions.one_hop.build import build_table
from study.transitions.one_hop.play import Trigger, play
from study.transitions.one_hop.problem import Alignment, Problem, Settings, Switch
from study.transitions.registration import registration
from study.transitions.support import footwork
from tests.walks import make_walk

FPS, SLOW_HZ, FAST_HZ = 60.0, 0.8, 1.25


def way_m(clip: Clip) -> float:
    return float(np.linalg.norm(np.diff(clip.root_positions[:, [0, 2]], axis=0), axis=1).sum())


def cycle_frames(clip: Clip) -> float:
    """From one passing of the ankles to the next of the same kind, frames, between frames by a straight line."""
    positions, roles = joint_positions(clip), clip.skeleton.roles
    apart = (positions[:, roles["ankle.L"]] - positions[:, roles["ankle.R"]])[:, 2]
    at = np.flatnonzero((apart[:-1] < 0) & (apart[1:] >= 0))
    return float(np.diff(at + apart[at] / (apart[at] - apart[at + 1])).mean())


@pytest.fixture(scope="module")
def walks() -> tuple[Clip, Clip]:
    """One walk at two tempi, the second three tenths of a cycle later, with steps of one length."""
    slow = make_walk(600, FPS, cadence=SLOW_HZ, speed=0.8)
    fast = make_walk(420, FPS, cadence=FAST_HZ, speed=1.25, phase=0.6 * np.pi)
    return replace(slow, name="slow"), replace(fast, name="fast")


@pytest.mark.parametrize("share", [0.25, 0.5, 0.8])
def test_one_walk_at_two_tempi_gives_that_walk_at_the_tempo_between(walks: tuple[Clip, Clip], share: float) -> None:
    pair = in_step(*walks)
    clip = mixed(pair, share)
    period = (1 - share) * FPS / SLOW_HZ + share * FPS / FAST_HZ
    assert cycle_frames(clip) == pytest.approx(period, abs=0.1)
    assert clip.frames == pytest.approx(pair.cycles * period, abs=2.0)
    # Steps are as long in both, so a metre a cycle.
    assert way_m(clip) / (clip.frames - 1) * period == pytest.approx(1.0, abs=0.005)
    fine = sample(walks[0], np.arange(100.0, 180.0, 0.05))
    own, made = (joint_positions(one) - one.root_positions[:, None] for one in (fine, clip))
    apart = [np.linalg.norm(own - pose, axis=-1).max(axis=1).min() for pose in made[::7]]
    assert max(apart) < 0.012, "every pose is one of the walk, within a centimetre"


def test_all_of_one_clip_is_that_clip_and_speeds_lie_evenly_between() -> None:
    slow, fast = (synthesize(name, seconds=6.0, fps=FPS) for name in ("walk_slow", "walk_fast"))
    pair = in_step(slow, fast)
    curve = np.linspace(0.0, 1.0, 4001)
    times = pair.times(curve)
    assert min(np.diff(each).min() for each in times) > 0.0
    for share, times_of, clip in ((0.0, times[0], slow), (1.0, times[1], fast)):
        made = mixed(pair, share)
        own = sample(clip, times_of[0] + np.arange(1, made.frames + 1))
        alike = np.abs(np.sum(made.rotations[:, 1:] * own.rotations[:, 1:], axis=-1))
        np.testing.assert_allclose(alike, 1.0, atol=1e-6)
        assert way_m(made) == pytest.approx(way_m(own), rel=1e-6)
    ends = [FPS * way / frames for way, frames in zip(pair.ways_m, pair.frames, strict=True)]
    speeds = [FPS * way_m(clip) / (clip.frames - 1) for clip in (mixed(pair, share) for share in pair.shares(3))]
    np.testing.assert_allclose(speeds, np.linspace(*ends, 5)[1:-1], rtol=0.01)
    np.testing.assert_allclose(in_step(slow, slow).shares(3), [0.25, 0.5, 0.75])


def assert_feet_stand(slow: Clip, fast: Clip) -> None:
    pair = in_step(slow, fast)
    for share in pair.shares(3):
        clip = mixed(pair, share)
        assert list(find_flaws(clip, (0, clip.frames), pair.clips).told()) == []


@pytest.mark.parametrize(("slow", "fast"), [("walk_slow", "walk_fast"), ("jog", "run_fast")])
def test_feet_stand_as_they_do_in_the_clips(slow: str, fast: str) -> None:
    assert_feet_stand(*(synthesize(name, seconds=6.0, fps=FPS) for name in (slow, fast)))


@pytest.mark.mocap
@pytest.mark.parametrize(("slow", "fast"), [("07_04", "07_01"), ("07_01", "07_12"), ("02_03", "09_01")])
def test_feet_stand_as_they_do_in_captured_clips(mocap: Path, slow: str, fast: str) -> None:
    library = open_library(mocap / "cmu_bvh")
    assert_feet_stand(*(library.clip(name, fps=FPS) for name in (slow, fast)))


def test_feet_that_stand_in_one_clip_stand_in_the_other() -> None:
    """A slow walk has its feet down for longer; by poses alone, the clips agree less often on which bear weight."""
    pair = in_step(*(synthesize(name, seconds=6.0, fps=FPS) for name in ("walk_slow", "walk_fast")))
    even = np.linspace(0.0, 1.0, round(max(pair.frames)) + 1)
    places = zip(pair.clips, pair.starts, pair.frames, strict=True)
    by_poses = replace(
        pair, lead=registration(*(sample(clip, start + length * even) for clip, start, length in places))
    )
    apart = []
    for one in (pair, by_poses):
        held = [
            footwork(clip).weight[np.minimum(at.astype(int), clip.frames - 2)]
            for clip, at in zip(one.clips, one.times(even), strict=True)
        ]
        apart.append(np.abs(held[0] - held[1]).mean())
    assert apart[0] < 0.75 * apart[1]


def test_it_is_a_state_like_any_other(walks: tuple[Clip, Clip]) -> None:
    clips = (*walks, mixed(in_step(*walks), 0.5, "between"))
    clips = tuple(resample(clip, 30.0) for clip in clips)
    problem = Problem(clips, (Switch(0, 2, Alignment(destination_frame=20)),), Settings(10, 10, 10), 1000)
    table = build_table(problem)
    played = play(clips, table, [Trigger(60, 2)])
    assert played.segments[-1].clip == 2


@pytest.mark.parametrize(
    ("slow", "fast", "found"),
    [
        ("stand", "walk", r"stand to end in steps that repeat, found standing\. Give two walks"),
        ("walk", "dance", "dance to end in steps that repeat, found none"),
    ],
)
def test_what_is_no_gait_is_refused(slow: str, fast: str, found: str) -> None:
    with pytest.raises(TransitionError, match=found):
        in_step(*(synthesize(name, seconds=6.0, fps=FPS) for name in (slow, fast)))


def test_other_rates_and_too_short_clips_are_refused(walks: tuple[Clip, Clip]) -> None:
    with pytest.raises(TransitionError, match="one frame rate, found 60 and 30 fps"):
        in_step(walks[0], resample(walks[1], 30.0))
    walk = synthesize("walk", seconds=6.0, fps=FPS)
    step = trim(walk, 100, 160)
    with pytest.raises(TransitionError, match=r"whole gait cycle, \d+ frames and one more, found 60 frames"):
        in_step(step, walk)
