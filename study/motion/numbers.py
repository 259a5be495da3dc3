"""Tables of numbers in text, fast where they are well formed and exact about the place where they are not."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from study.motion.source import Source, number

FloatArray = NDArray[np.float64]

_LINE = re.compile(rb"[^\r\n]+")
_WORD = re.compile(rb"\S+")


def parse_table(source: Source, offset: int, columns: int) -> FloatArray:
    """The rows from a byte offset to the end of the file, `(rows, columns)`; blank lines don't count.

    Raises
    ------
    MotionFileError
        Where a row has another number of values, or one of them is not a finite number.
    """
    data = source.raw[offset:]
    lines = [line for line in data.splitlines() if line.strip()]
    if lines and columns and b"_" not in data and all(len(line.split()) == columns for line in lines):
        try:
            values = np.array(data.split(), dtype=np.float64)
        except ValueError:
            values = np.array([np.nan])
        if np.isfinite(values).all():
            return values.reshape(-1, columns)
    return _parse_slowly(source, offset, columns)


def _parse_slowly(source: Source, offset: int, columns: int) -> FloatArray:
    """The same, word by word: finds what is wrong and where."""
    rows: list[list[float]] = []
    for line in _LINE.finditer(source.raw, offset):
        words = [(word.group(), word.start()) for word in _WORD.finditer(source.raw, line.start(), line.end())]
        if not words:
            continue
        row = [
            number(source, word, at, f"a number in frame {len(rows)}, value {k + 1} of {columns}")
            for k, (word, at) in enumerate(words[:columns])
        ]
        if len(words) < columns:
            raise source.error(
                line.end(),
                f"Expected {columns} values in frame {len(rows)}, found {len(words)}: the row is cut short. "
                "Copy the file again, or delete the row.",
            )
        if len(words) > columns:
            raise source.error(
                words[columns][1],
                f"Expected {columns} values in frame {len(rows)}, found {len(words)}. "
                "The channels above don't fit the rows.",
            )
        rows.append(row)
    if not rows:
        raise source.error(len(source.raw.rstrip()), "Expected data rows after 'Frame Time:', found none.")
    return np.array(rows)
