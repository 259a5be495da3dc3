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
