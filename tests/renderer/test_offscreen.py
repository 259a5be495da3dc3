"""Pixels: tiny exact pictures of each primitive, limbs that can't be lost, and the same bytes whatever the batch."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from renderer.camera import Camera, project, view_axes
from renderer.capsules import Figure, kept_capsules, place
from renderer.colour import nv12_to_rgb, to_ycbcr
from renderer.context import open_context
from renderer.digest import hash_frames
from renderer.errors import RendererError
from renderer.figure import STYLES, make_figure
from renderer.framing import frame_group
from renderer.offscreen import plain_frame, render_frames, render_rgb
from renderer.shapes import lay_out

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("context")]

SIZE = (32, 24)
# One metre is ten pixels; the origin is the middle of the frame.
CAMERA = Camera(np.array([0.0, 0.0, 10.0]), view_axes(0.0, 0.0), 100.0, SIZE)
WHITE, BLACK = (255, 255, 255), (0, 0, 0)


def capsules(
    radii: list[tuple[float, float]], colours: list[tuple[int, int, int]], *, lit: bool = False, **more: Any
) -> Figure:
    """Capsules on points 0-1, 2-3, ... with exact radii, on white."""
    count = len(radii)
    ends = np.arange(2 * count).reshape(count, 2)
    along, beyond = np.tile([0.0, 1.0], (count, 1)), np.zeros((count, 2))
    return Figure("test", 2 * count, ends, along, beyond, np.array(radii), np.array(colours), WHITE, lit, **more)


def points(*ends: tuple[float, float, float]) -> np.ndarray:
    return np.array(ends)[None]


def drawn(pose: np.ndarray, figure: Figure) -> np.ndarray:
    return next(render_frames(pose, figure, CAMERA))


def cover_by_hand(start: tuple[float, float], end: tuple[float, float], radius: float, samples: int = 16) -> np.ndarray:
    """The share of every pixel that lies within a capsule, by counting points in it: another way than the shader's."""
    width, height = SIZE
    fine = (np.arange(width * samples) + 0.5) / samples, (np.arange(height * samples) + 0.5) / samples
    x, y = np.meshgrid(*fine)
    a, way = np.array(start), np.subtract(end, start)
    share = ((x - a[0]) * way[0] + (y - a[1]) * way[1]) / max(float(way @ way), 1e-12)
    share = np.clip(share, 0, 1) if way.any() else np.zeros_like(x)
    inside = np.hypot(x - a[0] - share * way[0], y - a[1] - share * way[1]) <= radius
    return np.asarray(inside.reshape(height, samples, width, samples).mean(axis=(1, 3)))


@pytest.mark.parametrize(
    ("start", "end", "radius"),
    [
        ((0.0, 0.0), (0.0, 0.0), 0.5),
        ((0.13, -0.21), (0.13, -0.21), 0.33),
        ((-0.8, 0.0), (0.8, 0.0), 0.4),
        ((-0.9, -0.5), (0.7, 0.6), 0.3),
        ((0.3, -0.8), (0.3, 0.8), 0.15),
    ],
)
def test_a_capsule_covers_what_geometry_says(
    start: tuple[float, float], end: tuple[float, float], radius: float
) -> None:
    frame = drawn(points((*start, 0.0), (*end, 0.0)), capsules([(radius, radius)], [BLACK]))
    luma = frame[: SIZE[1]].astype(float)
    by_hand = cover_by_hand((16 + 10 * start[0], 12 - 10 * start[1]), (16 + 10 * end[0], 12 - 10 * end[1]), 10 * radius)
    covered = (235.0 - luma) / 219.0
    # On the edge a ramp one pixel wide stands for the area that is covered; it ends a tenth of a pixel off at most.
    assert covered[by_hand == 1.0].min() > 0.90
    assert covered[by_hand == 0.0].max() < 0.10
    assert np.abs(covered - by_hand).max() < 0.15
    assert abs(covered.sum() - by_hand.sum()) < 0.02 * by_hand.sum() + 0.5


PRIMITIVES = {
    "disc": (points((0.1, 0.1, 0), (0.1, 0.1, 0)), capsules([(0.6, 0.6)], [(20, 60, 120)])),
    "capsule": (points((-0.8, -0.4, 0), (0.9, 0.5, 0)), capsules([(0.3, 0.3)], [(200, 90, 20)])),
    "tapered": (points((-0.9, 0.0, 0), (0.9, 0.2, 0)), capsules([(0.5, 0.2)], [(0, 98, 168)])),
    "lit": (
        points((-0.7, -0.6, 0), (0.6, 0.5, 0)),
        capsules([(0.4, 0.4)], [(150, 150, 150)], lit=True, rounded=np.array([[False, True]])),
    ),
    "round": (
        points((0.0, -0.1, 0), (0.0, 0.2, 0)),
        capsules([(0.7, 0.8)], [(90, 90, 100)], lit=True, rounded=np.array([[True, True]])),
    ),
    "crossing": (
        points((-1, -0.7, 0.3), (1, 0.7, 0.3), (-1, 0.7, 0), (1, -0.7, 0)),
        capsules([(0.2, 0.2), (0.2, 0.2)], [(230, 152, 40), (0, 98, 168)]),
    ),
}


