from __future__ import annotations

import ctypes.util
import importlib.metadata
import os
import subprocess
import sys
from pathlib import Path

import pytest
from parts import unavailable

from renderer import context as contexts
from renderer.errors import RendererError

ROOT = Path(__file__).parents[2]

DRAW = """
import numpy as np
from renderer.context import open_context, shared_context
from renderer.framing import frame_group
from renderer.figure import make_figure
from renderer.offscreen import render_frames, render_rgb
from renderer.digest import hash_frames
import hashlib
# A tangle of bones in every direction, so that every kind of edge and overlap is in the pictures.
random = np.random.default_rng(5)
positions = np.cumsum(random.normal(0, 0.02, (6, 12, 3)), axis=0) + random.uniform(-0.6, 0.6, (12, 3))
figure = make_figure(np.array([[i, i + 1] for i in range(11)]), ["left", "right", "centre"] * 4, floor_m=-0.7)
camera = frame_group([positions], size=(192, 144))
print(shared_context().kind, hash_frames(render_frames(positions, figure, camera), camera.size),
      hashlib.sha256(np.stack(list(render_rgb(positions, figure, camera)))).hexdigest())
"""


def available(kind: str) -> bool:
    if kind == "osmesa":
        return ctypes.util.find_library("OSMesa") is not None
    if kind == "osmesa-wheel":
        try:
            return bool(importlib.metadata.files("lavavu-osmesa"))
        except importlib.metadata.PackageNotFoundError:
            return False
    return ctypes.util.find_library("EGL") is not None


def require(kind: str) -> None:
    if not available(kind):
        how = {"osmesa": "libosmesa6 (Mesa before 25.1)", "osmesa-wheel": "pip install lavavu-osmesa"}.get(
            kind, "libegl1"
        )
        unavailable(f"the context {kind}", how, package="libosmesa6" if kind == "osmesa" else None)


def draw_in_process(**environment: str) -> list[str]:
    clean = {k: v for k, v in os.environ.items() if k not in ("SEGUE_GL", "LP_NUM_THREADS")}
    done = subprocess.run(
        [sys.executable, "-c", DRAW],
        cwd=ROOT,
        check=False,
        env={**clean, **environment},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.mark.gl
@pytest.mark.parametrize("kind", contexts.KINDS)
def test_each_context_opens_and_clears(kind: str) -> None:
    require(kind)
    context = contexts.open_context(kind)
    try:
        assert context.kind == kind
        assert context.gl.version_code >= 330
        assert context.version
        assert context.renderer
        target = context.gl.framebuffer([context.gl.texture((4, 4), 1)])
        target.clear(0.2)
        assert set(target.read(components=1, alignment=1)) == {51}
    finally:
        context.release()


@pytest.mark.gl
def test_the_same_pixels_from_every_context_and_thread_count() -> None:
    kinds = [kind for kind in contexts.KINDS if available(kind)]
    if not kinds:
        require("egl")
    pictures = {kind: draw_in_process(SEGUE_GL=kind) for kind in kinds}
    assert all(picture[0] == kind for kind, picture in pictures.items())
    software = {kind: picture[1:] for kind, picture in pictures.items()}
    assert len({tuple(picture) for picture in software.values()}) == 1, software
    assert draw_in_process(SEGUE_GL=kinds[0], LP_NUM_THREADS="3")[1:] == pictures[kinds[0]][1:]


@pytest.mark.gl
def test_the_wheel_serves_where_the_system_has_no_gl(tmp_path: Path) -> None:
    require("osmesa-wheel")
    # Libraries that the loader finds first and can't read stand for libraries that are not there.
    for name in ("libGL.so", "libGL.so.1", "libEGL.so", "libEGL.so.1", "libOSMesa.so", "libOSMesa.so.8"):
        (tmp_path / name).touch()
    assert draw_in_process(LD_LIBRARY_PATH=str(tmp_path))[0] == "osmesa-wheel"


def test_without_any_context_the_error_names_the_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(kind: str) -> None:
        raise OSError(f"no {kind} here")

    monkeypatch.setattr(contexts, "_open", fail)
    monkeypatch.delenv("SEGUE_GL", raising=False)
    with pytest.raises(RendererError, match=r"libegl1 and libgl1.*lavavu-osmesa.*no egl here.*no osmesa-wheel here"):
        contexts.open_context()


def test_contexts_are_tried_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    tried = []

    def fail(kind: str) -> None:
        tried.append(kind)
        raise OSError

    monkeypatch.setattr(contexts, "_open", fail)
    monkeypatch.delenv("SEGUE_GL", raising=False)
    with pytest.raises(RendererError):
        contexts.open_context()
    assert tried == ["egl", "egl-only", "osmesa", "osmesa-wheel"]
    tried.clear()
    monkeypatch.setenv("SEGUE_GL", "osmesa")
    with pytest.raises(RendererError):
        contexts.open_context()
    assert tried == ["osmesa"]


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(RendererError, match=r"Expected a context of kind egl, .*got 'vulkan'"):
        contexts.open_context("vulkan")


def test_the_wheel_that_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(contexts.metadata, "files", missing)
    with pytest.raises(RendererError, match="lavavu-osmesa is not installed"):
        contexts.open_context("osmesa-wheel")


@pytest.mark.gl
def test_describe_says_what_draws_and_what_encodes() -> None:
    found = contexts.describe()
    assert found["kind"] in contexts.KINDS
    assert found["gl_version"]
    assert found["gl_renderer"]
    assert found["h264"].startswith("libx264")


def test_describe_without_gl_gives_advice_and_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(kind: str) -> None:
        raise OSError(f"no {kind}")

    monkeypatch.setattr(contexts, "_open", fail)
    monkeypatch.setattr(contexts, "_h264_encoder", lambda: None)
    found = contexts.describe()
    assert found["kind"] is None
    assert "libegl1" in found["advice"][0]
    assert "libx264" in found["advice"][1]
