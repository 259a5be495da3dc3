"""Power on the page: what `segue power --json` left in a results folder in; a table, figures, sentences out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study.counting import counted
from study.errors import AnalysisError
from study.report import tables, words
from study.report.drawing import BLUE, INK, SOFT, new_figure, picture_of, quiet_grid
from study.report.sections.section import Drawing


@dataclass(frozen=True)
class Point:
    """The power that studies with so many participants were found to have, with Wilson's interval."""

    participants: int
    studies: int
    power: float
    low: float
    high: float


@dataclass(frozen=True)
class FoundPower:
    """What the page shows of a file that `segue power --json` printed."""

    study: str
    aim: str
    points: tuple[Point, ...]
    target: float
    needed: int | None
    note: str
    answers_per_participant: int
    by_motions: tuple[tuple[int, int | None], ...]
    """Other numbers of motions, and the participants needed with them."""


def read_power(folder: Path) -> list[FoundPower]:
    """Return what `segue power --json` printed into files `power*.json` of a results folder, by the files' names.

    Raises
    ------
    AnalysisError
        When such a file holds anything else.
    """
    found = []
    for path in sorted(folder.glob("power*.json")):
        try:
            found.append(_parsed(json.loads(path.read_text(encoding="utf-8-sig"))))
        except (OSError, ValueError, TypeError, KeyError) as error:
            what = f"no {error}" if isinstance(error, KeyError) else error
            raise AnalysisError(
                f"{path}: expected what `segue power --json` prints, found {what}; make it again, or name the file "
                "otherwise"
            ) from error
    return found


def _parsed(content: Any) -> FoundPower:
    points = []
    for point in content["points"]:
        low, high = (point["interval"][end] for end in ("low", "high"))
        ends = 0.0 if low is None else float(low), 1.0 if high is None else float(high)
        points.append(Point(int(point["participants"]), int(point["studies"]), float(point["power"]), *ends))
    if not points:
        raise ValueError("no points")
    return FoundPower(
        study=str(content["study"]),
        aim=str(content["aim"]),
        points=tuple(points),
        target=float(content["target"]),
        needed=None if content["needed"] is None else int(content["needed"]),
        note=str(content["note"]),
        answers_per_participant=int(content["answers_per_participant"]),
        by_motions=tuple((row["motions"], row["needed"]) for row in content.get("by_motions", ())),
    )


def power_sentence(found: FoundPower) -> str:
    """Return how many participants are needed, in words."""
    who = (
        f"{counted(found.needed, 'participant')} are needed"
        if found.needed
        else "none of the numbers of participants tried is enough"
    )
    note = f" ({found.note})" if found.note else ""
    return (
        f"{words.sentence(words.readable(found.study))}: to {found.aim} in {100 * found.target:g}% of studies, "
        f"with {counted(found.answers_per_participant, 'answer')} of each participant, {who}{note}."
        + "".join(
            f" With {counted(motions, 'motion')}: {needed or 'none of the numbers tried'}."
            for motions, needed in found.by_motions
        )
    )


def power_table(found: Sequence[FoundPower]) -> tables.Table:
    """Return the power at every number of participants that was tried."""
    rows = [vars(point) | {"study": words.readable(entry.study)} for entry in found for point in entry.points]
    return tables.make(
        "power",
        "Power. The proportion of simulated studies, with the real plan and analysis, that found the effect, with "
        "Wilson’s 95% interval.",
        "study participants studies power low high",
        rows,
    )


def power_drawing(found: FoundPower, name: str, asked: int) -> Drawing:
    """Draw one study's power by the number of participants; `asked` is how many took part."""
    points = found.points
    across, up = [point.participants for point in points], [point.power for point in points]
    below, above = [one.power - one.low for one in points], [one.high - one.power for one in points]
    with new_figure(7.2, 2.6) as (figure, axes):
        axes.axhline(found.target, color=SOFT, linewidth=0.9, linestyle=(0, (1, 2)))
        axes.errorbar(across, up, yerr=[below, above], color=BLUE, marker="o", markersize=4.5, linewidth=1.5,
                      elinewidth=1, capsize=2.5)  # fmt: skip
        if asked and min(across) <= asked <= max(across):
            axes.axvline(asked, color=INK, linewidth=0.9)
            axes.annotate(
                f"{asked} in this study", (asked, 0), xytext=(4, 4), textcoords="offset points", color=INK, fontsize=8.5
            )
        axes.annotate(
            f"aim {found.target:g}", (across[0], found.target), xytext=(-6, 3), textcoords="offset points",
            color=SOFT, fontsize=8.5,
        )  # fmt: skip
        axes.set_ylim(-0.02, 1.04)
        axes.set_xlabel("participants")
        axes.set_title("power")
        quiet_grid(axes)
        spoken = "; ".join(f"{counted(point.participants, 'participant')}: {point.power:.2f}" for point in points)
        svg = picture_of(
            figure, f"power-{found.study}", f"Power of {words.readable(found.study)}", spoken, "simulated studies"
        )
    return Drawing(name, svg, f"Power to {found.aim}, by simulation, with Wilson’s 95% intervals.")
