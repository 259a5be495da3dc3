"""A body as a motion file has it, in its unit and with joints that may change their place, to a clip in metres.

A clip has bones of constant length and a root that moves: constant places say how long the bones are, a root that only
carries the body is folded into it, and what a clip can't hold causes a warning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from study.arrays import FloatArray, IntArray
from study.motion import quaternions as quat
from study.motion.clip import Clip, some_frames, with_roles
from study.motion.readers.source import Source
from study.motion.skeleton import Skeleton
from study.motion.units import find_scale

# A bone whose length the data changes by less than this (metres) is taken as rigid.
_RIGID_M = 1e-4


@dataclass(frozen=True, eq=False)
class Measured:
    """What a file says of a body and its motion, in its own unit; shapes as in `Skeleton` and `Clip`."""

    names: tuple[str, ...]
    parents: IntArray
    offsets: FloatArray
    end_parents: IntArray
    end_offsets: FloatArray
    paths: Mapping[int, FloatArray]
    """Places of joints in their parents `(frames, 3)`: of the root, and of those that have them in each frame."""
    rotations: FloatArray


def unique(names: Sequence[str]) -> tuple[str, ...]:
    """The names, with `_2`, `_3` ... behind those that stand before."""
    found: dict[str, int] = {}
    for name in names:
        one = name
        while one in found:
            found[name] += 1
            one = f"{name}_{found[name]}"
        found[one] = 1
    return tuple(found)


def rigid_clip(
    source: Source,
    name: str,
    body: Measured,
    fps: float,
    metres_per_unit: float | None,
    mapping: Mapping[str, str] | None,
    history: list[str],
    *,
    stated: float | None = None,
) -> Clip:
    """The clip, with what was mended noted after the lines of `history`.

    The unit is `metres_per_unit` where that is told, else found from the legs of the body; where it has none, it is the
    one that the format has `stated`, or found from the whole body.
    """
    offsets, paths, parents, rotations = body.offsets.copy(), dict(body.paths), body.parents, body.rotations
    # Constant places first: on rigs with six channels everywhere the data say how long the bones are.
    for j, path in paths.items():
        if j > 0:
            offsets[j] = np.median(path, axis=0)
    whole = Skeleton(body.names, parents, offsets, body.end_parents, body.end_offsets)
    some = some_frames(len(rotations))
    found = with_roles(Clip(whole, paths[0][some], rotations[some], fps), mapping).skeleton
    if metres_per_unit is None:
        metres_per_unit = _unit(source, found, stated, history)
    else:
        history.append(f"lengths x {metres_per_unit:.6g} m, as told")
    root = 0
    while _rides(root, parents, body.end_parents.tolist(), paths, metres_per_unit):
        child, rotations = root + 1, rotations.copy()
        paths[child] = paths[root] + quat.rotate(rotations[:, root], paths[child])
        rotations[:, child] = quat.multiply(rotations[:, root], rotations[:, child])
        history.append(f"joint {body.names[root]!r} folded into {body.names[child]!r}, which moves in it")
        root = child
    for j, path in paths.items():
        if j > root:
            _check_rigid(source, body.names[j], path, offsets[j], metres_per_unit)
    skeleton = Skeleton(
        body.names[root:],
        np.where(parents[root:] < root, -1, parents[root:] - root),
        offsets[root:] * metres_per_unit,
        body.end_parents - root,
        body.end_offsets * metres_per_unit,
        found.body.without_first(root),
    )
    return Clip(
        skeleton,
        paths[root] * metres_per_unit,
        rotations[:, root:],
        fps,
        name=name,
        history=tuple(history),
        metres_per_unit=metres_per_unit,
    )


def _unit(source: Source, skeleton: Skeleton, stated: float | None, history: list[str]) -> float:
    """Metres in a unit, noted in the history; a warning where no unit gives a person's size, or not the stated one."""
    scale = find_scale(skeleton)
    if stated is not None and not scale.by_legs:
        history.append(f"lengths x {stated:.6g} m, as the format says")
        return stated
    history.append(scale.note)
    if scale.by_legs and not (scale.plausible and stated in (None, scale.metres_per_unit)):
        why = "the format has another" if scale.plausible else "a person has another size"
        source.warn(f"{scale.note}; {why}: say `unit` in library.toml")
    return scale.metres_per_unit


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
