"""BVH files to clips and back.

In: Biovision hierarchy files as real tools write them. Out: `Clip` (Y up, metres, radians, wxyz). Rotation channels
multiply in the order in which each joint lists them; position channels are the joint's place in its parent's frame
and replace its OFFSET, wherever they stand in the list. What a clip can't hold (a limb that changes its length) is
warned of; what can't be read is refused with file, line and column.
"""

from __future__ import annotations

import difflib
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.counting import counted
from study.errors import MotionFileError, MotionWarning
from study.files import write_whole
from study.motion import quaternions as quat
from study.motion.clip import HIGHEST_FPS, LOWEST_FPS, Clip, refuse_large, with_roles
from study.motion.digits import parse_table
from study.motion.skeleton import MOST_JOINTS, Skeleton
from study.motion.source import LARGEST, Source, number, read_source, shown, whole_number
from study.motion.units import find_scale

FloatArray = NDArray[np.float64]

_CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")
_CANONICAL = {name.lower(): name for name in _CHANNELS}
_TOKEN = re.compile(rb"[{}]|[^\s{}]+")
_NAME = re.compile(rb"[^{}\r\n]*")
_LONGEST_NAME = 1000
_MOST_CHANNELS = 12
# So many joints whose names stand twice are named one by one.
_NAMED = 3
# A bone whose length the data changes by less than this (metres) is taken as rigid.
_RIGID_M = 1e-4


@dataclass
class _Joint:
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
class _Hierarchy:
    joints: list[_Joint] = field(default_factory=list)
    ends: list[tuple[int, FloatArray]] = field(default_factory=list)
    columns: int = 0
    # Each name that is taken, with the number that the last joint of that name was given.
    names: dict[str, int] = field(default_factory=dict)
    renamed: list[tuple[str, str]] = field(default_factory=list)

    def unique(self, name: str) -> str:
        """A name that no joint has yet: the name itself, or with `_2`, `_3` ... behind it."""
        unique, number = name, self.names.get(name, 1)
        while unique in self.names:
            number += 1
            unique = f"{name}_{number}"
        self.names |= {name: number, unique: 1} if unique != name else {name: 1}
        if unique != name:
            self.renamed.append((name, unique))
        return unique


def read_bvh(
    path: Path | str,
    *,
    metres_per_unit: float | None = None,
    fps: float | None = None,
    mapping: Mapping[str, str] | None = None,
) -> Clip:
    """Read a BVH file.

    Parameters
    ----------
    path
        The file.
    metres_per_unit
        Metres in a unit of the file; by default found from the size of the body (`study.motion.units`), and said
        in the clip's history.
    fps
        Frames per second in place of what the file says; said in the clip's history where they differ.
    mapping
        Joint names by role, as `study.motion.rigs.find_roles` takes them.

    Raises
    ------
    MotionFileError
        For anything that can't be read without guessing, with line and column.

    Warns
    -----
    MotionWarning
        Where `Frames:` disagrees with the rows (the rows are trusted), `Frame Time:` is no time between frames but
        frames per second or milliseconds, a joint's position varies (its median is taken), or a body has no plausible
        size.
    """
    source = read_source(path, "a BVH file")
    hierarchy, offset = _read_hierarchy(source)
    for name, unique in hierarchy.renamed[:_NAMED]:
        _warn(f"{source.path}: two joints are called {name!r}; the second is read as {unique!r}")
    if more := len(hierarchy.renamed[_NAMED:]):
        _warn(f"{source.path}: {more} more joints have the name of another, and are numbered likewise")
    frame_time, stated, offset = _read_motion_header(source, offset)
    values = parse_table(source, offset, hierarchy.columns)
    if stated is not None and stated != len(values):
        _warn(f"{source.path}: says Frames: {stated}, but holds {counted(len(values), 'row')}; the rows are trusted")
    notes = [f"read from {source.path.name}"]
    if fps is None:
        fps = _stated_rate(source, frame_time)
    elif fps != (stated_fps := frame_rate(frame_time.text)):
        notes.append(f"taken at {fps:g} fps, as told, and not at the file's {stated_fps:g}")
    return _assemble(source, hierarchy, values, fps, metres_per_unit, mapping, notes)


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


def _read_hierarchy(source: Source) -> tuple[_Hierarchy, int]:
    """The joints, and the offset just behind the word MOTION."""
    tokens = _Tokens(source)
    token, start = tokens.next("HIERARCHY")
    if token.upper() != b"HIERARCHY":
        raise source.error(start, f"Expected HIERARCHY at the start of a BVH file, found {shown(token)}.")
    hierarchy = _Hierarchy()
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


