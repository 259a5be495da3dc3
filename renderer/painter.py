"""The draw pass: capsules on the screen, painted into whatever framebuffer is bound.

A `Painter` belongs to one GL context and knows nothing of files, frames or windows: `offscreen` paints luma and chroma
with it, a window paints the screen.
"""

from __future__ import annotations

from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.errors import RendererError
from renderer.shapes import FLOATS

TARGETS = ("luma", "chroma", "rgb")
"""What is painted offscreen: the first row of the framebuffer is the top of the picture."""

SCREEN = "screen"
"""The same colours as `rgb`, for a window, where the first row is the bottom: both where a capsule lies and which pixel
is being painted count from the top."""

# Pixels beyond a capsule that its smooth edge touches: half of one, or of a sample of two pixels that lies half a pixel
# aside, and something for the rounding of the corners.
_EDGE = {"luma": 0.75, "chroma": 1.75, "rgb": 0.75, SCREEN: 0.75}

# The light: how much brighter in the middle, towards the light (screen axes, y down), and darker at the rim.
_CONSTANTS = {
    "LIGHT_BASE": 0.12,
    "LIGHT_X": -0.10,
    "LIGHT_Y": -0.20,
    "LIGHT_RIM": 0.34,
    "BLACK": 16.0 / 255.0,
}


class Painter:
    """The compiled shaders and buffers of one context, for up to `capacity` capsules a call."""

    def __init__(self, gl: Any, targets: tuple[str, ...] = TARGETS, capacity: int = 1024) -> None:
        self._gl = gl
        self._capacity = 0
        self._programs = {target: _compile(gl, target) for target in targets}
        self._arrays: dict[str, Any] = {}
        self._buffers: list[Any] = []
        self._reserve(capacity)

    def _reserve(self, capacity: int) -> None:
        for thing in (*self._arrays.values(), *self._buffers):
            thing.release()
        corners = np.arange(capacity, dtype=np.int32)[:, None] * 4 + np.array([0, 1, 2, 2, 1, 3], dtype=np.int32)
        self._vertices = self._gl.buffer(reserve=capacity * 4 * FLOATS * 4)
        indices = self._gl.buffer(corners.tobytes())
        self._buffers = [self._vertices, indices]
        self._arrays = {
            target: self._gl.vertex_array(program, _content(self._vertices, program), indices, index_element_size=4)
            for target, program in self._programs.items()
        }
        self._capacity = capacity

    def load(self, data: NDArray[np.float32]) -> int:
        """Hand over capsules `(..., 24)` as `shapes.lay_out` numbers them; returns how many."""
        flat = data.reshape(-1, FLOATS)
        if len(flat) > self._capacity:
            self._reserve(2 * len(flat))
        self._vertices.write(np.repeat(flat, 4, axis=0))
        return len(flat)

    def paint(self, target: str, capsules: int, size: tuple[int, int]) -> None:
        """Paint the loaded capsules, in their order, over what the bound framebuffer holds.

        Parameters
        ----------
        target
            `"luma"` and `"chroma"` for the planes of NV12, `"rgb"` to be read, or `"screen"` to be shown.
        capsules
            How many of those loaded.
        size
            Width and height of the picture in pixels of luma.
        """
        program = self._programs[target]
        flip = -1.0 if target == SCREEN else 1.0
        program["scale"].value = (2.0 / size[0], 2.0 / size[1] * flip)
        program["origin"].value = (-1.0, -flip)
        self._gl.enable_only(self._gl.BLEND)
        self._gl.blend_func = self._gl.SRC_ALPHA, self._gl.ONE_MINUS_SRC_ALPHA
        self._arrays[target].render(self._gl.TRIANGLES, vertices=capsules * 6)

    def release(self) -> None:
        """Free what it holds of the context."""
        for thing in (*self._arrays.values(), *self._buffers, *self._programs.values()):
            thing.release()
        self._arrays, self._buffers, self._programs = {}, [], {}


_INPUTS = ("line", "body", "colour", "extra", "part_line", "part_body")


def _content(buffer: Any, program: Any) -> list[tuple[Any, ...]]:
    """The inputs that a program uses, out of 24 floats a vertex."""
    layout, names = [], []
    for name in _INPUTS:
        if name in program:
            layout.append("4f")
            names.append(name)
        else:
            layout.append("16x")
    return [(buffer, " ".join(layout), *names)]


def _compile(gl: Any, target: str) -> Any:
    if target not in (*TARGETS, SCREEN):
        raise RendererError(f"Expected a target of {', '.join((*TARGETS, SCREEN))}, got {target!r}.")
    # `precise` came with GLSL 4.00. Mesa's software renderers never fuse, so 3.30 gives the same pixels there.
    version, precise = ("400", "precise") if gl.version_code >= 400 else ("330", "")
    head = f"#version {version}\n#define PRECISE {precise}\n#define {'RGB' if target == SCREEN else target.upper()} 1\n"
    head += f"#define EDGE {_EDGE[target]}\n"
    head += "".join(f"#define {name} ({value!r})\n" for name, value in _CONSTANTS.items())
    folder = resources.files("renderer.shaders")
    vertex, fragment = ((folder / f"capsule.{kind}").read_text(encoding="utf-8") for kind in ("vert", "frag"))
    from_top = "layout(origin_upper_left) in vec4 gl_FragCoord;\n" if target == SCREEN else ""
    return gl.program(vertex_shader=head + vertex, fragment_shader=head + from_top + fragment)
