"""The exact one-hop search for one hop clip, without looking at every combination.

In: costs in counts of blends from the source to the hop and from the hop to the destination. Out: for every triggered
frame the best start, stays and cost with this hop. Koyama & Goto 2019, Eqs. 1 to 4.

The paper tries every (hop frame, stay in the source, stay in the hop). But the best stay in the hop depends only on
the hop's frame and the destination's frame at the end of the first blend, so `second_leg` finds it once for all
sources and triggers, by a running minimum along diagonals. What is left is, for a source frame and a destination
frame, the minimum over the hop's frames of a sum of two rows. With the alignment fixed (music) there is one such pair
for each source frame; with a fixed frame of the destination at the trigger there is one for each stay, and lower
bounds leave most of them out.

Ties: of transitions that cost the same, the one with the least stay in the source, then the first hop clip, then the
first frame of the hop, then the least stay in the hop, then the shortest first blend, then the shortest second one.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from study.arrays import BoolArray, CountArray, IntArray
from study.transitions.one_hop.problem import FORBIDDEN

_ROWS = 128
_SEGMENT = 64
_PAIRS = 8192


@dataclass(eq=False)
class Best:
    """The best transition found so far for each of a range of triggered frames; `offer` improves it in place."""

    cost: CountArray
    hop: CountArray
    frame: CountArray
    stay_source: CountArray
    stay_hop: CountArray
    blend_first: CountArray
    blend_second: CountArray
    """`(triggers,)`: cost in counts (`FORBIDDEN` or more where there is none), hop clip (-1 where there is none), the
    hop's frame at the start of the first blend, both stays, and the frames of both blends."""

    @staticmethod
    def none(triggers: int) -> Best:
        """Nothing found yet."""
        cost = np.full(triggers, FORBIDDEN, dtype=np.int32)
        return Best(
            cost, np.full(triggers, -1, dtype=np.int32), *(np.zeros(triggers, dtype=np.int32) for _ in range(5))
        )

    def beaten_by(self, cost: CountArray, stay_source: CountArray, hop: int) -> BoolArray:
        """Where a cost, with its stay in the source, is better by the rule for ties, or may be by the hop's frame."""
        same = (cost == self.cost) & (self.hop >= 0)
        sooner = (stay_source < self.stay_source) | ((stay_source == self.stay_source) & (hop <= self.hop))
        return np.asarray((cost < self.cost) | (same & sooner))

    def offer(self, where: IntArray, other: Best) -> None:
        """Take over `other`'s entries (one for each trigger in `where`) wherever they are better."""
        ours, theirs = self._keys(where), other._keys(slice(None))
        better, tied = np.zeros(len(where), dtype=bool), np.ones(len(where), dtype=bool)
        for old, new in zip(ours, theirs, strict=True):
            better |= tied & (new < old)
            tied &= new == old
        chosen = where[better]
        for each in fields(self):
            getattr(self, each.name)[chosen] = getattr(other, each.name)[better]

    def _keys(self, where: IntArray | slice) -> tuple[CountArray, ...]:
        stays = (self.cost, self.stay_source, self.hop, self.frame, self.stay_hop)
        return tuple(values[where] for values in (*stays, self.blend_first, self.blend_second))


@dataclass(frozen=True, eq=False)
class Table:
    """A block of a cost matrix with its place: entry `[r, c]` is for row `first_row + r`, column `first_column + c`."""

    counts: CountArray
    first_row: int
    first_column: int

    def block(self, rows: range, columns: range) -> CountArray:
        """A copy of any stretch of rows and columns, `FORBIDDEN` outside of what is known."""
        out = np.full((len(rows), len(columns)), FORBIDDEN, dtype=np.int32)
        top, bottom = max(rows.start, self.first_row), min(rows.stop, self.first_row + self.counts.shape[0])
        left, right = max(columns.start, self.first_column), min(columns.stop, self.first_column + self.counts.shape[1])
        if top < bottom and left < right:
            known = self.counts[
                top - self.first_row : bottom - self.first_row, left - self.first_column : right - self.first_column
            ]
            out[top - rows.start : bottom - rows.start, left - columns.start : right - columns.start] = known
        return out

    def at(self, rows: IntArray, columns: IntArray) -> CountArray:
        """Single entries, `FORBIDDEN` outside of what is known."""
        r, c = rows - self.first_row, columns - self.first_column
        known = (r >= 0) & (c >= 0) & (r < self.counts.shape[0]) & (c < self.counts.shape[1])
        out = np.full(np.shape(r), FORBIDDEN, dtype=np.int32)
        out[known] = self.counts[r[known], c[known]]
        return out


