"""Clips to a binary glTF 2.0 file: one skeleton, one animation a clip, and a body of thin bones that carries them.

Metres, Y up, seconds; a key in each frame, linear between. Engines (Unreal, Unity) import a skeleton and its animations
with a skinned mesh alone, so each bone has one: eight triangles, which also show the motion at once. The rest pose is
the clips', standing on the floor; the tips of bones are joints whose names end in `_end`.

Written by hand: what is needed of the format is a few dozen lines, and the libraries for it hold the same structures
without the arrays in them.
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
from study.motion.clip import Clip
from study.motion.readers.gltf import END
from study.motion.readers.gltf_file import pack, unique
from study.motion.skeleton import Skeleton

_FLOAT, _SHORT = 5126, 5123
_VERTICES, _INDICES = 34962, 34963
# A bone's corners: along it, and to both sides of it; its middle is this far along, and this wide, of its length.
_ALONG, _WIDE = 0.15, 0.06
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
    count = skeleton.joints + len(skeleton.end_parents)
    rest, names = _rest(skeleton), unique([*skeleton.names, *(skeleton.names[p] + END for p in skeleton.end_parents)])
    parents = np.concatenate([skeleton.parents, skeleton.end_parents])
    nodes: list[dict[str, Any]] = []
    for joint, (name, parent) in enumerate(zip(names, parents.tolist(), strict=True)):
        place = rest[joint] - (rest[parent] if parent >= 0 else 0.0)
        nodes.append({"name": name, "translation": place.tolist()})
        if children := np.flatnonzero(parents == joint).tolist():
            nodes[-1]["children"] = children
    nodes.append({"name": "bones", "mesh": 0, "skin": 0})
    inverse = np.tile(np.eye(4), (count, 1, 1))
    inverse[:, 3, :3] = -rest  # matrices are stored by columns
    skin = {"joints": list(range(count)), "inverseBindMatrices": file.add(inverse.reshape(count, 16), "MAT4")}
    root = {
        "asset": {"version": "2.0", "generator": f"Segue {__version__}"},
        "scene": 0,
        "scenes": [{"nodes": [0, count]}],
        "nodes": nodes,
        "meshes": [{"name": "bones", "primitives": [_bones(file, skeleton, rest)]}],
        "skins": [skin],
        "animations": [_animation(file, name, clip) for name, clip in clips.items()],
    }
    write_whole(path, pack(json.dumps(root | file.parts(), separators=(",", ":")).encode(), bytes(file.data)))


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
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": _FLOAT if floats else _SHORT,
                "count": len(kept),
                "type": kind,
                **({"min": kept.min(axis=0).tolist(), "max": kept.max(axis=0).tolist()} if bounds else {}),
            }
        )
        return len(self.accessors) - 1

    def parts(self) -> dict[str, Any]:
        """What the JSON says of them."""
        return {
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.data)}],
        }


def _rest(skeleton: Skeleton) -> FloatArray:
    """The rest pose with its lowest point on the floor, joints and then ends, `(joints + ends, 3)`, metres."""
    rest = np.zeros((skeleton.joints + len(skeleton.end_parents), 3))
    for bone in skeleton.bones:
        offset = (
            skeleton.offsets[bone[1]] if bone[1] < skeleton.joints else skeleton.end_offsets[bone[1] - skeleton.joints]
        )
        rest[bone[1]] = rest[bone[0]] + offset
    return np.asarray(rest - [0.0, rest[:, 1].min(), 0.0])


def _bones(file: _File, skeleton: Skeleton, rest: FloatArray) -> dict[str, Any]:
    """The mesh: a slim double pyramid from joint to joint, each on the joint that it hangs on."""
    upper, lower = skeleton.bones.T
    along = rest[lower] - rest[upper]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    there = length[:, 0] > 1e-6
    upper, along, length, start = upper[there], along[there], length[there], rest[upper[there]]
    side = np.cross(along / length, np.where(np.abs(along[:, :1]) < 0.9 * length, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    side = side / np.linalg.norm(side, axis=1, keepdims=True) * length
    other = np.cross(along / length, side)
    middle = start + _ALONG * along
    around = (middle + _WIDE * way for way in (side, other, -side, -other))
    corners = np.stack([start, *around, start + along], axis=1)
    faces = _FACES + 6 * np.arange(len(start))[:, None, None]
    joints = np.zeros((len(start) * 6, 4), dtype=np.int64)
    joints[:, 0] = np.repeat(upper, 6)
    weights = np.zeros(joints.shape)
    weights[:, 0] = 1.0
    return {
        "attributes": {
            "POSITION": file.add(corners.reshape(-1, 3), "VEC3", _VERTICES, bounds=True),
            "JOINTS_0": file.add(joints, "VEC4", _VERTICES),
            "WEIGHTS_0": file.add(weights, "VEC4", _VERTICES),
        },
        "indices": file.add(faces.reshape(-1, 1), "SCALAR", _INDICES),
    }


def _animation(file: _File, name: str, clip: Clip) -> dict[str, Any]:
    """A clip as an animation: the root's path, and a rotation of each joint."""
    times = file.add((np.arange(clip.frames) / clip.fps)[:, None], "SCALAR", bounds=True)
    outputs = [file.add(clip.root_positions, "VEC3")]
    outputs += [file.add(clip.rotations[:, joint][:, [1, 2, 3, 0]], "VEC4") for joint in range(clip.skeleton.joints)]
    targets = [(0, "translation"), *((joint, "rotation") for joint in range(clip.skeleton.joints))]
    return {
        "name": name,
        "samplers": [{"input": times, "output": output, "interpolation": "LINEAR"} for output in outputs],
        "channels": [
            {"sampler": sampler, "target": {"node": node, "path": kind}} for sampler, (node, kind) in enumerate(targets)
        ],
    }
