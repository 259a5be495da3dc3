"""Framing: the one camera from which everything that moves in a group of films is seen.

Positions `(frames, points, 3)` in metres, Y up, come in, one array a film; a `Camera` goes out, of one of three kinds
(`camera.CAMERAS`). Nothing leaves its frame, and the group's motion takes the given share of it in width or height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from renderer.camera import (
    CAMERAS,
    Camera,
    FloatArray,
    camera_path,
    check_positions,
    check_size,
    smooth_path,
    turned,
    view_axes,
    view_yaw,
)
from renderer.capsules import Figure, place
from renderer.errors import RendererError

FILLS = {"fixed": (0.86, 0.86), "pan": (0.80, 0.90), "track": (0.86, 0.86)}
"""The shares of the frame's width and height that a group takes at most. A panning camera leaves room at the sides, so
that the figure stays near the middle."""

PAN_ORDER = 2
"""Of the polynomials by which a panning camera turns."""
PAN_DISTANCE_M, PAN_DISTANCES = 40.0, 5.0
"""How far away a panning camera stands: metres, and as a multiple of the group's reach over the floor; the larger."""


def frame_group(
    positions_list: Sequence[ArrayLike],
    *,
    camera: str = "fixed",
    size: tuple[int, int] = (640, 480),
    view: str | float = "three-quarter",
    fill: float | None = None,
    elevation: float = 0.10,
    field_of_view: float = 0.44,
    figures: Sequence[Figure] = (),
    padding_m: float = 0.16,
    heading: float | None = None,
    track_seconds: float = 1.0,
    fps: float = 30.0,
) -> Camera:
    """One camera in which everything that moves in the group stays inside the frame.

    Parameters
    ----------
    positions_list
        Each `(frames, points, 3)`, metres: every stimulus of the group.
    camera
        `"fixed"`, `"pan"` or `"track"`; the group is framed as that camera sees it.
    size
        Width and height in pixels.
    view
        `"front"`, `"side"` or `"three-quarter"`, relative to the way the group travels; or radians from the front.
    fill
        The share of the frame, across and up, that the group's motion takes at most; reached in one of the two. By
        default those of `FILLS`.
    elevation
        Radians by which the camera looks down.
    field_of_view
        Radians from the top to the bottom of the frame, of a camera that doesn't pan. Small: a long lens, which
        distorts little. That of a panning camera follows from its distance.
    figures
        What is drawn at each clip's points; it is then framed exactly.
    padding_m
        What a figure takes around its points where none is given, metres: half a head and some.
    heading
        The direction that counts as forwards, radians about Y from +Z; found from the motion where None.
    track_seconds
        Smoothing window of a camera that tracks, seconds.
    fps
        Frames per second of the positions, for a camera that moves.
    """
    check_size(size)
    group = [check_positions(p, f"positions of clip {i} of the group") for i, p in enumerate(positions_list)]
    if not group:
        raise RendererError("Expected at least one clip to frame, got none.")
    if camera not in CAMERAS:
        raise RendererError(f"Expected a camera of {', '.join(CAMERAS)}, got {camera!r}.")
    shares = FILLS[camera] if fill is None else (fill, fill)
    if not 0.05 <= min(shares) <= max(shares) <= 1.0:
        raise RendererError(f"Expected a fill share from 0.05 to 1, got {fill}.")
    if not 0.02 <= field_of_view <= 2.5:
        raise RendererError(f"Expected a field of view from 0.02 to 2.5 radians, got {field_of_view}.")
    yaw = (find_heading(group) if heading is None else heading) + view_yaw(view)
    shifts = [smooth_path(clip, track_seconds, fps)[:, None] if camera == "track" else 0.0 for clip in group]
    group = [clip - shift for clip, shift in zip(group, shifts, strict=True)]
    radii: list[FloatArray | float] = [padding_m] * len(group)
    if figures:
        placed = [place(figure, clip) for figure, clip in zip(figures, group, strict=True)]
        group, radii = [ends.reshape(len(ends), -1, 3) for ends in placed], [each.radii.reshape(-1) for each in figures]
    if camera == "pan":
        return _panning(group, radii, size, yaw, elevation, shares, fps)
    still = _still(group, radii, size, view_axes(yaw, elevation), shares, field_of_view)
    return replace(still, track_seconds=track_seconds) if camera == "track" else still


