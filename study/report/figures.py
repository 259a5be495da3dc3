"""The report's figures: results of the analysis in, SVG text out.

Blue is the model or what is corrected, dark grey the data and what is as published; every figure says at its foot when
its answers are simulated or its motions synthetic.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from study.report.drawing import (
    BLUE,
    FAINT,
    INK,
    ORANGE,
    RULE,
    SOFT,
    TEAL,
    add_mark,
    new_figure,
    quiet_grid,
    style,
    to_svg,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Result = Mapping[str, Any]
SIGNS = {"shorter": -1.0, "longer": 1.0}


def _points(axes: Axes, rows: Sequence[Result], size: float = 5.0) -> None:
    """Percentages with bars of one standard error, interpolated linearly as in 2004 Figure 6."""
    across = [row["difference_frames"] for row in rows]
    up = [row["percent"] for row in rows]
    errors = [row["standard_error"] or 0.0 for row in rows]
    axes.plot(across, up, color=FAINT, linewidth=1.0, linestyle=(0, (4, 2)), zorder=2)
    axes.errorbar(across, up, yerr=errors, fmt="o", color=INK, markersize=size, elinewidth=1.1, capsize=2.5, zorder=4)


def _percent_axis(axes: Axes, level: float) -> None:
    axes.set_ylim(-3, 103)
    axes.set_yticks([0, 25, 50, 75, 100], ["0", "25", "50", "75", "100%"])
    quiet_grid(axes)
    axes.axhline(100 * level, color=SOFT, linewidth=0.9, linestyle=(0, (1, 2)), zorder=1)
    axes.axvline(0, color=RULE, linewidth=0.9, zorder=0)


def _level_ticks(axes: Axes, rows: Sequence[Result]) -> None:
    levels = [row["difference_frames"] for row in rows]
    axes.set_xticks(levels, [f"{level:+.0f}".replace("-", "−") if level else "k" for level in levels])


def _model_threshold(axes: Axes, threshold: Result, level: float, label: bool) -> None:
    """A drop line at the threshold and, at its foot, the interval."""
    if threshold["frames"] is None:
        return
    sign = SIGNS[threshold["side"]]
    place = sign * threshold["frames"]
    axes.plot([place, place], [0, 100 * level], color=BLUE, linewidth=1.0, zorder=3)
    low, high = threshold["interval"]["low"], threshold["interval"]["high"]
    if low is not None and high is not None:
        axes.plot([sign * low, sign * high], [0, 0], color=BLUE, linewidth=4, solid_capstyle="butt", zorder=3)
    if label:
        text = f"k {'+' if sign > 0 else '−'} {threshold['frames']:.1f}"
        axes.annotate(
            text, (place, 0), xytext=(5 * sign, 7), textcoords="offset points", color=BLUE, fontsize=10,
            ha="left" if sign > 0 else "right", fontweight="bold",
        )  # fmt: skip


def same_different_figure(result: Result, name: str, mark: str) -> str:
    """Percent "different" by difference in blend length, with both readings of the threshold (2004 Figure 6)."""
    rows, model = result["percent_different"], result["model"]
    with style():
        figure, axes = new_figure(7.2, 3.9)
        _percent_axis(axes, result["level"])
        _points(axes, rows)
        _level_ticks(axes, rows)
        if model:
            across, up = zip(*model["curve"], strict=True)
            axes.plot(across, up, color=BLUE, linewidth=1.8, zorder=3)
            for threshold in model["jnd"].values():
                _model_threshold(axes, threshold, result["level"], label=True)
        axes.set_xlabel("difference in blend length from k, frames (shorter ← → longer)")
        axes.set_ylabel("answers “different”")
        _key(axes, bool(model))
        add_mark(figure, mark)
        return to_svg(figure, name, "Percent “different” by difference in blend length", _spoken_levels(rows))


def _key(axes: Axes, with_model: bool) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=FAINT, linestyle=(0, (4, 2)), marker="o", markerfacecolor=INK, markeredgecolor=INK,
               markersize=4.5, label="mean ± standard error over participants"),
    ]  # fmt: skip
    if with_model:
        handles.append(Line2D([], [], color=BLUE, linewidth=1.8, label="differencing model, thresholds with interval"))
    axes.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=8.5, labelcolor=SOFT)


def _spoken_levels(rows: Sequence[Result]) -> str:
    return "; ".join(f"{row['difference_frames']:+.0f} frames: {row['percent']:.0f}%" for row in rows)


def motions_figure(result: Result, name: str, mark: str) -> str:
    """The same curve for every motion, side by side."""
    motions = result["motions"]
    columns = min(len(motions), 3)
    lines = -(-len(motions) // columns)
    with style():
        figure, grid = new_figure(7.2, 2.5 * lines + 0.25, lines, columns, sharey=True, sharex=True, squeeze=False)
        for axes, motion in zip(grid.flat, motions, strict=False):
            _percent_axis(axes, result["level"])
            _points(axes, motion["percent_different"], size=3.5)
            if motion["model"]:
                across, up = zip(*motion["model"]["curve"], strict=True)
                axes.plot(across, up, color=BLUE, linewidth=1.5, zorder=3)
                for threshold in motion["model"]["jnd"].values():
                    _model_threshold(axes, threshold, result["level"], label=False)
            axes.set_title(_readable(motion["motion"]))
        for axes in grid.flat[len(motions) :]:
            axes.set_axis_off()
        figure.supylabel("answers “different”", fontsize=9.5)
        for axes in grid[-1]:
            axes.set_xlabel("difference, frames")
        add_mark(figure, mark)
        spoken = ". ".join(f"{_readable(m['motion'])}: {_spoken_levels(m['percent_different'])}" for m in motions)
        return to_svg(figure, name, "Percent “different” for every motion", spoken)


def _readable(name: str) -> str:
    return name.replace("_", " ")


def thresholds_figure(result: Result, name: str, mark: str, known: Mapping[str, float] | None = None) -> str:
    """Thresholds with intervals: all motions and each one, linear interpolation and model, shorter and longer."""
    entries: list[tuple[str, Result]] = [("all motions", result)]
    entries += [(_readable(motion["motion"]), motion) for motion in result["motions"] if len(result["motions"]) > 1]
    with style():
        figure, axes = new_figure(7.2, 0.62 * len(entries) + 1.15)
        axes.axvline(0, color=FAINT, linewidth=0.9)
        for row, (_, entry) in enumerate(entries):
            for side in SIGNS:
                _bar(axes, entry["published"][side], -row + 0.14, INK, "o")
                if entry["model"] and side in entry["model"]["jnd"]:
                    _bar(axes, entry["model"]["jnd"][side], -row - 0.14, BLUE, "s")
        for side, place in (known or {}).items():
            axes.axvline(SIGNS[side] * place, color=ORANGE, linewidth=1.0, linestyle=(0, (2, 2)), zorder=0)
        axes.set_yticks([-row for row in range(len(entries))], [label for label, _ in entries])
        axes.tick_params(axis="y", labelcolor=INK)
        axes.set_ylim(-len(entries) + 0.5, 0.5)
        axes.spines["left"].set_visible(False)
        quiet_grid(axes, "x")
        ticks = sorted({row["difference_frames"] for row in result["percent_different"]})
        if ticks:
            axes.set_xlim(min(*ticks, -1) * 1.02, max(*ticks, 1) * 1.02)
            axes.set_xticks(ticks, [f"{tick:+.0f}".replace("-", "−") if tick else "k" for tick in ticks])
        axes.set_xlabel(f"{100 * result['level']:.0f}% “different”, frames from k")
        _threshold_key(axes, bool(known))
        add_mark(figure, mark)
        return to_svg(figure, name, "Thresholds with their intervals", _spoken_thresholds(entries))


def _bar(axes: Axes, threshold: Result, height: float, colour: str, marker: str) -> None:
    """A point with its interval, where it is closed; nothing where there is no threshold."""
    sign = SIGNS[threshold["side"]]
    low, high = threshold["interval"]["low"], threshold["interval"]["high"]
    if threshold["frames"] is None:
        return
    if low is not None and high is not None:
        axes.plot([sign * low, sign * high], [height, height], color=colour, linewidth=1.6, solid_capstyle="butt")
    axes.plot([sign * threshold["frames"]], [height], marker=marker, color=colour, markersize=5)


def _threshold_key(axes: Axes, known: bool) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=INK, marker="o", markersize=4.5, label="linear interpolation (as published)"),
        Line2D([], [], color=BLUE, marker="s", markersize=4.5, label="differencing model"),
    ]
    if known:
        handles.append(
            Line2D([], [], color=ORANGE, linestyle=(0, (2, 2)), label="true values of the simulated observers")
        )
    axes.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=8.5, labelcolor=SOFT)


def _spoken_thresholds(entries: Sequence[tuple[str, Result]]) -> str:
    parts = []
    for label, entry in entries:
        for side in SIGNS:
            found = entry["published"][side]["frames"]
            parts.append(f"{label}, {side}: " + (f"{found:.1f} frames" if found is not None else "not found"))
    return "; ".join(parts)


def preference_figure(comparison: Result, name: str, mark: str) -> str:
    """Percent favouring the first method: every motion with Wilson's interval, and all together over participants."""
    motions, people, pooled = comparison["motions"], comparison["participants"], comparison["published"]
    labels = [_readable(row["motion"]) for row in motions]
    with style():
        figure, axes = new_figure(7.2, 0.34 * (len(motions) + 3) + 0.9)
        axes.axvline(50, color=SOFT, linewidth=0.9, linestyle=(0, (1, 2)))
        for row, motion in enumerate(motions):
            if motion["percent"] is not None:
                axes.plot([motion["low"], motion["high"]], [-row, -row], color=INK, linewidth=1.4)
                axes.plot([motion["percent"]], [-row], "o", color=INK, markersize=4.5)
            _at_the_right(axes, -row, f"{motion['favouring']} / {motion['answers']}")
        foot = -len(motions) - 0.3
        if pooled["percent"] is not None:
            ends = [100 * pooled["interval"][end] for end in ("low", "high")]
            axes.plot(ends, [foot, foot], color=INK, linewidth=2.4)
            axes.plot([pooled["percent"]], [foot], "o", color=INK, markersize=6)
        _at_the_right(axes, foot, f"{pooled['favouring']} / {pooled['answers']}")
        if people["low"] is not None:
            axes.plot([people["low"], people["high"]], [foot - 1, foot - 1], color=BLUE, linewidth=2.4)
        axes.plot([people["mean_percent"]], [foot - 1], "s", color=BLUE, markersize=6)
        _at_the_right(axes, foot - 1, f"{people['mean_percent']:.1f}%", BLUE)
        axes.axhline(-len(motions) + 0.35, color=RULE, linewidth=0.9)
        places = [*(-row for row in range(len(motions))), foot, foot - 1]
        axes.set_yticks(places, [*labels, "all answers", "all, over participants"])
        axes.tick_params(axis="y", labelcolor=INK)
        axes.spines["left"].set_visible(False)
        quiet_grid(axes, "x")
        axes.set_xlim(-1, 101)
        axes.set_xticks([0, 25, 50, 75, 100], ["0", "25", "50", "75", "100%"])
        a, b = _readable(comparison["method_a"]), _readable(comparison["method_b"])
        axes.set_xlabel(f"responses that favoured {a} over {b}")
        add_mark(figure, mark)
        known = [row for row in motions if row["percent"] is not None]
        spoken = "; ".join(f"{_readable(row['motion'])}: {row['percent']:.0f}%" for row in known)
        return to_svg(figure, name, f"Percent favouring {a} over {b}", spoken)


