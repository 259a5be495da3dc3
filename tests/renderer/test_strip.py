from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from PIL import Image

from renderer.colour import to_ycbcr
from renderer.errors import RendererError
from renderer.figure import make_figure
from renderer.segments import SEGMENT_COLOURS, Segment
from renderer.strip import render_strip

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("context")]

SEGMENTS = (Segment("source", 0, 16), Segment("blend", 16, 24), Segment("destination", 24, 40))


@pytest.fixture
def scene(puppet: Any) -> tuple[np.ndarray, Any]:
    return puppet.walk(40), make_figure(puppet.bones, puppet.sides, puppet.parts)


def figures_in(picture: np.ndarray) -> int:
    """Runs of columns with something on them."""
    drawn = (picture != picture[0, 0]).any(axis=(0, 2)).astype(int)
    return int((np.diff(np.concatenate([[0], drawn])) == 1).sum())


def draw_strip(*scene: Any, **how: Any) -> np.ndarray:
    """The picture of a strip, RGB `(height, width, 3)`."""
    with TemporaryDirectory() as folder, Image.open(render_strip(Path(folder) / "strip.png", *scene, **how)) as picture:
        return np.asarray(picture)


def near(picture: np.ndarray, colour: tuple[int, int, int]) -> np.ndarray:
    """Where a picture has the hue of a colour, in whatever light."""
    _, blue, red = to_ycbcr(colour)
    pixels = picture.astype(float) / 255
    luma = pixels @ [0.2126, 0.7152, 0.0722]
    found_blue, found_red = (pixels[..., 2] - luma) / 1.8556 * 224, (pixels[..., 0] - luma) / 1.5748 * 224
    distance = np.hypot(found_blue - (blue - 128), found_red - (red - 128))
    return np.asarray((distance < 12) & (np.hypot(found_blue, found_red) > 15))


def test_a_row_shows_as_many_poses_as_asked(scene: Any) -> None:
    for count in (1, 3, 7):
        picture = draw_strip(*scene, count=count, height=200)
        assert picture.shape[0] == 200
        assert figures_in(picture) == count


def test_poses_are_evenly_spaced_or_those_asked_for(scene: Any) -> None:
    clip, figure = scene
    even = draw_strip(clip, figure, count=3, height=200)
    asked = draw_strip(clip, figure, frames=[0, 20, 39], height=200)
    assert (even == asked).all()
    assert figures_in(draw_strip(clip[:2], figure, count=9, height=200)) == 2


def test_segments_have_their_own_colours_in_a_row(scene: Any) -> None:
    clip, figure = scene
    picture = draw_strip(clip, figure, frames=[4, 20, 36], segments=SEGMENTS, height=240)
    thirds = np.array_split(picture, 3, axis=1)
    for i, name in enumerate(SEGMENT_COLOURS):
        counts = [int(near(third, SEGMENT_COLOURS[name]).sum()) for third in thirds]
        assert counts[i] > 200, (name, counts)
        assert sum(counts) - counts[i] < 0.1 * counts[i], (name, counts)


def test_the_file_is_a_png_and_whole(scene: Any, tmp_path: Path) -> None:
    path = render_strip(tmp_path / "new" / "strip.png", *scene, count=4, segments=SEGMENTS, height=160)
    with Image.open(path) as picture:
        assert picture.format == "PNG"
        assert picture.height == 160
    assert [p.name for p in path.parent.iterdir()] == ["strip.png"]


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"height": 31}, "even height"),
        ({"count": 0}, "at least one pose"),
        ({"frames": [40]}, "frames from 0 to 39"),
        ({"frames": []}, "frames from 0 to 39"),
        ({"segments": [Segment("middle", 0, 40)]}, "source, blend, destination, or one with a colour; got 'middle'"),
    ],
)
def test_what_makes_no_strip(scene: Any, change: dict[str, Any], match: str) -> None:
    with pytest.raises(RendererError, match=match):
        draw_strip(*scene, **change)


def test_strips_are_png(scene: Any, tmp_path: Path) -> None:
    with pytest.raises(RendererError, match=r"end in \.png"):
        render_strip(tmp_path / "strip.jpg", *scene)
