"""A screen: paints pictures and frames of motions into a window's framebuffer. It knows GL, but neither glfw nor time.

RGB images and motions `(frames, points, 3)` in metres come in. A frame is painted with the capsules of the offscreen
renderer and the same colours, and a floor by a shader of the same arithmetic, so a frame in a window is that of the
video, as large as the window allows.
"""

from __future__ import annotations

from dataclasses import replace
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.camera import Camera, camera_path, check_positions
from renderer.capsules import Figure
from renderer.events import Size
from renderer.floor import uniforms
from renderer.painter import SCREEN, Painter
from renderer.shapes import Shapes, lay_out

RGB = tuple[int, int, int]
Place = tuple[int, int, int, int]
Shares = tuple[float, float, float, float]
"""Left, top, right and bottom of a part of the window, as shares of its width and height."""
WHOLE: Shares = (0.0, 0.0, 1.0, 1.0)

_KEPT_FLOORS = 2


class Picture:
    """An RGB picture in the window's memory; made by `Screen.picture`."""

    def __init__(self, texture: Any) -> None:
        self.texture = texture
        self.size: Size = texture.size

    def release(self) -> None:
        """Free it."""
        self.texture.release()


class Drawing:
    """A motion laid out for a window, to be drawn frame by frame; made by `Screen.drawing`."""

    def __init__(
        self,
        positions: NDArray[np.float64],
        figure: Figure,
        camera: Camera,
        fps: float,
        height: float,
        cell: Shares = WHOLE,
    ) -> None:
        self.positions, self.figure, self.fps, self._made_for, self._height = positions, figure, fps, camera, height
        self._cell = cell
        self.frames = len(positions)
        self.path = camera_path(positions, camera, fps)
        self.size: Size | None = None
        self.camera = camera
        self.place: Place = (0, 0, *camera.size)
        self.shapes: Shapes | None = None

    def fit(self, size: Size) -> bool:
        """Lay the motion out for a window of that size; False where that was done before."""
        if self.size == size:
            return False
        left, top, right, bottom = (round(share * edge) for share, edge in zip(self._cell, (*size, *size), strict=True))
        self.camera = fitted_camera(self._made_for, (right - left, bottom - top), self._height)
        width, height = self.camera.size
        self.place = ((left + right - width) // 2, (top + bottom - height) // 2, width, height)
        self.shapes = lay_out(self.positions, self.figure, self.camera, self.fps)
        self.shapes.data[..., 12:14] += np.array(self.place[:2], dtype=np.float32)
        self.size = size
        return True


def fitted_camera(camera: Camera, size: Size, height: float) -> Camera:
    """The camera with its picture `height` pixels high, or as high as the window allows where that is less."""
    made = camera.size
    scale = min(size[0] / made[0], size[1] / made[1], height / made[1])
    wide, high = (max(16, int(edge * scale + 1e-6) // 2 * 2) for edge in made)
    return replace(camera, size=(wide, high), focal_pixels=camera.focal_pixels * min(wide / made[0], high / made[1]))


class Screen:
    """The programs and textures of one window's context. Sizes are those of the window when it is painted."""

    def __init__(self, gl: Any) -> None:
        self.gl = gl
        self._painter = Painter(gl, (SCREEN,))
        self._copy, self._floor = (_program(gl, name) for name in ("picture", "floor"))
        self._copy_array, self._floor_array = (gl.vertex_array(one, []) for one in (self._copy, self._floor))
        self._floors: dict[tuple[Any, ...], _LoadedFloor] = {}

    def release(self) -> None:
        """Free what it holds of the context."""
        for floor in self._floors.values():
            floor.release()
        self._painter.release()

    def picture(self, rgb: NDArray[np.uint8]) -> Picture:
        """Load an RGB picture `(height, width, 3)`; the first row is the top."""
        height, width, _ = rgb.shape
        texture = self.gl.texture((width, height), 3, np.ascontiguousarray(rgb).tobytes(), alignment=1)
        return Picture(_sharp(texture))

    def drawing(
        self,
        positions: NDArray[np.float64],
        figure: Figure,
        camera: Camera,
        fps: float,
        size: Size,
        height: float,
        cell: Shares = WHOLE,
    ) -> Drawing:
        """Lay out a motion for a part of a window of that size, floor included."""
        made = Drawing(check_positions(positions), figure, camera, fps, height, cell)
        made.fit(size)
        if figure.floor_m is not None:
            self._floor_picture(made, 0)
        return made

    def clear(self, colour: RGB, size: Size) -> None:
        """Make the whole window one colour."""
        self.gl.screen.use()
        self.gl.viewport = (0, 0, *size)
        self.gl.clear(*(value / 255.0 for value in colour))

    def paint(self, picture: Picture, background: RGB, size: Size) -> None:
        """A picture in the middle, pixel for pixel."""
        self.clear(background, size)
        wide, high = picture.size
        self._copy_to(picture, ((size[0] - wide) // 2, (size[1] - high) // 2, wide, high))

    def _copy_to(self, picture: Picture, place: Place) -> None:
        self.gl.disable(self.gl.BLEND)
        self.gl.viewport = place
        picture.texture.use(0)
        self._copy_array.render(self.gl.TRIANGLE_STRIP, vertices=4)

    def paint_frame(self, drawing: Drawing, frame: int, size: Size, *, over: bool = False) -> None:
        """One frame of a motion on its figure's background, or `over` what was painted before."""
        drawing.fit(size)
        assert drawing.shapes is not None, "fit lays it out"
        floor = None if drawing.figure.floor_m is None else self._floor_picture(drawing, frame)
        if not over:
            self.clear(drawing.figure.background, size)
        left, top, wide, high = drawing.place
        place = (left, size[1] - top - high, wide, high)
        if floor is not None:
            self._copy_to(floor, place)
        self.gl.scissor = place
        self.gl.viewport = (0, 0, *size)
        self._painter.paint(SCREEN, self._painter.load(drawing.shapes.data[frame]), size)
        self.gl.scissor = None

    def _floor_picture(self, drawing: Drawing, frame: int) -> Picture:
        """The floor at one frame; painted again only if the camera has moved."""
        floor = self._loaded_floor(drawing)
        shift, axes = drawing.path.shift[frame], drawing.path.axes[frame]
        seen_from = (shift.tobytes(), axes.tobytes())
        if floor.seen_from != seen_from:
            floor.seen_from = seen_from
            right, above, back = (tuple(row) for row in axes)
            moving = {"shift": (float(shift[0]), float(shift[2])), "right": right, "above": above, "back": back}
            for name, value in {**floor.uniforms, **moving}.items():
                self._floor[name].value = value
            floor.target.use()
            self.gl.disable(self.gl.BLEND)
            self._floor_array.render(self.gl.TRIANGLE_STRIP, vertices=4)
        return floor.picture

    def _loaded_floor(self, drawing: Drawing) -> _LoadedFloor:
        """The same for all motions under one camera, so the latest ones are kept."""
        camera, figure = drawing.camera, drawing.figure
        key = (camera.eye.tobytes(), camera.focal_pixels, camera.size, figure.floor_m, figure.background)
        if key not in self._floors:
            while len(self._floors) >= _KEPT_FLOORS:
                self._floors.pop(next(iter(self._floors))).release()
            self._floors[key] = _LoadedFloor(self.gl, uniforms(figure, camera), camera.size)
        return self._floors[key]


class _LoadedFloor:
    """What the floor's shader paints from, and the picture that it painted last."""

    def __init__(self, gl: Any, uniforms: dict[str, Any], size: Size) -> None:
        self.uniforms = uniforms
        self.picture = Picture(_sharp(gl.texture(size, 4)))
        self.target = gl.framebuffer([self.picture.texture])
        self.seen_from: tuple[bytes, ...] | None = None

    def release(self) -> None:
        """Free it."""
        self.target.release()
        self.picture.release()


def _sharp(texture: Any) -> Any:
    texture.filter = (texture.ctx.NEAREST, texture.ctx.NEAREST)
    return texture


def _program(gl: Any, name: str) -> Any:
    folder = resources.files("renderer.shaders")
    parts = (folder / file for file in ("place.vert", f"{name}.frag"))
    vertex, fragment = ("#version 330\n" + part.read_text(encoding="utf-8") for part in parts)
    return gl.program(vertex_shader=vertex, fragment_shader=fragment)
