"""Shapes: a figure's capsules on the screen, in the order to paint them.

Positions `(frames, points, 3)` in metres, a `Figure` and a `Camera` come in; numbers go out that a shader paints
without knowing anything of bodies: for every capsule two ends in pixels, radii, colour. Capsules are painted
from the back to the front, each with smooth edges over what is there already, so that crossing limbs have smooth
edges too (a depth buffer would leave them jagged). Order is decided pair by pair where two limbs cross on the screen,
not by the middles of bones: else a long limb would jump before another while both are far from crossing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.camera import Camera, camera_path, project
from renderer.capsules import Figure, kept_capsules, place
from renderer.colour import to_ycbcr
from renderer.floor import shadow_capsules
from renderer.segments import Segment, painted

FloatArray = NDArray[np.float64]

FLOATS = 24
"""Numbers that the shader takes for each capsule; see `lay_out`."""

# Pixels around a capsule that its smooth edge may touch, in luma or in the half-size chroma.
EDGE_PIXELS = 2.0


@dataclass(frozen=True, eq=False)
class Shapes:
    """Capsules on the screen.

    Parameters
    ----------
    data : (frames, capsules, 24), float32
        In the order to paint: start x, y and the way to the end x, y (pixels, y down); radius at the start, growth
        of the radius, 1 / length squared, 1 / (2 mean radius); luma, blue chroma, red chroma (0..1 of the 8-bit
        range) and opacity; the shift into the picture that is drawn on (x, y), shading (0 none, 1 straight on past
        its ends, 2 round at the far end, 3 round at both), stretch of y; the line along which it is lit, as its own
        line and radii at the beginning.
    boxes : (frames, 4), int64
        Left, top, right and bottom edge of what may be touched, even numbers, not cut at the frame's edges.
    """

    data: NDArray[np.float32]
    boxes: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Poses:
    """Some frames of a motion with a figure on them, for any camera to look at; made by `pose`."""

    positions: FloatArray
    frames: list[int]
    figure: Figure
    placed: FloatArray


def pose(positions: FloatArray, figure: Figure, frames: Sequence[int]) -> Poses:
    """Put the figure on some frames of a motion `(frames, points, 3)`, in metres."""
    shown = list(frames)
    return Poses(positions, shown, *_without_hidden(figure, place(figure, positions[shown])))


def on_picture(poses: Poses, camera: Camera, fps: float) -> tuple[FloatArray, FloatArray]:
    """Where poses land in the picture, in pixels, y down.

    Returns
    -------
    tuple
        The points, `(frames, points, 2)`, and the edges of the figure as `lay_out` draws it, without smooth edges and
        shadows: `(frames, 4)`, left, top, right, bottom; not cut at the edges of the picture.
    """
    path = camera_path(poses.positions, camera, fps, poses.frames)
    shift = path.shift[:, None]
    ends, nearness = project(camera, poses.placed - shift[:, None], path.axes)
    reach = (poses.figure.radii * camera.focal_pixels * nearness)[..., None]
    edges = np.concatenate([(ends - reach).min(axis=(1, 2)), (ends + reach).max(axis=(1, 2))], axis=1)
    return project(camera, poses.positions[poses.frames] - shift, path.axes)[0], edges


def lay_out(
    positions: FloatArray, figure: Figure, camera: Camera, fps: float = 30.0, segments: Sequence[Segment] = ()
) -> Shapes:
    """Capsules on the screen, sorted from the back to the front; `fps` matters to a camera that moves."""
    path = camera_path(positions, camera, fps)
    placed = place(figure, positions - path.shift[:, None])
    figure, placed = _without_hidden(figure, placed)
    ends, nearness = project(camera, placed, path.axes)
    # Rounded to 1/256 pixel, as far as the eye goes; what remains of a difference in the last bit of a sine between
    # two machines is rounded away too.
    ends = np.round(ends * 256.0) / 256.0
    radii = figure.radii * camera.focal_pixels * nearness
    radii = np.maximum(np.round(radii * 256.0) / 256.0, 0.5)
    lifted = nearness + figure.lift[:, None] * nearness**2
    order = paint_order(ends, radii, lifted, figure.radii.mean(axis=1), joined(figure), figure.part)
    data = _shader_numbers(ends, radii, figure)
    for segment in segments:
        data[segment.start : segment.stop, :, 8:11] = _paint(painted(figure, segment.start, [segment]))
    data = np.take_along_axis(data, order[..., None], axis=1)
    boxes = _boxes(ends, radii)
    if figure.floor_m is not None:
        shadows, shadow_boxes = _shadows(placed, figure, camera, path.axes)
        data = np.concatenate([shadows, data], axis=1)
        boxes = np.concatenate(
            [np.minimum(boxes[:, :2], shadow_boxes[:, :2]), np.maximum(boxes[:, 2:], shadow_boxes[:, 2:])], axis=1
        )
    return _ended(Shapes(data, boxes), figure, camera) if any(figure.ending) else Shapes(data, boxes)


def visible_share(frames: int, ending: tuple[int, int]) -> FloatArray:
    """How much of the picture is seen in each frame, `(frames,)`: 1, falling in the fade, 0 under the cover.

    `ending` counts the frames of the fade and, after it, of the cover, at the end of the film.
    """
    fade, cover = ending
    following = np.arange(frames)[::-1] - cover
    return np.clip((following + 1) / (fade + 1), 0.0, 1.0)


def _ended(shapes: Shapes, figure: Figure, camera: Camera) -> Shapes:
    """The same with a disc in the colour of the background over everything, as opaque as the ending hides."""
    hidden = 1.0 - visible_share(len(shapes.data), figure.ending)
    ends, width, height = np.zeros((len(hidden), 1, 2, 2)), *camera.size
    ends[..., 0], ends[..., 1] = width / 2, height / 2
    # Over the whole picture where it hides anything, else so small that it costs nothing.
    radius = np.where(hidden > 0, float(width + height), 0.5)
    disc = _shader_numbers(ends, np.repeat(radius[:, None, None], 2, axis=2), None)
    disc[..., 8:11] = np.array(to_ycbcr(figure.background)) / 255.0
    disc[..., 11] = hidden[:, None]
    # A box beyond the edges: such a frame is drawn by itself, and the disc covers no other.
    whole = np.array([-2, -2, width + 2, height + 2])
    boxes = np.where(hidden[:, None] > 0, whole, shapes.boxes)
    return Shapes(np.concatenate([shapes.data, disc], axis=1), boxes)


def _shadows(
    placed: FloatArray, figure: Figure, camera: Camera, axes: FloatArray
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """The shadows' numbers and boxes; they cover fully in their middle and fade out towards their radius."""
    ends, radii, opacity, stretch, luma = shadow_capsules(placed, figure, camera, axes)
    ends, radii = np.round(ends * 256.0) / 256.0, np.maximum(np.round(radii * 256.0) / 256.0, 0.5)
    boxes = _boxes(ends, radii)
    round_ends = ends.copy()
    round_ends[..., 1] = ends[..., :1, 1] + (ends[..., 1] - ends[..., :1, 1]) * stretch[..., None]
    data = _shader_numbers(round_ends, radii, None)
    # cover = (r^2 - d^2) w + 1/2 is 1 in the middle and 0 at the radius R where r^2 = R^2 / 2 and w = 1 / R^2.
    data[..., 4:6] *= np.sqrt(0.5)
    data[..., 7] = 4.0 / (radii[..., 0] + radii[..., 1]) ** 2
    _, blue, red = to_ycbcr(figure.background)
    data[..., 8:11] = np.array([luma, round(blue), round(red)]) / 255.0
    data[..., 11] = opacity
    data[..., 15] = stretch
    return data, boxes


