"""Acclaim motions (AMC) with their skeletons (ASF), as the CMU database has them, to clips.

A bone starts where its parent ends, and its rotation `C M C^-1` (C from the bone's `axis`, M from its degrees of
freedom) is taken in the world's axes: with all rotations identity the body stands in the ASF's rest pose. So each bone
is a joint at its start (`lfemur` is the hip), and the tip of a bone without children is an end site. Both kinds of
angles turn about fixed axes in the order listed: `XYZ` is `Z Y X` as a product of matrices.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from study.arrays import FloatArray
from study.counting import counted
from study.errors import MotionFileError
from study.motion import quaternions as quat
from study.motion.clip import Clip, refuse_large, with_roles
from study.motion.readers.asf import LINE, ROOT, Body, Bone, fixed_axes, read_asf
from study.motion.readers.numbers import parse_numbers
from study.motion.readers.source import Source, number, read_source, shown, whole_number
from study.motion.skeleton import Skeleton
from study.motion.units import INCH, find_scale

CMU_FPS = 120.0


def read_amc(
    path: Path | str,
    *,
    asf: Path | str | None = None,
    metres_per_unit: float | None = None,
    fps: float | None = None,
    mapping: Mapping[str, str] | None = None,
) -> Clip:
    """Read an AMC motion with its ASF skeleton.

    Parameters
    ----------
    path, fps, mapping
        As `study.motion.readers.registry.read_clip` takes them.
    asf
        The skeleton; by default `16.asf` beside `16_15.amc`, else the only `.asf` in the folder.
    metres_per_unit
        Metres in a unit of the file. By default the ASF's `:units length` (0.45 for CMU) divides an inch, unless that
        gives a body of no human size: then the unit is found from its size.

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
    body = read_asf(read_source(asf if asf is not None else _find_asf(Path(path)), "an ASF file"))
    values, degrees = _read_frames(source, body)
    return _assemble(source, body, values, degrees, CMU_FPS if fps is None else fps, metres_per_unit, mapping)


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


def _read_frames(source: Source, body: Body) -> tuple[dict[str, FloatArray], bool]:
    """Values of each bone `(frames, dofs)` in the file's unit, and whether angles are degrees."""
    degrees, start = _read_amc_header(source, body.degrees)
    moving = {bone.name: len(bone.dofs) for bone in body.bones if bone.dofs}
    values = _parse_regular(source.raw[start:], moving)
    if values is None:
        values = _parse_slowly(source, start, moving, {bone.name for bone in body.bones}, body.path.name)
    return values, degrees


def _read_amc_header(source: Source, degrees: bool) -> tuple[bool, int]:
    """Whether the angles are degrees, and where the first frame's number starts."""
    for line in LINE.finditer(source.raw):
        text = line.group().strip()
        if not text or text.startswith(b"#"):
            continue
        if not text.startswith(b":"):
            return degrees, line.start()
        key = text.upper()
        if key in (b":DEGREES", b":RADIANS"):
            degrees = key == b":DEGREES"
    raise source.error(len(source.raw.rstrip()), "Expected frames, found the end of the file. Copy it again.")


def _parse_regular(frames: bytes, moving: dict[str, int]) -> dict[str, FloatArray] | None:
    """The fast way, for files whose frames all list the same bones in the same order; None for any other."""
    words = frames.split()
    blocks, width = _first_frame(words, moving)
    if len(blocks) != len(moving) or len(words) % width:
        return None
    for name, column in reversed(blocks.items()):
        if set(words[column::width]) != {name.encode()}:
            return None
        del words[column::width]
        width -= 1
    table = parse_numbers(b"\n".join(b" ".join(words[at : at + width]) for at in range(0, len(words), width)))
    if table is None or not np.array_equal(table[:, 0], np.arange(1, len(table) + 1)):
        return None
    parts = np.split(table[:, 1:], np.cumsum([moving[name] for name in blocks])[:-1], axis=1)
    return dict(zip(blocks, parts, strict=True))


def _first_frame(words: list[bytes], moving: dict[str, int]) -> tuple[dict[str, int], int]:
    """The position of each bone's name among the first frame's words, in order, and how many words a frame has."""
    blocks: dict[str, int] = {}
    at = 1
    while at < len(words):
        name = words[at].decode("utf-8", "replace")
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
    for line in LINE.finditer(source.raw, start):
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
        source.warn(
            f"frame numbers jump {counted(gaps, 'time')} from {first_number} to {last_number}; all rows are kept"
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
    body: Body,
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
            source.warn(f"bone {bone.name!r} shifts or stretches by up to {stretch:.4g} units, which is ignored")
    leaves = np.array(sorted(set(range(len(bones))) - {int(p) for p in parents}), dtype=np.int64)
    path = np.tile(body.root_position, (frames, 1))
    for k, dof in enumerate(bones[0].dofs):
        if dof[0] == "t":
            path[:, "xyz".index(dof[1])] += values[ROOT][:, k]
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


def _rotation(bone: Bone, values: FloatArray | None, frames: int, degrees: bool) -> FloatArray:
    """`C M C^-1` of a bone in every frame `(frames, 4)`; degrees of freedom that it lacks are zero."""
    turns = [(dof[1].upper(), k) for k, dof in enumerate(bone.dofs) if dof[0] == "r"]
    if values is None or not turns:
        return np.tile(quat.IDENTITY, (frames, 1))
    motion = fixed_axes("".join(axis for axis, _ in turns), values[:, [k for _, k in turns]], degrees)
    return quat.multiply(quat.multiply(bone.axis, motion), quat.conjugate(bone.axis))


def _stretch(bone: Bone, values: FloatArray) -> float:
    columns = [k for k, dof in enumerate(bone.dofs) if dof[0] in "tl"]
    return float(np.max(np.abs(values[:, columns]))) if columns else 0.0


def _scale(body: Body, skeleton: Skeleton, told: float | None) -> tuple[float, str]:
    if told is not None:
        return told, f"lengths x {told:.6g} m, as told"
    stated = INCH / body.length_unit
    found = find_scale(skeleton)
    if np.isclose(stated, found.metres_per_unit, rtol=0.3):
        return stated, f"lengths in 1/{body.length_unit:g} inch (x {stated:.6g} m), as {body.path.name} says"
    return found.metres_per_unit, found.note
