"""How participants answered over the course of a study: answers in, a table and figures out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from study.analysis.analyse import Results
from study.report import tables, words
from study.report.drawing import BLUE, FAINT, RULE, Picture, new_figure, picture_of, quiet_grid
from study.report.sections.registry import SECTIONS
from study.report.sections.section import Course

if TYPE_CHECKING:
    import pandas as pd


PARTS = 6
FEWEST_ANSWERS = 12


def learning_table(answers: pd.DataFrame, results: Results) -> tables.Table:
    """Return, for sixths of each study's trials, how participants answered: right (same-different), or the first."""
    rows = []
    for study, part in answers.groupby("study", sort=False):
        result = results.studies.get(str(study))
        if result is not None and (course := SECTIONS[type(result)].course):
            rows += _by_sixths(str(study), course, part)
    return tables.make(
        "learning",
        "Over the course of each study. By sixths of its trials: right answers (same-different) or answers for the one "
        "shown first (preference), means over participants with standard errors.",
        "study part what percent standard_error:one answers",
        rows,
    )


def _by_sixths(study: str, course: Course, part: pd.DataFrame) -> list[dict[str, Any]]:
    """Percentages by sixth of one study; none where there are too few trials to part."""
    given = part[part["answer"].notna()]
    if len(given) < FEWEST_ANSWERS:
        return []
    place = part.groupby("participant")["trial"].rank(method="first")
    most = place.groupby(part["participant"]).transform("max")
    if most.max() < PARTS:
        return []
    sixth = np.ceil(place / most * PARTS).loc[given.index]
    what, counts_of = course
    counts = counts_of(given).astype(float)
    shares = counts.groupby([given["participant"].astype(str), sixth]).mean().unstack()
    sizes = counts.groupby(sixth).size()
    rows = []
    for number in shares.columns:
        column = shares[number].dropna()
        error = 100 * float(column.std(ddof=1)) / len(column) ** 0.5 if len(column) > 1 else None
        row = {"study": study, "part": int(number), "what": what, "percent": 100 * float(column.mean())}
        rows.append(row | {"standard_error": error, "answers": int(sizes[number])})
    return rows


def learning_figure(table: tables.Table, name: str, mark: str) -> Picture | None:
    """Draw the table, one panel a study; None where there is nothing to draw."""
    if not table.rows:
        return None
    studies = list(dict.fromkeys(str(row["study"]) for row in table.rows))
    columns = 4  # also for fewer: panels keep their size
    lines = -(-len(studies) // columns)
    with new_figure(7.2, 2.0 * lines + 0.5, lines, columns, sharex=True, sharey=True, squeeze=False) as (figure, grid):
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
        return picture_of(figure, name, "Answers over the course of each study", "; ".join(spoken), mark)


def response_figure(answers: pd.DataFrame, name: str, mark: str) -> Picture | None:
    """Response times: how they are distributed, and how they change over the session; None without times."""
    timed = answers[answers["response_s"].notna()] if "response_s" in answers else answers.iloc[:0]
    if timed.empty:
        return None
    times = timed["response_s"].to_numpy(dtype=np.float64)
    with new_figure(7.2, 2.5, 1, 2, width_ratios=(1, 1.25)) as (figure, (left, right)):
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
        spoken = f"median {middle:.2f} s, from {times.min():.2f} to {times.max():.2f} s"
        return picture_of(figure, name, "Response times", spoken, mark)
