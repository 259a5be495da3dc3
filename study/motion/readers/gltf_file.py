"""What a glTF 2.0 file holds: its JSON, the names of its animations, and its arrays of numbers.

In: a `.glb` file, or a `.gltf` file with its buffers beside it or inside. Out: a `Document`, whose parts are checked as
they are asked for; a refusal names the part as the JSON does: `hero.glb: animations[0].samplers[3].input: ...`.

Source: Khronos Group, glTF 2.0 Specification (ISO/IEC 12113:2022), sections 3.6 (buffers) and 4 (GLB).
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any, NoReturn
from urllib.parse import unquote

import numpy as np

from study.arrays import FloatArray
from study.errors import MotionFileError
from study.motion.readers.source import LARGEST, Source, read_raw

KIND = "a glTF 2.0 file"
GLTF_SUFFIXES = (".glb", ".gltf")
_HEADER, _CHUNK, _MAGIC, _JSON, _BINARY = struct.Struct("<4sII"), struct.Struct("<I4s"), b"glTF", b"JSON", b"BIN\0"
_LONGEST_NAME = 1000
_WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
# Component types with the divisor of those that stand for numbers up to 1.
_COMPONENTS = {5126: ("<f4", 0), 5120: ("i1", 127), 5121: ("u1", 255), 5122: ("<i2", 32767), 5123: ("<u2", 65535)}


def is_animation(path: Path) -> bool:
    """Whether a path names an animation of a glTF file as if it were a file in a folder: `hero.glb/walk`."""
    return path.parent.suffix.lower() in GLTF_SUFFIXES and path.parent.is_file()


def file_of(path: Path) -> Path:
    """The file on the disk that a motion file, or an animation in one, is read from."""
    return path.parent if is_animation(path) else path


def bare_name(path: Path) -> str:
    """The name of a motion file without its suffix; of an animation in a glTF file, its whole name."""
    return path.name if path.parent.suffix.lower() in GLTF_SUFFIXES else path.stem


def motions_in(path: Path) -> list[Path]:
    """What a motion file is read as: itself, or the animations of a glTF file that has several."""
    if path.suffix.lower() in GLTF_SUFFIXES:
        try:
            names = read_document(path).animation_names
        except MotionFileError:
            return [path]  # reading it says what is wrong
        if len(names) > 1:
            return [path / name for name in names]
    return [path]


@dataclass(frozen=True, eq=False)
class Document:
    """A glTF file in memory."""

    path: Path
    root: dict[str, Any]
    binary: bytes
    """The chunk of numbers of a `.glb` file."""
    _buffers: dict[int, bytes] = field(default_factory=dict)

    @cached_property
    def source(self) -> Source:
        """The file as readers of motion have it, for warnings."""
        return Source(self.path, b"")

    @cached_property
    def animation_names(self) -> tuple[str, ...]:
        """Names of the animations, each different, and such as a file in a folder can have."""
        names: list[str] = []
        for number in range(len(self.items("animations"))):
            name = self.name("animations", number).replace("/", "_").replace("\\", "_")
            names.append("_" if name in (".", "..") else name)
        return unique(names)

    def name(self, kind: str, number: int) -> str:
        """What a node or an animation is called; `node 5` where it has no name."""
        said = self.item(kind, number, kind).get("name")
        name = "".join(letter if letter.isprintable() else "_" for letter in said) if isinstance(said, str) else ""
        return name[:_LONGEST_NAME] or f"{kind[:-1]} {number}"

    def refuse(self, place: str, message: str) -> NoReturn:
        """Raise the refusal of a part of the file."""
        raise MotionFileError(f"{place}: {message}", self.path)

    def items(self, kind: str) -> Sequence[Any]:
        """The list of nodes, skins, animations, ...; empty where there is none."""
        found = self.root.get(kind, [])
        if not isinstance(found, list):
            self.refuse(kind, f"Expected a list, found {shown(found)}.")
        return found

    def item(self, kind: str, number: object, place: str) -> dict[str, Any]:
        """One of them by its number, which the file names at `place`."""
        items = self.items(kind)
        if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < len(items):
            self.refuse(place, f"Expected the number of one of {len(items)} {kind}, found {shown(number)}.")
        if not isinstance(items[number], dict):
            self.refuse(f"{kind}[{number}]", f"Expected an object, found {shown(items[number])}.")
        return dict(items[number])

    def numbers(self, value: object, count: int, place: str) -> FloatArray:
        """A list of `count` numbers in the JSON, up to `LARGEST`."""
        if not isinstance(value, list) or len(value) != count or not all(map(_is_number, value)):
            self.refuse(place, f"Expected {count} numbers up to {LARGEST:.0e}, found {shown(value)}.")
        return np.array(value, dtype=np.float64)

    def whole(self, value: object, place: str) -> int:
        """A whole number from 0."""
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= LARGEST:
            self.refuse(place, f"Expected a whole number from 0 to {LARGEST:.0e}, found {shown(value)}.")
        return value

    def array(self, number: object, kind: str, place: str) -> FloatArray:
        """The numbers of an accessor, `(count, 1, 3 or 4)` for `"SCALAR"`, `"VEC3"`, `"VEC4"`."""
        accessor = self.item("accessors", number, place)
        place = f"accessors[{number}]"
        component = accessor.get("componentType")
        if accessor.get("type") != kind or component not in _COMPONENTS or "sparse" in accessor:
            found = "sparse" if "sparse" in accessor else f"{accessor.get('type')} of {component}"
            self.refuse(place, f"Expected {kind} of floats or normalised integers, found {found}. Export it anew.")
        kept, divisor = _COMPONENTS[component]
        if divisor and accessor.get("normalized") is not True:
            self.refuse(place, "Expected floats, or integers with normalized = true. Export it anew.")
        dtype, width, count = np.dtype(kept), _WIDTHS[kind], self.whole(accessor.get("count"), f"{place}.count")
        view, start, stop = self._view(accessor.get("bufferView"), place)
        stride = self.whole(view.get("byteStride", width * dtype.itemsize), f"{place}: byteStride")
        start += self.whole(accessor.get("byteOffset", 0), f"{place}.byteOffset")
        needed = start + (count - 1) * stride + width * dtype.itemsize
        if count < 1 or stride < width * dtype.itemsize or needed > stop:
            self.refuse(place, f"Expected 1 or more rows within the file's data, found {count}, which end at {needed} "
                               f"of {stop} bytes. Copy the file again.")  # fmt: skip
        data = self._buffer(view.get("buffer"), place)
        with np.errstate(invalid="ignore"):  # of what is no number, which is refused below
            rows = np.ndarray((count, width), dtype, data, start, (stride, dtype.itemsize)).astype(np.float64)
        if not np.all(np.abs(rows) <= LARGEST):
            bad = int(np.argmax(~(np.abs(rows) <= LARGEST).all(axis=1)))
            self.refuse(place, f"Expected numbers up to {LARGEST:.0e}, found {rows[bad].tolist()} in row {bad}.")
        return np.maximum(rows / divisor, -1.0) if divisor else rows

    def _view(self, number: object, place: str) -> tuple[dict[str, Any], int, int]:
        """A view of a buffer, and where it starts and ends in it."""
        view = self.item("bufferViews", number, f"{place}.bufferView")
        if "compression" in (packed := shown(view.get("extensions"))):
            self.refuse(place, f"Expected plain numbers, found {packed}. Export it without compression.")
        start = self.whole(view.get("byteOffset", 0), f"bufferViews of {place}: byteOffset")
        stop = start + self.whole(view.get("byteLength"), f"bufferViews of {place}: byteLength")
        return view, start, min(stop, len(self._buffer(view.get("buffer"), place)))

    def _buffer(self, number: object, place: str) -> bytes:
        buffer = self.item("buffers", number, f"{place}: buffer")
        assert isinstance(number, int)  # `item` has looked
        if number not in self._buffers:
            uri = buffer.get("uri")
            self._buffers[number] = self.binary if uri is None else self._outside(uri, f"buffers[{number}].uri")
        return self._buffers[number]

    def _outside(self, uri: object, place: str) -> bytes:
        """The bytes of a data URI, or of a file in the document's folder."""
        if not isinstance(uri, str):
            self.refuse(place, f"Expected text, found {shown(uri)}.")
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except (binascii.Error, ValueError) as problem:
                self.refuse(place, f"Expected base64 data, found {shown(uri)} ({problem}).")
        name = PurePosixPath(unquote(uri))
        if name.is_absolute() or ".." in name.parts or ":" in str(name) or "\0" in str(name):
            self.refuse(place, f"Expected a file in the folder of {self.path.name}, found {shown(uri)}.")
        return read_raw(self.path.parent / name, f"the data of {self.path.name}")


