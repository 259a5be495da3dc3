"""One-hop transitions whose blends are as long as the geodesic method of 2004 says, rather than 30 frames each.

Koyama & Goto 2019, section 5, Blending duration, which names Wang & Bodenheimer 2004 (there [37]) as the way to go.
For every frame of a clip and every frame of another, the blend that starts there gets the length at which the mean
weighted squared half angle (2004, Eqs. 1 and 2) is least; that least mean is the smoothness cost. Since longer blends
respond later, the responsiveness cost counts the blends too: `R = s_s + s_h + b_1 + b_2 - 2 * shortest`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.errors import TransitionError
from study.motion.clip import Clip
from study.transitions.distances import distance_matrix
from study.transitions.one_hop.problem import FORBIDDEN, IntArray, OffsetArray, Problem, Settings, Switch
from study.transitions.one_hop.search import Best, Table, second_leg, stays_in_hop
from study.transitions.one_hop.table import OneHopTable, table_of
from study.transitions.point_cloud import LARGEST_COUNT
from study.transitions.weights import joint_weights

# Counts of mean weighted squared half angles: 2^-20 squared radians.
UNIT = 2.0**-20
WORDS = "mean weighted squared half angle, squared radians (Wang & Bodenheimer 2004, Eqs. 1 and 2)"
SHORTEST_S, LONGEST_S = 1.0 / 30.0, 2.0


@dataclass(frozen=True, eq=False)
class Blends:
    """The blends that start at each frame of one clip (rows) and each frame of another (columns).

    Parameters
    ----------
    counts : (frames, frames) int32
        The least mean cost, in counts of `UNIT`; `FORBIDDEN` where not even the shortest blend fits.
    lengths : (frames, frames) int32
        The length that has it, frames; of equal ones the shortest.
    """

    counts: IntArray
    lengths: IntArray


def geodesic_blends(a: Clip, b: Clip, weights: NDArray[np.float64], shortest: int, longest: int) -> Blends:
    """The geodesic blend length for every pair of frames that may start a blend.

    Parameters
    ----------
    a, b
        Clips of one rig at one frame rate.
    weights : (joints,)
        From `joint_weights`.
    shortest, longest
        The range of lengths in frames.

    Notes
    -----
    The frame distances are summed along diagonals one frame at a time, so all lengths of all pairs cost `longest`
    additions each.
    """
    if not 1 <= shortest <= longest:
        raise TransitionError(f"Expected 1 <= shortest <= longest blend length, got {shortest} and {longest}.")
    frame_costs = (distance_matrix(a, b, weights) / UNIT).astype(np.float32)
    sums = np.zeros_like(frame_costs)
    least = np.full(frame_costs.shape, np.inf, dtype=np.float32)
    lengths = np.zeros(frame_costs.shape, dtype=np.int32)
    for length in range(1, min(longest, *frame_costs.shape) + 1):
        rows, columns = frame_costs.shape[0] - length + 1, frame_costs.shape[1] - length + 1
        here = sums[:rows, :columns]
        here += frame_costs[length - 1 :, length - 1 :]
        if length >= shortest:
            mean = np.rint(here / np.float32(length))
            better = mean < least[:rows, :columns]
            least[:rows, :columns][better] = mean[better]
            lengths[:rows, :columns][better] = length
    counts = np.where(np.isfinite(least), np.minimum(least, LARGEST_COUNT), FORBIDDEN).astype(np.int32)
    return Blends(counts, lengths)


_ONE_SEARCH = "Expected adaptive blends to be searched by build_adaptive, found another search; call that one."


@dataclass(frozen=True)
class _GeodesicDistance:
    """What a `Problem` for adaptive blends says of its cost; it has no windows of one length."""

    unit: float = UNIT
    words: str = WORDS

    def prepare(self, clip: Clip, blend_frames: int) -> Clip:
        del clip, blend_frames
        raise TransitionError(_ONE_SEARCH)

    def counts(self, a: Clip, b: Clip, blend_frames: int, rows: range, columns: range) -> IntArray:
        del a, b, blend_frames, rows, columns
        raise TransitionError(_ONE_SEARCH)


def build_adaptive(
    clips: Sequence[Clip],
    switches: Sequence[Switch],
    weight: float,
    *,
    settings: Settings | None = None,
    shortest: int | None = None,
    longest: int | None = None,
    weights: str = "wang2003",
    hops: Sequence[int] | None = None,
) -> OneHopTable:
    """Optimal one-hop transitions with geodesic blend lengths; entries of six integers.

    Parameters
    ----------
    clips, switches, hops
        As in `Problem`.
    weight
        Cost a frame, in squared radians.
    settings
        The longest stays (its blend length is not used); the paper's unless given.
    shortest, longest
        Blend lengths in frames; 0.03 to 2 s unless given, as in 2004.
    weights
        As `joint_weights` takes them.

    Raises
    ------
    TransitionError
        For clips that don't go together, or a bound on both stays, which this search doesn't have.
    """
    fps = clips[0].fps if clips else 60.0
    settings = settings or Settings.at(fps)
    if settings.longest_stay_both is not None:
        raise TransitionError("Expected no bound on both stays together: blends of their own length don't take one.")
    low = max(1, round(SHORTEST_S * fps)) if shortest is None else shortest
    high = max(low, round(LONGEST_S * fps)) if longest is None else longest
    problem = Problem(
        tuple(clips),
        tuple(switches),
        settings,
        round(weight / UNIT),
        _GeodesicDistance(),
        None if hops is None else tuple(hops),
    )
    joint = joint_weights(clips[0].skeleton, weights)
    best = {number: Best.none(len(problem.triggers(switch))) for number, switch in enumerate(switches)}
    direct = {number: np.full(len(found.cost), FORBIDDEN, dtype=np.int32) for number, found in best.items()}
    blends = {number: np.zeros((len(found.cost), 2), dtype=np.int32) for number, found in best.items()}
    for hop in problem.hop_numbers:
        legs = {
            clip: geodesic_blends(clips[clip], clips[hop], joint, low, high)
            for clip in sorted({number for switch in switches for number in (switch.source, switch.destination)})
        }
        for number, switch in enumerate(switches):
            where, found, lengths, straight = _search(problem, switch, hop, legs, low, high)
            before = best[number].cost.copy(), best[number].stay_source.copy(), best[number].hop.copy()
            best[number].offer(where, found)
            after = best[number]
            taken = (before[0] != after.cost) | (before[1] != after.stay_source) | (before[2] != after.hop)
            blends[number][where] = np.where(taken[where, None], lengths, blends[number][where])
            if hop == switch.destination:
                direct[number] = straight
    table = table_of(problem, best, direct)
    entries = np.concatenate([table.entries, np.concatenate([blends[number] for number in best])], axis=1)
    entries[entries[:, 0] < 0, 4:] = 0
    return OneHopTable(**{**vars(table), "entries": entries, "blend_frames": 0})


def _search(
    problem: Problem, switch: Switch, hop: int, legs: dict[int, Blends], low: int, high: int
) -> tuple[OffsetArray, Best, IntArray, IntArray]:
    """The best with one hop: triggers, entries, blend lengths, and the direct cost of all triggers."""
    settings, weight = problem.settings, problem.weight
    first = _priced(legs[switch.source], low, weight)
    to_hop = Table(_priced(legs[switch.destination], low, weight), 0, 0)
    triggers = problem.triggers(switch)
    lengths = legs[switch.source].lengths
    every = np.arange(triggers.start, triggers.stop)
    offset = np.array([switch.alignment.offset_at(int(trigger)) for trigger in every])
    shifts = every - offset  # the destination's frame at the trigger
    last = int(shifts.max()) + settings.longest_stay_source + high
    start = max(int(shifts.min()), -settings.longest_stay_hop)
    times = range(start, max(start, min(last, problem.clips[switch.destination].frames) + 1))
    seconds = second_leg(to_hop, times, range(first.shape[1] + 1), settings.longest_stay_hop, weight)
    if hop == switch.destination:
        own = np.arange(max(times.start, 0), min(times.stop, first.shape[1] + 1))
        seconds.counts[own - times.start, own] = 0
    sums = np.full((len(triggers), settings.longest_stay_source + 1), FORBIDDEN, dtype=np.int32)
    frames = np.zeros_like(sums)
    for stay in range(sums.shape[1]):
        able = np.flatnonzero(every + stay < len(first))
        for part in range(0, len(able), 256):
            some = able[part : part + 256]
            total = _totals(first, lengths, seconds, every[some] + stay, shifts[some] + stay)
            frames[some, stay] = total.argmin(axis=1)
            sums[some, stay] = np.take_along_axis(total, frames[some, stay][:, None], axis=1)[:, 0] + stay * weight
    stay = sums.argmin(axis=1).astype(np.int32)
    cost = np.take_along_axis(sums, stay[:, None], axis=1)[:, 0]
    where = np.flatnonzero(cost < FORBIDDEN)
    stay, frame = stay[where], frames[where, stay[where]]
    length = lengths[every[where] + stay, frame]
    time = shifts[where] + stay + length
    stay_hop = stays_in_hop(to_hop, time, frame + length, np.full(len(where), settings.longest_stay_hop), weight)
    own_place = (time == frame + length) & (hop == switch.destination)
    stay_hop[own_place] = 0
    second = np.zeros(len(where), dtype=np.int32)
    blended = np.flatnonzero(~own_place)
    second[blended] = legs[switch.destination].lengths[(time + stay_hop)[blended], (frame + length + stay_hop)[blended]]
    found = Best(cost[where], np.full(len(where), hop, dtype=np.int32), frame, stay, stay_hop)
    straight = Table(first, 0, 0).at(every, shifts)
    return where, found, np.stack([length, second], axis=1), straight


def _priced(blends: Blends, low: int, weight: int) -> IntArray:
    return np.where(blends.counts < FORBIDDEN, blends.counts + (blends.lengths - low) * np.int32(weight), blends.counts)


def _totals(first: IntArray, lengths: IntArray, seconds: Table, rows: OffsetArray, times: OffsetArray) -> IntArray:
    """First legs from the source frames `rows` plus the second legs that follow them, by the hop's frame."""
    own = lengths[rows]
    time = times[:, None] + own - seconds.first_row
    frame = np.arange(first.shape[1]) + own
    known = (time >= 0) & (time < len(seconds.counts)) & (first[rows] < FORBIDDEN)
    second = seconds.counts[np.where(known, time, 0), frame] if len(seconds.counts) else np.zeros_like(own)
    return np.where(known, first[rows] + second, np.int32(FORBIDDEN))
