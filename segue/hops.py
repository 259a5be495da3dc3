"""Optimal one-hop transitions (Koyama & Goto 2019): a table for some clips, and what it plays."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from study.motion.clip import Clip, retarget

if TYPE_CHECKING:
    from study.transitions.one_hop.play import Played
    from study.transitions.one_hop.table import OneHopTable


def one_hop(
    clips: Sequence[Clip],
    *,
    pairs: Sequence[tuple[int, int]] | None = None,
    offset: int = 0,
    weight: float | None = None,
    seed: int = 0,
    out: str | Path | None = None,
) -> OneHopTable:
    """The best transition through a third clip, for every frame at which it may be triggered.

    Parameters
    ----------
    clips
        At one frame rate; all of them may be hops.
    pairs
        Numbers of source and destination; all ordered pairs unless given.
    offset
        Frame of the source with which frame 0 of the destination aligns.
    weight
        Cost of a frame of stay; that of Eq. 5 unless given, drawn with `seed`.
    out
        A file for the table, X.npz or X.bin.
    """
    from numpy.random import default_rng

    from study.transitions.one_hop.build import build_table
    from study.transitions.one_hop.default_weight import default_weight
    from study.transitions.one_hop.problem import (
        Alignment,
        PointCloudDistance,
        Problem,
        Settings,
        Switch,
        weight_in_counts,
    )
    from study.transitions.one_hop.table import write_table

    same_body = tuple(retarget(clip, clips[0].skeleton) for clip in clips)
    settings, distance = Settings.at(clips[0].fps), PointCloudDistance()
    if weight is None:
        weight = default_weight(same_body, default_rng(seed), settings=settings, distance=distance).weight
    chosen = pairs or [(a, b) for a in range(len(clips)) for b in range(len(clips)) if a != b]
    switches = tuple(Switch(a, b, Alignment(offset)) for a, b in chosen)
    table = build_table(Problem(same_body, switches, settings, weight_in_counts(weight, distance), distance))
    if out is not None:
        write_table(table, Path(out))
    return table


def play(
    clips: Sequence[Clip],
    table: OneHopTable,
    triggers: Sequence[tuple[int, int]],
    *,
    first: int = 0,
    method: str = "one-hop",
) -> Played:
    """The motion of a state machine that plays the table's transitions; `segue.strip` and `segue.film` show it.

    `triggers` are pairs of a frame and the number of the clip to change to; `first` is the clip to start with; `method`
    is `one-hop`, or `direct` for blends without a hop.
    """
    from study.transitions.one_hop.play import Trigger
    from study.transitions.one_hop.play import play as play_table

    return play_table(clips, table, [Trigger(*one) for one in triggers], first=first, method=method)
