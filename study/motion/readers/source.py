"""The bytes of a motion file, its numbers, and refusals that say where in it: `walk.bvh:41:7`.

Lines end with LF, CRLF or CR; a byte order mark is passed over; lines and columns count from 1.
"""

from __future__ import annotations

import codecs
import re
import warnings
from dataclasses import dataclass
from pathlib import Path

from study.errors import MotionFileError, MotionWarning
from study.motion.readers.other_formats import by_beginning

_LINE_END = re.compile(rb"\r\n|\r|\n")
# A number as motion files write it; Python's own reading would also take `1_000`, `nan` and `inf`.
NUMBER = re.compile(rb"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")

LARGEST = 1e9
"""The largest number that is taken: in millimetres a thousand kilometres. What is computed from it can't overflow."""


@dataclass(frozen=True, eq=False)
class Source:
    """A text file in memory."""

    path: Path
    """Where it came from, for messages."""
    raw: bytes
    """Its bytes, UTF-8 or another superset of ASCII."""

    def error(self, offset: int, message: str) -> MotionFileError:
        """The refusal of what is at a byte offset; to be raised by the caller."""
        before = self.raw[:offset]
        ends = list(_LINE_END.finditer(before))
        start = ends[-1].end() if ends else 0
        column = len(before[start:].decode("utf-8", "replace")) + 1
        return MotionFileError(message, self.path, len(ends) + 1, column)

    def warn(self, message: str) -> None:
        """Warn of what was read otherwise than the file says."""
        warnings.warn(f"{self.path}: {message}", MotionWarning, stacklevel=3)

    def text(self, start: int, stop: int) -> str:
        """A piece of the file as text, for names and messages."""
        return self.raw[start:stop].decode("utf-8", "replace").lstrip("\ufeff")


def read_raw(path: Path | str, kind: str) -> bytes:
    """The bytes of the file at `path`, which should be of a `kind`, such as `"a BVH file"`.

    Raises
    ------
    MotionFileError
        Where the file can't be read.
    """
    try:
        return Path(path).read_bytes()
    except OSError as problem:
        reason = problem.strerror or type(problem).__name__
        raise MotionFileError(
            f"Expected {kind}, but it can't be read ({reason}). Check the path and its permissions.", path
        ) from problem


def read_source(path: Path | str, kind: str) -> Source:
    """The file at `path`; refused where it can't be read, is empty, or is not text.

    Parameters
    ----------
    path
        The file.
    kind
        What it should be, for messages: `"a BVH file"`.
    """
    path, raw = Path(path), read_raw(path, kind)
    for mark, encoding in ((codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16")):
        if raw.startswith(mark):
            raw = raw.decode(encoding, "replace").encode()
    if raw.startswith(codecs.BOM_UTF8):
        # Blanks in its place keep every offset; the column of line 1 is then counted with them, so cut instead.
        raw = raw[len(codecs.BOM_UTF8) :]
    if not raw.strip():
        raise MotionFileError(f"Expected {kind}, but the file is empty. Copy or download it again.", path)
    if found := by_beginning(raw):
        raise MotionFileError(f"Expected {kind}, {found}", path)
    if b"\0" in raw[:4096] or b"\0" in raw:
        raise MotionFileError(f"Expected {kind}, which is text, but found binary data. Check what the file is.", path)
    return Source(path, raw)


def number(source: Source, token: bytes, offset: int, what: str) -> float:
    """One number, or the refusal that names its place."""
    if NUMBER.fullmatch(token):
        value = float(token)
        if abs(value) <= LARGEST:
            return value
        raise source.error(offset, f"Expected {what} of at most {LARGEST:.0e}, found {shown(token)}. Check the line.")
    hint = "Check the line."
    if b"," in token:
        hint = "Write decimals with a point and separate numbers by blanks."
    elif re.fullmatch(rb"[+-]?nan.*|[+-]?inf.*", token, re.IGNORECASE):
        hint = "The frame holds no measurement: export again, or cut it out."
    elif len(re.findall(rb"\.", token)) > 1 or re.fullmatch(rb".*[\d.][+-]\d.*", token):
        hint = "Two numbers seem to be glued together: put a blank between them."
    raise source.error(offset, f"Expected {what}, found {shown(token)}. {hint}")


def whole_number(source: Source, token: bytes, offset: int, what: str) -> int:
    """One whole number from 0, or the refusal that names its place."""
    if token.isdigit() and len(token.lstrip(b"0")) < len(f"{LARGEST:.0f}"):
        return int(token)
    raise source.error(offset, f"Expected {what}, a whole number below {LARGEST:.0e}, found {shown(token)}.")


def shown(token: bytes) -> str:
    """A word of the file in quotes, as messages give it: not more than its beginning."""
    return repr(token.decode("utf-8", "replace")[:40])
