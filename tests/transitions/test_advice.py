from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from walks import make_walk

from study.errors import TransitionError
from study.motion.clip import sample
from study.motion.library import open_library
from study.transitions.advice import advise, is_cyclic, just_noticeable, own_time
from study.transitions.blend_length import fixed_length, geodesic_length
from study.transitions.methods.registry import LENGTHS

# 2004 sections 4.3 and 4.4: what its studies two and three were about.
CYCLIC = ("walk_slow", "walk", "walk_fast", "jog", "run", "run_fast", "stand_to_walk", "walk_to_stop")
CYCLIC += ("walk_turn_left", "walk_turn_right", "run_turn_left", "run_turn_right")
FREE = ("box", "box_combination", "dance", "dance_modern", "dance_turns", "tai_chi", "tai_chi_slow", "stand", "idle")


def test_differences_in_just_noticeable_ones() -> None:
    """2004 section 5.1: 7 frames longer, 8 frames shorter, at 30 fps."""
    assert just_noticeable(7 / 30) == pytest.approx(1.0)
    assert just_noticeable(-8 / 30) == pytest.approx(1.0)
    assert just_noticeable(0.0) == 0.0
    assert just_noticeable(14 / 30) == pytest.approx(2.0)


@pytest.mark.parametrize("name", CYCLIC)
def test_gait_is_cyclic(name: str) -> None:
    assert is_cyclic(open_library("synthetic").clip(name, fps=60.0))


@pytest.mark.parametrize("name", FREE)
def test_what_has_no_gait_is_not(name: str) -> None:
    assert not is_cyclic(open_library("synthetic").clip(name, fps=60.0))


@pytest.mark.mocap
def test_captured_motions_are_told_apart(mocap: Path) -> None:
    library = open_library(mocap)
    there = set(library.names())
    assert [name for name in CYCLIC if name in there and not is_cyclic(library.clip(name))] == []
    assert [name for name in FREE if name in there and is_cyclic(library.clip(name))] == []


def test_the_own_time_of_a_swing_is_a_sixth_of_its_cycle() -> None:
    assert own_time(make_walk(150, cadence=1.0)) == pytest.approx(30 / (2 * np.pi), rel=0.1)
    assert own_time(make_walk(150, cadence=0.5)) == pytest.approx(60 / (2 * np.pi), rel=0.1)
    assert own_time(sample(make_walk(5), [0.0] * 20)) == 0.0


def test_advice_is_the_methods_own_length_at_its_point() -> None:
    source, destination = make_walk(150, name="slow"), make_walk(150, phase=1.0, cadence=1.5, swing=0.7, name="quick")
    for cyclic, method in (((True, False), "geodesic"), ((False, False), "velocity")):
        found = advise(source, destination, cyclic=cyclic)
        assert found.method == method
        own = LENGTHS[method]().at(source, destination, found.start_frame, found.end_frame)
        assert found.blend_frames == own.blend_frames
        assert found.cost == pytest.approx(own.cost, abs=1e-12)
        fixed = fixed_length(source, destination, found.start_frame, found.end_frame)
        assert found.default_cost == pytest.approx(fixed.cost)
        assert found.difference_frames == found.blend_frames - 10
        assert found.jnd == pytest.approx(just_noticeable(found.difference_frames / 30))
        assert 5 <= found.blend_frames <= 35
        assert found.start_frame >= 30
        assert found.end_frame < 120


def test_two_walks_out_of_phase_are_joined_in_phase() -> None:
    source, destination = make_walk(150), make_walk(150, phase=2.0)
    found = advise(source, destination)
    assert found.why == "both motions are cyclic"
    assert found.cost < 0.02 * np.mean(geodesic_length(source, destination, 60, 89).costs)


def test_short_clips_say_so() -> None:
    short = make_walk(45, name="short")
    found = advise(short, short, cyclic=(True, True))
    assert "the clips supply blends of up to 24 frames; 60 were asked for" in found.note
    own = geodesic_length(short, short, found.start_frame, found.end_frame)
    assert (own.blend_frames, own.cost) == (found.blend_frames, found.cost)
    with pytest.raises(TransitionError, match="found 18 in tiny"):
        advise(make_walk(18, name="tiny"), make_walk(90), cyclic=(True, True))
