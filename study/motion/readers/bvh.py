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

from study.arrays import FloatArray, IntArray
from study.counting import counted
from study.motion import quaternions as quat
from study.motion.clip import Clip, refuse_large, with_roles
from study.motion.readers.bvh_hierarchy import Hierarchy, Joint, read_hierarchy
from study.motion.readers.frame_times import frame_rate, read_motion_header, stated_rate
from study.motion.readers.numbers import parse_table
from study.motion.readers.source import Source, read_source
from study.motion.skeleton import Skeleton
from study.motion.units import find_scale

# The number of joints with a repeated name that are named one by one.
_NAMED = 3
# A bone whose length the data changes by less than this (metres) is taken as rigid.
_RIGID_M = 1e-4


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
    for name, unique in hierarchy.renamed[:_NAMED]:
        source.warn(f"two joints are called {name!r}; the second is read as {unique!r}")
    if more := len(hierarchy.renamed[_NAMED:]):
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
    return _assemble(source, hierarchy, values, fps, metres_per_unit, mapping, notes)


def _assemble(
    source: Source,
    hierarchy: Hierarchy,
    values: FloatArray,
    fps: float,
    metres_per_unit: float | None,
    mapping: Mapping[str, str] | None,
    history: list[str],
) -> Clip:
    """The clip of a hierarchy and the values of its channels, shape (frames, channels), with what was mended noted."""
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
            source.warn(f"{scale.note}; a person has another size: say `unit` in library.toml")
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


def _rides(root: int, parents: IntArray, ends: set[int], paths: dict[int, FloatArray], metres_per_unit: float) -> bool:
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
        source.warn(
            f"joint {name!r} changes its place in its parent by up to {strays[worst] * 100:.2f} cm "
            f"(frame {worst}); a clip has bones of constant length, so its median is taken"
        )
