"""glTF 2.0 files (`.glb`, `.gltf`) to clips: skins and animations as Blender, Maya and game engines export them.

In: a file with one animation, or `hero.glb/walk`, the animation `walk` of a file with several. Out: `Clip`. Lengths are
metres and Y is up, as the format says. The joints are those of the largest skin, or without skins all nodes that move;
what stands above them, such as an armature in another unit or turned upright, is taken into them. Scales of nodes are
taken into the lengths where they are the same along all axes and constant, and refused otherwise. Rotations are counted
from the rest pose of the nodes, as in BVH files, so that a clip's rest pose is the file's.

Source: glTF 2.0 Specification, sections 3.5.3 (transformations), 3.7.3 (skins), 3.11 (animations), appendix C.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from study.arrays import FloatArray
from study.errors import MotionFileError
from study.motion import quaternions as quat
from study.motion.clip import Clip, refuse_large
from study.motion.readers.frame_times import tidy_rate
from study.motion.readers.gltf_file import Document, bare_name, file_of, is_animation, read_document
from study.motion.readers.rigid import Measured, rigid_clip, unique
from study.motion.readers.source import Source
from study.motion.skeleton import MOST_JOINTS

# Scales that differ by less are one.
_ALIKE = 1e-3
# Keys that are further apart than this are sampled in between; keys at uneven times at the second rate.
_SLOWEST_FPS, _USUAL_FPS, _UNEVEN_FPS = 20.0, 30.0, 60.0
_USUAL_RATES = (30.0, 24.0, 25.0, 60.0, 50.0, 120.0, 100.0, 240.0)
_ON_FRAME = 0.02
# Poses that few keys may be sampled to, and poses for each key beyond that.
_FEW_POSES, _POSES_A_KEY = 1_000_000, 100
END = "_end"
"""How the name of a bone's tip ends, which `gltf_writing` writes as a node of its own."""

# Properties of a node at rest, rotations scalar last as files have them.
_REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}
_SCALAR_FIRST = [3, 0, 1, 2]


@dataclass(frozen=True, eq=False)
class Node:
    """A node at rest."""

    parent: int
    translation: FloatArray
    rotation: FloatArray
    scale: FloatArray


@dataclass(frozen=True, eq=False)
class Track:
    """What an animation does with one property of a node: keys `(keys,)`, seconds, and values `(keys, 3 or 4)`."""

    place: str
    times: FloatArray
    values: FloatArray
    tangents: tuple[FloatArray, FloatArray] | None
    """In and out, of cubic splines."""
    stepped: bool

    def at(self, times: FloatArray) -> FloatArray:
        """The property at `(n,)` seconds; before the first key and after the last as there."""
        # Times are in single precision: a frame that falls on a key up to that is meant to be on it.
        close = 4 * np.finfo(np.float32).eps * max(1.0, float(np.max(times)))
        before = np.clip(np.searchsorted(self.times, times + close, side="right") - 1, 0, len(self.times) - 1)
        after = np.minimum(before + 1, len(self.times) - 1)
        since = times - self.times[before]
        step = np.where(after > before, self.times[after] - self.times[before], 1.0)
        u = np.where((np.abs(since) <= close) | self.stepped, 0.0, np.clip(since / step, 0.0, 1.0))
        start, stop, rotation = self.values[before], self.values[after], self.values.shape[1] == 4
        if self.tangents is None and rotation:
            return quat.slerp(start, stop, u)
        u, step = u[:, None], step[:, None]
        if self.tangents is None:
            return start + u * (stop - start)
        leaves, arrives = step * self.tangents[1][before], step * self.tangents[0][after]
        mixed = (
            start + (3 * u**2 - 2 * u**3) * (stop - start) + (u**3 - 2 * u**2 + u) * leaves + (u**3 - u**2) * arrives
        )
        return quat.normalise(mixed) if rotation else mixed


