"""The best one-hop transition that ends at a wanted place and heading, exactly: a constraint on the whole transition.

Koyama & Goto 2019, section 5, Positional and orientational constraints, which they name as missing: a character has to
arrive somewhere. In: a problem, a switch, one triggered frame, and where the destination is to stand. Out: the best of
all transitions that end there.

Where a transition ends follows from both blends: each places the next clip on the one before where it fits best on the
floor (`play`). On the floor a placement is a complex number to multiply by and one to add, known for all pairs of
windows from one product of matrices (as in `point_cloud`); so every stay and frame is looked at, and nothing played.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.arrays import BoolArray
from study.errors import TransitionError
from study.motion.clip import Clip, joint_positions
from study.transitions.blending import facing
from study.transitions.one_hop.problem import FORBIDDEN, Problem, Switch
from study.transitions.one_hop.table import Entry

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class Wanted:
    """Where the figure is to be at the end of the transition, seen from where it is and faces at the triggered frame.

    What is None may be anything.
    """

    forward_m: float | None = None
    left_m: float | None = None
    within_m: float = 0.1
    """How far the place may be from the wanted one: of both numbers, or along the one that is given."""
    turn_rad: float | None = None
    within_rad: float = math.radians(10.0)
    """The change of facing to the left, and by how much it may differ."""

    def met(self, moved: ComplexArray, turned: ComplexArray) -> BoolArray:
        """Whether displacements (forward + left i, metres) and turns (unit numbers) are as wanted."""
        off = np.zeros(moved.shape)
        if self.forward_m is not None:
            off = off + (moved.real - self.forward_m) ** 2
        if self.left_m is not None:
            off = off + (moved.imag - self.left_m) ** 2
        met = off <= self.within_m**2
        if self.turn_rad is not None:
            met &= np.abs(np.angle(turned * np.exp(-1j * self.turn_rad))) <= self.within_rad
        return np.asarray(met)


@dataclass(frozen=True)
class Reached:
    """A transition, its cost, and where the destination stands at its last blended frame."""

    entry: Entry
    cost: float
    forward_m: float
    left_m: float
    turn_rad: float


def reach(problem: Problem, switch: Switch, trigger: int, wanted: Wanted) -> Reached | None:
    """The best transition from one triggered frame that ends as wanted; None where none does.

    With nothing wanted it is the table's entry (`build_table`), ties included.

    Raises
    ------
    TransitionError
        For blends of several lengths, or hops that are kept near to the direct transition.
    """
    if problem.settings.lengths or problem.nearest_to_direct is not None:
        raise TransitionError("Expected blends of one length and any hop, found a problem with other rules; omit them.")
    search = _Search(problem, switch, trigger, wanted)
    for hop in problem.hop_numbers:
        search.look_at(hop)
    return search.best


class _Search:
    """What is best so far, by cost, stay in the source, hop, its frame and the stay in it."""

    def __init__(self, problem: Problem, switch: Switch, trigger: int, wanted: Wanted) -> None:
        self.problem, self.switch, self.trigger, self.wanted = problem, switch, trigger, wanted
        self.blend = problem.settings.blend_frames
        self.source, self.destination = (problem.clips[n] for n in (switch.source, switch.destination))
        windows = self.source.frames - self.blend + 1
        stays = min(problem.settings.longest_stay_source, problem.settings.stay_both)
        self.rows = range(trigger, max(trigger, min(trigger + stays + 1, windows)))
        self.into = trigger + self.blend - switch.alignment.offset_at(trigger)
        """The destination's frame at the end of a first blend that starts at once."""
        self.floor, self.faces = _floor(self.destination), np.exp(1j * facing(self.destination))
        self.here = _floor(self.source)[trigger]
        self.ahead = np.exp(1j * facing(self.source)[trigger])
        self.key: tuple[int, ...] = (FORBIDDEN,)
        self.best: Reached | None = None

    def look_at(self, hop: int) -> None:
        """All transitions through one hop."""
        clip, blend, settings = self.problem.clips[hop], self.blend, self.problem.settings
        columns = range(max(clip.frames - blend + 1, 0))
        into = range(max(self.into, 0), self.into + len(self.rows) + settings.longest_stay_hop)
        into = range(into.start, max(into.start, min(into.stop, self.destination.frames - blend + 1)))
        if not len(columns) or not len(self.rows):
            return
        first = self._counts(self.switch.source, hop, self.rows, columns)
        allowed = self.problem.offsets.get((self.switch.source, hop))
        if allowed is not None:
            offsets = np.arange(self.rows.start, self.rows.stop)[:, None] - np.arange(len(columns))
            first[~np.isin(offsets, allowed)] = FORBIDDEN
        turn, shift = placements(self.source, clip, blend, self.rows, columns)
        second = self._counts(self.switch.destination, hop, into, columns)
        then_turn, then_shift = placements(clip, self.destination, blend, columns, into)
        frames = np.arange(len(columns))
        for stay in range(len(self.rows)):
            at = self.into + stay
            if hop == self.switch.destination and 0 <= at - blend < len(columns):
                own = np.array([at - blend])
                there = turn[stay, own], shift[stay, own]
                self._offer(hop, stay, own, np.zeros(1, dtype=int), first[stay, own], there, np.array([at - 1]))
            longest = min(settings.longest_stay_hop, settings.stay_both - stay)
            stays, starts = (grid.ravel() for grid in np.meshgrid(np.arange(longest + 1), frames, indexing="ij"))
            ends, then = starts + blend + stays, at + stays - into.start
            fits = (ends < len(columns)) & (then >= 0) & (then < len(into)) & (first[stay, starts] < FORBIDDEN)
            stays, starts, ends, then = (values[fits] for values in (stays, starts, ends, then))
            costs = first[stay, starts] + second[then, ends] + stays * self.problem.weight
            placed = turn[stay, starts] * then_turn[ends, then]
            where = turn[stay, starts] * then_shift[ends, then] + shift[stay, starts]
            self._offer(hop, stay, starts, stays, costs, (placed, where), then + into.start + blend - 1)

    def _counts(self, clip: int, hop: int, rows: range, columns: range) -> NDArray[np.int64]:
        if not len(rows):
            return np.zeros((0, len(columns)), dtype=np.int64)
        distance, clips = self.problem.distance, self.problem.clips
        theirs = distance.prepare(clips[hop], self.blend)
        ours = theirs if clip == hop else distance.prepare(clips[clip], self.blend)
        return distance.counts(ours, theirs, self.blend, rows, columns).astype(np.int64)

    def _offer(
        self,
        hop: int,
        stay: int,
        starts: NDArray[np.intp],
        stays: NDArray[np.intp],
        costs: NDArray[np.int64],
        placed: tuple[ComplexArray, ComplexArray],
        ends: NDArray[np.intp],
    ) -> None:
        """Take the best of some transitions with one stay in the source, if it is better than what is known."""
        costs = costs + stay * self.problem.weight + self.problem.hop_costs.get(hop, 0)
        some = np.flatnonzero(costs <= self.key[0])
        some = some[costs[some] < FORBIDDEN]
        turn, shift = (values[some] for values in placed)
        moved = (turn * self.floor[ends[some]] + shift - self.here) / self.ahead
        turned = turn * self.faces[ends[some]] / self.ahead
        met = np.flatnonzero(self.wanted.met(moved, turned))
        if not len(met):
            return
        chosen = some[met]
        least = met[np.lexsort((stays[chosen], starts[chosen], costs[chosen]))[0]]
        one = int(some[least])
        key = (int(costs[one]), stay, hop, int(starts[one]), int(stays[one]))
        if key < self.key:
            entry = Entry(hop, self.trigger + stay - key[3], stay, key[4])
            where, cost = complex(moved[least]), key[0] * self.problem.distance.unit
            self.key = key
            self.best = Reached(entry, cost, where.real, where.imag, float(np.angle(turned[least])))


