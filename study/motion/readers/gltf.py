"""glTF 2.0 files (`.glb`, `.gltf`) to clips: skins and animations as Blender, Maya and game engines export them.

In: a file with one animation, or `hero.glb/walk`, the animation `walk` of a file with several. Out: `Clip`. Lengths are
metres and Y is up, as the format says. The joints are those of the largest skin, or without skins all nodes that move;
what stands above them, such as an armature in another unit or turned upright, is taken into them. Scales of nodes are
taken into the lengths where they are the same along all axes and constant, and refused otherwise. Rotations are counted
from the rest pose of the nodes, as in BVH files, so that a clip's rest pose is the file's.

Source: glTF 2.0 Specification, sections 3.5.3 (transformations), 3.7.3 (skins), 3.11 (animations), appendix C.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from study.arrays import FloatArray
from study.errors import MotionFileError
from study.motion import quaternions as quat
from study.motion.clip import Clip, refuse_large
from study.motion.readers.frame_times import tidy_rate
from study.motion.readers.gltf_file import Document, bare_name, file_of, is_animation, read_document, shown, unique
from study.motion.readers.rigid import Measured, rigid_clip
from study.motion.skeleton import MOST_JOINTS

# Scales that differ by less are one.
_ALIKE = 1e-3
# Keys that are further apart than this are sampled in between; keys at uneven times at the second rate.
_SLOWEST_FPS, _USUAL_FPS, _UNEVEN_FPS = 20.0, 30.0, 60.0
_USUAL_RATES = (30.0, 24.0, 25.0, 60.0, 50.0, 120.0, 100.0, 240.0)
_ON_FRAME = 0.02
# Poses that few keys may be sampled to, and poses for each key beyond that.
_FEW_POSES, _POSES_A_KEY = 1_000_000, 100
# Bones that Unreal adds beside the body, to hold hands and feet to.
_HELPER = "ik_"
END = "_end"
"""How the name of a bone's tip ends, which `gltf_writing` writes as a node of its own."""


@dataclass(frozen=True, eq=False)
class Node:
    """A node at rest."""

    parent: int
    translation: FloatArray
    rotation: FloatArray
    scale: FloatArray


@dataclass(frozen=True, eq=False)
class Track:
    """What an animation does with one property of a node."""

    place: str
    times: FloatArray
    """`(keys,)`, seconds, ascending."""
    values: FloatArray
    """`(keys, 3 or 4)`; rotations scalar first, unit."""
    tangents: tuple[FloatArray, FloatArray] | None
    """In and out, of cubic splines."""
    stepped: bool

    def at(self, times: FloatArray) -> FloatArray:
        """The property at `(n,)` seconds; before the first key and after the last as there."""
        # Times are in single precision: a frame that falls on a key up to that is meant to be on it.
        close = 4 * np.finfo(np.float32).eps * max(1.0, float(np.max(times)))
        before = np.clip(np.searchsorted(self.times, times + close, side="right") - 1, 0, len(self.times) - 1)
        after = np.minimum(before + 1, len(self.times) - 1)
        if self.stepped:
            return self.values[before]
        step = np.where(after > before, self.times[after] - self.times[before], 1.0)
        u = np.clip((times - self.times[before]) / step, 0.0, 1.0)
        u = np.where(np.abs(times - self.times[before]) <= close, 0.0, u)
        rotation = self.values.shape[1] == 4
        if self.tangents is None and rotation:
            return quat.slerp(self.values[before], self.values[after], u)
        u, step = u[:, None], step[:, None]
        if self.tangents is None:
            return self.values[before] + u * (self.values[after] - self.values[before])
        leaves, arrives = step * self.tangents[1][before], step * self.tangents[0][after]
        mixed = (
            (2 * u**3 - 3 * u**2 + 1) * self.values[before]
            + (u**3 - 2 * u**2 + u) * leaves
            + (3 * u**2 - 2 * u**3) * self.values[after]
            + (u**3 - u**2) * arrives
        )
        return quat.normalise(mixed) if rotation else mixed


Tracks = Mapping[tuple[int, str], Track]


