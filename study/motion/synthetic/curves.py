"""Small curves that every generator shares: smooth steps, clamped splines, slow noise.

Times come in as arrays (seconds) and values go out with the same leading shape. Nothing here knows about frame
rates: a motion is planned on a fixed grid of `GRID_STEP` seconds and sampled from there.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from study.arrays import FloatArray

GRID_STEP = 0.005
"""Seconds between the points on which a motion is planned, whatever its frame rate."""


def smooth_step(x: ArrayLike, start: float = 0.0, stop: float = 1.0) -> FloatArray:
    """From 0 at `start` to 1 at `stop`, with zero slope and curvature at both (quintic)."""
    share = np.clip((np.asarray(x, dtype=np.float64) - start) / (stop - start), 0.0, 1.0)
    return np.asarray(share**3 * (10.0 - 15.0 * share + 6.0 * share**2))


def bump(x: ArrayLike, start: float, top: float, stop: float) -> FloatArray:
    """From 0 at `start` over 1 at `top` back to 0 at `stop`, smooth throughout."""
    x = np.asarray(x, dtype=np.float64)
    return np.where(x < top, smooth_step(x, start, top), 1.0 - smooth_step(x, top, stop))


def blur(values: FloatArray, sigma_s: float) -> FloatArray:
    """Grid values `(n, ...)` averaged under a Gaussian of `sigma_s` seconds; the ends are held."""
    if sigma_s < 0.5 * GRID_STEP:
        return np.asarray(values, dtype=np.float64)
    reach = int(np.ceil(4.0 * sigma_s / GRID_STEP))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) * GRID_STEP / sigma_s) ** 2)
    kernel /= kernel.sum()
    flat = np.asarray(values, dtype=np.float64).reshape(len(values), -1)
    padded = np.pad(flat, ((reach, reach), (0, 0)), mode="edge")
    smooth = np.stack([np.convolve(column, kernel, mode="valid") for column in padded.T], axis=1)
    return np.asarray(smooth.reshape(np.shape(values)))


def slope(values: FloatArray) -> FloatArray:
    """Derivative by time of grid values `(n, ...)`."""
    return np.asarray(np.gradient(values, GRID_STEP, axis=0))


def running_integral(rates: FloatArray) -> FloatArray:
    """Integral over time of grid values `(n, ...)`, zero at the first (trapezoidal)."""
    steps = 0.5 * GRID_STEP * (rates[1:] + rates[:-1])
    return np.concatenate([np.zeros_like(rates[:1]), np.cumsum(steps, axis=0)])


def hermite(share: FloatArray, ends: tuple[FloatArray, FloatArray], rates: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Cubic from `ends[0]` to `ends[1]`, `(channels,)`, over `share (n,)` 0..1; slopes `rates` per unit share."""
    u = share[:, None]
    return np.asarray(
        (1 + 2 * u) * (1 - u) ** 2 * ends[0]
        + u * (1 - u) ** 2 * rates[0]
        + u**2 * (3 - 2 * u) * ends[1]
        + u**2 * (u - 1) * rates[1]
    )


def clamped_spline(
    share: FloatArray, knots: Sequence[float], values: ArrayLike, rates: tuple[float, float]
) -> FloatArray:
    """Cubic spline through `values (knots, ...)`, with given slopes at both ends, at `share (n,)`."""
    from scipy.interpolate import CubicSpline

    ends: Any = ((1, rates[0]), (1, rates[1]))
    curve = CubicSpline(knots, np.asarray(values, dtype=np.float64), bc_type=ends)
    return np.asarray(curve(share))


@cache
def _monotone(knots: tuple[float, ...], values: tuple[float, ...]) -> Any:
    from scipy.interpolate import PchipInterpolator

    return PchipInterpolator(knots, values)


def shape_preserving(x: ArrayLike, knots: tuple[float, ...], values: tuple[float, ...]) -> FloatArray:
    """Monotone between the knots: it never leaves the values on either side (PCHIP); held outside the knots."""
    return np.asarray(_monotone(knots, values)(np.clip(x, knots[0], knots[-1])))


def slow_noise(
    rng: np.random.Generator,
    times: FloatArray,
    size: float,
    channels: int = 1,
    band_hz: tuple[float, float] = (0.08, 0.6),
) -> FloatArray:
    """Wandering `(n, channels)` of standard deviation `size`: seven sines of random frequency and phase."""
    waves = 7
    low, high = np.log(band_hz[0]), np.log(band_hz[1])
    frequencies = np.exp(rng.uniform(low, high, (waves, channels)))
    phases = rng.uniform(0.0, 2 * np.pi, (waves, channels))
    # Larger where slower, as sway and stride-to-stride wandering are.
    sizes = frequencies**-0.5
    sizes *= size * np.sqrt(2.0) / np.sqrt(np.sum(sizes**2, axis=0))
    angles = 2 * np.pi * times[:, None, None] * frequencies + phases
    return np.asarray(np.sum(sizes * np.sin(angles), axis=1))
