"""Colours: 8-bit sRGB in, BT.709 limited-range luma and chroma out, and back.

Recommendation ITU-R BT.709-6, section 3: `Y' = 0.2126 R' + 0.7152 G' + 0.0722 B'`; luma takes 16..235, chroma
16..240 around 128. The videos carry these tags, so a player gives the asked colours back.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from renderer.errors import RendererError

RGB = tuple[int, int, int]
FloatArray = NDArray[np.float64]

_RED, _GREEN, _BLUE = 0.2126, 0.7152, 0.0722
_RED_SPAN, _BLUE_SPAN = 2.0 * (1.0 - _RED), 2.0 * (1.0 - _BLUE)


def check_colour(colour: Sequence[int], name: str = "colour") -> RGB:
    """Three whole numbers from 0 to 255."""
    values = tuple(colour)
    if len(values) != 3 or any(int(v) != v or not 0 <= v <= 255 for v in values):
        raise RendererError(f"Expected a {name} as three whole numbers from 0 to 255, got {colour!r}.")
    return (int(values[0]), int(values[1]), int(values[2]))


def to_ycbcr(colour: Sequence[int]) -> tuple[float, float, float]:
    """Luma and chroma of an 8-bit RGB colour, on the limited 8-bit range, not rounded."""
    red, green, blue = (value / 255.0 for value in colour)
    luma = _RED * red + _GREEN * green + _BLUE * blue
    return (
        16.0 + 219.0 * luma,
        128.0 + 224.0 * (blue - luma) / _BLUE_SPAN,
        128.0 + 224.0 * (red - luma) / _RED_SPAN,
    )


def nv12_to_rgb(frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An NV12 frame `(height * 3 / 2, width)` as RGB `(height, width, 3)`; chroma is repeated, not smoothed."""
    height = frame.shape[0] * 2 // 3
    width = frame.shape[1]
    chroma = frame[height:].reshape(height // 2, width // 2, 2).astype(np.float64)
    chroma = np.repeat(np.repeat(chroma, 2, axis=0), 2, axis=1)
    return to_rgb(frame[:height].astype(np.float64), chroma[..., 0], chroma[..., 1])


def to_rgb(luma: FloatArray, blue: FloatArray, red: FloatArray) -> NDArray[np.uint8]:
    """Planes of luma and both chromas, limited 8-bit range, as RGB `(..., 3)`."""
    luma, blue, red = (luma - 16.0) / 219.0, (blue - 128.0) / 224.0, (red - 128.0) / 224.0
    red = luma + _RED_SPAN * red
    blue = luma + _BLUE_SPAN * blue
    green = (luma - _RED * red - _BLUE * blue) / _GREEN
    rgb = np.stack([red, green, blue], axis=-1)
    return np.clip(np.round(rgb * 255.0), 0, 255).astype(np.uint8)
