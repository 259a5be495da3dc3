"""Standing and idling: quiet sway, breath, shifts of weight, and small steps to stand anew.

Sway after Winter 1995 (a few millimetres, below 1 Hz), shifts of weight after Duarte & Zatsiorsky 1999 (every few
seconds in people who stand at ease), breath at a quarter of a hertz.
"""

from __future__ import annotations

import numpy as np

from study.arrays import FloatArray
from study.motion.synthetic.curves import blur, bump, slow_noise, smooth_step
from study.motion.synthetic.legs import FOREVER, Contact, hip_height, on_grid, solve_legs, under_limit
from study.motion.synthetic.locomotion import Person, grid
from study.motion.synthetic.targets import LEFT, OUTWARD, RIGHT, Targets


def stand(seconds: float, rng: np.random.Generator) -> Targets:
    """Standing at ease, both feet planted, hardly moving."""
    person = Person.drawn(rng)
    times = grid(seconds)
    feet = tuple([_place(side, person, -FOREVER, FOREVER, rng)] for side in (LEFT, RIGHT))
    shift = slow_noise(rng, times, 0.006, 1, (0.05, 0.3))[:, 0]
    return _upright((feet[0], feet[1]), times, person, rng, shift, restless=0.35)


def idle(seconds: float, rng: np.random.Generator) -> Targets:
    """Waiting: the weight goes from leg to leg, a foot is set anew, the eyes wander, the arms follow."""
    person = Person.drawn(rng)
    times = grid(seconds)
    sides: tuple[list[Contact], list[Contact]] = ([], [])
    starts = [-FOREVER, -FOREVER]
    target = np.zeros(len(times))
    time, side = float(times[0] + rng.uniform(0.5, 2.5)), int(rng.integers(2))
    while time < times[-1] - 2.5:
        # Onto the leg of `side`; now and then the other foot, free of weight, takes a small step.
        last = target[-1]
        size = OUTWARD[side] * rng.uniform(0.035, 0.055)
        target += (size - last) * smooth_step(times, time, time + rng.uniform(0.9, 1.4))
        if rng.random() < 0.45:
            free = 1 - side
            lift = time + 1.2
            sides[free].append(_place(free, person, starts[free], lift, rng))
            starts[free] = lift + rng.uniform(0.38, 0.46)
        time += rng.uniform(2.6, 4.6)
        side = 1 - side
    for foot in (LEFT, RIGHT):
        sides[foot].append(_place(foot, person, starts[foot], FOREVER, rng))
    ready = (on_grid(sides[LEFT], times), on_grid(sides[RIGHT], times))
    return _upright(ready, times, person, rng, blur(target, 0.1), restless=1.0)


def _place(side: int, person: Person, start: float, stop: float, rng: np.random.Generator) -> Contact:
    spread = np.clip(rng.standard_normal(3), -2, 2)
    return Contact(
        start=start,
        stop=stop,
        x=float(OUTWARD[side] * (0.095 * person.width + 0.010 * spread[0])),
        z=float(0.018 * spread[1]),
        yaw=float(OUTWARD[side] * (person.toe_out[side] + np.radians(4.0 + 2.0 * spread[2]))),
        strike_pitch=np.radians(-0.0),
        off_pitch=np.radians(24.0),
        heel_off=0.72,
        knee=np.radians(6.0),
        off_knee=np.radians(22.0),
        swing_knee=np.radians(38.0),
        swing_peak=0.4,
        nominal_s=1.2,
    )


