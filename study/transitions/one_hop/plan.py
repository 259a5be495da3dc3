"""A search cut into blocks that fit into memory, and what it will take, said before it starts.

In: a problem, workers and a bound on memory. Out: blocks of transitions with their jobs, which any number of workers do
in any order; operations, bytes, and seconds by a short trial on this machine. The search of Koyama & Goto 2019, section
3.2, grows with the cube of the number of clips: 1,000 clips of 20 s have a million transitions, each with 1,000 hops.

A block is the transitions from some clips to some clips, through every hop. In memory at a time are what was found for
one block, and for each worker the costs between the block's clips and a stretch of one hop.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.arrays import FloatArray, IntArray
from study.motion.clip import Clip
from study.transitions.one_hop.jobs import (
    Job,
    bytes_a_column,
    legs_to_hop,
    make_jobs,
    overhang,
    prepared_for,
    run_job,
    work_a_column,
)
from study.transitions.one_hop.problem import Problem
from study.transitions.one_hop.search import Best
from study.transitions.threads import one_blas_thread

STATE_BYTES = 32
"""For a triggered frame while its block is searched: `Best`, and the cost of the direct transition."""
_TRIAL_SWITCHES, _TRIAL_SEARCHES = 8, 80


@dataclass(frozen=True)
class Block:
    """Transitions that are searched together."""

    switches: tuple[int, ...]
    """Their numbers, ascending."""
    jobs: tuple[Job, ...]
    """Every stretch of every hop."""

    def part(self, problem: Problem) -> Problem:
        """The problem of these transitions alone."""
        return replace(problem, switches=tuple(problem.switches[number] for number in self.switches))


@dataclass(frozen=True)
class Plan:
    """What a search takes."""

    clips: int
    transitions: int
    triggered_frames: int
    blocks: int
    jobs: int
    window_pairs: int
    """Pairs of windows whose distance is computed."""
    sums: int
    """Sums of two legs; where the destination starts at one frame, bounds leave most of them out."""
    clips_bytes: int
    """Clips, and the points of those of a block."""
    block_bytes: int
    """The most that a block takes: what was found, and the matrices of all workers."""
    table_bytes: int
    """Entries and costs; those of several blocks lie on the disk until the table is written."""
    core_s: float
    """Processor time, by a trial on this machine."""

    @property
    def peak_bytes(self) -> int:
        """The most that is in memory, without the program itself."""
        return self.clips_bytes + self.block_bytes + (self.table_bytes if self.blocks == 1 else 0)


def make_blocks(problem: Problem, memory_bytes: int, workers: int) -> tuple[Block, ...]:
    """The fewest blocks, as squares of sources and destinations, that `workers` can search within the memory."""
    ends = np.array([(s.source, s.destination) for s in problem.switches], dtype=np.int64).reshape(-1, 2)
    triggers = np.array([len(problem.triggers(switch)) for switch in problem.switches], dtype=np.int64)
    ranks = [np.unique(column, return_inverse=True) for column in ends.T]
    most = max((len(known) for known, _ in ranks), default=1)
    groups = 1
    while True:
        cuts = [rank * groups // max(len(known), 1) for known, rank in ranks]
        _, of_block = np.unique(cuts[0] * groups + cuts[1], return_inverse=True)
        members = [np.flatnonzero(of_block == block) for block in range(of_block.max(initial=-1) + 1)]
        if groups >= most or all(_fits(problem, ends[one], triggers[one], memory_bytes, workers) for one in members):
            break
        groups = min(math.ceil(groups * 1.2), most)
    blocks = []
    for one in members:
        block = Block(tuple(one.tolist()), ())
        left = (memory_bytes - STATE_BYTES * int(triggers[one].sum())) // workers
        blocks.append(replace(block, jobs=make_jobs(block.part(problem), max(left, 2**20))))
    return tuple(blocks)


def _fits(problem: Problem, ends: IntArray, triggers: IntArray, memory_bytes: int, workers: int) -> bool:
    """Whether what is found takes a quarter of the memory, and hops need not be cut so that most is overhang."""
    state = STATE_BYTES * int(triggers.sum())
    columns = (memory_bytes - state) // workers // bytes_a_column(problem, np.unique(ends).tolist())
    longest = max(clip.frames for clip in problem.clips)
    return state <= memory_bytes // 4 and columns >= min(longest, 4 * overhang(problem.settings))


def plan(problem: Problem, memory_bytes: int, workers: int) -> Plan:
    """What `build_table` will take with this memory and so many workers of this machine; nothing is built."""
    blocks = make_blocks(problem, memory_bytes, workers)
    counts, held, points, entries = np.zeros(3), 0, 0, 0
    for block in blocks:
        part = block.part(problem)
        used = {number for switch in part.switches for number in (switch.source, switch.destination)}
        triggers = sum(len(part.triggers(switch)) for switch in part.switches)
        counts += _work(part, block.jobs)
        columns = max((job.stop - job.start for job in block.jobs), default=0) + overhang(problem.settings)
        matrices = min(workers, len(block.jobs)) * columns * bytes_a_column(part, used)
        held, entries = max(held, STATE_BYTES * triggers + matrices), entries + triggers
        points = max(points, sum(_bytes_of(problem.clips[n]) for n in used))
    return Plan(
        clips=len(problem.clips),
        transitions=len(problem.switches),
        triggered_frames=entries,
        blocks=len(blocks),
        jobs=sum(len(block.jobs) for block in blocks),
        window_pairs=int(counts[0]),
        sums=int(counts[2]),
        clips_bytes=sum(_bytes_of(clip) for clip in problem.clips) + points,
        block_bytes=held,
        table_bytes=entries * (40 if problem.settings.lengths else 32),
        core_s=float(counts @ _trial(problem)) if entries else 0.0,
    )


def _bytes_of(clip: Clip) -> int:
    """A clip's; its points take no more."""
    return clip.rotations.nbytes + clip.root_positions.nbytes