def _at_the_right(axes: Axes, height: float, text: str, colour: str = INK) -> None:
    """A number in a column beside the axes."""
    axes.annotate(text, (1.0, height), xycoords=("axes fraction", "data"), xytext=(52, 0), textcoords="offset points",
                  ha="right", va="center", fontsize=8.5, color=colour)  # fmt: skip


def response_figure(answers: pd.DataFrame, name: str, mark: str) -> str | None:
    """Response times: how they are distributed, and how they change over the session; None without times."""
    import numpy as np

    timed = answers[answers["response_s"].notna()] if "response_s" in answers else answers.iloc[:0]
    if timed.empty:
        return None
    times = timed["response_s"].to_numpy(dtype=np.float64)
    with style():
        figure, (left, right) = new_figure(7.2, 2.5, 1, 2, width_ratios=(1, 1.25))
        left.hist(times, bins=np.linspace(0, max(float(times.max()), 1.0), 31).tolist(), color=FAINT, edgecolor="white")
        middle = float(np.median(times))
        left.axvline(middle, color=BLUE, linewidth=1.6)
        left.annotate(f"median {middle:.2f} s", (middle, 0.98), xycoords=("data", "axes fraction"), xytext=(5, 0),
                      textcoords="offset points", color=BLUE, fontsize=8.5, va="top")  # fmt: skip
        left.set_xlabel("response time, s")
        left.set_title("answers")
        quiet_grid(left)
        if "trial" in timed:
            medians = timed.groupby("trial")["response_s"].quantile(np.array([0.25, 0.5, 0.75])).unstack()
            trials = medians.index.to_numpy(dtype=np.float64)
            right.fill_between(trials, medians[0.25], medians[0.75], color=RULE, linewidth=0)
            right.plot(trials, medians[0.5], color=BLUE, linewidth=1.4)
            right.set_xlabel("trial in the session")
            right.set_title("response time, s: median and middle half")
            right.set_ylim(bottom=0)
            quiet_grid(right)
        else:
            right.set_axis_off()
        add_mark(figure, mark)
        spoken = f"median {middle:.2f} s, from {times.min():.2f} to {times.max():.2f} s"
        return to_svg(figure, name, "Response times", spoken)


