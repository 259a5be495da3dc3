"""Costs of cuts between all frames, and what a frame costs beside itself."""

from __future__ import annotations

import numpy as np
import pytest
from walks import make_walk

from study.transitions.candidates import frame_costs
from study.transitions.cost_matrix import WINDOW_S
from study.transitions.one_hop.joint_distance import JointDistance
from study.transitions.point_cloud import point_cloud, window_distances


def test_point_clouds_are_compared_over_a_third_of_a_second_around_a_frame() -> None:
    source, destination = make_walk(40, speed=1.0), make_walk(50, speed=2.0, phase=1.0)
    frames = round(WINDOW_S * 30)
    assert frames > 5
    costs = frame_costs(source, destination, "pointcloud")
    whole = window_distances(point_cloud(source), point_cloud(destination), frames)
    assert costs.shape == (40, 50)
    for row, column in ((0, 0), (7, 20), (40 - frames, 50 - frames)):
        assert costs[row + frames // 2, column + frames // 2] == pytest.approx(whole[row, column])
    assert costs[0, 0] == pytest.approx(np.median(whole)), "a frame without a whole window"


def test_a_frame_costs_nothing_beside_itself() -> None:
    walk = make_walk(60, cadence=0.9)
    counts = JointDistance().counts(walk, walk, 5, range(10, 40), range(20, 50))
    same = [counts[row - 10, row - 20] for row in range(20, 40)]
    assert same == [0] * 20
    assert np.count_nonzero(counts == 0) == 20
