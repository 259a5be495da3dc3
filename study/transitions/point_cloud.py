"""How far two stretches of motion are apart as clouds of points, at best alignment on the floor.

In: clips. Out: the mean squared distance (square metres) between the joints of a window of one clip and of a window
of another, after the second was turned about the vertical and shifted on the floor to fit best. Kovar, Gleicher &
Pighin 2002, "Motion graphs", section 3.1 and Eq. 1; the distance function of Koyama & Goto 2019, section 3.2.

A whole matrix of window pairs costs little more than a matrix of frame pairs. With floor positions as complex
numbers `p`, `q` (their weighted mean over the window taken off) and heights `y`, `y'`, the residual is

    sum w|p|^2 + sum w|q|^2 + sum w y^2 + sum w y'^2 - 2 sum w y y' - 2 |sum w p conj(q)|

and both sums of products are sums of frame products along a diagonal of the matrix: the frame products are one
matrix product, and the diagonals of a matrix with rows of length n are its flat memory read with stride n + 1.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.arrays import AnyFloat, CountArray, FloatArray
from study.counting import counted
from study.errors import TransitionError
from study.motion.clip import Clip, joint_positions

ComplexArray = NDArray[np.complex128]

# A cost as a whole number: so many 2^-24 square metres (0.06 square millimetres). Sums of them are exact.
COUNTS_PER_SQUARE_METRE = 2.0**24
LARGEST_COUNT = 2**26  # 4 square metres; what is further apart counts as that

# A tile of about 400 kB, so that the five in use stay in cache.
_TILE_ROWS, _TILE_COLUMNS = 256, 320


@dataclass(frozen=True, eq=False)
class PointCloud:
    """A clip's joints as a point cloud, in the parts that `window_distances` multiplies."""

    name: str
    """The clip's name, for messages."""
    centres: ComplexArray
    """`(frames,) complex`: the weighted mean of the points on the floor, `z + ix`, metres: turning by `yaw` multiplies
    by `exp(i yaw)`."""
    floor: ComplexArray
    """`(frames, points) complex`: each point on the floor, from that mean, times the root of its weight."""
    heights: FloatArray
    """`(frames, points)`: each point's height, metres."""
    weights: FloatArray
    """`(points,)`: they sum to 1."""

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.centres)


def point_cloud(clip: Clip, weights: FloatArray | None = None) -> PointCloud:
    """A clip's joints as a point cloud.

    Parameters
    ----------
    clip
        The motion; its joints are the points (end sites are not).
    weights : (joints,), optional
        How much each joint counts, none below 0; all the same unless given. They are scaled to sum to 1.

    Raises
    ------
    TransitionError
        For weights that don't fit the skeleton, are negative, or sum to nothing.
    """
    joints = clip.skeleton.joints
    chosen = np.ones(joints) if weights is None else np.asarray(weights, dtype=np.float64)
    if chosen.shape != (joints,) or not np.isfinite(chosen).all() or chosen.min() < 0 or chosen.sum() <= 0:
        raise TransitionError(
            f"Expected {joints} joint weights, one a joint of {clip.name or 'the clip'}, none negative and not all "
            f"zero, got {chosen.size}: {chosen.ravel()[:4]}..."
        )
    used = np.flatnonzero(chosen)
    share = chosen[used] / chosen.sum()
    positions = joint_positions(clip)[:, used]
    floor = positions[..., 2] + 1j * positions[..., 0]
    centres = floor @ share
    return PointCloud(clip.name, centres, (floor - centres[:, None]) * np.sqrt(share), positions[..., 1], share)


def window_distances(
    a: PointCloud,
    b: PointCloud,
    window: int,
    *,
    rows: range | None = None,
    columns: range | None = None,
    precision: str = "single",
) -> FloatArray:
    """The distance of every window of one clip from every window of another.

    Parameters
    ----------
    a, b
        The clips' point clouds, with the same points.
    window
        Frames in a window, at least 1.
    rows, columns
        First frames of the windows of `a` and of `b`; all that fit unless given.
    precision
        `"single"` or `"double"`: what the products are computed in.

    Returns
    -------
    (len(rows), len(columns)) square metres, float64.

    Raises
    ------
    TransitionError
        For clouds of different points, windows that are not in the clips, or clips shorter than a window.

    Notes
    -----
    In single precision each entry is within `(points + 20) * 2^-24 * e` of the exact residual, where `e` is the sum
    over the two windows of the mean squared distance of the points from the window's mean on the floor and from a
    height common to both clips (for people, `e` is below 1 square metre, so the bound is some square millimetres,
    and what is seen is a tenth of it). Beyond the result, memory is that of the clips' factors (about 1 kB a frame
    for 20 points and windows of 30) and of a tile (3 MB).
    """
    rows, columns = _ranges(a, b, window, rows, columns)
    out = np.empty((len(rows), len(columns)))
    kind = np.float32 if precision == "single" else np.float64
    for down, across, tile in _tiles(a, b, window, rows, columns, kind, 1.0):
        np.maximum(tile, 0.0, out=out[down, across])
    return out


