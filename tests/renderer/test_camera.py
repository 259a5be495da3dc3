from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from renderer.camera import Camera, check_positions, check_size, project, smooth_path, view_axes
from renderer.errors import RendererError
from renderer.framing import find_heading, frame_group


def group_of(random: np.random.Generator) -> list[np.ndarray]:
    """Clips of any size and place: a crowd of points in a box somewhere."""
    middle = random.uniform(-20, 20, 3)
    extent = 10.0 ** random.uniform(-1, 1.3, 3)
    return [
        middle + random.uniform(-0.5, 0.5, (int(random.integers(1, 30)), int(random.integers(1, 25)), 3)) * extent
        for _ in range(int(random.integers(1, 5)))
    ]


@pytest.mark.parametrize("seed", range(60))
def test_nothing_of_a_group_ever_leaves_the_frame(seed: int) -> None:
    random = np.random.default_rng(seed)
    group = group_of(random)
    size = [(640, 480), (1280, 720), (480, 640), (64, 512)][seed % 4]
    view = ["front", "side", "three-quarter", float(random.uniform(-3, 3))][seed % 4]
    fill, padding = float(random.uniform(0.3, 1.0)), float(random.uniform(0.0, 0.4))
    camera = frame_group(
        group, size=size, view=view, fill=fill, padding_m=padding, elevation=float(random.uniform(-0.3, 1.2))
    )
    for clip in group:
        pixels, nearness = project(camera, clip)
        # A ball around every point; its outline in perspective is a little wider than its radius.
        reach = padding * camera.focal_pixels * nearness
        margin = (1.0 - fill) * 0.5 * np.array(size)
        assert (pixels - reach[..., None] >= margin - 1e-6).all()
        assert (pixels + reach[..., None] <= np.array(size) - margin + 1e-6).all()
        assert (1.0 / nearness >= 0.5).all()


