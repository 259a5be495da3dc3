"""Acclaim skeletons (ASF): bones, their axes and degrees of freedom, and the tree that they form."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from study.arrays import FloatArray, IntArray
from study.counting import counted
from study.motion import quaternions as quat
from study.motion.readers.source import Source, number, shown
from study.motion.skeleton import MOST_JOINTS

LINE = re.compile(rb"[^\r\n]+")
_WORD = re.compile(rb"[^\s()]+")
_DOFS = ("tx", "ty", "tz", "rx", "ry", "rz", "l")
ROOT = "root"
# Shorter directions and units of length are zero except for rounding.
_SMALLEST = 1e-9
_Words = list[tuple[bytes, int]]


@dataclass
class Bone:
    """A bone of an ASF; lengths in the file's unit, angles in radians."""

    name: str
    start: int
    direction: FloatArray = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axis: FloatArray = field(default_factory=lambda: quat.IDENTITY)
    dofs: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Body:
    """An ASF: bones with the root first and parents before children."""

    path: Path
    bones: tuple[Bone, ...]
    parents: IntArray
    root_position: FloatArray
    length_unit: float
    degrees: bool


def _sections(source: Source) -> Iterator[tuple[str, int, list[_Words]]]:
    """Each `:section` of an ASF with the words of its lines, the heading's own words first; without comments."""
    heading: tuple[str, int] | None = None
    lines: list[_Words] = []
    for line in LINE.finditer(source.raw):
        words = [(w.group(), w.start()) for w in _WORD.finditer(source.raw, line.start(), line.end())]
        if not words or words[0][0].startswith(b"#"):
            continue
        if words[0][0].startswith(b":"):
            if heading:
                yield *heading, lines
            heading, lines = (words[0][0][1:].decode("utf-8", "replace").lower(), words[0][1]), []
            words = words[1:]
        elif heading is None:
            raise source.error(words[0][1], f"Expected a section such as :units, found {shown(words[0][0])}.")
        if words:
            lines.append(words)
    if heading:
        yield *heading, lines


def read_asf(source: Source) -> Body:
    """The skeleton of an ASF file; refused, with line and column, where it is incomplete."""
    sections: dict[str, tuple[int, list[_Words]]] = {}
    for name, start, lines in _sections(source):
        sections[name] = (start, lines)
    for name in ("root", "bonedata", "hierarchy"):
        if name not in sections:
            raise source.error(
                len(source.raw.rstrip()), f"Expected a section :{name} in an ASF file, found none. Copy it again."
            )
    length_unit, degrees = _read_units(source, sections.get("units", (0, []))[1])
    root, root_position = _read_root(source, *sections["root"], degrees)
    bones = {root.name: root}
    for lines in _blocks(source, *sections["bonedata"]):
        bone = _read_bone(source, lines, degrees)
        if bone.name in bones:
            raise source.error(bone.start, f"Expected each bone once, found {bone.name!r} again.")
        bones[bone.name] = bone
        if len(bones) > MOST_JOINTS:
            raise source.error(bone.start, f"Expected at most {MOST_JOINTS} bones, found more.")
    order, parents = _read_hierarchy(source, *sections["hierarchy"], bones)
    if not any(bone.dofs for bone in bones.values()):
        raise source.error(
            root.start,
            "Expected a degree of freedom in the root's order or a bone's dof, found none: nothing moves.",
        )
    return Body(source.path, tuple(bones[n] for n in order), parents, root_position, length_unit, degrees)


def _read_units(source: Source, lines: list[_Words]) -> tuple[float, bool]:
    length, degrees = 1.0, True
    for words in lines:
        key = words[0][0].lower()
        if key == b"length":
            (length,) = _numbers(source, words, 1, "the length unit")
            if length < _SMALLEST:
                raise source.error(words[1][1], f"Expected a length unit above 0, found {length:g}.")
        elif key == b"angle":
            unit = words[1][0].lower() if len(words) > 1 else b""
            if unit not in (b"deg", b"rad"):
                raise source.error(words[-1][1], f"Expected 'angle deg' or 'angle rad', found {shown(words[-1][0])}.")
            degrees = unit == b"deg"
    return length, degrees


def _read_root(source: Source, start: int, lines: list[_Words], degrees: bool) -> tuple[Bone, FloatArray]:
    root = Bone(ROOT, start, dofs=_DOFS[:6])
    position, orientation, order = np.zeros(3), np.zeros(3), "XYZ"
    for words in lines:
        key = words[0][0].lower()
        if key == b"order":
            root.dofs = _dofs(source, words[1:])
        elif key == b"axis":
            order = _axis_order(source, words, 1)
        elif key == b"position":
            position = _numbers(source, words, 3, "a coordinate of the root")
        elif key == b"orientation":
            orientation = _numbers(source, words, 3, "an angle of the root")
    root.axis = fixed_axes(order, _in_order(orientation, order), degrees)
    return root, position


