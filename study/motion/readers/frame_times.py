"""Frames per second of a BVH file: from the `Frame Time:` as it is printed, by tools that round it or mean a rate."""

from __future__ import annotations

import re
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from study.motion.clip import HIGHEST_FPS, LOWEST_FPS
from study.motion.readers.source import Source, number, shown, whole_number


class FrameTime(NamedTuple):
    """The seconds between frames as the file prints them, and where."""

    text: str
    offset: int


def read_motion_header(source: Source, offset: int) -> tuple[FrameTime, int | None, int]:
    """The frame time, the stated number of frames (None where it is missing), and where the rows start."""
    stated: int | None = None
    line = re.compile(rb"[ \t]*([^\r\n]*)(\r\n|\r|\n|$)")
    while True:
        found = line.match(source.raw, offset)
        if found is None or offset >= len(source.raw):
            raise source.error(len(source.raw.rstrip()), "Expected 'Frame Time:', found the end of the file.")
        content, start, offset = found.group(1), found.start(1), found.end()
        if not content.strip():
            continue
        key = re.match(rb"(frames|frame\s*time)\s*:?\s*", content, re.IGNORECASE)
        if key is None:
            raise source.error(
                start,
                f"Expected 'Frame Time:' before the data rows, found {shown(content)}. "
                "Add the line, for instance 'Frame Time: 0.0083333' for 120 fps.",
            )
        value, at = content[key.end() :].strip(), start + key.end()
        if key.group(1).lower() == b"frames":
            stated = whole_number(source, value, at, "the number of frames after 'Frames:'")
            continue
        seconds = number(source, value, at, "the seconds between frames after 'Frame Time:'")
        if not 1.0 / HIGHEST_FPS <= seconds <= 1.0 / LOWEST_FPS:
            raise source.error(
                at,
                f"Expected a Frame Time above 0, in seconds, from {1.0 / HIGHEST_FPS:g} to {1.0 / LOWEST_FPS:g}, "
                f"found {shown(value)}. Write 1 / fps, such as 0.0083333 for 120 fps; or say `fps` in library.toml.",
            )
        # Digits beyond those of a double say no more.
        return FrameTime(value.decode() if len(value) <= 40 else repr(seconds), at), stated, offset


# Frame rates that cameras and tools run at; tried first where few digits are printed.
_COMMON_FPS = tuple(Fraction(f) for f in (24, 25, 30, 48, 50, 60, 72, 90, 100, 120, 144, 200, 240))
_NTSC_FPS = tuple(Fraction(f * 1000, 1001) for f in (24, 30, 48, 60, 120, 240))
_COMMON_WITHIN = Fraction(2, 100)
_SINGLE = 1e-5
# A second or more between frames is no motion capture, but frames per second or milliseconds. Milliseconds are often
# printed without decimals, which puts them off by as much as this; some numbers can be either.
_SLOWEST_S, _ROUNDED_MS = 1.0, Fraction(5, 100)
_SURELY_FPS, _EITHER = range(48, 501), (10, 12, 15, 20, 40)


def stated_rate(source: Source, frame_time: FrameTime) -> float:
    """Frames per second of the file's frame time; where it holds frames per second or milliseconds, with a warning."""
    value = Fraction(frame_time.text)
    if value < _SLOWEST_S:
        return frame_rate(frame_time.text)
    rates = [float(r) for r in (*_COMMON_FPS, *_NTSC_FPS) if abs(r / value - 1) < Fraction(1, 2000)]
    rates += [float(value)] if value in _SURELY_FPS else []
    words = f"{frame_time.text} frames a second"
    if not rates and value not in _EITHER:
        per_second = 1000 / value
        near = [r for r in _COMMON_FPS if abs(per_second / r - 1) < _ROUNDED_MS]
        rates = [float(r) for r in sorted(near, key=lambda r: abs(r - per_second))]
        words = f"{frame_time.text} milliseconds"
    if not rates:
        raise source.error(
            frame_time.offset,
            f"Expected the seconds between frames after 'Frame Time:', found {frame_time.text}. Write 1 / fps, such as "
            "0.0083333 for 120 fps; or say `fps` in library.toml.",
        )
    source.warn(
        f"expected the seconds between frames after 'Frame Time:', found {frame_time.text}; read as "
        f"{words}, so at {rates[0]:g} fps"
    )
    return rates[0]


def tidy_rate(fps: float) -> float:
    """A rate found from times in single precision: the common, NTSC or whole one that it is up to that; else itself."""
    rates = (*_COMMON_FPS, *_NTSC_FPS, Fraction(round(fps)))
    return next((float(rate) for rate in rates if abs(fps / float(rate or 1) - 1.0) < _SINGLE), fps)


def frame_rate(printed: str) -> float:
    """Frames per second of a printed frame time.

    `0.0083333` means 120 and not 120.00048: where a common rate, a whole number or an NTSC rate (30000/1001) lies
    within what the printed digits leave open, it is meant. A frame time that names none of them is not rounded.

    Examples
    --------
    >>> frame_rate("0.0083333"), frame_rate("0.033367"), frame_rate("0.012")
    (120.0, 29.97002997002997, 83.33333333333333)
    """
    exact = Fraction(printed)
    mantissa, _, exponent = printed.lower().partition("e")
    decimals = len(mantissa.partition(".")[2]) - int(exponent or 0)
    # Half a unit of the last digit; or of a double, for those who print all 17 digits of one.
    open_by = max(Fraction(1, 2) / Fraction(10) ** decimals, Fraction(float(np.spacing(float(exact)))))
    plain = 1 / exact

    def fits(rate: Fraction) -> bool:
        return abs(1 / rate - exact) <= open_by

    if plain.denominator == 1:
        return float(plain)
    common = [r for r in (*_COMMON_FPS, *_NTSC_FPS) if fits(r) and abs(r / plain - 1) <= _COMMON_WITHIN]
    if common:
        return float(min(common, key=lambda rate: abs(rate - plain)))
    whole = Fraction(round(plain))
    neighbours = [Fraction(round(plain) + step) for step in (-1, 1)]
    if whole > 0 and fits(whole) and not any(n > 0 and fits(n) for n in neighbours):
        return float(whole)
    return float(plain)
