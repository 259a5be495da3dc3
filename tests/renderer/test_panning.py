"""A camera that stands still and turns by one slow path for all films of a group."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from renderer.camera import Camera, camera_path, project, project_film
from renderer.errors import RendererError
from renderer.figure import make_figure
from renderer.framing import frame_group
from renderer.offscreen import render_frames

SIZE = (320, 180)


def runner(frames: int = 150, metres: float = 16.0, start: int = 0) -> np.ndarray:
    """Pelvis, head, and two feet that swing, `(frames, 4, 3)`: standing up to `start`, then running along +Z."""
    way = np.clip((np.arange(frames) - start) / (frames - 1 - start), 0.0, None) * metres
    swing = 0.5 * np.sin(2 * np.pi * 1.4 * way / 4.0)
    clip = np.zeros((frames, 4, 3))
    clip[:, :, 1] = [0.95, 1.75, 0.05, 0.05]
    clip[:, 0:2, 1] += 0.04 * np.abs(np.sin(2 * np.pi * 1.4 * way / 4.0))[:, None]
    clip[:, :, 2] = way[:, None] + np.stack([0 * swing, 0 * swing, swing, -swing], axis=1)
    return clip


def drawn(clip: np.ndarray, camera: Camera, frames: slice = slice(None)) -> np.ndarray:
    """Which pixels differ from the background, `(frames, height, width)`."""
    figure = make_figure(np.array([[0, 1], [0, 2], [0, 3]]), ["centre", "centre", "left", "right"], {})
    shown = [frame[: camera.size[1]] for frame in render_frames(clip, figure, camera)][frames]
    return np.array([luma != luma[0, 0] for luma in shown])


@pytest.mark.parametrize("seed", range(20))
def test_nothing_of_a_group_leaves_the_frame(seed: int) -> None:
    random = np.random.default_rng(seed)
    walks = np.cumsum(random.normal(0, 0.05, (3, 90, 1, 3)) + random.normal(0, 0.05, (3, 1, 1, 3)), axis=1)
    group = [walk[: random.integers(1, 90)] + random.uniform(-1, 1, (1, 7, 3)) for walk in walks]
    padding = float(random.uniform(0, 0.3))
    camera = frame_group(group, camera="pan", size=SIZE, view=float(random.uniform(-3, 3)), padding_m=padding)
    for clip in group:
        pixels, nearness = project_film(camera, clip, 30.0)
        reach = (padding * camera.focal_pixels * nearness)[..., None]
        assert (pixels - reach >= 0).all()
        assert (pixels + reach <= SIZE).all()


@pytest.mark.parametrize("view", ["side", "three-quarter", "front"])
@pytest.mark.parametrize("start", [0, 60])
def test_a_runner_of_sixteen_metres_is_large_in_every_frame(view: str, start: int) -> None:
    """Pixels of the film are counted; a fixed camera is beside it."""
    clip = runner(start=start)
    rows = drawn(clip, frame_group([clip], camera="pan", size=SIZE, view=view)).any(axis=2)
    heights = rows.sum(axis=1) / SIZE[1]
    assert not rows[:, [0, -1]].any()
    assert heights.min() >= 0.40
    assert np.median(heights) >= 0.55
    still = drawn(clip, frame_group([clip], size=SIZE, view=view)).any(axis=2).sum(axis=1) / SIZE[1]
    assert np.median(still) < 0.45


def test_the_path_is_quadratic_in_the_seconds_since_the_film_began_whatever_the_frame_rate() -> None:
    clip = runner(frames=121)
    camera = frame_group([clip], camera="pan", size=SIZE, view="side", fps=30.0)
    assert camera.turns is not None
    yaw = np.arctan2(*np.moveaxis(camera_path(clip, camera, 30.0).axes[:, 2][:, [0, 2]], -1, 0))
    np.testing.assert_allclose(np.diff(np.unwrap(yaw), n=3), 0, atol=1e-12)
    assert np.ptp(yaw) > 0.2
    slower = camera_path(clip, camera, 60.0).axes
    np.testing.assert_allclose(slower[::2], camera_path(clip, camera, 30.0).axes[:61])


def test_films_that_begin_alike_look_alike_until_they_differ() -> None:
    one, other = runner(), runner(frames=170)
    other[:100] = one[:100]
    camera = frame_group([one, other], camera="pan", size=SIZE, view="side")
    assert (drawn(one, camera)[:100] == drawn(other, camera)[:100]).all()
    assert (drawn(one, camera)[110] != drawn(other, camera)[110]).any()


@pytest.mark.parametrize("frame", [0, 75])
def test_a_hop_moves_as_many_pixels_as_in_a_still_frame_of_the_same_scale(frame: int) -> None:
    """5 cm up in one frame, seen by a camera that was fitted to the film with the hop, so it could hide some of it."""
    smooth = runner()
    hop = smooth.copy()
    hop[frame, :, 1] += 0.05
    size = (480, 270)
    pans, pans_smooth = (frame_group([clip], camera="pan", size=size, view="side") for clip in (hop, smooth))
    still = replace(pans, turns=None, axes=camera_path(hop, pans, 30.0).axes[frame])

    def jump(clip: np.ndarray, camera: Camera) -> float:
        """Rows by which what is drawn leaps up in that frame, against the mean of the frames beside it."""
        beside = [at for at in (frame - 1, frame + 1) if 0 <= at < len(clip)]
        seen = drawn(clip, camera)
        rows = {at: np.average(np.arange(size[1]), weights=seen[at].sum(axis=1)) for at in (frame, *beside)}
        return float(np.mean([rows[at] for at in beside]) - rows[frame])

    in_still = jump(hop, still) - jump(smooth, still)
    in_pan = jump(hop, pans) - jump(smooth, replace(pans_smooth, focal_pixels=pans.focal_pixels))
    assert in_still > 4
    assert in_pan == pytest.approx(in_still, rel=0.03)


def test_a_hop_that_all_films_of_a_group_but_one_lack_is_not_followed() -> None:
    smooth, hop = runner(), runner()
    hop[75, :, 1] += 0.05
    camera = frame_group([smooth, hop], camera="pan", size=(1280, 720), view="side")
    (a, nearness), (b, _) = (project_film(camera, clip, 30.0) for clip in (smooth, hop))
    moved = (a - b)[75, :, 1]
    np.testing.assert_allclose(moved, 0.05 * camera.focal_pixels * nearness[75] * np.cos(camera.elevation), rtol=0.01)
    assert (np.delete(a, 75, axis=0) == np.delete(b, 75, axis=0)).all()


def test_a_figure_keeps_its_size_wherever_it_goes() -> None:
    clip = runner()
    camera = frame_group([clip], camera="pan", size=SIZE, view="side")
    _, nearness = project_film(camera, clip, 30.0)
    assert np.ptp(nearness[:, 0]) / nearness.mean() < 0.03


def test_a_figure_that_stays_is_not_turned_after() -> None:
    camera = frame_group([runner(metres=0.0)], camera="pan", size=SIZE, view="front", elevation=0.1)
    assert camera.turns is not None
    assert np.abs(camera.turns[:, 1:]).max() < 1e-3


def test_a_film_of_one_frame_is_framed_too() -> None:
    camera = frame_group([runner()[:1]], camera="pan", size=SIZE, view="side")
    pixels, _ = project_film(camera, runner()[:1], 30.0)
    assert np.abs(0.5 * (pixels[0].min(axis=0) + pixels[0].max(axis=0)) - np.array(SIZE) / 2).max() < 2


@pytest.mark.parametrize("kind", ["fixed", "pan", "track"])
def test_the_whole_figure_is_framed_by_its_capsules(puppet: Any, kind: str) -> None:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts, style="mannequin")
    clip = puppet.walk(30, speed=2.0)
    camera = frame_group([clip], figures=[figure], camera=kind, size=SIZE, view="front", fill=1.0)
    shown = np.array([frame[:180] != frame[0, 0] for frame in render_frames(clip, figure, camera)])
    rows = np.flatnonzero(shown.any(axis=(0, 2)))
    assert rows.min() <= 2
    assert rows.max() >= 177


@pytest.mark.parametrize("turns", [np.zeros(3), np.zeros((3, 3)), np.full((2, 3), np.nan)])
def test_turns_that_are_none(turns: np.ndarray) -> None:
    with pytest.raises(RendererError, match="turns as two rows of finite coefficients"):
        Camera(np.zeros(3), np.eye(3), 100.0, SIZE, turns=turns)


def test_an_unknown_camera_is_refused() -> None:
    with pytest.raises(RendererError, match="fixed, pan, track, got 'follow'"):
        frame_group([runner()], camera="follow")


def test_a_still_camera_projects_a_film_as_it_projects_points() -> None:
    clip = runner()
    camera = frame_group([clip])
    for one, other in zip(project_film(camera, clip, 30.0), project(camera, clip), strict=True):
        assert (one == other).all()
