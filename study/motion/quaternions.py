"""Unit quaternions as plain arrays: `(..., 4)`, scalar first (`wxyz`), vectorised over the leading axes.

The logarithm is the half angle, as in Lee et al. 2002 (and so in Wang & Bodenheimer 2003 and 2004):
`||log(q)|| = angle / 2`. Functions assume unit quaternions and never normalise silently, except where
the docstring says so.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from study.arrays import FloatArray

IDENTITY: FloatArray = np.array([1.0, 0.0, 0.0, 0.0])
IDENTITY.setflags(write=False)

# Below this the series of sin(x)/x is used; the next term is x**4/120, under 1e-18 here.
_SMALL_ANGLE = 1e-4


def multiply(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Hamilton product `a b` (apply `b` first, then `a`); shapes `(..., 4)` broadcast."""
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    return np.ascontiguousarray(np.moveaxis(multiply_parts(np.moveaxis(a, -1, 0), np.moveaxis(b, -1, 0)), 0, -1))


def multiply_parts(a: FloatArray, b: FloatArray) -> FloatArray:
    """`multiply` for arrays `(4, ...)`, one part after the other: quicker where each part is contiguous."""
    (aw, ax, ay, az), (bw, bx, by, bz) = a, b
    product = np.empty((4, *np.broadcast_shapes(a.shape[1:], b.shape[1:])))
    product[0] = aw * bw - ax * bx - ay * by - az * bz
    product[1] = aw * bx + ax * bw + ay * bz - az * by
    product[2] = aw * by - ax * bz + ay * bw + az * bx
    product[3] = aw * bz + ax * by - ay * bx + az * bw
    return product


def conjugate(q: ArrayLike) -> FloatArray:
    """The inverse of unit quaternions `(..., 4)`."""
    conjugated: FloatArray = np.asarray(q, dtype=np.float64) * np.array([1.0, -1.0, -1.0, -1.0])
    return conjugated


def normalise(q: ArrayLike) -> FloatArray:
    """Quaternions `(..., 4)` scaled to unit length; a zero quaternion gives NaN."""
    q = np.asarray(q, dtype=np.float64)
    unit: FloatArray = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return unit


def positive(q: ArrayLike) -> FloatArray:
    """The same rotations with `w >= 0`."""
    q = np.asarray(q, dtype=np.float64)
    return np.where(q[..., :1] < 0.0, -q, q)


def continuous(q: ArrayLike) -> FloatArray:
    """The same rotations `(frames, ..., 4)` with each sign chosen nearest to the frame before."""
    q = np.array(q, dtype=np.float64)
    if len(q) > 1:
        flips = np.sum(q[1:] * q[:-1], axis=-1) < 0.0
        q[1:][np.cumsum(flips, axis=0) % 2 == 1] *= -1.0
    return q


def rotate(q: ArrayLike, vectors: ArrayLike) -> FloatArray:
    """Vectors `(..., 3)` rotated by quaternions `(..., 4)`; leading axes broadcast."""
    q, vectors = np.asarray(q, dtype=np.float64), np.asarray(vectors, dtype=np.float64)
    return np.ascontiguousarray(np.moveaxis(rotate_parts(np.moveaxis(q, -1, 0), np.moveaxis(vectors, -1, 0)), 0, -1))


def rotate_parts(q: FloatArray, vectors: FloatArray) -> FloatArray:
    """`rotate` for arrays `(4, ...)` and `(3, ...)`, one part after the other; `np.cross` takes much longer."""
    (w, x, y, z), (a, b, c) = q, vectors
    # v + w t + u x t, with t = 2 u x v.
    ta, tb, tc = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    rotated = np.empty((3, *np.broadcast_shapes(q.shape[1:], vectors.shape[1:])))
    rotated[0] = a + w * ta + (y * tc - z * tb)
    rotated[1] = b + w * tb + (z * ta - x * tc)
    rotated[2] = c + w * tc + (x * tb - y * ta)
    return rotated


