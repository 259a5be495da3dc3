"""Offscreen frames: positions in, NV12 or RGB pictures out.

NV12 is what the H.264 encoder takes: a plane of luma, and below it one of half the size with both chromas in turn,
in one array `(height * 3 / 2, width)`. Drawing it directly spares a conversion that costs more than the drawing.

Only the box that the figure takes is drawn and read back; several frames share one picture (an atlas), so that calls
to GL are few. A capsule's pixels are computed from its own numbers and the pixel's place in the frame, both
exact whatever the place in the atlas, so the frames do not depend on the batch.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.camera import Camera, camera_path, check_positions, check_size
from renderer.capsules import Figure
from renderer.colour import to_ycbcr
from renderer.context import Context, shared_context
from renderer.errors import RendererError
from renderer.floor import Floor
from renderer.painter import Painter
from renderer.segments import Segment
from renderer.shapes import Shapes, lay_out

Bytes = NDArray[np.uint8]
Box = tuple[int, int, int, int]
BATCH = 16


def plain_frame(size: tuple[int, int], background: tuple[int, int, int]) -> Bytes:
    """An NV12 frame of one colour, `(height * 3 / 2, width)`."""
    width, height = check_size(size)
    frame = np.empty((height * 3 // 2, width), dtype=np.uint8)
    luma, blue, red = (round(value) for value in to_ycbcr(background))
    frame[:height] = luma
    frame[height:, 0::2] = blue
    frame[height:, 1::2] = red
    return frame


def render_frames(
    positions: ArrayLike,
    figure: Figure,
    camera: Camera,
    *,
    batch: int = BATCH,
    context: Context | None = None,
    fps: float = 30.0,
) -> Iterator[Bytes]:
    """Frames of NV12, `(height * 3 / 2, width)` each, one for each frame of `positions (frames, points, 3)`.

    Parameters
    ----------
    positions : (frames, points, 3)
        Metres, Y up.
    figure, camera
        What to draw, and from where.
    batch
        Frames drawn at a time; has no influence on the pixels.
    context
        By default the process's own.
    fps
        Frames per second of the positions; matters to a camera that tracks.

    Raises
    ------
    RendererError
        For positions that are not finite, no frames, or a batch below 1.
    """
    for frame, _ in paste_frames(positions, figure, camera, fps=fps, batch=batch, context=context):
        yield frame.copy()


def render_rgb(
    positions: ArrayLike, figure: Figure, camera: Camera, *, context: Context | None = None, fps: float = 30.0
) -> Iterator[Bytes]:
    """Frames of RGB, `(height, width, 3)` each, drawn without the half-size chroma of video; for stills."""
    points = check_positions(positions)
    shapes = lay_out(points, figure, camera, fps)
    ground = Ground(figure, camera, points, fps)
    gl = (context or shared_context()).gl
    width, height = camera.size
    target = gl.framebuffer([gl.texture(camera.size, 3)])
    try:
        for number, data in enumerate(shapes.data):
            with gl:
                floor = ground.floor(number)
                if floor is None:
                    target.clear(*(value / 255.0 for value in figure.background))
                else:
                    target.color_attachments[0].write(floor.rgb(ground.path.shift[number]).tobytes(), alignment=1)
                target.use()
                painter = painter_of(gl)
                painter.paint("rgb", painter.load(data), camera.size)
                read = target.read(components=3, alignment=1)
            yield np.frombuffer(read, dtype=np.uint8).reshape(height, width, 3)
    finally:
        with gl:
            _release(target)


def _release(target: Any) -> None:
    for attachment in target.color_attachments:
        attachment.release()
    target.release()


def paste_frames(
    positions: ArrayLike,
    figure: Figure,
    camera: Camera,
    *,
    fps: float = 30.0,
    segments: Sequence[Segment] = (),
    batch: int = BATCH,
    context: Context | None = None,
) -> Iterator[tuple[Bytes, Box]]:
    """The frames of `render_frames`, each in the *same* array: to be used up before the next one is asked for.

    Frames in one of the `segments` have its colours. With each comes the box (left, top, right, bottom) outside which
    it is the background.
    """
    points = check_positions(positions)
    if batch < 1:
        raise RendererError(f"Expected a batch of at least one frame, got {batch}.")
    shapes = lay_out(points, figure, camera, fps, segments)
    backdrop = Ground(figure, camera, points, fps)
    gl = (context or shared_context()).gl
    canvas = backdrop.frame(0).copy()
    atlas = Atlas(gl, painter_of(gl), shapes, camera.size, backdrop, batch)
    try:
        for first in range(0, len(points), batch):
            for number, tile in enumerate(atlas.draw(first, min(first + batch, len(points))), start=first):
                background = backdrop.frame(number)
                if backdrop.moves:
                    canvas[:] = background
                _put(canvas, camera.size[1], tile)
                yield canvas, tile.box if backdrop.plain else (0, 0, *camera.size)
                _put_back(canvas, background, camera.size[1], tile)
    finally:
        atlas.release()


class Ground:
    """What is behind the figure: one colour, or a floor, which moves under a camera that tracks or turns."""

    def __init__(self, figure: Figure, camera: Camera, positions: NDArray[np.float64], fps: float) -> None:
        self._figure, self._camera = figure, camera
        self.plain = figure.floor_m is None
        self.moves = not self.plain and (camera.track_seconds is not None or camera.turns is not None)
        self.path = camera_path(positions, camera, fps)
        self._floor = None if self.plain else Floor(figure, camera)
        self._known: dict[int, Bytes] = {}

    def floor(self, number: int) -> Floor | None:
        """The floor as the camera sees it in one frame, except for how far it has come."""
        if self._floor is None or self._camera.turns is None:
            return self._floor
        return Floor(self._figure, self._camera, self.path.axes[number])

    def frame(self, number: int) -> Bytes:
        """The NV12 frame without the figure; not to be written to."""
        key = number if self.moves else 0
        if key not in self._known:
            if len(self._known) >= 2 * BATCH:
                self._known.clear()
            floor = self.floor(number)
            self._known[key] = (
                plain_frame(self._camera.size, self._figure.background)
                if floor is None
                else floor.nv12(self.path.shift[number])
            )
        return self._known[key]


@dataclass(frozen=True, eq=False)
class Tile:
    """The pixels of one frame's box: left and top edge in the frame, luma, and chroma as bytes in turn."""

    left: int
    top: int
    luma: Bytes
    chroma: Bytes

    @property
    def box(self) -> Box:
        """Left, top, right and bottom edge in the frame."""
        rows, columns = self.luma.shape
        return self.left, self.top, self.left + columns, self.top + rows