def placements(a: Clip, b: Clip, blend_frames: int, rows: range, columns: range) -> tuple[ComplexArray, ComplexArray]:
    """How clip `b` is placed on clip `a` (`point_cloud.alignment`) where a blend starts at a row and a column.

    Returns
    -------
    turn, shift : (len(rows), len(columns))
        Floor positions `z + ix` of `b` times `turn`, plus `shift`, metres.
    """
    p, q = (
        _joints(clip, range(wanted.start, wanted.stop + blend_frames - 1 if len(wanted) else wanted.start))
        for clip, wanted in ((a, rows), (b, columns))
    )
    shape = (len(rows), len(columns))
    if not all(shape):
        return np.ones(shape, dtype=complex), np.zeros(shape, dtype=complex)
    means = [np.lib.stride_tricks.sliding_window_view(each.mean(axis=1), blend_frames).mean(axis=1) for each in (p, q)]
    products = p @ q.conj().T / p.shape[1]
    total = np.zeros(shape, dtype=complex)
    for frame in range(blend_frames):
        total += products[frame : frame + shape[0], frame : frame + shape[1]]
    covariance = total / blend_frames - means[0][:, None] * means[1].conj()
    size = np.abs(covariance)
    turn = np.where(size > 0, covariance / np.where(size > 0, size, 1.0), 1.0)
    return turn, means[0][:, None] - turn * means[1]


def _joints(clip: Clip, frames: range) -> ComplexArray:
    positions = joint_positions(clip)[frames.start : frames.stop]
    return np.asarray(positions[..., 2] + 1j * positions[..., 0])


def _floor(clip: Clip) -> ComplexArray:
    return np.asarray(clip.root_positions[:, 2] + 1j * clip.root_positions[:, 0])
