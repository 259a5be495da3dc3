"""The figure of a preference study: a comparison in, SVG text out.

Blue is what is corrected, dark grey the data and what is as published.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from study.analysis.crossed import OVER_BOTH
from study.analysis.preference.analyse import Comparison
from study.analysis.preference.bradley_terry import BradleyTerry
from study.report.drawing import (
    BLUE,
    INK,
    RULE,
    SOFT,
    Picture,
    named_rows,
    new_figure,
    picture_of,
)
from study.report.words import readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def preference_figure(comparison: Comparison, name: str, mark: str) -> Picture:
    """Percent favouring the first method: every motion with Wilson's interval, and all together by the default test."""
    motions, found, pooled = comparison.motions, comparison.default, comparison.published
    labels = [readable(row.motion) for row in motions]
    with new_figure(7.2, 0.34 * (len(motions) + 3) + 0.9) as (figure, axes):
        axes.axvline(50, color=SOFT, linewidth=0.9, linestyle=(0, (1, 2)))
        for row, motion in enumerate(motions):
            if motion.percent is not None:
                axes.plot([motion.low, motion.high], [-row, -row], color=INK, linewidth=1.4)
                axes.plot([motion.percent], [-row], "o", color=INK, markersize=4.5)
            _at_the_right(axes, -row, f"{motion.favouring} / {motion.answers}")
        foot = -len(motions) - 0.3
        if pooled.percent is not None:
            ends = [100 * (end or 0.0) for end in (pooled.interval.low, pooled.interval.high)]
            axes.plot(ends, [foot, foot], color=INK, linewidth=2.4)
            axes.plot([pooled.percent], [foot], "o", color=INK, markersize=6)
        _at_the_right(axes, foot, f"{pooled.favouring} / {pooled.answers}")
        if found.low is not None:
            axes.plot([found.low, found.high], [foot - 1, foot - 1], color=BLUE, linewidth=2.4)
        if found.percent is not None:
            axes.plot([found.percent], [foot - 1], "s", color=BLUE, markersize=6)
            _at_the_right(axes, foot - 1, f"{found.percent:.1f}%", BLUE)
        axes.axhline(-len(motions) + 0.35, color=RULE, linewidth=0.9)
        places = [*(-row for row in range(len(motions))), foot, foot - 1]
        over = "all, over participants" + (" and motions" if found.test == OVER_BOTH else "")
        named_rows(axes, places, [*labels, "all answers", over])
        axes.set_xlim(-1, 101)
        axes.set_xticks([0, 25, 50, 75, 100], ["0", "25", "50", "75", "100%"])
        a, b = readable(comparison.method_a), readable(comparison.method_b)
        axes.set_xlabel(f"responses that favoured {a} over {b}")
        known = [row for row in motions if row.percent is not None]
        spoken = "; ".join(f"{readable(row.motion)}: {row.percent:.0f}%" for row in known)
        return picture_of(figure, name, f"Percent favouring {a} over {b}", spoken, mark)


def strengths_figure(found: BradleyTerry, name: str, mark: str) -> Picture:
    """Strengths of methods with their intervals, the strongest at the top."""
    rows = [row for row in found.strengths if row.value is not None]
    with new_figure(7.2, 0.34 * len(rows) + 1.1) as (figure, axes):
        axes.axvline(0, color=SOFT, linewidth=0.9, linestyle=(0, (1, 2)))
        for place, row in enumerate(rows):
            if row.standard_error:
                axes.plot([row.interval.low, row.interval.high], [-place, -place], color=BLUE, linewidth=2.0)
            axes.plot([row.value], [-place], "o", color=INK if row.method == found.reference else BLUE, markersize=5)
            _at_the_right(axes, -place, f"{row.value:+.2f}")
        named_rows(axes, [-place for place in range(len(rows))], [readable(row.method) for row in rows])
        axes.set_xlabel(f"strength in logits beside {readable(found.reference)}")
        spoken = "; ".join(f"{readable(row.method)}: {row.value:+.2f}" for row in rows)
        return picture_of(figure, name, "Strengths of the methods", spoken, mark)


def _at_the_right(axes: Axes, height: float, text: str, colour: str = INK) -> None:
    """A number in a column beside the axes."""
    axes.annotate(text, (1.0, height), xycoords=("axes fraction", "data"), xytext=(52, 0), textcoords="offset points",
                  ha="right", va="center", fontsize=8.5, color=colour)  # fmt: skip
