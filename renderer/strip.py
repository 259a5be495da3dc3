"""Time-lapse strips: a motion in one picture, as the figures of the papers show it.

Positions, a figure and (for a blend) its segments come in; one PNG goes out: a row of poses, evenly spaced in time.
Source, blend and destination have their own colours.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from renderer.camera import Camera, check_positions, project
from renderer.capsules import Figure
from renderer.errors import RendererError
from renderer.files import whole_file
from renderer.framing import find_heading, frame_group
from renderer.offscreen import render_rgb
from renderer.segments import Segment, painted

FloatArray = NDArray[np.float64]
Bytes = NDArray[np.uint8]


def render_strip(
    path: Path | str,
    positions: ArrayLike,
    figure: Figure,
    *,
    count: int = 9,
    frames: Sequence[int] | None = None,
    segments: Sequence[Segment] = (),
    height: int = 360,
    view: str | float = "three-quarter",
) -> Path:
    """Write a strip as PNG; returns its path.

    Parameters
    ----------
    path
        The PNG to write, whole or not at all.
    positions : (frames, points, 3)
        Metres, Y up.
    figure
        Its own colours are used where no segment is given.
    count
        Poses, evenly spaced over time; fewer where there are fewer frames.
    frames
        Which frames to show, instead of `count`.
    segments
        Stretches with their own colours; frames in none of them keep the figure's.
    height
        Of the picture, pixels.
    view
        As for `frame_group`.
    """
    target = Path(path)
    if target.suffix.lower() != ".png":
        raise RendererError(f"Expected a strip's name to end in .png, got {target.name!r}.")
    points = check_positions(positions)
    if not (height % 2 == 0 and 32 <= height <= 4096):
        raise RendererError(f"Expected an even height from 32 to 4096 pixels, got {height}.")
    shown = _choose(len(points), count, frames)
    figures = [painted(figure, frame, segments) for frame in shown]
    picture = np.concatenate(list(_cells(points, shown, figures, height, view)), axis=1)
    from PIL import Image

    with whole_file(target) as unfinished:
        Image.fromarray(picture).save(unfinished, format="png")
    return target


def _cells(
    points: FloatArray,
    shown: Sequence[int],
    figures: Sequence[Figure],
    height: int,
    view: str | float,
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
        yield next(render_rgb(pose[None], figure, cell))


def _reach(poses: FloatArray, camera: Camera) -> int:
    """Pixels from the middle of the frame to the furthest that a figure at these points may reach, left or right."""
    pixels, nearness = project(camera, poses)
    half = np.abs(pixels[..., 0] - 0.5 * camera.size[0]) + 0.12 * camera.focal_pixels * nearness
    return int(np.ceil(half.max()))


def _choose(total: int, count: int, frames: Sequence[int] | None) -> list[int]:
    if frames is not None:
        chosen = [int(frame) for frame in frames]
        if not chosen or min(chosen) < 0 or max(chosen) >= total:
            raise RendererError(f"Expected frames from 0 to {total - 1}, got {list(frames)}.")
        return chosen
    if count < 1:
        raise RendererError(f"Expected at least one pose, got count {count}.")
    return sorted({round(frame) for frame in np.linspace(0, total - 1, min(count, total)).tolist()})
