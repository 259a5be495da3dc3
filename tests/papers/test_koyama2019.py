"""Koyama & Goto 2019: the numbers and the behaviour that the paper states.

Its motions are not public, so its cost values can't be repeated; what follows from its equations is.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from study.errors import TransitionError
from study.motion.clip import Clip
from study.motion.synthetic import synthesize
from study.transitions.one_hop.build import build_table
from study.transitions.one_hop.default_weight import CONDITIONS, default_weight
from study.transitions.one_hop.problem import Alignment, PointCloudDistance, Problem, Settings, Switch, weight_in_counts
from study.transitions.one_hop.table import OneHopTable, Row, write_table

DISTANCE = PointCloudDistance()


@pytest.fixture(scope="module")
def dances() -> tuple[Clip, ...]:
    names = ("dance", "dance_modern", "dance_turns", "box")
    return tuple(synthesize(name, seconds=7.0, fps=30.0, seed=3 + k) for k, name in enumerate(names))


def test_section_3_2_50_transitions_of_1000_frames_are_800_000_bytes(tmp_path: Path) -> None:
    rows = tuple(Row(k, k + 1, Alignment(offset=0), 0, 1000, 1000 * k) for k in range(50))
    zeros = np.zeros(50_000)
    entries = np.zeros((50_000, 4), dtype=np.int32)
    names = tuple(map(str, range(51)))
    table = OneHopTable(names, (1000,) * 51, 60.0, 30, rows, entries, zeros, zeros, 0.0, "")
    assert table.entries.nbytes == 800_000
    assert write_table(table, tmp_path / "table.bin")[0].stat().st_size == 800_000


def test_sections_3_1_and_3_3_the_settings_at_60_fps() -> None:
    assert Settings.at(60.0) == Settings(blend_frames=30, longest_stay_source=60, longest_stay_hop=60)
    assert Settings.at(30.0) == Settings(15, 30, 30)
    assert CONDITIONS == 100


def test_section_3_2_the_direct_transition_is_in_the_search_space(dances: tuple[Clip, ...]) -> None:
    for alignment in (Alignment(offset=0), Alignment(destination_frame=10)):
        switches = tuple(Switch(a, b, alignment) for a in range(4) for b in range(4) if a != b)
        weight = weight_in_counts(3e-4, DISTANCE)
        table = build_table(Problem(dances, switches, Settings.at(30.0), weight, DISTANCE))
        direct = np.isfinite(table.direct_costs)
        assert direct.mean() > 0.9
        assert (table.costs[direct] <= table.direct_costs[direct]).all()


def test_equation_5_and_its_seed(dances: tuple[Clip, ...]) -> None:
    settings = Settings.at(30.0)
    found = default_weight(dances, np.random.default_rng(8), conditions=12)
    assert found.weight == pytest.approx((found.without_stays - found.with_stays) / (2 * 30), rel=1e-12)
    assert found.without_stays > found.with_stays > 0
    again = default_weight(dances, np.random.default_rng(8), conditions=12)
    assert (again.weight, again.conditions) == (found.weight, found.conditions)
    assert default_weight(dances, np.random.default_rng(9), conditions=12).conditions != found.conditions
    # The two means, one condition at a time.
    for stays, mean in ((0, found.without_stays), (30, found.with_stays)):
        costs = [
            build_table(Problem(dances, (switch,), Settings(settings.blend_frames, stays, stays), 0, DISTANCE)).costs[0]
            for switch in found.conditions
        ]
        assert np.mean(costs) == pytest.approx(mean, abs=1e-6)
    for switch in found.conditions:
        assert switch.source != switch.destination
        assert switch.first_trigger == switch.last_trigger


def test_figure_11_a_larger_weight_responds_sooner_and_is_less_smooth(dances: tuple[Clip, ...]) -> None:
    stays, smoothness = [], []
    for factor in (0.1, 1.0, 10.0):
        weight = weight_in_counts(factor * 5e-4, DISTANCE)
        problem = Problem(dances, (Switch(0, 3, Alignment(offset=0)),), Settings.at(30.0), weight, DISTANCE)
        table = build_table(problem)
        some = np.isfinite(table.costs)
        stay = table.entries[some, 2] + table.entries[some, 3]
        stays.append(stay)
        smoothness.append(table.costs[some] - stay * weight * DISTANCE.unit)
    for soft, hard in ((0, 1), (1, 2)):  # for every single trigger: a weighted sum of two minimised costs
        assert (stays[soft] >= stays[hard]).all()
        assert (smoothness[soft] <= smoothness[hard] + 1e-12).all()
    assert stays[0].mean() > stays[1].mean() > stays[2].mean()


def test_refusals(dances: tuple[Clip, ...]) -> None:
    rng = np.random.default_rng(0)
    with pytest.raises(TransitionError, match="at least two clips of 15 frames or more, the blend, found 1 of 1"):
        default_weight(dances[:1], rng)
    with pytest.raises(TransitionError, match="stays of some frames"):
        default_weight(dances, rng, settings=Settings(15, 0, 0))
