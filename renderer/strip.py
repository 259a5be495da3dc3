"""Time-lapse strips: a motion in one picture, as the figures of the papers show it.

Positions, a figure and (for a blend) its segments come in; one PNG goes out: either a row of poses, evenly spaced in
time, or an onion skin, where the poses stand where they were, earlier ones paler. Source, blend and destination have
their own colours.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.camera import Camera, check_positions, project
from renderer.capsules import Figure
from renderer.context import Context
from renderer.errors import RendererError
from renderer.files import whole_file
from renderer.framing import find_heading, frame_group
from renderer.offscreen import render_layers
from renderer.segments import Segment, painted

FloatArray = NDArray[np.float64]
Bytes = NDArray[np.uint8]

LAYOUTS = ("row", "onion")


def render_strip(
    path: Path | str,
    positions: ArrayLike,
    figure: Figure,
    camera: Camera | None = None,
    *,
    count: int = 9,
    frames: Sequence[int] | None = None,
    segments: Sequence[Segment] = (),
    layout: str = "row",
    height: int = 360,
    view: str | float = "three-quarter",
    context: Context | None = None,
) -> Path:
    """Write a strip as PNG.

    Parameters
    ----------
    path
        The PNG to write, whole or not at all.
    positions : (frames, points, 3)
        Metres, Y up.
    figure
        Its own colours are used where no segment is given.
    camera
        For an onion skin: by default one that sees all its poses. A row has cameras of its own.
    count
        Poses, evenly spaced over time; fewer where there are fewer frames.
    frames
        Which frames to show, instead of `count`.
    segments
        Stretches with their own colours; frames in none of them keep the figure's.
    layout
        `"row"` or `"onion"`.
    height
        Of the picture, pixels.
    view
        As for `frame_group`.
    context
        By default the process's own.

    Returns
    -------
    Path
        The file.
    """
    target = Path(path)
    if target.suffix.lower() != ".png":
        raise RendererError(f"Expected a strip's name to end in .png, got {target.name!r}.")
    picture = draw_strip(
        positions,
        figure,
        camera,
        count=count,
        frames=frames,
        segments=segments,
        layout=layout,
        height=height,
        view=view,
        context=context,
    )
    from PIL import Image

    with whole_file(target) as unfinished:
        Image.fromarray(picture).save(unfinished, format="png")
    return target


def draw_strip(
    positions: ArrayLike,
    figure: Figure,
    camera: Camera | None = None,
    *,
    count: int = 9,
    frames: Sequence[int] | None = None,
    segments: Sequence[Segment] = (),
    layout: str = "row",
    height: int = 360,
    view: str | float = "three-quarter",
    context: Context | None = None,
) -> Bytes:
    """The picture of `render_strip`, RGB `(height, width, 3)`."""
    points = check_positions(positions)
    if layout not in LAYOUTS:
        raise RendererError(f"Expected a layout of {', '.join(LAYOUTS)}, got {layout!r}.")
    if not (height % 2 == 0 and 32 <= height <= 4096):
        raise RendererError(f"Expected an even height from 32 to 4096 pixels, got {height}.")
    shown = _choose(len(points), count, frames)
    figures = [painted(figure, frame, segments) for frame in shown]
    if layout == "onion":
        seen = camera or frame_group([points[shown]], size=_wide(points[shown], height, view), view=view)
        faded = [_faded(f, share) for f, share in zip(figures, np.linspace(0.62, 0.0, len(shown)), strict=True)]
        return render_layers([(points[frame], f) for frame, f in zip(shown, faded, strict=True)], seen, context)
    return np.concatenate(list(_cells(points, shown, figures, height, view, context)), axis=1)


def _cells(
    points: FloatArray,
    shown: Sequence[int],
    figures: Sequence[Figure],
    height: int,
    view: str | float,
    context: Context | None,
) -> Iterator[Bytes]:
    """One image for each pose, all from the same side and at the same size, without movement over the floor."""
    heading = find_heading([points])
    poses = points[list(shown)]
    middle = 0.5 * (poses.min(axis=1) + poses.max(axis=1))
    middle[:, 1] = 0.0
    poses = poses - middle[:, None]
    tall = frame_group([poses], size=(height * 4, height), view=view, heading=heading, fill=0.94, elevation=0.06)
    width = max(32, 2 * _reach(poses, tall))
    cell = replace(tall, size=(width, height))
    for pose, figure in zip(poses, figures, strict=True):
        yield render_layers([(pose, figure)], cell, context)


def _reach(poses: FloatArray, camera: Camera) -> int:
    """Pixels from the middle of the frame to the furthest that a figure at these points may reach, left or right."""
    pixels, nearness = project(camera, poses)
    half = np.abs(pixels[..., 0] - 0.5 * camera.size[0]) + 0.12 * camera.focal_pixels * nearness
    return int(np.ceil(half.max()))


def _wide(poses: FloatArray, height: int, view: str | float) -> tuple[int, int]:
    """A frame as wide as the motion needs at this height, up to eight times the height."""
    widest = 8 * height
    reach = _reach(poses, frame_group([poses], size=(min(widest, 8192), height), view=view))
    return (min(widest, 8192, max(height // 2 * 2, 2 * reach)), height)


def _choose(total: int, count: int, frames: Sequence[int] | None) -> list[int]:
    if frames is not None:
        chosen = [int(frame) for frame in frames]
        if not chosen or min(chosen) < 0 or max(chosen) >= total:
            raise RendererError(f"Expected frames from 0 to {total - 1}, got {list(frames)}.")
        return chosen
    if count < 1:
        raise RendererError(f"Expected at least one pose, got count {count}.")
    return sorted({round(frame) for frame in np.linspace(0, total - 1, min(count, total)).tolist()})


def _faded(figure: Figure, share: float) -> Figure:
    """The figure, that share of the way to its background."""
    ground = np.array(figure.background, dtype=np.float64)
    return replace(figure, colours=np.round(figure.colours + (ground - figure.colours) * share).astype(np.int64))
