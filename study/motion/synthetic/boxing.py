"""Shadow boxing: guard, jabs, crosses, hooks, slips and small steps, in orthodox stance.

Timing after published measurements: a straight punch takes 0.2-0.3 s to land and about as long to come back, the
hand reaching 6-9 m/s, driven from the rear foot through hips and trunk, which turn first (Turner et al. 2011;
Lenetsky et al. 2013; Dinu & Louis 2020).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from study.arrays import FloatArray
from study.motion.synthetic.curves import running_integral, slow_noise
from study.motion.synthetic.locomotion import grid
from study.motion.synthetic.score import Score, perform
from study.motion.synthetic.targets import LEFT, RIGHT, Targets

_STYLE = {
    "off_pitch": 0.45,
    "heel_off": 0.75,
    "nominal_s": 0.6,
    "swing_knee": 0.70,
    "swing_peak": 0.42,
    "knee": 0.5,
}
_LEFT_PLACE, _RIGHT_PLACE = (0.105, 0.215), (-0.145, -0.205)
_LEFT_YAW, _RIGHT_YAW = np.radians(-22.0), np.radians(-52.0)
_STANCE_YAW = np.radians(-38.0)
_GUARD = ((-0.085, 0.055, 0.300, 0.25), (-0.095, 0.085, 0.225, 0.22))
_COMBINATIONS = (
    ("jab", "cross"),
    ("jab", "jab", "cross"),
    ("jab", "cross", "hook"),
    ("jab", "cross", "hook", "cross"),
    ("jab", "slip_right", "cross", "hook"),
    ("jab", "body_cross", "hook"),
    ("jab", "cross", "duck", "hook", "cross"),
    ("slip_left", "hook", "cross"),
    ("jab", "cross", "slip_left", "hook", "cross"),
)
_SINGLES = (
    ("jab",),
    ("jab", "jab"),
    ("jab", "cross"),
    ("slip_right", "jab"),
    ("duck",),
    ("jab", "duck", "cross"),
    ("jab", "cross", "hook"),
    ("slip_left", "slip_right"),
)


def box(seconds: float, rng: np.random.Generator, *, tempo: float = 1.0) -> Targets:
    """Moving about in guard, with single punches and short combinations between steps."""
    return _bout(seconds, rng, _SINGLES, pause=(0.4, 1.2), tempo=tempo)


def box_combination(seconds: float, rng: np.random.Generator, *, tempo: float = 1.0) -> Targets:
    """Combinations of three to five punches with little rest."""
    return _bout(seconds, rng, _COMBINATIONS, pause=(0.2, 0.7), tempo=tempo)


def _bout(
    seconds: float,
    rng: np.random.Generator,
    phrases: tuple[tuple[str, ...], ...],
    pause: tuple[float, float],
    tempo: float,
) -> Targets:
    times = grid(seconds)
    score = Score(times, dict(_STYLE))
    centre = np.zeros(2)
    score.feet.stand(LEFT, *_LEFT_PLACE, _LEFT_YAW, heel_up=0.05)
    score.feet.stand(RIGHT, *_RIGHT_PLACE, _RIGHT_YAW, heel_up=0.30)
    _take_guard(score)
    time = float(times[0]) + 0.4
    while time < times[-1] - 3.5:
        time, centre = _steps(score, time, centre, rng, tempo)
        for name in phrases[int(rng.integers(len(phrases)))]:
            time = _MOVES[name](score, time, rng, tempo)
        time += float(rng.uniform(*pause)) / tempo * 0.5
        if rng.random() < 0.75:
            time, centre = _steps(score, time, centre, rng, tempo)
        time += float(rng.uniform(*pause)) / tempo * 0.5
    _bounce(score, rng, tempo)
    return perform(score, rng, unrest=1.5)


def _take_guard(score: Score) -> None:
    score.begin(
        crouch=0.075,
        pelvis=[_STANCE_YAW, np.radians(6.0), 0.0],
        chest=[_STANCE_YAW - 0.03, np.radians(12.0), 0.0],
        head=[np.radians(-6.0), np.radians(13.0), 0.0],
    )
    for side in (LEFT, RIGHT):
        score.hands[side].reset(_GUARD[side])
        score.wrists[side].reset(np.radians([10.0, 6.0]))
        score.collars[side].reset(np.radians([5.0, 6.0]))


def _bounce(score: Score, rng: np.random.Generator, tempo: float) -> None:
    """The light rise and fall of someone on the balls of his feet, now stronger, now weaker."""
    rate = 1.75 * tempo * (1.0 + 0.08 * slow_noise(rng, score.times, 1.0)[:, 0])
    size = np.clip(1.0 + 0.5 * slow_noise(rng, score.times, 1.0)[:, 0], 0.2, 2.0)
    beat = 2 * np.pi * running_integral(rate)
    score.crouch.values[:, 0] += 0.014 * size * np.cos(beat)
    score.shift.values[:, 1] += 0.018 * size * np.cos(0.5 * beat)
    score.shift.values[:, 0] += 0.012 * size * np.sin(0.5 * beat)
    # The trunk never holds still: it weaves, and the head goes with it less than the shoulders do.
    weave = np.radians([4.5, 2.5, 3.5]) * slow_noise(rng, score.times, 1.0, 3, (0.25, 0.9))
    score.chest.values += weave
    score.pelvis.values += 0.4 * weave
    score.head.values += 0.3 * weave
    score.shift.values[:, 0] -= 0.20 * weave[:, 2]
    for side in (LEFT, RIGHT):
        lag = 0.6 + 0.3 * side
        score.hands[side].values[:, 1] += 0.007 * size * np.cos(beat - lag)
        score.hands[side].values[:, 2] += 0.008 * size * np.sin(0.5 * beat - lag)
        score.pivots[side].values[:, 1] += 0.03 * (1.0 - np.cos(beat)) * size


def _steps(
    score: Score, time: float, centre: FloatArray, rng: np.random.Generator, tempo: float
) -> tuple[float, FloatArray]:
    """A small step: the foot on the side to which one goes moves first, the other follows to keep the stance."""
    # Back toward the middle of the ring the farther out one is.
    to = np.clip(rng.normal(0.0, [0.16, 0.20]) - 0.40 * centre, -0.28, 0.28)
    first = LEFT if to[1] + 0.6 * to[0] > 0 else RIGHT
    new = centre + to
    long, gap = 0.22 / tempo, 0.13 / tempo
    for index, side in enumerate((first, 1 - first)):
        place = (_LEFT_PLACE, _RIGHT_PLACE)[side]
        yaw = (_LEFT_YAW, _RIGHT_YAW)[side] + rng.normal(0.0, 0.05)
        lift = time + index * (long + 0.3 * gap)
        x, z = new[0] + place[0] + rng.normal(0, 0.012), new[1] + place[1] + rng.normal(0, 0.015)
        score.step(side, lift, lift + long, (x, z), yaw, heel_up=(0.05, 0.30)[side])
        score.weight.move(lift - 0.10, lift + 0.03, 0.45 if side == RIGHT else -0.45)
    end = time + 2 * long + 0.3 * gap
    score.weight.move(end - 0.02, end + 0.22, rng.normal(-0.08, 0.06))
    return end + gap, new


def _jab(score: Score, time: float, rng: np.random.Generator, tempo: float) -> float:
    out, back = 0.17 / tempo, 0.25 / tempo
    hit, end = time + out, time + out + back
    score.chest.visit(time - 0.03, hit, end + 0.05, [_STANCE_YAW - 0.30, np.radians(14.0), np.radians(-3.0)])
    score.pelvis.visit(time - 0.06, hit - 0.02, end + 0.05, [_STANCE_YAW - 0.10, np.radians(7.0), 0.0])
    score.shift.visit(time - 0.05, hit, end + 0.1, [0.01, 0.045])
    _strike(score, LEFT, time, hit, end, [0.03 + rng.normal(0, 0.02), 0.185 + rng.normal(0, 0.02), 0.82])
    score.hands[RIGHT].visit(time, hit, end, [-0.11, 0.10, 0.20, 0.18])
    return end - 0.04 + float(rng.uniform(0.0, 0.08))


def _cross(score: Score, time: float, rng: np.random.Generator, tempo: float, height: float = 0.18) -> float:
    out, back = 0.21 / tempo, 0.30 / tempo
    hit, end = time + out, time + out + back
    dip = 0.0 if height > 0.1 else 0.09
    # From the floor up: heel and hip turn first, then the trunk, then the arm.
    score.pivots[RIGHT].visit(time - 0.08, hit - 0.02, end + 0.08, [np.radians(34.0), 0.28])
    score.pelvis.visit(time - 0.06, hit - 0.01, end + 0.06, [np.radians(6.0), np.radians(8.0), 0.0])
    score.chest.visit(time - 0.02, hit, end + 0.05, [np.radians(30.0), np.radians(15.0) + 2 * dip, np.radians(3.0)])
    score.weight.visit(time - 0.08, hit, end + 0.12, 0.38)
    score.crouch.visit(time - 0.10, hit, end + 0.10, 0.09 + dip)
    _strike(score, RIGHT, time, hit, end, [0.0 + rng.normal(0, 0.02), height + rng.normal(0, 0.02), 0.80])
    score.hands[LEFT].visit(time, hit, end, [-0.07, 0.075, 0.22, 0.22])
    return end - 0.06 + float(rng.uniform(0.0, 0.08))


def _hook(score: Score, time: float, rng: np.random.Generator, tempo: float) -> float:
    load, out, back = 0.12 / tempo, 0.17 / tempo, 0.30 / tempo
    start, hit, end = time + load, time + load + out, time + load + out + back
    score.chest.move(time - 0.04, start, [np.radians(-12.0), np.radians(13.0), np.radians(-2.0)])
    score.chest.move(start - 0.02, hit + 0.02, [np.radians(-72.0), np.radians(11.0), np.radians(3.0)])
    score.chest.move(hit + 0.02, end + 0.06, [_STANCE_YAW - 0.03, np.radians(12.0), 0.0])
    score.pelvis.move(time - 0.06, start - 0.02, [np.radians(-24.0), np.radians(6.0), 0.0])
    score.pelvis.move(start - 0.05, hit, [np.radians(-56.0), np.radians(6.0), 0.0])
    score.pelvis.move(hit + 0.02, end + 0.06, [_STANCE_YAW, np.radians(6.0), 0.0])
    score.pivots[LEFT].visit(start - 0.05, hit, end + 0.08, [np.radians(-34.0), 0.30])
    score.weight.move(time - 0.04, start, 0.25)
    score.weight.move(start, hit, -0.28)
    score.weight.move(hit, end + 0.1, -0.08)
    # The elbow comes up beside the fist, bent at a right angle, and the trunk carries both round.
    left = score.hands[LEFT]
    left.move(time, start, [0.10, 0.02, 0.27, 1.10])
    left.move(start - 0.03, hit, [-0.13, 0.055, 0.40, 1.42])
    left.move(hit + 0.01, end, _GUARD[LEFT])
    score.hands[RIGHT].visit(time, hit, end, [-0.10, 0.11, 0.19, 0.15])
    return end - 0.05 + float(rng.uniform(0.0, 0.08))


def _slip(score: Score, time: float, rng: np.random.Generator, tempo: float, toward: float) -> float:
    """The head leaves the line of a punch: the knees give, the trunk tilts and turns, the eyes stay in front."""
    long = 0.42 / tempo
    top, end = time + 0.45 * long, time + long
    size = float(rng.uniform(0.8, 1.15))
    tilt, turn = -toward * np.radians(13.0) * size, toward * np.radians(15.0) * size
    score.chest.visit(time, top, end + 0.06, [_STANCE_YAW + turn, np.radians(17.0), tilt])
    score.pelvis.visit(time - 0.03, top, end + 0.06, [_STANCE_YAW + 0.5 * turn, np.radians(8.0), 0.3 * tilt])
    score.head.visit(time, top, end, [np.radians(-6.0), np.radians(11.0), 0.5 * tilt])
    score.shift.visit(time, top, end + 0.05, [0.055 * toward * size, 0.0])
    score.crouch.visit(time, top, end + 0.05, 0.075 + 0.065 * size)
    return end - 0.08


def _duck(score: Score, time: float, rng: np.random.Generator, tempo: float) -> float:
    """Under a swing: the knees bend deep, the back leans, the head passes from one side to the other."""
    down, up = 0.30 / tempo, 0.36 / tempo
    low, end = time + down, time + down + up
    toward = 1.0 if rng.random() < 0.5 else -1.0
    deep = 0.075 + float(rng.uniform(0.15, 0.21))
    score.crouch.visit(time, low, end + 0.08, deep)
    score.chest.move(time, low, [_STANCE_YAW + 0.10 * toward, np.radians(32.0), -toward * np.radians(9.0)])
    score.chest.move(low - 0.08, end, [_STANCE_YAW - 0.10 * toward, np.radians(18.0), toward * np.radians(9.0)])
    score.chest.move(end - 0.06, end + 0.25, [_STANCE_YAW - 0.03, np.radians(12.0), 0.0])
    score.head.visit(time, low, end, [np.radians(-6.0), np.radians(16.0), 0.0])
    score.shift.visit(time, low, end, [0.05 * toward, -0.02])
    return end


def _strike(score: Score, side: int, time: float, hit: float, end: float, aim: list[float]) -> None:
    """A straight punch: the hand goes to its aim and back, the fist turns over, the shoulder follows."""
    score.aims[side].move(time - 0.02, time + 0.05, aim)
    score.aimed[side].visit(time, hit, end, 1.0)
    score.wrists[side].visit(time + 0.03, hit, end, np.radians([85.0, 0.0]))
    score.collars[side].visit(time, hit, end, np.radians([9.0, 20.0]))


_MOVES: dict[str, Callable[[Score, float, np.random.Generator, float], float]] = {
    "jab": _jab,
    "cross": _cross,
    "body_cross": partial(_cross, height=0.0),
    "hook": _hook,
    "duck": _duck,
    "slip_left": partial(_slip, toward=1.0),
    "slip_right": partial(_slip, toward=-1.0),
}
