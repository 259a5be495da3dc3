"""Acclaim skeletons (ASF) and motions (AMC), as the CMU database has them, to clips.

A bone starts where its parent ends, and its rotation `C M C^-1` (C from the bone's `axis`, M from its degrees of
freedom) is taken in the world's axes: with all rotations identity the body stands in the ASF's rest pose. So each bone
is a joint at its start (`lfemur` is the hip), and the tip of a bone without children an end site. Both kinds of
angles turn about fixed axes in the order listed: `XYZ` is `Z Y X` as a product of matrices.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from study.counting import counted
from study.errors import MotionFileError, MotionWarning
from study.motion import quaternions as quat
from study.motion.clip import Clip, refuse_large, with_roles
from study.motion.digits import ByteArray, IntArray, are_usable, parse_words, split_words
from study.motion.skeleton import MOST_JOINTS, Skeleton
from study.motion.source import Source, number, read_source, shown, whole_number
from study.motion.units import INCH, find_scale

FloatArray = NDArray[np.float64]

_LINE = re.compile(rb"[^\r\n]+")
_WORD = re.compile(rb"[^\s()]+")
_DOFS = ("tx", "ty", "tz", "rx", "ry", "rz", "l")
_ROOT = "root"
# Shorter directions and units of length are zero but for rounding.
_SMALLEST = 1e-9

CMU_FPS = 120.0


@dataclass
class _Bone:
    """A bone of an ASF; lengths in the file's unit, angles in radians."""

    name: str
    start: int
    direction: FloatArray = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    axis: FloatArray = field(default_factory=lambda: quat.IDENTITY)
    dofs: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Body:
    """An ASF: bones with the root first and parents before children."""

    path: Path
    bones: tuple[_Bone, ...]
    parents: NDArray[np.int64]
    root_position: FloatArray
    length_unit: float
    degrees: bool


def read_amc(
    path: Path | str,
    *,
    asf: Path | str | None = None,
    fps: float = CMU_FPS,
    metres_per_unit: float | None = None,
    mapping: Mapping[str, str] | None = None,
) -> Clip:
    """Read an AMC motion with its ASF skeleton.

    Parameters
    ----------
    path
        The `.amc` file.
    asf
        The skeleton; by default `16.asf` beside `16_15.amc`, else the only `.asf` in the folder.
    fps
        Frames per second, which the files don't say; the CMU database was captured at 120.
    metres_per_unit
        Metres in a unit of the file. By default the ASF's `:units length` (0.45 for CMU) divides an inch, unless the
        body comes out of no human size: then the unit is found from its size.
    mapping
        Joint names by role, as `study.motion.rigs.find_roles` takes them.

    Raises
    ------
    MotionFileError
        For anything that can't be read without guessing, with line and column.

    Warns
    -----
    MotionWarning
        Where frame numbers have gaps, or bones stretch (a clip has bones of constant length).
    """
    source = read_source(path, "an AMC file")
    body = _read_asf(read_source(asf if asf is not None else _find_asf(Path(path)), "an ASF file"))
    values, degrees = _read_frames(source, body)
    return _assemble(source, body, values, degrees, fps, metres_per_unit, mapping)


def _find_asf(path: Path) -> Path:
    own = path.with_name(path.stem.rsplit("_", 1)[0] + ".asf")
    if own.is_file():
        return own
    found = sorted(p for p in path.parent.glob("*") if p.suffix.lower() == ".asf")
    if len(found) == 1:
        return found[0]
    there = ", ".join(p.name for p in found) or "none"
    raise MotionFileError(
        f"Expected its skeleton beside it as {own.name}, or a single .asf file in the folder; found {there}. "
        "Put the subject's ASF there, or name it with asf.",
        path,
    )


# -- The skeleton ---------------------------------------------------------------------------------------------------

_Words = list[tuple[bytes, int]]


