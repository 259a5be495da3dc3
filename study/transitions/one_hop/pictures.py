"""Pictures of distances and costs: Koyama & Goto 2019, Figures 5 and 10. In: numbers. Out: PNG files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.files import whole_file
from study.transitions.one_hop.robustness import Costs

# After Okabe and Ito 2008: told apart by people with any colour vision.
_FIRST, _SECOND, _WAITING, _DIRECT = "#0062a8", "#cc6200", "#bbbbbb", "#444444"


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
