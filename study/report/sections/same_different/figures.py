"""Figures of a same-different study: its result in, SVG text out.

Blue is the model, dark grey the data and what is as published.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from study.analysis.same_different.analyse import MotionThresholds, SameDifferent
from study.analysis.same_different.counts import SIDES, SIGNS, PercentDifferent, Side, Threshold
from study.report.drawing import (
    BLUE,
    FAINT,
    INK,
    RULE,
    SOFT,
    Picture,
    named_rows,
    new_figure,
    percent_axis,
    picture_of,
)
from study.report.words import readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_TICKS = 14
"""Labels of levels along an axis; those of staircases and QUEST+ are many."""


def _points(axes: Axes, rows: Sequence[PercentDifferent], size: float = 5.0) -> None:
    """Percentages with bars of one standard error, interpolated linearly as in 2004 Figure 6."""
    across = [row.difference_frames for row in rows]
    up = [row.percent for row in rows]
    errors = [row.standard_error or 0.0 for row in rows]
    axes.plot(across, up, color=FAINT, linewidth=1.0, linestyle=(0, (4, 2)), zorder=2)
    axes.errorbar(across, up, yerr=errors, fmt="o", color=INK, markersize=size, elinewidth=1.1, capsize=2.5, zorder=4)


def _level_axis(axes: Axes, level: float) -> None:
    percent_axis(axes)
    axes.axhline(100 * level, color=SOFT, linewidth=0.9, linestyle=(0, (1, 2)), zorder=1)
    axes.axvline(0, color=RULE, linewidth=0.9, zorder=0)


def _level_ticks(axes: Axes, levels: Sequence[float]) -> None:
    """The levels, outwards from k, as many as have room."""
    room = (max(levels, default=0) - min(levels, default=0)) / MOST_TICKS
    shown: list[float] = []
    for level in sorted(levels, key=abs):
        if all(abs(level - other) >= room for other in shown):
            shown.append(level)
    axes.set_xticks(shown, [f"{level:+g}".replace("-", "−") if level else "k" for level in shown])


def _model_threshold(axes: Axes, threshold: Threshold, level: float, label: bool) -> None:
    """A drop line at the threshold and, at its foot, the interval."""
    if threshold.frames is None:
        return
    sign = SIGNS[threshold.side]
    place = sign * threshold.frames
    axes.plot([place, place], [0, 100 * level], color=BLUE, linewidth=1.0, zorder=3)
    low, high = threshold.interval.low, threshold.interval.high
    if low is not None and high is not None:
        axes.plot([sign * low, sign * high], [0, 0], color=BLUE, linewidth=4, solid_capstyle="butt", zorder=3)
    if label:
        text = f"k {'+' if sign > 0 else '−'} {threshold.frames:.1f}"
        axes.annotate(
            text, (place, 0), xytext=(5 * sign, 7), textcoords="offset points", color=BLUE, fontsize=10,
            ha="left" if sign > 0 else "right", fontweight="bold",
        )  # fmt: skip


def same_different_figure(result: SameDifferent, name: str, mark: str) -> Picture:
    """Percent "different" by difference in blend length, with both readings of the threshold (2004 Figure 6)."""
    rows, found, fitted = result.percent_different, result.believed, result.mixed or result.model
    with new_figure(7.2, 3.9) as (figure, axes):
        _level_axis(axes, result.level)
        _points(axes, rows)
        _level_ticks(axes, [row.difference_frames for row in rows])
        if found and fitted:
            across, up = zip(*fitted.curve, strict=True)
            axes.plot(across, up, color=BLUE, linewidth=1.8, zorder=3)
            for threshold in found.jnd.values():
                _model_threshold(axes, threshold, result.level, label=True)
        axes.set_xlabel("difference in blend length from k, frames (shorter ← → longer)")
        axes.set_ylabel("answers “different”")
        _key(axes, found.whose if found else "")
        return picture_of(figure, name, "Percent “different” by difference in blend length", _spoken_levels(rows), mark)


def _key(axes: Axes, whose: str) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=FAINT, linestyle=(0, (4, 2)), marker="o", markerfacecolor=INK, markeredgecolor=INK,
               markersize=4.5, label="mean ± standard error over participants"),
    ]  # fmt: skip
    if whose:
        handles.append(Line2D([], [], color=BLUE, linewidth=1.8, label=f"{whose}, thresholds with interval"))
    axes.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=8.5, labelcolor=SOFT)


def _spoken_levels(rows: Sequence[PercentDifferent]) -> str:
    return "; ".join(f"{row.difference_frames:+g} frames: {row.percent:.0f}%" for row in rows)


def motions_figure(result: SameDifferent, name: str, mark: str) -> Picture:
    """The same curve for every motion, side by side."""
    motions = result.motions
    columns = min(len(motions), 3)
    lines = -(-len(motions) // columns)
    with new_figure(7.2, 2.5 * lines + 0.25, lines, columns, sharey=True, sharex=True, squeeze=False) as (figure, grid):
        for axes, motion in zip(grid.flat, motions, strict=False):
            _level_axis(axes, result.level)
            _points(axes, motion.percent_different, size=3.5)
            if motion.model:
                across, up = zip(*motion.model.curve, strict=True)
                axes.plot(across, up, color=BLUE, linewidth=1.5, zorder=3)
                for threshold in motion.model.jnd.values():
                    _model_threshold(axes, threshold, result.level, label=False)
            axes.set_title(readable(motion.motion))
        for axes in grid.flat[len(motions) :]:
            axes.set_axis_off()
        figure.supylabel("answers “different”", fontsize=9.5)
        for axes in grid[-1]:
            axes.set_xlabel("difference, frames")
        spoken = ". ".join(f"{readable(m.motion)}: {_spoken_levels(m.percent_different)}" for m in motions)
        return picture_of(figure, name, "Percent “different” for every motion", spoken, mark)


def thresholds_figure(result: SameDifferent, name: str, mark: str) -> Picture:
    """Thresholds with intervals: all motions and each one, linear interpolation and model, shorter and longer."""
    entries: list[tuple[str, SameDifferent | MotionThresholds]] = [("all motions", result)]
    entries += [(readable(motion.motion), motion) for motion in result.motions if len(result.motions) > 1]
    with new_figure(7.2, 0.62 * len(entries) + 1.15) as (figure, axes):
        axes.axvline(0, color=FAINT, linewidth=0.9)
        for row, (_, entry) in enumerate(entries):
            for side in SIDES:
                _bar(axes, entry.published[side], -row + 0.14, INK, "o")
                if side in (own := _own(entry)):
                    _bar(axes, own[side], -row - 0.14, BLUE, "s")
        named_rows(axes, [-row for row in range(len(entries))], [label for label, _ in entries])
        axes.set_ylim(-len(entries) + 0.5, 0.5)
        ticks = sorted({row.difference_frames for row in result.percent_different})
        if ticks:
            axes.set_xlim(min(*ticks, -1) * 1.02, max(*ticks, 1) * 1.02)
            _level_ticks(axes, ticks)
        axes.set_xlabel(f"{100 * result.level:.0f}% “different”, frames from k")
        _threshold_key(axes)
        return picture_of(figure, name, "Thresholds with their intervals", _spoken_thresholds(entries), mark)


def _own(entry: SameDifferent | MotionThresholds) -> Mapping[Side, Threshold]:
    """The thresholds to be believed: the headline's, and those of one motion by itself."""
    if isinstance(entry, SameDifferent):
        return entry.believed.jnd if entry.believed else {}
    return entry.model.jnd if entry.model else {}


def _bar(axes: Axes, threshold: Threshold, height: float, colour: str, marker: str) -> None:
    """A point with its interval, where it is closed; nothing where there is no threshold."""
    sign = SIGNS[threshold.side]
    low, high = threshold.interval.low, threshold.interval.high
    if threshold.frames is None:
        return
    if low is not None and high is not None:
        axes.plot([sign * low, sign * high], [height, height], color=colour, linewidth=1.6, solid_capstyle="butt")
    axes.plot([sign * threshold.frames], [height], marker=marker, color=colour, markersize=5)


def _threshold_key(axes: Axes) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=INK, marker="o", markersize=4.5, label="linear interpolation (as published)"),
        Line2D([], [], color=BLUE, marker="s", markersize=4.5, label="differencing model"),
    ]
    axes.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=8.5, labelcolor=SOFT)


def _spoken_thresholds(entries: Sequence[tuple[str, SameDifferent | MotionThresholds]]) -> str:
    parts = []
    for label, entry in entries:
        for side in SIDES:
            found = entry.published[side].frames
            parts.append(f"{label}, {side}: " + (f"{found:.1f} frames" if found is not None else "not found"))
    return "; ".join(parts)
