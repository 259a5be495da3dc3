"""Two clips that don't overlap, joined by a hop: the last frames of one, a hop, the first frames of the other.

Koyama & Goto 2019, section 5, Connection of nonoverlapping motions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from study.counting import counted
from study.errors import TransitionError
from study.transitions.one_hop.problem import FORBIDDEN, Problem
from study.transitions.one_hop.table import Entry


@dataclass(frozen=True)
class Connection:
    """How a hop joins two clips."""

    entry: Entry
    """The hop, its offset on the source's timeline, no stay in the source, and the stay in the hop."""
    offset: int
    """The source's frame at which the second blend starts, with the destination's frame 0."""
    cost: float
    """Eq. 2, in the distance's cost."""


def connect(problem: Problem, source: int, destination: int) -> Connection:
    """The best hop from the last frames of one clip to the first frames of another.

    The first blend takes the last frames of the source, the second one the first frames of the destination, which
    starts when the hop is done. So the stay in the hop decides where the destination stands, and is searched with the
    hop's frame. Ties: the first hop, its first frame, the least stay.

    Raises
    ------
    TransitionError
        Where a clip is shorter than the blend, or no hop has the frames.
    """
    settings, distance = problem.settings, problem.distance
    blend = settings.blend_frames
    for number in (source, destination):
        clip = problem.clips[number]
        if clip.frames < blend:
            raise TransitionError(
                f"Expected clips of at least {counted(blend, 'frame')}, the blend, {clip.name or number} has "
                f"{clip.frames}."
            )
    last = problem.clips[source].frames - blend
    prepared = {n: distance.prepare(problem.clips[n], blend) for n in {source, destination, *problem.hop_numbers}}
    best: tuple[int, int, int, int] | None = None
    for hop in problem.hop_numbers:
        windows = problem.clips[hop].frames - blend + 1
        starts = windows - blend
        if starts < 1:
            continue
        first = distance.counts(prepared[source], prepared[hop], blend, range(last, last + 1), range(starts))[0]
        second = distance.counts(prepared[destination], prepared[hop], blend, range(1), range(windows))[0]
        allowed = problem.offsets.get((source, hop))
        if allowed is not None:
            first = np.where(np.isin(last - np.arange(starts), allowed), first, np.int32(FORBIDDEN))
        # (frame of the hop, stay): the second blend starts that much after the first one ends.
        stays = np.arange(min(settings.longest_stay_hop, settings.stay_both) + 1)
        padded = np.concatenate([second, np.full(len(stays), FORBIDDEN, dtype=np.int32)])
        after = np.lib.stride_tricks.sliding_window_view(padded, len(stays))[blend : blend + starts]
        total = first[:, None] + after + (stays * problem.weight).astype(np.int32)
        total += np.int32(problem.hop_costs.get(hop, 0))
        where, width = int(np.argmin(total)), len(stays)
        found = (int(total.flat[where]), hop, where // width, where % width)
        if found[0] < FORBIDDEN and (best is None or found < best):
            best = found
    if best is None:
        raise TransitionError(f"Expected a hop of at least {2 * blend} frames, two blends, found none. Add clips.")
    cost, hop, frame, stay = best
    return Connection(Entry(hop, last - frame, 0, stay), last + blend + stay, cost * distance.unit)
