"""More than one hop, by dynamic programming.

Koyama & Goto 2019, section 5, Multiple hops: a straightforward extension that they did not make because of its cost.
Trying all pairs of hops would square the number of combinations; here each further hop costs one (min, +) product of
the matrix of all hop-to-hop distances with the best ways to go on, because these depend only on the clip, its frame and
the destination's frame (the time). That is `n^2` sums for `n` hop frames and each time: seconds for a dozen short
clips, minutes for twenty of 20 seconds, and memory for the matrix, which is refused beyond a bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from study.arrays import CountArray
from study.counting import counted
from study.errors import TransitionError
from study.transitions.one_hop.build import MEMORY_BYTES
from study.transitions.one_hop.play import Step
from study.transitions.one_hop.problem import FORBIDDEN, Problem, Switch
from study.transitions.one_hop.search import Table, second_leg
from study.transitions.threads import one_blas_thread

_ROWS = 64


@dataclass(frozen=True)
class Chain:
    """A transition by several hops."""

    cost: float
    """The distances of all blends, plus the weight times all stays, in the distance's cost."""
    steps: tuple[Step, ...]
    """The hops, and the destination last; `play.play_steps` plays them."""


def find_chains(
    problem: Problem, switch: Switch, hops: int, *, memory_bytes: int = MEMORY_BYTES
) -> tuple[Chain | None, ...]:
    """The best transition through at most n hops, for each triggered frame of a switch.

    One for each triggered frame; None where none fits. With one hop the costs are those of `build_table`, and more hops
    never cost more.

    Parameters
    ----------
    problem, switch
        What is asked; the destination's alignment must be an offset (music), and neither stays nor single hops have
        bounds or costs of their own.
    hops, memory_bytes
        The most hops, at least 1, and the most memory for the distances.

    Raises
    ------
    TransitionError
        For a problem that this search doesn't take, or that needs more memory.
    """
    search = _Search(problem, switch, hops, memory_bytes)
    return tuple(search.chain(trigger) for trigger in problem.triggers(switch))