def _still(
    group: Sequence[FloatArray],
    radii: Sequence[FloatArray | float],
    size: tuple[int, int],
    axes: FloatArray,
    fills: tuple[float, float],
    field_of_view: float,
) -> Camera:
    """The closest eye that sees all points of a group, which has a closed form.

    With `t` the tangent of half the angle across, a point at `x` right of and `z` before the origin is seen where
    `|x - x_eye| <= t (z_eye - z)`; adding the tightest left and right of these bounds gives `z_eye`, their difference
    `x_eye`. The same holds for the height.
    """
    seen = np.concatenate([turned(clip, axes).reshape(-1, 3) for clip in group])
    padding = np.concatenate(
        [np.broadcast_to(pad, clip.shape[:2]).ravel() for pad, clip in zip(radii, group, strict=True)]
    )
    focal = 0.5 * size[1] / np.tan(0.5 * field_of_view)
    eye = np.zeros(3)
    distances = []
    for axis in (0, 1):
        tangent = fills[axis] * 0.5 * size[axis] / focal
        reach = padding * np.sqrt(1.0 + tangent * tangent)
        right = np.max(seen[:, axis] + tangent * seen[:, 2] + reach)
        left = np.max(-seen[:, axis] + tangent * seen[:, 2] + reach)
        distances.append((right + left) / (2.0 * tangent))
        eye[axis] = 0.5 * (right - left)
    # Never closer than half a metre before the nearest point, whatever the lens.
    eye[2] = max(*distances, float((seen[:, 2] + padding).max()) + 0.5)
    return Camera((axes * eye[:, None]).sum(axis=0), axes, float(focal), size)


def _panning(
    group: Sequence[FloatArray],
    radii: Sequence[FloatArray | float],
    size: tuple[int, int],
    yaw: float,
    elevation: float,
    fills: tuple[float, float],
    fps: float,
) -> Camera:
    """A camera far away that turns by the group's common path, with the longest lens that sees everything."""
    middles = [0.5 * (clip.min(axis=1) + clip.max(axis=1)) for clip in group]
    every = np.concatenate(middles)
    centre = 0.5 * (every.min(axis=0) + every.max(axis=0))
    reach = float(np.hypot(every[:, 0] - centre[0], every[:, 2] - centre[2]).max())
    axes = view_axes(yaw, elevation)
    eye = centre + max(PAN_DISTANCE_M, PAN_DISTANCES * reach) * axes[2]
    seconds = np.concatenate([np.arange(len(clip)) / fps for clip in group])
    right, up, back = np.moveaxis(turned(every - eye, view_axes(yaw, 0.0)), -1, 0)
    bearing, height = np.arctan2(right, -back), np.arctan2(up, np.hypot(right, back))
    # Rounded well below what moves a pixel: a solver's last digits differ between machines.
    turns = np.round(_polynomials(seconds, np.stack([-bearing, -height - elevation])), 10)
    camera = Camera(eye, axes, 1.0, size, turns=turns)
    # As much room above as below: what reaches up for a moment would else leave some unused at the feet.
    angles = np.arctan(_slopes(camera, group, radii, fps, axis=1))
    raised = np.round(angles.mean(), 10)
    turns[1, 0] -= raised
    camera = replace(camera, turns=turns)
    slopes = np.stack([_slopes(camera, group, radii, fps, axis=0), np.tan(angles - raised)])
    focal = np.array(fills) * 0.5 * np.array(size) / np.maximum(np.abs(slopes).max(axis=1), 1e-3)
    return replace(camera, focal_pixels=float(focal.min()))


def _slopes(
    camera: Camera, group: Sequence[FloatArray], radii: Sequence[FloatArray | float], fps: float, axis: int
) -> FloatArray:
    """The least and the largest slope, `(2,)`, at which anything of a group is seen: to the right (0) or upwards (1).

    A ball of radius `r` at `x` aside and `z` ahead is seen up to the slope of the tangent to its circle.
    """
    low, high = np.inf, -np.inf
    axes = camera_path(max(group, key=len), camera, fps).axes[:, [axis, 2]]  # it turns alike during every clip
    for clip, radius in zip(group, radii, strict=True):
        aside, ahead = np.moveaxis(turned(clip - camera.eye, axes[: len(clip)]), -1, 0)
        ahead2 = ahead**2 - radius**2
        middle, around = -aside * ahead, radius * np.sqrt(aside**2 + ahead2)
        low = min(low, float(((middle - around) / ahead2).min()))
        high = max(high, float(((middle + around) / ahead2).max()))
    return np.array([low, high])


def _polynomials(seconds: FloatArray, values: FloatArray) -> FloatArray:
    """Polynomials of least squared error through values `(rows, n)`: `(rows, PAN_ORDER + 1)`, the constants first."""
    order = min(PAN_ORDER, len(np.unique(seconds)) - 1)
    half = 0.5 * seconds.max() or 1.0
    found = np.zeros((len(values), PAN_ORDER + 1))
    basis = np.vander(seconds / half - 1.0, order + 1, increasing=True)
    for power, factors in enumerate(np.linalg.lstsq(basis, values.T)[0]):
        found[:, : power + 1] += np.outer(factors, np.polynomial.polynomial.polypow([-1.0, 1.0 / half], power))
    return found


def find_heading(group: Sequence[FloatArray]) -> float:
    """The way the group travels over the floor, radians about Y from +Z: the mean of the clips' displacements.

    0.0 where nobody gets further than 0.3 m, since standing has no heading.
    """
    ways = np.array([(clip[-1] - clip[0]).mean(axis=0)[[0, 2]] for clip in group])
    way = ways.mean(axis=0)
    if np.hypot(*way) < 0.3:
        return 0.0
    return float(np.arctan2(way[0], way[1]))