@pytest.mark.parametrize("name", PRIMITIVES)
def test_each_primitive_is_drawn_byte_by_byte_as_before(same_picture: Any, name: str) -> None:
    pose, figure = PRIMITIVES[name]
    same_picture(name, drawn(pose, figure))


def test_a_shadow_is_drawn_byte_by_byte_as_before(same_picture: Any) -> None:
    figure = replace(capsules([(0.15, 0.15)], [BLACK]), floor_m=-0.6)
    camera = Camera(np.array([0.0, 3.0, 9.0]), view_axes(0.0, 0.33), 100.0, SIZE)
    same_picture("shadow", next(render_frames(points((0, -0.4, 0), (0, 0.6, 0)), figure, camera)))


def test_the_background_is_exactly_the_asked_colour() -> None:
    for colour in ((222, 223, 225), (10, 200, 30), (24, 25, 28)):
        figure = replace(capsules([(0.2, 0.2)], [BLACK]), background=colour)
        frame = drawn(points((0, 0, 0), (0.1, 0, 0)), figure)
        luma, blue, red = (round(v) for v in to_ycbcr(colour))
        assert frame[0, 0] == luma
        assert frame[SIZE[1], :2].tolist() == [blue, red]
        assert (frame[0] == luma).all()
        assert np.abs(nv12_to_rgb(frame)[0, 0].astype(int) - colour).max() <= 1


def test_the_limb_in_front_hides_the_one_behind() -> None:
    pose, figure = PRIMITIVES["crossing"]
    middle = (SIZE[1] // 2, SIZE[0] // 2)
    near, far = (drawn(p, figure)[: SIZE[1]][middle] for p in (pose, pose * [1, 1, -1]))
    assert near == round(to_ycbcr((230, 152, 40))[0])
    assert far == round(to_ycbcr((0, 98, 168))[0])


def test_half_size_chroma_stands_left_of_the_middle_of_two_pixels() -> None:
    # A coloured half plane whose edge runs through the middle of column 16: luma has half of it there. The chroma
    # sample of columns 16 and 17 lies on column 16, so it has half as well; midway it would have three quarters.
    figure = capsules([(2.0, 2.0)], [(255, 0, 0)])
    frame = drawn(points((2.05, -9.0, 0), (2.05, 9.0, 0)), figure)
    red = (frame[SIZE[1] + 6, 1::2].astype(float) - 128) / 112
    luma = (235 - frame[12].astype(float)) / (235 - round(to_ycbcr((255, 0, 0))[0]))
    assert luma[16] == pytest.approx(0.5, abs=0.02)
    assert red[8] == pytest.approx(0.5, abs=0.03)
    assert red[9] == pytest.approx(1.0, abs=0.02)
    assert red[7] == pytest.approx(0.0, abs=0.02)


# ---- whole figures ----------------------------------------------------------------------------------------------


def puppet_scene(
    puppet: Any, style: str = "stick", frames: int = 30, **camera: Any
) -> tuple[np.ndarray, Figure, Camera]:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts, style=style)
    clip = puppet.walk(frames)
    return clip, figure, frame_group([clip], **{"size": (320, 240), **camera})


@pytest.mark.parametrize("style", ["stick", "mannequin"])
def test_every_limb_shows_its_colour_where_it_is(puppet: Any, style: str) -> None:
    # Seen obliquely no limb hides another one all along.
    clip, figure, camera = puppet_scene(puppet, style, frames=24)
    ends, _ = project(camera, place(figure, clip))
    seen = np.zeros(len(figure.ends), dtype=bool)
    for frame, picture in enumerate(render_rgb(clip, figure, camera)):
        for i in range(len(figure.ends)):
            for share in (0.3, 0.5, 0.7):
                x, y = (ends[frame, i, 0] + share * (ends[frame, i, 1] - ends[frame, i, 0])).astype(int)
                asked, found = (np.array(to_ycbcr(c.tolist())) for c in (figure.colours[i], picture[y, x]))
                seen[i] |= bool(np.abs(asked[1:] - found[1:]).max() < 6 and abs(asked[0] / found[0] - 1) < 0.35)
    for i in np.flatnonzero(~seen).tolist():
        # A sleeve or a leg of the shorts may cover where a limb begins, which goes on below.
        covers = (figure.part == figure.part[i]) & (figure.ends[:, 0] == figure.ends[i, 0]) & seen
        assert (figure.colours[covers] != figure.colours[i]).any(), f"never seen: {figure.ends[i].tolist()}"


