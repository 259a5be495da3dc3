"""Transitions chosen by rule, not by eye, what each costs, and pictures of it: Koyama & Goto 2019, section 4.2.

    python benchmarks/one_hop_robustness.py FOLDER A.bvh B.bvh ...

Writes `one_hop_costs.png` (Figure 10) and `one_hop_distances.png` (Figure 5, the first two clips) into the folder, as
`docs/one_hop.md` shows them, and prints how smooth the transitions are: direct, with blends of one length, and with
blends of their own length.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1]))

from study.errors import TransitionError
from study.files import whole_file
from study.motion.clip import Clip, joint_positions, resample, retarget
from study.motion.mending import mend
from study.motion.readers.registry import read_clip
from study.transitions.one_hop.adaptive import adaptive, lengths_at
from study.transitions.one_hop.build import build_table
from study.transitions.one_hop.play import Played, Trigger, entry_steps, play
from study.transitions.one_hop.problem import (
    FORBIDDEN,
    Alignment,
    PointCloudDistance,
    Problem,
    Settings,
    Switch,
    weight_in_counts,
)
from study.transitions.one_hop.table import OneHopTable
from study.transitions.point_cloud import point_cloud, window_distances

WEIGHT = 2.5e-4
FPS = 60.0
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


@dataclass(frozen=True)
class Smoothness:
    """What a transition does to the motion, told by where the joints are and by nothing that the search knows.

    Parameters
    ----------
    seconds
        From the triggered frame to the end of the last blend.
    joint_acceleration, toe_acceleration
        The largest of any joint and of a toe in the blends and two frames about them, metres per second squared.
    slide_m
        How far the slower toe moves on the floor during the blends.
    skating
        The share of blended frames in which a toe is within 4 cm of the floor and none is slower than 0.2 m/s.
    """

    seconds: float
    joint_acceleration: float
    toe_acceleration: float
    slide_m: float
    skating: float


def smoothness_of(played: Played, trigger: int, floor: float) -> Smoothness:
    """Measure one transition; `floor` is the height of a standing toe, metres."""
    clip, fps = played.clip, played.clip.fps
    positions = joint_positions(clip)
    toes = [clip.skeleton.role(role) for role in ("toe.L", "toe.R")]
    acceleration = np.linalg.norm(np.diff(positions, n=2, axis=0), axis=-1) * fps**2
    slower = np.linalg.norm(np.diff(positions[:, toes][..., [0, 2]], axis=0), axis=-1).min(axis=1)
    low = positions[:-1, toes, 1].min(axis=1) < floor + 0.04
    blends = [segment for segment in played.segments if segment.kind == "blend"]
    about = np.concatenate([acceleration[max(part.start - 3, 0) : part.stop + 1] for part in blends])
    blended = np.concatenate([np.arange(part.start, min(part.stop, len(slower))) for part in blends])
    return Smoothness(
        (blends[-1].stop - trigger) / fps,
        float(about.max()),
        float(about[:, toes].max()),
        float(slower[blended].sum()),
        float(np.mean(low[blended] & (slower[blended] * fps > 0.2))),
    )


def floor_of(clips: Sequence[Clip]) -> float:
    """The height of a standing toe, metres: the 5% quantile of the lower toe's heights, the median over the clips."""
    toes = [clips[0].skeleton.role(role) for role in ("toe.L", "toe.R")]
    return float(np.median([np.quantile(joint_positions(clip)[:, toes, 1].min(axis=1), 0.05) for clip in clips]))


def compare(problem: Problem) -> None:
    """Print how smooth direct transitions are, and one-hop ones with blends of one length and of their own.

    Both weights are that of Eq. 5, which divides by the most that the responsiveness cost can be: where blends have
    their own length, that includes what they take beyond the shortest.
    """
    settings = replace(problem.settings, lengths=lengths_at(problem.clips[0].fps, problem.settings.blend_frames))
    stays = settings.longest_stay_source + settings.longest_stay_hop
    share = stays / (stays + 2 * (settings.blends[-1] - settings.blends[0]))
    own = adaptive(replace(problem, settings=settings, weight=round(problem.weight * share)))
    floor = floor_of(problem.clips)
    for name, asked, method in (
        ("direct", problem, "direct"),
        (f"{settings.blend_frames} frames", problem, "one-hop"),
        ("own lengths", own, "one-hop"),
    ):
        found, costs = [], []
        for switch in problem.switches:
            # A table of its own, since two transitions of the set can join the same clips.
            table = build_table(replace(asked, switches=(switch,)))
            trigger = switch.first_trigger
            single = [Trigger(trigger, switch.destination)]
            played = play(problem.clips, table, single, first=switch.source, method=method)
            found.append(smoothness_of(played, trigger, floor))
            if method == "one-hop":
                costs.append(strain(own, table, switch))
        print(f"{name}: {f'mean cost {np.mean(costs):.4f} as own lengths count it, ' if costs else ''}mean (largest)")
        for field in fields(Smoothness):
            values = [getattr(one, field.name) for one in found]
            print(f"  {field.name:20} {np.mean(values):8.3f} ({np.max(values):.3f})")


