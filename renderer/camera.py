"""Cameras: where the eye is, and where each point of the world appears in the image.

Positions `(frames, points, 3)` in metres, Y up, come in; pixels go out: x to the right and y *down* from the top left
corner of the frame, so that the first row of a picture is the top one. One fixed camera frames a whole group of
stimuli, so that nothing but the motion differs between two of them (Wang and Bodenheimer 2004, section 4: both
clips of a pair were seen from one camera); `track` lets the camera follow the figure.

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
        None for a fixed camera. Otherwise it follows the figure's centre over the floor; smoothing window in
        seconds.
    fill_share
        The share of the frame's width or height, whichever is the larger, that the motion it was made for takes.
    """

    eye: FloatArray
    axes: FloatArray
    focal_pixels: float
    size: tuple[int, int]
    track_seconds: float | None = None
    fill_share: float | None = None

    def __post_init__(self) -> None:
        for field, shape in (("eye", (3,)), ("axes", (3, 3))):
            array = np.array(getattr(self, field), dtype=np.float64)
            if array.shape != shape or not np.isfinite(array).all():
                raise RendererError(f"Expected a camera's {field} as finite numbers of shape {shape}, got {array}.")
            array.setflags(write=False)
            object.__setattr__(self, field, array)
        if not (np.isfinite(self.focal_pixels) and self.focal_pixels > 0):
            raise RendererError(f"Expected a focal length above 0 pixels, got {self.focal_pixels}.")
        check_size(self.size)

    @property
    def elevation(self) -> float:
        """Radians by which it looks down."""
        return float(np.arcsin(np.clip(self.axes[2, 1], -1.0, 1.0)))


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


def frame_group(
    positions_list: Sequence[ArrayLike],
    *,
    size: tuple[int, int] = (640, 480),
    view: str | float = "three-quarter",
    fill: float = 0.86,
    elevation: float = 0.10,
    field_of_view: float = 0.44,
    padding_m: float = 0.16,
    heading: float | None = None,
    track_seconds: float | None = None,
    fps: float = 30.0,
) -> Camera:
    """One camera in which everything that moves in the group stays inside the frame.

    Parameters
    ----------
    positions_list
        Each `(frames, points, 3)`, metres: every stimulus of the group.
    size
        Width and height in pixels.
    view
        `"front"`, `"side"` or `"three-quarter"`, relative to the way the group travels; or radians from the front.
    fill
        The share of the frame, across or up, that the group's motion takes at most; reached in one of the two.
    elevation
        Radians by which the camera looks down.
    field_of_view
        Radians from the top to the bottom of the frame. Small: a long lens, which distorts little.
    padding_m
        What a figure takes around its points, metres: half a head and some.
    heading
        The direction that counts as forwards, radians about Y from +Z; found from the motion where None.
    track_seconds
        Let the camera follow the figure; smoothing window in seconds. The group is then framed as seen by that
        camera.
    fps
        Frames per second of the positions, for `track_seconds`.

    Notes
    -----
    The closest eye that sees all points has a closed form. With `t` the tangent of half the angle across, a point
    at `x` right of and `z` before the origin is seen where `|x - x_eye| <= t (z_eye - z)`; adding the tightest
    left and right of these bounds gives `z_eye`, their difference `x_eye`. The same holds for the height.
    """
    width, height = check_size(size)
    group = [check_positions(p, f"positions of clip {i} of the group") for i, p in enumerate(positions_list)]
    if not group:
        raise RendererError("Expected at least one clip to frame, got none.")
    if not 0.05 <= fill <= 1.0:
        raise RendererError(f"Expected a fill share from 0.05 to 1, got {fill}.")
    if not 0.02 <= field_of_view <= 2.5:
        raise RendererError(f"Expected a field of view from 0.02 to 2.5 radians, got {field_of_view}.")
    yaw = (find_heading(group) if heading is None else heading) + view_yaw(view)
    axes = view_axes(yaw, elevation)
    if track_seconds is not None:
        group = [clip - smooth_path(clip, track_seconds, fps)[:, None] for clip in group]
    seen = np.concatenate([_turned(clip, axes).reshape(-1, 3) for clip in group])
    focal = 0.5 * height / np.tan(0.5 * field_of_view)
    half = np.array([0.5 * width, 0.5 * height])
    eye = np.zeros(3)
    distances = []
    for axis in (0, 1):
        tangent = fill * half[axis] / focal
        reach = padding_m * np.sqrt(1.0 + tangent * tangent)
        right = np.max(seen[:, axis] + tangent * seen[:, 2]) + reach
        left = np.max(-seen[:, axis] + tangent * seen[:, 2]) + reach
        distances.append((right + left) / (2.0 * tangent))
        eye[axis] = 0.5 * (right - left)
    # Never closer than half a metre before the nearest point, whatever the lens.
    eye[2] = max(*distances, float(seen[:, 2].max()) + padding_m + 0.5)
    return Camera(_turned_back(eye, axes), axes, float(focal), (width, height), track_seconds, float(fill))


