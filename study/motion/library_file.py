"""`library.toml`: what somebody says about the motion files of a folder.

In: a folder. Out: a `LibraryFile`, the nearest `library.toml` at or above it, whose `[defaults]` hold for every file
below and whose `[clips.NAME]` name a clip each: a file, or a part of one. Keys become fields of an `Entry`
(`study.motion.entries`). What a table does not say stays as it is found.
"""

from __future__ import annotations

import difflib
import math
import os
import unicodedata
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from study.errors import MotionFileError
from study.files import read_text, write_whole
from study.motion.clip import HIGHEST_FPS, LOWEST_FPS
from study.motion.joint_names import CENTRE_ROLES, ROLES
from study.motion.units import INCH
from study.toml_text import LARGEST_TEXT, parse_toml, quoted

NAME = "library.toml"
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": INCH}
# What a file is, whichever part of it is meant: tables about one file can't disagree on these.
FACTS = ("metres_per_unit", "fps", "joints")


@dataclass(frozen=True, eq=False)
class ClipTable:
    """`[clips.NAME]`: a name, the file that it is about (as `placed` writes it), and fields of an `Entry`."""

    name: str
    file: str
    fields: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class LibraryFile:
    """A `library.toml`: where it is, the fields that hold for all files, and its tables."""

    path: Path
    defaults: Mapping[str, Any]
    tables: tuple[ClipTable, ...]

    def about(self, file: Path) -> tuple[ClipTable, ...]:
        """The tables about a file of the folder.

        Raises
        ------
        MotionFileError
            Where two of them say different things of one file: its unit, frame rate or joints.
        """
        place = placed(file, self.path.parent)
        tables = tuple(table for table in self.tables if table.file == place)
        for field in FACTS:
            said = {repr(table.fields[field]): table.name for table in tables if field in table.fields}
            if len(said) > 1:
                one, other = list(said.values())[:2]
                raise MotionFileError(
                    f"Expected the same unit, fps and joints in all tables about {place}, found different ones in "
                    f"[clips.{one!r}] and [clips.{other!r}]. They are facts about the file: make them alike.",
                    self.path,
                )
        return tables


def composed(text: str) -> str:
    """A name with accents as one letter each (Unicode NFC), as people type it; some systems store them apart."""
    return unicodedata.normalize("NFC", text)


def absolute(path: Path) -> Path:
    """A path from the root of the disk, without `..`; links stay as the user wrote them."""
    return Path(os.path.normpath(path.absolute()))


def placed(file: Path, folder: Path) -> str:
    """A file as seen from a folder, with `/`, accents composed."""
    return composed(file.relative_to(folder).as_posix())


def find_library_file(folder: Path) -> LibraryFile | None:
    """The nearest `library.toml` at or above a folder, read; None where there is none."""
    for above in (folder, *folder.parents):
        if (above / NAME).is_file():
            return read_library_file(above / NAME)
    return None


def read_library_file(path: Path) -> LibraryFile:
    """Read a `library.toml`.

    Raises
    ------
    FileError
        For what can't be read, or is no TOML.
    MotionFileError
        For unknown keys (with the nearest one), and values that can't be meant.
    """
    content = parse_toml(read_text(path, "a library.toml", LARGEST_TEXT + 1), str(path))
    _only(content, ("clips", "defaults"), "", path)
    clips = _table(content.get("clips", {}), "clips", path)
    defaults = _fields(_table(content.get("defaults", {}), "defaults", path), "defaults", tuple(_KEYS), path)
    return LibraryFile(path, defaults, tuple(_clip(name, table, path) for name, table in clips.items()))


def _clip(name: str, table: object, path: Path) -> ClipTable:
    where = f"clips.{name}" if name.isidentifier() else f'clips."{name}"'
    keys = _table(table, where, path)
    file = keys.get("file")
    _only(keys, ("file", *_KEYS), where, path)
    if not isinstance(file, str) or not file.strip():
        found = "no such key" if file is None else repr(file)
        raise MotionFileError(f'[{where}]: expected file = "..." with a file of this folder, found {found}.', path)
    place = Path(file)
    if place.is_absolute() or ".." in place.parts:
        raise MotionFileError(
            f"[{where}] file: expected a file in the folder of this library.toml or below, found {file!r}. "
            "Write its place as seen from there.",
            path,
        )
    rest = {key: value for key, value in keys.items() if key != "file"}
    return ClipTable(composed(name), composed(place.as_posix()), _fields(rest, where, tuple(_KEYS), path))


def _fields(keys: Mapping[str, object], where: str, known: Iterable[str], path: Path) -> dict[str, Any]:
    """The keys of a table as fields of an `Entry`."""
    _only(keys, known, where, path)
    fields: dict[str, Any] = {}
    for key, value in keys.items():
        convert, expected = _KEYS[key]
        try:
            fields |= convert(value)
        except (TypeError, ValueError) as problem:
            more = f" {problem}" if isinstance(problem, _SaidError) else ""
            raise MotionFileError(f"[{where}] {key}: expected {expected}, found {value!r}.{more}", path) from None
    first, last = fields.get("first_frame", 0), fields.get("last_frame")
    if last is not None and last < first:
        raise MotionFileError(f"[{where}] last_frame: expected {first} or more, found {last}.", path)
    return fields


def _table(found: object, where: str, path: Path) -> dict[str, Any]:
    if not isinstance(found, dict):
        raise MotionFileError(f"Expected [{where}] to be a table of keys, found {found!r}.", path)
    return found


