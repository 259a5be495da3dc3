"""Numbers in text, fast where they are well formed and exact about the place where they are not.

The fast way reads decimal digits eight at a time, as bytes of 64-bit words, for all numbers of a chunk at once
(after D. Lemire, "Number parsing at a gigabyte per second", Software: Practice and Experience 51, 2021;
here over arrays instead of one number after the other). Digits make a whole number below 2**53, divided once by a power
of ten: both exact, so the quotient is the nearest double, the same that `float` gives. Anything unusual (more than 15
digits, large exponents) goes through `float`, and anything wrong is found again, word by word, to say where it is.
"""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

from study.arrays import BoolArray, FloatArray, IntArray
from study.counting import counted
from study.motion.readers.source import LARGEST, NUMBER, Source, number

ByteArray = NDArray[np.uint8]
WordArray = NDArray[np.uint64]

_LINE = re.compile(rb"[^\r\n]+")
_WORD = re.compile(rb"\S+")

# Chunks of about this many bytes keep the arrays between the steps in the processor's cache.
_CHUNK = 200_000
# Blanks put before a chunk, so that the 16 bytes up to the end of any word lie within it.
_LEAD = 17

_EACH = np.uint64(0x0101010101010101)
_ZEROS = np.uint64(ord("0")) * _EACH
_POINTS = np.uint64(ord(".")) * _EACH
# Powers of ten up to this one are doubles without rounding.
_EXACT = 22
_TEN_POWERS = np.array([float(10**n) for n in range(_EXACT + 1)])
# Keeps the last n of the 8 bytes of a word (the highest ones: words are read as little-endian).
_LAST = np.array([0] + [((1 << (8 * n)) - 1) << (64 - 8 * n) for n in range(1, 9)], dtype=np.uint64)


def parse_table(source: Source, offset: int, columns: int) -> FloatArray:
    """The rows from a byte offset to the end of the file, `(rows, columns)`; blank lines don't count.

    Raises
    ------
    MotionFileError
        Where a row has another number of values, or one of them is not a number up to `LARGEST`.
    """
    if columns == 0:
        raise source.error(offset, "Expected at least one channel in the hierarchy, found none: nothing moves.")
    line_end = b"\n" if source.raw.find(b"\n", offset) >= 0 else b"\r"
    tables: list[FloatArray] = []
    at = offset
    while at < len(source.raw):
        stop = source.raw.find(line_end, min(at + _CHUNK, len(source.raw)))
        stop = len(source.raw) if stop < 0 else stop
        table = _parse_rows(source.raw[at:stop], columns)
        if table is None:
            return _parse_slowly(source, offset, columns)
        tables.append(table)
        at = stop
    if not sum(map(len, tables)):
        raise source.error(len(source.raw.rstrip()), "Expected data rows after 'Frame Time:', found none.")
    return np.concatenate(tables)


def _parse_rows(chunk: bytes, columns: int) -> FloatArray | None:
    """Whole lines as rows `(rows, columns)`; None where anything is wrong."""
    data, starts, stops = split_words(chunk)
    line_ends = np.flatnonzero((data == ord("\n")) | (data == ord("\r")))
    per_line = np.diff(np.concatenate([[0], np.searchsorted(starts, line_ends), [len(starts)]]))
    if not np.all((per_line == columns) | (per_line == 0)):
        return None
    values = parse_words(data, starts, stops)
    return values.reshape(-1, columns) if are_usable(values) else None


def are_usable(values: FloatArray) -> bool:
    """Whether all are numbers, up to the largest that is taken."""
    return bool(np.all(np.abs(values) <= LARGEST))


def split_words(chunk: bytes) -> tuple[ByteArray, IntArray, IntArray]:
    """The bytes with blanks around them, and where each word in them starts and stops."""
    data = np.frombuffer(b" " * _LEAD + chunk + b" ", dtype=np.uint8)
    blank = data <= ord(" ")
    edges = np.flatnonzero(blank[1:] != blank[:-1]) + 1
    return data, edges[::2], edges[1::2]


def parse_words(data: ByteArray, starts: IntArray, stops: IntArray) -> FloatArray:
    """The numbers in words of `split_words`; NaN for a word that is not a finite number.

    Parameters
    ----------
    data : (bytes,)
        Bytes with at least 17 blanks before the first word.
    starts, stops : (words,)
        The words, as slices of `data`.
    """
    # Any eight bytes in a row, as one word of 64 bits whose highest byte is the last character.
    eights: WordArray = np.ndarray((len(data) - 7,), dtype="<u8", buffer=data, strides=(1,))
    signs = data[starts]
    negative = signs == ord("-")
    begins = starts + (negative | (signs == ord("+")))
    values = _decimals(eights, begins, stops, np.zeros(1, dtype=np.int64))
    for digits in (2, 3):
        odd = np.flatnonzero(np.isnan(values))
        if len(odd):
            values[odd] = _with_exponent(data, eights, begins[odd], stops[odd], digits)
    np.negative(values, out=values, where=negative)
    for k in np.flatnonzero(np.isnan(values)):
        word = data[starts[k] : stops[k]].tobytes()
        if NUMBER.fullmatch(word) and np.isfinite(value := float(word)):
            values[k] = value
    return values


