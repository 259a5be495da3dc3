"""The robustness set of Koyama & Goto 2019, section 4.2: transitions by rule, and what each part of them costs.

Clips, or a problem and its table, come in; switches, costs and the picture of Figure 10 go out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from study.errors import TransitionError
from study.files import whole_file
from study.motion.clip import Clip
from study.transitions.one_hop.problem import FORBIDDEN, Alignment, Problem, Settings, Switch
from study.transitions.one_hop.table import OneHopTable

COUNT = 15
# After Okabe and Ito 2008: told apart by people with any colour vision.
_FIRST, _SECOND, _WAITING, _DIRECT = "#0062a8", "#cc6200", "#bbbbbb", "#444444"


@dataclass(frozen=True)
class Costs:
    """The parts of one transition's cost, in the distance's cost.

    Parameters
    ----------
    first, second
        `D` of the blend into the hop, and of the blend out of it.
    waiting
        `w R`: the weight times both stays.
    direct
        `D` of the direct transition; infinite where the clips don't have the frames.
    """

    first: float
    second: float
    waiting: float
    direct: float

    @property
    def total(self) -> float:
        """Eq. 2."""
        return self.first + self.second + self.waiting


def robustness_set(clips: Sequence[Clip], settings: Settings, count: int = COUNT) -> tuple[Switch, ...]:
    """So many transitions (2019: 15) at triggered frames a fixed interval apart, between two clips or more, in order.

    Frames are usable from which a transition with all its stays fits in both clips; those of all clips, one after the
    other, give up `count` frames at equal distances, the first half an interval from the start. Each is a trigger to go
    to the next clip (from the last one to the first), which at that moment is as far, in parts of its own usable
    frames, as the source. `TransitionError` where a clip is too short for even one such frame.
    """
    needed = 2 * settings.blend_frames + settings.longest_stay_source + settings.longest_stay_hop
    usable = [clip.frames - needed + 1 for clip in clips]
    if len(clips) < 2 or min(usable) < 1:
        shortest = min((clip.frames for clip in clips), default=0)
        raise TransitionError(
            f"Expected at least two clips of {needed} frames or more, two blends and both stays, got {len(clips)}, the "
            f"shortest of {shortest}. Leave short clips out, or bound the stays."
        )
    starts = np.concatenate([[0], np.cumsum(usable)])
    switches = []
    for k in range(count):
        place = int(starts[-1] * (k + 0.5) / count)
        source = int(np.searchsorted(starts, place, side="right")) - 1
        destination = (source + 1) % len(clips)
        trigger = place - int(starts[source])
        frame = trigger * usable[destination] // usable[source]
        switches.append(Switch(source, destination, Alignment(destination_frame=frame), trigger, trigger))
    return tuple(switches)


def costs_of(problem: Problem, table: OneHopTable, number: int, trigger: int) -> Costs:
    """The parts of the cost of one entry, measured again between the clips.

    Parameters
    ----------
    problem, table
        What was asked, and the answer.
    number
        The switch.
    trigger
        The triggered frame.
    """
    row, distance, blend = table.rows[number], problem.distance, problem.settings.blend_frames
    hop, offset, stay_source, stay_hop = (
        int(value) for value in table.entries[row.first_entry + trigger - row.first_trigger, :4]
    )
    if hop < 0:
        raise TransitionError(f"Expected a triggered frame with a transition, got {trigger}, where none fits.")
    to = row.alignment.offset_at(trigger)
    start = trigger + stay_source
    second = start + blend + stay_hop

    def between(a: int, frame_a: int, b: int, frame_b: int) -> float:
        clips = problem.clips[a], problem.clips[b]
        if (a, frame_a) == (b, frame_b):
            return 0.0
        if not all(0 <= f <= clip.frames - blend for f, clip in zip((frame_a, frame_b), clips, strict=True)):
            return float("inf")
        prepared = [distance.prepare(clip, blend) for clip in clips]
        rows, columns = range(frame_a, frame_a + 1), range(frame_b, frame_b + 1)
        found = distance.counts(prepared[0], prepared[1], blend, rows, columns)
        return int(found[0, 0]) * distance.unit if found[0, 0] < FORBIDDEN else float("inf")

    return Costs(
        between(row.source, start, hop, start - offset),
        between(hop, second - offset, row.destination, second - to),
        problem.weight * (stay_source + stay_hop) * distance.unit,
        between(row.source, trigger, row.destination, trigger - to),
    )


def draw_costs(costs: Sequence[Costs], path: Path) -> None:
    """Bars of what each transition costs, direct on the left and one-hop in its three parts on the right (Figure 10).

    Parameters
    ----------
    costs
        From `costs_of`.
    path
        The PNG file.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(max(4.5, 0.6 * len(costs) + 1.5), 3.8), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    place = np.arange(len(costs))
    direct = np.array([each.direct if np.isfinite(each.direct) else 0.0 for each in costs])
    axes.bar(place - 0.2, direct, 0.38, color=_DIRECT, label="direct: D source to destination")
    below = np.zeros(len(costs))
    for label, colour, heights in (
        ("one-hop: D source to hop", _FIRST, [each.first for each in costs]),
        ("one-hop: D hop to destination", _SECOND, [each.second for each in costs]),
        ("one-hop: w R, the stays", _WAITING, [each.waiting for each in costs]),
    ):
        axes.bar(place + 0.2, heights, 0.38, bottom=below, color=colour, label=label)
        below = below + np.array(heights)
    axes.set_xticks(place, [str(k + 1) for k in range(len(costs))])
    axes.set_xlabel("transition")
    axes.set_ylabel("cost, m²")
    axes.set_ylim(0.0, 1.28 * max(float(direct.max(initial=0.0)), float(below.max(initial=0.0)), 1e-9))
    axes.legend(frameon=False, fontsize=8, ncols=2, loc="upper left")
    with whole_file(path) as unfinished:
        figure.savefig(unfinished, format="png")
