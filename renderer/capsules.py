"""Capsules: what the renderer draws, and where each of them is.

A `Figure` is a list of capsules (cones with round ends) that hang on the points of a pose; `place` puts them into the
world. Which capsules make up a body is the business of `renderer.figure`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.colour import RGB, check_colour
from renderer.errors import RendererError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

BACKGROUND: RGB = (222, 223, 225)


@dataclass(frozen=True)
class Way:
    """A direction in a body: from one point of a pose to another, or square to two other directions.

    Parameters
    ----------
    start, end
        Points, by number; or two ways, whose cross product it is then.
    otherwise
        What to take where the two coincide; up, by default.
    """

    start: int | Way
    end: int | Way
    otherwise: Way | None = None


@dataclass(frozen=True)
class Anchor:
    """A point of a body that is no joint: the weighted mean of points, moved by metres along directions.

    Parameters
    ----------
    mean
        Points, by number, and their weights.
    moved
        Directions and metres.
    """

    mean: tuple[tuple[int, float], ...]
    moved: tuple[tuple[Way, float], ...] = ()


_ARRAYS: dict[str, tuple[tuple[int, ...], type]] = {
    "ends": ((2,), np.int64), "along": ((2,), np.float64), "beyond": ((2,), np.float64), "radii": ((2,), np.float64),
    "colours": ((3,), np.int64), "rounded": ((2,), np.bool_), "part": ((), np.int64), "lift": ((), np.float64),
}  # fmt: skip
"""The arrays of a figure, with what each has for a capsule."""


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
        The two points that each capsule hangs on: those of a pose, and after them the anchors.
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
        Whether an end is shaded as a round one, not as going straight on into the next bone; no end by default.
    anchors
        Further points to hang capsules on; each may rest on those before it.
    part : (capsules,)
        The capsule along whose line each one is lit. Those with one line look like one surface, whatever they are put
        together from; each by its own by default.
    lift : (capsules,)
        Metres by which it counts as nearer to the eye when it is decided what is painted over what; zeros by default.
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
    rounded: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    anchors: tuple[Anchor, ...] = ()
    part: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    lift: FloatArray = field(default_factory=lambda: np.zeros(0))
    floor_m: float | None = None
    ending: tuple[int, int] = (0, 0)

    def __post_init__(self) -> None:
        check_colour(self.background, "background colour")
        count = len(self.ends)
        defaults: dict[str, NDArray[Any]] = {
            "rounded": np.zeros((count, 2)),
            "part": np.arange(count),
            "lift": np.zeros(count),
        }
        for name, (shape, kind) in _ARRAYS.items():
            given = np.asarray(getattr(self, name))
            array: NDArray[Any] = np.array(given if given.size else defaults.get(name, given), dtype=kind)
            if array.shape != (count, *shape) or count == 0:
                raise RendererError(
                    f"Expected a figure's {name} of shape {(count, *shape)}, at least one capsule, got {array.shape}."
                )
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if self.floor_m is not None and not np.isfinite(self.floor_m):
            raise RendererError(f"Expected a floor at a finite height, got {self.floor_m}.")
        last = self.points + len(self.anchors) - 1
        if self.ends.min() < 0 or self.ends.max() > last:
            raise RendererError(f"Expected capsules on points 0 to {last}, got {self.ends.min()} to {self.ends.max()}.")
        if not (np.isfinite(self.radii).all() and (self.radii > 0).all()):
            raise RendererError("Expected capsules with radii above 0 metres.")


def place(figure: Figure, positions: FloatArray) -> FloatArray:
    """The ends of every capsule in the world: `(frames, capsules, 2, 3)` from points `(frames, points, 3)`."""
    if positions.shape[1] != figure.points:
        raise RendererError(
            f"Expected {figure.points} points a frame, as the figure was made for, got {positions.shape[1]}; "
            "bones and positions must come from one skeleton, end sites included."
        )
    positions = _with_anchors(figure, positions)
    first, second = positions[:, figure.ends[:, 0]], positions[:, figure.ends[:, 1]]
    way = second - first
    length = np.sqrt(way[..., 0] ** 2 + way[..., 1] ** 2 + way[..., 2] ** 2)[..., None]
    # A bone of no length points up: heads of rigs without a head bone still sit on the neck.
    unit = np.where(length > 1e-6, way / np.maximum(length, 1e-6), np.array([0.0, 1.0, 0.0]))
    placed: FloatArray = np.stack(
        [first + way * figure.along[:, e, None] + unit * figure.beyond[:, e, None] for e in (0, 1)], axis=2
    )
    return placed


def _with_anchors(figure: Figure, positions: FloatArray) -> FloatArray:
    """The points of each pose, and the anchors after them; summed one by one, so that every machine rounds alike."""
    points = [positions[:, i] for i in range(figure.points)]
    known: dict[Way, FloatArray] = {}
    for anchor in figure.anchors:
        place = np.zeros((len(positions), 3))
        for point, weight in anchor.mean:
            place = place + weight * points[point]
        for way, metres in anchor.moved:
            place = place + metres * _direction(way, points, known)
        points.append(place)
    return np.stack(points, axis=1) if figure.anchors else positions


def _direction(way: Way, points: Sequence[FloatArray], known: dict[Way, FloatArray]) -> FloatArray:
    """A unit vector for each frame, `(frames, 3)`."""
    if way not in known:
        if isinstance(way.start, int) and isinstance(way.end, int):
            out = points[way.end] - points[way.start]
        elif isinstance(way.start, Way) and isinstance(way.end, Way):
            a, b = (_direction(one, points, known) for one in (way.start, way.end))
            x, y, z = (a[:, i] * b[:, j] - a[:, j] * b[:, i] for i, j in ((1, 2), (2, 0), (0, 1)))
            out = np.stack([x, y, z], axis=1)
        else:
            raise AssertionError("a direction rests on two points or on two directions")
        length = np.sqrt(out[:, 0] ** 2 + out[:, 1] ** 2 + out[:, 2] ** 2)[:, None]
        instead = np.array([0.0, 1.0, 0.0]) if way.otherwise is None else _direction(way.otherwise, points, known)
        known[way] = np.where(length > 1e-6, out / np.maximum(length, 1e-6), instead)
    return known[way]


def kept_capsules(figure: Figure, keep: NDArray[np.bool_]) -> Figure:
    """The figure with only some of its capsules, `keep (capsules,)`."""
    number = np.cumsum(keep) - 1
    part = np.where(keep[figure.part], number[figure.part], number)[keep]
    kept = {name: getattr(figure, name)[keep] for name in _ARRAYS}
    return replace(figure, **{**kept, "part": part})