def view_yaw(view: str | float) -> float:
    """Radians about Y from the front, of a named view or of a number."""
    if isinstance(view, str):
        if view not in _VIEW_YAW:
            raise RendererError(f"Expected a view of {', '.join(VIEWS)} or an angle in radians, got {view!r}.")
        return float(_VIEW_YAW[view])
    if not np.isfinite(view):
        raise RendererError(f"Expected a view as a finite angle in radians, got {view}.")
    return float(view)


def view_axes(yaw: float, elevation: float) -> FloatArray:
    """Axes of a camera at `yaw` about Y (from +Z towards +X) and looks down by `elevation`, radians."""
    sin_y, cos_y, sin_e, cos_e = np.sin(yaw), np.cos(yaw), np.sin(elevation), np.cos(elevation)
    return np.array(
        [
            [cos_y, 0.0, -sin_y],
            [-sin_e * sin_y, cos_e, -sin_e * cos_y],
            [cos_e * sin_y, sin_e, cos_e * cos_y],
        ]
    )


def find_heading(group: Sequence[FloatArray]) -> float:
    """The way the group travels over the floor, radians about Y from +Z: the mean of the clips' displacements.

    0.0 where nobody gets further than 0.3 m, since standing has no heading.
    """
    ways = np.array([(clip[-1] - clip[0]).mean(axis=0)[[0, 2]] for clip in group])
    way = ways.mean(axis=0)
    if np.hypot(*way) < 0.3:
        return 0.0
    return float(np.arctan2(way[0], way[1]))


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


def camera_path(positions: FloatArray, camera: Camera, fps: float) -> FloatArray:
    """Displacement of the camera at each frame, `(frames, 3)`, metres; zero for a fixed camera."""
    if camera.track_seconds is None:
        return np.zeros((len(positions), 3))
    return smooth_path(positions, camera.track_seconds, fps)


def project(camera: Camera, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where points `(..., 3)` land: pixels `(..., 2)`, y down, and the nearness `(...)`, 1 / distance along the view.

    Nearness times `focal_pixels` is the size of a metre there, in pixels. Points nearer than 1 cm or behind the
    eye count as 1 cm before it.
    """
    seen = _turned(points - camera.eye, camera.axes)
    nearness = 1.0 / np.maximum(-seen[..., 2], 0.01)
    scale = camera.focal_pixels * nearness
    width, height = camera.size
    pixels = np.stack([0.5 * width + seen[..., 0] * scale, 0.5 * height - seen[..., 1] * scale], axis=-1)
    return pixels, nearness


def _turned(points: FloatArray, axes: FloatArray) -> FloatArray:
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack([x * row[0] + y * row[1] + z * row[2] for row in axes], axis=-1)


def _turned_back(point: FloatArray, axes: FloatArray) -> FloatArray:
    turned: FloatArray = (axes * point[:, None]).sum(axis=0)
    return turned