def _with_exponent(data: ByteArray, eights: WordArray, begins: IntArray, stops: IntArray, digits: int) -> FloatArray:
    """Numbers such as `5.1e-06`, with an exponent of `digits` digits; NaN for anything else."""
    marks = stops - digits - 2
    tens = data[stops[:, None] - np.arange(digits, 0, -1)].astype(np.int64) - ord("0")
    exponents = tens @ 10 ** np.arange(digits - 1, -1, -1)
    signs = data[marks + 1]
    exponents = np.where(signs == ord("-"), -exponents, exponents)
    fits = (data[marks] | 0x20 == ord("e")) & ((signs == ord("-")) | (signs == ord("+")))
    fits &= np.all((tens >= 0) & (tens <= 9), axis=1) & (marks > begins)
    return np.where(fits, _decimals(eights, begins, np.where(fits, marks, stops), exponents), np.nan)


def _decimals(eights: WordArray, begins: IntArray, stops: IntArray, exponents: IntArray) -> FloatArray:
    """Unsigned decimals times powers of ten `(words,)` or `(1,)`; NaN where they are anything else, or not exact."""
    lengths = stops - begins
    whole, decimals, valid = _short(eights[stops - 8] & _LAST[np.minimum(lengths, 8)], lengths)
    longer = np.flatnonzero((lengths > 8) & (lengths <= 16))
    if len(longer):
        ends, more = stops[longer], lengths[longer]
        high = eights[ends - 16] & _LAST[more - 8]
        whole[longer], decimals[longer], valid[longer] = _long(high, eights[ends - 8], more)
    powers = exponents - decimals
    valid &= np.abs(powers) <= _EXACT
    numbers = whole.astype(np.float64)
    values = numbers / _TEN_POWERS[np.clip(-powers, 0, _EXACT)]
    if exponents.any():
        values = np.where(powers > 0, numbers * _TEN_POWERS[np.clip(powers, 0, _EXACT)], values)
    return np.where(valid, values, np.nan)


def _short(words: WordArray, lengths: IntArray) -> tuple[WordArray, IntArray, BoolArray]:
    """Decimals of at most 8 characters: their digits as a whole number, how many are decimals, and validity."""
    words, decimals, found = _without_point(words)
    counts = lengths - found
    words, valid = _filled(words, np.clip(counts, 0, 8))
    return _whole(words), decimals, valid & (counts >= 1) & (lengths <= 8)


def _long(high: WordArray, low: WordArray, lengths: IntArray) -> tuple[WordArray, IntArray, BoolArray]:
    """The same for decimals of 9 to 16 characters, the last 8 of them in `low`."""
    low, decimals, found = _without_point(low)
    moved, more, found_high = _without_point(high)
    # Without a point in it, the low word has room for the high word's last digit.
    low = np.where(found, low | (high >> np.uint64(56)), low)
    high = np.where(found, high << np.uint64(8), moved)
    decimals = np.where(found, decimals, np.where(found_high, more + 8, 0))
    counts = lengths - (found | found_high)
    low, valid = _filled(low, np.minimum(counts, 8))
    high, valid_high = _filled(high, np.clip(counts - 8, 0, 8))
    whole = _whole(high) * np.uint64(10**8) + _whole(low)
    return whole, decimals, valid & valid_high & (counts <= 15)


def _without_point(words: WordArray) -> tuple[WordArray, IntArray, BoolArray]:
    """Words with the point taken out and the characters before it moved up, digits behind it, and where one was."""
    differing = words ^ _POINTS
    # The usual test for a zero byte; only bytes above a true hit can be false ones, so the lowest is kept.
    hits = (differing - _EACH) & ~differing & (np.uint64(0x80) * _EACH)
    point = (hits & (~hits + np.uint64(1))) >> np.uint64(7)
    found = point != 0
    before = point - np.uint64(1)
    # A power of two as a double has its logarithm in its exponent: 8 times the byte's number.
    byte = ((point.astype(np.float64).view(np.int64) >> 52) - 1023) >> 3
    after = words & ~(before | (point * np.uint64(0xFF)))
    return (
        np.where(found, after | ((words & before) << np.uint64(8)), words),
        np.where(found, 7 - byte, 0),
        found,
    )


def _filled(words: WordArray, counts: IntArray) -> tuple[WordArray, BoolArray]:
    """Words of `counts` characters with zeros before them, and whether all the characters are digits."""
    words = words | (_ZEROS & ~_LAST[counts])
    high_halves = np.uint64(0xF0) * _EACH
    valid = ((words & high_halves) == _ZEROS) & (((words + np.uint64(0x06) * _EACH) & high_halves) == _ZEROS)
    return words, valid


def _whole(words: WordArray) -> WordArray:
    """The number that eight digits spell: pairs of digits to numbers, pairs of these, and once more."""
    words = ((words & (np.uint64(0x0F) * _EACH)) * np.uint64(10 * 2**8 + 1)) >> np.uint64(8)
    words = ((words & np.uint64(0x00FF00FF00FF00FF)) * np.uint64(100 * 2**16 + 1)) >> np.uint64(16)
    return ((words & np.uint64(0x0000FFFF0000FFFF)) * np.uint64(10000 * 2**32 + 1)) >> np.uint64(32)


def _parse_slowly(source: Source, offset: int, columns: int) -> FloatArray:
    """The same as `parse_table`, word by word: finds what is wrong and where."""
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
    return np.array(rows)
