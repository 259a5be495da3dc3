"""Builds one-hop tables: block by block, on all cores or a cluster, within a memory bound, resumable.

In: a problem. Out: a `OneHopTable`. Koyama & Goto 2019, section 3.2; the paper's search took 36 cores about an hour
for 1,000 triggered frames.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.workers import Where, cores, run_jobs
from study.arrays import CountArray
from study.files import refused, whole_file
from study.motion.clip import trim
from study.transitions.one_hop.jobs import Found, Job, prepared_for, run_job
from study.transitions.one_hop.plan import Block, make_blocks
from study.transitions.one_hop.problem import FORBIDDEN, Problem
from study.transitions.one_hop.search import Best
from study.transitions.one_hop.table import OneHopTable, filled, kind_of, table_of
from study.transitions.threads import one_blas_thread

MEMORY_BYTES = 2 * 2**30
_SAVE_EVERY_S = 5.0

Progress = Callable[[int, int], None]


def build_table(
    problem: Problem,
    *,
    workers: Where = None,
    memory_bytes: int = MEMORY_BYTES,
    checkpoint: Path | None = None,
    progress: Progress | None = None,
) -> OneHopTable:
    """The best one-hop transition for every triggered frame of every switch.

    Parameters
    ----------
    problem
        Clips, switches and what counts as good.
    workers
        Threads, one a core by default, or the address of a Dask scheduler.
    memory_bytes
        About how much memory to work in, clips not counted; on a cluster, for each worker. Less makes more and smaller
        jobs, and where it is needed more blocks (`plan`).
    checkpoint
        A file that holds what was found so far; it is read at the start where it is there and belongs to this
        problem, written every few seconds and when the work is interrupted, and removed at the end. Beside it lies
        what was found for finished blocks, where there are several.
    progress
        Called with (jobs done, jobs in all) after each job.

    Returns
    -------
    The table; see `study.transitions.one_hop.table`.

    Notes
    -----
    The outcome doesn't depend on the workers or on interruptions. The memory bound decides how the matrix products are
    cut up; another bound may change costs by one count (6e-8 square metres for point clouds).
    """
    blocks = make_blocks(problem, memory_bytes, 1 if isinstance(workers, str) else workers or cores())
    key = _fingerprint(problem, blocks) if checkpoint is not None else ""
    finished = checkpoint.with_suffix(".npy") if checkpoint is not None and len(blocks) > 1 else None
    begun, kept = _read(checkpoint, key) if finished is None or finished.exists() else (0, {})
    ends = np.cumsum([0, *(len(problem.triggers(switch)) for switch in problem.switches)])
    table = _room(kind_of(problem), int(ends[-1]), finished, fresh=not kept)
    count = sum(len(block.jobs) for block in blocks[:begun])
    for number, block in enumerate(blocks[begun:], begun):
        state, kept = _State(block.part(problem), block.jobs, kept), {}
        saved = time.monotonic()
        try:
            for numbers, found in _found(state, workers):
                state.take(numbers, found)
                if progress is not None:
                    progress(count + int(state.done.sum()), sum(len(one.jobs) for one in blocks))
                if checkpoint is not None and time.monotonic() - saved > _SAVE_EVERY_S:
                    state.write(checkpoint, key, number)
                    saved = time.monotonic()
        except BaseException:
            if checkpoint is not None:
                state.write(checkpoint, key, number)
            raise
        count += len(block.jobs)
        for place, switch in enumerate(block.switches):
            table[ends[switch] : ends[switch + 1]] = state.filled(place)
    for path in (checkpoint, finished):
        if path is not None:
            path.unlink(missing_ok=True)
    return table_of(problem, table)


def _room(kind: np.dtype[Any], count: int, finished: Path | None, fresh: bool) -> NDArray[Any]:
    """Where finished blocks go: into memory, or a file."""
    if finished is None:
        return np.empty(count, dtype=kind)
    try:
        table = np.lib.format.open_memmap(finished, "w+" if fresh else "r+", dtype=kind, shape=(count,))
        if fresh and hasattr(os, "posix_fallocate"):  # a disk without room says so now, not by a signal later
            with finished.open("r+b") as file:
                os.posix_fallocate(file.fileno(), 0, finished.stat().st_size)
    except OSError as error:
        raise refused(error, finished) from error
    return table


def _found(state: _State, workers: Where) -> Iterator[tuple[Sequence[int], list[Found]]]:
    """What the jobs of a block find that are not done yet, with their numbers."""
    part, jobs = state.part, state.jobs
    todo = [number for number in range(len(jobs)) if not state.done[number]]
    if isinstance(workers, str):
        # A cluster is sent some hops at a time, since with each go the clips of the block.
        size = min(max(len(todo) // 64, 1), 16)
        groups = [todo[at : at + size] for at in range(0, len(todo), size)]
        far = (_Far.of(part, [jobs[number] for number in group], state.best) for group in groups)
        for place, found in run_jobs(_Far.found, far, workers):
            yield groups[place], found
        return
    prepared = prepared_for(part, ())

    def found_here(number: int) -> list[Found]:
        hop = jobs[number].hop
        cloud = prepared[hop] if hop in prepared else part.distance.prepare(part.clips[hop], part.settings.blend_frames)
        return run_job(part, {**prepared, hop: cloud}, jobs[number], state.best)

    with one_blas_thread():
        for place, found in run_jobs(found_here, todo, workers, threads=True):
            yield (todo[place],), found


@dataclass(frozen=True, eq=False)
class _Far:
    """Jobs for another machine, with what they need."""

    problem: Problem
    jobs: list[Job]
    limits: dict[int, Best]

    @staticmethod
    def of(part: Problem, jobs: list[Job], limits: dict[int, Best]) -> _Far:
        """The clips that the jobs don't touch are sent as their first frames."""
        needed = {n for s in part.switches for n in (s.source, s.destination)} | {job.hop for job in jobs}
        clips = (clip if n in needed else trim(clip, 0, 1) for n, clip in enumerate(part.clips))
        return _Far(replace(part, clips=tuple(clips)), jobs, limits)

    def found(self) -> list[Found]:
        """What all its jobs find."""
        prepared = prepared_for(self.problem, self.jobs)
        with one_blas_thread():
            return [one for job in self.jobs for one in run_job(self.problem, prepared, job, self.limits)]


