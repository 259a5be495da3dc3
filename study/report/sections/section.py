"""What the page shows of one study: a headline, figures, tables, and one line of the table that compares readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from study.report import tables
from study.report.tables import Table


@dataclass(frozen=True)
class Drawing:
    """A figure with its caption; `svg` is markup of our own making, `name` that of its file."""

    name: str
    svg: str
    caption: str


@dataclass(frozen=True)
class Headline:
    """An answer in words: the statement itself, and what it rests on."""

    statement: str
    detail: str


@dataclass(frozen=True)
class Section:
    """One study on the page.

    Attributes
    ----------
    anchor, title
        Where links lead, and the heading.
    headlines
        They stand at the top of the page.
    drawings, tables, notes
        In this order; the tables follow the first drawing.
    folded
        Tables to open.
    readings
        Lines of the table that sets published and corrected results side by side: `result`, `published`, `corrected`.
    """

    anchor: str
    title: str
    headlines: tuple[Headline, ...]
    drawings: tuple[Drawing, ...] = ()
    tables: tuple[Table, ...] = ()
    notes: tuple[str, ...] = ()
    folded: tuple[Table, ...] = ()
    readings: tuple[Mapping[str, Any], ...] = ()


def readings_table(sections: Sequence[Section]) -> Table | None:
    """Return every result as published and corrected, side by side; None where there is no result."""
    rows = [row for section in sections for row in section.readings]
    if not rows:
        return None
    names = [row["result"] for row in rows]
    if len(set(names)) < len(names):
        rows = [
            {**row, "result": f"{section.title}: {row['result']}"} for section in sections for row in section.readings
        ]
    return tables.make(
        "results",
        "Every result as published and corrected, with 95% intervals in brackets. Published: the statistics of the "
        "papers, which take all answers for independent or read thresholds off straight lines. Corrected: the "
        "participant is the unit, and thresholds come from a model of the task.",
        "result published corrected",
        rows,
    )
