"""Capsules: what the renderer draws, and where each of them is.

A `Figure` is a list of capsules (cones with round ends) that hang on the points of a pose; `place` puts them into the
world. Which capsules make up a body is the business of `renderer.figure`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.colour import RGB, check_colour
from renderer.errors import RendererError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

BACKGROUND: RGB = (222, 223, 225)


@dataclass(frozen=True, eq=False)
class Figure:
    """Capsules on points: cones with round ends, each from one point towards another.

    Parameters
    ----------
    style
        What its maker calls it, for manifests.
    points
        How many points a pose has.
    ends : (capsules, 2)
        The two points that each capsule hangs on.
    along : (capsules, 2)
        Where its ends lie between them: 0 on the first point, 1 on the second.
    beyond : (capsules, 2)
        Metres added to that along the line, so that a head has its size whatever the rig's head bone.
    radii : (capsules, 2)
        Metres, at each end.
    colours : (capsules, 3)
        8-bit RGB.
    background
        8-bit RGB.
    lit
        Whether capsules are shaded as round; else flat discs of one colour.
    rounded : (capsules, 2)
        Whether an end is shaded as a round one, not as going straight on into the next bone; no end where None.
    forward : (capsules, 2)
        Metres added to each end the way that the body faces; zeros where None.
    facing
        Four points that say which way it faces: left, right, low and high, as both shoulders, neck and head.
    floor_m
        Height of a floor to stand on, metres; None for none.
    """

    style: str
    points: int
    ends: IntArray
    along: FloatArray
    beyond: FloatArray
    radii: FloatArray
    colours: IntArray
    background: RGB = BACKGROUND
    lit: bool = True
    rounded: NDArray[np.bool_] | None = None
    forward: FloatArray | None = None
    facing: tuple[int, int, int, int] | None = None
    floor_m: float | None = None

    def __post_init__(self) -> None:
        check_colour(self.background, "background colour")
        count = len(self.ends)
        for name, shape in (
            ("ends", (count, 2)),
            ("along", (count, 2)),
            ("beyond", (count, 2)),
            ("radii", (count, 2)),
            ("colours", (count, 3)),
        ):
            array = np.array(getattr(self, name), dtype=np.int64 if name in ("ends", "colours") else np.float64)
            if array.shape != shape or count == 0:
                raise RendererError(
                    f"Expected a figure's {name} of shape {shape}, at least one capsule, got {array.shape}."
                )
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if self.forward is not None and (self.facing is None or self.forward.shape != (count, 2)):
            raise RendererError(f"Expected shifts forward of shape {(count, 2)}, and points that say where that is.")
        if self.rounded is not None and self.rounded.shape != (count, 2):
            raise RendererError(f"Expected round ends of shape {(count, 2)}, got {self.rounded.shape}.")
        if self.floor_m is not None and not np.isfinite(self.floor_m):
            raise RendererError(f"Expected a floor at a finite height, got {self.floor_m}.")
        if self.ends.min() < 0 or self.ends.max() >= self.points:
            raise RendererError(
                f"Expected capsules on points 0 to {self.points - 1}, got {self.ends.min()} to {self.ends.max()}."
            )
        if not (np.isfinite(self.radii).all() and (self.radii > 0).all()):
            raise RendererError("Expected capsules with radii above 0 metres.")


def place(figure: Figure, positions: FloatArray) -> FloatArray:
    """The ends of every capsule in the world: `(frames, capsules, 2, 3)` from points `(frames, points, 3)`."""
    if positions.shape[1] != figure.points:
        raise RendererError(
            f"Expected {figure.points} points a frame, as the figure was made for, got {positions.shape[1]}; "
            "bones and positions must come from one skeleton, end sites included."
        )
    first, second = positions[:, figure.ends[:, 0]], positions[:, figure.ends[:, 1]]
    way = second - first
    length = np.sqrt(way[..., 0] ** 2 + way[..., 1] ** 2 + way[..., 2] ** 2)[..., None]
    # A bone of no length points up: heads of rigs without a head bone still sit on the neck.
    unit = np.where(length > 1e-6, way / np.maximum(length, 1e-6), np.array([0.0, 1.0, 0.0]))
    placed: FloatArray = np.stack(
        [first + way * figure.along[:, e, None] + unit * figure.beyond[:, e, None] for e in (0, 1)], axis=2
    )
    if figure.forward is not None and figure.facing is not None:
        placed += _facing(positions, figure.facing)[:, None, None] * figure.forward[:, :, None]
    return placed


def outline(figure: Figure, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What a figure takes of space: ends of its capsules `(frames, points, 3)`, and their radii `(points,)`, metres."""
    return place(figure, positions).reshape(len(positions), -1, 3), figure.radii.reshape(-1)


def _facing(positions: FloatArray, points: tuple[int, int, int, int]) -> FloatArray:
    """The way a body faces: square to the line of its shoulders and to the line up its neck; `(frames, 3)`."""
    left, right, low, high = (positions[:, point] for point in points)
    a, b = left - right, high - low
    out = np.stack(
        [
            a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1],
            a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2],
            a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0],
        ],
        axis=1,
    )
    length = np.sqrt(out[:, 0] ** 2 + out[:, 1] ** 2 + out[:, 2] ** 2)[:, None]
    facing: FloatArray = np.where(length > 1e-9, out / np.maximum(length, 1e-9), 0.0)
    return facing


def kept_capsules(figure: Figure, keep: NDArray[np.bool_]) -> Figure:
    """The figure with only some of its capsules, `keep (capsules,)`."""
    names = ("ends", "along", "beyond", "radii", "colours", "rounded", "forward")
    kept = {name: getattr(figure, name)[keep] for name in names if getattr(figure, name) is not None}
    return replace(figure, **kept)