def read_document(path: Path) -> Document:
    """A glTF file.

    Raises
    ------
    MotionFileError
        For what is no glTF 2.0.
    """
    raw, binary = read_raw(path, KIND), b""
    if raw.startswith(_MAGIC):
        raw, binary = _chunks(path, raw)
    try:
        root = json.loads(raw.decode("utf-8-sig"), parse_constant=_no_number)
    except json.JSONDecodeError as problem:
        where = (problem.lineno, problem.colno) if not binary else (0, 0)
        raise MotionFileError(f"Expected {KIND}, found no JSON in it ({problem.msg}).", path, *where) from problem
    except (ValueError, RecursionError) as problem:
        raise MotionFileError(f"Expected {KIND}, found no JSON in it ({str(problem)[:80]}).", path) from problem
    asset = root.get("asset") if isinstance(root, dict) else None
    version = asset.get("version") if isinstance(asset, dict) else None
    if not isinstance(version, str) or not version.startswith("2."):
        raise MotionFileError(f"Expected {KIND}, found version {shown(version)}. Export it as glTF 2.0.", path)
    return Document(path, root, binary)


def _chunks(path: Path, raw: bytes) -> tuple[bytes, bytes]:
    """The JSON and the numbers of a `.glb` file."""
    if len(raw) < _HEADER.size + _CHUNK.size:
        raise MotionFileError(f"Expected {KIND}, found {len(raw)} bytes. Copy the file again.", path)
    _, version, length = _HEADER.unpack_from(raw)
    if version != 2 or length > len(raw):
        raise MotionFileError(
            f"Expected version 2 and {len(raw)} bytes, found version {version} and {length} bytes in the header. "
            "Copy the file again, or export it as glTF 2.0.",
            path,
        )
    found: dict[bytes, bytes] = {}
    at = _HEADER.size
    while at + _CHUNK.size <= length:
        size, kind = _CHUNK.unpack_from(raw, at)
        at += _CHUNK.size
        if at + size > length:
            raise MotionFileError(f"Expected {size} bytes at byte {at}, found {length - at}. Copy it again.", path)
        found.setdefault(kind, raw[at : at + size])
        at += size
    if _JSON not in found:
        raise MotionFileError(f"Expected {KIND}, found no chunk of JSON in it. Export it anew.", path)
    return found[_JSON], found.get(_BINARY, b"")


def pack(text: bytes, binary: bytes) -> bytes:
    """A `.glb` file of JSON and numbers."""
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    chunks = b"".join(_CHUNK.pack(len(part), kind) + part for part, kind in ((text, _JSON), (binary, _BINARY)))
    return _HEADER.pack(_MAGIC, 2, _HEADER.size + len(chunks)) + chunks


def unique(names: Sequence[str]) -> tuple[str, ...]:
    """The names, with `_2`, `_3` ... behind those that stand before."""
    found: dict[str, None] = {}
    again: dict[str, int] = {}
    for name in names:
        one, number = name, again.get(name, 1)
        while one in found:
            number += 1
            one = f"{name}_{number}"
        found[one], again[name] = None, number
    return tuple(found)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST


def _no_number(text: str) -> float:
    raise ValueError(f"{text} is no number")


def shown(value: object) -> str:
    """A value of the JSON as messages show it: not more than its beginning."""
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
