"""What a glTF 2.0 file holds: its JSON, the names of its animations, and its arrays of numbers.

In: a `.glb` file, or a `.gltf` file with its buffers beside it or inside. Out: a `Document`, whose parts are checked as
they are asked for; a refusal names the part as the JSON does: `hero.glb: animations[0].samplers[3].input: ...`.

Source: Khronos Group, glTF 2.0 Specification (ISO/IEC 12113:2022), sections 3.6 (buffers) and 4 (GLB).
"""

from __future__ import annotations

import base64
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
from study.motion.readers.rigid import unique
from study.motion.readers.source import LARGEST, read_raw

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


def buffers_of(path: Path) -> list[Path]:
    """The files that a glTF file has its numbers in, besides itself; none where it can't be read."""
    try:
        listed = read_document(path).items("buffers")
    except MotionFileError:
        return []
    uris = [uri for one in listed if isinstance(one, dict) and isinstance(uri := one.get("uri"), str)]
    return [path.parent / unquote(uri) for uri in uris if not uri.startswith("data:")]


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
    def animation_names(self) -> tuple[str, ...]:
        """Names of the animations, each different, and such as a file in a folder can have."""
        names = [self.name("animations", number) for number in range(len(self.items("animations")))]
        return unique(["_" * len(n) if n in (".", "..") else n.replace("/", "_").replace("\\", "_") for n in names])

    def name(self, kind: str, number: int) -> str:
        """What a node or an animation is called; `node 5` where it has no name."""
        said = self.item(kind, number, kind).get("name")
        name = "".join(letter if letter.isprintable() else "_" for letter in said) if isinstance(said, str) else ""
        return name[:_LONGEST_NAME] or f"{kind[:-1]} {number}"

    def refuse(self, place: str, expected: str, found: object, advice: str = "Export it anew.") -> NoReturn:
        """Raise the refusal of a part of the file; `found` is a value of the JSON."""
        raise MotionFileError(f"{place}: Expected {expected}, found {_shown(found)}. {advice}", self.path)

    def items(self, kind: str) -> Sequence[Any]:
        """The list of nodes, skins, animations, ...; empty where there is none."""
        return self.listed(self.root.get(kind, []), kind)

    def listed(self, value: object, place: str) -> Sequence[Any]:
        """A list of the JSON."""
        return value if isinstance(value, list) else self.refuse(place, "a list", value)

    def whole(self, value: object, place: str, limit: float = LARGEST, what: str = "a whole number") -> int:
        """A whole number from 0 and below a limit."""
        if type(value) is int and 0 <= value < limit:
            return value
        return self.refuse(place, f"{what} from 0 and below {limit:.10g}", value)

    def item(self, kind: str, number: object, place: str) -> dict[str, Any]:
        """One of the items by its number, which the file names at `place`."""
        items = self.items(kind)
        found = items[self.whole(number, place, len(items), f"a number of {kind}")]
        return found if isinstance(found, dict) else self.refuse(f"{kind}[{number}]", "an object", found)

    def numbers(self, value: object, count: int, place: str) -> FloatArray:
        """A list of `count` numbers in the JSON, up to `LARGEST`."""
        found = self.listed(value, place)
        if len(found) != count or not all(type(one) in (int, float) and abs(one) <= LARGEST for one in found):
            self.refuse(place, f"{count} numbers up to {LARGEST:.0e}", value)
        return np.array(found, dtype=np.float64)

    def array(self, number: object, kind: str, place: str) -> FloatArray:
        """The numbers of an accessor, `(count, 1, 3 or 4)` for `"SCALAR"`, `"VEC3"`, `"VEC4"`."""
        accessor = self.item("accessors", number, place)
        place = f"accessors[{number}]"
        about = [accessor.get(key) for key in ("type", "componentType", "normalized", "sparse")]
        stored, divisor = _COMPONENTS.get(about[1] if isinstance(about[1], int) else 0, ("", 0))
        if about[0] != kind or not stored or about[3] is not None or (divisor and about[2] is not True):
            self.refuse(place, f"{kind} of floats or normalised integers", about)
        view = self.item("bufferViews", accessor.get("bufferView"), f"{place}.bufferView")
        if "compression" in _shown(view.get("extensions")):
            self.refuse(place, "plain numbers", view.get("extensions"), "Export it without compression.")
        dtype, width, data = np.dtype(stored), _WIDTHS[kind], self._buffer(view.get("buffer"), place)
        row = width * dtype.itemsize
        count, stride, before, start, length = (
            self.whole(about.get(key, usual), f"{place}: {key}")
            for about, key, usual in ((accessor, "count", None), (view, "byteStride", row), (view, "byteOffset", 0),
                                      (accessor, "byteOffset", 0), (view, "byteLength", None))
        )  # fmt: skip
        end = start + (count - 1) * stride + row
        if count < 1 or stride < row or end > min(length, len(data) - before):
            self.refuse(place, "1 or more rows within the file's data", [count, end], "Copy the file again.")
        with np.errstate(invalid="ignore"):  # of what is no number, which is refused below
            rows = np.ndarray((count, width), dtype, data, before + start, (stride, dtype.itemsize)).astype(np.float64)
        if not np.all(np.abs(rows) <= LARGEST):
            bad = int(np.argmax(~(np.abs(rows) <= LARGEST).all(axis=1)))
            self.refuse(place, f"numbers up to {LARGEST:.0e} in row {bad}", rows[bad].tolist())
        return np.maximum(rows / divisor, -1.0) if divisor else rows

    def _buffer(self, number: object, place: str) -> bytes:
        """The bytes of a buffer: in the file itself, in a data URI, or in a file in the document's folder."""
        uri, place = self.item("buffers", number, f"{place}: buffer").get("uri"), f"buffers[{number}].uri"
        assert isinstance(number, int)  # `item` has looked
        if uri is None:
            return self.binary
        if number in self._buffers:
            return self._buffers[number]
        name = PurePosixPath(unquote(uri if isinstance(uri, str) else "/"))
        if isinstance(uri, str) and uri.startswith("data:"):
            try:
                self._buffers[number] = base64.b64decode(uri.partition(",")[2], validate=True)
            except ValueError:
                self.refuse(place, "base64 data", uri)
        elif name.is_absolute() or ".." in name.parts or ":" in str(name) or "\0" in str(name):
            self.refuse(place, f"a file in the folder of {self.path.name}", uri)
        else:
            self._buffers[number] = read_raw(self.path.parent / name, f"the data of {self.path.name}")
        return self._buffers[number]