Nodes = Mapping[int, Node]
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
    nodes, tracks = _nodes(document), _tracks(document, number)
    above, joints = _joints(document, nodes, tracks)
    keys = [track.times for (node, _), track in tracks.items() if node in joints]
    rate, start, stop = fps or _frame_rate(keys), min(k[0] for k in keys), max(k[-1] for k in keys)
    frames = int((stop - start) * rate + _ON_FRAME) + 1
    refuse_large(frames, len(joints), str(path))
    if frames * len(joints) > max(_FEW_POSES, _POSES_A_KEY * sum(map(len, keys))):
        document.refuse(f"animations[{number}]", "keys over less time", f"{stop - start:.6g} s")
    measured = _measured(document, nodes, tracks, above, joints, start + np.arange(frames) / rate)
    notes = [f"read from {document.path.name}, animation {document.animation_names[number]!r}"]
    notes.append(f"sampled at {rate:g} fps" + ("" if fps is None else ", as told"))
    source = Source(document.path, b"")
    return rigid_clip(source, bare_name(path), measured, rate, metres_per_unit, mapping, notes, stated=1.0)


def _chosen(document: Document, path: Path) -> int:
    """The number of the animation that is meant."""
    names = document.animation_names
    if is_animation(path) and path.name in names:
        return names.index(path.name)
    if len(names) == 1 and not is_animation(path):
        return 0
    listed = ", ".join(names[:20]) + (", ..." if len(names) > 20 else "")
    advice = f"Name one, such as {document.path / names[0]}." if names else "Export it with its animation."
    raise MotionFileError(f"Expected an animation of this file, found {listed or 'none in it'}. {advice}", path)


def _nodes(document: Document) -> Nodes:
    """All nodes by number, parents first; every one has at most one parent, and none stands below itself."""
    count = len(document.items("nodes"))
    parents = dict.fromkeys(range(count), -1)
    below = [document.listed(document.item("nodes", n, "nodes").get("children", []), "children") for n in parents]
    for number, children in enumerate(below):
        for child in children:
            document.item("nodes", child, f"nodes[{number}].children")
            if parents[child] >= 0:
                document.refuse(f"nodes[{number}].children", "nodes that no other has as children", child)
            parents[child] = number
    reached = [number for number in parents if parents[number] < 0]
    for number in reached:
        reached += below[number]
    if len(reached) < count:
        number = min(set(parents).difference(reached))
        document.refuse(f"nodes[{number}].children", "a tree", "a node below itself")
    return {number: _at_rest(document, number, parents[number]) for number in reached}


def _at_rest(document: Document, number: int, parent: int) -> Node:
    node, place = document.item("nodes", number, "nodes"), f"nodes[{number}]"
    if "matrix" in node:
        matrix = document.numbers(node["matrix"], 16, f"{place}.matrix").reshape(4, 4).T
        scale = np.linalg.norm(matrix[:3, :3], axis=0)
        turn = matrix[:3, :3] / np.maximum(scale, 1e-12)
        if not np.allclose(turn.T @ turn, np.eye(3), atol=_ALIKE) or np.linalg.det(turn) < 0:
            document.refuse(f"{place}.matrix", "a rotation, a scale and a shift", "shear or a mirror")
        return Node(parent, matrix[:3, 3], quat.from_matrix(turn), scale)
    translation, rotation, scale = (
        document.numbers(node.get(name, list(usual)), len(usual), f"{place}.{name}") for name, usual in _REST.items()
    )
    return Node(parent, translation, _unit(document, rotation[None], f"{place}.rotation")[0], scale)


def _unit(document: Document, rotations: FloatArray, place: str) -> FloatArray:
    """Rotations `(n, 4)` as the file has them as unit quaternions, scalar first."""
    lengths = np.linalg.norm(rotations, axis=1)
    if np.min(lengths) < 0.1:
        document.refuse(place, "unit quaternions", rotations[int(np.argmin(lengths))].tolist())
    return np.asarray((rotations / lengths[:, None])[:, _SCALAR_FIRST])