def _sections(source: Source) -> Iterator[tuple[str, int, list[_Words]]]:
    """Each `:section` of an ASF with the words of its lines, the heading's own words first; comments left out."""
    heading: tuple[str, int] | None = None
    lines: list[_Words] = []
    for line in _LINE.finditer(source.raw):
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


def _read_asf(source: Source) -> _Body:
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
    return _Body(source.path, tuple(bones[n] for n in order), parents, root_position, length_unit, degrees)


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


def _read_root(source: Source, start: int, lines: list[_Words], degrees: bool) -> tuple[_Bone, FloatArray]:
    root = _Bone(_ROOT, start, dofs=_DOFS[:6])
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
    root.axis = _fixed_axes(order, _in_order(orientation, order), degrees)
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


def _read_bone(source: Source, lines: list[_Words], degrees: bool) -> _Bone:
    entries = {words[0][0].lower(): words for words in lines}
    start = lines[0][0][1] if lines else 0
    for key in (b"name", b"direction", b"length"):
        if key not in entries or len(entries[key]) < 2:
            raise source.error(start, f"Expected a {key.decode()} in each bone, found none in this one.")
    name = entries[b"name"][1][0].decode("utf-8", "replace")
    bone = _Bone(name, entries[b"name"][1][1])
    bone.direction = _numbers(source, entries[b"direction"], 3, f"the direction of {name!r}")
    size = float(np.linalg.norm(bone.direction))
    if size < _SMALLEST:
        raise source.error(entries[b"direction"][1][1], f"Expected a direction of {name!r} that is not zero.")
    bone.direction = bone.direction / size
    (bone.length,) = _numbers(source, entries[b"length"], 1, f"the length of {name!r}")
    if b"axis" in entries:
        angles = _numbers(source, entries[b"axis"], 3, f"the axis of {name!r}")
        order = _axis_order(source, entries[b"axis"], 4)
        bone.axis = _fixed_axes(order, _in_order(angles, order), degrees)
    if b"dof" in entries:
        bone.dofs = _dofs(source, entries[b"dof"][1:])
    return bone


def _read_hierarchy(
    source: Source, start: int, lines: list[_Words], bones: dict[str, _Bone]
) -> tuple[list[str], NDArray[np.int64]]:
    """Bone names depth first, and the index of each one's parent."""
    children: dict[str, list[str]] = {}
    seen = {_ROOT}
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
    stack = [(_ROOT, -1)]
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


def _fixed_axes(order: str, angles: FloatArray, degrees: bool) -> FloatArray:
    """Turns about the world's axes, the first letter first: as moving axes, the same in reverse."""
    if not order:
        return np.broadcast_to(quat.IDENTITY, (*angles.shape[:-1], 4))
    return quat.from_euler(order[::-1], (np.radians(angles) if degrees else angles)[..., ::-1])


# -- The motion -----------------------------------------------------------------------------------------------------


def _read_frames(source: Source, body: _Body) -> tuple[dict[str, FloatArray], bool]:
    """Values of each bone `(frames, dofs)` in the file's unit, and whether angles are degrees."""
    degrees, start = _read_amc_header(source, body.degrees)
    moving = {bone.name: len(bone.dofs) for bone in body.bones if bone.dofs}
    values = _parse_regular(source.raw[start:], moving)
    if values is None:
        values = _parse_slowly(source, start, moving, {bone.name for bone in body.bones}, body.path.name)
    return values, degrees


def _read_amc_header(source: Source, degrees: bool) -> tuple[bool, int]:
    """Whether the angles are degrees, and where the first frame's number starts."""
    for line in _LINE.finditer(source.raw):
        text = line.group().strip()
        if not text or text.startswith(b"#"):
            continue
        if not text.startswith(b":"):
            return degrees, line.start()
        key = text.upper()
        if key in (b":DEGREES", b":RADIANS"):
            degrees = key == b":DEGREES"
    raise source.error(len(source.raw.rstrip()), "Expected frames, found the end of the file. Copy it again.")