def from_axis_angle(axis: ArrayLike, angle: ArrayLike) -> FloatArray:
    """Rotation about unit `axis (..., 3)` by `angle (...)` radians."""
    axis, half = np.asarray(axis, dtype=np.float64), 0.5 * np.asarray(angle, dtype=np.float64)[..., None]
    shape = np.broadcast_shapes(axis.shape[:-1], half.shape[:-1])
    q = np.empty((*shape, 4))
    q[..., :1] = np.cos(half)
    q[..., 1:] = np.sin(half) * axis
    return q


def from_euler(order: str, angles: ArrayLike) -> FloatArray:
    """Intrinsic rotations about the moving axes named in `order`, as BVH channels are: `R = R1 R2 R3`.

    Parameters
    ----------
    order
        One to three letters of `XYZ`, in the order in which the matrices are multiplied.
    angles : (..., len(order))
        Radians.

    Returns
    -------
    (..., 4) unit quaternions, `w >= 0`.
    """
    half = 0.5 * np.asarray(angles, dtype=np.float64)
    if half.shape[-1] != len(order):
        raise ValueError(f"Expected angles of shape (..., {len(order)}) for order {order!r}, got {half.shape}.")
    if not order or set(order) - set("XYZ"):
        raise ValueError(f"Expected an order of one to three of the letters X, Y, Z, got {order!r}.")
    return np.ascontiguousarray(np.moveaxis(from_euler_parts(order, np.moveaxis(2.0 * half, -1, 0)), 0, -1))


def from_euler_parts(order: str, angles: FloatArray) -> FloatArray:
    """`from_euler` for angles `(len(order), ...)`, giving `(4, ...)`, one part after the other."""
    half = 0.5 * angles
    cos, sin = np.cos(half), np.sin(half)
    q = np.zeros((4, *half.shape[1:]))
    q[0], q[1 + "XYZ".index(order[0])] = cos[0], sin[0]
    for k, letter in enumerate(order[1:], start=1):
        # Times a rotation about one axis: half the work of a product.
        axis = "XYZ".index(letter)
        along, second, third = (1 + (axis + step) % 3 for step in range(3))
        turned = q * cos[k]
        turned[0] -= q[along] * sin[k]
        turned[along] += q[0] * sin[k]
        turned[second] += q[third] * sin[k]
        turned[third] -= q[second] * sin[k]
        q = turned
    return np.negative(q, out=q, where=np.broadcast_to(q[0] < 0.0, q.shape))


def to_euler(order: str, q: ArrayLike) -> FloatArray:
    """Intrinsic angles `(..., 3)`, radians, of quaternions `(..., 4)` for an order of three different axes.

    At gimbal lock (the middle angle a quarter turn) the third angle is set to zero.
    """
    if sorted(order) != ["X", "Y", "Z"]:
        raise ValueError(f"Expected an order of three different axes such as 'ZXY', got {order!r}.")
    i, j, k = ("XYZ".index(letter) for letter in order)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    matrices = to_matrix(q)
    angles = np.empty((*matrices.shape[:-2], 3))
    middle_sine = np.clip(sign * matrices[..., i, k], -1.0, 1.0)
    angles[..., 1] = np.arcsin(middle_sine)
    angles[..., 0] = np.arctan2(-sign * matrices[..., j, k], matrices[..., k, k])
    angles[..., 2] = np.arctan2(-sign * matrices[..., i, j], matrices[..., i, i])
    locked = np.abs(middle_sine) > 1.0 - 1e-12
    first_when_locked = np.arctan2(sign * matrices[..., k, j], matrices[..., j, j])
    angles[..., 0] = np.where(locked, first_when_locked, angles[..., 0])
    angles[..., 2] = np.where(locked, 0.0, angles[..., 2])
    return angles