def _upright(
    sides: tuple[list[Contact], list[Contact]],
    times: FloatArray,
    person: Person,
    rng: np.random.Generator,
    shift: FloatArray,
    restless: float,
) -> Targets:
    n = len(times)
    sway = slow_noise(rng, times, 0.004, 2, (0.1, 0.8))
    breath = np.sin(2 * np.pi * 0.24 * times + rng.uniform(0, 6.3) + 0.4 * slow_noise(rng, times, 1.0)[:, 0])
    # The hip sinks on the side that bears little; the trunk stays over the feet.
    yaw = restless * slow_noise(rng, times, np.radians(2.0), 1, (0.04, 0.2))[:, 0]
    pelvis = np.column_stack([yaw, np.full(n, np.radians(1.0)), 1.15 * shift])
    level = np.column_stack([shift + sway[:, 0], np.zeros(n), 0.015 + sway[:, 1]])
    height, limit = hip_height(sides, times, level, pelvis)
    level[:, 1] = under_limit(blur(height, 0.12), limit, 0.20) - 0.004
    ankles, feet, toes = solve_legs(sides, times, level, pelvis, np.zeros(n))

    look = _glances(times, rng, restless)
    tilt = slow_noise(rng, times, np.radians(0.6), 3)
    chest_pitch = np.radians(1.0) + person.lean + np.radians(0.5) * breath + tilt[:, 1]
    chest = np.column_stack([0.8 * yaw + 0.22 * look[:, 0] + tilt[:, 0], chest_pitch, -0.5 * shift + tilt[:, 2]])
    head_roll = -0.2 * shift + 0.5 * tilt[:, 2]
    head = np.column_stack([look[:, 0] + 0.4 * yaw, person.head_pitch + look[:, 1] + 0.3 * tilt[:, 1], head_roll])
    arms, wrists, collars = _hanging(times, person, rng, breath, restless)
    return Targets(
        times=times,
        pelvis_position=level,
        pelvis_angles=pelvis,
        chest_angles=chest,
        head_angles=head,
        ankles=ankles,
        feet_angles=feet,
        toes=toes,
        knees_out=np.full((n, 2), np.radians(2.0)),
        arms=arms,
        wrists=wrists,
        collars=collars,
    )


def _glances(times: FloatArray, rng: np.random.Generator, restless: float) -> FloatArray:
    """Yaw and pitch of the head `(n, 2)`: fixations of one to four seconds with quick turns between them."""
    yaw, pitch = np.zeros(len(times)), np.zeros(len(times))
    time, now = float(times[0]), np.zeros(2)
    while time < times[-1]:
        time += rng.uniform(1.2, 4.0)
        then = restless * np.radians([16.0, 4.0]) * np.clip(rng.standard_normal(2), -2, 2)
        turn = smooth_step(times, time, time + 0.35 + 0.8 * abs(then[0] - now[0]))
        yaw, pitch = yaw + (then[0] - now[0]) * turn, pitch + (then[1] - now[1]) * turn
        now = then
    drift = slow_noise(rng, times, np.radians(0.8), 2)
    return np.column_stack([yaw, pitch]) + drift


def _hanging(
    times: FloatArray, person: Person, rng: np.random.Generator, breath: FloatArray, restless: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arms that hang at ease; a restless person swings, lifts and shrugs them a little."""
    n = len(times)
    arms, wrists, collars = np.zeros((n, 2, 4)), np.zeros((n, 2, 2)), np.zeros((n, 2, 2))
    base = np.radians([1.0, 7.0, -12.0, 14.0])
    for side in (LEFT, RIGHT):
        own = base * (1.0 + 0.25 * np.clip(rng.standard_normal(4), -1.5, 1.5))
        drift = slow_noise(rng, times, 1.0, 4, (0.06, 0.5))
        arms[:, side] = own + np.radians([1.2, 0.6, 1.5, 1.6]) * drift * (0.6 + restless)
        wrists[:, side] = np.radians([40.0, 8.0])
        collars[:, side, 0] = OUTWARD[side] * person.shoulder_drop + np.radians(0.8) * breath
    if restless > 0.5:
        time = float(times[0] + rng.uniform(1.0, 4.0))
        while time < times[-1] - 3.0:
            side, long = int(rng.integers(2)), float(rng.uniform(1.4, 2.4))
            raised = bump(times, time, time + 0.45 * long, time + long)[:, None]
            arms[:, side] += raised * np.radians([14.0, 3.0, -10.0, rng.uniform(25.0, 60.0)])
            time += long + rng.uniform(2.5, 6.0)
    return arms, wrists, collars
