from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from walks import make_walk

from study.errors import TransitionError
from study.transitions.batch import geodesic_lengths, velocity_lengths
from study.transitions.blend_length import BlendLength, geodesic_length, velocity_length


def test_many_at_once_are_what_they_are_one_by_one() -> None:
    source, destination = make_walk(200, phase=0.3), make_walk(180, phase=2.0, cadence=1.3, swing=0.7)
    rng = np.random.default_rng(5)
    starts, ends = rng.integers(0, 141, 60), rng.integers(59, 180, 60)
    lengths, costs = geodesic_lengths(source, destination, starts, ends)
    for i, j, length, cost in zip(starts, ends, lengths, costs, strict=True):
        one = geodesic_length(source, destination, int(i), int(j))
        assert one.costs is not None
        assert one.costs[length - 1] == pytest.approx(one.cost, abs=1e-13)
        assert cost == pytest.approx(one.cost, abs=1e-13)


@pytest.mark.parametrize(
    ("starts", "ends", "message"),
    [
        (
            [0, 41],
            [59, 99],
            "start frames from 0 to 40 in the source.*1 of 2 transitions do not, the first from 41 to 99",
        ),
        ([0], [58], "end frames from 59 to 99.*1 of 1 transition do not"),
        ([-1], [60], "first from -1 to 60"),
        ([0, 1], [60], r"as many start frames as end frames.*\(2,\) and \(1,\)"),
    ],
)
def test_frames_that_are_not_there_are_counted(starts: list[int], ends: list[int], message: str) -> None:
    # At 1800 frames a second the shortest blend takes 60 frames.
    with pytest.raises(TransitionError, match=message):
        geodesic_lengths(make_walk(100, 1800.0), make_walk(100, 1800.0), starts, ends)


def test_velocity_lengths_are_those_found_one_by_one() -> None:
    source, destination = make_walk(90, phase=0.4), make_walk(80, phase=2.5, cadence=1.6, swing=0.8)
    rng = np.random.default_rng(2)
    starts, ends = rng.integers(0, 60, 40), rng.integers(29, 80, 40)
    lengths, costs = velocity_lengths(source, destination, starts, ends)
    for i, j, length, cost in zip(starts, ends, lengths, costs, strict=True):
        one = velocity_length(source, destination, int(i), int(j))
        assert length == one.blend_frames
        assert cost == pytest.approx(one.cost, abs=1e-12)


@pytest.mark.parametrize(("length", "find"), [(geodesic_length, geodesic_lengths), (velocity_length, velocity_lengths)])
def test_near_the_ends_of_clips_lengths_are_held_as_they_are_one_by_one(
    length: Callable[..., BlendLength], find: Callable[..., Any]
) -> None:
    source, destination = make_walk(90, phase=0.4), make_walk(80, phase=2.5, cadence=1.6, swing=0.8)
    rng = np.random.default_rng(7)
    starts, ends = rng.integers(0, 90, 80), rng.integers(0, 80, 80)
    starts[:2], ends[:2] = (89, 0), (0, 0)
    lengths, costs = find(source, destination, starts, ends)
    for i, j, frames, cost in zip(starts, ends, lengths, costs, strict=True):
        one = length(source, destination, int(i), int(j))
        assert frames == one.blend_frames <= min(90 - i, j + 1)
        assert cost == pytest.approx(one.cost, abs=1e-12)