def _tracks(document: Document, number: int) -> Tracks:
    """The channels of an animation by node and property; targets other than nodes are passed over."""
    animation, place = document.item("animations", number, "animations"), f"animations[{number}]"
    samplers = document.listed(animation.get("samplers"), f"{place}.samplers")
    found: dict[tuple[int, str], Track] = {}
    for at, channel in enumerate(document.listed(animation.get("channels"), f"{place}.channels")):
        here = f"{place}.channels[{at}]"
        target = channel.get("target") if isinstance(channel, dict) else None
        if not isinstance(target, dict):
            document.refuse(here, "an object with a target", channel)
        node, kind = target.get("node"), target.get("path")
        if kind in [*_REST] and node is not None:
            document.item("nodes", node, f"{here}.target.node")
            sampler = document.whole(channel.get("sampler"), f"{here}.sampler", len(samplers), "a number of samplers")
            found[node, kind] = _track(document, samplers[sampler], kind, f"{place}.samplers[{sampler}]")
    return found


def _track(document: Document, sampler: object, kind: str, place: str) -> Track:
    if not isinstance(sampler, dict):
        document.refuse(place, "an object", sampler)
    way = sampler.get("interpolation", "LINEAR")
    if way not in ("LINEAR", "STEP", "CUBICSPLINE"):
        document.refuse(f"{place}.interpolation", "LINEAR, STEP or CUBICSPLINE", way)
    times = document.array(sampler.get("input"), "SCALAR", f"{place}.input")[:, 0]
    rows = document.array(sampler.get("output"), "VEC4" if kind == "rotation" else "VEC3", f"{place}.output")
    if np.any(np.diff(times) <= 0.0) or times[0] < 0.0:
        document.refuse(f"{place}.input", "times from 0 that grow from key to key", "others")
    if len(rows) != (needed := len(times) * (3 if way == "CUBICSPLINE" else 1)):
        document.refuse(f"{place}.output", f"{needed} rows for {len(times)} keys ({way})", len(rows))
    tangents = None
    if way == "CUBICSPLINE":
        arrives, rows, leaves = rows.reshape(len(times), 3, -1).transpose(1, 0, 2)
        if kind == "rotation":
            length = np.maximum(np.linalg.norm(rows, axis=1)[:, None], 0.1)
            arrives, leaves = (arrives / length)[:, _SCALAR_FIRST], (leaves / length)[:, _SCALAR_FIRST]
        tangents = (arrives, leaves)
    values = _unit(document, rows, f"{place}.output") if kind == "rotation" else rows
    return Track(place, times, values, tangents, way == "STEP")


def _joints(document: Document, nodes: Nodes, tracks: Tracks) -> tuple[list[int], list[int]]:
    """The nodes above the skeleton from the top down, and its joints, parents first, the ends of bones included."""
    moving = {node for node, _ in tracks}
    skins = []
    for number in range(len(document.items("skins"))):
        place = f"skins[{number}].joints"
        joints = document.listed(document.item("skins", number, "skins").get("joints"), place)
        skins.append({joint for joint in joints if document.item("nodes", joint, place)})
    wanted = max(skins, key=lambda skin: (len(skin), len(skin & moving)), default=moving)
    wanted = wanted.union(*(skin for skin in skins if skin & wanted))
    # How many of them stand at or below each node, and which nodes stand directly below it, the last one first.
    counts, below = dict.fromkeys((-1, *nodes), 0), {number: list[int]() for number in (-1, *nodes)}
    for number in reversed(list(nodes)):
        counts[number] += number in wanted
        counts[nodes[number].parent] += counts[number]
        below[nodes[number].parent].append(number)
    root = max(below[-1], key=lambda top: counts[top], default=-1)
    above, total = [], counts[root]
    while not {root} & (moving | wanted) and (further := [n for n in below[root] if counts[n] == total > 0]):
        above.append(root)
        root = further[0]
    # Unreal has marks beside the body on a root that carries it, and bones `ik_` for hands and feet to hold to.
    body = [n for n in below[root] if below[n] and not document.name("nodes", n).startswith("ik_")]
    if len(body) == 1 and (body[0], "translation") in tracks:
        below[root] = body
    ordered, waiting = [], [root]
    while waiting:
        ordered.append(waiting.pop())
        for number in below[ordered[-1]]:
            name = document.name("nodes", number).lower()
            if counts[number] or name.endswith(END):
                waiting.append(number)
    if not moving.intersection(ordered) or len(ordered) > MOST_JOINTS:
        found = f"{len(ordered)} joints" if moving.intersection(ordered) else "none that moves"
        document.refuse("animations", f"one that moves joints of a skin, or nodes, {MOST_JOINTS} at most", found)
    return above, ordered