def _parse_regular(chunk: bytes, moving: dict[str, int]) -> dict[str, FloatArray] | None:
    """The fast way, for files whose frames all list the same bones in the same order; None for any other."""
    data, starts, stops = split_words(chunk)
    blocks, width = _first_frame(data, starts, stops, moving)
    if len(blocks) != len(moving) or len(starts) % width:
        return None
    starts, stops = starts.reshape(-1, width), stops.reshape(-1, width)
    for name, column in blocks.items():
        letters = np.frombuffer(name.encode(), dtype=np.uint8)
        at = starts[:, column]
        if not np.all(stops[:, column] - at == len(letters)):
            return None
        if not np.all(data[at[:, None] + np.arange(len(letters))] == letters):
            return None
    columns = np.setdiff1d(np.arange(width), list(blocks.values()))
    # Some hundred frames at a time stay in the processor's cache.
    pieces = [slice(first, first + 256) for first in range(0, len(starts), 256)]
    table = np.concatenate(
        [parse_words(data, starts[p][:, columns].ravel(), stops[p][:, columns].ravel()) for p in pieces]
    )
    table = table.reshape(-1, len(columns))
    if not are_usable(table) or not np.array_equal(table[:, 0], np.arange(1, len(table) + 1)):
        return None
    values: dict[str, FloatArray] = {}
    for name, column in blocks.items():
        first = int(np.searchsorted(columns, column))
        values[name] = table[:, first : first + moving[name]]
    return values


def _first_frame(
    data: ByteArray, starts: IntArray, stops: IntArray, moving: dict[str, int]
) -> tuple[dict[str, int], int]:
    """Where in a frame's words each bone's name stands, and how many words a frame has, by the first frame."""
    blocks: dict[str, int] = {}
    at = 1
    while at < len(starts):
        name = data[starts[at] : stops[at]].tobytes().decode("utf-8", "replace")
        if name not in moving or name in blocks:
            break
        blocks[name] = at
        at += 1 + moving[name]
    return blocks, at


def _parse_slowly(
    source: Source, start: int, moving: dict[str, int], known: set[str], asf: str
) -> dict[str, FloatArray]:
    """Line by line: bones in any order; finds what is wrong and where."""
    frames: list[dict[str, list[float]]] = []
    first_number = last_number = 0
    gaps = 0
    for line in _LINE.finditer(source.raw, start):
        words = [(w.group(), w.start()) for w in re.finditer(rb"\S+", line.group())]
        words = [(w, line.start() + at) for w, at in words]
        if not words or words[0][0].startswith(b"#"):
            continue
        word, at = words[0]
        if len(words) == 1 and word.isdigit():
            number_here = whole_number(source, word, at, "a frame's number")
            if frames:
                _complete(source, frames[-1], moving, last_number, at)
            gaps += bool(frames) and number_here != last_number + 1
            last_number = number_here
            first_number = first_number or last_number
            frames.append({})
            continue
        if not frames:
            raise source.error(at, f"Expected a frame number, found {shown(word)}.")
        name = word.decode("utf-8", "replace")
        if name not in known:
            raise source.error(at, f"Expected a bone of {asf}, found {shown(word)}. Use the subject's own ASF.")
        if name in frames[-1]:
            raise source.error(at, f"Expected each bone once in frame {last_number}, found {name!r} again.")
        count = moving.get(name, 0)
        if len(words) - 1 != count:
            place = words[count + 1][1] if len(words) > count + 1 else line.end()
            raise source.error(
                place,
                f"Expected {counted(count, 'value')} for {name!r} in frame {last_number}, as {asf} says, found "
                f"{len(words) - 1}.",
            )
        frames[-1][name] = [number(source, w, a, f"a value of {name!r} in frame {last_number}") for w, a in words[1:]]
    if frames:
        _complete(source, frames[-1], moving, last_number, len(source.raw.rstrip()))
    if not frames:
        raise source.error(len(source.raw.rstrip()), "Expected frames, found none.")
    if gaps:
        _warn(
            f"{source.path}: frame numbers jump {counted(gaps, 'time')} from {first_number} to {last_number}; "
            "all rows are kept"
        )
    return {name: np.array([frame[name] for frame in frames]) for name in moving}


