"""The fast search against the plain one: every entry of many random small problems, ties included."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer.workers import cores
from study.arrays import CountArray
from study.errors import TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions
from study.motion.skeleton import Skeleton
from study.transitions.one_hop import build, jobs, plan
from study.transitions.one_hop.parts import part_weights
from study.transitions.one_hop.problem import (
    Alignment,
    PointCloudDistance,
    Problem,
    Settings,
    Switch,
    weight_in_counts,
)
from study.transitions.one_hop.runs import from_runs, to_runs
from study.transitions.one_hop.table import read_table, write_table
from tests.walks import make_walk

POINT = Skeleton(("root",), np.array([-1]), np.zeros((1, 3)), np.zeros(0, dtype=np.int64), np.zeros((0, 3)))


def still(frames: int, number: int, fps: float = 60.0) -> Clip:
    return Clip(POINT, np.zeros((frames, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (frames, 1, 1)), fps, str(number))


class GivenCosts:
    """A distance that is drawn, not measured: small whole numbers, so that ties abound. Clips go by their number."""

    unit = 1.0
    words = "drawn costs"

    def __init__(self, costs: dict[tuple[int, int], np.ndarray]) -> None:
        self.costs = costs

    def prepare(self, clip: Clip, blend_frames: int) -> int:
        del blend_frames
        return int(clip.name)

    def counts(self, a: Any, b: Any, blend_frames: int, rows: range, columns: range) -> np.ndarray:
        del blend_frames
        return self.costs[a, b][rows.start : rows.stop, columns.start : columns.stop].copy()


def random_problem(seed: int) -> tuple[Problem, dict[tuple[int, int], np.ndarray]]:
    """Up to four clips of 1 to 29 frames, some shorter than the blend, with every option now and then."""
    rng = np.random.default_rng(seed)
    count, blend = int(rng.integers(1, 5)), int(rng.integers(1, 6))
    lengths = [int(rng.integers(max(1, blend - 2), 30)) for _ in range(count)]
    highest = int(rng.choice([2, 5, 1000]))
    costs = {}
    for a in range(count):
        for b in range(a, count):
            drawn = rng.integers(0, highest, (max(lengths[a] - blend + 1, 0), max(lengths[b] - blend + 1, 0)))
            if a == b:
                drawn = np.minimum(drawn, drawn.T)
                np.fill_diagonal(drawn, 0)
            costs[a, b] = drawn.astype(np.int32)
            costs[b, a] = costs[a, b].T.copy()
    both = int(rng.integers(0, 10)) if rng.random() < 0.4 else None
    settings = Settings(blend, int(rng.integers(0, 7)), int(rng.integers(0, 7)), both)
    switches = []
    for _ in range(int(rng.integers(1, 4))):
        music = rng.random() < 0.5
        where = Alignment(offset=int(rng.integers(-12, 12))) if music else Alignment(None, int(rng.integers(0, 12)))
        source = int(rng.integers(count))
        first = int(rng.integers(lengths[source])) if rng.random() < 0.3 else 0
        switches.append(Switch(source, int(rng.integers(count)), where, first))
    some = tuple(rng.choice(count, int(rng.integers(1, count + 1)), replace=False).tolist())
    pairs = [(switch.source, int(rng.integers(count))) for switch in switches] if rng.random() < 0.3 else []
    problem = Problem(
        tuple(still(length, k) for k, length in enumerate(lengths)),
        tuple(switches),
        settings,
        int(rng.integers(0, 4)),
        GivenCosts(costs),
        some if rng.random() < 0.3 else None,
        {int(rng.integers(count)): int(rng.integers(0, 5))} if rng.random() < 0.3 else {},
        {pair: np.unique(rng.integers(-20, 30, 15)) for pair in pairs},
        int(rng.integers(0, 5)) if rng.random() < 0.2 else None,
    )
    return problem, costs


def exhaustive_search(
    problem: Problem,
    switch: Switch,
    trigger: int,
    first_legs: dict[int, CountArray],
    second_legs: dict[int, CountArray],
) -> tuple[int, int, int, int, int] | None:
    """The best transition for one triggered frame, by trying everything: Koyama & Goto 2019, Eqs. 1 to 4.

    Parameters
    ----------
    problem, switch, trigger
        What is asked.
    first_legs, second_legs
        By hop clip, the counts of blends from each source frame (rows) to each frame of the hop (columns), and from
        each destination frame (rows) to each frame of the hop (columns): all windows of both clips.

    Returns
    -------
    `(cost, hop, offset of the hop, stay in the source, stay in the hop)`, or None where none fits; of equal costs
    the one with the least stay in the source, then the first hop, then its first frame, then the least stay in it.
    """
    settings, blend = problem.settings, problem.settings.blend_frames
    to_destination = switch.alignment.offset_at(trigger)
    end = problem.clips[switch.destination].frames
    best: tuple[int, int, int, int, int] | None = None
    for stay_source, hop in product(range(settings.longest_stay_source + 1), problem.hop_numbers):
        start = trigger + stay_source
        if start >= len(first_legs[hop]):
            continue
        for frame in range(first_legs[hop].shape[1]):
            offset = start - frame
            allowed = problem.offsets.get((switch.source, hop))
            if allowed is not None and offset not in allowed:
                continue
            near = problem.nearest_to_direct
            if near is not None and (hop != switch.destination or abs(offset - to_destination) > near):
                continue
            for stay_hop in range(min(settings.longest_stay_hop, settings.stay_both - stay_source) + 1):
                second_start = start + blend + stay_hop
                there, here = second_start - to_destination, second_start - offset
                itself = hop == switch.destination and offset == to_destination and stay_hop == 0 and 0 <= there <= end
                if itself:  # the hop is the direct transition's destination: a blend of it with itself is nothing
                    second = 0
                elif 0 <= there < second_legs[hop].shape[0] and 0 <= here < second_legs[hop].shape[1]:
                    second = int(second_legs[hop][there, here])
                else:
                    continue
                cost = int(first_legs[hop][start, frame]) + second + problem.hop_costs.get(hop, 0)
                found = (cost + problem.weight * (stay_source + stay_hop), stay_source, hop, frame, stay_hop)
                best = found if best is None or found < best else best
    if best is None:
        return None
    cost, stay_source, hop, frame, stay_hop = best
    return cost, hop, trigger + stay_source - frame, stay_source, stay_hop


def assert_same_as_exhaustive(problem: Problem, costs: dict[tuple[int, int], np.ndarray], **options: Any) -> int:
    """Compares every entry; the number of those that are transitions."""
    table = build.build_table(problem, **options)
    some = 0
    for row, switch in zip(table.rows, problem.switches, strict=True):
        first = {hop: costs[switch.source, hop] for hop in problem.hop_numbers}
        second = {hop: costs[switch.destination, hop] for hop in problem.hop_numbers}
        for trigger in problem.triggers(switch):
            expected = exhaustive_search(problem, switch, trigger, first, second)
            position = row.first_entry + trigger - row.first_trigger
            cost, *entry = (np.inf, -1, 0, 0, 0) if expected is None else expected
            assert table.entries[position].tolist() == entry, (switch, trigger)
            assert table.costs[position] == cost
            some += expected is not None
    return some


@pytest.mark.parametrize("seed", range(0, 100, 10))
def test_every_entry_equals_exhaustive_search(seed: int) -> None:
    assert sum(assert_same_as_exhaustive(*random_problem(k), workers=1) for k in range(seed, seed + 10)) > 50


def wriggling(frames: int, rng: np.random.Generator) -> Clip:
    walk = make_walk(frames, phase=float(rng.uniform(0, 6)), cadence=float(rng.uniform(1, 4)))
    turns = quat.exp(0.1 * np.cumsum(rng.standard_normal((frames, walk.skeleton.joints, 3)), axis=0))
    return replace(walk, rotations=quat.multiply(walk.rotations, turns))


def fitted(a: np.ndarray, b: np.ndarray) -> float:
    """Mean squared distance of points `(n, 3)` after the second were turned about the vertical and shifted to fit best:
    the printed formula of Kovar, Gleicher & Pighin 2002, section 3.1, with equal weights.
    """
    (x, _, z), (u, _, w) = a.T, b.T
    n = len(a)
    across = np.sum(x * w - u * z) - (x.sum() * w.sum() - u.sum() * z.sum()) / n
    along = np.sum(x * u + z * w) - (x.sum() * u.sum() + z.sum() * w.sum()) / n
    turn = np.arctan2(across, along)
    turned = np.stack([u * np.cos(turn) + w * np.sin(turn), w * np.cos(turn) - u * np.sin(turn)])
    gap = np.stack([x, z]) - turned
    gap -= gap.mean(axis=1, keepdims=True)
    return float((gap**2).sum() + np.sum((a[:, 1] - b[:, 1]) ** 2)) / n


LEGS = {"Hips"} | {side + bone for side in ("Left", "Right") for bone in ("UpLeg", "Leg", "Foot", "Toe")}


@pytest.mark.parametrize("seed", range(50))
def test_a_part_of_the_body_has_the_best_of_all_transitions_by_its_own_joints(seed: int) -> None:
    rng = np.random.default_rng([seed, 9])
    blend = int(rng.integers(1, 4))
    clips = tuple(wriggling(int(n), rng) for n in rng.integers(blend + 2, 11, 3))
    clips = tuple(replace(clip, skeleton=clips[0].skeleton) for clip in clips)
    where = Alignment(offset=int(rng.integers(-3, 4))) if rng.random() < 0.5 else Alignment(None, int(rng.integers(4)))
    switches, stay = (Switch(0, 1, where), Switch(2, 0, where)), int(rng.integers(0, 4))
    settings, weight = Settings(blend, stay, stay), int(rng.choice([0, 300, 30_000]))
    entries = []
    for part in ("lower", "upper"):
        distance = PointCloudDistance(part_weights(clips[0].skeleton, part))
        problem = Problem(clips, switches, settings, weight, distance)
        table = build.build_table(problem, workers=1)
        entries.append(table.entries)
        joints = [k for k, name in enumerate(clips[0].skeleton.names) if (name in LEGS) == (part == "lower")]
        points = [joint_positions(clip)[:, joints] for clip in clips]
        costs = {
            (a, b): np.array(
                [
                    [
                        fitted(*(np.concatenate(points[c][k : k + blend]) for c, k in ((a, i), (b, j)))) / distance.unit
                        for j in range(clips[b].frames - blend + 1)
                    ]
                    for i in range(clips[a].frames - blend + 1)
                ]
            )
            for a, b in product(range(3), repeat=2)
        }
        for row, switch in zip(table.rows, switches, strict=True):
            first, second = ({hop: costs[end, hop] for hop in range(3)} for end in (switch.source, switch.destination))
            for trigger in problem.triggers(switch):
                best = exhaustive_search(problem, switch, trigger, first, second)
                position = row.first_entry + trigger - row.first_trigger
                assert (best is None) == (table.entries[position, 0] < 0)
                if best is None:
                    continue
                # Rounding may prefer another of two that cost the same: what was found is measured again.
                hop, offset, waits, waited = (int(number) for number in table.entries[position])
                there = trigger + waits + blend + waited - switch.alignment.offset_at(trigger)
                out = hop == switch.destination and there == trigger + waits + blend + waited - offset
                cost = first[hop][trigger + waits, trigger + waits - offset] + weight * (waits + waited)
                cost += 0.0 if out else second[hop][there, trigger + waits + blend + waited - offset]
                assert cost == pytest.approx(best[0], abs=20)
                assert table.costs[position] / distance.unit == pytest.approx(best[0], abs=20)
    if seed == 0:
        assert not np.array_equal(*entries), "the parts go their own ways"


@pytest.mark.parametrize("seed", range(100, 130, 10))
def test_pieces_of_hops_in_any_order_on_two_workers_change_nothing(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    for k in range(seed, seed + 10):
        problem, costs = random_problem(k)
        pieces = [
            jobs.Job(job.hop, start, min(start + 7, job.stop))
            for job in jobs.make_jobs(problem, 2**30)
            for start in range(job.start, job.stop, 7)
        ]
        np.random.default_rng(k).shuffle(pieces)  # type: ignore[arg-type]
        monkeypatch.setattr(plan, "make_jobs", lambda *_, pieces=pieces: tuple(pieces))
        assert_same_as_exhaustive(problem, costs, workers=2)


def test_the_direct_transition_is_one_of_them_to_the_last_frame_of_the_destination() -> None:
    """Both clips end with the blend: only the direct transition fits, though the second blend has no frames."""
    costs = {pair: np.full((6, 6), 9, dtype=np.int32) for pair in ((0, 1), (1, 0), (0, 0), (1, 1))}
    for k in (0, 1):
        np.fill_diagonal(costs[k, k], 0)
    problem = Problem((still(10, 0), still(10, 1)), (Switch(0, 1),), Settings(5, 2, 2), 1, GivenCosts(costs))
    table = build.build_table(problem, workers=1)
    assert table.entries[5].tolist() == [1, 0, 0, 0]
    assert table.costs[5] == table.direct_costs[5] == 9
    assert table.look_up(0, 1, 6) is None
    assert np.isinf(table.costs[6:]).all()


def moving(rng: np.random.Generator, frames: int, name: str) -> Clip:
    path = np.cumsum(rng.standard_normal((frames, 3)) * 0.05, axis=0)
    turn = np.cumsum(rng.standard_normal((frames, 1)) * 0.1, axis=0)
    rotations = np.stack([np.cos(turn), 0 * turn, np.sin(turn), 0 * turn], axis=-1)
    return Clip(POINT, path, rotations, 60.0, name)


def moving_problem(alignment: Alignment, weight: float = 1e-4) -> Problem:
    rng = np.random.default_rng(7)
    clips = tuple(moving(rng, frames, f"m{frames}") for frames in (90, 120, 75))
    distance = PointCloudDistance()
    switches = tuple(Switch(a, b, alignment) for a in range(3) for b in range(3) if a != b)
    return Problem(clips, switches, Settings(8, 12, 9), weight_in_counts(weight, distance), distance)


@pytest.mark.parametrize("alignment", [Alignment(offset=-4), Alignment(destination_frame=3)])
def test_real_distances_never_cost_more_than_direct_and_a_memory_bound_changes_next_to_nothing(
    alignment: Alignment, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = moving_problem(alignment)
    whole = build.build_table(problem)
    known = np.isfinite(whole.direct_costs)
    assert known.sum() > 200
    assert (whole.costs[known] <= whole.direct_costs[known]).all()
    assert (whole.costs[known] < whole.direct_costs[known]).mean() > 0.5
    monkeypatch.setattr(plan, "make_jobs", lambda given, _: jobs.make_jobs(given, 40_000))
    assert len(plan.make_jobs(problem, 0)) > 10
    pieces = build.build_table(problem)
    assert np.array_equal(np.isfinite(pieces.costs), np.isfinite(whole.costs))
    some = np.isfinite(whole.costs)
    assert np.abs(pieces.costs[some] - whole.costs[some]).max() <= 4 * problem.distance.unit


def test_work_goes_on_after_an_interruption(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    problem, checkpoint = moving_problem(Alignment(offset=0)), tmp_path / "work.npz"
    whole = build.build_table(problem)
    runs: list[int] = []
    run_job = build.run_job

    def stop_at_the_second(given: Problem, prepared: Any, job: jobs.Job, limits: Any) -> Any:
        if len(runs) == 2:
            raise KeyboardInterrupt
        runs.append(job.hop)
        return run_job(given, prepared, job, limits)

    monkeypatch.setattr(build, "run_job", stop_at_the_second)
    with pytest.raises(KeyboardInterrupt):
        build.build_table(problem, workers=1, checkpoint=checkpoint)
    assert checkpoint.exists()
    assert not list(tmp_path.glob("*.part"))
    again: list[int] = []
    monkeypatch.setattr(build, "run_job", lambda *args: again.append(args[2].hop) or run_job(*args))
    table = build.build_table(problem, workers=1, checkpoint=checkpoint)
    assert len(again) == 1
    assert again[0] not in runs
    assert np.array_equal(table.entries, whole.entries)
    assert not checkpoint.exists()


def test_a_checkpoint_of_another_problem_is_left_aside(tmp_path: Path) -> None:
    checkpoint = tmp_path / "work.npz"
    first, second = moving_problem(Alignment(offset=0)), moving_problem(Alignment(offset=0), weight=1e-3)
    (block,) = plan.make_blocks(first, build.MEMORY_BYTES, cores())
    state = build._State(first, block.jobs, {})
    state.done[:] = True
    state.write(checkpoint, build._fingerprint(first, (block,)), 0)
    assert np.array_equal(build.build_table(second, checkpoint=checkpoint).entries, build.build_table(second).entries)


def test_refusals() -> None:
    with pytest.raises(TransitionError, match=r"either an offset \(music\) or the destination's frame"):
        Alignment()
    with pytest.raises(TransitionError, match=r"clip 1 \(1\) has 30 fps and clip 0 has 60"):
        Problem((still(9, 0), still(9, 1, fps=30.0)), ())
    two = Skeleton(("root", "arm"), np.array([-1, 0]), np.zeros((2, 3)), np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
    other = Clip(two, np.zeros((9, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (9, 2, 1)), 60.0, "other")
    with pytest.raises(TransitionError, match=r"clip 1 \(other\) differs from clip 0 \(0\) in arm"):
        Problem((still(9, 0), other), ())
    with pytest.raises(TransitionError, match="clip numbers from 0 to 0, got 4"):
        Problem((still(9, 0),), (Switch(0, 4),))
    with pytest.raises(TransitionError, match="triggered frames from 0 to 8 of 0, got 0 to 9"):
        build.build_table(Problem((still(9, 0),), (Switch(0, 0, last_trigger=9),)))
    with pytest.raises(TransitionError, match="blend of at least 1 frame"):
        Settings(0)
    with pytest.raises(TransitionError, match="Expected a weight from 0 to"):
        Problem((still(9, 0),), (), weight=2**28)
    with pytest.raises(TransitionError, match="weight of at least 0"):
        weight_in_counts(-1.0, PointCloudDistance())
    with pytest.raises(TransitionError, match="at least one clip"):
        Problem((), ())


# The table as runs


def fewest_runs(entries: np.ndarray) -> int:
    """By dynamic programming over every cut, with each rule for what goes on written out."""

    def goes_on(kind: int, k: int, first: int) -> bool:
        expected = entries[first].copy()
        if kind:
            expected[3 - kind] += (k - first) * (-1 if kind == 1 else 1)
        return bool((entries[k] == expected).all())

    least = [0] + [len(entries) + 1] * len(entries)
    for first in range(len(entries)):
        for kind in range(3):
            stop = first
            while stop < len(entries) and goes_on(kind, stop, first):
                stop += 1
                least[stop] = min(least[stop], least[first] + 1)
    return least[-1]


@pytest.mark.parametrize("seed", range(50))
def test_runs_give_back_every_entry_and_no_division_has_fewer(seed: int, tmp_path: Path) -> None:
    problem, _ = random_problem(seed)
    table = build.build_table(problem, workers=1)
    runs = to_runs(table.entries)
    count = len(table.entries)
    np.testing.assert_array_equal(from_runs(runs, range(count)), table.entries)
    for place in range(count):
        np.testing.assert_array_equal(from_runs(runs, range(place, place + 1))[0], table.entries[place])
    assert len(runs) == fewest_runs(table.entries)
    flat, words = write_table(table, tmp_path / "t.bin", as_runs=True)
    assert flat.stat().st_size == 20 * len(runs)
    again = read_table(words)
    np.testing.assert_array_equal(again.entries, table.entries)
    assert again.rows == table.rows


def test_blends_of_their_own_length_go_along_in_runs_and_damage_is_told(tmp_path: Path) -> None:
    entries = np.array([[1, 5, 3, 0, 4, 9], [1, 5, 2, 0, 4, 9], [1, 5, 1, 0, 4, 8], [1, 6, 1, 0, 4, 8]], dtype=np.int32)
    runs = to_runs(entries)
    assert runs.tolist() == [[1, 1, 5, 3, 0, 4, 9], [8, 1, 5, 1, 0, 4, 8]]
    np.testing.assert_array_equal(from_runs(runs, range(4)), entries)
    assert to_runs(entries[:0]).shape == (0, 7)
    table = build.build_table(random_problem(3)[0], workers=1)
    _, words = write_table(table, tmp_path / "t.bin", as_runs=True)
    words.write_text(words.read_text().replace(f'"entries": {len(table.entries)}', '"entries": 1000000000'))
    with pytest.raises(TransitionError, match="its triggered frames, found another number"):
        read_table(words)
