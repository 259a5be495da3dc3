"""The report's tables: rows in; CSV, JSON and cells for the page out."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast, get_args

from study.spreadsheets import safe_cell

LONGEST_SHORT = 30
"""Longer text may break into lines. [characters]"""

WIDTH_OF_TEXT = 88
"""Characters that a table may take in a row before it extends into the margins."""

Kind = Literal["text", "count", "one", "two", "three", "percent", "p", "short"]
"""How a value is written: as it is, as a whole number, with one to three places, ..., or with three digits."""


COLUMNS: Mapping[str, tuple[str, Kind]] = {
    # What a row is about.
    "study": ("study", "text"),
    "motion": ("motion", "text"),
    "point": ("point", "count"),
    "transition": ("transition", "text"),
    "result": ("result", "text"),
    "comparison": ("comparison", "text"),
    "item": ("question", "text"),
    "method": ("method", "text"),
    "source": ("source", "text"),
    "reading": ("reading", "text"),
    "estimate": ("estimate", "text"),
    "side": ("blend is", "text"),
    "difference_frames": ("frames from k", "count"),
    "remark": ("remark", "text"),
    "answer": ("answer", "text"),
    # Counts.
    "participants": ("participants", "count"),
    "answers": ("answers", "count"),
    "missed": ("missed", "count"),
    "different": ("different", "count"),
    "favouring": ("favouring", "count"),
    # Estimates, how sure they are, and tests.
    "frames": ("frames", "two"),
    "repeat": ("repeat", "count"),
    "reversals": ("reversals", "count"),
    "seconds": ("seconds", "three"),
    "percent": ("percent", "one"),
    "mean": ("mean", "two"),
    "median": ("median", "one"),
    "rank": ("rank", "two"),
    "value": ("value", "two"),
    "standard_deviation": ("standard deviation", "two"),
    "standard_error": ("standard error", "two"),
    "low": ("interval from", "two"),
    "high": ("to", "two"),
    "test": ("test", "text"),
    "generalises_to": ("holds for", "text"),
    "statistic": ("statistic", "two"),
    "t": ("t", "two"),
    "chi_square": ("chi-square", "two"),
    "f": ("F", "two"),
    "degrees_of_freedom": ("df", "count"),
    "error_degrees_of_freedom": ("error df", "count"),
    "p_value": ("p", "p"),
    "exact_p_value": ("exact p", "p"),
    "holm_p_value": ("Holm p", "p"),
    "signed_rank_p_value": ("signed-rank p", "p"),
    "sum_of_squares": ("SS", "two"),
    "mean_square": ("MS", "two"),
    "partial_eta_squared": ("partial η²", "two"),
    "effect_low": ("η² from", "two"),
    "effect_high": ("to", "two"),
    "epsilon": ("ε", "two"),
    "corrected_p_value": ("corrected p", "p"),
    "order": ("seen first", "text"),
    "of": ("difference", "text"),
    "published": ("as published", "text"),
    "corrected": ("corrected", "text"),
    # Same-different.
    "shorter": ("shorter", "two"),
    "shorter_seconds": ("seconds", "three"),
    "shorter_standard_error": ("standard error", "two"),
    "reference_frames": ("k", "count"),
    "shorter_share": ("% of k", "one"),
    "longer_share": ("% of k", "one"),
    "shorter_low": ("interval from", "two"),
    "shorter_high": ("to", "two"),
    "longer": ("longer", "two"),
    "longer_seconds": ("seconds", "three"),
    "longer_standard_error": ("standard error", "two"),
    "longer_low": ("interval from", "two"),
    "longer_high": ("to", "two"),
    "d_prime": ("d-prime", "two"),
    "d_prime_independent": ("independent observations", "two"),
    "criterion": ("criterion", "two"),
    "criterion_free": ("criterion-free, frames", "two"),
    "lapse_percent": ("lapses, %", "one"),
    "known": ("known", "two"),
    "found": ("found", "two"),
    "distance": ("off by", "two"),
    # Preferences.
    "spread": ("spread of participants, logits", "two"),
    "narrow": ("upper end, times the lower", "two"),
    "margin": ("counts as none", "text"),
    "equivalence_p_value": ("equivalence p", "p"),
    # How the study went.
    "part": ("sixth", "count"),
    "what": ("percent of", "text"),
    "rule": ("rule", "text"),
    "reason": ("reason", "text"),
    "timed_by": ("timed by", "text"),
    "shown": ("presentations", "count"),
    "badly": ("faulty", "count"),
    "again": ("shown again", "count"),
    "frames_lost": ("frames lost", "count"),
    "frames_lost_percent": ("frames lost, %", "two"),
    "median_gap": ("longest gap, median", "two"),
    "longest_gap": ("longest gap of all", "two"),
    "all_value": ("of all answers", "two"),
    "all_low": ("interval from", "two"),
    "all_high": ("to", "two"),
    "all_p_value": ("p", "p"),
    # What was shown, and to whom.
    "category": ("category", "text"),
    "optimal_frames": ("k", "count"),
    "blend_frames": ("blend", "count"),
    "destination": ("to", "text"),
    "notes": ("notes", "text"),
    "id": ("hash", "text"),
    "role": ("place", "text"),
    "file": ("file", "text"),
    "frame": ("at", "count"),
    "added_before": ("added before", "count"),
    "added_after": ("after", "count"),
    "changes": ("how", "text"),
    "cue": ("seen alone", "text"),
    "furthest_percent": ("at the furthest", "one"),
    "expected_percent": ("by the method", "one"),
    "pair": ("pair", "text"),
    "longer_s": ("longer, s", "three"),
    "first_right": ("first frame: right", "three"),
    "first_down": ("down", "three"),
    "first_size": ("size", "three"),
    "first_pose": ("pose", "three"),
    "last_right": ("last frame: right", "three"),
    "last_down": ("down", "three"),
    "last_size": ("size", "three"),
    "last_pose": ("pose", "three"),
    "faster_m_s": ("faster, m/s", "three"),
    "farther_m": ("farther, m", "three"),
    "unsupported_percent": ("no foot stands, %", "one"),
    "own_unsupported_percent": ("in the motions", "one"),
    "left_skating_percent": ("left foot skates, %", "one"),
    "right_skating_percent": ("right", "one"),
    "own_skating_percent": ("in the motions", "one"),
    "sink_cm": ("sinks, cm", "one"),
    "toe_times": ("toe, times", "two"),
    "joint_times": ("joint", "two"),
    "root_times": ("root", "two"),
    "participant": ("participant", "text"),
    "kind": ("kind", "text"),
    "started": ("started (UTC)", "text"),
    "trials": ("asked", "count"),
    "answered": ("answered", "count"),
    "median_response_s": ("median time, s", "two"),
    "too_fast": ("too fast", "count"),
    "shown_badly": ("display failures", "count"),
    "false_alarms": ("false alarms", "count"),
    "same_pairs": ("of same pairs", "count"),
    "flags": ("flags", "text"),
    "left_out": ("excluded", "text"),
    # Planning.
    "studies": ("simulated studies", "count"),
    "power": ("power", "two"),
}
"""Heading and kind of every column that a table of the report may have, by its key; one word for one thing."""


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
    """A table with a name (of its files) and a caption, whose first sentence is the title."""

    name: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[Mapping[str, Any], ...]

    @property
    def title(self) -> str:
        """The caption's first sentence, shown above the table."""
        return self.caption.partition(". ")[0].removesuffix(".")

    @property
    def note(self) -> str:
        """The rest of the caption, shown below."""
        return self.caption.partition(". ")[2]

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
    if kind == "short":
        return short_number(value)
    places = {"one": 1, "two": 2, "three": 3}[kind]
    return f"{value:.{places}f}".replace("-", "−")


