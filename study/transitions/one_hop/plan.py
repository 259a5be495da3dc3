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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

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
    searched,
    work_a_column,
)
from study.transitions.one_hop.problem import Problem
from study.transitions.one_hop.search import Best
from study.transitions.threads import one_blas_thread

STATE_BYTES, FOUND_BYTES = 32, 36
"""For a triggered frame while its block is searched: `Best` and the cost of the direct transition; and for each worker
what a job finds, which is most of them at the beginning: `Best` and where."""
_TRIAL_SWITCHES, _TRIAL_HOPS, _TRIALS = 16, 3, 5


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
        left = memory_bytes - _state_bytes(int(triggers[one].sum()), workers)
        blocks.append(replace(block, jobs=make_jobs(block.part(problem), max(left // workers, 2**20))))
    return tuple(blocks)


def _fits(problem: Problem, ends: IntArray, triggers: IntArray, memory_bytes: int, workers: int) -> bool:
    """Whether what is found takes half of the memory, and hops need not be cut so that most is overhang."""
    state = _state_bytes(int(triggers.sum()), workers)
    columns = (memory_bytes - state) // workers // bytes_a_column(problem, np.unique(ends).tolist())
    longest = max(clip.frames for clip in problem.clips)
    return state <= memory_bytes // 2 and columns >= min(longest, 4 * overhang(problem.settings))


def plan(problem: Problem, memory_bytes: int, workers: int) -> Plan:
    """What `build_table` will take with this memory and so many workers of this machine; nothing is built."""
    blocks = make_blocks(problem, memory_bytes, workers)
    counts, held, points, entries = np.zeros(2), 0, 0, 0
    for block in blocks:
        part = block.part(problem)
        used = {number for switch in part.switches for number in (switch.source, switch.destination)}
        triggers = sum(len(part.triggers(switch)) for switch in part.switches)
        counts += _work(part, block.jobs)
        columns = max((job.stop - job.start for job in block.jobs), default=0) + overhang(problem.settings)
        busy = min(workers, len(block.jobs))
        matrices = busy * columns * bytes_a_column(part, used)
        held, entries = max(held, _state_bytes(triggers, busy) + matrices), entries + triggers
        points = max(points, sum(_bytes_of(problem.clips[n]) for n in used))
    return Plan(
        clips=len(problem.clips),
        transitions=len(problem.switches),
        triggered_frames=entries,
        blocks=len(blocks),
        jobs=sum(len(block.jobs) for block in blocks),
        window_pairs=int(counts[0]),
        sums=int(counts[1]),
        clips_bytes=sum(_bytes_of(clip) for clip in problem.clips) + points,
        block_bytes=held,
        table_bytes=entries * (40 if problem.settings.lengths else 32),
        core_s=float(counts @ _trial(problem, blocks[len(blocks) // 2])) if entries else 0.0,
    )


def _state_bytes(triggers: int, workers: int) -> int:
    """What was found for so many triggered frames, and what each worker may just have found."""
    return (STATE_BYTES + FOUND_BYTES * workers) * triggers


def _bytes_of(clip: Clip) -> int:
    """A clip's; its points take no more."""
    return clip.rotations.nbytes + clip.root_positions.nbytes


def _work(part: Problem, jobs: Sequence[Job]) -> FloatArray:
    """Window pairs and sums of these jobs."""
    shortest = part.settings.blends[0]
    wide = [min(job.stop + overhang(part.settings), part.clips[job.hop].frames - shortest + 1) for job in jobs]
    columns = sum(stop - job.start for stop, job in zip(wide, jobs, strict=True))
    return np.array(work_a_column(part), dtype=np.float64) * (columns, sum(job.stop - job.start for job in jobs))


def _trial(problem: Problem, block: Block) -> FloatArray:
    """Processor seconds for a window pair, and for a sum with what goes with it, by a job for a few transitions.

    They are into one clip, as they follow each other in a search, from as many others as no cache holds. Through the
    n-th hop one trigger in n has its best so far: here as many have as do on average, and the others what was found
    through some hops. Medians, as the machine may be at other work as well.
    """
    if not block.jobs:
        return np.zeros(2)
    switches = block.part(problem).switches
    middle = switches[len(switches) // 2]
    into = [s for s in switches if (s.destination, s.alignment) == (middle.destination, middle.alignment)]
    few = replace(problem, switches=tuple(into[:: -(-len(into) * len(problem.settings.blends) // _TRIAL_SWITCHES)]))
    *others, job = block.jobs[:: -(-len(block.jobs) // _TRIAL_HOPS)]
    prepared = prepared_for(few, (*others, job))
    limits = {number: Best.none(len(few.triggers(switch))) for number, switch in enumerate(few.switches)}
    share = float(np.mean(1.0 / np.arange(1, len(block.jobs) + 1)))
    with one_blas_thread():
        for other in others:
            for found in run_job(few, prepared, other, limits):
                limits[found.switch].offer(found.where, found.best)
        for found in run_job(few, prepared, job, limits):
            cost = limits[found.switch].cost
            beaten = np.arange(len(found.where)) % max(1, round(len(found.where) / (share * len(cost)))) == 0
            cost[found.where[~beaten]] = found.best.cost[~beaten] - 1
        seconds = [_timed(few, prepared, job, limits) for _ in range(_TRIALS)]
    return np.asarray(np.median(seconds, axis=0) / np.maximum(_work(few, (job,)), 1.0))


def _timed(few: Problem, prepared: Mapping[int, Any], job: Job, limits: Mapping[int, Best]) -> tuple[float, float]:
    """Processor seconds of a job's costs and of its search."""
    begun = time.process_time()
    legs = legs_to_hop(few, prepared, job)
    between = time.process_time()
    searched(few, job, legs, limits)
    return between - begun, time.process_time() - between
