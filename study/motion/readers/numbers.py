"""Numbers in text, fast where they are well formed and exact about the place where they are not."""

from __future__ import annotations

import re
from contextlib import suppress
from io import BytesIO

import numpy as np

from study.arrays import FloatArray
from study.counting import counted
from study.motion.readers.source import LARGEST, Source, number

_LINE = re.compile(rb"[^\r\n]+")
_WORD = re.compile(rb"\S+")
# From so many bytes on it pays to load pandas.
_LARGE = 1_000_000


def parse_table(source: Source, offset: int, columns: int) -> FloatArray:
    """The rows from a byte offset to the end of the file, `(rows, columns)`; blank lines don't count.

    Raises
    ------
    MotionFileError
        Where a row has another number of values, or one of them is not a number up to `LARGEST`.
    """
    if columns == 0:
        raise source.error(offset, "Expected at least one channel in the hierarchy, found none: nothing moves.")
    table = parse_numbers(source.raw[offset:])
    return table if table is not None and table.shape[1] == columns else _parse_slowly(source, offset, columns)


def parse_numbers(lines: bytes) -> FloatArray | None:
    """Lines of as many numbers each, `(lines, numbers)`; None where they are anything else.

    Each is the nearest double, as `float` gives it: NumPy reads so, and pandas from 3.1 on, several times as fast.
    """
    lines = lines.replace(b"\r", b"\n")
    if not lines or lines.isspace() or lines.translate(None, b"0123456789+-.eE \t\n"):
        return None  # letters such as those of `inf`, which both take
    try:
        table = np.loadtxt(BytesIO(lines), ndmin=2) if len(lines) < _LARGE else _parse_many(lines)
    except ValueError:
        return None
    return table if table.min() >= -LARGEST and table.max() <= LARGEST else None


def _parse_many(lines: bytes) -> FloatArray:
    import pandas as pd  # only here: it takes longer to load than most files to read

    def parsed(separator: str) -> FloatArray:
        table = pd.read_csv(BytesIO(lines), sep=separator, header=None, dtype=np.float64, na_filter=False)
        return table.to_numpy()

    first = lines.lstrip(b"\n").split(b"\n", 1)[0]
    if first.endswith(b" "):
        lines = lines.replace(b" \n", b"\n")
    if first.split() == first.removesuffix(b" ").split(b" "):
        with suppress(ValueError):  # where a later line has other blanks
            return parsed(" ")  # in two thirds of the time
    return parsed(r"\s+")


def _parse_slowly(source: Source, offset: int, columns: int) -> FloatArray:
    """The same word by word: finds what is wrong and where."""
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
                f"Expected {counted(columns, 'value')} in frame {len(rows)}, found {len(words)}: the row is cut short. "
                "Copy the file again, or delete the row.",
            )
        if len(words) > columns:
            raise source.error(
                words[columns][1],
                f"Expected {counted(columns, 'value')} in frame {len(rows)}, found {len(words)}: "
                "the rows don't fit the channels of the hierarchy.",
            )
        rows.append(row)
    if not rows:
        raise source.error(len(source.raw.rstrip()), "Expected data rows after 'Frame Time:', found none.")
    return np.array(rows)