class _State:
    """A block's results so far; only the main thread changes them."""

    def __init__(self, part: Problem, jobs: tuple[Job, ...], kept: Mapping[str, Any]) -> None:
        self.part, self.jobs = part, jobs
        ends = np.cumsum([0, *(len(part.triggers(switch)) for switch in part.switches)])
        best = kept.get("best", np.stack([getattr(Best.none(int(ends[-1])), field.name) for field in fields(Best)]))
        direct = kept.get("direct", np.full(ends[-1], FORBIDDEN, dtype=np.int32))
        self.done = kept.get("done", np.zeros(len(jobs), dtype=bool))
        spans = [slice(*span) for span in pairwise(ends)]
        self.best = {number: Best(*(row[span].copy() for row in best)) for number, span in enumerate(spans)}
        self.direct: dict[int, CountArray] = {number: direct[span].copy() for number, span in enumerate(spans)}

    def take(self, numbers: Sequence[int], found: list[Found]) -> None:
        """What some jobs found."""
        for part in found:
            # A copy that is changed and then put in place: jobs that are reading the old one see it whole.
            best = Best(*(getattr(self.best[part.switch], field.name).copy() for field in fields(Best)))
            best.offer(part.where, part.best)
            self.best[part.switch] = best
            direct = self.direct[part.switch]
            direct[part.direct_where] = np.minimum(direct[part.direct_where], part.direct)
        self.done[list(numbers)] = True

    def filled(self, place: int) -> NDArray[Any]:
        """The table's part for one transition, by its place in the block."""
        return filled(self.part, self.part.switches[place], self.best[place], self.direct[place])

    def write(self, path: Path, key: str, block: int) -> None:
        """Everything to a file, at once or not at all."""
        best = [np.concatenate([getattr(one, field.name) for one in self.best.values()]) for field in fields(Best)]
        direct = np.concatenate(list(self.direct.values()))
        with whole_file(path) as unfinished, unfinished.open("wb") as file:
            np.savez(file, key=np.array(key), block=block, done=self.done, best=np.stack(best), direct=direct)


def _read(path: Path | None, key: str) -> tuple[int, dict[str, Any]]:
    """The block to go on with, and its state; the first one, where a file is of another problem, damaged or missing."""
    if path is None or not path.exists():
        return 0, {}
    try:
        with np.load(path) as arrays:
            kept = dict(arrays)
        return (int(kept["block"]), kept) if str(kept["key"]) == key else (0, {})
    except (ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, zlib.error):
        return 0, {}


def _fingerprint(problem: Problem, blocks: tuple[Block, ...]) -> str:
    """The same for the same problem cut into the same blocks and jobs."""
    digest = hashlib.sha256()
    for clip in problem.clips:
        digest.update(clip.root_positions.tobytes())
        digest.update(clip.rotations.tobytes())
        digest.update(clip.skeleton.offsets.tobytes())
    weights = getattr(problem.distance, "weights", None)
    weights = weights.tolist() if isinstance(weights, np.ndarray) else weights
    parts = [
        repr(
            (problem.switches, problem.settings, problem.weight, problem.hop_numbers, problem.nearest_to_direct, blocks)
        ),
        repr(sorted(problem.hop_costs.items())),
        repr([(pair, offsets.tolist()) for pair, offsets in sorted(problem.offsets.items())]),
        f"{problem.distance.words} {weights}",
    ]
    digest.update(json.dumps(parts).encode())
    return digest.hexdigest()
