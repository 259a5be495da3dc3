"""The courses of the locomotion motions: steady, starting, stopping, and turning."""

from __future__ import annotations

import numpy as np

from study.errors import MotionError
from study.motion.synthetic import gait
from study.motion.synthetic.curves import bump, smooth_step
from study.motion.synthetic.locomotion import Course, grid, travel
from study.motion.synthetic.targets import Targets

SPEED_RANGE = (0.5, 6.0)
ANGLE_RANGE = (5.0, 180.0)


def steady(seconds: float, rng: np.random.Generator, *, speed: float = 1.3) -> Targets:
    """Walking or running straight on at `speed` m/s; people change over near 2 m/s."""
    _check("speed", speed, SPEED_RANGE, "m/s")
    times = grid(seconds)
    return travel(Course(times, np.full(len(times), float(speed)), np.zeros(len(times))), rng)


def start(seconds: float, rng: np.random.Generator, *, speed: float = 1.3, event_s: float | None = None) -> Targets:
    """Standing, then walking or running; the body begins to move at `event_s` (the middle where none is given)."""
    _check("speed", speed, SPEED_RANGE, "m/s")
    times = grid(seconds)
    at = _event(seconds, event_s)
    profile = float(speed) * smooth_step(times, at, at + _ramp_s(speed))
    return travel(Course(times, profile, np.zeros(len(times)), start=at), rng)


def stop(seconds: float, rng: np.random.Generator, *, speed: float = 1.3, event_s: float | None = None) -> Targets:
    """Walking or running, then standing; it begins to slow at `event_s` (the middle where none is given)."""
    _check("speed", speed, SPEED_RANGE, "m/s")
    times = grid(seconds)
    at = _event(seconds, event_s)
    end = at + 1.2 * _ramp_s(speed)
    profile = float(speed) * (1.0 - smooth_step(times, at, end))
    return travel(Course(times, profile, np.zeros(len(times)), stop=end), rng)


def turn(
    seconds: float,
    rng: np.random.Generator,
    *,
    speed: float = 1.3,
    angle: float = 90.0,
    event_s: float | None = None,
) -> Targets:
    """Straight on, a turn of `angle` degrees to the left (negative: to the right), straight on.

    The middle of the turn is at `event_s` (the middle of the motion where none is given). It takes longer the wider
    it is, and the speed falls by up to a fifth in it (Orendurff et al. 2006 for walking).
    """
    _check("speed", speed, SPEED_RANGE, "m/s")
    _check("angle (either way)", abs(angle), ANGLE_RANGE, "degrees")
    times = grid(seconds)
    middle = _event(seconds, event_s)
    running = float(gait.running_share(speed))
    wide = abs(float(angle)) / 90.0
    long = (1.75 - 0.25 * running) * (0.55 + 0.45 * wide)
    # No sharper than half a g inward, which a running person leans into by 27 degrees.
    long = max(long, 1.875 * np.radians(abs(float(angle))) * 0.8 * float(speed) / 5.0)
    heading = np.radians(float(angle)) * smooth_step(times, middle - 0.5 * long, middle + 0.5 * long)
    slower = (0.18 + 0.04 * running) * min(1.0, wide) * bump(times, middle - 0.8 * long, middle, middle + 0.8 * long)
    return travel(Course(times, float(speed) * (1.0 - slower), heading), rng)


def _ramp_s(speed: float) -> float:
    """Seconds from standing to speed: two to three steps of walking (Jian et al. 1993), four to five of running."""
    return float(1.30 + 0.33 * max(0.0, speed - 1.3))


def _event(seconds: float, event_s: float | None) -> float:
    if event_s is None:
        return 0.5 * seconds
    if not 0.0 <= event_s <= seconds:
        raise MotionError(f"Expected event_s from 0 to the length of {seconds:g} s, got {event_s:g}.")
    return float(event_s)


def _check(what: str, value: float, span: tuple[float, float], unit: str) -> None:
    if not (np.isfinite(value) and span[0] <= value <= span[1]):
        raise MotionError(f"Expected {what} from {span[0]:g} to {span[1]:g} {unit}, got {value}.")