@pytest.mark.parametrize("fill", [0.5, 0.86, 1.0])
@pytest.mark.parametrize("size", [(640, 480), (480, 640)])
def test_the_padding_is_a_distance_to_the_edge_of_what_is_seen(fill: float, size: tuple[int, int]) -> None:
    """In space: a ball of that radius around the outermost point just touches the plane through the eye and the edge.

    The bounds of pixels alone do not tell: a ball seen aslant reaches further than its radius.
    """
    rows = np.random.default_rng(4).uniform(-1, 1, (5, 20, 3)) * [3.0, 3.0, 1.0]
    camera = frame_group([rows], size=size, view=0.0, elevation=0.0, fill=fill, padding_m=0.3, field_of_view=1.2)
    seen = (rows.reshape(-1, 3) - camera.eye) @ camera.axes.T
    angles = [np.arctan(fill * 0.5 * size[axis] / camera.focal_pixels) for axis in (0, 1)]
    distances = [
        np.min(-seen[:, 2] * np.sin(angle) - side * seen[:, axis] * np.cos(angle))
        for axis, angle in enumerate(angles)
        for side in (-1.0, 1.0)
    ]
    assert min(distances) == pytest.approx(0.3, abs=1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_the_group_fills_the_stated_share(seed: int) -> None:
    random = np.random.default_rng(seed)
    group = [clip * 1.0 for clip in group_of(random)]
    camera = frame_group(group, size=(640, 480), fill=0.8, padding_m=0.0)
    pixels = np.concatenate([project(camera, clip)[0].reshape(-1, 2) for clip in group])
    share = np.ptp(pixels, axis=0) / [640, 480]
    extent = np.ptp(np.concatenate([clip.reshape(-1, 3) for clip in group]), axis=0).max()
    if extent > 0.5:  # a smaller group would be closer than half a metre to the eye
        assert share.max() == pytest.approx(0.8, abs=1e-9)
    assert share.max() <= 0.8 + 1e-9


def test_named_views_see_a_walker_as_they_are_called() -> None:
    walker = np.zeros((30, 2, 3))
    walker[:, :, 2] = np.linspace(0, 3, 30)[:, None]
    walker[:, 1, 1] = 1.7
    front, near = project(frame_group([walker], view="front"), walker)
    assert np.ptp(front[:, 0, 0]) == pytest.approx(0, abs=1e-9)
    assert (np.diff(near[:, 0]) > 0).all(), "towards the camera"
    side, near = project(frame_group([walker], view="side"), walker)
    assert (np.diff(side[:, 0, 0]) > 0).all(), "from left to right"
    assert np.ptp(near[:, 0]) / near.mean() < 1e-6
    half, near = project(frame_group([walker], view="three-quarter"), walker)
    assert (np.diff(half[:, 0, 0]) > 0).all()
    assert (np.diff(near[:, 0]) > 0).all()
    assert (half[:, 1, 1] < half[:, 0, 1]).all(), "y grows downwards"


@pytest.mark.parametrize("turn", [0.0, 1.0, -2.5])
def test_the_view_turns_with_the_way_the_group_travels(turn: float) -> None:
    walker = np.zeros((30, 3, 3))
    walker[:, :, 2] = np.linspace(0, 3, 30)[:, None]
    walker[:, 1] += [0.2, 1.7, 0.1]
    walker[:, 2] += [-0.3, 0.9, 0]
    sin, cos = np.sin(turn), np.cos(turn)
    turned = np.stack(
        [walker[..., 0] * cos + walker[..., 2] * sin, walker[..., 1], walker[..., 2] * cos - walker[..., 0] * sin],
        axis=-1,
    )
    assert find_heading([turned]) == pytest.approx(turn)
    one, _ = project(frame_group([walker], view="side"), walker)
    other, _ = project(frame_group([turned], view="side"), turned)
    np.testing.assert_allclose(one, other, atol=1e-6)


def test_standing_has_no_heading() -> None:
    assert find_heading([np.random.default_rng(0).normal(0, 0.01, (20, 4, 3))]) == 0.0


def test_projection_by_hand() -> None:
    camera = Camera(np.array([0.0, 1.0, 5.0]), view_axes(0.0, 0.0), 200.0, (640, 480))
    pixels, nearness = project(camera, np.array([[0.0, 1.0, 0.0], [1.0, 2.0, 0.0], [-0.5, 0.0, 2.5]]))
    np.testing.assert_allclose(pixels, [[320, 240], [360, 200], [280, 320]])
    np.testing.assert_allclose(nearness, [0.2, 0.2, 0.4])


def test_a_tracking_camera_keeps_a_runner_in_the_middle() -> None:
    runner = np.zeros((90, 2, 3))
    runner[:, :, 2] = np.linspace(0, 9, 90)[:, None]
    runner[:, :, 0] = 0.05 * np.sin(np.arange(90) / 3)[:, None]
    runner[:, 1, 1] = 1.7
    path = smooth_path(runner, 0.4, 30.0)
    assert path[0].tolist() == [0, 0, 0]
    np.testing.assert_allclose(path[:, 2], runner[:, 0, 2], atol=0.02)
    assert np.ptp(path[:, 0]) < 0.5 * np.ptp(runner[:, 0, 0]), "sway is not followed"
    still = frame_group([runner], view="side")
    tracking = frame_group([runner], view="side", camera="track", track_seconds=0.4)
    seen, _ = project(tracking, runner - path[:, None])
    assert ((seen > 0) & (seen < [640, 480])).all()
    tall = [float(np.ptp(project(c, runner[:1])[0][0, :, 1])) for c in (still, tracking)]
    assert tall[1] > 2 * tall[0]


def test_projection_does_not_depend_on_the_batch() -> None:
    points = np.random.default_rng(1).normal(0, 1, (50, 20, 3))
    camera = frame_group([points])
    whole, near = project(camera, points)
    for i in (0, 7, 49):
        one, one_near = project(camera, points[i : i + 1])
        assert (one[0] == whole[i]).all()
        assert (one_near[0] == near[i]).all()


@pytest.mark.parametrize(
    ("size", "match"),
    [
        ((0, 480), "even whole numbers from 16"),
        ((641, 480), r"got \(641, 480\)"),
        ((640, -2), "even whole numbers"),
        ((640.5, 480), "even whole numbers"),
        ((9000, 480), "to 8192"),
        ((640,), "width, height"),
        (None, "width, height"),
    ],
)
def test_frame_sizes_that_cannot_be_encoded(size: Any, match: str) -> None:
    with pytest.raises(RendererError, match=match):
        check_size(size)


@pytest.mark.parametrize(
    ("positions", "match"),
    [
        (np.zeros((0, 5, 3)), r"at least one frame and one point, got \(0, 5, 3\)"),
        (np.zeros((5, 3)), r"got \(5, 3\)"),
        (np.zeros((4, 5, 2)), r"got \(4, 5, 2\)"),
        ([["a"]], "numbers"),
        (np.full((2, 3, 3), np.inf), "frame 0, point 0"),
    ],
)
def test_positions_that_cannot_be_drawn(positions: Any, match: str) -> None:
    with pytest.raises(RendererError, match=match):
        check_positions(positions)


def test_a_nan_is_found_and_named() -> None:
    positions = np.zeros((9, 4, 3))
    positions[6, 2, 1] = np.nan
    with pytest.raises(RendererError, match="frame 6, point 2; mend or drop"):
        frame_group([positions])


@pytest.mark.parametrize(
    ("settings", "match"),
    [
        ({"fill": 0.0}, "fill share"),
        ({"fill": 1.5}, "fill share"),
        ({"view": "behind"}, "front, side, three-quarter.*'behind'"),
        ({"view": float("nan")}, "finite angle"),
        ({"field_of_view": 4.0}, "field of view"),
        ({"camera": "track", "track_seconds": -1.0}, "tracking time"),
    ],
)
def test_settings_that_make_no_camera(settings: Any, match: str) -> None:
    with pytest.raises(RendererError, match=match):
        frame_group([np.zeros((2, 2, 3))], **settings)


def test_no_clips_make_no_camera() -> None:
    with pytest.raises(RendererError, match="at least one clip"):
        frame_group([])
