"""A slow form in the manner of tai chi: low, even, always moving, the weight going wholly from foot to foot.

After descriptions of the 24-form: single steps take some four seconds, knees stay bent by 30-60 degrees, nearly half
of the time is spent on one leg or passing to it, and the feet are set down before they are loaded (Wu et al. 2004;
Law & Li 2014). The moves are free renderings of well-known ones; no master would call this a form.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from study.motion.synthetic.locomotion import grid
from study.motion.synthetic.score import Score, perform
from study.motion.synthetic.targets import LEFT, OUTWARD, RIGHT, Targets

_STYLE = {
    "strike_pitch": 0.22,
    "off_pitch": 0.35,
    "flat_from": 0.25,
    "heel_off": 0.8,
    "nominal_s": 3.0,
    "swing_knee": 1.15,
    "swing_peak": 0.45,
    "knee": 0.7,
}
_LOW = 0.125
_HALF = 0.13

_HELD_HIGH = (-0.04, -0.06, 0.32, 1.05)
_HELD_LOW = (-0.05, -0.36, 0.28, 0.75)
_OPEN_HIGH = (0.10, 0.10, 0.44, 0.75)
_BY_HIP = (0.14, -0.40, 0.12, 0.75)
_PUSHED = (0.00, 0.04, 0.52, 0.55)
_BACK = (0.04, -0.08, 0.24, 0.75)
_BESIDE_EAR = (0.05, 0.12, 0.22, 0.85)
_RESTING = (0.09, -0.50, 0.10, 0.30)


@dataclass
class _Form:
    """The score under way, and where the form has got to."""

    score: Score
    rng: np.random.Generator
    unit: float
    """Seconds that one shift of weight takes."""

    def place(self, side: int, ahead: float, aside: float) -> tuple[float, float]:
        """A point ahead and to the left of the other foot, as the form faces, `(x, z)`."""
        other = self.score.feet.at(1 - side)
        facing = float(self.score.heading.now[0])
        jitter = self.rng.normal(0.0, 0.01, 2)
        ahead, aside = ahead + jitter[0], aside + jitter[1]
        return (
            other.x + ahead * np.sin(facing) + aside * np.cos(facing),
            other.z + ahead * np.cos(facing) - aside * np.sin(facing),
        )


def tai_chi(seconds: float, rng: np.random.Generator, *, pace: float = 1.0) -> Targets:
    """Parting, brushing, pushing, and hands like clouds, at an ordinary pace of practice."""
    return _form(seconds, rng, pace, (_part, _brush, _push, _part, _clouds, _brush))


def tai_chi_slow(seconds: float, rng: np.random.Generator, *, pace: float = 0.65) -> Targets:
    """Mostly hands like clouds and pushes, slower."""
    return _form(seconds, rng, pace, (_clouds, _push, _part, _clouds))


def _form(
    seconds: float, rng: np.random.Generator, pace: float, moves: tuple[Callable[[_Form, float, int], float], ...]
) -> Targets:
    score = Score(grid(seconds), dict(_STYLE))
    form = _Form(score, rng, 1.45 / float(np.clip(pace, 0.3, 2.5)))
    for side in (LEFT, RIGHT):
        score.feet.stand(side, OUTWARD[side] * _HALF, 0.0, OUTWARD[side] * np.radians(12.0))
        score.hands[side].reset(_RESTING)
    score.begin(crouch=0.05, chest=[0.0, np.radians(2.0), 0.0], head=[0.0, np.radians(3.0), 0.0])
    time = _open(form, float(score.times[0]) + 0.3)
    side, count = int(rng.integers(2)), int(rng.integers(len(moves)))
    while time < score.times[-1] - 6.5 * form.unit:
        time = moves[count % len(moves)](form, time, side)
        side, count = 1 - side, count + 1
    return perform(score, rng, unrest=0.8)


def _open(form: _Form, time: float) -> float:
    """Arms float up to shoulder height, and down as the knees give."""
    score, unit = form.score, form.unit
    for side in (LEFT, RIGHT):
        score.hands[side].move(time + 0.05 * side, time + 1.2 * unit, [0.02, -0.02, 0.46, 0.45])
        score.hands[side].move(time + 1.15 * unit, time + 2.3 * unit, _HELD_LOW)
    score.crouch.move(time + 1.0 * unit, time + 2.3 * unit, _LOW)
    return time + 2.2 * unit


def _hold_ball(form: _Form, time: float, over: int) -> float:
    """All the weight over one foot, the hands round a ball, the upper one on that side."""
    score, unit, sign = form.score, form.unit, OUTWARD[over]
    score.weight.move(time, time + 1.1 * unit, 0.95 * sign)
    score.pelvis.move(time, time + 1.2 * unit, [0.30 * sign, 0.03, 0.0])
    score.chest.move(time, time + 1.3 * unit, [0.45 * sign, 0.04, 0.0])
    score.head.move(time, time + 1.2 * unit, [0.40 * sign, 0.07, 0.0])
    score.hands[over].move(time, time + 1.2 * unit, _HELD_HIGH)
    score.hands[1 - over].move(time + 0.05, time + 1.3 * unit, [-0.16, -0.36, 0.26, 0.75])
    score.wrists[over].move(time, time + 1.2 * unit, np.radians([90.0, 5.0]))
    score.wrists[1 - over].move(time, time + 1.2 * unit, np.radians([-40.0, 5.0]))
    return time + 0.95 * unit


def _bow_step(form: _Form, time: float, side: int) -> float:
    """A foot is set down ahead, heel first and empty; then the weight flows onto it, the rear heel turning out."""
    score, unit, sign = form.score, form.unit, OUTWARD[side]
    facing = float(score.heading.now[0])
    place = form.place(side, ahead=0.50, aside=0.24 * sign)
    score.step(side, time, time + 1.05 * unit, place, facing + 0.10 * sign)
    flow = time + 0.95 * unit
    score.weight.move(flow, flow + 1.3 * unit, 0.48 * sign)
    rear = score.pivots[1 - side]
    rear.move(flow + 0.3 * unit, flow + 1.2 * unit, np.add(rear.now, [0.25 * sign, 0.0]))
    score.pelvis.move(time + 0.3 * unit, flow + 1.2 * unit, [0.05 * sign, 0.04, 0.0])
    score.crouch.move(flow, flow + 1.2 * unit, _LOW + 0.02)
    return flow


def _gather(form: _Form, time: float, side: int) -> float:
    """The rear foot is drawn up beside the other, on its ball."""
    score, unit, sign = form.score, form.unit, OUTWARD[side]
    facing = float(score.heading.now[0])
    score.weight.move(time, time + 0.8 * unit, -0.95 * sign)
    lift = time + 0.75 * unit
    score.step(
        side,
        lift,
        lift + 0.75 * unit,
        form.place(side, ahead=0.06, aside=0.17 * sign),
        facing + 0.35 * sign,
        strike_pitch=0.0,
        heel_up=0.30,
    )
    score.crouch.move(time, lift + 0.6 * unit, _LOW)
    return lift + 0.70 * unit


def _part(form: _Form, time: float, side: int) -> float:
    """Parting the wild horse's mane: from the ball, one hand sweeps up and out, the other down to the hip."""
    score, unit, sign = form.score, form.unit, OUTWARD[side]
    time = _hold_ball(form, time, 1 - side)
    flow = _bow_step(form, time, side)
    end = flow + 1.4 * unit
    score.chest.move(flow - 0.2 * unit, end, [0.30 * sign, 0.05, 0.0])
    score.head.move(flow, end, [0.25 * sign, 0.05, 0.0])
    score.hands[side].move(flow - 0.3 * unit, end, _OPEN_HIGH)
    score.hands[1 - side].move(flow - 0.2 * unit, end + 0.1, _BY_HIP)
    score.wrists[side].move(flow, end, np.radians([-50.0, 10.0]))
    score.wrists[1 - side].move(flow, end, np.radians([80.0, -25.0]))
    return _gather(form, end - 0.1 * unit, 1 - side)