class _Search:
    """Value tables: `to_go[k][clip]` is the least cost to go with at most k more hops, by (destination frame, frame).

    It is for a clip that plays alone from that frame on, at the end of the blend into it.
    """

    def __init__(self, problem: Problem, switch: Switch, hops: int, memory_bytes: int) -> None:
        if hops < 1 or switch.alignment.offset is None or problem.settings.longest_stay_both is not None:
            raise TransitionError(
                "Expected at least one hop, an alignment by an offset and no bound on both stays, got "
                f"{counted(hops, 'hop')}, {switch.alignment} and a bound of {problem.settings.longest_stay_both}."
            )
        if problem.offsets or problem.hop_costs or problem.nearest_to_direct is not None:
            raise TransitionError("Expected a problem without rules for single hops; chains of hops don't take them.")
        self.problem, self.switch, self.hops = problem, switch, hops
        self.blend = problem.settings.blend_frames
        self.windows = [max(clip.frames - self.blend + 1, 0) for clip in problem.clips]
        self.used = [hop for hop in problem.hop_numbers if self.windows[hop]]
        total = sum(self.windows[hop] for hop in self.used)
        times = problem.clips[switch.destination].frames + 1
        needed = 4 * total * (total + (hops + 1) * times)
        if needed > memory_bytes:
            raise TransitionError(
                f"Expected to need at most {memory_bytes / 2**30:.1f} GB, a search over chains of "
                f"{counted(total, 'hop frame')} "
                f"needs {needed / 2**30:.1f} GB. Give fewer or shorter hops, or more memory."
            )
        distance = problem.distance
        with one_blas_thread():
            clips = {switch.source, switch.destination, *self.used}
            prepared = {number: distance.prepare(problem.clips[number], self.blend) for number in clips}
            self.costs = {
                (a, b): self._counts(prepared, a, b)
                for a in clips
                for b in self.used
                if a in self.used or a == switch.source
            }
            self.last = {hop: self._counts(prepared, switch.destination, hop) for hop in self.used}
        self.offset = switch.alignment.offset
        # Times before the destination's first frame are there for hops that begin before it does.
        reach = hops * (self.blend + problem.settings.longest_stay_hop) + problem.settings.longest_stay_hop
        first = problem.triggers(switch).start + self.blend - self.offset
        self.times = range(min(max(first, -reach), times), times)
        self.to_go: list[dict[int, Table]] = [{hop: self._last_leg(self.last[hop], hop) for hop in self.used}]
        for _ in range(hops - 1):
            self.to_go.append({hop: self._one_more(hop) for hop in self.used})

    def _counts(self, prepared: dict[int, Any], a: int, b: int) -> CountArray:
        rows, columns = range(self.windows[a]), range(self.windows[b])
        return self.problem.distance.counts(prepared[a], prepared[b], self.blend, rows, columns)

    def _last_leg(self, into: CountArray, hop: int) -> Table:
        settings, frames = self.problem.settings, self.problem.clips[hop].frames
        table = second_leg(
            Table(into, 0, 0), self.times, range(frames + 1), settings.longest_stay_hop, self.problem.weight
        )
        if hop == self.switch.destination:
            own = np.arange(max(self.times.start, 0), min(self.times.stop, frames + 1))
            table.counts[own - self.times.start, own] = 0
        return table

    def _onward(self, to_go: dict[int, Table], time: int) -> CountArray:
        """What it costs to go on after a blend into any hop frame that starts at a time: all hops side by side."""
        at = time + self.blend - self.times.start
        parts = [
            to_go[hop].counts[at, self.blend : self.blend + self.windows[hop]]
            if 0 <= at < len(self.times)
            else np.full(self.windows[hop], FORBIDDEN, dtype=np.int32)
            for hop in self.used
        ]
        return np.concatenate(parts)

    def _one_more(self, clip: int) -> Table:
        """The least cost to go with one more hop than the last table allows."""
        before = self.to_go[-1]
        costs = np.concatenate([self.costs[clip, hop] for hop in self.used], axis=1)
        leave = np.full((len(self.times), self.windows[clip]), FORBIDDEN, dtype=np.int32)
        work = np.empty((_ROWS, costs.shape[1]), dtype=np.int32)
        for row, time in enumerate(self.times):
            onward = self._onward(before, time)
            if onward.min(initial=FORBIDDEN) >= FORBIDDEN:
                continue
            for top in range(0, len(costs), _ROWS):
                block = costs[top : top + _ROWS]
                np.add(block, onward, out=work[: len(block)]).min(axis=1, out=leave[row, top : top + len(block)])
        np.minimum(leave, FORBIDDEN, out=leave)
        frames = self.problem.clips[clip].frames
        table = second_leg(
            Table(leave, self.times.start, 0),
            self.times,
            range(frames + 1),
            self.problem.settings.longest_stay_hop,
            self.problem.weight,
        )
        np.minimum(table.counts, before[clip].counts, out=table.counts)
        return table

    def chain(self, trigger: int) -> Chain | None:
        """The best chain for a triggered frame: found forwards, by what the tables say it costs to go on."""
        weight, clip, frame, time = self.problem.weight, self.switch.source, trigger, trigger - self.offset
        steps: list[Step] = []
        total: int | None = None
        owed = 0
        for left in range(self.hops, 0, -1):
            to_go = self.to_go[left - 1]
            longest = self.problem.settings.longest_stay_hop if steps else self.problem.settings.longest_stay_source
            if steps and self.to_go[0][clip].counts[time - self.times.start, frame] == owed:
                break
            best = (FORBIDDEN, 0, 0, 0, 0)
            for stay in range(longest + 1):
                if frame + stay >= self.windows[clip]:
                    break
                onward = self._onward(to_go, time + stay)
                costs = np.concatenate([self.costs[clip, hop][frame + stay] for hop in self.used]) + onward
                where = int(costs.argmin())
                cost = int(costs[where]) + stay * weight
                if cost < best[0]:
                    hop, start = self._place(where)
                    best = (cost, stay, hop, start, int(onward[where]))
            cost, stay, hop, start, onward_cost = best
            if cost >= FORBIDDEN:
                return None
            total = cost if total is None else total
            steps.append(Step(stay, hop, time + stay - start + self.offset, self.blend))
            clip, frame, time, owed = hop, start + self.blend, time + stay + self.blend, onward_cost
        assert total is not None  # there was at least one hop
        stay = self._last_stay(clip, frame, time, owed)
        steps.append(Step(stay, self.switch.destination, self.offset, self.blend))
        return Chain(total * self.problem.distance.unit, tuple(steps))

    def _last_stay(self, clip: int, frame: int, time: int, owed: int) -> int:
        """The shortest stay with which the last blend costs what it must."""
        if clip == self.switch.destination and frame == time:
            return 0
        into = Table(self.last[clip], 0, 0)
        for stay in range(self.problem.settings.longest_stay_hop + 1):
            cost = int(into.at(np.array([time + stay]), np.array([frame + stay]))[0])
            if cost + stay * self.problem.weight == owed:
                return stay
        raise AssertionError("the value table and the distances disagree")

    def _place(self, where: int) -> tuple[int, int]:
        """The hop, and its frame, of a column of all hops side by side."""
        starts = np.cumsum([0, *(self.windows[hop] for hop in self.used)])
        number = int(np.searchsorted(starts, where, side="right")) - 1
        return self.used[number], where - int(starts[number])
