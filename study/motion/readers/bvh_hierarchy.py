"""The tree of joints at the head of a BVH file: names, offsets and channels, in the file's unit."""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass, field

import numpy as np

from study.arrays import FloatArray
from study.motion.readers.source import Source, number, shown, whole_number
from study.motion.skeleton import MOST_JOINTS

_CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")
_CANONICAL = {name.lower(): name for name in _CHANNELS}
_TOKEN = re.compile(rb"[{}]|[^\s{}]+")
_NAME = re.compile(rb"[^{}\r\n]*")
_LONGEST_NAME = 1000
_MOST_CHANNELS = 12


@dataclass
class Joint:
    """A joint while the hierarchy is read; offsets in the file's unit."""

    name: str
    parent: int
    start: int
    offset: FloatArray | None = None
    channels: tuple[str, ...] = ()
    first_column: int = 0

    def columns(self, kind: str) -> list[tuple[int, str]]:
        """(column, axis letter) of each position or rotation channel, in the file's order."""
        return [(self.first_column + k, c[0]) for k, c in enumerate(self.channels) if c.endswith(kind)]


@dataclass
class Hierarchy:
    """The joints, end sites and columns that have been read."""

    joints: list[Joint] = field(default_factory=list)
    ends: list[tuple[int, FloatArray]] = field(default_factory=list)
    columns: int = 0


class _Tokens:
    """The words and braces of the hierarchy, one ahead."""

    def __init__(self, source: Source) -> None:
        self.source, self.offset = source, 0

    def next(self, expected: str) -> tuple[bytes, int]:
        """The next token and where it starts."""
        found = _TOKEN.search(self.source.raw, self.offset)
        if found is None:
            raise self.source.error(
                len(self.source.raw.rstrip()), f"Expected {expected}, found the end of the file. Copy it again."
            )
        self.offset = found.end()
        return found.group(), found.start()

    def name(self) -> str:
        """The rest of the line up to a brace: names may hold blanks."""
        line = _NAME.match(self.source.raw, self.offset)
        assert line is not None  # the pattern matches nothing as well
        self.offset = line.end()
        return " ".join(self.source.text(line.start(), line.end()).split())

    def word(self, expected: str) -> None:
        token, start = self.next(expected)
        if token.upper() != expected.encode().upper():
            raise self.source.error(start, f"Expected {expected}, found {shown(token)}.")

    def number(self, what: str) -> float:
        token, start = self.next(what)
        return number(self.source, token, start, what)


def read_hierarchy(source: Source) -> tuple[Hierarchy, int]:
    """The joints, and the offset just behind the word MOTION."""
    tokens = _Tokens(source)
    token, start = tokens.next("HIERARCHY")
    if token.upper() != b"HIERARCHY":
        raise source.error(start, f"Expected HIERARCHY at the start of a BVH file, found {shown(token)}.")
    hierarchy = Hierarchy()
    open_joints: list[int] = []
    while True:
        token, start = tokens.next("JOINT, End Site, '}' or MOTION")
        word = token.upper()
        if word == b"MOTION":
            if open_joints:
                name = hierarchy.joints[open_joints[-1]].name
                raise source.error(start, f"Expected '}}' to close joint {name!r} before MOTION. Balance the braces.")
            if not hierarchy.joints:
                raise source.error(start, "Expected ROOT and its joints before MOTION, found none.")
            return hierarchy, tokens.offset
        if word == b"}":
            if not open_joints:
                raise source.error(start, "Expected MOTION, found a '}' that closes nothing. Balance the braces.")
            _closed(source, hierarchy.joints[open_joints.pop()], start)
        elif word == b"ROOT" or (word == b"JOINT" and open_joints):
            if word == b"ROOT" and hierarchy.joints:
                raise source.error(start, "Expected one ROOT, found a second. Put each body into a file of its own.")
            open_joints.append(_open_joint(tokens, hierarchy, start, open_joints))
        elif word == b"END" and open_joints:
            _read_end(tokens, hierarchy, open_joints[-1])
        elif word in (b"OFFSET", b"CHANNELS") and open_joints:
            _read_property(tokens, hierarchy, hierarchy.joints[open_joints[-1]], word, start)
        else:
            expected = "OFFSET, CHANNELS, JOINT, End Site or '}'" if open_joints else "ROOT or MOTION"
            raise source.error(start, f"Expected {expected}, found {shown(token)}.")


def _open_joint(tokens: _Tokens, hierarchy: Hierarchy, start: int, open_joints: list[int]) -> int:
    name = tokens.name()
    if not name:
        raise tokens.source.error(start, "Expected a name after ROOT or JOINT, found none.")
    if len(name) > _LONGEST_NAME:
        raise tokens.source.error(
            start, f"Expected a name of at most {_LONGEST_NAME} letters, found {len(name)}. Check the line."
        )
    if len(hierarchy.joints) == MOST_JOINTS:
        raise tokens.source.error(
            start, f"Expected at most {MOST_JOINTS} joints, found more. Leave out what is no part of the body."
        )
    tokens.word("{")
    hierarchy.joints.append(Joint(name, open_joints[-1] if open_joints else -1, start))
    return len(hierarchy.joints) - 1


def _closed(source: Source, joint: Joint, start: int) -> None:
    if joint.offset is None:
        raise source.error(start, f"Expected an OFFSET in joint {joint.name!r} before its '}}'.")


def _read_end(tokens: _Tokens, hierarchy: Hierarchy, joint: int) -> None:
    tokens.name()  # `Site`, or whatever the tool calls it
    tokens.word("{")
    tokens.word("OFFSET")
    name = hierarchy.joints[joint].name
    hierarchy.ends.append((joint, np.array([tokens.number(f"a length in the End Site of {name!r}") for _ in range(3)])))
    tokens.word("}")


def _read_property(tokens: _Tokens, hierarchy: Hierarchy, joint: Joint, word: bytes, start: int) -> None:
    source = tokens.source
    if (joint.offset is not None) if word == b"OFFSET" else bool(joint.channels):
        raise source.error(start, f"Expected one {word.decode()} in joint {joint.name!r}, found a second.")
    if word == b"OFFSET":
        joint.offset = np.array([tokens.number(f"a length in the OFFSET of {joint.name!r}") for _ in range(3)])
        return
    token, at = tokens.next("the number of channels")
    count = whole_number(source, token, at, f"the number of channels of {joint.name!r}")
    if count > _MOST_CHANNELS:
        raise source.error(at, f"Expected at most {_MOST_CHANNELS} channels in {joint.name!r}, found {count}.")
    channels: list[str] = []
    for k in range(count):
        token, at = tokens.next("a channel name")
        channels.append(_channel(source, token, at, f"channel {k + 1} of {joint.name!r}"))
        if channels[-1].endswith("position") and channels.count(channels[-1]) > 1:
            raise source.error(
                at, f"Expected each position channel once in {joint.name!r}, found {channels[-1]} twice."
            )
    joint.channels, joint.first_column = tuple(channels), hierarchy.columns
    hierarchy.columns += len(channels)


def _channel(source: Source, token: bytes, offset: int, what: str) -> str:
    name = _CANONICAL.get(token.decode("utf-8", "replace").lower())
    if name is None:
        near = difflib.get_close_matches(token.decode("utf-8", "replace"), _CHANNELS, n=1)
        hint = f" Did you mean {near[0]}?" if near else ""
        raise source.error(offset, f"Expected {what} to be one of {', '.join(_CHANNELS)}, found {shown(token)}.{hint}")
    return name