def p_value(value: float) -> str:
    """Return a p-value in the form of the field: < .001, .012, .24."""
    if value < 0.001:
        return "< .001"
    text = f"{value:.3f}" if value < 0.1 else f"{value:.2f}"
    return text.removeprefix("0") if value < 0.995 else "1.00"


def short_number(value: float) -> str:
    """Return a ratio with three digits: 12.3, 0.00171, over 1,000, under 0.001."""
    if value >= 1000:
        return "over 1,000"
    return f"{value:.3g}" if value >= 0.001 else "under 0.001"


def as_csv(table: Table) -> str:
    """Return the table as CSV with the keys as headings, numbers in full."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow([column.key for column in table.columns])
    for row in table.rows:
        cells = (row.get(column.key) for column in table.columns)
        writer.writerow(["" if cell is None else safe_cell(cell) for cell in cells])
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
    columns: str,
    rows: Sequence[Mapping[str, Any]],
    *,
    headings: Mapping[str, str] | None = None,
    files_only: str = "",
) -> Table:
    """Return a table.

    Parameters
    ----------
    name, caption
        Of the table; its files have the name.
    columns
        Keys of the rows, parted by blanks, each in `COLUMNS`; `low:one` writes the values of `low` as the kind `one`.
    rows
        Values by key.
    headings
        In place of those in `COLUMNS`.
    files_only
        Keys of the columns that the page omits, separated by blanks.
    """
    hidden = files_only.split()
    made = []
    for word in columns.split():
        key, _, kind = word.partition(":")
        heading, usual = COLUMNS[key]
        shown = (headings or {}).get(key, heading)
        made.append(Column(key, shown, _kind(kind) if kind else usual, key not in hidden))
    return Table(name, caption, tuple(made), tuple(rows))


def _kind(name: str) -> Kind:
    assert name in get_args(Kind), f"no kind of value is called {name!r}"
    return cast("Kind", name)