def _frame_rate(times: list[FloatArray]) -> float:
    """Frames per second at which all keys fall on frames: that of the track with most keys, or a usual one."""
    keys, most = np.unique(np.concatenate(times)), max(times, key=len)
    own = (len(most) - 1) / (most[-1] - most[0]) if len(most) > 1 else _USUAL_FPS
    for rate in (tidy_rate(own), *_USUAL_RATES):
        frames = (keys - keys[0]) * rate
        if np.all(np.abs(frames - np.round(frames)) < _ON_FRAME):
            return rate if rate >= _SLOWEST_FPS else rate * float(np.ceil(_USUAL_FPS / rate))
    return _UNEVEN_FPS


def _measured(
    document: Document, nodes: Nodes, tracks: Tracks, above: list[int], joints: list[int], times: FloatArray
) -> Measured:
    """The body in the file's unit: rotations counted from the rest pose, lengths with the scales of the nodes."""
    parents = [nodes[number].parent for number in joints]
    called = dict(zip(joints, unique([document.name("nodes", number) for number in joints]), strict=True))
    # What is known of each node: how it is turned in the world at rest, where it stands (above the joints), its size.
    turns, places, sizes = {-1: quat.IDENTITY}, {-1: np.zeros(3)}, {-1: 1.0}
    for number in (*above, *joints):
        node = nodes[number]
        turns[number] = quat.multiply(turns[node.parent], node.rotation)
        if number in above:
            place = quat.rotate(turns[node.parent], node.translation * sizes[node.parent])
            places[number] = places[node.parent] + place
        if number in above or number in parents:  # what a leaf's scale does, no joint shows
            sizes[number] = sizes[node.parent] * _scale(document, tracks, number, node)
    offsets = {n: quat.rotate(turns[nodes[n].parent], nodes[n].translation * sizes[nodes[n].parent]) for n in joints}
    ends = [n for n in joints[1:] if n not in parents and called[n].lower().endswith(END)]
    kept = [number for number in joints if number not in ends]
    index = {number: j for j, number in enumerate(kept)}
    paths, rotations = {}, np.empty((len(kept), len(times), 4))
    for j, number in enumerate(kept):
        node, turn = nodes[number], turns[nodes[number].parent]
        moved, turned = tracks.get((number, "translation")), tracks.get((number, "rotation"))
        if moved is not None or j == 0:
            path = (node.translation if moved is None else moved.at(times)) * sizes[node.parent]
            base = places[node.parent] if j == 0 else 0.0
            paths[j] = np.broadcast_to(quat.rotate(turn, path) + base, (len(times), 3))
        local = node.rotation if turned is None else turned.at(times)
        rotations[j] = quat.multiply(quat.multiply(turn, local), quat.conjugate(turns[number]))
    return Measured(
        tuple(called[number] for number in kept),
        np.array([-1, *(index[nodes[number].parent] for number in kept[1:])]),
        np.array([offsets[number] for number in kept]),
        np.array([index[nodes[number].parent] for number in ends], dtype=np.int64),
        np.array([offsets[number] for number in ends]).reshape(-1, 3),
        paths,
        rotations.transpose(1, 0, 2),
    )


def _scale(document: Document, tracks: Tracks, number: int, node: Node) -> float:
    """The scale of a node along all axes, animated or not; refused where it varies, mirrors, or differs among them."""
    track = tracks.get((number, "scale"))
    values = node.scale[None] if track is None else track.values
    scale = float(values[0, 0])
    if scale <= 1e-9 or np.any(np.abs(values - scale) > _ALIKE * scale):
        place = f"nodes[{number}].scale" if track is None else f"{track.place}.output"
        expected = f"one constant scale above 0 along x, y and z for {document.name('nodes', number)!r}"
        worst = values[int(np.argmax(np.abs(values - scale).max(axis=1)))]
        document.refuse(place, expected, worst.tolist(), "Apply the scale in the program that wrote the file.")
    return scale