def _complete(source: Source, frame: dict[str, list[float]], moving: dict[str, int], label: int, offset: int) -> None:
    missing = [name for name in moving if name not in frame]
    if missing:
        raise source.error(
            offset, f"Expected all bones in frame {label}, found none of {', '.join(missing)}. Copy the file again."
        )


def _assemble(
    source: Source,
    body: _Body,
    values: dict[str, FloatArray],
    degrees: bool,
    fps: float,
    metres_per_unit: float | None,
    mapping: Mapping[str, str] | None,
) -> Clip:
    bones, parents = body.bones, body.parents
    tips = np.array([bone.direction * bone.length for bone in bones])
    offsets = np.where(parents[:, None] >= 0, tips[parents], 0.0)
    names = tuple(bone.name for bone in bones)
    frames = len(next(iter(values.values())))
    refuse_large(frames, len(bones), str(source.path), sum(each.size for each in values.values()))
    rotations = np.empty((frames, len(bones), 4))
    for j, bone in enumerate(bones):
        rotations[:, j] = _rotation(bone, values.get(bone.name), frames, degrees)
        if j > 0 and bone.name in values and (stretch := _stretch(bone, values[bone.name])) > 0.0:
            _warn(
                f"{source.path}: bone {bone.name!r} shifts or stretches by up to {stretch:.4g} units, which is left out"
            )
    leaves = np.array(sorted(set(range(len(bones))) - {int(p) for p in parents}), dtype=np.int64)
    path = np.tile(body.root_position, (frames, 1))
    for k, dof in enumerate(bones[0].dofs):
        if dof[0] == "t":
            path[:, "xyz".index(dof[1])] += values[_ROOT][:, k]
    whole = Skeleton(names, parents, offsets, leaves, tips[leaves])
    whole = with_roles(Clip(whole, path, rotations, fps), mapping).skeleton
    scale, note = _scale(body, whole, metres_per_unit)
    skeleton = replace(whole, offsets=offsets * scale, end_offsets=tips[leaves] * scale)
    history = (
        f"read from {source.path.name} and {body.path.name}",
        note,
        f"taken at {fps:g} fps, which AMC files don't say",
    )
    return Clip(skeleton, path * scale, rotations, fps, name=source.path.stem, history=history, metres_per_unit=scale)


def _rotation(bone: _Bone, values: FloatArray | None, frames: int, degrees: bool) -> FloatArray:
    """`C M C^-1` of a bone in every frame `(frames, 4)`; degrees of freedom that it lacks are zero."""
    turns = [(dof[1].upper(), k) for k, dof in enumerate(bone.dofs) if dof[0] == "r"]
    if values is None or not turns:
        return np.tile(quat.IDENTITY, (frames, 1))
    motion = _fixed_axes("".join(axis for axis, _ in turns), values[:, [k for _, k in turns]], degrees)
    return quat.multiply(quat.multiply(bone.axis, motion), quat.conjugate(bone.axis))


def _stretch(bone: _Bone, values: FloatArray) -> float:
    columns = [k for k, dof in enumerate(bone.dofs) if dof[0] in "tl"]
    return float(np.max(np.abs(values[:, columns]))) if columns else 0.0


def _scale(body: _Body, skeleton: Skeleton, told: float | None) -> tuple[float, str]:
    if told is not None:
        return told, f"lengths x {told:.6g} m, as told"
    stated = INCH / body.length_unit
    found = find_scale(skeleton)
    if np.isclose(stated, found.metres_per_unit, rtol=0.3):
        return stated, f"lengths in 1/{body.length_unit:g} inch (x {stated:.6g} m), as {body.path.name} says"
    return found.metres_per_unit, found.note


def _warn(message: str) -> None:
    warnings.warn(message, MotionWarning, stacklevel=3)
