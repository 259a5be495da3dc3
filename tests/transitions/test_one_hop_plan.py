"""A search cut into blocks: the same table, the counts of the plan, and its memory."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.motion.clip import Clip
from study.transitions.one_hop import build
from study.transitions.one_hop.plan import Block, make_blocks, plan
from study.transitions.one_hop.problem import Alignment, PointCloudDistance, Problem, Settings, Switch
from tests.walks import make_walk

MEMORY = 50_000


def walks(count: int, frames: int = 60) -> tuple[Clip, ...]:
    return tuple(make_walk(frames, speed=1.0 + 0.1 * n, cadence=0.8 + 0.07 * n, name=f"walk{n}") for n in range(count))


def all_pairs(clips: tuple[Clip, ...], alignment: Alignment | None = None) -> Problem:
    alignment = alignment or Alignment(offset=0)
    switches = [Switch(a, b, alignment) for a in range(len(clips)) for b in range(len(clips)) if a != b]
    return Problem(clips, tuple(switches), Settings(8, 6, 6), 2000)


@pytest.fixture(scope="module")
def problem() -> Problem:
    return all_pairs(walks(4))


def split(problem: Problem, memory_bytes: int) -> tuple[Block, ...]:
    blocks = make_blocks(problem, memory_bytes, 1)
    assert len(blocks) > 3
    return blocks


def test_blocks_hold_every_transition_once_and_each_every_hop(problem: Problem) -> None:
    blocks = split(problem, MEMORY)
    assert sorted(n for block in blocks for n in block.switches) == list(range(12))
    for block in blocks:
        for hop in range(4):
            starts = problem.clips[hop].frames - 8 + 1
            assert sum(job.stop - job.start for job in block.jobs if job.hop == hop) == starts
    assert len(make_blocks(problem, 2**30, 2)) == 1


@pytest.mark.parametrize("alignment", [Alignment(offset=0), Alignment(destination_frame=10)])
def test_blocks_give_the_table_of_one(alignment: Alignment, tmp_path: Path) -> None:
    problem = all_pairs(walks(4), alignment)
    split(problem, MEMORY)
    whole = build.build_table(problem, workers=1)
    for checkpoint in (None, tmp_path / "unfinished.npz"):
        table = build.build_table(problem, workers=1, memory_bytes=MEMORY, checkpoint=checkpoint)
        assert table.rows == whole.rows
        some = np.isfinite(whole.costs)
        assert np.array_equal(np.isfinite(table.costs), some)
        assert np.abs(table.costs[some] - whole.costs[some]).max() <= 4 * problem.distance.unit  # other products
        assert (table.entries == whole.entries).all(axis=1).mean() > 0.99
    assert not list(tmp_path.iterdir())


def test_a_build_that_ends_in_a_later_block_goes_on_there(
    problem: Problem, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    checkpoint, done = tmp_path / "unfinished.npz", []
    blocks = split(problem, MEMORY)
    whole = build.build_table(problem, workers=1, memory_bytes=MEMORY)
    stop = len(blocks[0].jobs) + 1
    run_job = build.run_job

    def interrupted(*given: object) -> object:
        if len(done) == stop:
            raise KeyboardInterrupt
        done.append(given)
        return run_job(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(build, "run_job", interrupted)
    with pytest.raises(KeyboardInterrupt):
        build.build_table(problem, workers=1, memory_bytes=MEMORY, checkpoint=checkpoint)
    stop = 10**9
    table = build.build_table(problem, workers=1, memory_bytes=MEMORY, checkpoint=checkpoint)
    assert len(done) == sum(len(block.jobs) for block in blocks)
    assert np.array_equal(table.entries, whole.entries)
    assert np.array_equal(table.costs, whole.costs)


def test_the_plan_counts_what_is_compared(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    found, pairs = plan(problem, MEMORY, 1), 0
    counts = PointCloudDistance.counts

    def counted(self: PointCloudDistance, a: object, b: object, blend: int, rows: range, columns: range) -> object:
        nonlocal pairs
        pairs += len(rows) * len(columns)
        return counts(self, a, b, blend, rows, columns)  # type: ignore[arg-type]

    monkeypatch.setattr(PointCloudDistance, "counts", counted)
    build.build_table(problem, workers=1, memory_bytes=MEMORY)
    assert 0.9 * found.window_pairs <= pairs <= found.window_pairs
    assert (found.transitions, found.triggered_frames) == (12, sum(3 * clip.frames for clip in problem.clips))
    assert found.core_s > 0


def test_what_is_held_stays_within_the_bound_and_the_plan() -> None:
    problem, memory_bytes = all_pairs(walks(4, 240)), 2**21
    found = plan(problem, memory_bytes, 1)
    assert 0.5 * memory_bytes < found.block_bytes <= memory_bytes
    tracemalloc.start()
    build.build_table(problem, workers=1, memory_bytes=memory_bytes)
    held = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # And tiles of the products, and passing copies of what was found.
    assert 0.5 * found.block_bytes < held < found.block_bytes + found.table_bytes + found.clips_bytes + 2**21


@pytest.mark.parametrize("frames", [(5, 5, 5), (5, 60, 60), (60, 5, 60), (60, 60, 5), (5, 5, 60)])
def test_clips_shorter_than_a_blend_are_planned(frames: tuple[int, ...]) -> None:
    problem = all_pairs(tuple(walks(1, count)[0] for count in frames))
    for switches in (problem.switches, problem.switches[:1]):
        found = plan(replace(problem, switches=switches), 2**28, 1)
        assert found.transitions == len(switches)
        assert np.isfinite(found.core_s)
        assert found.core_s >= 0.0


def test_a_large_library_is_planned_without_being_built(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("study.transitions.one_hop.plan._trial", lambda *_: np.array([0.0, 1e-9]))
    drawn = walks(2, 1200)
    clips = tuple(replace(drawn[n % 2], name=str(n)) for n in range(160))
    small, large = (plan(all_pairs(clips[:count]), 2**28, 2) for count in (80, 160))
    assert large.blocks > small.blocks
    assert 7.9 < large.core_s / small.core_s < 8.1  # the cube of the clips
    assert max(small.block_bytes, large.block_bytes) <= 2**28
    assert large.table_bytes == 32 * 160 * 159 * 1200
