"""Dancing: a groove on the beat, a slow modern phrase, and turns.

Dancers bounce at the beat with the low point on it, shift the trunk and pelvis at half its rate, and swing the arms
at a quarter to a half (Burger et al. 2013; Toiviainen et al. 2010); popular dance music has about 120 beats a minute
(Moelants 2002). Each motion strings figures of eight beats, drawn by the seed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from study.motion.synthetic.curves import slow_noise
from study.motion.synthetic.locomotion import grid
from study.motion.synthetic.score import Score, perform
from study.motion.synthetic.targets import LEFT, OUTWARD, RIGHT, Targets

FloatArray = NDArray[np.float64]

_STYLE = {
    "off_pitch": 0.55,
    "heel_off": 0.7,
    "nominal_s": 0.5,
    "swing_knee": 0.85,
    "swing_peak": 0.42,
    "knee": 0.3,
}
_TOE_OUT = np.radians(11.0)
_HALF = 0.11

# Hands against the shoulder: outward, up, ahead; and the elbow's angle outward.
_LOW = (0.10, -0.46, 0.16, 0.35)
_WAIST = (0.09, -0.27, 0.27, 0.55)
_SIDE = (0.54, -0.02, 0.15, 0.95)
_HIGH = (0.15, 0.54, 0.09, 1.40)
_ROUND = (-0.06, -0.10, 0.38, 1.00)
_OPEN = (0.40, 0.30, 0.14, 1.25)
_CHEST = (-0.10, -0.08, 0.24, 0.90)


@dataclass
class _Dancer:
    """The score under way: where the middle of the feet is, and which foot is free."""

    score: Score
    rng: np.random.Generator
    beat: float
    x: float = 0.0
    z: float = 0.0

    def place(self, side: int, spread: float = _HALF, ahead: float = 0.0) -> tuple[float, float]:
        jitter = self.rng.normal(0.0, 0.008, 2)
        return self.x + OUTWARD[side] * spread + jitter[0], self.z + ahead + jitter[1]

    def step(self, side: int, on: float, spread: float = _HALF, ahead: float = 0.0, bear: float = 0.75) -> None:
        """Set a foot down on a beat and go over it."""
        toe_out = OUTWARD[side] * (_TOE_OUT + self.rng.normal(0, 0.05))
        self.score.step(side, on - 0.62 * self.beat, on - 0.04, self.place(side, spread, ahead), toe_out)
        self.score.weight.move(on - 0.45 * self.beat, on + 0.42 * self.beat, OUTWARD[side] * bear)


def dance(seconds: float, rng: np.random.Generator, *, beats_per_minute: float = 116.0) -> Targets:
    """A groove: step-touches, grapevines, hip sways, twists and points, bouncing on the beat."""
    dancer = _dancer(seconds, rng, beats_per_minute)
    time = _first_beat(dancer)
    figures = [_step_touch, _grapevine, _sway_high, _twist, _points]
    order: list[int] = []
    while time < dancer.score.times[-1] - 9 * dancer.beat:
        if not order:
            order = [int(k) for k in rng.permutation(len(figures))]
        figures[order.pop()](dancer, time)
        time += 8 * dancer.beat
    _groove(dancer)
    return perform(dancer.score, rng, unrest=1.3)


def dance_modern(seconds: float, rng: np.random.Generator, *, beats_per_minute: float = 84.0) -> Targets:
    """Long lines and falls: lunges with sweeping arms, contractions, arches, slow lifts of a leg."""
    dancer = _dancer(seconds, rng, beats_per_minute)
    time = _first_beat(dancer)
    figures = [_lunge, _contract, _lunge, _lift, _circle]
    order: list[int] = []
    first = int(rng.integers(2))
    while time < dancer.score.times[-1] - 6 * dancer.beat:
        if not order:
            order = [int(k) for k in rng.permutation(len(figures))]
        figures[order.pop()](dancer, time, first)
        first = 1 - first
        time += 4 * dancer.beat
    return perform(dancer.score, rng, unrest=1.5)


def dance_turns(seconds: float, rng: np.random.Generator, *, beats_per_minute: float = 100.0) -> Targets:
    """Whole turns in three steps to alternating sides, with opened and gathered arms, and sways between them."""
    dancer = _dancer(seconds, rng, beats_per_minute)
    time = _first_beat(dancer)
    side = int(rng.integers(2))
    while time < dancer.score.times[-1] - 9 * dancer.beat:
        _three_step_turn(dancer, time, side)
        _balance(dancer, time + 4 * dancer.beat, 1 - side)
        side = 1 - side
        time += 8 * dancer.beat
    _groove(dancer, bounce=0.4)
    return perform(dancer.score, rng, unrest=1.2)


def _dancer(seconds: float, rng: np.random.Generator, beats_per_minute: float) -> _Dancer:
    score = Score(grid(seconds), dict(_STYLE))
    dancer = _Dancer(score, rng, 60.0 / float(np.clip(beats_per_minute, 40.0, 180.0)))
    for side in (LEFT, RIGHT):
        x, z = dancer.place(side)
        score.feet.stand(side, x, z, OUTWARD[side] * _TOE_OUT)
        score.hands[side].reset(_LOW)
    score.begin(crouch=0.025, chest=[0.0, np.radians(2.0), 0.0], head=[0.0, np.radians(3.0), 0.0])
    return dancer


def _first_beat(dancer: _Dancer) -> float:
    return float(dancer.score.times[0]) + 1.2


def _groove(dancer: _Dancer, bounce: float = 1.0) -> None:
    """The bounce on every beat, and the give-and-take of chest, head and shoulders that goes with it."""
    score, rng = dancer.score, dancer.rng
    beat = 2 * np.pi * (score.times - _first_beat(dancer)) / dancer.beat
    size = bounce * np.clip(1.0 + 0.25 * slow_noise(rng, score.times, 1.0)[:, 0], 0.4, 1.6)
    score.crouch.values[:, 0] += size * (0.020 + 0.018 * np.cos(beat) + 0.003 * np.cos(2 * beat))
    score.chest.values[:, 1] += size * np.radians(2.2) * np.cos(beat - 0.5)
    score.head.values[:, 1] += size * np.radians(3.0) * np.cos(beat - 0.9)
    score.pelvis.values[:, 1] -= size * np.radians(2.0) * np.cos(beat - 0.2)
    for side in (LEFT, RIGHT):
        lag = 0.7 + 0.25 * side
        score.hands[side].values[:, 1] -= 0.018 * size * np.cos(beat - lag)
        score.collars[side].values[:, 0] -= size * np.radians(2.0) * np.cos(beat - 0.4)


def _hips(dancer: _Dancer, on: float, toward: int, size: float = 1.0) -> None:
    """The hip goes out and up over the foot that bears; the chest stays, tilting against it."""
    score, half, sign = dancer.score, 0.5 * dancer.beat, OUTWARD[toward]
    score.pelvis.move(on - half, on + half, [sign * 0.10 * size, 0.02, sign * np.radians(7.0) * size])
    score.chest.move(on - 0.8 * half, on + 1.1 * half, [-sign * 0.10 * size, 0.035, -sign * np.radians(4.0) * size])
    score.head.move(on - 0.6 * half, on + 1.2 * half, [sign * 0.10 * size, 0.05, sign * np.radians(3.0) * size])
    score.shift.move(on - half, on + half, [sign * 0.025 * size, 0.0])


def _arms(dancer: _Dancer, on: float, left: tuple[float, ...], right: tuple[float, ...], long: float = 0.8) -> None:
    """Both hands arrive at a place a little after a beat, neither at the same time nor quite where it should."""
    for side, to in ((LEFT, left), (RIGHT, right)):
        late = dancer.rng.uniform(0.0, 0.10)
        aim = np.asarray(to) + dancer.rng.normal(0.0, [0.012, 0.015, 0.012, 0.04])
        dancer.score.hands[side].move(on - long * dancer.beat + late, on + 0.12 + late, aim)


def _step_touch(dancer: _Dancer, time: float) -> None:
    side = int(dancer.rng.integers(2))
    for count in range(4):
        on, sign = time + 2 * count * dancer.beat, OUTWARD[side]
        dancer.x += sign * 0.20
        dancer.step(side, on, 0.13)
        _hips(dancer, on, side)
        dancer.step(1 - side, on + dancer.beat, 0.03 - 0.04, bear=-0.55)
        _hips(dancer, on + dancer.beat, side, 0.5)
        near, far = (0.32, -0.22, 0.22, 0.8), (-0.16, -0.24, 0.26, 0.7)
        _arms(dancer, on, near if side == LEFT else far, near if side == RIGHT else far)
        _arms(dancer, on + dancer.beat, _WAIST, _WAIST)
        side = 1 - side


def _grapevine(dancer: _Dancer, time: float) -> None:
    side = int(dancer.rng.integers(2))
    for half in range(2):
        sign, start = OUTWARD[side], time + 4 * half * dancer.beat
        for count in range(4):
            on = start + count * dancer.beat
            foot = side if count % 2 == 0 else 1 - side
            if count < 3:
                dancer.x += sign * (0.16 if count != 1 else 0.14)
            behind = -0.13 if count == 1 else 0.0
            spread = -0.06 if count == 1 else (0.02 if count == 3 else 0.10)
            dancer.step(foot, on, spread, behind, bear=-0.5 if count == 3 else 0.75)
            _hips(dancer, on, foot if count < 3 else side, 0.6)
            _arms(dancer, on, _SIDE if count % 2 == 0 else _WAIST, _SIDE if count % 2 == 0 else _WAIST)
        side = 1 - side


def _sway_high(dancer: _Dancer, time: float) -> None:
    score = dancer.score
    dancer.step(RIGHT, time, 0.17)
    dancer.step(LEFT, time + dancer.beat, 0.17)
    for side in (LEFT, RIGHT):
        score.sweep(side, time - 0.3 * dancer.beat, time + 1.6 * dancer.beat, _OPEN, _HIGH)
    side = LEFT
    for count in range(2, 8):
        on, sign = time + count * dancer.beat, OUTWARD[side]
        score.weight.move(on - 0.5 * dancer.beat, on + 0.5 * dancer.beat, 0.55 * sign)
        _hips(dancer, on, side, 1.35)
        lean = 0.13 * sign
        _arms(
            dancer,
            on,
            (0.16 + lean, 0.52 - 0.05 * (count % 2), 0.10, 1.40),
            (0.16 - lean, 0.47 + 0.05 * (count % 2), 0.10, 1.40),
        )
        side = 1 - side
    end = time + 8 * dancer.beat
    for side in (LEFT, RIGHT):
        score.sweep(side, end - 1.0 * dancer.beat, end + 0.5 * dancer.beat, _SIDE, _WAIST)


def _twist(dancer: _Dancer, time: float) -> None:
    score = dancer.score
    score.weight.move(time - 0.5 * dancer.beat, time + 0.4 * dancer.beat, 0.0)
    score.crouch.move(time - 0.5 * dancer.beat, time + dancer.beat, 0.055)
    for count in range(8):
        on = time + count * dancer.beat
        sign = 1.0 if count % 2 == 0 else -1.0
        start, stop = on - 0.45 * dancer.beat, on + 0.15 * dancer.beat
        angle = np.radians(24.0) * sign if count < 7 else 0.0
        for side in (LEFT, RIGHT):
            score.pivots[side].move(start, stop, [angle, 0.20 if count < 7 else 0.0])
        score.pelvis.move(start, stop, [0.9 * angle, 0.04, np.radians(2.0) * sign])
        score.chest.move(start, stop + 0.05, [-0.7 * angle, 0.06, -np.radians(2.0) * sign])
        score.weight.move(start, stop, 0.25 * sign)
        fore, back = (0.06, -0.18, 0.34, 0.5), (0.10, -0.30, 0.06, 0.5)
        _arms(dancer, on, fore if sign > 0 else back, back if sign > 0 else fore, long=0.55)
    score.crouch.move(time + 7 * dancer.beat, time + 8 * dancer.beat, 0.025)


def _points(dancer: _Dancer, time: float) -> None:
    side = int(dancer.rng.integers(2))
    score = dancer.score
    dancer.step(side, time, 0.20)
    for count in range(4):
        on, sign = time + 2 * count * dancer.beat, OUTWARD[side]
        other = 1 - side
        score.weight.move(on - 0.5 * dancer.beat, on + 0.4 * dancer.beat, 0.6 * sign)
        _hips(dancer, on, side, 1.2)
        # By way of the front, so that the hand keeps clear of its shoulder.
        ahead = [0.10, 0.08, 0.40, 0.95]
        score.sweep(side, on - 0.8 * dancer.beat, on + 0.15, ahead, [0.36, 0.45, 0.10, 1.2])
        score.hands[other].move(on - 0.6 * dancer.beat, on + 0.15, [0.10, -0.33, 0.10, 0.8])
        down = on + dancer.beat
        _hips(dancer, down, other, 0.7)
        score.weight.move(down - 0.5 * dancer.beat, down + 0.4 * dancer.beat, -0.3 * sign)
        score.sweep(side, down - 0.65 * dancer.beat, down + 0.18, ahead, [-0.20, -0.22, 0.30, 0.7])
        if count == 1:
            score.hands[side].move(down + 0.2, down + dancer.beat, _WAIST)
            side = other
            dancer.step(side, on + 2 * dancer.beat, 0.20)
    for hand in (LEFT, RIGHT):
        score.hands[hand].move(time + 7.2 * dancer.beat, time + 8.2 * dancer.beat, _WAIST)


def _lunge(dancer: _Dancer, time: float, side: int) -> None:
    """A wide step into a bent knee, one arm up and one out, and back over the feet."""
    score, beat, sign = dancer.score, dancer.beat, OUTWARD[side]
    far = dancer.rng.uniform(0.52, 0.64)
    ahead = dancer.rng.uniform(-0.05, 0.20)
    score.step(side, time, time + 0.95 * beat, dancer.place(side, far, ahead), sign * np.radians(38.0), swing_knee=1.1)
    score.weight.move(time + 0.4 * beat, time + 1.7 * beat, 0.62 * sign)
    score.crouch.move(time + 0.3 * beat, time + 1.7 * beat, 0.13)
    score.pelvis.move(time + 0.2 * beat, time + 1.7 * beat, [sign * 0.35, 0.05, sign * 0.03])
    score.chest.move(time + 0.3 * beat, time + 1.9 * beat, [sign * 0.55, 0.06, -sign * 0.16])
    score.head.move(time + 0.5 * beat, time + 2.0 * beat, [sign * 0.75, -0.12, -sign * 0.05])
    score.sweep(side, time, time + 1.9 * beat, [0.45, -0.05, 0.30, 1.0], [0.30, 0.50, 0.10, 1.3])
    score.sweep(1 - side, time + 0.15 * beat, time + 2.0 * beat, [0.20, -0.35, 0.35, 0.9], [0.56, 0.06, -0.03, 1.0])
    back = time + 2.3 * beat
    score.step(side, back, back + 0.9 * beat, dancer.place(side), sign * _TOE_OUT, swing_knee=0.9)
    score.weight.move(back - 0.6 * beat, back + 0.2 * beat, -0.72 * sign)
    score.weight.move(back + 0.6 * beat, back + 1.4 * beat, 0.0)
    score.crouch.move(back - 0.3 * beat, back + 1.0 * beat, 0.03)
    score.pelvis.move(back - 0.3 * beat, back + 1.0 * beat, [0.0, 0.0, 0.0])
    score.chest.move(back - 0.3 * beat, back + 1.2 * beat, [0.0, 0.03, 0.0])
    score.head.move(back - 0.2 * beat, back + 1.3 * beat, [0.0, 0.05, 0.0])
    score.sweep(side, back - 0.3 * beat, back + 1.4 * beat, _SIDE, _LOW)
    score.sweep(1 - side, back - 0.2 * beat, back + 1.5 * beat, [0.34, -0.30, 0.22, 0.7], _LOW)


def _contract(dancer: _Dancer, time: float, side: int) -> None:
    """Down and in, the back round; then up and open, the chest arched."""
    score, beat = dancer.score, dancer.beat
    sign = OUTWARD[side]
    score.crouch.move(time, time + 1.5 * beat, 0.22)
    score.pelvis.move(time, time + 1.4 * beat, [0.08 * sign, -0.18, 0.0])
    score.chest.move(time + 0.1 * beat, time + 1.5 * beat, [0.14 * sign, 0.62, 0.06 * sign])
    score.head.move(time + 0.2 * beat, time + 1.6 * beat, [0.10 * sign, 0.75, 0.05 * sign])
    score.shift.move(time, time + 1.5 * beat, [0.0, -0.05])
    for hand in (LEFT, RIGHT):
        score.sweep(hand, time + 0.05 * hand, time + 1.5 * beat, [0.25, -0.20, 0.30, 0.9], _CHEST)
    up = time + 1.9 * beat
    score.crouch.move(up - 0.2 * beat, up + 1.3 * beat, 0.015)
    score.shift.move(up - 0.2 * beat, up + 1.1 * beat, [0.0, 0.02])
    score.pelvis.move(up - 0.1 * beat, up + 1.2 * beat, [0.0, 0.06, 0.0])
    score.chest.move(up, up + 1.4 * beat, [0.0, -0.20, 0.0])
    score.head.move(up + 0.2 * beat, up + 1.6 * beat, [0.0, -0.38, 0.0])
    for hand in (LEFT, RIGHT):
        score.sweep(hand, up + 0.08 * hand, up + 1.5 * beat, [0.10, 0.18, 0.36, 1.1], [0.28, 0.50, 0.04, 1.35])
        score.sweep(hand, up + 1.4 * beat, up + 2.6 * beat, _SIDE, _LOW)
    score.chest.move(up + 1.4 * beat, up + 2.3 * beat, [0.0, 0.03, 0.0])
    score.head.move(up + 1.4 * beat, up + 2.4 * beat, [0.0, 0.05, 0.0])
    score.crouch.move(up + 1.4 * beat, up + 2.2 * beat, 0.03)


def _lift(dancer: _Dancer, time: float, side: int) -> None:
    """All the weight on one leg; the other knee is drawn up high and set down again, the arms opening."""
    score, beat, sign = dancer.score, dancer.beat, OUTWARD[side]
    score.weight.move(time - 0.3 * beat, time + 0.6 * beat, -0.97 * sign)
    score.crouch.move(time, time + 1.2 * beat, 0.012)
    score.pelvis.move(time + 0.2 * beat, time + 1.4 * beat, [0.12 * sign, -0.05, 0.06 * sign])
    score.chest.move(time + 0.2 * beat, time + 1.6 * beat, [0.20 * sign, -0.03, -0.05 * sign])
    ahead = float(dancer.rng.uniform(0.02, 0.12))
    score.step(
        side,
        time + 0.7 * beat,
        time + 2.9 * beat,
        dancer.place(side, ahead=ahead),
        sign * _TOE_OUT,
        heel_up=0.0,
    )
    score.feet.raise_last_swing(side, knee=1.75, peak=0.5, reach=0.62)
    score.sweep(side, time + 0.1 * beat, time + 1.8 * beat, [0.30, -0.20, 0.35, 0.9], _SIDE)
    score.sweep(1 - side, time + 0.2 * beat, time + 1.9 * beat, [0.25, 0.0, 0.42, 1.0], _HIGH)
    score.head.move(time + 0.5 * beat, time + 1.8 * beat, [-0.25 * sign, -0.10, 0.0])
    down = time + 2.7 * beat
    score.weight.move(down, down + 1.2 * beat, 0.0)
    score.crouch.move(down - 0.3 * beat, down + 0.9 * beat, 0.04)
    score.pelvis.move(down - 0.6 * beat, down + 0.8 * beat, [0.0, 0.0, 0.0])
    score.chest.move(down - 0.5 * beat, down + 0.9 * beat, [0.0, 0.03, 0.0])
    score.head.move(down - 0.5 * beat, down + 0.9 * beat, [0.0, 0.05, 0.0])
    score.sweep(side, down - 0.5 * beat, down + 1.0 * beat, [0.34, -0.30, 0.22, 0.7], _LOW)
    score.sweep(1 - side, down - 0.6 * beat, down + 1.1 * beat, _SIDE, _LOW)


def _circle(dancer: _Dancer, time: float, side: int) -> None:
    """The trunk circles over wide feet, the arms trailing it."""
    score, beat, sign = dancer.score, dancer.beat, OUTWARD[side]
    wide = 0.24
    score.step(side, time - 0.1 * beat, time + 0.6 * beat, dancer.place(side, wide), sign * 0.45)
    score.crouch.move(time, time + 1.0 * beat, 0.085)
    for quarter, (pitch, roll, lean) in enumerate(((0.10, 0.34, -0.5), (0.52, 0.0, 0.0), (0.10, -0.34, 0.5))):
        start = time + (0.3 + 0.95 * quarter) * beat
        score.chest.move(start, start + 1.3 * beat, [-0.35 * roll * sign, pitch, roll * sign])
        score.head.move(start + 0.1 * beat, start + 1.4 * beat, [-0.4 * roll * sign, 0.8 * pitch, 0.9 * roll * sign])
        score.weight.move(start, start + 1.3 * beat, lean * sign)
    for hand, late in ((side, 0.2), (1 - side, 0.35)):
        score.sweep(hand, time + late * beat, time + 1.8 * beat, _OPEN, [0.10, 0.40, 0.30, 1.2])
        score.sweep(
            hand, time + (1.6 + late) * beat, time + 3.2 * beat, [0.0, -0.15, 0.44, 0.9], [0.42, -0.20, 0.20, 0.8]
        )
        score.hands[hand].move(time + 3.1 * beat, time + 4.2 * beat, _LOW)
    end = time + 3.3 * beat
    score.chest.move(end, end + 1.0 * beat, [0.0, 0.03, 0.0])
    score.head.move(end, end + 1.1 * beat, [0.0, 0.05, 0.0])
    score.weight.move(end - 0.3 * beat, end + 0.3 * beat, -0.7 * sign)
    score.step(side, end + 0.1 * beat, end + 0.75 * beat, dancer.place(side), sign * _TOE_OUT)
    score.weight.move(end + 0.5 * beat, end + 1.2 * beat, 0.0)
    score.crouch.move(end, end + 1.0 * beat, 0.03)


def _three_step_turn(dancer: _Dancer, time: float, side: int) -> None:
    """Once round to a side in three steps: out, round with the back to the front, and on."""
    score, beat = dancer.score, dancer.beat
    sign = OUTWARD[side]
    facing = float(score.heading.now[0])
    whole = sign * 2 * np.pi
    score.crouch.move(time - 1.2 * beat, time - 0.3 * beat, 0.06)
    score.chest.move(time - 1.2 * beat, time - 0.3 * beat, [-0.30 * sign, 0.03, 0.0])
    score.chest.move(time - 0.3 * beat, time + 0.7 * beat, [0.22 * sign, 0.0, 0.0])
    score.crouch.move(time - 0.3 * beat, time + 0.8 * beat, 0.012)
    # Hands gather as the turn gets under way and open at its end.
    score.hands[side].move(time - 1.2 * beat, time - 0.2 * beat, _ROUND)
    score.hands[1 - side].move(time - 1.1 * beat, time - 0.1 * beat, _SIDE)
    for hand in (LEFT, RIGHT):
        score.hands[hand].move(time + (0.0 + 0.12 * hand) * beat, time + 1.2 * beat, _ROUND)
        score.hands[hand].move(time + (2.0 + 0.10 * hand) * beat, time + 3.3 * beat, _SIDE)
    travel = (0.32, 0.30, 0.32)
    feet = (side, 1 - side, side)
    turned = (0.25, 0.75, 1.0)
    for count in range(3):
        on = time + count * beat
        foot = feet[count]
        dancer.x += sign * travel[count]
        yaw = facing + whole * turned[count] + OUTWARD[foot] * 0.10
        place = (dancer.x + dancer.rng.normal(0, 0.01), dancer.z + dancer.rng.normal(0, 0.01))
        score.step(foot, on - 0.62 * beat, on - 0.06, place, yaw, heel_up=0.22, off_pitch=0.5)
        score.weight.move(on - 0.5 * beat, on + 0.15 * beat, OUTWARD[foot] * 0.92)
        if count < 2:
            score.pivot(foot, on + 0.02, on + 0.72 * beat, whole * (0.33 if count == 0 else 0.22), heel=0.12)
    score.heading.move(time - 0.9 * beat, time + 1.95 * beat, facing + whole)
    # The head stays behind, then snaps round ahead of the body (spotting).
    score.head.move(time - 0.4 * beat, time + 0.75 * beat, [-0.75 * sign, 0.02, 0.0])
    score.head.move(time + 0.75 * beat, time + 1.45 * beat, [0.65 * sign, 0.02, 0.0])
    score.head.move(time + 1.45 * beat, time + 2.5 * beat, [0.0, 0.04, 0.0])
    score.chest.move(time + 1.8 * beat, time + 2.8 * beat, [0.0, 0.03, 0.0])
    other, on = 1 - side, time + 3 * beat
    place = (dancer.x - sign * 0.13, dancer.z + 0.01)
    score.step(other, on - 0.62 * beat, on, place, facing + whole + OUTWARD[other] * _TOE_OUT)
    score.weight.move(on - 0.1 * beat, on + 0.7 * beat, sign * 0.2)
    score.crouch.move(on - 0.4 * beat, on + 0.6 * beat, 0.045)
    dancer.x -= sign * 0.065


def _balance(dancer: _Dancer, time: float, side: int) -> None:
    """Sways from foot to foot in place, arms passing low, ready for the next turn."""
    score, beat = dancer.score, dancer.beat
    facing = float(score.heading.now[0])
    for count in range(3):
        on, sign = time + count * beat, OUTWARD[side]
        toe_out = facing + sign * _TOE_OUT
        score.step(side, on - 0.6 * beat, on - 0.05, dancer.place(side, 0.15), toe_out)
        score.weight.move(on - 0.5 * beat, on + 0.45 * beat, 0.7 * sign)
        _hips(dancer, on, side, 0.8)
        near, far = (0.48, 0.12, 0.20, 1.0), (0.02, -0.14, 0.40, 0.9)
        _arms(dancer, on, near if side == LEFT else far, near if side == RIGHT else far, long=0.9)
        side = 1 - side
