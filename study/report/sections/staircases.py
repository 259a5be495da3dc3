"""Tracks on the page, of staircases and of QUEST+: their courses as small multiples, and a table of them all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal

from study.analysis.same_different.counts import Side
from study.analysis.same_different.staircases import StaircaseRun, Staircases
from study.counting import counted
from study.report import words
from study.report.drawing import BLUE, FAINT, INK, ORANGE, new_figure, picture_of, quiet_grid
from study.report.sections.section import Drawing
from study.report.tables import Table, make

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS = 4
UP_OR_DOWN: Mapping[Side | Literal["both"], int] = {"longer": 1, "shorter": -1, "both": 1}
MOST_DRAWN = 40
"""Participants whose tracks are drawn; the table has all."""


def staircase_table(name: str, found: Staircases) -> Table:
    """Return every track."""
    reversals, interval = ("reversals ", "") if found.averaged else ("", " low high narrow")
    return make(
        f"{name}_staircases",
        f"Every {found.title}: the {found.estimate}, in frames. A dash where it stopped too early for it.",
        f"participant motion side repeat trials {reversals}frames spread{interval}",
        [
            {
                **vars(run),
                "motion": words.readable(run.motion),
                "narrow": run.high / run.low if run.high and run.low else None,
            }
            for run in found.runs
        ],
        headings={"spread": "standard deviation"},
    )


def tracks_drawing(name: str, found: Staircases, mark: str) -> Drawing:
    """Draw the difference that each trial of each track showed, participant by participant."""
    people = sorted({run.participant for run in found.runs})
    drawn = people[:MOST_DRAWN]
    of_all = "" if drawn == people else f" The first {len(drawn)} of {counted(len(people), 'participant')} are drawn."
    shared = (
        " Where sides share a track, the sign is left out." if any(run.side == "both" for run in found.runs) else ""
    )
    points = (
        "Points are reversals; the dashed lines are"
        if found.averaged
        else "After the last trial stand the posterior of the threshold and, as a bar, its 95% interval with the "
        "median; the dashed lines are"
    )
    caption = (
        f"The course of every {found.title}: the difference from k in each of its trials. {points} the "
        f"{found.estimate}, over all of a participant and a side.{shared}{of_all}"
    )
    columns = min(len(drawn), COLUMNS)
    lines = -(-len(drawn) // columns)
    with new_figure(7.2, 1.45 * lines + 0.5, lines, columns, sharex=True, sharey=True, squeeze=False) as (figure, grid):
        for axes, participant in zip(grid.flat, drawn, strict=False):
            _tracks(axes, [run for run in found.runs if run.participant == participant], found)
            axes.set_title(participant)
        for axes in grid.flat[len(drawn) :]:
            axes.set_axis_off()
        figure.supylabel("difference from k, frames", fontsize=9.5)
        for axes in grid.flat[max(len(drawn) - columns, 0) : len(drawn)]:
            axes.tick_params(labelbottom=True)
            axes.set_xlabel("trial")
        svg = picture_of(
            figure, f"study-{name}-tracks", f"The course of every {found.title}", _spoken(drawn, found), mark
        )
    return Drawing(f"{name}_tracks", svg, caption)


def _tracks(axes: Axes, runs: Sequence[StaircaseRun], found: Staircases) -> None:
    quiet_grid(axes)
    axes.axhline(0, color=FAINT, linewidth=0.8)
    wide = 0.12 * max(len(run.levels) for run in found.runs)
    for side, sign in UP_OR_DOWN.items():
        own = [run for run in runs if run.side == side]
        for run in own:
            levels, end = [sign * level for level in run.levels], len(run.levels) + 1
            axes.plot(range(1, end), levels, color=BLUE, linewidth=0.9, drawstyle="steps-mid", alpha=0.75)
            if run.low is not None and run.high is not None and run.frames is not None:
                most = 1.3 * max(run.levels)
                ends = [sign * run.low, sign * min(run.high, most)]
                axes.plot([end, end], ends, color=ORANGE, linewidth=1.6, solid_capstyle="butt")
                axes.plot(end, sign * run.frames, "o", color=ORANGE, markersize=2.6)
                # By frame, since the grid's steps grow with the threshold.
                density = {at: mass / at for at, mass in zip(found.grid, run.posterior, strict=True) if at <= most}
                right = [end + wide * height / max(density.values()) for height in density.values()]
                axes.fill_betweenx([sign * at for at in density], end, right, color=ORANGE, alpha=0.3, linewidth=0)
            axes.plot(run.turns, [levels[turn - 1] for turn in run.turns], "o", color=INK, markersize=2.6)
        means = [run.frames for run in own if run.frames is not None]
        if means:
            axes.axhline(sign * sum(means) / len(means), color=ORANGE, linewidth=1.0, linestyle=(0, (4, 2)))


def _spoken(people: Sequence[str], found: Staircases) -> str:
    parts = []
    for participant in people:
        runs = [run for run in found.runs if run.participant == participant]
        trials, turns = sum(run.trials for run in runs), sum(run.reversals for run in runs)
        told = [counted(len(runs), found.title), counted(trials, "trial")]
        told += [counted(turns, "reversal")] if found.averaged else []
        parts.append(f"{participant}: {', '.join(told)}")
    return "; ".join(parts)
