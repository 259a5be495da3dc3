"""Builds one-hop tables: all jobs of a problem, on all cores, within a memory bound, going on after an interruption.

In: a problem. Out: a `OneHopTable`. Koyama & Goto 2019, section 3.2; the paper's search took 36 cores about an hour
for 1,000 triggered frames.
"""

from __future__ import annotations

import hashlib
import json
import time
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from renderer.workers import cores, run_jobs
from study.arrays import CountArray
from study.files import whole_file
from study.transitions.one_hop.jobs import Found, Job, make_jobs, run_job
from study.transitions.one_hop.problem import FORBIDDEN, Problem
from study.transitions.one_hop.search import Best
from study.transitions.one_hop.table import OneHopTable, table_of
from study.transitions.threads import one_blas_thread

MEMORY_BYTES = 2 * 2**30
_SAVE_EVERY_S = 5.0

Progress = Callable[[int, int], None]


def build_table(
    problem: Problem,
    *,
    workers: int | None = None,
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
        Threads (default: one a core).
    memory_bytes
        About how much memory to work in, clips not counted. Less makes more and smaller jobs.
    checkpoint
        A file that holds what was found so far; it is read at the start where it is there and belongs to this
        problem, written every few seconds and when the work is interrupted, and removed at the end.
    progress
        Called with (jobs done, jobs in all) after each job.

    Returns
    -------
    The table; see `study.transitions.one_hop.table`.

    Notes
    -----
    The outcome doesn't depend on the number of workers or on interruptions. The memory bound decides how the matrix
    products are cut up; another bound may change costs by one count (6e-8 square metres for point clouds).
    """
    workers = workers or cores()
    jobs = make_jobs(problem, max(memory_bytes // workers, 2**20))
    state = _State(problem, jobs)
    key = _fingerprint(problem, jobs) if checkpoint is not None else ""
    if checkpoint is not None and checkpoint.exists():
        state.read(checkpoint, key)
    prepared = [problem.distance.prepare(clip, problem.settings.blend_frames) for clip in problem.clips]
    todo = [number for number in range(len(jobs)) if not state.done[number]]
    saved = time.monotonic()
    with one_blas_thread():
        try:
            for place, found in run_jobs(
                lambda number: run_job(problem, prepared, jobs[number], state.best), todo, workers, threads=True
            ):
                state.take(todo[place], found)
                if progress is not None:
                    progress(int(state.done.sum()), len(jobs))
                if checkpoint is not None and time.monotonic() - saved > _SAVE_EVERY_S:
                    state.write(checkpoint, key)
                    saved = time.monotonic()
        except BaseException:
            if checkpoint is not None:
                state.write(checkpoint, key)
            raise
    if checkpoint is not None:
        checkpoint.unlink(missing_ok=True)
    return table_of(problem, state.best, state.direct)


class _State:
    """The results so far; only the main thread changes them."""

    def __init__(self, problem: Problem, jobs: tuple[Job, ...]) -> None:
        self.problem = problem
        self.done = np.zeros(len(jobs), dtype=bool)
        lengths = [len(problem.triggers(switch)) for switch in problem.switches]
        self.best = {number: Best.none(length) for number, length in enumerate(lengths)}
        self.direct: dict[int, CountArray] = {
            number: np.full(length, FORBIDDEN, dtype=np.int32) for number, length in enumerate(lengths)
        }

    def take(self, number: int, found: list[Found]) -> None:
        """A job's findings."""
        for part in found:
            # A copy that is changed and then put in place: jobs that are reading the old one see it whole.
            best = Best(*(getattr(self.best[part.switch], field.name).copy() for field in fields(Best)))
            best.offer(part.where, part.best)
            self.best[part.switch] = best
            direct = self.direct[part.switch]
            direct[part.direct_where] = np.minimum(direct[part.direct_where], part.direct)
        self.done[number] = True

    def write(self, path: Path, key: str) -> None:
        """Everything to a file, at once or not at all."""
        arrays: dict[str, Any] = {"key": np.array(key), "done": self.done}
        for number, best in self.best.items():
            arrays[f"best{number}"] = np.stack([getattr(best, field.name) for field in fields(Best)])
            arrays[f"direct{number}"] = self.direct[number]
        with whole_file(path) as unfinished, unfinished.open("wb") as file:
            np.savez(file, **arrays)

    def read(self, path: Path, key: str) -> None:
        """Goes on from a file that belongs to the same problem; one that does not, or is damaged, is left aside."""
        try:
            with np.load(path) as arrays:
                if str(arrays["key"]) != key:
                    return
                best = {number: Best(*(row.copy() for row in arrays[f"best{number}"])) for number in self.best}
                direct = {number: arrays[f"direct{number}"].copy() for number in self.best}
                done = arrays["done"].copy()
        except (ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, zlib.error):
            return
        self.done, self.best, self.direct = done, best, direct


def _fingerprint(problem: Problem, jobs: tuple[Job, ...]) -> str:
    """The same for the same problem cut into the same jobs."""
    digest = hashlib.sha256()
    for clip in problem.clips:
        digest.update(clip.root_positions.tobytes())
        digest.update(clip.rotations.tobytes())
        digest.update(clip.skeleton.offsets.tobytes())
    weights = getattr(problem.distance, "weights", None)
    weights = weights.tolist() if isinstance(weights, np.ndarray) else weights
    parts = [
        repr(
            (problem.switches, problem.settings, problem.weight, problem.hop_numbers, problem.nearest_to_direct, jobs)
        ),
        repr(sorted(problem.hop_costs.items())),
        repr([(pair, offsets.tolist()) for pair, offsets in sorted(problem.offsets.items())]),
        f"{problem.distance.words} {weights}",
    ]
    digest.update(json.dumps(parts).encode())
    return digest.hexdigest()
