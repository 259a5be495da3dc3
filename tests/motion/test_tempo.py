"""Frame times several times too long or short are found from the motion, and true ones are left alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.motion.clip import Clip
from study.motion.defects import find_defects
from study.motion.library import open_library
from study.motion.mending import mend
from study.motion.synthetic import NAMES, synthesize
from study.motion.tempo import wrong_tempo

GAITS = ("walk_slow", "walk", "walk_fast", "jog", "run", "run_fast", "stand_to_walk", "walk_turn_left")


def at(clip: Clip, times: float) -> Clip:
    """The clip with a frame time so many times too long."""
    return replace(clip, fps=clip.fps / times)


@pytest.mark.parametrize("name", NAMES)
def test_synthetic_motions_have_the_speed_of_life(name: str) -> None:
    assert wrong_tempo(synthesize(name)) is None


@pytest.mark.parametrize("times", [4.0, 0.25])
@pytest.mark.parametrize("name", GAITS)
def test_gaits_at_a_quarter_and_at_four_times_their_speed_are_found(name: str, times: float) -> None:
    found = wrong_tempo(at(synthesize(name, seconds=6.0), times))
    assert found is not None
    assert times / 2 < found.times < times * 2


def test_the_defect_says_what_to_do_and_is_not_mended() -> None:
    clip = at(synthesize("walk", seconds=4.0, fps=30.0), 4.0)
    (defect,) = [d for d in find_defects(clip) if d.kind == "frame-time"]
    assert (defect.frame_start, defect.frame_stop, defect.unit) == (0, clip.frames, "times")
    assert "about 4 times too long (30 fps rather than 7.5?)" in defect.message
    assert "`fps` in library.toml" in defect.message
    assert mend(clip).fps == clip.fps


def jumping(times: float, gravity: float = 9.81) -> Clip:
    """Somebody who stands and jumps 30 cm high twice, on parabolas; nothing else moves."""
    standing = synthesize("stand", seconds=4.0, fps=120.0)
    seconds = np.arange(standing.frames) / 120.0
    flight = np.sqrt(8.0 * 0.3 / gravity)
    height = np.zeros(standing.frames)
    for start in (1.0, 2.5):
        inside = np.clip(seconds - start, 0.0, flight)
        height += 0.5 * gravity * inside * (flight - inside)
    path = standing.root_positions + height[:, None] * [0.0, 1.0, 0.0]
    return at(replace(standing, root_positions=path), times)


def test_jumps_fall_as_stones_do() -> None:
    assert wrong_tempo(jumping(1.0)) is None
    slow, quick = wrong_tempo(jumping(4.0)), wrong_tempo(jumping(0.25))
    assert slow is not None
    assert quick is not None
    assert slow.times == pytest.approx(4.0, rel=0.1)
    assert quick.times == pytest.approx(0.25, rel=0.1)


def test_too_short_and_legless_clips_are_left_alone() -> None:
    walk = synthesize("walk", seconds=2.0, fps=30.0)
    assert (
        wrong_tempo(at(replace(walk, root_positions=walk.root_positions[:2], rotations=walk.rotations[:2]), 4)) is None
    )


@pytest.mark.mocap
def test_no_captured_motion_is_taken_for_too_slow_or_quick(mocap: Path) -> None:
    for folder in ("cmu", "cmu_bvh", "bandai", "perfume"):
        library = open_library(mocap / folder)
        for name in library.distinct():
            assert wrong_tempo(library.clip(name)) is None, name


@pytest.mark.mocap
@pytest.mark.parametrize("times", [4.0, 0.25])
def test_captured_walks_and_runs_at_another_speed_are_found(mocap: Path, times: float) -> None:
    trials = ("02_01", "07_04", "16_15", "07_01", "16_21", "02_03", "16_35", "09_02", "16_45", "127_08")
    library = open_library(mocap)
    for name in (*trials, "dataset-1_walk_tired_001", "dataset-1_run_active_001"):
        found = wrong_tempo(at(library.clip(name), times))
        assert found is not None, name
        assert (found.times > 1.0) == (times > 1.0), name