def _put(canvas: Bytes, height: int, tile: Tile) -> None:
    rows, columns = tile.luma.shape
    canvas[tile.top : tile.top + rows, tile.left : tile.left + columns] = tile.luma
    top = height + tile.top // 2
    canvas[top : top + rows // 2, tile.left : tile.left + columns] = tile.chroma


def _put_back(canvas: Bytes, background: Bytes, height: int, tile: Tile) -> None:
    rows, columns = tile.luma.shape
    top = height + tile.top // 2
    for first, count in ((tile.top, rows), (top, rows // 2)):
        where = np.s_[first : first + count, tile.left : tile.left + columns]
        canvas[where] = background[where]


class Atlas:
    """A picture that holds the boxes of several frames side by side."""

    def __init__(
        self, gl: Any, painter: Painter, shapes: Shapes, size: tuple[int, int], backdrop: Ground, batch: int
    ) -> None:
        self._gl, self._painter, self._shapes, self._size = gl, painter, shapes, size
        self._boxes = _cut(shapes.boxes, size)
        self._loose = (self._boxes != shapes.boxes).any(axis=1)
        extent = self._boxes[:, 2:] - self._boxes[:, :2]
        self._tile = (max(2, int(extent[:, 0].max())), max(2, int(extent[:, 1].max())))
        limit = min(int(gl.info["GL_MAX_TEXTURE_SIZE"]), 8192)
        self._across = max(1, min(batch, limit // self._tile[0]))
        rows = max(1, min(-(-batch // self._across), limit // self._tile[1]))
        self._held = self._across * rows
        width, height = self._tile[0] * self._across, self._tile[1] * rows
        self._extent = (width, height)
        self._luma = gl.framebuffer([gl.texture((width, height), 1)])
        self._chroma = gl.framebuffer([gl.texture((width // 2, height // 2), 2)])
        self._luma_bytes = np.empty((height, width), dtype=np.uint8)
        self._chroma_bytes = np.empty((height // 2, width), dtype=np.uint8)
        self._backdrop = backdrop

    def draw(self, first: int, stop: int) -> Iterator[Tile]:
        """The tiles of frames `first .. stop - 1`, each to be used up before the next is asked for."""
        frame = first
        while frame < stop:
            # A figure that leaves the frame would paint over its neighbours: it gets the picture for itself, in whose
            # corner what sticks out to the left and above is cut, and the rest is not read.
            last = frame + 1
            while not self._loose[frame] and last < stop and last - frame < self._held and not self._loose[last]:
                last += 1
            yield from self._draw(frame, last)
            frame = last

    def _draw(self, first: int, stop: int) -> Iterator[Tile]:
        # Somebody may have made another context current since the last batch.
        with self._gl:
            place = self._paint(first, stop)
        for i, (x, y) in enumerate(place.tolist()):
            left, top, right, bottom = self._boxes[first + i].tolist()
            yield Tile(
                left,
                top,
                self._luma_bytes[y : y + bottom - top, x : x + right - left],
                self._chroma_bytes[y // 2 : (y + bottom - top) // 2, x : x + right - left],
            )

    def _paint(self, first: int, stop: int) -> NDArray[np.int64]:
        """Paint and read back frames `first .. stop - 1`; returns where in the picture each of them is."""
        count = stop - first
        width, height = self._tile
        place = np.stack([np.arange(count) % self._across * width, np.arange(count) // self._across * height], axis=1)
        data = self._shapes.data[first:stop].copy()
        data[..., 12:14] = (place - self._boxes[first:stop, :2])[:, None]
        capsules = self._painter.load(data)
        self._start(first, place)
        self._luma.use()
        self._painter.paint("luma", capsules, self._extent)
        self._chroma.use()
        self._painter.paint("chroma", capsules, self._extent)
        rows = (-(-count // self._across)) * height
        self._luma.read_into(self._luma_bytes, (0, 0, self._extent[0], rows), components=1, alignment=1)
        self._chroma.read_into(self._chroma_bytes, (0, 0, self._extent[0] // 2, rows // 2), components=2, alignment=1)
        return place

    def _start(self, first: int, place: NDArray[np.int64]) -> None:
        """The background of each tile."""
        height = self._size[1]
        if self._backdrop.plain:
            ground = self._backdrop.frame(first)
            self._luma.clear(float(ground[0, 0]) / 255.0)
            self._chroma.clear(*(float(value) / 255.0 for value in ground[height, :2]))
            return
        for i, (x, y) in enumerate(place.tolist()):
            ground = self._backdrop.frame(first + i)
            left, top, right, bottom = self._boxes[first + i].tolist()
            self._luma_bytes[y : y + bottom - top, x : x + right - left] = ground[top:bottom, left:right]
            self._chroma_bytes[y // 2 : (y + bottom - top) // 2, x : x + right - left] = ground[
                height + top // 2 : height + bottom // 2, left:right
            ]
        self._luma.color_attachments[0].write(self._luma_bytes, alignment=1)
        self._chroma.color_attachments[0].write(self._chroma_bytes, alignment=1)

    def release(self) -> None:
        """Free what it holds of the context."""
        with self._gl:
            for target in (self._luma, self._chroma):
                _release(target)


def _cut(boxes: NDArray[np.int64], size: tuple[int, int]) -> NDArray[np.int64]:
    """Boxes within the frame; one that lies outside altogether becomes empty."""
    width, height = size
    return np.clip(boxes, 0, np.array([width, height, width, height]))


_painters: weakref.WeakKeyDictionary[Any, Painter] = weakref.WeakKeyDictionary()


def painter_of(gl: Any) -> Painter:
    """The context's own painter: compiling takes longer than drawing a second of motion."""
    if gl not in _painters:
        _painters[gl] = Painter(gl)
    return _painters[gl]
