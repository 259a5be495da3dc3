"""What a transition from any frame of one clip to any frame of another costs: Lee et al. 2002, as studied in 2003.

In: two clips of one rig at one frame rate, weights, and nu. Out: the cost of every pair of frames, whole or in blocks
of rows, and its minimum. Wang & Bodenheimer 2003, section 2.1, Eqs. 1 and 2:

    D(i, j) = d(p_i, p_j) + nu d(v_i, v_j)
    d(p_i, p_j) = |root_i - root_j|^2 + sum over joints of weight |log(q_j^-1 q_i)|^2

The sum over joints needs an arccosine for each pair of frames and each joint that weighs something. All else is squared
distances of vectors, which one matrix product gives for all frames together.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from renderer.workers import run_jobs
from study.arrays import AnyFloat, FloatArray, IntArray
from study.errors import TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, retarget
from study.transitions.blending import facing
from study.transitions.distances import on_joints_of
from study.transitions.point_cloud import point_cloud, window_distances
from study.transitions.threads import one_blas_thread
from study.transitions.weights import joint_weights

Block = tuple[range, AnyFloat]

ROOTS = ("matched", "world", "none")
METRICS = ("joint", "pointcloud")

# The papers' frame rate: velocities are differences over this time, whatever the clips' own rate.
_PAPER_FPS = 30.0
# Kovar et al. 2002, section 4: windows of a third of a second.
WINDOW_S = 1.0 / 3.0
# A block is what is handed out, and what memory holds of a matrix that is not kept; a tile stays in a core's cache.
_BLOCK_ROWS, _TILE_COLUMNS = 256, 512
# One of two quaternions is shortened by so many units in the last place, more than products of unit ones are ever off;
# what that adds to the square of a half angle h, 2 h / tan(h) times as much, is taken away again to h squared.
_SHORT = 8.0


@dataclass(frozen=True)
class Extremes:
    """Where a cost matrix is least and greatest, and its least and greatest cost."""

    min: float
    argmin: tuple[int, int]
    """Source and destination frame of the least: the global optimum (2003 section 4.2); the first of equals."""
    max: float
    shape: tuple[int, int]
    """Source frames (or windows) and destination frames."""


def cost_matrix(
    source: Clip,
    destination: Clip,
    *,
    weights: str | Mapping[str, float] = "wang2003",
    nu: float = 1.0,
    root: str = "matched",
    precision: str = "double",
) -> AnyFloat:
    """The cost of a transition between all frames of two clips (2003 Eqs. 1 and 2).

    Parameters
    ----------
    source, destination
        Clips of one rig at one frame rate; the destination is put on the source's skeleton.
    weights
        As `joint_weights` takes them. The pelvis may weigh something: where the root plays it, its rotation counts
        without the facing.
    nu
        How much the velocities weigh beside the poses, 0 or more (2003: one).
    root
        What counts of the root's position and velocity. `"matched"`: the height, and the velocity as the figure sees it
        in its own facing, since a transition matches floor position and facing (2003 section 4.2); turning or moving a
        clip on the floor changes nothing. `"world"`: all three coordinates, as Eq. 2 prints. `"none"`: nothing.
    precision
        `"double"`, or `"single"`: almost twice as fast, good to about 1e-6.

    Returns
    -------
    (source frames, destination frames), float64 or float32: half angles squared, and metres squared.

    Raises
    ------
    TransitionError
        For clips of different rigs or frame rates, an unknown option, or weights that can't be used.
    MotionError
        Where the rig has no joint for a role that weighs something.

    Notes
    -----
    The papers don't say how velocities are measured. Here they are differences over the frames on either side, in half
    angles (for joints, in the joint's own frame) and metres for each 1/30 s, the papers' frame, at any frame rate. So
    measured they weigh little beside the poses, as 2003 reports (section 3: insensitive to nu).
    """
    out: AnyFloat = np.empty((source.frames, destination.frames), dtype=_kind(precision))
    for _ in joint_blocks(source, destination, weights=weights, nu=nu, root=root, precision=precision, into=out):
        pass
    return out


def joint_blocks(
    source: Clip,
    destination: Clip,
    *,
    weights: str | Mapping[str, float] = "wang2003",
    nu: float = 1.0,
    root: str = "matched",
    precision: str = "single",
    into: AnyFloat | None = None,
) -> Iterator[Block]:
    """`cost_matrix` in blocks of rows, in order: the rows of each, and their costs `(rows, destination frames)`.

    All cores work; no more than one block a core waits to be taken. With `into`, the blocks are written there.
    """
    destination = on_joints_of(source, destination)
    destination = retarget(destination, source.skeleton)
    if root not in ROOTS:
        raise TransitionError(f"Expected the root as {', '.join(ROOTS)}, got {root!r}.")
    if not (np.isfinite(nu) and nu >= 0):
        raise TransitionError(f"Expected nu, the weight of velocities, of 0 or more, got {nu}.")
    weight = joint_weights(source.skeleton, weights, with_root=True)
    kind = _kind(precision)
    a, b = (_terms(clip, weight, nu, root) for clip in (source, destination))
    left, right = _factors(a.vectors, b.vectors, kind)
    added = 2.0 * _SHORT * np.finfo(kind).eps
    joints = _joints(a.rotations, b.rotations, weight[weight > 0] * (1.0 + added / 3.0), kind)
    right[-1] -= added * weight.sum()

    def work(rows: range) -> Block:
        block = np.empty((len(rows), destination.frames), dtype=kind) if into is None else into[rows.start : rows.stop]
        _fill(block, left[rows.start : rows.stop], right, joints, slice(rows.start, rows.stop))
        return rows, block

    todo = [range(at, min(at + _BLOCK_ROWS, source.frames)) for at in range(0, source.frames, _BLOCK_ROWS)]
    with one_blas_thread():
        yield from (block for _, block in run_jobs(work, todo, threads=True, in_order=True))


def pointcloud_blocks(source: Clip, destination: Clip, *, window: int | None = None) -> Iterator[Block]:
    """Point cloud distances of all windows of two clips (Kovar et al. 2002) in blocks of rows, square metres.

    `window` is in frames, a third of a second unless given; rows and columns count the windows' first frames.
    """
    destination = on_joints_of(source, destination)
    a, b = (point_cloud(clip) for clip in (source, retarget(destination, source.skeleton)))
    window = max(1, round(WINDOW_S * source.fps)) if window is None else window
    count = max(source.frames - window + 1, 1)
    for at in range(0, count, _BLOCK_ROWS):
        rows = range(at, min(at + _BLOCK_ROWS, count))
        yield rows, window_distances(a, b, window, rows=rows)


def extremes(blocks: Iterable[Block]) -> Extremes:
    """Where a matrix that comes in blocks is least and greatest."""
    least, greatest, at, rows_seen, columns = np.inf, -np.inf, (0, 0), 0, 0
    for rows, block in blocks:
        rows_seen, columns = rows.stop, block.shape[1]
        row, column = np.unravel_index(int(np.argmin(block)), block.shape)
        if block[row, column] < least:
            least, at = float(block[row, column]), (rows.start + int(row), int(column))
        greatest = max(greatest, float(block.max()))
    return Extremes(least, at, greatest, (rows_seen, columns))


@dataclass(frozen=True, eq=False)
class _Terms:
    """What a clip brings into the cost."""

    rotations: FloatArray
    """`(weighted joints, frames, 4)`: those of the root without the facing."""
    vectors: FloatArray
    """`(frames, parts)`: positions and velocities, times the root of their weight: squared distances of these are added
    to the cost."""


def _terms(clip: Clip, weight: FloatArray, nu: float, root: str) -> _Terms:
    used = np.flatnonzero(weight)
    rotations = clip.rotations[:, used].copy()
    turn = quat.yaw(-facing(clip)) if root == "matched" or 0 in used else np.tile(quat.IDENTITY, (clip.frames, 1))
    if 0 in used:
        rotations[:, 0] = quat.multiply(turn, rotations[:, 0])
    vectors = [velocities(clip, used) * np.sqrt(nu * weight[used])[:, None]] if nu > 0 else []
    parts = [part.reshape(clip.frames, -1) for part in vectors]
    if root != "none":
        before, after, frames = _around(clip)
        speed = (clip.root_positions[after] - clip.root_positions[before]) / frames[:, None]
        parts.append(clip.root_positions[:, 1:2] if root == "matched" else clip.root_positions)
        parts.append(np.sqrt(nu) * (quat.rotate(turn, speed) if root == "matched" else speed))
    stacked = np.concatenate([*parts, np.zeros((clip.frames, 1))], axis=1)
    return _Terms(np.ascontiguousarray(rotations.transpose(1, 0, 2)), stacked)


def velocities(clip: Clip, joints: IntArray) -> FloatArray:
    """Half-angle velocities of joints, `(frames, joints, 3)`, radians for each 1/30 s, in the joints' own frames."""
    before, after, frames = _around(clip)
    turned = quat.multiply(
        quat.conjugate(clip.rotations[before][:, joints]),
        clip.rotations[after][:, joints],
    )
    return quat.log(turned) / frames[:, None, None]


def _around(clip: Clip) -> tuple[IntArray, IntArray, FloatArray]:
    """For each frame, the frames on either side (at the ends, one side) and the time between, in 1/30 s."""
    frames = np.arange(clip.frames)
    before, after = np.maximum(frames - 1, 0), np.minimum(frames + 1, clip.frames - 1)
    return before, after, np.maximum(after - before, 1) * _PAPER_FPS / clip.fps


def _factors(a: FloatArray, b: FloatArray, kind: type) -> tuple[AnyFloat, AnyFloat]:
    """Two matrices whose product is the squared distance of each row of `a` from each row of `b`.

    Taken from their common mean, so that little cancels.
    """
    middle = 0.5 * (a.mean(axis=0) + b.mean(axis=0))
    a, b = a - middle, b - middle
    left = np.concatenate([-2.0 * a, np.sum(a * a, axis=1)[:, None], np.ones((len(a), 1))], axis=1)
    right = np.concatenate([b, np.ones((len(b), 1)), np.sum(b * b, axis=1)[:, None]], axis=1)
    return left.astype(kind), np.ascontiguousarray(right.T).astype(kind)


@dataclass(frozen=True, eq=False)
class _Joint:
    """One joint's rotations, whose products are the cosines of half angles."""

    source: AnyFloat
    """`(frames, 4)`, a little shorter than 1: no product exceeds 1, of which there would be no arccosine."""
    destination: AnyFloat
    """`(4, frames)`."""
    weight: float
    opposed: bool
    """Whether products may be negative: where a quaternion is the nearer one with the other sign."""


def _joints(a: FloatArray, b: FloatArray, weights: FloatArray, kind: type) -> list[_Joint]:
    """The joints of two clips, `(joints, frames, 4)` each, those of equal weight together."""
    found = []
    for joint in np.argsort(weights, kind="stable"):
        every = quat.normalise(np.concatenate([a[joint], b[joint]]))
        every = every * np.where(every @ every[0] < 0, -1.0, 1.0)[:, None]
        middle = every.sum(axis=0)
        along = every @ (middle / max(float(np.linalg.norm(middle)), 1e-9))
        every = every * np.where(along < 0, -1.0, 1.0)[:, None]
        # All within 45 degrees of their middle, in half angles, are within 90 of each other.
        opposed = bool(np.abs(along).min() < np.sqrt(0.5) + 1e-6)
        short = 1.0 - _SHORT * np.finfo(kind).eps
        of_a: AnyFloat = (short * every[: a.shape[1]]).astype(kind)
        of_b: AnyFloat = np.ascontiguousarray(every[a.shape[1] :].T).astype(kind)
        found.append(_Joint(of_a, of_b, float(weights[joint]), opposed))
    return found


def _fill(block: AnyFloat, left: AnyFloat, right: AnyFloat, joints: Sequence[_Joint], rows: slice) -> None:
    """Write the costs of a block of rows, tile by tile, in the same memory each time."""
    space = np.empty((3, len(block) * _TILE_COLUMNS), dtype=block.dtype)
    nothing = np.zeros(_TILE_COLUMNS, dtype=block.dtype)  # NumPy takes three times as long with a bare number
    for at in range(0, block.shape[1], _TILE_COLUMNS):
        columns = slice(at, min(at + _TILE_COLUMNS, block.shape[1]))
        shape = (len(block), columns.stop - columns.start)
        tile, alike, angles = (part[: shape[0] * shape[1]].reshape(shape) for part in space)
        np.matmul(left, right[:, columns], out=tile)
        for weight, group in groupby(joints, key=lambda joint: joint.weight):
            for number, joint in enumerate(group):
                out = angles if number else alike
                np.matmul(joint.source[rows], joint.destination[:, columns], out=out)
                if joint.opposed:
                    np.abs(out, out=out)
                np.arccos(out, out=out)
                np.square(out, out=out)
                if number:
                    alike += angles
            alike *= weight
            tile += alike
        np.maximum(tile, nothing[: shape[1]], out=block[:, columns])


def _kind(precision: str) -> type:
    if precision not in ("single", "double"):
        raise TransitionError(f"Expected a precision of 'single' or 'double', got {precision!r}.")
    return np.float32 if precision == "single" else np.float64