def window_counts(
    a: PointCloud, b: PointCloud, window: int, *, rows: range | None = None, columns: range | None = None
) -> CountArray:
    """`window_distances` in single precision as whole numbers of 2^-24 square metres, rounded to the nearest.

    Returns
    -------
    (len(rows), len(columns)) int32, at most `LARGEST_COUNT` (4 square metres). Windows of the same clip at the same
    frame are 0 apart.
    """
    rows, columns = _ranges(a, b, window, rows, columns)
    out = np.empty((len(rows), len(columns)), dtype=np.int32)
    for down, across, tile in _tiles(a, b, window, rows, columns, np.float32, COUNTS_PER_SQUARE_METRE):
        np.minimum(tile, LARGEST_COUNT, out=tile)
        tile += 0.5
        np.copyto(out[down, across], tile, casting="unsafe")
    np.maximum(out, 0, out=out)
    if a is b:
        same = np.arange(max(rows.start, columns.start), min(rows.stop, columns.stop))
        out[same - rows.start, same - columns.start] = 0
    return out


def alignment(a: FloatArray, b: FloatArray, weights: FloatArray | None = None) -> tuple[float, FloatArray, float]:
    """The turn about the vertical and the shift on the floor that bring `b` nearest to `a` (Kovar et al. 2002, Eq. 1).

    Parameters
    ----------
    a, b : (..., 3)
        Points that correspond, metres, Y up; any leading axes, the same in both.
    weights : broadcasts to (...), optional
        How much each pair of points counts.

    Returns
    -------
    yaw, translation (3,), residual
        Radians; metres, with no vertical part; and the weighted mean squared distance that is left, square metres.
        `study.motion.clip.moved(clip, yaw, translation)` applies them.
    """
    share = np.broadcast_to(1.0 if weights is None else weights, a.shape[:-1])
    share = share / share.sum()
    p, q = a[..., 2] + 1j * a[..., 0], b[..., 2] + 1j * b[..., 0]
    p_mean, q_mean = np.sum(share * p), np.sum(share * q)
    covariance = np.sum(share * (p - p_mean) * np.conj(q - q_mean))
    turn = covariance / abs(covariance) if abs(covariance) > 0 else 1.0 + 0.0j
    shift = p_mean - turn * q_mean
    gap = np.abs(p - p_mean - turn * (q - q_mean)) ** 2 + (a[..., 1] - b[..., 1]) ** 2
    return float(np.angle(turn)), np.array([shift.imag, 0.0, shift.real]), float(np.sum(share * gap))


def _ranges(
    a: PointCloud, b: PointCloud, window: int, rows: range | None, columns: range | None
) -> tuple[range, range]:
    if len(a.weights) != len(b.weights) or not np.allclose(a.weights, b.weights):
        raise TransitionError(
            f"Expected {a.name or 'both clips'} and {b.name or 'the other'} to have the same points, got "
            f"{len(a.weights)} and {len(b.weights)} points or other weights. Use clips of one rig."
        )
    chosen = []
    for cloud, wanted in ((a, rows), (b, columns)):
        count = cloud.frames - window + 1
        if window < 1 or count < 1:
            raise TransitionError(
                f"Expected a window of 1 to {counted(cloud.frames, 'frame')}, which {cloud.name or 'the clip'} "
                f"has, got {window}."
            )
        wanted = range(count) if wanted is None else wanted
        if wanted.step != 1 or wanted.start < 0 or wanted.stop > count:
            raise TransitionError(
                f"Expected windows that start at frames 0 to {count - 1} of {cloud.name or 'the clip'}, got {wanted}."
            )
        chosen.append(wanted)
    return chosen[0], chosen[1]


@dataclass(frozen=True, eq=False)
class _Factors:
    """One clip's side of the matrix products; rows are frames for `bodies` and `heights`, windows for the others."""

    heights: AnyFloat
    bodies: AnyFloat
    paths: AnyFloat
    energies: AnyFloat


def _factors(cloud: PointCloud, window: int, wanted: range, height: float, scale: float, kind: type) -> _Factors:
    """The frames of the wanted windows, from a common height, with every sum over a window made a mean.

    The mean position of each frame is kept apart from the points around it (`paths`: it is centred window by
    window), so that nothing large is ever subtracted from something as large, wherever on the floor a clip takes
    place.
    """
    frames = slice(wanted.start, wanted.stop + window - 1)
    heights = (cloud.heights[frames] - height) * np.sqrt(cloud.weights)
    floor = cloud.floor[frames]
    windows = np.lib.stride_tricks.sliding_window_view(cloud.centres[frames], window)
    paths = windows - windows.mean(axis=1, keepdims=True)
    by_frame = np.sum(heights**2 + np.abs(floor) ** 2, axis=1)
    total = np.lib.stride_tricks.sliding_window_view(by_frame, window).mean(axis=1) + np.mean(
        np.abs(paths) ** 2, axis=1
    )
    each = scale / np.sqrt(window)

    def parts(values: ComplexArray) -> AnyFloat:
        return np.asarray(np.concatenate([values.real, values.imag], axis=1).astype(kind) * kind(each))

    return _Factors(heights.astype(kind) * kind(each), parts(floor), parts(paths), (total * scale * scale).astype(kind))