def test_a_lost_leg_is_found_by_its_foreground(puppet: Any, compare_foreground: Any) -> None:
    clip, figure, camera = puppet_scene(puppet, frames=1)
    whole = next(render_rgb(clip, figure, camera))
    again = next(render_rgb(clip.copy(), figure, camera))
    assert compare_foreground(whole, again, figure.background) == 0.0
    lost = [puppet.parts[f"{name}.R"] for name in ("knee", "ankle", "toe")]
    keep = ~np.isin(figure.ends[:, 1], lost)
    other = next(render_rgb(clip, kept_capsules(figure, keep), camera))
    assert compare_foreground(whole, other, figure.background) > 0.10
    whole_picture = (np.abs(whole.astype(int) - other) > 12).any(axis=-1).mean()
    assert whole_picture < 0.02, "which a comparison of the whole picture would hardly notice"


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("view", ["front", "side", "three-quarter"])
def test_no_figure_touches_the_edge_of_the_frame(puppet: Any, style: str, view: str) -> None:
    clip, figure, camera = puppet_scene(puppet, style, frames=40, view=view, fill=0.9)
    width, height = camera.size
    extent = []
    for picture in render_rgb(clip[::4], figure, camera):
        drawn_on = (picture != figure.background).any(axis=-1)
        rows, columns = np.flatnonzero(drawn_on.any(axis=1)), np.flatnonzero(drawn_on.any(axis=0))
        extent.append((columns[0], rows[0], columns[-1], rows[-1]))
    left, top, _, _ = np.min(extent, axis=0)
    _, _, right, bottom = np.max(extent, axis=0)
    assert left >= 0.04 * width
    assert right < 0.96 * width
    assert top >= 0.04 * height
    assert bottom < 0.96 * height
    share = max((right - left) / width, (bottom - top) / height)
    assert 0.65 < share <= 0.9


@pytest.mark.parametrize("style", STYLES)
def test_frames_do_not_depend_on_the_batch(puppet: Any, style: str) -> None:
    clip, figure, camera = puppet_scene(puppet, style, frames=23)
    expected = [frame.tobytes() for frame in render_frames(clip, figure, camera, batch=16)]
    assert len(set(expected)) == 23
    for batch in (1, 2, 7, 64):
        assert [frame.tobytes() for frame in render_frames(clip, figure, camera, batch=batch)] == expected
    alone = [next(render_frames(clip[i : i + 1], figure, camera)).tobytes() for i in (0, 9, 22)]
    assert alone == [expected[i] for i in (0, 9, 22)]


def test_another_context_in_between_does_no_harm(puppet: Any) -> None:
    clip, figure, camera = puppet_scene(puppet, frames=12)
    expected = hash_frames(render_frames(clip, figure, camera), camera.size)
    frames, stills = render_frames(clip, figure, camera, batch=3), render_rgb(clip, figure, camera)
    seen = []
    for _ in range(12):
        seen.append(next(frames))
        first = next(stills)
        other = open_context()
        other.gl.clear()
        other.release()
    assert hash_frames(seen, camera.size) == expected
    assert (first == list(render_rgb(clip, figure, camera))[-1]).all()


def test_threads_draw_side_by_side(puppet: Any) -> None:
    clip, figure, camera = puppet_scene(puppet, frames=12)
    alone = hash_frames(render_frames(clip, figure, camera), camera.size)
    with ThreadPoolExecutor(2) as pool:
        both = list(
            pool.map(lambda _: hash_frames(render_frames(clip, figure, camera, batch=3), camera.size), range(4))
        )
    assert both == [alone] * 4
    assert hash_frames(render_frames(clip, figure, camera), camera.size) == alone


def test_a_figure_that_leaves_the_frame_is_cut_there_and_spoils_nothing(puppet: Any) -> None:
    clip, figure, camera = puppet_scene(puppet, frames=24)
    close = replace(camera, focal_pixels=4.0 * camera.focal_pixels)
    shapes = lay_out(clip, figure, close)
    assert (shapes.boxes[:, 0] < 0).any()
    whole = [frame.tobytes() for frame in render_frames(clip, figure, close, batch=8)]
    alone = [next(render_frames(clip[i : i + 1], figure, close)).tobytes() for i in range(24)]
    assert whole == alone
    away = clip + np.array([0, 50, 0])
    for frame in render_frames(away, figure, camera):
        assert (frame == plain_frame(camera.size, figure.background)).all()