def read_gltf(
    path: Path | str,
    *,
    metres_per_unit: float | None = None,
    fps: float | None = None,
    mapping: Mapping[str, str] | None = None,
) -> Clip:
    """Read an animation of a glTF file; parameters as `study.motion.readers.registry.read_clip` takes them.

    Keys give the frame rate; `fps` samples the animation at another. Where keys stand at no common rate, 60 frames a
    second are taken.

    Raises
    ------
    MotionFileError
        For anything that can't be read without guessing, with the part of the file; for a file of several animations.

    Warns
    -----
    MotionWarning
        Where the position of a joint in its parent varies (its median is taken), or metres give no plausible body.
    """
    path = Path(path)
    document = read_document(file_of(path))
    number = _chosen(document, path)
    nodes = _nodes(document)
    tracks = _tracks(document, number)
    above, joints = _joints(document, nodes, tracks)
    keys = [tracks[key].times for key in tracks if key[0] in joints]
    rate, start, stop = fps or _frame_rate(keys), min(k[0] for k in keys), max(k[-1] for k in keys)
    frames = int((stop - start) * rate + _ON_FRAME) + 1
    refuse_large(frames, len(joints), str(path))
    if frames * len(joints) > max(_FEW_POSES, _POSES_A_KEY * sum(map(len, keys))):
        document.refuse(f"animations[{number}]", f"Expected keys over less time, found them over {stop - start:.6g} s.")
    measured = _measured(document, nodes, tracks, above, joints, start + np.arange(frames) / rate)
    notes = [f"read from {document.path.name}, animation {document.animation_names[number]!r}"]
    notes.append(f"sampled at {rate:g} fps" + ("" if fps is None else ", as told"))
    return rigid_clip(document.source, bare_name(path), measured, rate, metres_per_unit, mapping, notes, stated=1.0)


def _chosen(document: Document, path: Path) -> int:
    """The number of the animation that is meant."""
    names = document.animation_names
    if is_animation(path) and path.name in names:
        return names.index(path.name)
    if len(names) == 1 and not is_animation(path):
        return 0
    listed = ", ".join(names[:20]) + (", ..." if len(names) > 20 else "")
    raise MotionFileError(
        f"Expected an animation of this file, found {listed or 'none in it'}. "
        + (f"Name one, such as {document.path / names[0]}." if names else "Export it with its animation."),
        path,
    )


def _nodes(document: Document) -> list[Node]:
    """All nodes; every one has at most one parent, and none stands below itself."""
    count = len(document.items("nodes"))
    parents, found = [-1] * count, []
    for number in range(count):
        children = document.item("nodes", number, "nodes").get("children", [])
        for child in children if isinstance(children, list) else [children]:
            document.item("nodes", child, f"nodes[{number}].children")
            if parents[child] >= 0:
                document.refuse(f"nodes[{number}].children", f"Expected one parent for node {child}, found another.")
            parents[child] = number
    done = [False] * count
    for number in range(count):
        way: set[int] = set()
        while number >= 0 and not done[number]:
            if number in way:
                document.refuse(f"nodes[{number}].children", "Expected a tree, found a node below itself.")
            way.add(number)
            number = parents[number]
        for one in way:
            done[one] = True
    for number, parent in enumerate(parents):
        found.append(Node(parent, *_at_rest(document, document.item("nodes", number, "nodes"), f"nodes[{number}]")))
    return found