def _open_joint(tokens: _Tokens, hierarchy: _Hierarchy, start: int, open_joints: list[int]) -> int:
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
    unique = hierarchy.unique(name)
    hierarchy.joints.append(_Joint(unique, open_joints[-1] if open_joints else -1, start))
    return len(hierarchy.joints) - 1


def _closed(source: Source, joint: _Joint, start: int) -> None:
    if joint.offset is None:
        raise source.error(start, f"Expected an OFFSET in joint {joint.name!r} before its '}}'.")


def _read_end(tokens: _Tokens, hierarchy: _Hierarchy, joint: int) -> None:
    tokens.name()  # `Site`, or whatever the tool calls it
    tokens.word("{")
    tokens.word("OFFSET")
    name = hierarchy.joints[joint].name
    hierarchy.ends.append((joint, np.array([tokens.number(f"a length in the End Site of {name!r}") for _ in range(3)])))
    tokens.word("}")


def _read_property(tokens: _Tokens, hierarchy: _Hierarchy, joint: _Joint, word: bytes, start: int) -> None:
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


class _FrameTime(NamedTuple):
    """The seconds between frames as the file prints them, and where."""

    text: str
    offset: int


def _read_motion_header(source: Source, offset: int) -> tuple[_FrameTime, int | None, int]:
    """The frame time, the stated number of frames (None where it is missing), and where the rows start."""
    stated: int | None = None
    line = re.compile(rb"[ \t]*([^\r\n]*)(\r\n|\r|\n|$)")
    while True:
        found = line.match(source.raw, offset)
        if found is None or offset >= len(source.raw):
            raise source.error(len(source.raw.rstrip()), "Expected 'Frame Time:', found the end of the file.")
        content, start, offset = found.group(1), found.start(1), found.end()
        if not content.strip():
            continue
        key = re.match(rb"(frames|frame\s*time)\s*:?\s*", content, re.IGNORECASE)
        if key is None:
            raise source.error(
                start,
                f"Expected 'Frame Time:' before the data rows, found {shown(content)}. "
                "Add the line, for instance 'Frame Time: 0.0083333' for 120 fps.",
            )
        value, at = content[key.end() :].strip(), start + key.end()
        if key.group(1).lower() == b"frames":
            stated = whole_number(source, value, at, "the number of frames after 'Frames:'")
            continue
        seconds = number(source, value, at, "the seconds between frames after 'Frame Time:'")
        if not 1.0 / HIGHEST_FPS <= seconds <= 1.0 / LOWEST_FPS:
            raise source.error(
                at,
                f"Expected a Frame Time above 0, in seconds, from {1.0 / HIGHEST_FPS:g} to {1.0 / LOWEST_FPS:g}, "
                f"found {shown(value)}. Write 1 / fps, such as 0.0083333 for 120 fps; or say `fps` in library.toml.",
            )
        # Digits beyond those of a double say no more.
        return _FrameTime(value.decode() if len(value) <= 40 else repr(seconds), at), stated, offset


# Frame rates that cameras and tools run at; tried first where few digits are printed.
_COMMON_FPS = tuple(Fraction(f) for f in (24, 25, 30, 48, 50, 60, 72, 90, 100, 120, 144, 200, 240))
_NTSC_FPS = tuple(Fraction(f * 1000, 1001) for f in (24, 30, 48, 60, 120, 240))
_COMMON_WITHIN = Fraction(2, 100)
# A second or more between frames is no motion capture, but frames per second or milliseconds. Milliseconds are often
# printed without decimals, which puts them off by as much as this; some numbers can be either.
_SLOWEST_S, _ROUNDED_MS = 1.0, Fraction(5, 100)
_SURELY_FPS, _EITHER = range(48, 501), (10, 12, 15, 20, 40)


def _stated_rate(source: Source, frame_time: _FrameTime) -> float:
    """Frames per second of the file's frame time; where it holds frames per second or milliseconds, with a warning."""
    value = Fraction(frame_time.text)
    if value < _SLOWEST_S:
        return frame_rate(frame_time.text)
    rates = [float(r) for r in (*_COMMON_FPS, *_NTSC_FPS) if abs(r / value - 1) < Fraction(1, 2000)]
    rates += [float(value)] if value in _SURELY_FPS else []
    words = f"{frame_time.text} frames a second"
    if not rates and value not in _EITHER:
        per_second = 1000 / value
        near = [r for r in _COMMON_FPS if abs(per_second / r - 1) < _ROUNDED_MS]
        rates = [float(r) for r in sorted(near, key=lambda r: abs(r - per_second))]
        words = f"{frame_time.text} milliseconds"
    if not rates:
        raise source.error(
            frame_time.offset,
            f"Expected the seconds between frames after 'Frame Time:', found {frame_time.text}. Write 1 / fps, such as "
            "0.0083333 for 120 fps; or say `fps` in library.toml.",
        )
    _warn(
        f"{source.path}: expected the seconds between frames after 'Frame Time:', found {frame_time.text}; read as "
        f"{words}, so at {rates[0]:g} fps"
    )
    return rates[0]