def _blocks(source: Source, start: int, lines: list[_Words]) -> Iterator[list[_Words]]:
    """The lines between each `begin` and `end`."""
    block: list[_Words] | None = None
    for words in lines:
        key = words[0][0].lower()
        if key == b"begin" and block is None:
            block, start = [], words[0][1]
        elif key == b"end" and block is not None:
            yield block
            block = None
        elif block is None or key == b"begin":
            raise source.error(words[0][1], f"Expected {'end' if block else 'begin'}, found {shown(words[0][0])}.")
        else:
            block.append(words)
    if block is not None:
        raise source.error(start, "Expected an 'end' for this 'begin', found the end of the section.")


def _read_bone(source: Source, lines: list[_Words], degrees: bool) -> Bone:
    entries = {words[0][0].lower(): words for words in lines}
    start = lines[0][0][1] if lines else 0
    for key in (b"name", b"direction", b"length"):
        if key not in entries or len(entries[key]) < 2:
            raise source.error(start, f"Expected a {key.decode()} in each bone, found none in this one.")
    name = entries[b"name"][1][0].decode("utf-8", "replace")
    bone = Bone(name, entries[b"name"][1][1])
    bone.direction = _numbers(source, entries[b"direction"], 3, f"the direction of {name!r}")
    size = float(np.linalg.norm(bone.direction))
    if size < _SMALLEST:
        raise source.error(entries[b"direction"][1][1], f"Expected a direction of {name!r} that is not zero.")
    bone.direction = bone.direction / size
    (bone.length,) = _numbers(source, entries[b"length"], 1, f"the length of {name!r}")
    if b"axis" in entries:
        angles = _numbers(source, entries[b"axis"], 3, f"the axis of {name!r}")
        order = _axis_order(source, entries[b"axis"], 4)
        bone.axis = fixed_axes(order, _in_order(angles, order), degrees)
    if b"dof" in entries:
        bone.dofs = _dofs(source, entries[b"dof"][1:])
    return bone


def _read_hierarchy(
    source: Source, start: int, lines: list[_Words], bones: dict[str, Bone]
) -> tuple[list[str], IntArray]:
    """Bone names depth first, and the index of each one's parent."""
    children: dict[str, list[str]] = {}
    seen = {ROOT}
    for words in (w for block in _blocks(source, start, lines) for w in block):
        for word, at in words:
            name = word.decode("utf-8", "replace")
            if name not in bones:
                raise source.error(at, f"Expected a bone of :bonedata, found {name!r}.")
            if at == words[0][1]:
                parent = name
                continue
            if name in seen:
                raise source.error(at, f"Expected each bone to have one parent, found a second one for {name!r}.")
            seen.add(name)
            children.setdefault(parent, []).append(name)
    order: list[str] = []
    parents: list[int] = []
    stack = [(ROOT, -1)]
    while stack:
        name, parent_index = stack.pop()
        order.append(name)
        parents.append(parent_index)
        stack += [(child, len(order) - 1) for child in reversed(children.get(name, []))]
    if lost := bones.keys() - set(order):
        first = min(lost, key=lambda name: bones[name].start)
        raise source.error(bones[first].start, f"Expected bone {first!r} to hang on the root in :hierarchy.")
    return order, np.array(parents, dtype=np.int64)


def _numbers(source: Source, words: _Words, count: int, what: str) -> FloatArray:
    if len(words) < count + 1:
        raise source.error(words[-1][1], f"Expected {counted(count, 'number')} for {what}, found {len(words) - 1}.")
    return np.array([number(source, word, at, what) for word, at in words[1 : count + 1]])


def _axis_order(source: Source, words: _Words, index: int) -> str:
    word, at = words[index] if len(words) > index else (b"XYZ", 0)
    order = word.decode("utf-8", "replace").upper()
    if sorted(order) != ["X", "Y", "Z"]:
        raise source.error(at, f"Expected an order of axes such as XYZ, found {shown(word)}.")
    return order


def _dofs(source: Source, words: _Words) -> tuple[str, ...]:
    dofs: list[str] = []
    for word, at in words:
        dof = word.decode("utf-8", "replace").lower()
        if dof not in _DOFS or dof in dofs:
            raise source.error(at, f"Expected degrees of freedom out of {', '.join(_DOFS)}, found {shown(word)}.")
        dofs.append(dof)
    return tuple(dofs)


def _in_order(angles: FloatArray, order: str) -> FloatArray:
    """Angles about x, y and z, in which order the file always has them, in the order of turning."""
    return angles[["XYZ".index(letter) for letter in order]]


def fixed_axes(order: str, angles: FloatArray, degrees: bool) -> FloatArray:
    """Turns about the world's axes, the first letter first: as moving axes, the same in reverse."""
    if not order:
        return np.broadcast_to(quat.IDENTITY, (*angles.shape[:-1], 4))
    return quat.from_euler(order[::-1], (np.radians(angles) if degrees else angles)[..., ::-1])
