"""Clips to BVH files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from study.arrays import FloatArray, IntArray
from study.errors import MotionFileError
from study.files import write_whole
from study.motion import quaternions as quat
from study.motion.clip import Clip
from study.motion.readers.rigid import unique
from study.motion.readers.source import LARGEST
from study.motion.skeleton import Skeleton


def write_bvh(clip: Clip, path: Path | str, *, metres_per_unit: float | None = None) -> None:
    """Write a clip as a BVH file, whole or not at all; reading it back gives the same motion.

    Joints stand depth first in it, as the format asks; those of a skeleton in another order are read back so.

    Parameters
    ----------
    clip, path
        What to write, with channels `Zrotation Yrotation Xrotation`, in degrees; the file, replaced if it is there.
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
    order = _depth_first(clip.skeleton.parents)
    lines = ["HIERARCHY", *_hierarchy_lines(clip.skeleton, order, 1.0 / metres_per_unit)]
    lines += ["MOTION", f"Frames: {clip.frames}", f"Frame Time: {1.0 / clip.fps!r}"]
    degrees = np.degrees(quat.to_euler("ZYX", clip.rotations[:, order])).reshape(clip.frames, -1)
    table = np.concatenate([clip.root_positions / metres_per_unit, degrees], axis=1)
    if np.max(np.abs(table)) > LARGEST:
        raise MotionFileError(f"Expected to write no number above {LARGEST:.0e}, but the body moves further.", path)
    row = " ".join(["%.10g"] * table.shape[1])
    lines += [row % tuple(values) for values in table.tolist()]
    write_whole(path, "\n".join(lines) + "\n")


def _depth_first(parents: IntArray) -> list[int]:
    """The joints such that all that hang on one directly follow it."""
    order, waiting = list[int](), [0]
    while waiting:
        order.append(waiting.pop())
        waiting += np.flatnonzero(parents == order[-1])[::-1].tolist()
    return order


def _hierarchy_lines(skeleton: Skeleton, order: list[int], scale: float) -> list[str]:
    """The lines of the tree, joint by joint."""

    def place(offset: FloatArray) -> str:
        return "OFFSET " + " ".join(f"{value:.10g}" for value in offset * scale)

    ends: dict[int, list[FloatArray]] = {}
    for joint, offset in zip(skeleton.end_parents.tolist(), skeleton.end_offsets, strict=True):
        ends.setdefault(joint, []).append(offset)
    # Braces end a name in BVH files, and blanks around it are not read.
    names = unique([re.sub(r"[{}\r\n]", "_", name).strip() or "_" for name in skeleton.names])
    lines: list[str] = []
    open_joints: list[int] = []

    def close_to(parent: int) -> None:
        while open_joints and open_joints[-1] != parent:
            open_joints.pop()
            lines.append("\t" * len(open_joints) + "}")

    for joint in order:
        close_to(int(skeleton.parents[joint]))
        tab = "\t" * len(open_joints)
        position = "6 Xposition Yposition Zposition" if joint == 0 else "3"
        lines += [f"{tab}{'ROOT' if joint == 0 else 'JOINT'} {names[joint]}", f"{tab}{{"]
        lines += [f"{tab}\t{place(skeleton.offsets[joint])}"]
        lines += [f"{tab}\tCHANNELS {position} Zrotation Yrotation Xrotation"]
        for end in ends.get(joint, []):
            lines += [f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\t{place(end)}", f"{tab}\t}}"]
        open_joints.append(joint)
    close_to(-1)
    return lines