def frame_rate(printed: str) -> float:
    """Frames per second of a printed frame time.

    `0.0083333` means 120 and not 120.00048: where a common rate, a whole number or an NTSC rate (30000/1001) lies
    within what the printed digits leave open, it is meant. A frame time that names none of them is not rounded.

    Examples
    --------
    >>> frame_rate("0.0083333"), frame_rate("0.033367"), frame_rate("0.012")
    (120.0, 29.97002997002997, 83.33333333333333)
    """
    exact = Fraction(printed)
    mantissa, _, exponent = printed.lower().partition("e")
    decimals = len(mantissa.partition(".")[2]) - int(exponent or 0)
    # Half a unit of the last digit; or of a double, for those who print all 17 digits of one.
    open_by = max(Fraction(1, 2) / Fraction(10) ** decimals, Fraction(float(np.spacing(float(exact)))))
    plain = 1 / exact

    def fits(rate: Fraction) -> bool:
        return abs(1 / rate - exact) <= open_by

    if plain.denominator == 1:
        return float(plain)
    common = [r for r in (*_COMMON_FPS, *_NTSC_FPS) if fits(r) and abs(r / plain - 1) <= _COMMON_WITHIN]
    if common:
        return float(min(common, key=lambda rate: abs(rate - plain)))
    whole = Fraction(round(plain))
    neighbours = [Fraction(round(plain) + step) for step in (-1, 1)]
    if whole > 0 and fits(whole) and not any(n > 0 and fits(n) for n in neighbours):
        return float(whole)
    return float(plain)


def _assemble(
    source: Source,
    hierarchy: _Hierarchy,
    values: FloatArray,
    fps: float,
    metres_per_unit: float | None,
    mapping: Mapping[str, str] | None,
    history: list[str],
) -> Clip:
    names = tuple(joint.name for joint in hierarchy.joints)
    parents = np.array([joint.parent for joint in hierarchy.joints])
    offsets = np.array([joint.offset for joint in hierarchy.joints])
    end_parents = np.array([parent for parent, _ in hierarchy.ends], dtype=np.int64)
    end_offsets = np.array([offset for _, offset in hierarchy.ends]).reshape(-1, 3)
    refuse_large(len(values), len(names), str(source.path), values.size)
    rotations = _rotations(hierarchy.joints, values)
    paths = {j: _path(joint, values) for j, joint in enumerate(hierarchy.joints) if joint.columns("position") or j == 0}
    # Constant places first: on rigs with six channels everywhere the data say how long the bones are.
    for j, path in paths.items():
        if j > 0:
            offsets[j] = np.median(path, axis=0)
    whole = Skeleton(names, parents, offsets, end_parents, end_offsets)
    body = with_roles(Clip(whole, paths[0], rotations, fps), mapping).skeleton
    if metres_per_unit is None:
        scale = find_scale(body)
        metres_per_unit = scale.metres_per_unit
        history.append(scale.note)
        if not scale.plausible and scale.by_legs:
            _warn(f"{source.path}: {scale.note}; a person has another size: say `unit` in library.toml")
    else:
        history.append(f"lengths x {metres_per_unit:.6g} m, as told")
    root = 0
    while _rides(root, parents, end_parents.tolist(), paths, metres_per_unit):
        child = root + 1
        paths[child] = paths[root] + quat.rotate(rotations[:, root], paths[child])
        rotations[:, child] = quat.multiply(rotations[:, root], rotations[:, child])
        history.append(f"joint {names[root]!r} folded into {names[child]!r}, which moves in it")
        root = child
    for j, path in paths.items():
        if j > root:
            _check_rigid(source, names[j], path, offsets[j], metres_per_unit)
    skeleton = Skeleton(
        names[root:],
        np.where(parents[root:] < root, -1, parents[root:] - root),
        offsets[root:] * metres_per_unit,
        end_parents - root,
        end_offsets * metres_per_unit,
        body.body.without_first(root),
    )
    return Clip(
        skeleton,
        paths[root] * metres_per_unit,
        rotations[:, root:],
        fps,
        name=source.path.stem,
        history=tuple(history),
        metres_per_unit=metres_per_unit,
    )


def _rotations(joints: list[_Joint], values: FloatArray) -> FloatArray:
    """Local rotations `(frames, joints, 4)`; joint by joint, which keeps what is at work in the processor's cache."""
    by_channel = np.ascontiguousarray(values.T)
    rotations = np.empty((4, len(joints), len(values)))
    for j, joint in enumerate(joints):
        turns = joint.columns("rotation")
        if turns:
            angles = np.radians(by_channel[[column for column, _ in turns]])
            rotations[:, j] = quat.from_euler_parts("".join(axis for _, axis in turns), angles)
        else:
            rotations[:, j] = quat.IDENTITY[:, None]
    return rotations.transpose(2, 1, 0)