def _without_hidden(figure: Figure, placed: FloatArray) -> tuple[Figure, FloatArray]:
    """Leave out bones that have no length in any frame and hang on a bone that has: nobody would see them.

    Rigs are full of them (an offset of zero from the pelvis to both hips), and each costs as much as a limb.
    """
    way = np.abs(placed[:, :, 1] - placed[:, :, 0]).max(axis=(0, 2))
    long = way > 1e-6
    hidden = ~long & (joined(figure) & long[None]).any(axis=1)
    if not hidden.any():
        return figure, placed
    return kept_capsules(figure, ~hidden), placed[:, ~hidden]


def joined(figure: Figure) -> NDArray[np.bool_]:
    """Which capsules meet in a joint, `(capsules, capsules)`: they have one point in common, but not both."""
    start, end = figure.ends[:, 0], figure.ends[:, 1]
    on_start = (start[:, None] == start) | (start[:, None] == end)
    on_end = (end[:, None] == start) | (end[:, None] == end)
    meets: NDArray[np.bool_] = on_start != on_end
    return meets


def _shader_numbers(ends: FloatArray, radii: FloatArray, figure: Figure | None) -> NDArray[np.float32]:
    frames, count = ends.shape[:2]
    data = np.zeros((frames, count, FLOATS), dtype=np.float32)
    data[..., 0:8] = _line(ends, radii)
    data[..., 11] = 1.0
    data[..., 15] = 1.0
    data[..., 16:24] = data[..., 0:8]
    if figure is None:
        return data
    data[..., 8:11] = _paint(figure)
    if figure.lit:
        # 1: going straight on at both ends; 2: the far end is round; 3: both are.
        data[..., 14] = (1.0 + figure.rounded[:, 1] + figure.rounded.all(axis=1))[figure.part]
    for leader in np.unique(figure.part).tolist():
        members = np.flatnonzero(figure.part == leader)
        around = np.round(_reach(ends[:, members], radii[:, members], ends[:, leader]) * 256.0) / 256.0
        data[:, members, 16:24] = _line(ends[:, leader], around)[:, None]
    return data