def ratings_figure(rows: Sequence[Result], name: str, mark: str, points: int) -> str:
    """Mean ratings with intervals over participants, for every question and method."""
    with style():
        figure, axes = new_figure(7.2, 0.36 * len(rows) + 1.0)
        axes.set_ylim(0.5 - len(rows), 0.5)
        for place, row in enumerate(rows):
            if row["low"] is not None:
                axes.plot([row["low"], row["high"]], [-place, -place], color=BLUE, linewidth=2)
            axes.plot([row["mean"]], [-place], "s", color=BLUE, markersize=5.5)
        labels = [_readable(": ".join(filter(None, (row["item"], row["method"])))) for row in rows]
        axes.set_yticks([-place for place in range(len(rows))], labels)
        axes.tick_params(axis="y", labelcolor=INK)
        axes.spines["left"].set_visible(False)
        quiet_grid(axes, "x")
        axes.set_xlim(-0.1, points - 0.9)
        axes.set_xticks(range(points))
        axes.set_xlabel("mean rating")
        add_mark(figure, mark)
        spoken = "; ".join(f"{label}: {row['mean']:.2f}" for label, row in zip(labels, rows, strict=True))
        return to_svg(figure, name, "Mean ratings", spoken)


def cells_figure(cells: Sequence[Result], name: str, mark: str, points: int) -> str:
    """Mean ratings by method and by which was seen first: a panel a question, a line an order (2003 section 4.2)."""
    items = list(dict.fromkeys(row["item"] for row in cells))
    methods = list(dict.fromkeys(row["method"] for row in cells))
    orders = list(dict.fromkeys(row["order"] for row in cells))
    columns = 3  # also for fewer: panels keep their size
    lines = -(-len(items) // columns)
    with style():
        figure, grid = new_figure(7.2, 2.3 * lines + 0.5, lines, columns, sharex=True, sharey=True, squeeze=False)
        for axes, item in zip(grid.flat, items, strict=False):
            for place, order in enumerate(orders):
                own = [row for row in cells if row["item"] == item and row["order"] == order]
                _cell_line(axes, own, methods, place, len(orders))
            axes.set_title(_readable(item))
            axes.set_xticks(range(len(methods)), [_readable(method) for method in methods])
            axes.set_xlim(-0.4, len(methods) - 0.3)
            axes.set_ylim(-0.1, points - 0.9)
            axes.set_yticks(range(points))
            quiet_grid(axes)
        for axes in grid.flat[len(items) :]:
            axes.set_axis_off()
        _cells_key(figure, orders)
        add_mark(figure, mark)
        spoken = "; ".join(
            _readable(f"{row['item']} {row['method']}, {row['order']} seen first: {row['mean']:.2f}") for row in cells
        )
        return to_svg(figure, name, "Mean ratings by method and order of presentation", spoken)


def _order_style(place: int) -> dict[str, Any]:
    """Colour and marker together, so that neither is needed alone."""
    return {"color": (BLUE, ORANGE, TEAL)[place % 3], "marker": "so^"[place % 3]}


def _cell_line(axes: Axes, own: Sequence[Result], methods: Sequence[str], place: int, orders: int) -> None:
    """One order's means, with their intervals, a little to the side of the other's."""
    across = [methods.index(row["method"]) + 0.08 * (place - (orders - 1) / 2) for row in own]
    look = _order_style(place)
    axes.plot(across, [row["mean"] for row in own], linewidth=1.2, markersize=4.5, **look)
    for at, row in zip(across, own, strict=True):
        if row["low"] is not None:
            axes.plot([at, at], [row["low"], row["high"]], color=look["color"], linewidth=1.2)


def _cells_key(figure: Figure, orders: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], markersize=4.5, label=f"{_readable(order)} seen first", **_order_style(place))
        for place, order in enumerate(orders)
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(orders), fontsize=8.5, labelcolor=SOFT)
