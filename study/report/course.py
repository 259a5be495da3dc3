"""How participants answered over the course of a study: answers in, a table and a figure out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from study.report import tables, words
from study.report.drawing import BLUE, FAINT, add_mark, new_figure, quiet_grid, style, to_svg

if TYPE_CHECKING:
    import pandas as pd

PARTS = 6
FEWEST_ANSWERS = 12


def learning_table(answers: pd.DataFrame) -> tables.Table:
    """Return, for sixths of each study's trials, how participants answered: right (same-different), or the first."""
    rows = [row for (study, task), part in _studies(answers) for row in _course(str(study), str(task), part)]
    return tables.make(
        "learning",
        "Over the course of each study. By sixths of its trials: right answers (same-different) or answers for the one "
        "shown first (preference), means over participants with standard errors.",
        "study part what percent standard_error:one answers",
        rows,
    )


def _studies(answers: pd.DataFrame) -> Any:
    return answers.groupby(["study", "task"], sort=False)


def _course(study: str, task: str, part: pd.DataFrame) -> list[dict[str, Any]]:
    """Percentages by sixth of one study; none for ratings, nor where there are too few trials to part."""
    given = part[part["answer"].notna()]
    if task not in ("same-different", "preference") or len(given) < FEWEST_ANSWERS:
        return []
    place = part.groupby("participant")["trial"].rank(method="first")
    most = place.groupby(part["participant"]).transform("max")
    if most.max() < PARTS:
        return []
    sixth = np.ceil(place / most * PARTS).loc[given.index]
    if task == "same-different":
        counted = ((given["answer"] == "different") == (given["difference_frames"] != 0)).astype(float)
    else:
        counted = (given["answer"] == "first").astype(float)
    shares = counted.groupby([given["participant"].astype(str), sixth]).mean().unstack()
    sizes = counted.groupby(sixth).size()
    rows = []
    for number in shares.columns:
        column = shares[number].dropna()
        error = 100 * float(column.std(ddof=1)) / len(column) ** 0.5 if len(column) > 1 else None
        what = "right answers" if task == "same-different" else "answers for the first"
        mean = 100 * float(column.mean())
        rows.append({"study": study, "part": int(number), "what": what, "percent": mean})
        rows[-1] |= {"standard_error": error, "answers": int(sizes[number])}
    return rows


def learning_figure(table: tables.Table, name: str, mark: str) -> str | None:
    """Draw the table, one panel a study; None where there is nothing to draw."""
    if not table.rows:
        return None
    studies = list(dict.fromkeys(str(row["study"]) for row in table.rows))
    columns = 4  # also for fewer: panels keep their size
    lines = -(-len(studies) // columns)
    with style():
        figure, grid = new_figure(7.2, 2.0 * lines + 0.5, lines, columns, sharex=True, sharey=True, squeeze=False)
        spoken = []
        for axes, study in zip(grid.flat, studies, strict=False):
            own = [row for row in table.rows if row["study"] == study]
            across, up = [row["part"] for row in own], [row["percent"] for row in own]
            errors = [row["standard_error"] or 0.0 for row in own]
            axes.axhline(50, color=FAINT, linewidth=0.9, linestyle=(0, (4, 3)))
            axes.errorbar(across, up, yerr=errors, color=BLUE, marker="o", markersize=3.5, linewidth=1.3, elinewidth=1)
            axes.set_title(f"{words.readable(study)}:\n{own[0]['what']}", fontsize=8.5)
            axes.set_ylim(-3, 103)
            axes.set_yticks([0, 50, 100], ["0", "50", "100%"])
            axes.set_xticks(range(1, PARTS + 1))
            quiet_grid(axes)
            spoken.append(f"{words.readable(study)}, {own[0]['what']}: " + ", ".join(f"{value:.0f}%" for value in up))
        for axes in grid.flat[len(studies) :]:
            axes.set_axis_off()
        for axes in grid[-1]:
            axes.set_xlabel("sixth of the study")
        add_mark(figure, mark)
        return to_svg(figure, name, "Answers over the course of each study", "; ".join(spoken))