def read_document(path: Path) -> Document:
    """A glTF file; `MotionFileError` for what is none of version 2."""
    raw, chunks = read_raw(path, KIND), dict[bytes, bytes]()
    if raw.startswith(_MAGIC):
        at = _HEADER.size
        while at + _CHUNK.size <= len(raw):
            size, kind = _CHUNK.unpack_from(raw, at)
            at += _CHUNK.size
            chunks.setdefault(kind, raw[at : at + size])
            at += size
        if at != len(raw) or raw[4 : _HEADER.size] != struct.pack("<II", 2, len(raw)) or _JSON not in chunks:
            raise MotionFileError(f"Expected {KIND}, found one of another version, or a damaged one.", path)
    try:
        root = json.loads(chunks.get(_JSON, raw).decode("utf-8-sig"), parse_constant=str)  # NaN is no number
    except (ValueError, RecursionError) as problem:
        where = (problem.lineno, problem.colno) if isinstance(problem, json.JSONDecodeError) and not chunks else (0, 0)
        raise MotionFileError(f"Expected {KIND}, found no JSON in it ({str(problem)[:80]}).", path, *where) from problem
    asset = root.get("asset") if isinstance(root, dict) else None
    version = asset.get("version") if isinstance(asset, dict) else None
    if not isinstance(version, str) or not version.startswith("2."):
        raise MotionFileError(f"Expected {KIND}, found version {_shown(version)}. Export it as glTF 2.0.", path)
    return Document(path, root, chunks.get(_BINARY, b""))


def pack(text: bytes, binary: bytes) -> bytes:
    """A `.glb` file of JSON and numbers."""
    parts = ((text + b" " * (-len(text) % 4), _JSON), (binary + bytes(-len(binary) % 4), _BINARY))
    chunks = b"".join(_CHUNK.pack(len(part), kind) + part for part, kind in parts)
    return _HEADER.pack(_MAGIC, 2, _HEADER.size + len(chunks)) + chunks


def _shown(value: object) -> str:
    """A value of the JSON as messages show it: not more than its beginning."""
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
