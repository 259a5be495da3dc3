"""Cells that a spreadsheet does not run: what people typed comes in, text that stays text goes out.

A spreadsheet takes a cell that begins with a sign such as `=` for a formula, and may ask other machines for data or
start programs. Every table that leaves Segue passes here; numbers stay numbers.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

# Blanks and marks that a spreadsheet passes over may stand before the sign; a tab or a line end is enough alone.
_FORMULA = re.compile(r"[\t\n]|[\s\x00-\x1f\u200b\ufeff]*[-=+@\uff0d\uff1d\uff0b\uff20]")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)


def safe_cell(value: Any) -> Any:
    """Return a cell as it is, or with an apostrophe in front where a spreadsheet would take it for a formula.

    Carriage returns become line ends, which every writer of CSV quotes: unquoted, they would begin a row.

    Examples
    --------
    >>> safe_cell("=1+1"), safe_cell("-3.2"), safe_cell(-3.2)
    ("'=1+1", '-3.2', -3.2)
    """
    if not isinstance(value, str):
        return value
    text = value.replace("\r\n", "\n").replace("\r", "\n")
    return f"'{text}" if _FORMULA.match(text) and not _NUMBER.fullmatch(text) else text


def safe_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table with `safe_cell` for every cell of text."""
    text = table.select_dtypes(["object", "string"]).columns
    return table.assign(**{name: table[name].map(safe_cell) for name in text})