def _line(ends: FloatArray, radii: FloatArray) -> FloatArray:
    """Start and way, radius at the start and its growth, 1 / length squared and 1 / (2 mean radius): `(..., 8)`."""
    way = ends[..., 1, :] - ends[..., 0, :]
    length2 = way[..., 0] ** 2 + way[..., 1] ** 2
    inverse = np.where(length2 > 1e-3, 1.0 / np.maximum(length2, 1e-3), 0.0)
    form = [radii[..., 0], radii[..., 1] - radii[..., 0], inverse, 1.0 / (radii[..., 0] + radii[..., 1])]
    line: FloatArray = np.concatenate([ends[..., 0, :], way, np.stack(form, axis=-1)], axis=-1)
    return line


def _reach(ends: FloatArray, radii: FloatArray, line: FloatArray) -> FloatArray:
    """How far the capsules of a part reach from its line `(frames, 2, 2)`, by their first ends and by their second."""
    start, way = line[:, None, None, 0], (line[:, 1] - line[:, 0])[:, None, None]
    out = ends - start
    share = np.clip(_dot(out, way) / np.maximum(_dot(way, way), 1e-3), 0.0, 1.0)
    out = out - share[..., None] * way
    reach: FloatArray = (np.sqrt(_dot(out, out)) + radii).max(axis=1)
    return reach


def _paint(figure: Figure) -> FloatArray:
    paint: FloatArray = np.array([to_ycbcr(colour) for colour in figure.colours]) / 255.0
    return paint


def _boxes(ends: FloatArray, radii: FloatArray) -> NDArray[np.int64]:
    reach = radii[..., None] + EDGE_PIXELS
    low = np.floor((ends - reach).min(axis=(1, 2)) / 2.0) * 2.0
    high = np.ceil((ends + reach).max(axis=(1, 2)) / 2.0) * 2.0
    boxes: NDArray[np.int64] = np.concatenate([low, high], axis=1).astype(np.int64)
    return boxes


def paint_order(
    ends: FloatArray,
    radii: FloatArray,
    nearness: FloatArray,
    thickness: FloatArray,
    meets: NDArray[np.bool_],
    parts: NDArray[np.int64] | None = None,
) -> NDArray[np.int64]:
    """Capsules from the back to the front, `(frames, capsules)`.

    Parameters
    ----------
    ends : (frames, capsules, 2, 2)
        Pixels.
    radii : (frames, capsules, 2)
        Pixels.
    nearness : (frames, capsules, 2)
        1 / distance of each end, which is linear along a line on the screen.
    thickness : (capsules,)
        Radius in metres.
    meets : (capsules, capsules)
        Which capsules share a joint: at the joint neither is before the other, so it counts whose surface comes
        closer to the eye at its middle.
    parts : (capsules,)
        The capsule that leads the part of which each is one; each is a part of its own where None. A part is painted as
        a whole: of all places where two parts cross, that counts where they are furthest apart.
    """
    frames, count = ends.shape[:2]
    leaders, part = np.unique(np.arange(count) if parts is None else parts, return_inverse=True)
    middle = np.stack([nearness[:, part == i].sum(axis=2).mean(axis=1) for i in range(len(leaders))], axis=1)
    lead = nearness[:, leaders].sum(axis=2)
    joined_parts = meets[np.ix_(leaders, leaders)]
    behind = np.zeros((frames, len(leaders), len(leaders)), dtype=bool)
    near, far = np.nonzero(np.triu(joined_parts, k=1))
    surface = thickness[leaders] - 2.0 / lead
    behind[:, near, far] = surface[:, far] >= surface[:, near]
    behind[:, far, near] = ~behind[:, near, far]
    one, two = np.triu_indices(count, k=1)
    apart = (part[one] != part[two]) & ~joined_parts[part[one], part[two]]
    one, two = one[apart], two[apart]
    frame, pair = np.nonzero(_boxes_overlap(ends, radii, one, two))
    one, two = one[pair], two[pair]
    s, t, gap = nearest_on_screen(ends[frame, one], ends[frame, two])
    ahead = _between(nearness[frame, two], t) - _between(nearness[frame, one], s)
    sums = nearness.sum(axis=2)
    ahead = np.where(ahead == 0.0, sums[frame, two] - sums[frame, one], ahead)
    touch = gap < radii[frame, one].max(axis=1) + radii[frame, two].max(axis=1) + 2.0
    frame, ahead, low, high = frame[touch], ahead[touch], part[one[touch]], part[two[touch]]
    most = np.full(behind.shape, -np.inf)
    np.maximum.at(most, (frame, low, high), ahead)
    np.maximum.at(most, (frame, high, low), -ahead)
    other = most.transpose(0, 2, 1)
    later = np.triu(np.ones(behind.shape[1:], dtype=bool))
    behind |= (most > other) | ((most == other) & np.isfinite(most) & later)
    ranks = np.argsort(_topological(behind, middle), axis=1)
    order: NDArray[np.int64] = np.argsort(ranks[:, part] * count + np.arange(count), axis=1)
    return order


