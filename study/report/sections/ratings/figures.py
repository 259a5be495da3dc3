"""Figures of a rating study: mean ratings in, SVG text out."""

from __future__ import annotations

from collections.abc import Sequence

from study.analysis.ratings.table import MethodRating
from study.report.drawing import BLUE, Picture, named_rows, new_figure, picture_of
from study.report.words import readable


def ratings_figure(rows: Sequence[MethodRating], name: str, mark: str, points: int) -> Picture:
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
        axes.set_xticks(range(0, points, 1 if points <= 11 else 10))
        axes.set_xlabel("mean rating")
        spoken = "; ".join(f"{label}: {row.mean:.2f}" for label, row in zip(labels, rows, strict=True))
        return picture_of(figure, name, "Mean ratings", spoken, mark)