def _at_rest(document: Document, node: dict[str, Any], place: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Translation, rotation and scale of a node."""
    if "matrix" in node:
        matrix = document.numbers(node["matrix"], 16, f"{place}.matrix").reshape(4, 4).T
        scale = np.linalg.norm(matrix[:3, :3], axis=0)
        turn = matrix[:3, :3] / np.maximum(scale, 1e-12)
        if not np.allclose(turn.T @ turn, np.eye(3), atol=_ALIKE) or np.linalg.det(turn) < 0:
            document.refuse(f"{place}.matrix", "Expected a rotation, a scale and a shift, found shear or a mirror.")
        return matrix[:3, 3], quat.from_matrix(turn), scale
    translation, rotation, scale = (
        document.numbers(node.get(name, usual), len(usual), f"{place}.{name}")
        for name, usual in (("translation", [0, 0, 0]), ("rotation", [0, 0, 0, 1]), ("scale", [1, 1, 1]))
    )
    return translation, _unit(document, rotation[None], f"{place}.rotation")[0], scale


def _unit(document: Document, rotations: FloatArray, place: str) -> FloatArray:
    """Rotations `(n, 4)` as the file has them, scalar last, as unit quaternions, scalar first."""
    lengths = np.linalg.norm(rotations, axis=1)
    if np.min(lengths) < 0.1:
        document.refuse(place, f"Expected unit quaternions, found {rotations[int(np.argmin(lengths))].tolist()}.")
    return np.asarray((rotations / lengths[:, None])[:, [3, 0, 1, 2]])


def _tracks(document: Document, number: int) -> Tracks:
    """The channels of an animation by node and property; targets other than nodes are passed over."""
    animation = document.item("animations", number, "animations")
    place = f"animations[{number}]"
    channels, samplers = animation.get("channels"), animation.get("samplers")
    if not isinstance(channels, list) or not isinstance(samplers, list):
        document.refuse(place, "Expected lists of channels and samplers, found none. Export it anew.")
    found: dict[tuple[int, str], Track] = {}
    for at, channel in enumerate(channels):
        target = channel.get("target") if isinstance(channel, dict) else None
        if not isinstance(target, dict):
            document.refuse(f"{place}.channels[{at}]", f"Expected an object with a target, found {shown(channel)}.")
        sampler, node = channel.get("sampler"), target.get("node")
        if target.get("path") not in ("translation", "rotation", "scale") or node is None:
            continue
        document.item("nodes", node, f"{place}.channels[{at}].target.node")
        if isinstance(sampler, bool) or not isinstance(sampler, int) or not 0 <= sampler < len(samplers):
            document.refuse(f"{place}.channels[{at}].sampler", f"Expected a sampler, found {shown(sampler)}.")
        if (node, target["path"]) not in found:
            found[node, target["path"]] = _track(
                document, samplers[sampler], target["path"], f"{place}.samplers[{sampler}]"
            )
    return found


def _track(document: Document, sampler: object, kind: str, place: str) -> Track:
    if not isinstance(sampler, dict):
        document.refuse(place, f"Expected an object, found {shown(sampler)}.")
    way = sampler.get("interpolation", "LINEAR")
    if way not in ("LINEAR", "STEP", "CUBICSPLINE"):
        document.refuse(f"{place}.interpolation", f"Expected LINEAR, STEP or CUBICSPLINE, found {shown(way)}.")
    times = document.array(sampler.get("input"), "SCALAR", f"{place}.input")[:, 0]
    rows = document.array(sampler.get("output"), "VEC4" if kind == "rotation" else "VEC3", f"{place}.output")
    if np.any(np.diff(times) <= 0.0) or times[0] < 0.0:
        document.refuse(f"{place}.input", "Expected times from 0 that grow from key to key, found others.")
    keys = len(times)
    if len(rows) != keys * (3 if way == "CUBICSPLINE" else 1):
        document.refuse(f"{place}.output", f"Expected values for {keys} keys ({way}), found {len(rows)} rows.")
    tangents = None
    if way == "CUBICSPLINE":
        arrives, rows, leaves = rows.reshape(keys, 3, -1).transpose(1, 0, 2)
        order = [3, 0, 1, 2] if kind == "rotation" else [0, 1, 2]
        length = np.linalg.norm(rows, axis=1)[:, None] if kind == "rotation" else 1.0
        tangents = ((arrives / np.maximum(length, 0.1))[:, order], (leaves / np.maximum(length, 0.1))[:, order])
    values = _unit(document, rows, f"{place}.output") if kind == "rotation" else rows
    return Track(place, times, values, tangents, way == "STEP")


def _joints(document: Document, nodes: list[Node], tracks: Tracks) -> tuple[list[int], list[int]]:
    """The nodes above the skeleton from the top down, and its joints, parents first, the ends of bones included."""

    def way(node: int) -> list[int]:
        up = [node]
        while nodes[up[-1]].parent >= 0:
            up.append(nodes[up[-1]].parent)
        return up[::-1]

    moving = {node for node, _ in tracks}
    skins = [
        {n for n in joints if document.item("nodes", n, f"skins[{s}].joints")}
        for s in range(len(document.items("skins")))
        if isinstance(joints := document.item("skins", s, "skins").get("joints"), list)
    ]
    wanted = max(skins, key=lambda skin: (len(skin), len(skin & moving)), default=moving)
    wanted = wanted.union(*(skin for skin in skins if skin & wanted))
    ways = {node: way(node) for node in wanted}
    tops = Counter(up[0] for up in ways.values())
    ways = {node: up for node, up in ways.items() if up[0] == max(tops, key=lambda top: tops[top])}
    if not ways or not moving & set().union(*ways.values()):
        document.refuse("animations", "Expected one that moves joints of a skin or nodes, found none that does.")
    shared = min(map(len, ways.values()))
    common = next((k for k in range(shared) if len({up[k] for up in ways.values()}) > 1), shared)
    chain = next(iter(ways.values()))[:common]
    root = next((k for k, node in enumerate(chain) if node in moving or node in wanted), len(chain) - 1)
    inside = {node for up in ways.values() for node in up[root:]}
    children: dict[int, list[int]] = {}
    for number in range(len(nodes)):
        name, parent = document.name("nodes", number).lower(), nodes[number].parent
        if parent in inside and (number in inside or name.endswith(END)) and not name.startswith(_HELPER):
            children.setdefault(parent, []).append(number)
    ordered, waiting = [], [chain[root]]
    while waiting:
        ordered.append(waiting.pop())
        waiting += children.get(ordered[-1], [])[::-1]
    if len(ordered) > MOST_JOINTS:
        document.refuse("nodes", f"Expected at most {MOST_JOINTS} joints, found {len(ordered)}.")
    return chain[:root], ordered


def _frame_rate(times: list[FloatArray]) -> float:
    """Frames per second at which all keys fall on frames: that of the track with most keys, or a usual one."""
    keys = np.unique(np.concatenate(times))
    most = max(times, key=len)
    own = (len(most) - 1) / (most[-1] - most[0]) if len(most) > 1 else _USUAL_FPS
    for rate in (tidy_rate(own), *_USUAL_RATES):
        frames = (keys - keys[0]) * rate
        if np.all(np.abs(frames - np.round(frames)) < _ON_FRAME):
            return rate if rate >= _SLOWEST_FPS else rate * float(np.ceil(_USUAL_FPS / rate))
    return _UNEVEN_FPS


def _measured(
    document: Document, nodes: list[Node], tracks: Tracks, above: list[int], joints: list[int], times: FloatArray
) -> Measured:
    """The body in the file's unit: rotations counted from the rest pose, lengths with the scales of the nodes."""
    turn, place, size = quat.IDENTITY, np.zeros(3), 1.0
    for number in above:
        node = nodes[number]
        place = place + quat.rotate(turn, node.translation * size)
        turn, size = quat.multiply(turn, node.rotation), size * _one_scale(document, node.scale, number)
    names = unique([document.name("nodes", number) for number in joints])
    leaf = set(joints) - {nodes[number].parent for number in joints[1:]}
    ends = [n for n in joints[1:] if n in leaf and document.name("nodes", n).lower().endswith(END)
            and not {(n, "rotation"), (n, "translation")} & tracks.keys()]  # fmt: skip
    kept = [number for number in joints if number not in ends]
    index = {number: j for j, number in enumerate(kept)}
    turns, sizes = {nodes[joints[0]].parent: turn}, {nodes[joints[0]].parent: size}
    offsets, paths = np.zeros((len(kept), 3)), {}
    rotations = np.empty((len(kept), len(times), 4))
    end_offsets = []
    for number in joints:
        node = nodes[number]
        turn, size = turns[node.parent], sizes[node.parent]
        offset = quat.rotate(turn, node.translation * size)
        if number in ends:
            end_offsets.append(offset)
            continue
        j = index[number]
        turns[number] = quat.multiply(turn, node.rotation)
        if number in {nodes[n].parent for n in joints}:
            sizes[number] = size * _one_scale(document, _scale(document, tracks, number, node), number)
        offsets[j] = offset
        moved, turned = tracks.get((number, "translation")), tracks.get((number, "rotation"))
        if moved is not None or j == 0:
            path = node.translation if moved is None else moved.at(times)
            paths[j] = np.broadcast_to(quat.rotate(turn, path * size) + (place if j == 0 else 0.0), (len(times), 3))
        local = node.rotation if turned is None else turned.at(times)
        rotations[j] = quat.multiply(quat.multiply(turn, local), quat.conjugate(turns[number]))
    return Measured(
        tuple(name for name, number in zip(names, joints, strict=True) if number not in ends),
        np.array([-1, *(index[nodes[number].parent] for number in kept[1:])]),
        offsets,
        np.array([index[nodes[number].parent] for number in ends], dtype=np.int64),
        np.array(end_offsets).reshape(-1, 3),
        paths,
        rotations.transpose(1, 0, 2),
    )


def _scale(document: Document, tracks: Tracks, number: int, node: Node) -> FloatArray:
    """The scale of a joint, which may be animated if it stays the same."""
    track = tracks.get((number, "scale"))
    if track is None:
        return node.scale
    if np.any(np.abs(track.values - track.values[0]) > _ALIKE * np.abs(track.values[0])):
        name = document.name("nodes", number)
        document.refuse(f"{track.place}.output", f"Expected a constant scale of {name!r}, found one that varies: "
                                                 "a clip has bones of constant length. Export it without.")  # fmt: skip
    return np.asarray(track.values[0])


def _one_scale(document: Document, scale: FloatArray, number: int) -> float:
    """The scale along all axes; refused where they differ, or mirror or flatten what hangs on the node."""
    if scale[0] <= 1e-9 or np.any(np.abs(scale - scale[0]) > _ALIKE * scale[0]):
        document.refuse(
            f"nodes[{number}].scale",
            f"Expected one scale above 0 along x, y and z for {document.name('nodes', number)!r}, found "
            f"{scale.tolist()}. Apply the scale in the program that wrote the file.",
        )
    return float(scale[0])