def second_leg(to_hop: Table, times: range, frames: range, longest_stay: int, weight: int) -> Table:
    """The best stay in the hop and blend into the destination, from every (destination frame, hop frame).

    For each pair `(e, v)` of `times` and `frames`, the destination's and the hop's frames at the end of the first
    blend, it is the least of `to_hop[e + s, v + s] + weight * s` over the stays `s` up to `longest_stay`.

    Notes
    -----
    By doubling: the least over 2m stays is the lesser of the least over m stays here, and over m stays m frames
    on, plus the weight of these m frames. The frames further on lie on a diagonal: a fixed stride in flat memory.
    """
    out = np.empty((len(times), len(frames)), dtype=np.int32)
    wide = range(frames.start, frames.stop + longest_stay)
    for top in range(0, len(times), _ROWS):
        bottom = min(top + _ROWS, len(times))
        block = to_hop.block(range(times.start + top, times.start + bottom + longest_stay), wide)
        least, stride, done = block.reshape(-1), len(wide) + 1, 1
        spare = np.empty_like(least)
        while done <= longest_stay:
            step = min(done, longest_stay + 1 - done)
            here = len(least) - step * stride
            further = np.add(least[step * stride :], np.int32(step * weight), out=spare[:here])
            np.minimum(least[:here], further, out=least[:here])
            done += step
        out[top:bottom] = block[: bottom - top, : len(frames)]
    return Table(out, times.start, frames.start)


def second_rows(to_hop: Table, times: IntArray, frames: range, longest: IntArray, weight: int) -> CountArray:
    """Single rows of `second_leg`, each with its own longest stay: `(len(times), len(frames))`."""
    out = np.full((len(times), len(frames)), FORBIDDEN, dtype=np.int32)
    counts = to_hop.counts
    for stay in range(int(longest.max(initial=-1)) + 1):
        rows = times + stay - to_hop.first_row
        used = np.flatnonzero((rows >= 0) & (rows < counts.shape[0]) & (stay <= longest))
        left = max(frames.start + stay, to_hop.first_column)
        right = min(frames.stop + stay, to_hop.first_column + counts.shape[1])
        if len(used) and left < right:
            cost = counts[rows[used], left - to_hop.first_column : right - to_hop.first_column]
            cost += np.int32(stay * weight)
            here = slice(left - stay - frames.start, right - stay - frames.start)
            out[used, here] = np.minimum(out[used, here], cost)
    return out


def stays_in_hop(to_hop: Table, times: IntArray, frames: IntArray, longest: IntArray, weight: int) -> CountArray:
    """The shortest stay in the hop of least cost, for single pairs, each with its own longest stay."""
    least = np.full(len(times), FORBIDDEN, dtype=np.int32)
    stays = np.zeros(len(times), dtype=np.int32)
    for stay in range(int(longest.max(initial=-1)) + 1):
        cost = to_hop.at(times + stay, frames + stay) + np.int32(stay * weight)
        better = (cost < least) & (stay <= longest)
        least[better], stays[better] = cost[better], stay
    return stays


