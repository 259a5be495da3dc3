"""The report's tables: rows in; CSV, JSON and cells for the page out."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

LONGEST_SHORT = 30
"""Longer text may break into lines. [characters]"""

WIDTH_OF_TEXT = 100
"""Characters that a table may take in a row before it stands out into the margins."""

Kind = Literal["text", "count", "one", "two", "three", "percent", "p"]


@dataclass(frozen=True)
class Column:
    """A column: its key in the rows, its heading, how its values are written, and whether the page shows it."""

    key: str
    heading: str
    kind: Kind = "text"
    shown: bool = True

    @property
    def numeric(self) -> bool:
        """Whether its cells are set to the right."""
        return self.kind != "text"


@dataclass(frozen=True)
class Table:
    """A table with a name (of its files) and a caption."""

    name: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[Mapping[str, Any], ...]

    @property
    def shown(self) -> tuple[Column, ...]:
        """The columns that the page shows; the files have all of them."""
        return tuple(column for column in self.columns if column.shown)

    @property
    def broad(self) -> bool:
        """Whether it needs more than the width of the text."""
        widths = [
            max([len(column.heading), *lengths]) for column, lengths in zip(self.shown, self._lengths, strict=True)
        ]
        return sum(min(width, LONGEST_SHORT) + 2 for width in widths) > WIDTH_OF_TEXT

    @property
    def _lengths(self) -> list[list[int]]:
        return [[len(row[place][0]) for row in self.cells] for place in range(len(self.shown))]

    @property
    def cells(self) -> list[list[tuple[str, str]]]:
        """What the page shows: text and its class (number, short or long)."""
        return [[_cell(row.get(column.key), column) for column in self.shown] for row in self.rows]


def _cell(value: Any, column: Column) -> tuple[str, str]:
    text = written(value, column.kind)
    return text, "number" if column.numeric else "short" if len(text) <= LONGEST_SHORT else "long"


def written(value: Any, kind: Kind) -> str:
    """Return a value as the page shows it; a dash where there is none."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "–"
    if kind == "text":
        return str(value)
    if kind == "count":
        return f"{value:,.0f}".replace("-", "−")
    if kind == "percent":
        return f"{value:.1f}%"
    if kind == "p":
        return p_value(value)
    places = {"one": 1, "two": 2, "three": 3}[kind]
    return f"{value:.{places}f}".replace("-", "−")


def p_value(value: float) -> str:
    """Return a p-value in the form of the field: < .001, .012, .24."""
    if value < 0.001:
        return "< .001"
    text = f"{value:.3f}" if value < 0.1 else f"{value:.2f}"
    return text.removeprefix("0") if value < 0.995 else "1.00"


def as_csv(table: Table) -> str:
    """Return the table as CSV with the keys as headings, numbers in full."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([column.key for column in table.columns])
    for row in table.rows:
        writer.writerow(["" if row.get(column.key) is None else row[column.key] for column in table.columns])
    return buffer.getvalue()


def as_json(table: Table) -> str:
    """Return the table as JSON: caption, headings by key, and rows."""
    headings = {column.key: column.heading for column in table.columns}
    rows = [{column.key: row.get(column.key) for column in table.columns} for row in table.rows]
    content = {"name": table.name, "caption": table.caption, "columns": headings, "rows": rows}
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def make(
    name: str,
    caption: str,
    columns: Sequence[tuple[str, str, Kind]],
    rows: Sequence[Mapping[str, Any]],
    *,
    files_only: Sequence[str] = (),
) -> Table:
    """Return a table from plain column tuples (key, heading, kind); `files_only` names columns the page leaves out."""
    return Table(
        name, caption, tuple(Column(*column, shown=column[0] not in files_only) for column in columns), tuple(rows)
    )
