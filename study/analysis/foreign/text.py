"""A table of texts from what another program exported: text in, one row a record out, numbered by its line.

Exports differ in delimiter, in blank columns from trailing commas, in rows that say nothing (blank ones, headings
repeated where files were joined, Gorilla's END OF FILE), and in quoted cells that go over several lines. What can be
told is told; what can't is refused.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from study.analysis.foreign.kinds import other_kind
from study.counting import counted
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "pipe": "|", "space": " "}
END = "END OF FILE"


def decoded(content: bytes) -> str:
    """Return the text of a file: UTF-8, or UTF-16 (as spreadsheets save "Unicode text").

    Raises
    ------
    AnalysisError
        When it is neither; where it is another kind of file, by its name and with what to do.
    """
    if found := other_kind(content):
        raise AnalysisError(f"expected a table as text (CSV), found {found[0]}, whatever its name; {found[1]}")
    encoding = "utf-8-sig"
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encoding = "utf-16"
    elif 0 in content[:2]:
        encoding = "utf-16-be" if content[0] == 0 else "utf-16-le"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        raise AnalysisError(f"expected a table of UTF-8 text: {error}; save it as CSV, UTF-8") from error
    if "\0" in text:
        raise AnalysisError("expected a table as text (CSV), found binary data; export it as CSV (UTF-8)")
    return text.lstrip("\ufeff")


def parse_table(text: str, needed: Sequence[str], delimiter: str | None = None) -> pd.DataFrame:
    """Return the records of a delimited text, all cells as trimmed text.

    Parameters
    ----------
    text
        Its first line with anything in it is the heading.
    needed
        Columns that will be asked for: the delimiter is the one under which the heading holds most of them.
    delimiter
        A name from `DELIMITERS`; found out where None.

    Returns
    -------
    DataFrame
        Indexed by line of the file less two, so that row 0 follows a heading in line 1. Columns without a heading and
        without any content are skipped.

    Raises
    ------
    AnalysisError
        When there is no heading or row, the delimiter can't be determined, a row has more cells than the heading, or a
        needed column occurs twice.
    """
    import pandas as pd

    stated = re.match(r"sep=(.)\r?\n", text, re.IGNORECASE)  # for spreadsheets, which then show it in no cell
    mark = DELIMITERS[delimiter] if delimiter else stated[1] if stated else _delimiter(text, needed)
    records = _records(text, mark)[1 if stated else 0 :]
    if not records:
        raise AnalysisError("expected a table with a heading, found an empty file")
    heading, rows = records[0][1], records[1:]
    if len(rows) > 1 and any(cell.startswith('{"ImportId"') for cell in rows[1][1]):
        rows = rows[2:]  # Qualtrics repeats its heading, as questions and as names of its own
    twice = [name for name in needed if heading.count(name) > 1]
    if twice:
        raise AnalysisError(f"expected one column {twice[0]!r}, found {heading.count(twice[0])}; rename the others")
    rows = [(line, cells) for line, cells in rows if cells != heading and END not in cells]
    for line, cells in rows:
        if any(cells[len(heading) :]):
            raise AnalysisError(
                f"row {line}: expected {counted(len(heading), 'cell')} as in the heading, found {len(cells)}; "
                "quote cells that hold the delimiter, or name another one with --delimiter"
            )
    if not rows:
        raise AnalysisError("expected rows under the heading, found none")
    width = len(heading)
    table = pd.DataFrame(
        [[*cells[:width], *[""] * (width - len(cells))] for _, cells in rows],
        columns=range(width),
        index=[line - 2 for line, _ in rows],
        dtype=str,
    )
    kept = [place for place in range(width) if heading[place] or (table[place] != "").any()]
    table = table[kept]
    table.columns = pd.Index([heading[place] or f"column {place + 1}" for place in kept])
    return table


def _records(text: str, mark: str, *, strict: bool = True) -> list[tuple[int, list[str]]]:
    """Records with anything in them: the line that each begins in, from 1, and its trimmed cells."""
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=mark, skipinitialspace=True, strict=strict)
    found, line = [], 1
    try:
        for cells in reader:
            trimmed = [cell.strip().strip("\ufeff") for cell in cells]
            if any(trimmed):
                found.append((line, trimmed))
            line = reader.line_num + 1
    except csv.Error as error:
        raise AnalysisError(f"row {line}: expected a table, found what can't be read as one: {error}") from error
    return found


def _delimiter(text: str, needed: Sequence[str]) -> str:
    """The delimiter under which the heading holds most of the needed columns; most columns where it holds none."""
    first = next((line for line in text.splitlines() if line.strip("\ufeff \t\r")), "")
    headings = {mark: _records(first, mark, strict=False) for mark in DELIMITERS.values()}
    names = {mark: set(records[0][1]) if records else set() for mark, records in headings.items()}
    held = {mark: len(names[mark] & {name.partition(".")[0] for name in needed} | names[mark] & set(needed))
            for mark in names}  # fmt: skip
    best = [mark for mark in held if held[mark] == max(held.values())]
    if len(best) > 1:
        best = [mark for mark in best if len(names[mark]) == max(len(names[other]) for other in best)]
    if len(best) > 1 and len(names[best[0]]) > 1:
        raise AnalysisError("expected one delimiter, found a heading that several fit; name it with --delimiter")
    return best[0]
