"""Cameras: where the eye is, and where each point of the world appears in the image.

Positions `(frames, points, 3)` in metres, Y up, come in; pixels go out: x to the right and y *down* from the top left
corner of the frame, so that the first row of a picture is the top one. One camera frames a whole group of stimuli
(Wang and Bodenheimer 2004, section 4: groups of motions were shown from the same camera position). Where two figures
end at different places, their pictures differ all the same.

- `fixed`: it neither moves nor turns. A figure that travels far is small in it.
- `pan`: it stands still and turns, by the same slow path in every film of the group: yaw and pitch are quadratic in the
  time since the film began, fitted by least squares to the figures of all films. A path with three numbers can follow
  neither a step nor a hop, and films of one group that begin alike look alike until they differ. It stands far away
  and looks through a long lens, so a figure keeps nearly its size wherever it goes.
- `track`: it follows the figure over the floor, so it hides part of what the figure does; for looking at a motion.

Everything is computed element by element: a matrix product may sum in another order for another number of frames,
and the same pose must land on the same pixels whatever batch it stands in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.errors import RendererError

FloatArray = NDArray[np.float64]

VIEWS = ("front", "side", "three-quarter")
"""Named views: seen against the way the group travels, square to it, and half way between."""

_VIEW_YAW = {"front": 0.0, "three-quarter": -np.pi / 4, "side": -np.pi / 2}

CAMERAS = ("fixed", "pan", "track")
"""What a camera does while a film lasts; see above."""


@dataclass(frozen=True, eq=False)
class Camera:
    """An eye in space that looks along a line.

    Parameters
    ----------
    eye : (3,)
        Its position, metres.
    axes : (3, 3)
        Rows: to the right, up, and *towards the eye*, unit vectors of the world.
    focal_pixels
        Pixels that one metre takes at a distance of one metre.
    size
        Width and height of the frame that it was made for, pixels.
    track_seconds
        Where given, it follows the figure's centre over the floor; smoothing window in seconds.
    turns : (2, coefficients)
        Where given, it turns while the film lasts: polynomials, constant first, in the seconds since the film began, of
        what is added to the yaw and to the elevation of `axes`, radians.
    """

    eye: FloatArray
    axes: FloatArray
    focal_pixels: float
    size: tuple[int, int]
    track_seconds: float | None = None
    turns: FloatArray | None = None

    def __post_init__(self) -> None:
        for field, shape in (("eye", (3,)), ("axes", (3, 3))):
            array = np.array(getattr(self, field), dtype=np.float64)
            if array.shape != shape or not np.isfinite(array).all():
                raise RendererError(f"Expected a camera's {field} as finite numbers of shape {shape}, got {array}.")
            array.setflags(write=False)
            object.__setattr__(self, field, array)
        if self.turns is not None:
            turns = np.array(self.turns, dtype=np.float64)
            if turns.ndim != 2 or len(turns) != 2 or not np.isfinite(turns).all():
                raise RendererError(f"Expected a camera's turns as two rows of finite coefficients, got {self.turns}.")
            turns.setflags(write=False)
            object.__setattr__(self, "turns", turns)
        if not (np.isfinite(self.focal_pixels) and self.focal_pixels > 0):
            raise RendererError(f"Expected a focal length above 0 pixels, got {self.focal_pixels}.")
        check_size(self.size)

    @property
    def elevation(self) -> float:
        """Radians by which it looks down."""
        return float(np.arcsin(np.clip(self.axes[2, 1], -1.0, 1.0)))

    @property
    def yaw(self) -> float:
        """Radians about Y, from +Z towards +X, of the side on which it stands."""
        return float(np.arctan2(self.axes[2, 0], self.axes[2, 2]))


def check_size(size: tuple[int, int]) -> tuple[int, int]:
    """Width and height of a frame, checked: even, from 16 to 8192 pixels (H.264 in 4:2:0 takes even sizes only)."""
    try:
        width, height = (int(side) for side in size)
    except (TypeError, ValueError):
        raise RendererError(f"Expected a frame size as (width, height), got {size!r}.") from None
    if (
        (width, height) != tuple(size)
        or width % 2
        or height % 2
        or not (16 <= min(width, height) <= max(width, height) <= 8192)
    ):
        raise RendererError(
            f"Expected a frame size of even whole numbers from 16 to 8192, as (640, 480), got {tuple(size)!r}."
        )
    return width, height


def check_positions(positions: ArrayLike, name: str = "positions") -> FloatArray:
    """Positions as float64 `(frames, points, 3)`, finite, with at least one frame and one point."""
    try:
        array = np.asarray(positions, dtype=np.float64)
    except (TypeError, ValueError):
        raise RendererError(f"Expected {name} as numbers of shape (frames, points, 3).") from None
    if array.ndim != 3 or array.shape[2] != 3 or 0 in array.shape:
        raise RendererError(
            f"Expected {name} of shape (frames, points, 3) with at least one frame and one point, got {array.shape}."
        )
    if not np.isfinite(array).all():
        frame, point = np.argwhere(~np.isfinite(array).all(axis=2))[0]
        raise RendererError(
            f"Expected finite {name}, found {array[frame, point]} at frame {frame}, point {point}; "
            "mend or drop that frame first."
        )
    return array


def view_yaw(view: str | float) -> float:
    """Radians about Y from the front, of a named view or of a number."""
    if isinstance(view, str):
        if view not in _VIEW_YAW:
            raise RendererError(f"Expected a view of {', '.join(VIEWS)} or an angle in radians, got {view!r}.")
        return float(_VIEW_YAW[view])
    if not np.isfinite(view):
        raise RendererError(f"Expected a view as a finite angle in radians, got {view}.")
    return float(view)


def view_axes(yaw: FloatArray | float, elevation: FloatArray | float) -> FloatArray:
    """Axes `(..., 3, 3)` of a camera that stands at `yaw` about Y (from +Z towards +X) and looks down by `elevation`.

    Both in radians, as numbers or of shape `(...)`.
    """
    sin_y, cos_y, sin_e, cos_e = np.sin(yaw), np.cos(yaw), np.sin(elevation), np.cos(elevation)
    rows: tuple[tuple[FloatArray | float, ...], ...] = (
        (cos_y, 0.0, -sin_y),
        (-sin_e * sin_y, cos_e, -sin_e * cos_y),
        (cos_e * sin_y, sin_e, cos_e * cos_y),
    )
    axes = np.empty((*np.broadcast_shapes(np.shape(yaw), np.shape(elevation)), 3, 3))
    for row, column in np.ndindex(3, 3):
        axes[..., row, column] = rows[row][column]
    return axes


def smooth_path(positions: FloatArray, seconds: float, fps: float) -> FloatArray:
    """The figure's centre over the floor, smoothed, relative to the first frame: `(frames, 3)` with y = 0.

    The smoothing is a Gaussian of standard deviation `seconds`; beyond both ends the path continues as its mirror
    image, so that a straight path stays straight.
    """
    if not (seconds >= 0 and np.isfinite(seconds)):
        raise RendererError(f"Expected a tracking time of 0 seconds or more, got {seconds}.")
    centre = positions.mean(axis=1)
    centre[:, 1] = 0.0
    sigma = seconds * fps
    if sigma > 0 and len(centre) > 1:
        reach = int(np.ceil(3 * sigma))
        kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
        kernel /= kernel.sum()
        line = np.pad(centre, ((reach, reach), (0, 0)), mode="reflect", reflect_type="odd")
        centre = np.stack([np.convolve(line[:, axis], kernel, mode="valid") for axis in range(3)], axis=1)
    path: FloatArray = centre - centre[0]
    return path


@dataclass(frozen=True, eq=False)
class CameraPath:
    """What a camera does during a film: how far it has come, `shift (frames, 3)`, metres, and `axes (frames, 3, 3)`."""

    shift: FloatArray
    axes: FloatArray


def camera_path(positions: FloatArray, camera: Camera, fps: float, shown: Sequence[int] | None = None) -> CameraPath:
    """Where a camera is and looks in each frame of a film with these positions, which matter where it tracks.

    With `shown`, in these frames alone.
    """
    frames = np.arange(len(positions)) if shown is None else np.asarray(shown)
    tracks = camera.track_seconds is not None
    shift = (
        smooth_path(positions, float(camera.track_seconds or 0.0), fps)[frames]
        if tracks
        else np.zeros((len(frames), 3))
    )
    if camera.turns is None:
        return CameraPath(shift, np.broadcast_to(camera.axes, (len(frames), 3, 3)))
    seconds = frames / fps
    yaw, elevation = (sum(c * seconds**i for i, c in enumerate(row)) for row in camera.turns)
    return CameraPath(shift, view_axes(camera.yaw + yaw, camera.elevation + elevation))


def project_film(camera: Camera, positions: FloatArray, fps: float) -> tuple[FloatArray, FloatArray]:
    """Where the points of a film `(frames, points, 3)` land in its picture, whatever its camera does; as `project`."""
    path = camera_path(positions, camera, fps)
    return project(camera, positions - path.shift[:, None], path.axes)


def project(camera: Camera, points: FloatArray, axes: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Where points `(..., 3)` land: pixels `(..., 2)`, y down, and the nearness `(...)`, 1 / distance along the view.

    Nearness times `focal_pixels` is the size of a metre there, in pixels. Points nearer than 1 cm or behind the
    eye count as 1 cm before it. `axes (frames, 3, 3)` are those of a camera that turns, for points `(frames, ..., 3)`.
    """
    seen = turned(points - camera.eye, camera.axes if axes is None else axes)
    nearness = 1.0 / np.maximum(-seen[..., 2], 0.01)
    scale = camera.focal_pixels * nearness
    width, height = camera.size
    pixels = np.stack([0.5 * width + seen[..., 0] * scale, 0.5 * height - seen[..., 1] * scale], axis=-1)
    return pixels, nearness


def turned(points: FloatArray, axes: FloatArray) -> FloatArray:
    """Points `(..., 3)` along axes `(n, 3)`, or along axes `(frames, n, 3)` of their own for each frame: `(..., n)`."""
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    count = axes.shape[-2]
    rows = axes.reshape(*axes.shape[:-2], *(1,) * (points.ndim - axes.ndim + 1), count, 3) if axes.ndim > 2 else axes
    return np.stack([x * rows[..., i, 0] + y * rows[..., i, 1] + z * rows[..., i, 2] for i in range(count)], axis=-1)