def test_stills_and_video_frames_look_alike(puppet: Any) -> None:
    clip, figure, camera = puppet_scene(puppet, frames=2)
    for still, frame in zip(render_rgb(clip, figure, camera), render_frames(clip, figure, camera), strict=True):
        difference = np.abs(still.astype(int) - nv12_to_rgb(frame))
        # Inside and outside the same; along edges the half-size chroma differs.
        assert (difference.max(axis=-1) > 6).mean() < 0.03
        background = (still == still[0, 0]).all(axis=-1)
        assert difference[background].max(axis=-1).mean() < 2.0


def test_a_tracking_camera_follows(puppet: Any) -> None:
    clip, figure, camera = puppet_scene(puppet, frames=30, view="side", camera="track", track_seconds=0.5)
    middles = []
    for frame in render_frames(clip, figure, camera):
        columns = np.flatnonzero((frame[:240] != frame[0, 0]).any(axis=0))
        middles.append(columns.mean())
    assert np.ptp(middles) < 30


def test_a_floor_darkens_under_the_feet_and_stands_still(puppet: Any) -> None:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts, floor_m=0.0)
    clip = puppet.walk(12)
    camera = frame_group([clip], size=(320, 240))
    frames = list(render_frames(clip, figure, camera))
    without = list(render_frames(clip, replace(figure, floor_m=None), camera))
    pixels, _ = project(camera, np.array([[clip[0, 0, 0] - 0.2, 0.0, clip[0, 0, 2] - 0.15]]))
    x, y = pixels[0].astype(int)
    assert int(frames[0][y, x]) < int(without[0][y, x]) - 25
    assert (frames[0][:8, :40] == frames[-1][:8, :40]).all()
    moved = frames[0][:240].astype(int) != frames[-1][:240]
    assert moved.mean() < 0.15
    assert hash_frames(frames, camera.size) == hash_frames(
        list(render_frames(clip, figure, camera, batch=5)), camera.size
    )


def test_a_floor_travels_under_a_tracking_camera(puppet: Any) -> None:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts, floor_m=0.0)
    clip = puppet.walk(6, speed=3.0)
    camera = frame_group([clip], size=(160, 120), view="side", camera="track", track_seconds=0.4)
    frames = list(render_frames(clip, figure, camera))
    assert (frames[0][100:120, :30] != frames[5][100:120, :30]).any()
    alone = list(render_frames(clip, figure, camera, batch=1))
    assert all((a == b).all() for a, b in zip(frames, alone, strict=True))


def test_a_batch_without_frames_is_refused() -> None:
    with pytest.raises(RendererError, match="batch of at least one"):
        next(render_frames(points((0, 0, 0), (1, 0, 0)), capsules([(0.1, 0.1)], [BLACK]), CAMERA, batch=0))


def test_bad_positions_are_refused_before_anything_is_drawn() -> None:
    figure = capsules([(0.1, 0.1)], [BLACK])
    with pytest.raises(RendererError, match="frame 0, point 1"):
        next(render_frames(points((0, 0, 0), (np.nan, 0, 0)), figure, CAMERA))
    with pytest.raises(RendererError, match="at least one frame"):
        next(render_frames(np.zeros((0, 2, 3)), figure, CAMERA))


@pytest.mark.parametrize("size", [(320, 180), (160, 160)])
def test_a_floor_has_no_edge_on_a_larger_page(size: tuple[int, int]) -> None:
    """Its outermost pixels are the background's, so that the picture ends nowhere; it is darker below the figure."""
    figure = replace(capsules([(0.1, 0.1)], [BLACK]), floor_m=-0.6)
    camera = Camera(np.array([0.0, 1.5, 9.0]), view_axes(0.0, 0.16), 3.0 * size[1], size)
    luma = next(render_frames(points((0, 0.2, 0), (0, 0.5, 0)), figure, camera))[: size[1]].astype(int)
    ground = round(to_ycbcr(figure.background)[0])
    edges = (luma[0], luma[-1], luma[:, 0], luma[:, -1])
    assert max(np.abs(edge - ground).max() for edge in edges) <= 1
    assert ground - np.median(luma[int(0.8 * size[1]), size[0] // 2 - 20 : size[0] // 2 + 20]) > 10
    steps = np.abs(np.diff(luma[int(0.8 * size[1])], axis=0))
    assert steps[: size[0] // 4].max() <= 8
