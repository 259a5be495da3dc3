"""Answers on a scale that has a middle, drawn as diverging stacked bars: `pair_ratings` in, SVG text out.

A bar a question, centred on the middle of the scale: answers that favour the reference to the left, those that favour
the comparison to the right. Beside it the mean score with its interval over participants.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from study.analysis.ratings.pairs import PairQuestion, ScoreTest
from study.report.drawing import BLUE, INK, ORANGE, RULE, SOFT, Picture, new_figure, picture_of, quiet_grid
from study.report.words import readable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEAST_LABELLED = 5.0
"""A part of a bar that is narrower has no room for its count. [percent]"""


def likert_figure(
    questions: Sequence[PairQuestion], name: str, mark: str, ends: Mapping[str, tuple[str, str]]
) -> Picture:
    """Return the figure.

    Parameters
    ----------
    questions
        From `pair_ratings`, for one pair of methods.
    name
        Unique in the page.
    mark
        What the figure says about its data.
    ends
        Words at the lowest and highest point of the scale, by question.
    """
    points = len(questions[0].distribution)
    places = [-float(row) for row in range(len(questions))]
    with new_figure(7.2, 0.62 * len(questions) + 1.35, 1, 2, width_ratios=(1.9, 1), sharey=True) as (
        figure,
        (bars, means),
    ):
        widest = max(_bar(bars, question, at, points) for question, at in zip(questions, places, strict=True))
        for question, at in zip(questions, places, strict=True):
            _mean(means, question.participants, at)
        bars.set_yticks(places, [_label(question.item, ends) for question in questions])
        bars.set_ylim(places[-1] - 0.6, 0.6)
        _percent_axis(bars, widest, questions[0])
        means.set_xlim(-0.15, points - 0.85)
        means.set_xticks(range(points))
        means.axvline(questions[0].middle, color=SOFT, linewidth=0.9, linestyle=(0, (1, 2)))
        means.set_xlabel("mean score")
        quiet_grid(means, "x")
        for axes in (bars, means):
            axes.tick_params(axis="y", labelcolor=INK)
            axes.spines["left"].set_visible(False)
        figure.legend(loc="outside upper center", ncols=points, fontsize=8.5, labelcolor=SOFT, handlelength=1.0,
                      handles=_keys(points), title="points of the scale", title_fontsize=8.5)  # fmt: skip
        return picture_of(figure, name, "Answers at each point of the scale, and mean scores", _spoken(questions), mark)


def shades(points: int) -> list[str]:
    """A colour for each point: orange below the middle, blue above, the deeper the further away; grey in the middle."""
    from matplotlib.colors import to_hex, to_rgb

    found = []
    for point in range(points):
        away = 2 * point / (points - 1) - 1
        red, green, blue = to_rgb(BLUE if away > 0 else ORANGE)
        # The nearest to the middle keeps a colour of its own beside the grey.
        part = 0.0 if away == 0 else 0.2 + 0.8 * abs(away) ** 1.5
        found.append(
            RULE if away == 0 else to_hex((1 - part * (1 - red), 1 - part * (1 - green), 1 - part * (1 - blue)))
        )
    return found


def _bar(axes: Axes, question: PairQuestion, at: float, points: int) -> float:
    """One question's bar; how far it reaches from the middle, percent."""
    counts = list(question.distribution.values())
    shares = [100 * count / question.answers for count in counts]
    middle = (points - 1) / 2
    left = -sum(share for point, share in enumerate(shares) if point < middle)
    left -= shares[int(middle)] / 2 if middle.is_integer() else 0.0
    reach = float(max(-left, left + 100))
    for point, (count, share, colour) in enumerate(zip(counts, shares, shades(points), strict=True)):
        axes.barh(at, share, 0.5, left=left, color=colour, edgecolor="white", linewidth=0.8)
        if share >= LEAST_LABELLED:
            ink = "white" if abs(point - middle) > 0.75 * middle else INK
            axes.text(left + share / 2, at, str(count), ha="center", va="center", fontsize=8.5, color=ink)
        left += share
    return reach


def _percent_axis(axes: Axes, widest: float, question: PairQuestion) -> None:
    """Percentages to both sides of the middle, and which side favours whom."""
    edge = min(100, 25 * -(-int(widest + 0.999) // 25))
    steps = range(-edge, edge + 1, 25 if edge <= 75 else 50)
    axes.set_xlim(-edge - 3, edge + 3)
    axes.set_xticks(list(steps), [f"{abs(step)}{'%' if step == steps[-1] else ''}" for step in steps])
    axes.axvline(0, color=SOFT, linewidth=0.9, linestyle=(0, (1, 2)), zorder=0)
    axes.set_xlabel(f"← {readable(question.method_a)} · answers for · {readable(question.method_b)} →")


def _mean(axes: Axes, found: ScoreTest, at: float) -> None:
    mean = found.mean or 0.0
    if found.low is not None and found.high is not None:
        axes.plot([found.low, found.high], [at, at], color=BLUE, linewidth=2)
    axes.plot([mean], [at], "s", color=BLUE, markersize=5.5)
    axes.annotate(f"{mean:.2f}", (mean, at), xytext=(0, 6), textcoords="offset points",
                  ha="center", fontsize=8.5, color=INK)  # fmt: skip


def _label(item: str, ends: Mapping[str, tuple[str, str]]) -> str:
    low, high = ends.get(item, ("", ""))
    words = f"{low} – {high}" if low and high else low or high
    return "\n".join(filter(None, (readable(item), words)))


def _keys(points: int) -> list[Any]:
    from matplotlib.patches import Patch

    return [Patch(facecolor=colour, label=str(point)) for point, colour in enumerate(shades(points))]


def _spoken(questions: Sequence[PairQuestion]) -> str:
    parts = []
    for question in questions:
        counts = ", ".join(f"{count} at {point}" for point, count in question.distribution.items())
        parts.append(f"{readable(question.item or 'rating')}: {counts}; mean {question.participants.mean:.2f}")
    return "; ".join(parts)