def to_matrix(q: ArrayLike) -> FloatArray:
    """Rotation matrices `(..., 3, 3)` of unit quaternions `(..., 4)`; columns are the rotated axes."""
    q = np.asarray(q, dtype=np.float64)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    m = np.empty((*q.shape[:-1], 3, 3))
    m[..., 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    m[..., 0, 1] = 2.0 * (x * y - w * z)
    m[..., 0, 2] = 2.0 * (x * z + w * y)
    m[..., 1, 0] = 2.0 * (x * y + w * z)
    m[..., 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    m[..., 1, 2] = 2.0 * (y * z - w * x)
    m[..., 2, 0] = 2.0 * (x * z - w * y)
    m[..., 2, 1] = 2.0 * (y * z + w * x)
    m[..., 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    return m


def from_matrix(matrices: ArrayLike) -> FloatArray:
    """Unit quaternions `(..., 4)`, `w >= 0`, of rotation matrices `(..., 3, 3)`.

    Each takes the numerically largest of the four component formulas, so none divides by a small number.
    """
    m = np.asarray(matrices, dtype=np.float64)
    t0, t1, t2 = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    squares = np.stack([1 + t0 + t1 + t2, 1 + t0 - t1 - t2, 1 - t0 + t1 - t2, 1 - t0 - t1 + t2], axis=-1)
    yz, zx, xy = (m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1])
    syz, szx, sxy = (m[..., 2, 1] + m[..., 1, 2], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 0] + m[..., 0, 1])
    rows = np.stack(
        [
            np.stack([squares[..., 0], yz, zx, xy], axis=-1),
            np.stack([yz, squares[..., 1], sxy, szx], axis=-1),
            np.stack([zx, sxy, squares[..., 2], syz], axis=-1),
            np.stack([xy, szx, syz, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    best = np.argmax(squares, axis=-1)
    return positive(normalise(np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :]))


def log(q: ArrayLike) -> FloatArray:
    """Half-angle rotation vectors `(..., 3)` of unit quaternions `(..., 4)`, by the shorter way round.

    `||log(q)|| = angle / 2`, from 0 to pi/2 (Lee et al. 2002).
    """
    q = positive(q)
    w, u = q[..., :1], q[..., 1:]
    sine = np.linalg.norm(u, axis=-1, keepdims=True)
    half = np.arctan2(sine, w)
    safe = np.where(sine < _SMALL_ANGLE, 1.0, sine)
    return np.asarray(u * np.where(sine < _SMALL_ANGLE, 1.0 + sine**2 / 6.0, half / safe))


def exp(half_angle_vectors: ArrayLike) -> FloatArray:
    """Unit quaternions `(..., 4)` of half-angle rotation vectors `(..., 3)`; the inverse of `log`."""
    v = np.asarray(half_angle_vectors, dtype=np.float64)
    half = np.linalg.norm(v, axis=-1, keepdims=True)
    safe = np.where(half < _SMALL_ANGLE, 1.0, half)
    q = np.empty((*v.shape[:-1], 4))
    q[..., :1] = np.cos(half)
    q[..., 1:] = v * np.where(half < _SMALL_ANGLE, 1.0 - half**2 / 6.0, np.sin(half) / safe)
    return q


def half_angle_between(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """`||log(b^-1 a)||`, the geodesic distance of Wang & Bodenheimer 2004, Eqs. 2 and 3; `(...)`, 0 to pi/2.

    From the chord, not from the arccosine of the dot product, which loses half of the digits at small angles.
    """
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    dot = np.sum(a * b, axis=-1, keepdims=True)
    chord = np.linalg.norm(a - np.where(dot < 0.0, -b, b), axis=-1)
    return np.asarray(2.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0)))


def slerp(a: ArrayLike, b: ArrayLike, weight: ArrayLike) -> FloatArray:
    """Spherical linear interpolation from `a` (weight 0) to `b` (weight 1) by the shorter way round.

    Shapes `(..., 4)` and `weight (...)` broadcast. At the ends `a`, and `b` up to sign, come back exactly.
    """
    a, b = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    weight = np.asarray(weight, dtype=np.float64)[..., None]
    dot = np.sum(a * b, axis=-1, keepdims=True)
    b = np.where(dot < 0.0, -b, b)
    angle = 2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(a - b, axis=-1, keepdims=True), 0.0, 1.0))
    near = angle < _SMALL_ANGLE
    safe = np.where(near, 1.0, np.sin(angle))
    share_a = np.where(near, 1.0 - weight, np.sin((1.0 - weight) * angle) / safe)
    share_b = np.where(near, weight, np.sin(weight * angle) / safe)
    return normalise(share_a * a + share_b * b)


def yaw(angle: ArrayLike) -> FloatArray:
    """Rotation about the vertical (Y) axis by `angle (...)` radians; `(..., 4)`."""
    return from_axis_angle(np.array([0.0, 1.0, 0.0]), angle)
