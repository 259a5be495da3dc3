"""A floor to stand on: a plane that fades into the background, with a faint grid of metres, and soft contact shadows.

The plane is computed here and not on the GPU, so that its pixels are the same everywhere: once for a camera, of which
only the grid's lines move while it travels, and again for every frame of one that turns. (A window, which has no time
for that, has a shader do it; see `uniforms`.)
Shadows are capsules like any other, flattened onto the floor: dark and narrow under a foot that stands, wide and faint
under one that is lifted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from renderer.camera import Camera, project
from renderer.capsules import Figure
from renderer.colour import to_rgb, to_ycbcr

FloatArray = NDArray[np.float64]

_FLOOR_SHADE = 0.90
"""Luma of the floor before the camera, as a share of the background's."""
_GRID_SHADE = 0.90
_GRID_HALF_WIDTH_M = 0.009
_EDGES = (0.5, 0.65, 0.12)
"""Within so much of the picture's height from its sides, its top and its bottom the floor fades into the background, so
that a picture on a larger screen has no edge."""
_SHADOW_SHADE = 0.30
_CONTACT_OPACITY, _CONTACT_HEIGHT_M = 0.34, 0.16
_BODY_OPACITY, _BODY_RADIUS_M = 0.20, 0.42


class Floor:
    """The plane as one camera sees it, looking along its own axes or along others `(3, 3)`.

    What does not change while the camera travels straight on is computed once; the grid's lines move.
    """

    def __init__(self, figure: Figure, camera: Camera, axes: FloatArray | None = None) -> None:
        self._size = camera.size
        self._ground = to_ycbcr(figure.background)
        axes = camera.axes if axes is None else axes
        floor = _height(figure)
        way = _rays(camera, axes)
        falls = (way[1] < -1e-6) & (camera.eye[1] > floor)
        down = np.where(falls, way[1], -1.0)
        far = np.where(falls, (floor - camera.eye[1]) / down, 0.0)
        reach = far * np.sqrt(way[0] ** 2 + way[1] ** 2 + way[2] ** 2)
        far_off = np.exp(-np.log(2.0) * (reach / _half_faded(figure, camera)) ** 2)
        self._seen = np.where(falls, far_off, 0.0) * _within(camera.size)
        self._lines = []
        for axis in (0, 2):
            # How far on the floor one pixel aside and one pixel up lead.
            steps = [far * (row[axis] - way[axis] * row[1] / down) for row in axes[:2] / camera.focal_pixels]
            footprint = np.maximum(np.abs(steps[0]) + np.abs(steps[1]), 1e-6)
            self._lines.append(_Lines(camera.eye[axis] + far * way[axis], footprint))

    def luma(self, shift: FloatArray) -> FloatArray:
        """Luma `(height, width)`, not rounded; `shift (3,)` is how far a tracking camera has come, metres."""
        grid = np.maximum(self._lines[0].at(float(shift[0])), self._lines[1].at(float(shift[2])))
        shade = 1.0 - self._seen * (1.0 - _FLOOR_SHADE * (1.0 - grid * (1.0 - _GRID_SHADE)))
        return np.asarray((self._ground[0] - 16.0) * shade + 16.0)

    def nv12(self, shift: FloatArray) -> NDArray[np.uint8]:
        """The same as an NV12 frame."""
        width, height = self._size
        frame = np.empty((height * 3 // 2, width), dtype=np.uint8)
        frame[:height] = np.round(self.luma(shift))
        frame[height:, 0::2] = round(self._ground[1])
        frame[height:, 1::2] = round(self._ground[2])
        return frame

    def rgb(self, shift: FloatArray) -> NDArray[np.uint8]:
        """The same as RGB `(height, width, 3)`."""
        luma = self.luma(shift)
        return to_rgb(luma, np.full_like(luma, self._ground[1]), np.full_like(luma, self._ground[2]))


class _Lines:
    """Lines a metre apart across one axis of the floor, as wide on the screen as they are, and as faint where thin.

    `metres` along the axis, and those that a pixel covers, its `footprint`: both `(height, width)`.
    """

    def __init__(self, metres: FloatArray, footprint: FloatArray) -> None:
        self.metres = metres
        self.slope = 1.0 / footprint
        # Where a pixel is wider than a third of the spacing the lines would run into each other: they fade before.
        self._faint = np.minimum(1.0, 2.0 * _GRID_HALF_WIDTH_M / footprint) * np.clip(1.5 - 3.0 * footprint, 0.0, 1.0)

    def at(self, shift: float) -> FloatArray:
        """How much of each pixel they cover."""
        place = self.metres + shift
        aside = np.abs(place - np.round(place))
        cover: FloatArray = np.clip(0.5 + (_GRID_HALF_WIDTH_M - aside) * self.slope, 0.0, 1.0) * self._faint
        return cover


def uniforms(figure: Figure, camera: Camera) -> dict[str, float | tuple[float, ...]]:
    """What `shaders/floor.frag` computes the same from, except for the axes and the shift of a frame."""
    return {
        "eye": tuple(float(value) for value in camera.eye),
        "middle": (0.5 * camera.size[0], 0.5 * camera.size[1]),
        "focal": camera.focal_pixels,
        "floor_m": _height(figure),
        "half_faded": _half_faded(figure, camera),
        "edges": tuple(share * camera.size[1] for share in _EDGES),
        "ground": tuple(value / 255.0 for value in to_ycbcr(figure.background)),
        "half_width": _GRID_HALF_WIDTH_M,
        "shades": (_FLOOR_SHADE, _GRID_SHADE),
    }


def _height(figure: Figure) -> float:
    return 0.0 if figure.floor_m is None else figure.floor_m


def _half_faded(figure: Figure, camera: Camera) -> float:
    """The distance at which the floor is half way faded: twice that to where the camera looks."""
    above = abs(float(camera.eye[1] - _height(figure)))
    return 2.0 * float(np.hypot(*camera.eye[[0, 2]])) + 2.0 * above + 1.0


def _within(size: tuple[int, int]) -> FloatArray:
    """How much of the floor is left towards the edges of the picture, `(height, width)`: nothing at the edges."""
    side, top, bottom = (share * size[1] for share in _EDGES)
    across, down = (np.arange(pixels, dtype=np.float64) + 0.5 for pixels in size)
    sides = _ramp(np.minimum(across, size[0] - across) / side)
    upright = _ramp(down / top) * _ramp((size[1] - down) / bottom)
    within: FloatArray = upright[:, None] * sides[None, :]
    return within


def _ramp(share: FloatArray) -> FloatArray:
    """From 0 to 1 without a corner."""
    within: FloatArray = np.clip(share, 0.0, 1.0)
    return within * within * (3.0 - 2.0 * within)


def _rays(camera: Camera, axes: FloatArray) -> list[FloatArray]:
    """The way that each pixel looks: three arrays that go with `(height, width)`, one metre deep."""
    width, height = camera.size
    across = ((np.arange(width) + 0.5 - 0.5 * width) / camera.focal_pixels)[None, :]
    up = ((0.5 * height - np.arange(height) - 0.5) / camera.focal_pixels)[:, None]
    right, above, back = axes
    return [across * right[i] + up * above[i] - back[i] for i in range(3)]


def shadow_capsules(
    placed: FloatArray, figure: Figure, camera: Camera, axes: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]:
    """Shadows of capsules `placed (frames, capsules, 2, 3)`, in pixels, seen along `axes (frames, 3, 3)`.

    Returns
    -------
    tuple
        Ends `(frames, shadows, 2, 2)`, radii `(frames, shadows, 2)`, opacity and stretch of y `(frames, shadows)`, and
        the luma to paint them in. A shadow is a circle on the floor, so on the screen it is flat: stretched by
        that much in y it is round again.
    """
    floor = _height(figure)
    heights = np.maximum(placed[..., 1] - figure.radii - floor, 0.0)
    opacity = _CONTACT_OPACITY * np.exp(-heights.mean(axis=2) / _CONTACT_HEIGHT_M)
    opacity = np.where(opacity > 0.01, opacity, 0.0)
    on_floor = placed.copy()
    on_floor[..., 1] = floor
    radii = figure.radii * 1.5 + 0.25 * heights
    middle = on_floor.mean(axis=(1, 2))[:, None, None, :]
    on_floor = np.concatenate([np.broadcast_to(middle, (len(placed), 1, 2, 3)), on_floor], axis=1)
    opacity = np.concatenate([np.full((len(placed), 1), _BODY_OPACITY), opacity], axis=1)
    radii = np.concatenate([np.full((len(placed), 1, 2), _BODY_RADIUS_M), radii], axis=1)
    pixels, nearness = project(camera, on_floor, axes)
    from_eye = on_floor.mean(axis=2) - camera.eye
    distance = np.sqrt(from_eye[..., 0] ** 2 + from_eye[..., 1] ** 2 + from_eye[..., 2] ** 2)
    stretch = np.clip(distance / np.maximum(-from_eye[..., 1], 1e-3), 1.001, 25.0)
    # A floor seen from below casts no shadow that anyone sees.
    opacity = np.where(from_eye[..., 1] < 0.0, opacity, 0.0)
    luma = 16.0 + (to_ycbcr(figure.background)[0] - 16.0) * _SHADOW_SHADE
    return pixels, radii * camera.focal_pixels * nearness, opacity, stretch, luma
