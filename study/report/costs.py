"""Pictures of what transitions cost: the matrix over frames, and the curve over blend lengths.

Costs come in; a PNG file goes out. Wang & Bodenheimer 2003, Figures 1 to 3 (darker is cheaper); 2004, Figures 3 and 5,
and the matrix over both lengths of section 3.1.4.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.arrays import AnyFloat
from study.counting import counted
from study.files import whole_file
from study.report.drawing import BLUE, FAINT, INK, ORANGE, SOFT, TEAL, new_figure, quiet_grid

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# Limbs of 2004 Figure 5: a colour a part, a full line for the left side and a dashed one for the right.
_PART_COLOURS = {"hip": BLUE, "knee": TEAL, "shoulder": ORANGE, "elbow": "#7b3fa0"}


def cost_picture(
    costs: AnyFloat,
    out: Path,
    *,
    least: tuple[int, int],
    span: tuple[int, int],
    names: tuple[str, str],
    label: str,
    first: int = 0,
) -> None:
    """A cost matrix as a picture: black is the least cost, white the greatest, in proportion between (2003 Figure 1).

    Parameters
    ----------
    costs : (rows, columns)
        Rows are the source's, columns the destination's; for large matrices reduced, over `span` frames all the same.
    out
        A `.png` file.
    least
        Row and column of the least cost, in frames; it is ringed.
    span
        Frames (or lengths) that rows and columns stand for.
    names
        What rows and columns are, for the axes.
    label
        What the cost is, with its unit, for the scale beside the picture.
    first
        What the first row and column count as.
    """
    width, height = (6.2 * min(1.0, 1.4 * span[one] / span[other]) for one, other in ((1, 0), (0, 1)))
    with new_figure(max(width, 2.5) + 1.0, height) as (figure, axes):
        extent = (first - 0.5, first + span[1] - 0.5, first + span[0] - 0.5, first - 0.5)
        shown = axes.imshow(costs, cmap="gray", extent=extent, interpolation="nearest", aspect="equal")
        axes.plot(
            least[1], least[0], "o", markersize=9, markerfacecolor="none", markeredgecolor=ORANGE, markeredgewidth=1.6
        )
        axes.set_xlabel(names[1])
        axes.set_ylabel(names[0])
        axes.set_title(f"least at {least[0]}, {least[1]}", color=ORANGE)
        scale = figure.colorbar(shown, ax=axes, shrink=0.7, pad=0.02)
        scale.set_label(label)
        scale.outline.set_visible(False)
        _save(figure, out)


def curve_picture(
    lengths: NDArray[np.integer],
    costs: AnyFloat,
    out: Path,
    *,
    chosen: int,
    fps: float,
    joints: Mapping[str, AnyFloat] | None = None,
    frames: tuple[AnyFloat, int] | None = None,
    words: str = "",
) -> None:
    """The cost over blend lengths (2004 Figure 3), of single joints (Figure 5), and frame by frame (Figure 2).

    Parameters
    ----------
    lengths, costs : (lengths,)
        Frames, and the cost of each.
    out
        A `.png` file.
    chosen
        The length that was chosen, frames.
    fps
        Frames per second, for seconds along the top.
    joints
        The cost by length of each joint, unweighted, by role.
    frames
        The difference of each pair of corresponding frames in the chosen blend, and the source frame of the first.
    words
        What transition it is.
    """
    panels = 1 + (joints is not None) + (frames is not None)
    with new_figure(8.6, 0.6 + 2.3 * panels, panels) as (figure, drawn):
        all_axes: list[Any] = list(np.atleast_1d(drawn))
        axes = all_axes.pop(0)
        axes.plot(lengths, costs, color=INK, linewidth=1.6)
        at = int(np.flatnonzero(np.asarray(lengths) == chosen)[0])
        axes.plot(chosen, costs[at], "o", color=ORANGE, markersize=7, clip_on=False, zorder=5)
        axes.set_ylabel("cost")
        axes.set_title(f"{words}: {counted(chosen, 'frame')}, {chosen / fps:.2f} s", color=ORANGE)
        seconds = axes.secondary_xaxis("top", functions=(lambda x: x / fps, lambda x: x * fps))
        seconds.set_xlabel("blend length, seconds")
        _finish_length_axis(axes)
        if joints is not None:
            _draw_joints(all_axes.pop(0), lengths, joints, chosen)
        if frames is not None:
            axes = all_axes.pop(0)
            differences, first = frames
            axes.bar(first + np.arange(len(differences)), differences, color=SOFT, width=0.8)
            axes.axhline(float(np.mean(differences)), color=ORANGE, linewidth=1.2)
            axes.set_xlabel("source frame in the blend; the line is the mean, the cost")
            axes.set_ylabel("difference")
            quiet_grid(axes)
        _save(figure, out)


def _draw_joints(axes: Any, lengths: NDArray[np.integer], joints: Mapping[str, AnyFloat], chosen: int) -> None:
    for role, own in joints.items():
        part, _, side = role.partition(".")
        axes.plot(
            lengths,
            own,
            color=_PART_COLOURS.get(part, FAINT),
            linestyle="--" if side == "R" else "-",
            linewidth=1.3,
            label=f"{part} { ({'L': 'left', 'R': 'right'}.get(side, '')) }".strip(),
        )
    axes.axvline(chosen, color=ORANGE, linewidth=0.9)
    axes.set_ylabel("cost of a joint, unweighted")
    axes.legend(ncols=2, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    _finish_length_axis(axes)


def _finish_length_axis(axes: Any) -> None:
    axes.set_xlabel("blend length, frames")
    axes.set_ylim(bottom=0)
    quiet_grid(axes)


class Reducer:
    """A matrix handed over block by block, made small enough for a picture: the least of each square of entries."""

    def __init__(self, shape: tuple[int, int], most: int = 1500) -> None:
        self.step = max(1, -(-max(shape) // most))
        self.small = np.full((-(-shape[0] // self.step), -(-shape[1] // self.step)), np.inf, dtype=np.float32)

    def add(self, rows: range, block: AnyFloat) -> None:
        """Take a block of rows into account."""
        across = np.minimum.reduceat(block, np.arange(0, block.shape[1], self.step), axis=1)
        groups, starts = np.unique(np.arange(rows.start, rows.stop) // self.step, return_index=True)
        down = np.minimum.reduceat(across, starts, axis=0)
        self.small[groups] = np.minimum(self.small[groups], down)


def _save(figure: Figure, out: Path) -> None:
    with whole_file(out) as unfinished:
        figure.savefig(unfinished, format="png", dpi=150, facecolor="white")
