"""One job of a search: everything that one stretch of one hop clip contributes to every transition.

In: a problem and a job. Out: for each transition of the state machine the best with this hop, by triggered frame. Where
blends may have several lengths, the search is done for each length of the first blend, and the second leg is the least
over all lengths of the second one. Jobs
don't depend on each other, so they run in any order, on any number of cores or machines, and give the same table.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from study.arrays import CountArray, IntArray
from study.transitions.one_hop import search
from study.transitions.one_hop.problem import FORBIDDEN, Alignment, Problem, Settings, Switch
from study.transitions.one_hop.search import Best, Table


@dataclass(frozen=True)
class Job:
    """The frames `start .. stop - 1` of a hop clip, as starts of the first blend."""

    hop: int
    start: int
    stop: int


@dataclass(frozen=True, eq=False)
class Found:
    """What a job found for one switch with one length of the first blend."""

    switch: int
    """Its number."""
    where: IntArray
    """`(n,)`: triggers, counted from the switch's first."""
    best: Best
    """An entry for each of them."""
    direct_where: IntArray
    direct: CountArray
    """`(m,)`: the cost in counts of the direct transition, where this job knows it."""


def make_jobs(problem: Problem, memory_bytes: int) -> tuple[Job, ...]:
    """All jobs, hops that are destinations first; each takes about `memory_bytes` at most.

    The cost of the direct transition, known from the destination as hop, saves much of the work for the others.
    """
    blends = problem.settings.blends
    width = max(16, memory_bytes // bytes_a_column(problem, _ends(problem)) - overhang(problem.settings))
    jobs = []
    destinations = {switch.destination for switch in problem.switches}
    for hop in sorted(problem.hop_numbers, key=lambda number: (number not in destinations, number)):
        starts = problem.clips[hop].frames - blends[0] + 1
        pieces = -(-starts // width) if starts > 0 else 0
        edges = [starts * piece // pieces for piece in range(pieces + 1)] if pieces else []
        jobs += [Job(hop, start, stop) for start, stop in pairwise(edges)]
    return tuple(jobs)


def overhang(settings: Settings) -> int:
    """How many frames of the hop a job needs beyond its own."""
    return settings.blends[-1] + settings.longest_stay_hop


def bytes_a_column(problem: Problem, clips: Iterable[int]) -> int:
    """The memory of a job for each frame of the hop, where transitions have these sources and destinations.

    Matrices of all these clips, then a second leg, a masked first leg, and what sums and bounds take.
    """
    return 4 * (_windows(problem, clips) + 4 * max((clip.frames for clip in problem.clips), default=0))


def _windows(problem: Problem, clips: Iterable[int]) -> int:
    return sum(max(problem.clips[n].frames - blend + 1, 0) for n in clips for blend in problem.settings.blends)


def _ends(problem: Problem) -> list[int]:
    """The clips that are sources or destinations."""
    return sorted({number for switch in problem.switches for number in (switch.source, switch.destination)})


def prepared_for(problem: Problem, jobs: Iterable[Job]) -> dict[int, Any]:
    """`distance.prepare` of the clips that these jobs need, by number."""
    needed = {*_ends(problem), *(job.hop for job in jobs)}
    return {n: problem.distance.prepare(problem.clips[n], problem.settings.blend_frames) for n in sorted(needed)}


def work_a_column(problem: Problem) -> tuple[int, int]:
    """For each frame of a hop, at most: windows to compare it with, and sums of two legs."""
    settings = problem.settings
    stays = settings.longest_stay_source + 1
    sums = sum(len(problem.triggers(s)) * (stays if s.alignment.offset is None else 1) for s in problem.switches)
    return _windows(problem, _ends(problem)), len(settings.blends) * sums


def run_job(problem: Problem, prepared: Mapping[int, Any], job: Job, limits: Mapping[int, Best]) -> list[Found]:
    """What a job finds, by switch and length of the first blend.

    Parameters
    ----------
    problem, job
        What to do.
    prepared
        `prepared_for` this job, or others as well.
    limits
        The best known so far, by switch: only what may beat it needs to be found. Older knowledge does no harm.
    """
    return searched(problem, job, legs_to_hop(problem, prepared, job), limits)


def searched(
    problem: Problem, job: Job, legs: Mapping[int, Mapping[int, Table]], limits: Mapping[int, Best]
) -> list[Found]:
    """The same by what `legs_to_hop` gives for it."""
    blends, groups = problem.settings.blends, _by_destination(problem)
    to_hop = {clip: _to_hop(problem, {blend: legs[blend][clip] for blend in blends}) for clip, _ in groups}
    found: list[Found] = []
    for blend in blends:
        one = replace(problem, settings=replace(problem.settings, blend_frames=blend))
        for (clip, _), numbers in groups.items():
            second = _SecondLegs(one, job, to_hop[clip], [problem.switches[number] for number in numbers])
            for number in numbers:
                leg = legs[blend][problem.switches[number].source]
                found.append(_search(one, job, number, leg, second, limits[number]))
    return found


def legs_to_hop(problem: Problem, prepared: Mapping[int, Any], job: Job) -> dict[int, dict[int, Table]]:
    """For each length of blends, their costs between each clip in use (rows) and the hop (columns)."""
    return {blend: _legs(problem, prepared, job, blend) for blend in problem.settings.blends}


def _legs(problem: Problem, prepared: Mapping[int, Any], job: Job, blend: int) -> dict[int, Table]:
    settings, hop_windows = problem.settings, problem.clips[job.hop].frames - blend + 1
    last = min(job.stop + overhang(settings), hop_windows)
    columns = range(job.start, max(job.start, last))
    legs = {}
    for number, rows in _needed_rows(problem, blend).items():
        none = np.zeros((len(rows), len(columns)), dtype=np.int32)
        counts = (
            problem.distance.counts(prepared[number], prepared[job.hop], blend, rows, columns) if none.size else none
        )
        legs[number] = Table(counts, rows.start, columns.start)
    return legs


@dataclass(frozen=True, eq=False)
class _ToHop:
    """Blends between a destination and the hop: the least cost over their lengths, and the shortest that has it."""

    costs: Table
    lengths: Table | int

    def lengths_at(self, times: IntArray, frames: IntArray) -> CountArray:
        """The lengths of single blends."""
        if isinstance(self.lengths, int):
            return np.full(len(times), self.lengths, dtype=np.int32)
        return self.lengths.at(times, frames)


def _to_hop(problem: Problem, legs: Mapping[int, Table]) -> _ToHop:
    """The second blends into one destination, from those of each length; a longer one pays for its frames."""
    (shortest, first), *longer = legs.items()
    if not longer:
        return _ToHop(first, shortest)
    ends = [leg.first_row + len(leg.counts) for leg in legs.values()]
    rows = range(min(leg.first_row for leg in legs.values()), max(ends))
    columns = range(first.first_column, first.first_column + first.counts.shape[1])
    least = first.block(rows, columns)
    lengths = np.full(least.shape, shortest, dtype=np.int32)
    for blend, leg in longer:
        costs = leg.block(rows, columns) + np.int32(problem.weight * (blend - shortest))
        lengths[costs < least] = blend
        np.minimum(least, costs, out=least)
    return _ToHop(Table(least, rows.start, columns.start), Table(lengths, rows.start, columns.start))


def _by_destination(problem: Problem) -> dict[tuple[int, Alignment], list[int]]:
    """The switches that share their second legs."""
    groups: dict[tuple[int, Alignment], list[int]] = {}
    for number, switch in enumerate(problem.switches):
        groups.setdefault((switch.destination, switch.alignment), []).append(number)
    return groups


def _needed_rows(problem: Problem, blend: int) -> dict[int, range]:
    """Which windows of `blend` frames of each clip the switches need, as a source or as a destination."""
    settings = problem.settings
    needed: dict[int, range] = {}
    for switch in problem.switches:
        frames = _source_frames(problem, switch, blend)
        spans = [_times(problem, switch, first) for first in settings.blends]
        times = range(min(span.start for span in spans), max(span.stop for span in spans))
        for clip, rows in (
            (switch.source, frames),
            (switch.destination, range(times.start, times.stop + settings.longest_stay_hop)),
        ):
            windows = max(problem.clips[clip].frames - blend + 1, 0)
            rows = range(min(max(rows.start, 0), windows), max(min(rows.stop, windows), 0))
            before = needed.get(clip, rows)
            if len(rows):
                both = (before, rows) if len(before) else (rows,)
                needed[clip] = range(min(r.start for r in both), max(r.stop for r in both))
            else:
                needed[clip] = before
    return needed


def _source_frames(problem: Problem, switch: Switch, blend: int) -> range:
    """Source frames at which a first blend of `blend` frames may start."""
    triggers = problem.triggers(switch)
    windows = max(problem.clips[switch.source].frames - blend + 1, 0)
    stop = min(triggers.stop + problem.settings.longest_stay_source, windows)
    return range(min(triggers.start, stop), stop)


def _times(problem: Problem, switch: Switch, blend: int) -> range:
    """The destination's frames at which a first blend of `blend` frames may end."""
    settings = problem.settings
    if switch.alignment.destination_frame is not None:
        first = switch.alignment.destination_frame + blend
        return range(first, first + settings.longest_stay_source + 1)
    frames = _source_frames(problem, switch, blend)
    shift = blend - switch.alignment.offset_at(0)
    last = problem.clips[switch.destination].frames + 1
    start = max(frames.start + shift, -settings.longest_stay_hop)
    return range(start, max(start, min(frames.stop + shift, last)))


class _SecondLegs:
    """The second legs of a job into one destination, for all sources and triggers.

    `by_time` holds them by the destination's frame at the end of the first blend, where the alignment is fixed and
    stays don't bound each other; `by_stay` by the stay in the source, where the destination's frame at the trigger
    is fixed. Where both stays share a bound and the alignment is fixed, they are made when asked for.
    """

    def __init__(self, problem: Problem, job: Job, to_hop: _ToHop, switches: Sequence[Switch]) -> None:
        settings = problem.settings
        self.problem, self.job, self.to_hop = problem, job, to_hop
        self.destination, self.alignment = switches[0].destination, switches[0].alignment
        self.ends = range(job.start + settings.blend_frames, job.stop + settings.blend_frames)
        self.stays = np.arange(settings.longest_stay_source + 1)
        self.bounds = np.minimum(settings.longest_stay_hop, settings.stay_both - self.stays)
        spans = [_times(problem, switch, settings.blend_frames) for switch in switches]
        self.times = range(min(span.start for span in spans), max(span.stop for span in spans))
        self.by_time: Table | None = None
        self.by_stay: CountArray | None = None
        if self.alignment.destination_frame is not None:
            times = self.alignment.destination_frame + settings.blend_frames + self.stays
            free = bool((self.bounds == settings.longest_stay_hop).all())
            self.by_stay = self.bounded_by(self.bounds[0]).counts if free else self._rows(times, self.bounds)
        elif (self.bounds == settings.longest_stay_hop).all():
            self.by_time = self.bounded_by(settings.longest_stay_hop)

    def bounded_by(self, longest: int) -> Table:
        """All second legs with one longest stay, by the destination's frame."""
        table = search.second_leg(self.to_hop.costs, self.times, self.ends, longest, self.problem.weight)
        self._mend(table.counts, np.arange(self.times.start, self.times.stop))
        return table

    def of(self, times: IntArray, stays: CountArray) -> CountArray:
        """Single rows: `(n, hop frames)` for n destination frames and stays in the source that go with them."""
        if self.by_stay is not None:
            return self.by_stay[stays]
        if self.by_time is not None:
            return self.by_time.counts[times - self.by_time.first_row]
        return self._rows(times, self.bounds[stays])

    def _rows(self, times: IntArray, longest: IntArray) -> CountArray:
        rows = search.second_rows(self.to_hop.costs, times, self.ends, longest, self.problem.weight)
        self._mend(rows, times)
        rows[longest < 0] = FORBIDDEN
        return rows

    def _mend(self, rows: CountArray, times: IntArray) -> None:
        """What a second leg has beyond its costs: the destination as its own hop, and offsets kept near to its own.

        Where the hop is the destination at its own place, nothing is left to blend: the second leg costs nothing and
        needs no more frames. So the direct transition is among the one-hop ones wherever it exists.
        """
        if self.job.hop == self.destination:
            frames = self.problem.clips[self.destination].frames
            own = np.flatnonzero((times >= max(self.ends.start, 0)) & (times < self.ends.stop) & (times <= frames))
            rows[own, times[own] - self.ends.start] = 0
        if self.problem.nearest_to_direct is not None:
            apart = np.abs(np.arange(self.ends.start, self.ends.stop) - times[:, None])
            rows[(apart > self.problem.nearest_to_direct) | (self.job.hop != self.destination)] = FORBIDDEN


def _search(problem: Problem, job: Job, number: int, leg: Table, second: _SecondLegs, limit: Best) -> Found:
    """What a job finds for one switch with one length of the first blend."""
    switch = problem.switches[number]
    triggers, settings = problem.triggers(switch), problem.settings
    longer = np.int32(problem.weight * (settings.blend_frames - settings.blends[0]))
    extra = np.int32(problem.hop_costs.get(job.hop, 0)) + longer
    own = Table(leg.counts[:, : job.stop - job.start], leg.first_row, job.start)
    if own.counts.shape[1] < job.stop - job.start:  # the hop ends before so long a blend does
        rows = range(leg.first_row, leg.first_row + len(leg.counts))
        own = Table(own.block(rows, range(job.start, job.stop)), leg.first_row, job.start)
    first = _allowed(problem, job, switch, own)
    paid = (second.stays * problem.weight).astype(np.int32)
    if second.by_stay is not None:
        sums = search.minima_by_stay(first, second.by_stay, triggers, problem.weight, limit.cost - extra)
    else:
        sums = _sums_with_fixed_alignment(problem, switch, first, second)
    sums += paid
    sums[:, second.bounds < 0] = FORBIDDEN
    stay = sums.argmin(axis=1).astype(np.int32)
    cost = np.take_along_axis(sums, stay[:, None], axis=1)[:, 0] + extra
    where = np.flatnonzero((cost < FORBIDDEN) & limit.beaten_by(cost, stay, job.hop))
    best = _entries(problem, job, switch, first, second, where, cost[where], stay[where])
    direct_where, direct = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int32)
    if job.hop == switch.destination:
        every = np.arange(triggers.start, triggers.stop)
        costs = own.at(every, every - _offsets(switch, every))
        direct_where = np.flatnonzero(costs < FORBIDDEN)
        direct = costs[direct_where] + longer
    return Found(number, where, best, direct_where, direct)


def _offsets(switch: Switch, triggers: IntArray) -> IntArray:
    """The destination's offset for each triggered frame."""
    if switch.alignment.offset is not None:
        return np.full(len(triggers), switch.alignment.offset, dtype=np.int64)
    return triggers + switch.alignment.offset_at(0)


def _allowed(problem: Problem, job: Job, switch: Switch, leg: Table) -> Table:
    """First legs without the offsets that the hop may not have."""
    allowed = problem.offsets.get((switch.source, job.hop))
    if allowed is None or not len(leg.counts):
        return leg
    rows, columns = leg.counts.shape
    first = leg.first_row - leg.first_column
    # Offsets are row less column: the same along each diagonal, so a row of the mask is a stretch of one list.
    listed = np.isin(np.arange(first - columns + 1, first + rows), allowed)
    mask = np.lib.stride_tricks.sliding_window_view(listed, columns)[:rows, ::-1]
    return Table(np.where(mask, leg.counts, np.int32(FORBIDDEN)), leg.first_row, leg.first_column)


def _sums_with_fixed_alignment(problem: Problem, switch: Switch, first: Table, second: _SecondLegs) -> CountArray:
    """The least sum of both legs by trigger and stay in the source, `(triggers, stays)`, stays not yet paid for.

    It depends on the source's frame alone: trigger plus stay. Only a bound on both stays makes a difference by stay.
    """
    triggers, frames = problem.triggers(switch), _source_frames(problem, switch, problem.settings.blend_frames)
    shift = problem.settings.blend_frames - switch.alignment.offset_at(0)
    sums = np.full((len(triggers), len(second.stays)), FORBIDDEN, dtype=np.int32)
    for bound in sorted({int(bound) for bound in second.bounds if bound >= 0}):
        table = second.by_time or second.bounded_by(bound)
        minima = search.minima_with_fixed_alignment(first, table, frames, shift)
        padded = np.concatenate([minima, np.full(sum(sums.shape), FORBIDDEN, dtype=np.int32)])
        windows = np.lib.stride_tricks.sliding_window_view(padded, len(second.stays))[: len(triggers)]
        here = second.bounds == bound
        sums[:, here] = windows[:, here]
    return sums


def _entries(
    problem: Problem,
    job: Job,
    switch: Switch,
    first: Table,
    second: _SecondLegs,
    where: IntArray,
    cost: CountArray,
    stay: CountArray,
) -> Best:
    """Whole entries for the triggers in `where`, from the least cost and the stay in the source that has it."""
    blend = problem.settings.blend_frames
    trigger = problem.triggers(switch).start + where
    source = trigger + stay
    times = source + blend - _offsets(switch, trigger)
    frame = np.zeros(len(where), dtype=np.int64)
    for part in range(0, len(where), 256):
        some = slice(part, part + 256)
        total = first.counts[source[some] - first.first_row] + second.of(times[some], stay[some])
        frame[some] = total.argmin(axis=1)
    frame += job.start
    longest = second.bounds[stay]
    stay_hop = search.stays_in_hop(second.to_hop.costs, times, frame + blend, longest, problem.weight)
    blend_second = second.to_hop.lengths_at(times + stay_hop, frame + blend + stay_hop)
    if job.hop == switch.destination:
        own = frame + blend == times
        stay_hop[own], blend_second[own] = 0, 0
    hop, blend_first = (np.full(len(where), value, dtype=np.int32) for value in (job.hop, blend))
    return Best(cost, hop, frame.astype(np.int32), stay, stay_hop, blend_first, blend_second)