def strain(problem: Problem, table: OneHopTable, switch: Switch) -> float:
    """What both blends of an entry cost, whichever table it is from, as `problem.distance` counts them."""
    entry = table.look_up(switch.source, switch.destination, switch.first_trigger)
    assert entry is not None  # the robustness set has only triggers from which a transition fits
    to = switch.alignment.offset_at(switch.first_trigger)
    first, second = entry_steps(table, entry, switch.destination, to)
    start = switch.first_trigger + first.stay
    then = start + first.blend_frames + second.stay
    total = 0.0
    for other, at, step, there in (
        (switch.source, start, first, start - first.offset),
        (switch.destination, then - to, second, then - first.offset),
    ):
        if (switch.destination, then - to) == (entry.hop, there) and step is second:
            continue  # the hop is the destination in its place
        pair = [problem.distance.prepare(problem.clips[number], step.blend_frames) for number in (other, entry.hop)]
        if other == entry.hop:
            pair[1] = pair[0]
        rows, columns = range(at, at + 1), range(there, there + 1)
        total += int(problem.distance.counts(*pair, step.blend_frames, rows, columns)[0, 0]) * problem.distance.unit
    return total


def robustness_set(clips: Sequence[Clip], settings: Settings, count: int = COUNT) -> tuple[Switch, ...]:
    """Transitions at triggered frames a fixed interval apart.

    Parameters
    ----------
    clips
        At least two, in a given order.
    settings
        Blend and stays: only frames are used from which a transition with all its stays fits in both clips.
    count
        How many (2019: 15).

    Returns
    -------
    The usable frames of all clips, one after the other, give up `count` frames at equal distances, the first half an
    interval from the start. Each is a trigger to go to the next clip (from the last one to the first), which at
    that moment is as far, in parts of its own usable frames, as the source.

    Raises
    ------
    TransitionError
        Where a clip is too short for even one such frame.
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


def draw_distances(
    distances: NDArray[np.float64],
    path: Path,
    *,
    fps: float,
    names: tuple[str, str] = ("A", "B"),
    words: str = "distance",
    marks: Sequence[tuple[int, int]] = (),
) -> None:
    """A colour map of the distance of every frame of one clip from every frame of another (Figure 5).

    Parameters
    ----------
    distances : (frames, frames)
        Rows for the first clip, columns for the second; blends start at these frames.
    path
        The PNG file.
    fps
        The clips' frame rate, for axes in seconds.
    names, words
        The clips, and what the colours are.
    marks
        (row, column) places to mark with a cross, such as where transitions start.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows, columns = distances.shape
    inches = 5.4 / max(rows, columns)
    size = max(inches * columns, 1.5) + 1.7, max(inches * rows, 1.5) + 0.8
    figure = Figure(figsize=size, dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    image = axes.imshow(
        distances, origin="lower", extent=(0.0, columns / fps, 0.0, rows / fps), cmap="viridis", interpolation="nearest"
    )
    if marks:
        frames = (np.array(marks) + 0.5) / fps
        axes.plot(frames[:, 1], frames[:, 0], "x", color="#ff5050", markersize=9, markeredgewidth=2)
    axes.set_xlabel(f"{names[1]}, seconds")
    axes.set_ylabel(f"{names[0]}, seconds")
    figure.colorbar(image, ax=axes, label=words)
    with whole_file(path) as unfinished:
        figure.savefig(unfinished, format="png")


def draw_costs(costs: Sequence[Costs], path: Path, *, unit: str = "m²", names: Sequence[str] = ()) -> None:
    """Bars of what each transition costs, direct on the left and one-hop in its three parts on the right (Figure 10).

    Parameters
    ----------
    costs
        From `costs_of`.
    path
        The PNG file.
    unit
        The cost's unit, for the axis.
    names
        A name for each transition; numbers from 1 unless given.
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
    axes.set_xticks(place, list(names) if names else [str(k + 1) for k in range(len(costs))])
    axes.set_xlabel("transition")
    axes.set_ylabel(f"cost, {unit}")
    axes.set_ylim(0.0, 1.28 * max(float(direct.max(initial=0.0)), float(below.max(initial=0.0)), 1e-9))
    axes.legend(frameon=False, fontsize=8, ncols=2, loc="upper left")
    with whole_file(path) as unfinished:
        figure.savefig(unfinished, format="png")


def main(folder: Path, files: Sequence[Path]) -> None:
    """Draw both pictures of the clips."""
    clips = [replace(resample(mend(read_clip(file)), FPS), name=file.stem) for file in files]
    clips = [retarget(clip, clips[0].skeleton) for clip in clips]
    distance, settings = PointCloudDistance(), Settings.at(FPS)
    switches = robustness_set(clips, settings)
    problem = Problem(tuple(clips), switches, settings, weight_in_counts(WEIGHT, distance), distance)
    table = build_table(problem)
    compare(problem)
    costs = [costs_of(problem, table, number, switch.first_trigger) for number, switch in enumerate(switches)]
    draw_costs(costs, folder / "one_hop_costs.png")
    first, second = clips[:2]
    distances = window_distances(point_cloud(first), point_cloud(second), settings.blend_frames)
    draw_distances(distances, folder / "one_hop_distances.png", fps=FPS, names=(first.name, second.name))


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]])
