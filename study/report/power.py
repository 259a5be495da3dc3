"""Power on the page: what `segue power --json` left in a results folder in; a table, figures, sentences out."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from study.counting import counted
from study.errors import AnalysisError
from study.report import tables, words
from study.report.drawing import BLUE, INK, SOFT, add_mark, new_figure, quiet_grid, style, to_svg
from study.report.sections.section import Drawing

Result = Mapping[str, Any]

NEEDED = ("study", "aim", "points", "target", "needed", "note", "answers_per_participant")


def read_power(folder: Path) -> list[Result]:
    """Return what `segue power --json` printed into files `power*.json` of a results folder, by the files' names.

    Raises
    ------
    AnalysisError
        When such a file holds anything else.
    """
    found = []
    for path in sorted(folder.glob("power*.json")):
        try:
            content = json.loads(path.read_text(encoding="utf-8-sig"))
        except (OSError, ValueError) as error:
            raise AnalysisError(f"{path}: expected what `segue power --json` prints: {error}; make it anew") from error
        missing = [key for key in NEEDED if not isinstance(content, dict) or key not in content] or _gaps(content)
        if missing:
            raise AnalysisError(
                f"{path}: expected what `segue power --json` prints, found no {', '.join(missing)}; make it anew or "
                "name "
                "the file otherwise"
            )
        found.append(content)
    return found


def _gaps(content: dict[str, Any]) -> list[str]:
    """What the points of a curve lack."""
    points = content["points"]
    if not isinstance(points, list) or not points or not all(isinstance(point, dict) for point in points):
        return ["points"]
    keys = ("participants", "studies", "power")
    gaps = [f"points.{key}" for point in points for key in keys if not _is_number(point.get(key))]
    intervals = [point.get("interval") for point in points]
    ends = all(isinstance(one, dict) and {"low", "high"} <= one.keys() for one in intervals)
    numbers = [key for key in ("target", "answers_per_participant") if not _is_number(content[key])]
    return sorted({*gaps, *numbers}) + ([] if ends else ["points.interval"])


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def power_sentence(found: Result) -> str:
    """Return how many participants are needed, in words."""
    who = (
        f"{counted(found['needed'], 'participant')} are needed"
        if found["needed"]
        else "no number of participants that was tried is enough"
    )
    note = f" ({found['note']})" if found["note"] else ""
    return (
        f"{words.sentence(words.readable(found['study']))}: to {found['aim']} in {100 * found['target']:g}% of "
        "studies, "
        f"with {counted(found['answers_per_participant'], 'answer')} of each participant, {who}{note}."
    )


def power_table(found: Sequence[Result]) -> tables.Table:
    """Return the power at every number of participants that was tried."""
    rows = [
        {
            "study": words.readable(entry["study"]),
            "participants": point["participants"],
            "studies": point["studies"],
            "power": point["power"],
            **{end: point["interval"][end] for end in ("low", "high")},
        }
        for entry in found
        for point in entry["points"]
    ]
    return tables.make(
        "power",
        "Power. The share of simulated studies, through the real plan and the real analysis, that found what is there, "
        "with Wilson’s 95% interval.",
        "study participants studies power low high",
        rows,
    )


def power_drawing(found: Result, name: str, asked: int) -> Drawing:
    """Draw one study's power by the number of participants; `asked` is how many took part."""
    points = found["points"]
    across, up = [point["participants"] for point in points], [point["power"] for point in points]
    below = [p["power"] - (p["interval"]["low"] or 0.0) for p in points]
    above = [(1.0 if p["interval"]["high"] is None else p["interval"]["high"]) - p["power"] for p in points]
    with style():
        figure, axes = new_figure(7.2, 2.6)
        axes.axhline(found["target"], color=SOFT, linewidth=0.9, linestyle=(0, (1, 2)))
        axes.errorbar(across, up, yerr=[below, above], color=BLUE, marker="o", markersize=4.5, linewidth=1.5,
                      elinewidth=1, capsize=2.5)  # fmt: skip
        if asked and min(across) <= asked <= max(across):
            axes.axvline(asked, color=INK, linewidth=0.9)
            axes.annotate(
                f"{asked} in this study", (asked, 0), xytext=(4, 4), textcoords="offset points", color=INK, fontsize=8.5
            )
        axes.annotate(
            f"aim {found['target']:g}", (across[0], found["target"]), xytext=(-6, 3), textcoords="offset points",
            color=SOFT, fontsize=8.5,
        )  # fmt: skip
        axes.set_ylim(-0.02, 1.04)
        axes.set_xlabel("participants")
        axes.set_title("power")
        quiet_grid(axes)
        add_mark(figure, "simulated studies")
        spoken = "; ".join(f"{counted(point['participants'], 'participant')}: {point['power']:.2f}" for point in points)
        svg = to_svg(figure, f"power-{found['study']}", f"Power of {words.readable(found['study'])}", spoken)
    return Drawing(name, svg, f"Power to {found['aim']}, by simulation, with Wilson’s 95% intervals.")
