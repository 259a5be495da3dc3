"""How people walk and run at a given speed: rhythm, stance, roll of the foot, and swing of pelvis, trunk and arms.

Every number comes from published measurements of healthy adults and is given for a stature of 1.75 m; the sources
stand beside the curves, and `docs/synthetic.md` lists them in full.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from study.arrays import FloatArray
from study.motion.synthetic.curves import shape_preserving, smooth_step

SPEEDS = (0.0, 0.8, 1.3, 1.8, 2.4, 3.3, 4.5)
"""m/s, the knots of the tables below: three of walking, then three of running."""

WALK_TO_RUN = (1.95, 2.25)
"""m/s: people change to running near 2.0 m/s (Thorstensson & Roberthson 1987; Hreljac 1993)."""

# Each row: value at the knots of SPEEDS. Angles in degrees, lengths in metres.
_TABLES = {
    # Stance as a share of the stride: Murray et al. 1966 (65, 61, 57 % slow, free and fast); running: Novacheck 1998.
    "stance": (0.68, 0.645, 0.615, 0.59, 0.385, 0.345, 0.295),
    # Foot pitch at heel strike and at toe-off: Winter 1991; running with a rear-foot strike: Nigg et al. 1987.
    "strike_pitch": (0.0, 15.0, 21.0, 25.0, 9.0, 9.0, 6.0),
    "off_pitch": (32.0, 55.0, 63.0, 68.0, 55.0, 60.0, 64.0),
    # Knee in stance and swing: Winter 1991, Bovi et al. 2011, Fukuchi et al. 2018; running: Novacheck 1998.
    "loading": (0.0, 7.0, 12.0, 17.0, 16.0, 19.0, 20.0),
    "knee": (5.0, 6.5, 7.0, 7.5, 22.0, 23.0, 22.0),
    "off_knee": (30.0, 37.0, 40.0, 42.0, 28.0, 25.0, 22.0),
    "swing_knee": (32.0, 57.0, 63.0, 66.0, 82.0, 97.0, 112.0),
    # Pelvis: rotation and list, half of the range (Murray et al. 1964; Crosbie et al. 1997; Schache et al. 2002).
    "pelvis_yaw": (0.0, 3.0, 4.6, 6.2, 4.0, 5.0, 6.5),
    "pelvis_list": (0.0, 2.2, 3.4, 4.6, 4.2, 4.8, 5.4),
    "pelvis_pitch": (0.0, 2.0, 2.5, 3.5, 8.0, 9.5, 11.0),
    # Sideways travel of the pelvis, half of the range: Orendurff et al. 2004; it shrinks with speed.
    "sway": (0.020, 0.025, 0.019, 0.014, 0.008, 0.006, 0.005),
    # Feet beside the line of progress: half of the step width (Murray et al. 1964; Cavanagh 1987 for running).
    "half_width": (0.085, 0.052, 0.046, 0.045, 0.030, 0.022, 0.016),
    # Trunk: turn against the pelvis, half of the range (Crosbie et al. 1997; Bruijn et al. 2008), and lean.
    "chest_yaw": (0.0, 2.0, 3.4, 4.8, 10.0, 12.5, 15.0),
    "chest_pitch": (0.5, 1.5, 2.5, 4.0, 7.0, 9.0, 11.0),
    # Arms: mean and half range of shoulder flexion and elbow (Murray et al. 1967; Hinrichs 1987 for running).
    "arm_mean": (2.0, 0.0, -2.5, -3.0, -15.0, -17.0, -18.0),
    "arm_swing": (0.0, 11.0, 18.0, 25.0, 20.0, 25.0, 34.0),
    "elbow_mean": (14.0, 18.0, 22.0, 30.0, 88.0, 96.0, 98.0),
    "elbow_swing": (0.0, 6.0, 11.0, 16.0, 10.0, 14.0, 19.0),
    "abduction": (7.0, 7.0, 7.0, 8.0, 16.0, 17.0, 18.0),
}
_IN_DEGREES = {
    "strike_pitch", "off_pitch", "loading", "knee", "off_knee", "swing_knee", "pelvis_yaw", "pelvis_list",
    "pelvis_pitch", "chest_yaw", "chest_pitch", "arm_mean", "arm_swing", "elbow_mean", "elbow_swing", "abduction",
}  # fmt: skip


def running_share(speed: ArrayLike) -> FloatArray:
    """0 for walking, 1 for running, between them around the speed at which people change over."""
    return smooth_step(speed, *WALK_TO_RUN)


def by_speed(what: str, speed: ArrayLike, running: ArrayLike | None = None) -> FloatArray:
    """A quantity of the tables above at `speed (...)` in m/s; angles in radians.

    Walking is interpolated and extended over its own knots, running over its own, and the two are mixed around the
    change-over, so that no speed gets a mean of walking and running but those few. `running (...)` overrides how
    much of each.
    """
    speed = np.asarray(speed, dtype=np.float64)
    table = _TABLES[what]
    run_share = running_share(speed) if running is None else np.asarray(running, dtype=np.float64)
    value = np.zeros(np.broadcast_shapes(speed.shape, run_share.shape))
    if (run_share < 1.0).any():
        value += (1.0 - run_share) * shape_preserving(speed, SPEEDS[:4], table[:4])
    if (run_share > 0.0).any():
        value += run_share * shape_preserving(speed, SPEEDS[4:], table[4:])
    return np.asarray(np.radians(value) if what in _IN_DEGREES else value)


def stride_rate(speed: ArrayLike) -> FloatArray:
    """Strides (two steps) a second at `speed (...)`.

    Walking: step rate grows with about the 0.42nd power of speed (Grieve & Gear 1966), 1.87 steps a second at
    1.3 m/s. Running: it hardly grows (Cavanagh & Kram 1989), from 2.58 at 2.4 m/s to 2.92 at 4.5 m/s.
    """
    speed = np.asarray(speed, dtype=np.float64)
    walking = 1.675 * np.maximum(speed, 0.42) ** 0.42
    running = 2.20 + 0.16 * speed
    run_share = running_share(speed)
    return np.asarray(0.5 * ((1.0 - run_share) * walking + run_share * running))


def landing_share(speed: ArrayLike) -> FloatArray:
    """The share of the stance after which the hips pass over the flat foot (earlier than half: the leg trails)."""
    run_share = running_share(speed)
    return np.asarray((1.0 - run_share) * 0.363 + run_share * 0.30)
