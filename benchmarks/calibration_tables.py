"""The tables behind docs/analysis.md out of the rows that `calibration.py ... --out FILE` kept.

python benchmarks/calibration_tables.py cells.jsonl
"""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import calibration_psychometric as psychometric
import calibration_same_different as same_different
import numpy as np

GROUPS = {group.name: group for group in (*same_different.DESIGN_2004, *same_different.OTHER)}
BAND = (0.93, 0.97)


def percent(value, places=1):
    return "" if value is None else f"{100 * value:.{places}f}%"


def number(value, places=2, sign=""):
    return "" if value is None else f"{value:{sign}.{places}f}"


def header(names):
    print("| " + " | ".join(names) + " |\n|" + "---|" * len(names))


def same_different_table(rows):
    """One line a group and side: estimates beside each other."""
    heads = ("people", "spread", "blend is", "median: true", "mixed", "covers", "group: true", "model", "covers",
             "mixed", "covers", "lines: true", "mean", "covers")  # fmt: skip
    header(heads)
    found = {(row["cell"], row["side"], row["estimate"]): row for row in rows}
    for cell, side in dict.fromkeys((row["cell"], row["side"]) for row in rows):
        median, one, group, lines = (found[cell, side, kind] for kind in (
            "mixed: median observer", "curve of the group", "mixed: group", "straight lines"))  # fmt: skip
        people = GROUPS[cell]
        parts = [str(people.people), f"{people.spread:g}", side, number(median["true"]), number(median["mean"]),
                 percent(median["covers"]), number(one["true"]), number(one["mean"]), percent(one["covers"]),
                 number(group["mean"]), percent(group["covers"]), number(lines["true"]), number(lines["mean"]),
                 percent(lines["covers"])]  # fmt: skip
        print("| " + " | ".join(parts) + " |")


def cells_of(rows):
    known = {cell.name: cell for cell in psychometric.FIRST + psychometric.CHECK + psychometric.CONFIRM}
    for seed in {int(match[1]) for row in rows if (match := re.match(r"drawn(\d+)-", row["cell"]))}:
        known |= {cell.name: cell for cell in psychometric.drawn_cells(seed)}
    return known


def described(cell):
    """Task, sigmoid, levels x answers, width in steps, place of the threshold among levels, guess and lapse rate."""
    axis = np.log(cell.levels) if cell.sigmoid == "weibull" else np.array(cell.levels)
    place = (cell.threshold - axis.min()) / (axis.max() - axis.min())
    more = [f"fitted as {cell.fitted}" if cell.fitted else "", "rates held" if cell.held else "",
            f"correlation {cell.correlation:g}" if cell.correlation else ""]  # fmt: skip
    answers = f"{cell.answers} in all, staircase" if cell.up else str(cell.answers)
    guess = f"{cell.guess:.2f}" if cell.task == "yes-no" else ""
    width = cell.width / np.median(np.diff(axis))
    sigmoid = ", ".join([cell.sigmoid, *filter(None, more)])
    return [cell.task, sigmoid, f"{len(cell.levels)} x {answers}", f"{width:.1f}", f"{100 * place:.0f}%", guess,
            f"{cell.lapse:.2f}"]  # fmt: skip


def psychometric_table(rows):
    cells = cells_of(rows)
    heads = ("task", "sigmoid", "levels x answers", "width, steps", "threshold at", "guess", "lapse", "covers",
             "all below", "all above", "open", "bias")  # fmt: skip
    header(heads)
    for row in rows:
        parts = [percent(row["covers"]), percent(row["below"]), percent(row["above"]), percent(row["open"], 0)]
        print("| " + " | ".join([*described(cells[row["cell"]]), *parts, number(row["bias"], 2, "+")]) + " |")


def drawn_summary(rows):
    """One line a seed, and the cells outside the band."""
    cells = cells_of(rows)
    for seed in sorted({re.match(r"drawn(\d+)-", row["cell"])[1] for row in rows}):
        own = [row for row in rows if row["cell"].startswith(f"drawn{seed}-")]
        covers = np.array([row["covers"] for row in own])
        print(f"drawn:{seed}: {len(own)} cells, cover {percent(covers.mean())} on average, {percent(covers.min())} to "
              f"{percent(covers.max())}; bias {np.mean([abs(row['bias']) for row in own]):.2f} steps, at most "
              f"{max(abs(row['bias']) for row in own):.2f}")  # fmt: skip
        for row in own:
            if not BAND[0] <= row["covers"] <= BAND[1]:
                print(
                    "   ", percent(row["covers"]), number(row["bias"], 2, "+"), ", ".join(described(cells[row["cell"]]))
                )


if __name__ == "__main__":
    kept = [json.loads(line) for line in Path(sys.argv[1]).read_text(encoding="utf-8").splitlines()]
    groups = [row for row in kept if "estimate" in row]
    own = [row for row in kept if "estimate" not in row and not row["cell"].startswith(("prior", "drawn"))]
    drawn = [row for row in kept if row["cell"].startswith("drawn")]
    for rows, show in ((groups, same_different_table), (own, psychometric_table), (drawn, drawn_summary)):
        if rows:
            show(rows)
            print()