def _brush(form: _Form, time: float, side: int) -> float:
    """Brush the knee: one hand passes low before the knee, the other pushes from beside the ear."""
    score, unit, sign = form.score, form.unit, OUTWARD[side]
    other = 1 - side
    score.weight.move(time, time + 1.0 * unit, -0.95 * sign)
    score.chest.move(time, time + 1.2 * unit, [-0.55 * sign, 0.04, 0.0])
    score.head.move(time, time + 1.2 * unit, [-0.40 * sign, 0.06, 0.0])
    score.pelvis.move(time, time + 1.2 * unit, [-0.30 * sign, 0.03, 0.0])
    score.sweep(other, time, time + 1.6 * unit, [0.34, -0.22, 0.22, 0.8], _BESIDE_EAR)
    score.hands[side].move(time, time + 1.3 * unit, [-0.20, -0.12, 0.26, 0.85])
    flow = _bow_step(form, time + 0.95 * unit, side)
    end = flow + 1.4 * unit
    score.chest.move(flow - 0.2 * unit, end, [0.12 * sign, 0.06, 0.0])
    score.head.move(flow - 0.2 * unit, end, [0.0, 0.05, 0.0])
    score.hands[other].move(flow - 0.1 * unit, end, _PUSHED)
    score.sweep(side, flow - 0.5 * unit, end - 0.1 * unit, [-0.06, -0.40, 0.30, 0.7], _BY_HIP)
    score.wrists[other].move(flow, end, np.radians([70.0, -45.0]))
    score.wrists[side].move(flow, end, np.radians([80.0, -20.0]))
    return _gather(form, end - 0.1 * unit, other)