def _between(ends: FloatArray, share: FloatArray) -> FloatArray:
    between: FloatArray = ends[:, 0] + share * (ends[:, 1] - ends[:, 0])
    return between


def _boxes_overlap(
    ends: FloatArray, radii: FloatArray, one: NDArray[np.int64], two: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Which pairs might touch, by the boxes around them: most do not, and need no closer look."""
    reach = radii.max(axis=2)[..., None] + 1.0
    low, high = ends.min(axis=2) - reach, ends.max(axis=2) + reach
    overlap: NDArray[np.bool_] = np.ones((len(ends), len(one)), dtype=bool)
    for axis in (0, 1):
        overlap &= low[:, one, axis] < high[:, two, axis]
        overlap &= low[:, two, axis] < high[:, one, axis]
    return overlap


def _topological(behind: NDArray[np.bool_], middle: FloatArray) -> NDArray[np.int64]:
    """Orders in which `behind[f, i, j]` puts i before j; a ring of limbs is cut at the one that is furthest away."""
    frames, count = middle.shape
    rows = np.arange(frames)
    waits = behind.sum(axis=1)
    order = np.empty((frames, count), dtype=np.int64)
    placed = np.zeros((frames, count), dtype=bool)
    span = float(middle.max()) * 2.0 + 1.0
    for position in range(count):
        # Free ones first, the furthest of them first; then those still waiting; those done never again.
        key = middle + span * (waits > 0) + 2.0 * span * placed
        chosen = np.argmin(key, axis=1)
        order[:, position] = chosen
        placed[rows, chosen] = True
        waits = waits - behind[rows, chosen]
    return order


def nearest_on_screen(one: FloatArray, two: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where two segments `(..., 2, 2)` come closest: the share along each, `(...)`, and the distance in pixels."""
    a, u = one[..., 0, :], one[..., 1, :] - one[..., 0, :]
    b, v = two[..., 0, :], two[..., 1, :] - two[..., 0, :]
    w = b - a
    cross = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    safe = np.where(np.abs(cross) > 1e-9, cross, 1.0)
    s = (w[..., 0] * v[..., 1] - w[..., 1] * v[..., 0]) / safe
    t = (w[..., 0] * u[..., 1] - w[..., 1] * u[..., 0]) / safe
    crossing = (np.abs(cross) > 1e-9) & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    best_s, best_t = np.where(crossing, s, 0.0), np.where(crossing, t, 0.0)
    best = np.where(crossing, 0.0, np.inf)
    uu, vv = _dot(u, u), _dot(v, v)
    for fixed in (0.0, 1.0):
        end = w + fixed * v
        share = np.clip(_dot(end, u) / np.maximum(uu, 1e-9), 0.0, 1.0)
        best_s, best_t, best = _closer(
            best_s, best_t, best, share, np.full_like(share, fixed), end - share[..., None] * u
        )
        end = fixed * u - w
        share = np.clip(_dot(end, v) / np.maximum(vv, 1e-9), 0.0, 1.0)
        best_s, best_t, best = _closer(
            best_s, best_t, best, np.full_like(share, fixed), share, end - share[..., None] * v
        )
    return best_s, best_t, np.sqrt(best)


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]
    return product


def _closer(
    best_s: FloatArray, best_t: FloatArray, best: FloatArray, s: FloatArray, t: FloatArray, apart: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    distance2 = _dot(apart, apart)
    better = distance2 < best
    return np.where(better, s, best_s), np.where(better, t, best_t), np.where(better, distance2, best)