def minima_with_fixed_alignment(first: Table, second: Table, frames: range, shift: int) -> CountArray:
    """For each source frame the least sum of both legs over the hop's frames, `(len(frames),)` counts.

    `first` are legs by (source frame, hop frame) where the first blend starts, `second` by (destination frame, hop
    frame) where it ends, `frames` the source frames at which it may start, and `shift` the destination's frame at its
    end, less the source's at its start.
    """
    top = max(frames.start, first.first_row, second.first_row - shift)
    bottom = min(first.first_row + len(first.counts), second.first_row + len(second.counts) - shift, frames.stop)
    out = np.full(len(frames), FORBIDDEN, dtype=np.int32)
    if top < bottom:
        left = first.counts[top - first.first_row : bottom - first.first_row]
        right = second.counts[top + shift - second.first_row : bottom + shift - second.first_row]
        work = np.empty((min(_ROWS, len(left)), left.shape[1]), dtype=np.int32)
        for row in range(0, len(left), _ROWS):  # in blocks that stay in cache
            total = np.add(left[row : row + _ROWS], right[row : row + _ROWS], out=work[: len(left) - row])
            total.min(axis=1, out=out[top - frames.start + row :][: len(total)])
    return out


def minima_by_stay(first: Table, second: CountArray, triggers: range, weight: int, limit: CountArray) -> CountArray:
    """For each triggered frame and stay in the source the least sum of both legs, where it may matter.

    `first` are legs by (source frame, hop frame), `second (stays, hop frames)` by the stay in the source, which gives
    the destination's frame, and `limit (triggers,)` the best costs known so far. It gives `(triggers, stays)` counts,
    stays not yet paid for; `FORBIDDEN` where the sum with its stay exceeds the best.

    Notes
    -----
    The least first leg and the least second leg of two rows bound all of their sums from below, so a pair whose bound
    exceeds the best known cost is never added up; and where a pair is, segments of the hop's frames are left out by
    bounds of their own. The most promising stay of each trigger is added up first: it sets a limit that leaves out
    most of the others. Equal costs are kept, for the rule for ties.
    """
    stays, width = second.shape
    out = np.full((len(triggers), stays), FORBIDDEN, dtype=np.int32)
    if not len(first.counts):
        return out
    counts, limit = first.counts[:, :width], np.minimum(limit, FORBIDDEN - 1)
    starts = np.arange(0, width, _SEGMENT)
    low_first, low_second = (np.minimum.reduceat(legs, starts, axis=1) for legs in (counts, second))
    source = np.arange(len(triggers))[:, None] + np.arange(stays) + (triggers.start - first.first_row)
    outside = (source < 0) | (source >= len(counts))
    source[outside] = 0
    paid = (np.arange(stays) * weight).astype(np.int32)
    bounds = low_first.min(axis=1)[source] + (low_second.min(axis=1) + paid)
    bounds[outside] = FORBIDDEN

    promising = bounds.argmin(axis=1)
    trigger = np.flatnonzero(np.take_along_axis(bounds, promising[:, None], axis=1)[:, 0] <= limit)
    stay = promising[trigger]
    for part in range(0, len(trigger), _ROWS):
        t, s = trigger[part : part + _ROWS], stay[part : part + _ROWS]
        out[t, s] = (counts[source[t, s]] + second[s]).min(axis=1)
    limit[trigger] = np.minimum(limit[trigger], out[trigger, stay] + paid[stay])
    bounds[trigger, stay] = FORBIDDEN  # done

    triggers_left, stays_left = np.nonzero(bounds <= limit[:, None])
    for part in range(0, len(triggers_left), _PAIRS):
        t, s = triggers_left[part : part + _PAIRS], stays_left[part : part + _PAIRS]
        segment_bounds = low_first[source[t, s]] + (low_second + paid[:, None])[s]
        for segment in range(len(starts)):
            here = slice(segment * _SEGMENT, min((segment + 1) * _SEGMENT, width))
            chosen = np.flatnonzero(segment_bounds[:, segment] <= limit[t])
            tc, sc = t[chosen], s[chosen]
            least = (counts[source[tc, sc], here] + second[sc, here]).min(axis=1)
            out[tc, sc] = np.minimum(out[tc, sc], least)
            np.minimum.at(limit, tc, least + paid[sc])
    return out