def _push(form: _Form, time: float, side: int) -> float:
    """Both hands draw back over the rear leg and push ahead over the front one, twice."""
    score, unit, sign = form.score, form.unit, OUTWARD[side]
    score.weight.move(time, time + 0.9 * unit, -0.95 * sign)
    for hand in (LEFT, RIGHT):
        score.hands[hand].move(time, time + 1.2 * unit, _BACK)
        score.wrists[hand].move(time, time + 1.2 * unit, np.radians([70.0, -30.0]))
    score.chest.move(time, time + 1.0 * unit, [-0.12 * sign, 0.02, 0.0])
    score.head.move(time, time + 1.0 * unit, [0.0, 0.05, 0.0])
    score.pelvis.move(time, time + 1.0 * unit, [-0.10 * sign, 0.02, 0.0])
    flow = _bow_step(form, time + 0.85 * unit, side)
    for repeat in range(2):
        end = flow + 1.3 * unit
        score.chest.move(flow, end, [0.06 * sign, 0.09, 0.0])
        for hand in (LEFT, RIGHT):
            score.hands[hand].move(flow + 0.1 + 0.06 * hand, end + 0.05, _PUSHED)
        if repeat == 0:
            score.weight.move(end, end + 1.2 * unit, -0.62 * sign)
            score.chest.move(end, end + 1.2 * unit, [-0.12 * sign, 0.0, 0.0])
            for hand in (LEFT, RIGHT):
                score.sweep(hand, end, end + 1.25 * unit, [0.12, -0.02, 0.40, 0.7], [0.05, -0.20, 0.22, 0.75])
            flow = end + 1.15 * unit
            score.weight.move(flow, flow + 1.25 * unit, 0.48 * sign)
    return _gather(form, end - 0.05 * unit, 1 - side)


def _clouds(form: _Form, time: float, side: int) -> float:
    """Hands like clouds: small steps to one side, the hands circling past the face in turn."""
    score, unit, sign = form.score, form.unit, OUTWARD[side]
    facing = float(score.heading.now[0])
    score.crouch.move(time, time + unit, _LOW)
    for count in range(2):
        # Onto the trailing foot, turned to it, its hand high; the leading foot goes out empty.
        score.weight.move(time, time + 1.0 * unit, -0.92 * sign)
        _cloud_arms(form, time, 1 - side)
        out = time + 0.85 * unit
        place = form.place(side, ahead=0.0, aside=0.46 * sign)
        score.step(side, out, out + 0.75 * unit, place, facing + 0.08 * sign, strike_pitch=0.0)
        flow = out + 0.70 * unit
        score.weight.move(flow, flow + 1.1 * unit, 0.92 * sign)
        _cloud_arms(form, flow, side)
        close = flow + 0.95 * unit
        place = form.place(1 - side, ahead=0.0, aside=-0.20 * sign)
        score.step(1 - side, close, close + 0.70 * unit, place, facing - 0.08 * sign, strike_pitch=0.0)
        time = close + (0.65 if count == 0 else 0.75) * unit
    return time


def _cloud_arms(form: _Form, time: float, over: int) -> None:
    score, unit, sign = form.score, form.unit, OUTWARD[over]
    long = 1.55 * unit
    score.chest.move(time, time + long, [0.62 * sign, 0.03, 0.0])
    score.pelvis.move(time, time + 0.9 * long, [0.34 * sign, 0.03, 0.0])
    score.head.move(time, time + long, [0.55 * sign, 0.06, 0.0])
    score.sweep(over, time, time + long, [-0.18, 0.02, 0.36, 0.95], [0.10, 0.04, 0.40, 0.85])
    score.sweep(1 - over, time, time + long, [0.10, -0.30, 0.32, 0.75], [-0.22, -0.34, 0.28, 0.75])
    score.wrists[over].move(time, time + long, np.radians([-30.0, 5.0]))
    score.wrists[1 - over].move(time, time + long, np.radians([60.0, 5.0]))
