"""Transitions chosen by rule, not by eye, what each costs, and pictures of it: Koyama & Goto 2019, section 4.2.

    python benchmarks/one_hop_robustness.py FOLDER A.bvh B.bvh ...

Writes `one_hop_costs.png` (Figure 10) and `one_hop_distances.png` (Figure 5, of the transition that gains most by its
hop) into the folder, as `docs/one_hop.md` shows them, and prints how smooth the transitions are: direct, with blends of
one length, and with blends of their own length.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from study.files import whole_file
from study.motion.clip import Clip, joint_positions, resample, retarget
from study.motion.mending import mend
from study.motion.readers.registry import read_clip
from study.transitions.one_hop.adaptive import adaptive, lengths_at
from study.transitions.one_hop.build import build_table
from study.transitions.one_hop.play import Played, Trigger, entry_steps, play
from study.transitions.one_hop.problem import (
    PointCloudDistance,
    Problem,
    Settings,
    Switch,
    weight_in_counts,
)
from study.transitions.one_hop.robustness import costs_of, draw_costs, robustness_set
from study.transitions.one_hop.table import OneHopTable
from study.transitions.point_cloud import point_cloud, window_distances

WEIGHT = 2.5e-4
FPS = 60.0


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


@dataclass(frozen=True)
class Crossing:
    """Where a blend joins two clips: their numbers, their frames at its start, and its own frames."""

    clips: tuple[int, int]
    frames: tuple[int, int]
    blend_frames: int


def crossings(table: OneHopTable, switch: Switch) -> tuple[Crossing, ...]:
    """The blends of the table's entry at the first trigger; one where the hop is the destination in its place."""
    entry = table.look_up(switch.source, switch.destination, switch.first_trigger)
    assert entry is not None  # the robustness set has only triggers from which a transition fits
    to = switch.alignment.offset_at(switch.first_trigger)
    first, second = entry_steps(table, entry, switch.destination, to)
    start = switch.first_trigger + first.stay
    then = start + first.blend_frames + second.stay
    leave = Crossing((switch.source, entry.hop), (start, start - first.offset), first.blend_frames)
    arrive = Crossing((entry.hop, switch.destination), (then - first.offset, then - to), second.blend_frames)
    return (leave,) if arrive.clips[0] == arrive.clips[1] and arrive.frames[0] == arrive.frames[1] else (leave, arrive)


def strain(problem: Problem, table: OneHopTable, switch: Switch) -> float:
    """What both blends of an entry cost, whichever table it is from, as `problem.distance` counts them."""
    total = 0.0
    for one in crossings(table, switch):
        prepared = {number: problem.distance.prepare(problem.clips[number], one.blend_frames) for number in one.clips}
        first, second = (prepared[number] for number in one.clips)
        rows, columns = (range(frame, frame + 1) for frame in one.frames)
        counts = problem.distance.counts(first, second, one.blend_frames, rows, columns)
        total += int(counts[0, 0]) * problem.distance.unit
    return total


def draw_path(clips: Sequence[Clip], table: OneHopTable, switch: Switch, path: Path) -> None:
    """Colour maps of the distances that a transition crosses, a cross where each blend starts (2019, Figure 5).

    The first map is of the direct transition, from the triggered frame on; then come the one-hop transition's, out of
    the source and into the destination. All have one scale: metres squared, the mean over points and a blend's frames.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    clouds, trigger = [point_cloud(clip) for clip in clips], switch.first_trigger
    there = trigger - switch.alignment.offset_at(trigger)
    direct = Crossing((switch.source, switch.destination), (trigger, there), table.blend_frames)
    shown = (direct, *crossings(table, switch))
    maps = [window_distances(*(clouds[number] for number in one.clips), one.blend_frames) for one in shown]
    widths = [distances.shape[1] for distances in maps]
    figure = Figure(figsize=(4.0 * len(shown) + 0.8, 4.0), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    highest = max(float(distances.max()) for distances in maps)
    panels = figure.subplots(1, len(shown), squeeze=False, width_ratios=widths)[0]
    for axes, one, distances, title in zip(panels, shown, maps, ("direct", "to the hop", "from the hop"), strict=False):
        fps = clips[0].fps
        rows, columns = (size / fps for size in distances.shape)
        extent = (0.0, columns, 0.0, rows)
        image = axes.imshow(
            distances, origin="lower", extent=extent, cmap="viridis", interpolation="nearest", vmin=0.0, vmax=highest
        )
        row, column = ((frame + 0.5) / fps for frame in one.frames)
        axes.plot(column, row, "x", color="#ff5050", markersize=9, markeredgewidth=2)
        axes.set_title(f"{title}: {distances[one.frames]:.2g} m²")
        axes.set_xlabel(f"{clips[one.clips[1]].name}, seconds")
        axes.set_ylabel(f"{clips[one.clips[0]].name}, seconds")
    figure.colorbar(image, ax=list(panels), label="distance (m²)")
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
    gains = [one.direct - one.total for one in costs]
    best = switches[int(np.argmax(gains))]
    draw_path(clips, build_table(replace(problem, switches=(best,))), best, folder / "one_hop_distances.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]), [Path(name) for name in sys.argv[2:]])
