"""BVH files to clips.

In: Biovision hierarchy files as real tools write them. Out: `Clip` (Y up, metres, radians, wxyz). Rotation channels
multiply in the order in which each joint lists them; position channels are the joint's place in its parent's frame
and replace its OFFSET, in any position of the list. What a clip can't hold (a limb that changes its length) causes
a warning; what can't be read is refused with file, line and column.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from study.arrays import FloatArray
from study.counting import counted
from study.motion import quaternions as quat
from study.motion.clip import Clip, refuse_large
from study.motion.readers.bvh_hierarchy import Hierarchy, Joint, read_hierarchy
from study.motion.readers.frame_times import frame_rate, read_motion_header, stated_rate
from study.motion.readers.numbers import parse_table
from study.motion.readers.rigid import Measured, rigid_clip, unique
from study.motion.readers.source import Source, read_source

# The number of joints with a repeated name that are named one by one.
_NAMED = 3


def read_bvh(
    path: Path | str,
    *,
    metres_per_unit: float | None = None,
    fps: float | None = None,
    mapping: Mapping[str, str] | None = None,
) -> Clip:
    """Read a BVH file; parameters as `study.motion.readers.registry.read_clip` takes them.

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
    hierarchy, offset = read_hierarchy(source)
    names = unique([joint.name for joint in hierarchy.joints])
    renamed = [(joint.name, name) for joint, name in zip(hierarchy.joints, names, strict=True) if joint.name != name]
    for name, other in renamed[:_NAMED]:
        source.warn(f"two joints are called {name!r}; the second is read as {other!r}")
    if more := len(renamed[_NAMED:]):
        source.warn(f"{more} more joints have the name of another, and are numbered likewise")
    frame_time, stated, offset = read_motion_header(source, offset)
    values = parse_table(source, offset, hierarchy.columns)
    if stated is not None and stated != len(values):
        source.warn(f"says Frames: {stated}, but holds {counted(len(values), 'row')}; the rows are trusted")
    notes = [f"read from {source.path.name}"]
    if fps is None:
        fps = stated_rate(source, frame_time)
    elif fps != (stated_fps := frame_rate(frame_time.text)):
        notes.append(f"taken at {fps:g} fps, as told, and not at the file's {stated_fps:g}")
    measured = _measured(source, hierarchy, names, values)
    return rigid_clip(source, source.path.stem, measured, fps, metres_per_unit, mapping, notes)


def _measured(source: Source, hierarchy: Hierarchy, names: tuple[str, ...], values: FloatArray) -> Measured:
    """The body and its motion by a hierarchy and the values of its channels, shape (frames, channels)."""
    refuse_large(len(values), len(names), str(source.path), values.size)
    paths = {j: _path(joint, values) for j, joint in enumerate(hierarchy.joints) if joint.columns("position") or j == 0}
    return Measured(
        names,
        np.array([joint.parent for joint in hierarchy.joints]),
        np.array([joint.offset for joint in hierarchy.joints]),
        np.array([parent for parent, _ in hierarchy.ends], dtype=np.int64),
        np.array([offset for _, offset in hierarchy.ends]).reshape(-1, 3),
        paths,
        _rotations(hierarchy.joints, values),
    )


def _rotations(joints: list[Joint], values: FloatArray) -> FloatArray:
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


def _path(joint: Joint, values: FloatArray) -> FloatArray:
    """A joint's place in its parent's frame `(frames, 3)`: OFFSET where no channel replaces it."""
    path = np.tile(np.asarray(joint.offset), (len(values), 1))
    for column, axis in joint.columns("position"):
        path[:, "XYZ".index(axis)] = values[:, column]
    return path
