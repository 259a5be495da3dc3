"""Transitions by rule, the parts of their costs, pictures of them, the joint cost as distance, and captured dance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from matplotlib.image import imread
from programs import program

from study.errors import TransitionError
from study.motion.clip import Clip, resample, retarget, trim
from study.motion.mending import mend
from study.motion.readers.registry import read_clip
from study.motion.synthetic import synthesize
from study.transitions.cost_matrix import cost_matrix
from study.transitions.one_hop.adaptive import adaptive, lengths_at
from study.transitions.one_hop.build import build_table
from study.transitions.one_hop.joint_distance import JointDistance
from study.transitions.one_hop.play import Played, Segment, Trigger, play
from study.transitions.one_hop.problem import Alignment, PointCloudDistance, Problem, Settings, Switch, weight_in_counts
from study.transitions.one_hop.robustness import Costs, costs_of, draw_costs, robustness_set
from study.transitions.point_cloud import point_cloud, window_distances


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    """The benchmark, for its search that tries everything."""
    return program("benchmarks/one_hop")


@pytest.fixture(scope="module")
def robustness() -> ModuleType:
    """The transitions by rule, their costs and pictures."""
    return program("benchmarks/one_hop_robustness")


@pytest.fixture(scope="module")
def dances() -> tuple[Clip, ...]:
    names = ("dance", "dance_modern", "dance_turns")
    return tuple(synthesize(name, seconds=6.0 + k, fps=30.0, seed=k) for k, name in enumerate(names))


def test_the_robustness_set_follows_its_rule(dances: tuple[Clip, ...]) -> None:
    settings = Settings.at(30.0)
    switches = robustness_set(dances, settings)
    assert len(switches) == 15
    usable = [clip.frames - 90 + 1 for clip in dances]
    starts = np.concatenate([[0], np.cumsum(usable)])
    places = [starts[switch.source] + switch.first_trigger for switch in switches]
    assert np.ptp(np.diff(places)) <= 1  # a fixed interval, but for rounding
    for switch in switches:
        assert switch.destination == (switch.source + 1) % 3
        assert 0 <= (switch.alignment.destination_frame or 0) < usable[switch.destination]
    assert robustness_set(dances, settings) == switches
    with pytest.raises(TransitionError, match="at least two clips of 90 frames or more"):
        robustness_set((dances[0], trim(dances[1], 0, 80)), settings)


def test_the_parts_of_a_cost_add_up_to_the_table(dances: tuple[Clip, ...], tmp_path: Path) -> None:
    distance = PointCloudDistance()
    switches = robustness_set(dances, Settings.at(30.0), 6)
    problem = Problem(dances, switches, Settings.at(30.0), weight_in_counts(3e-4, distance), distance)
    table = build_table(problem)
    costs = [costs_of(problem, table, number, switch.first_trigger) for number, switch in enumerate(switches)]
    for number, parts in enumerate(costs):
        assert parts.total == pytest.approx(table.costs[number], abs=3 * distance.unit)
        assert parts.direct == pytest.approx(table.direct_costs[number], abs=2 * distance.unit)
        assert parts.total <= parts.direct + 3 * distance.unit
    draw_costs(costs, tmp_path / "costs.png")
    picture = imread(tmp_path / "costs.png")
    blue = np.all(np.abs(picture[..., :3] - np.array([0.0, 0x62 / 255, 0xA8 / 255])) < 0.01, axis=-1)
    assert blue.sum() > 100


def test_bars_are_as_high_as_their_costs(tmp_path: Path) -> None:
    draw_costs([Costs(0.0, 0.0, 0.0, 0.4), Costs(0.0, 0.0, 0.0, 0.2)], tmp_path / "costs.png")
    dark = np.all(np.abs(imread(tmp_path / "costs.png")[..., :3] - 0x44 / 255) < 0.01, axis=-1)
    heights = dark[80:].sum(axis=0)  # below the legend
    bars = np.flatnonzero(heights > 40)
    assert heights[bars[3]] == pytest.approx(2 * heights[bars[-4]], abs=3)


def test_the_path_crosses_the_frames_that_the_player_joins(
    dances: tuple[Clip, ...], tmp_path: Path, robustness: ModuleType
) -> None:
    distance, settings = PointCloudDistance(), Settings.at(30.0)
    for switch in robustness_set(dances, settings, 6):
        table = build_table(Problem(dances, (switch,), settings, weight_in_counts(3e-4, distance), distance))
        played = play(dances, table, [Trigger(switch.first_trigger, switch.destination)], first=switch.source)
        seen = [(part.clip, part.clip_start) for part in played.segments if part.kind == "blend"]
        path = robustness.crossings(table, switch)
        assert [(one.clips[1], one.frames[1]) for one in path] == seen[: len(path)]
        robustness.draw_path(dances, table, switch, tmp_path / "path.png")
        red = np.all(
            np.abs(imread(tmp_path / "path.png")[..., :3] - np.array([1.0, 0x50 / 255, 0x50 / 255])) < 0.02, axis=-1
        )
        assert red.sum() > 20 * (len(path) + 1)


def test_the_joint_cost_plugs_in(dances: tuple[Clip, ...]) -> None:
    distance = JointDistance()
    frames = cost_matrix(dances[0], dances[1])
    expected = np.mean([frames[3 + k, 40 + k] for k in range(15)])
    counts = distance.counts(dances[0], dances[1], 15, range(3, 9), range(40, 60))
    assert counts[0, 0] * distance.unit == pytest.approx(expected, abs=2e-5)
    switches = (Switch(0, 1, Alignment(offset=0)),)
    table = build_table(Problem(dances, switches, Settings(15, 10, 10), weight_in_counts(1e-3, distance), distance))
    known = np.isfinite(table.direct_costs)
    assert known.any()
    assert (table.costs[known] <= table.direct_costs[known]).all()


@pytest.mark.mocap
def test_sampled_entries_of_captured_dance_equal_trying_everything(mocap: Path, benchmark: ModuleType) -> None:
    files = [mocap / "cmu" / "subjects" / trial[:2] / f"{trial}.amc" for trial in ("49_10", "05_02", "49_18")]
    clips = [replace(resample(mend(read_clip(file)), 60.0), name=file.stem) for file in files]
    clips = [retarget(clip, clips[0].skeleton) for clip in clips]
    distance = PointCloudDistance()
    switches = (Switch(0, 1, Alignment(offset=20)), Switch(2, 0, Alignment(destination_frame=100)))
    problem = Problem(tuple(clips), switches, Settings(), weight_in_counts(2.5e-4, distance), distance)
    table = build_table(problem)
    found = benchmark.check(problem, table, 12, np.random.default_rng(11))
    assert (found["sampled"], found["equal"]) == (12, 12)
    # Single precision: the entry chosen is the best in double precision as well, but for a few counts.
    clouds = [point_cloud(clip) for clip in clips]
    exact = {(a, b): window_distances(clouds[a], clouds[b], 30, precision="double") for a in range(3) for b in range(3)}
    rounded = benchmark_like(exact, distance.unit)
    for position in np.flatnonzero(table.entries[:, 0] >= 0)[::60]:
        number = 0 if position < table.rows[1].first_entry else 1
        trigger = int(position) - table.rows[number].first_entry
        best = benchmark.brute_force(problem, switches[number], trigger, rounded)
        assert table.costs[position] == pytest.approx(best[0] * distance.unit, abs=2e-6)


def benchmark_like(exact: dict[tuple[int, int], np.ndarray], unit: float) -> dict[tuple[int, int], np.ndarray]:
    return {pair: np.rint(values / unit).astype(np.int32) for pair, values in exact.items()}


def test_blends_of_their_own_length_cost_no_more_and_are_no_cuts(
    dances: tuple[Clip, ...], robustness: ModuleType
) -> None:
    settings = Settings.at(30.0)
    switches = robustness_set(dances, settings, 6)
    weight = weight_in_counts(robustness.WEIGHT, PointCloudDistance())
    problem = Problem(dances, switches, settings, weight)
    own = adaptive(replace(problem, settings=replace(settings, lengths=lengths_at(30.0, 15)), weight=weight // 2))
    costs, blends = [], []
    for asked in (problem, own):
        tables = [build_table(replace(asked, switches=(switch,))) for switch in switches]
        costs.append([robustness.strain(own, *pair) for pair in zip(tables, switches, strict=True)])
        blends = [table.entries[0, 4:] for table in tables]
    assert np.mean(costs[1]) <= np.mean(costs[0])
    assert np.median(np.concatenate(blends)) >= 9


def test_smoothness_is_that_of_the_joints(robustness: ModuleType) -> None:
    """A body that falls for a stretch of its blend and slides at 0.6 m/s: both are read off."""
    clip = synthesize("stand", seconds=2.0, fps=30.0)
    still = replace(
        clip,
        root_positions=np.tile(clip.root_positions[:1], (clip.frames, 1)),
        rotations=np.tile(clip.rotations[:1], (clip.frames, 1, 1)),
    )
    path = still.root_positions.copy()
    path[:, 2] += 0.02 * np.arange(clip.frames)  # 0.6 m/s
    played = Played(replace(still, root_positions=path), (Segment("blend", 1, 20, 35, 0),))
    floor = robustness.floor_of((still,))
    found = robustness.smoothness_of(played, 10, floor)
    assert found.seconds == pytest.approx(25 / 30)
    assert found.slide_m == pytest.approx(15 * 0.02)
    assert found.skating == 1.0
    assert found.joint_acceleration == pytest.approx(0.0, abs=1e-6)
    path[28, 1] += 0.01  # a hop of a centimetre in one frame: 0.01 * 900 * 2 at its top
    found = robustness.smoothness_of(replace(played, clip=replace(still, root_positions=path)), 10, floor)
    assert found.joint_acceleration == pytest.approx(18.0, rel=1e-6)
    assert found.toe_acceleration == pytest.approx(18.0, rel=1e-6)