def _only(keys: Mapping[str, object], known: Iterable[str], where: str, path: Path) -> None:
    for key in keys:
        if key not in (known := tuple(known)):
            near = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
            hint = f"Did you mean {near[0]!r}?" if near else f"There are {', '.join(known)}."
            raise MotionFileError(f"{f'[{where}]: ' if where else ''}unknown key {key!r}. {hint}", path)


class _SaidError(ValueError):
    """A refusal with something to add to what was expected."""


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError
    return value


def _whole(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise TypeError
    return value


def _flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise TypeError
    return value


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise TypeError
    return float(value)


def _positive(value: object) -> float:
    if (found := _number(value)) <= 0.0:
        raise ValueError
    return found


def _rate(value: object) -> float:
    if not LOWEST_FPS <= (found := _number(value)) <= HIGHEST_FPS:
        raise ValueError
    return found


def _unit(value: object) -> float:
    return UNITS[value] if isinstance(value, str) and value in UNITS else _positive(value)


def _cyclic(value: object) -> dict[str, Any]:
    sides = {True: ("gait", "gait"), False: ("", ""), "start": ("gait", ""), "end": ("", "gait")}
    if not isinstance(value, bool | str) or value not in sides:
        raise TypeError
    start, end = sides[value]
    return {"start": start, "end": end, "cyclic": value is not False}


def _beats(value: object) -> tuple[float, ...]:
    if not isinstance(value, list) or any(_number(one) < 0.0 for one in value):
        raise TypeError
    return tuple(sorted(float(one) for one in value))


def _joints(value: object) -> tuple[tuple[str, str], ...]:
    if not isinstance(value, dict) or not all(isinstance(name, str) for name in value.values()):
        raise TypeError
    for role in value:
        if role not in ROLES:
            near = difflib.get_close_matches(role, ROLES, n=1)
            raise _SaidError(f"{role!r} is no role. " + (f"Did you mean {near[0]!r}?" if near else ", ".join(ROLES)))
    limbs = [name for role, name in value.items() if role not in CENTRE_ROLES]
    if twice := sorted({name for name in limbs if limbs.count(name) > 1}):
        raise _SaidError(f"{twice[0]!r} is named for two roles of limbs; name one joint for each.")
    return tuple(value.items())


# Each key: what it becomes, and what it may be, in words.
_KEYS: Mapping[str, tuple[Callable[[object], dict[str, Any]], str]] = {
    "first_frame": (lambda v: {"first_frame": _whole(v)}, "a frame number from 0"),
    "last_frame": (lambda v: {"last_frame": _whole(v)}, "a frame number from 0"),
    "mirror": (lambda v: {"mirrored": _flag(v)}, "true or false"),
    "unit": (lambda v: {"metres_per_unit": _unit(v)}, 'metres in a unit of the file, or "m", "cm", "mm" or "in"'),
    "fps": (lambda v: {"fps": _rate(v)}, f"frames per second from {LOWEST_FPS:.1g} to {HIGHEST_FPS:g}"),
    "cyclic": (_cyclic, 'true, false, "start" or "end"'),
    "category": (lambda v: {"kind": _text(v)}, "text in quotes"),
    "beats": (lambda v: {"beats": _beats(v)}, "a list of times in seconds, such as [0.5, 1.0]"),
    "genre": (lambda v: {"genre": _text(v)}, "text in quotes"),
    "joints": (lambda v: {"joints": _joints(v)}, 'a table of role to joint name, such as {"ankle.L" = "L_Ankle"}'),
}


_FIRST_LINES = """# What Segue is told of the motion files in this folder and below; see docs/libraries.md.
# A clip needs its file alone; every other key is optional.
#
#   file = "..."           the motion file, as seen from here; several clips may come from one file
#   first_frame, last_frame  the part that is the clip; both included, counted from 0 at the file's rate
#   mirror = true          left and right exchanged
#   unit = "cm"            length unit of the file: "m", "cm", "mm", "in", or metres in a unit
#   fps = 120              frames per second, where the file does not say it, or says it wrong
#   cyclic = true          steps that can be continued: true, false, "start" or "end"
#   category = "walking"   what kind of motion it is
#   beats = [0.5, 1.0]     times of the music's beats, seconds from the file's first frame
#   genre = "ballet"       what kind of dance it is
#   joints = {"ankle.L" = "L_Ankle"}  which joint plays a role, where Segue finds another
#
# Keys in [defaults] hold for all files.

[defaults]
"""


def write_library_file(folder: Path, tables: Iterable[tuple[str, str, str, str]]) -> Path:
    """Write a first `library.toml` into a folder: tables of a name, a file, a category (or `""`) and a comment.

    Raises
    ------
    MotionFileError
        Where the folder has one already.
    FileError
        Where it can't be written.
    """
    path = folder / NAME
    if path.exists():
        raise MotionFileError(
            "Expected a folder without library.toml, found one. It is never overwritten: add to it, or move it away.",
            path,
        )
    lines = [_FIRST_LINES]
    for name, file, category, comment in tables:
        comment = "".join(letter if letter.isprintable() else " " for letter in comment)
        lines += [f"[clips.{quoted(name)}]  # {comment}", f"file = {quoted(file)}"]
        lines += [f"category = {quoted(category)}", ""] if category else [""]
    write_whole(path, "\n".join(lines))
    return path