def _path(joint: _Joint, values: FloatArray) -> FloatArray:
    """A joint's place in its parent's frame `(frames, 3)`: OFFSET where no channel replaces it."""
    path = np.tile(np.asarray(joint.offset), (len(values), 1))
    for column, axis in joint.columns("position"):
        path[:, "XYZ".index(axis)] = values[:, column]
    return path


def _rides(
    root: int, parents: NDArray[np.int64], ends: set[int], paths: dict[int, FloatArray], metres_per_unit: float
) -> bool:
    """Whether the root only carries one joint, which moves in it: then that one is the body's root."""
    children = np.flatnonzero(parents == root)
    if len(children) != 1 or root in ends or root + 1 not in paths:
        return False
    path = paths[root + 1]
    return bool(np.max(np.abs(path - np.median(path, axis=0))) * metres_per_unit > _RIGID_M)


def _check_rigid(source: Source, name: str, path: FloatArray, offset: FloatArray, metres_per_unit: float) -> None:
    strays = np.linalg.norm(path - offset, axis=1) * metres_per_unit
    worst = int(np.argmax(strays))
    if strays[worst] > _RIGID_M:
        _warn(
            f"{source.path}: joint {name!r} changes its place in its parent by up to {strays[worst] * 100:.2f} cm "
            f"(frame {worst}); a clip has bones of constant length, so its median is taken"
        )


def write_bvh(clip: Clip, path: Path | str, *, metres_per_unit: float | None = None) -> None:
    """Write a clip as a BVH file, whole or not at all; reading it back gives the same motion.

    Parameters
    ----------
    clip
        What to write; channels are `Zrotation Yrotation Xrotation`, in degrees.
    path
        The file; one that is there is replaced.
    metres_per_unit
        The length unit to write; by default that of the file which the clip was read from, and centimetres for clips
        that were read from none.

    Raises
    ------
    MotionFileError
        Where the file would hold numbers that no reader takes.
    FileError
        Where the file can't be written.
    """
    path = Path(path)
    metres_per_unit = clip.metres_per_unit if metres_per_unit is None else metres_per_unit
    lines = ["HIERARCHY", *_hierarchy_lines(clip.skeleton, 1.0 / metres_per_unit)]
    lines += ["MOTION", f"Frames: {clip.frames}", f"Frame Time: {1.0 / clip.fps!r}"]
    degrees = np.degrees(quat.to_euler("ZYX", clip.rotations)).reshape(clip.frames, -1)
    table = np.concatenate([clip.root_positions / metres_per_unit, degrees], axis=1)
    if np.max(np.abs(table)) > LARGEST:
        raise MotionFileError(f"Expected to write no number above {LARGEST:.0e}, but the body moves further.", path)
    row = " ".join(["%.10g"] * table.shape[1])
    lines += [row % tuple(values) for values in table.tolist()]
    write_whole(path, "\n".join(lines) + "\n")


def _hierarchy_lines(skeleton: Skeleton, scale: float) -> list[str]:
    """The lines of the tree, joint by joint: depth first, as a skeleton has them."""

    def place(offset: FloatArray) -> str:
        return "OFFSET " + " ".join(f"{value:.10g}" for value in offset * scale)

    ends: dict[int, list[FloatArray]] = {}
    for joint, offset in zip(skeleton.end_parents.tolist(), skeleton.end_offsets, strict=True):
        ends.setdefault(joint, []).append(offset)
    lines: list[str] = []
    open_joints: list[int] = []

    def close_to(parent: int) -> None:
        while open_joints and open_joints[-1] != parent:
            open_joints.pop()
            lines.append("\t" * len(open_joints) + "}")

    for joint, parent in enumerate(skeleton.parents.tolist()):
        close_to(parent)
        tab = "\t" * len(open_joints)
        position = "6 Xposition Yposition Zposition" if joint == 0 else "3"
        lines += [f"{tab}{'ROOT' if joint == 0 else 'JOINT'} {skeleton.names[joint]}", f"{tab}{{"]
        lines += [f"{tab}\t{place(skeleton.offsets[joint])}"]
        lines += [f"{tab}\tCHANNELS {position} Zrotation Yrotation Xrotation"]
        for end in ends.get(joint, []):
            lines += [f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\t{place(end)}", f"{tab}\t}}"]
        open_joints.append(joint)
    close_to(-1)
    return lines


def _warn(message: str) -> None:
    warnings.warn(message, MotionWarning, stacklevel=3)
