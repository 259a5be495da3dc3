"""A slow modern phrase: lunges with sweeping arms, contractions, arches and slow lifts of a leg, four beats each."""

from __future__ import annotations

import numpy as np

from study.motion.synthetic.dancer import CHEST, HIGH, LOW, OPEN, SIDE, TOE_OUT, Dancer, new_dancer, phrases
from study.motion.synthetic.score import perform
from study.motion.synthetic.targets import LEFT, OUTWARD, RIGHT, Targets


def dance_modern(seconds: float, rng: np.random.Generator, *, beats_per_minute: float = 84.0) -> Targets:
    """Long lines and falls: lunges with sweeping arms, contractions, arches, slow lifts of a leg."""
    dancer = new_dancer(seconds, rng, beats_per_minute)
    side = int(rng.integers(2))
    for figure, time in phrases(dancer, (_lunge, _contract, _lunge, _lift, _circle), 4, 6):
        figure(dancer, time, side)
        side = 1 - side
    return perform(dancer.score, rng, unrest=1.5)


def _lunge(dancer: Dancer, time: float, side: int) -> None:
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
    score.step(side, back, back + 0.9 * beat, dancer.place(side), sign * TOE_OUT, swing_knee=0.9)
    score.weight.move(back - 0.6 * beat, back + 0.2 * beat, -0.72 * sign)
    score.weight.move(back + 0.6 * beat, back + 1.4 * beat, 0.0)
    score.crouch.move(back - 0.3 * beat, back + 1.0 * beat, 0.03)
    score.pelvis.move(back - 0.3 * beat, back + 1.0 * beat, [0.0, 0.0, 0.0])
    score.chest.move(back - 0.3 * beat, back + 1.2 * beat, [0.0, 0.03, 0.0])
    score.head.move(back - 0.2 * beat, back + 1.3 * beat, [0.0, 0.05, 0.0])
    score.sweep(side, back - 0.3 * beat, back + 1.4 * beat, SIDE, LOW)
    score.sweep(1 - side, back - 0.2 * beat, back + 1.5 * beat, [0.34, -0.30, 0.22, 0.7], LOW)


def _contract(dancer: Dancer, time: float, side: int) -> None:
    """Down and in, the back round; then up and open, the chest arched."""
    score, beat = dancer.score, dancer.beat
    sign = OUTWARD[side]
    score.crouch.move(time, time + 1.5 * beat, 0.22)
    score.pelvis.move(time, time + 1.4 * beat, [0.08 * sign, -0.18, 0.0])
    score.chest.move(time + 0.1 * beat, time + 1.5 * beat, [0.14 * sign, 0.62, 0.06 * sign])
    score.head.move(time + 0.2 * beat, time + 1.6 * beat, [0.10 * sign, 0.75, 0.05 * sign])
    score.shift.move(time, time + 1.5 * beat, [0.0, -0.05])
    for hand in (LEFT, RIGHT):
        score.sweep(hand, time + 0.05 * hand, time + 1.5 * beat, [0.25, -0.20, 0.30, 0.9], CHEST)
    up = time + 1.9 * beat
    score.crouch.move(up - 0.2 * beat, up + 1.3 * beat, 0.015)
    score.shift.move(up - 0.2 * beat, up + 1.1 * beat, [0.0, 0.02])
    score.pelvis.move(up - 0.1 * beat, up + 1.2 * beat, [0.0, 0.06, 0.0])
    score.chest.move(up, up + 1.4 * beat, [0.0, -0.20, 0.0])
    score.head.move(up + 0.2 * beat, up + 1.6 * beat, [0.0, -0.38, 0.0])
    for hand in (LEFT, RIGHT):
        score.sweep(hand, up + 0.08 * hand, up + 1.5 * beat, [0.10, 0.18, 0.36, 1.1], [0.28, 0.50, 0.04, 1.35])
        score.sweep(hand, up + 1.4 * beat, up + 2.6 * beat, SIDE, LOW)
    score.chest.move(up + 1.4 * beat, up + 2.3 * beat, [0.0, 0.03, 0.0])
    score.head.move(up + 1.4 * beat, up + 2.4 * beat, [0.0, 0.05, 0.0])
    score.crouch.move(up + 1.4 * beat, up + 2.2 * beat, 0.03)


def _lift(dancer: Dancer, time: float, side: int) -> None:
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
        sign * TOE_OUT,
        heel_up=0.0,
    )
    score.feet.raise_last_swing(side, knee=1.75, peak=0.5, reach=0.62)
    score.sweep(side, time + 0.1 * beat, time + 1.8 * beat, [0.30, -0.20, 0.35, 0.9], SIDE)
    score.sweep(1 - side, time + 0.2 * beat, time + 1.9 * beat, [0.25, 0.0, 0.42, 1.0], HIGH)
    score.head.move(time + 0.5 * beat, time + 1.8 * beat, [-0.25 * sign, -0.10, 0.0])
    down = time + 2.7 * beat
    score.weight.move(down, down + 1.2 * beat, 0.0)
    score.crouch.move(down - 0.3 * beat, down + 0.9 * beat, 0.04)
    score.pelvis.move(down - 0.6 * beat, down + 0.8 * beat, [0.0, 0.0, 0.0])
    score.chest.move(down - 0.5 * beat, down + 0.9 * beat, [0.0, 0.03, 0.0])
    score.head.move(down - 0.5 * beat, down + 0.9 * beat, [0.0, 0.05, 0.0])
    score.sweep(side, down - 0.5 * beat, down + 1.0 * beat, [0.34, -0.30, 0.22, 0.7], LOW)
    score.sweep(1 - side, down - 0.6 * beat, down + 1.1 * beat, SIDE, LOW)


def _circle(dancer: Dancer, time: float, side: int) -> None:
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
        score.sweep(hand, time + late * beat, time + 1.8 * beat, OPEN, [0.10, 0.40, 0.30, 1.2])
        score.sweep(
            hand, time + (1.6 + late) * beat, time + 3.2 * beat, [0.0, -0.15, 0.44, 0.9], [0.42, -0.20, 0.20, 0.8]
        )
        score.hands[hand].move(time + 3.1 * beat, time + 4.2 * beat, LOW)
    end = time + 3.3 * beat
    score.chest.move(end, end + 1.0 * beat, [0.0, 0.03, 0.0])
    score.head.move(end, end + 1.1 * beat, [0.0, 0.05, 0.0])
    score.weight.move(end - 0.3 * beat, end + 0.3 * beat, -0.7 * sign)
    score.step(side, end + 0.1 * beat, end + 0.75 * beat, dancer.place(side), sign * TOE_OUT)
    score.weight.move(end + 0.5 * beat, end + 1.2 * beat, 0.0)
    score.crouch.move(end, end + 1.0 * beat, 0.03)