def _work(part: Problem, jobs: Sequence[Job]) -> FloatArray:
    """Window pairs, second legs and sums of these jobs."""
    shortest = part.settings.blends[0]
    wide = [min(job.stop + overhang(part.settings), part.clips[job.hop].frames - shortest + 1) for job in jobs]
    narrow = sum(job.stop - job.start for job in jobs)
    columns = sum(stop - job.start for stop, job in zip(wide, jobs, strict=True))
    return np.array(work_a_column(part), dtype=np.float64) * (columns, narrow, narrow)


def _trial(problem: Problem) -> FloatArray:
    """Processor seconds for a window pair, a second leg and a sum: one job for a few transitions, and for many.

    The few are into one clip, as they follow each other in a search, whose costs fill no cache; the many are the few
    again and again, so that the difference is what sums take. What they are to beat was found through another hop.
    """
    blends = problem.settings.blends
    middle = problem.switches[len(problem.switches) // 2]
    into = [s for s in problem.switches if (s.destination, s.alignment) == (middle.destination, middle.alignment)]
    few = replace(problem, switches=tuple(into[:: -(-len(into) * len(blends) // _TRIAL_SWITCHES)]))
    repeats = 1 + _TRIAL_SEARCHES // len(few.switches)
    hops = [job for job in make_jobs(few, 2**40) if job.stop > job.start]
    if not hops:
        return np.zeros(3)
    before, job = hops[0], hops[-1]
    prepared = prepared_for(few, (before, job))
    limits = {number: Best.none(len(few.triggers(switch))) for number, switch in enumerate(few.switches)}
    with one_blas_thread():
        for found in run_job(few, prepared, before, limits):
            limits[found.switch].offer(found.where, found.best)
    many = replace(few, switches=few.switches * repeats)
    limits = {number: limits[number % len(few.switches)] for number in range(len(many.switches))}
    compared = _processor_s(lambda: [legs_to_hop(few, prepared, job, blend) for blend in blends])
    once = _processor_s(lambda: run_job(few, prepared, job, limits))
    often = _processor_s(lambda: run_job(many, prepared, job, limits))
    pairs, second, sums = _work(few, (job,))
    a_sum = max(often - once, 0.0) / (sums * (repeats - 1))
    return np.array([compared / pairs, max(once - compared - sums * a_sum, 0.0) / second, a_sum])


def _processor_s(work: Callable[[], object]) -> float:
    """Processor time of this process."""
    with one_blas_thread():
        started = time.process_time()
        work()
        return time.process_time() - started
