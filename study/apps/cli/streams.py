"""The standard streams: any text in any encoding, a reader who leaves, a disk that is full."""

from __future__ import annotations

import codecs
import io
import os
import sys
from contextlib import suppress
from typing import TextIO

from study.files import refused


def show(text: str, stream: TextIO | None) -> None:
    """Print to a standard stream, which may be closed; not by click, which writes UTF-8 where ASCII is asked for."""
    if stream is None:
        return
    try:
        print(text, file=stream, flush=True)
    except BrokenPipeError:
        raise
    except OSError as error:
        hush()
        if stream is sys.stdout:  # without its messages a verb does its work all the same
            raise refused(error, "standard output") from error


def hush() -> None:
    """Lead streams that take nothing any more nowhere, so that Python does not complain at its end."""
    for stream in filter(None, (sys.stdout, sys.stderr)):
        try:
            stream.flush()
        except (OSError, ValueError):
            with suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


_PLAIN = {
    "\N{MINUS SIGN}": "-", "\N{EN DASH}": "-", "\N{EM DASH}": "-", "\N{NO-BREAK SPACE}": " ",
    "\N{MULTIPLICATION SIGN}": "x", "\N{PLUS-MINUS SIGN}": "+/-", "\N{SUPERSCRIPT TWO}": "2",
    "\N{LEFT SINGLE QUOTATION MARK}": "'", "\N{RIGHT SINGLE QUOTATION MARK}": "'",
    "\N{LEFT DOUBLE QUOTATION MARK}": '"', "\N{RIGHT DOUBLE QUOTATION MARK}": '"',
    "\N{HORIZONTAL ELLIPSIS}": "...", "\N{RIGHTWARDS ARROW}": "->",
    "\N{LESS-THAN OR EQUAL TO}": "<=", "\N{GREATER-THAN OR EQUAL TO}": ">=", "\N{INFINITY}": "inf",
}  # fmt: skip


def print_in_any_encoding() -> None:
    """Make the standard streams take every text: what their encoding lacks becomes a plain sign, or a number."""

    def plain(error: UnicodeError) -> tuple[str | bytes, int]:
        assert isinstance(error, UnicodeEncodeError), "streams are written to"
        sign = error.object[error.start]
        if sign in _PLAIN:
            return _PLAIN[sign], error.start + 1
        one = UnicodeEncodeError(error.encoding, error.object, error.start, error.start + 1, error.reason)
        return codecs.backslashreplace_errors(one)

    codecs.register_error("segue", plain)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="segue")
