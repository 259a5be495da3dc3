"""Figures of a rating study: mean ratings in, SVG text out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from study.analysis.ratings.table import CellRating, MethodRating
from study.report.drawing import (
    BLUE,
    ORANGE,
    SOFT,
    TEAL,
    named_rows,
    new_figure,
    quiet_grid,
    to_svg,
)
from study.report.words import readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def ratings_figure(rows: Sequence[MethodRating], name: str, mark: str, points: int) -> str:
    """Mean ratings with intervals over participants, for every question and method."""
    with new_figure(7.2, 0.36 * len(rows) + 1.0) as (figure, axes):
        axes.set_ylim(0.5 - len(rows), 0.5)
        for place, row in enumerate(rows):
            if row.low is not None:
                axes.plot([row.low, row.high], [-place, -place], color=BLUE, linewidth=2)
            axes.plot([row.mean], [-place], "s", color=BLUE, markersize=5.5)
        labels = [readable(": ".join(filter(None, (row.item, row.method)))) for row in rows]
        named_rows(axes, [-place for place in range(len(rows))], labels)
        axes.set_xlim(-0.1, points - 0.9)
        axes.set_xticks(range(points))
        axes.set_xlabel("mean rating")
        spoken = "; ".join(f"{label}: {row.mean:.2f}" for label, row in zip(labels, rows, strict=True))
        return to_svg(figure, name, "Mean ratings", spoken, mark)


def cells_figure(cells: Sequence[CellRating], name: str, mark: str, points: int) -> str:
    """Mean ratings by method and by which was seen first: a panel a question, a line an order (2003 section 4.2)."""
    items = list(dict.fromkeys(row.item for row in cells))
    methods = list(dict.fromkeys(row.method for row in cells))
    orders = list(dict.fromkeys(row.order for row in cells))
    columns = 3  # also for fewer: panels keep their size
    lines = -(-len(items) // columns)
    with new_figure(7.2, 2.3 * lines + 0.5, lines, columns, sharex=True, sharey=True, squeeze=False) as (figure, grid):
        for axes, item in zip(grid.flat, items, strict=False):
            for place, order in enumerate(orders):
                own = [row for row in cells if row.item == item and row.order == order]
                _cell_line(axes, own, methods, place, len(orders))
            axes.set_title(readable(item))
            axes.set_xticks(range(len(methods)), [readable(method) for method in methods])
            axes.set_xlim(-0.4, len(methods) - 0.3)
            axes.set_ylim(-0.1, points - 0.9)
            axes.set_yticks(range(points))
            quiet_grid(axes)
        for axes in grid.flat[len(items) :]:
            axes.set_axis_off()
        _cells_key(figure, orders)
        spoken = "; ".join(
            readable(f"{row.item} {row.method}, {row.order} seen first: {row.mean:.2f}") for row in cells
        )
        return to_svg(figure, name, "Mean ratings by method and order of presentation", spoken, mark)


def _order_style(place: int) -> dict[str, Any]:
    """Colour and marker together, so that neither is needed alone."""
    return {"color": (BLUE, ORANGE, TEAL)[place % 3], "marker": "so^"[place % 3]}


def _cell_line(axes: Axes, own: Sequence[CellRating], methods: Sequence[str], place: int, orders: int) -> None:
    """One order's means, with their intervals, a little to the side of the other's."""
    across = [methods.index(row.method) + 0.08 * (place - (orders - 1) / 2) for row in own]
    look = _order_style(place)
    axes.plot(across, [row.mean or 0.0 for row in own], linewidth=1.2, markersize=4.5, **look)
    for at, row in zip(across, own, strict=True):
        if row.low is not None and row.high is not None:
            axes.plot([at, at], [row.low, row.high], color=look["color"], linewidth=1.2)


def _cells_key(figure: Figure, orders: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], markersize=4.5, label=f"{readable(order)} seen first", **_order_style(place))
        for place, order in enumerate(orders)
    ]
    figure.legend(handles=handles, loc="outside upper center", ncols=len(orders), fontsize=8.5, labelcolor=SOFT)