def _quarter_turned(values: AnyFloat) -> AnyFloat:
    """`[real, imag]` columns times -i, so that the same right factor gives the imaginary part of `p conj(q)`."""
    half = values.shape[1] // 2
    return np.concatenate([values[:, half:], -values[:, :half]], axis=1)


def _tiles(
    a: PointCloud, b: PointCloud, window: int, rows: range, columns: range, kind: type, per_square_metre: float
) -> Iterator[tuple[slice, slice, AnyFloat]]:
    """Tiles of the distance matrix with their place in it, small enough for a core's own cache.

    The next tile overwrites the last. The factor 2 of the two cross terms and the unit go into the factors: powers
    of two, which cost no digit. Each tile is worked on as flat memory, a window's overhang at the end of each row
    included; results in the overhang have no meaning and are omitted.
    """
    if not len(rows) or not len(columns):
        return
    height = 0.5 * float((a.heights.mean(axis=0) @ a.weights) + (b.heights.mean(axis=0) @ b.weights))
    scale = float(np.sqrt(per_square_metre))
    left = _factors(a, window, rows, height, scale, kind)
    right = _factors(b, window, columns, height, scale, kind)
    overhang = window - 1
    right_paths = np.concatenate([right.paths, np.zeros((overhang, 2 * window), dtype=kind)])
    right_energies = np.concatenate([right.energies, np.zeros(overhang, dtype=kind)])
    bodies, paths = 2 * left.bodies, 2 * left.paths
    floor_parts = ((bodies, paths), (_quarter_turned(bodies), _quarter_turned(paths)))
    heights = -2 * left.heights
    size = (min(_TILE_ROWS, len(rows)) + overhang) * (min(_TILE_COLUMNS, len(columns)) + overhang)
    # Zeros, since what lies in the overhang is added to as well: whatever memory held could be no number at all.
    work: AnyFloat = np.zeros((3, size), dtype=kind)
    whole_path: AnyFloat = np.zeros(size, dtype=kind)
    whole_floor: AnyFloat = np.zeros(size, dtype=kind)
    for left_column in range(0, len(columns), _TILE_COLUMNS):
        width = min(_TILE_COLUMNS, len(columns) - left_column)
        wide = width + overhang
        across = slice(left_column, left_column + wide)
        for top in range(0, len(rows), _TILE_ROWS):
            count = min(_TILE_ROWS, len(rows) - top)
            tall = count + overhang
            down, used = slice(top, top + tall), count * wide - overhang
            floor, path = whole_floor[:used], whole_path[:used]
            for k, (body, way) in enumerate(floor_parts):
                np.matmul(body[down], right.bodies[across].T, out=work[0, : tall * wide].reshape(tall, wide))
                sums = _diagonal_sums(work[:, : tall * wide], wide + 1, window)
                shaped = whole_path[: count * wide].reshape(count, wide)
                np.matmul(way[top : top + count], right_paths[across].T, out=shaped)
                path += sums[:used]
                np.multiply(path, path, out=path if k else floor)
            floor += path
            np.sqrt(floor, out=floor)
            np.matmul(heights[down], right.heights[across].T, out=work[0, : tall * wide].reshape(tall, wide))
            sums = _diagonal_sums(work[:, : tall * wide], wide + 1, window)
            sums[:used] -= floor
            tile = sums[: count * wide].reshape(count, wide)
            tile += left.energies[top : top + count, None]
            tile += right_energies[across]
            yield slice(top, top + count), slice(left_column, left_column + width), tile[:, :width]


def _diagonal_sums(work: AnyFloat, stride: int, window: int) -> AnyFloat:
    """Sums of `window` entries of the first row of `work (3, size)` that lie `stride` apart; the end is not filled.

    By doubling: a sum of 2m entries is the sum of m entries plus the same m entries later, so a sum takes
    `2 log2(window)` additions at most, and rounding errors grow as slowly. Returns one of the rows.
    """
    size = work.shape[1]
    held, done = 0, 1
    for bit in bin(window)[3:]:
        spare = 2 if held == 1 else 1
        here = size - (2 * done - 1) * stride
        np.add(work[held, :here], work[held, done * stride : done * stride + here], out=work[spare, :here])
        held, done = spare, 2 * done
        if bit == "1":
            here = size - done * stride
            work[held, :here] += work[0, done * stride : done * stride + here]
            done += 1
    sums: AnyFloat = work[held]
    return sums
