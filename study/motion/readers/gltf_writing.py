"""Clips to a binary glTF 2.0 file: one skeleton, one animation a clip, and a body of thin bones that carries them.

Metres, Y up, seconds; a key in each frame, linear between. Importers (Godot 3 and others) make a skeleton of a
skinned mesh alone, so each bone has one: eight triangles, which also show the motion at once. The rest pose is
the clips', standing on the floor; the tips of bones are joints whose names end in `_end`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from study import __version__
from study.arrays import FloatArray, IntArray
from study.errors import MotionError
from study.files import write_whole
from study.motion.clip import Clip, rest_positions
from study.motion.readers.gltf import END
from study.motion.readers.gltf_file import pack
from study.motion.readers.rigid import unique
from study.motion.skeleton import Skeleton

_FLOAT, _SHORT, _VERTICES, _INDICES = 5126, 5123, 34962, 34963
# A bone is a double pyramid: its widest place is this far along it, and this far from its middle, of its length.
_ALONG, _WIDE = 0.2, 0.1
_FACES = np.array([[0, 2, 1], [0, 3, 2], [0, 4, 3], [0, 1, 4], [5, 1, 2], [5, 2, 3], [5, 3, 4], [5, 4, 1]])


def write_glb(clips: Mapping[str, Clip], path: Path | str) -> None:
    """Write clips of one skeleton as the animations of a `.glb` file, whole or not at all.

    Parameters
    ----------
    clips
        By the names that the animations get; each at its own frame rate.
    path
        The file; one that is there is replaced.

    Raises
    ------
    MotionError
        Where there are no clips, or not all are on the skeleton of the first (`study.motion.clip.retarget`).
    FileError
        Where the file can't be written.
    """
    skeleton = next(iter(clips.values())).skeleton if clips else None
    if skeleton is None or any(clip.skeleton is not skeleton for clip in clips.values()):
        raise MotionError(f"Expected clips on one skeleton to write, found {len(clips)}, or other skeletons.")
    file = _File()
    rest = rest_positions(skeleton, ends=True)
    rest[:, 1] -= rest[:, 1].min()
    names = unique([*skeleton.names, *(skeleton.names[parent] + END for parent in skeleton.end_parents)])
    parents = np.concatenate([skeleton.parents, skeleton.end_parents])
    nodes: list[dict[str, Any]] = []
    for joint, parent in enumerate(parents.tolist()):
        place = rest[joint] - (rest[parent] if parent >= 0 else 0.0)
        nodes.append({"name": names[joint], "translation": place.tolist()})
        if children := np.flatnonzero(parents == joint).tolist():
            nodes[-1]["children"] = children
    inverse = np.tile(np.eye(4), (len(rest), 1, 1))
    inverse[:, 3, :3] = -rest  # matrices are stored by columns
    bind = file.add(inverse.reshape(-1, 16), "MAT4")
    root = {
        "asset": {"version": "2.0", "generator": f"Segue {__version__}"},
        "scene": 0,
        "scenes": [{"nodes": [0, len(rest)]}],
        "nodes": [*nodes, {"name": "bones", "mesh": 0, "skin": 0}],
        "meshes": [{"name": "bones", "primitives": [_bones(file, skeleton, rest)]}],
        "skins": [{"joints": list(range(len(rest))), "inverseBindMatrices": bind}],
        "animations": [_animation(file, name, clip) for name, clip in clips.items()],
        "accessors": file.accessors,
        "bufferViews": file.views,
        "buffers": [{"byteLength": len(file.data)}],
    }
    write_whole(path, pack(json.dumps(root, separators=(",", ":")).encode(), bytes(file.data)))


class _File:
    """The numbers of a file as they are added."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.accessors: list[dict[str, Any]] = []
        self.views: list[dict[str, Any]] = []

    def add(self, rows: FloatArray | IntArray, kind: str, target: int | None = None, *, bounds: bool = False) -> int:
        """Rows `(n, width)`, floats or whole numbers; gives the number of their accessor."""
        floats = np.issubdtype(rows.dtype, np.floating)
        kept = rows.astype("<f4" if floats else "<u2")
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": kept.nbytes}
        self.views.append(view if target is None else {**view, "target": target})
        self.data += kept.tobytes() + bytes(-kept.nbytes % 4)
        about = {"bufferView": len(self.views) - 1, "componentType": _FLOAT if floats else _SHORT}
        limits = {"min": kept.min(axis=0).tolist(), "max": kept.max(axis=0).tolist()} if bounds else {}
        self.accessors.append({**about, "count": len(kept), "type": kind, **limits})
        return len(self.accessors) - 1


def _bones(file: _File, skeleton: Skeleton, rest: FloatArray) -> dict[str, Any]:
    """The mesh: a slim double pyramid from joint to joint, each on the joint that it hangs on."""
    upper, lower = skeleton.bones[np.linalg.norm(np.diff(rest[skeleton.bones], axis=1)[:, 0], axis=1) > 1e-6].T
    if not len(upper):
        raise MotionError("Expected a skeleton with bones of some length to write, found none.")
    start, along = rest[upper], rest[lower] - rest[upper]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    across = np.where(np.abs(along[:, :1]) < 0.9 * length, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    side = np.cross(along, across)
    side *= length / np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(along / length, side)
    around = (start + _ALONG * along + _WIDE * way for way in (side, other, -side, -other))
    corners = np.stack([start, *around, rest[lower]], axis=1).reshape(-1, 3)
    faces = (_FACES + 6 * np.arange(len(start))[:, None, None]).reshape(-1, 1)
    joints = np.repeat(upper, 6)[:, None] * np.array([1, 0, 0, 0])
    weights = np.tile([1.0, 0.0, 0.0, 0.0], (len(corners), 1))
    attributes = {
        "POSITION": file.add(corners, "VEC3", _VERTICES, bounds=True),
        "JOINTS_0": file.add(joints, "VEC4", _VERTICES),
        "WEIGHTS_0": file.add(weights, "VEC4", _VERTICES),
    }
    return {"attributes": attributes, "indices": file.add(faces, "SCALAR", _INDICES)}


def _animation(file: _File, name: str, clip: Clip) -> dict[str, Any]:
    """A clip as an animation: the root's path, and a rotation of each joint."""
    times = file.add((np.arange(clip.frames) / clip.fps)[:, None], "SCALAR", bounds=True)
    turns = clip.rotations[..., [1, 2, 3, 0]]
    outputs = [file.add(clip.root_positions, "VEC3"), *(file.add(turns[:, j], "VEC4") for j in range(turns.shape[1]))]
    targets = [(0, "translation"), *((joint, "rotation") for joint in range(turns.shape[1]))]
    return {
        "name": name,
        "samplers": [{"input": times, "output": output} for output in outputs],
        "channels": [
            {"sampler": at, "target": {"node": node, "path": kind}} for at, (node, kind) in enumerate(targets)
        ],
    }
