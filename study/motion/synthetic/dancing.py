"""Popular dances: a groove on the beat, of figures of eight beats in an order drawn by the seed, and turns."""

from __future__ import annotations

import numpy as np

from study.motion.synthetic.dancer import (
    HIGH,
    OPEN,
    ROUND,
    SIDE,
    TOE_OUT,
    WAIST,
    Dancer,
    first_beat,
    groove,
    move_arms,
    new_dancer,
    phrases,
    sway_hips,
)
from study.motion.synthetic.score import perform
from study.motion.synthetic.targets import LEFT, OUTWARD, RIGHT, Targets


def dance(seconds: float, rng: np.random.Generator, *, beats_per_minute: float = 116.0) -> Targets:
    """A groove: step-touches, grapevines, hip sways, twists and points, bouncing on the beat."""
    dancer = new_dancer(seconds, rng, beats_per_minute)
    for figure, time in phrases(dancer, (_step_touch, _grapevine, _sway_high, _twist, _points), 8, 9):
        figure(dancer, time)
    groove(dancer)
    return perform(dancer.score, rng, unrest=1.3)


def dance_turns(seconds: float, rng: np.random.Generator, *, beats_per_minute: float = 100.0) -> Targets:
    """Whole turns in three steps to alternating sides, with opened and gathered arms, and sways between them."""
    dancer = new_dancer(seconds, rng, beats_per_minute)
    time = first_beat(dancer)
    side = int(rng.integers(2))
    while time < dancer.score.times[-1] - 9 * dancer.beat:
        _three_step_turn(dancer, time, side)
        _balance(dancer, time + 4 * dancer.beat, 1 - side)
        side = 1 - side
        time += 8 * dancer.beat
    groove(dancer, bounce=0.4)
    return perform(dancer.score, rng, unrest=1.2)


def _step_touch(dancer: Dancer, time: float) -> None:
    side = int(dancer.rng.integers(2))
    for count in range(4):
        on, sign = time + 2 * count * dancer.beat, OUTWARD[side]
        dancer.x += sign * 0.20
        dancer.step(side, on, 0.13)
        sway_hips(dancer, on, side)
        dancer.step(1 - side, on + dancer.beat, 0.03 - 0.04, bear=-0.55)
        sway_hips(dancer, on + dancer.beat, side, 0.5)
        near, far = (0.32, -0.22, 0.22, 0.8), (-0.16, -0.24, 0.26, 0.7)
        move_arms(dancer, on, near if side == LEFT else far, near if side == RIGHT else far)
        move_arms(dancer, on + dancer.beat, WAIST, WAIST)
        side = 1 - side


def _grapevine(dancer: Dancer, time: float) -> None:
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
            sway_hips(dancer, on, foot if count < 3 else side, 0.6)
            move_arms(dancer, on, SIDE if count % 2 == 0 else WAIST, SIDE if count % 2 == 0 else WAIST)
        side = 1 - side


def _sway_high(dancer: Dancer, time: float) -> None:
    score = dancer.score
    dancer.step(RIGHT, time, 0.17)
    dancer.step(LEFT, time + dancer.beat, 0.17)
    for side in (LEFT, RIGHT):
        score.sweep(side, time - 0.3 * dancer.beat, time + 1.6 * dancer.beat, OPEN, HIGH)
    side = LEFT
    for count in range(2, 8):
        on, sign = time + count * dancer.beat, OUTWARD[side]
        score.weight.move(on - 0.5 * dancer.beat, on + 0.5 * dancer.beat, 0.55 * sign)
        sway_hips(dancer, on, side, 1.35)
        lean = 0.13 * sign
        move_arms(
            dancer,
            on,
            (0.16 + lean, 0.52 - 0.05 * (count % 2), 0.10, 1.40),
            (0.16 - lean, 0.47 + 0.05 * (count % 2), 0.10, 1.40),
        )
        side = 1 - side
    end = time + 8 * dancer.beat
    for side in (LEFT, RIGHT):
        score.sweep(side, end - 1.0 * dancer.beat, end + 0.5 * dancer.beat, SIDE, WAIST)


def _twist(dancer: Dancer, time: float) -> None:
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
        move_arms(dancer, on, fore if sign > 0 else back, back if sign > 0 else fore, long=0.55)
    score.crouch.move(time + 7 * dancer.beat, time + 8 * dancer.beat, 0.025)


def _points(dancer: Dancer, time: float) -> None:
    side = int(dancer.rng.integers(2))
    score = dancer.score
    dancer.step(side, time, 0.20)
    for count in range(4):
        on, sign = time + 2 * count * dancer.beat, OUTWARD[side]
        other = 1 - side
        score.weight.move(on - 0.5 * dancer.beat, on + 0.4 * dancer.beat, 0.6 * sign)
        sway_hips(dancer, on, side, 1.2)
        # By way of the front, so that the hand keeps clear of its shoulder.
        ahead = [0.10, 0.08, 0.40, 0.95]
        score.sweep(side, on - 0.8 * dancer.beat, on + 0.15, ahead, [0.36, 0.45, 0.10, 1.2])
        score.hands[other].move(on - 0.6 * dancer.beat, on + 0.15, [0.10, -0.33, 0.10, 0.8])
        down = on + dancer.beat
        sway_hips(dancer, down, other, 0.7)
        score.weight.move(down - 0.5 * dancer.beat, down + 0.4 * dancer.beat, -0.3 * sign)
        score.sweep(side, down - 0.65 * dancer.beat, down + 0.18, ahead, [-0.20, -0.22, 0.30, 0.7])
        if count == 1:
            score.hands[side].move(down + 0.2, down + dancer.beat, WAIST)
            side = other
            dancer.step(side, on + 2 * dancer.beat, 0.20)
    for hand in (LEFT, RIGHT):
        score.hands[hand].move(time + 7.2 * dancer.beat, time + 8.2 * dancer.beat, WAIST)


def _three_step_turn(dancer: Dancer, time: float, side: int) -> None:
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
    score.hands[side].move(time - 1.2 * beat, time - 0.2 * beat, ROUND)
    score.hands[1 - side].move(time - 1.1 * beat, time - 0.1 * beat, SIDE)
    for hand in (LEFT, RIGHT):
        score.hands[hand].move(time + (0.0 + 0.12 * hand) * beat, time + 1.2 * beat, ROUND)
        score.hands[hand].move(time + (2.0 + 0.10 * hand) * beat, time + 3.3 * beat, SIDE)
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
    score.step(other, on - 0.62 * beat, on, place, facing + whole + OUTWARD[other] * TOE_OUT)
    score.weight.move(on - 0.1 * beat, on + 0.7 * beat, sign * 0.2)
    score.crouch.move(on - 0.4 * beat, on + 0.6 * beat, 0.045)
    dancer.x -= sign * 0.065


def _balance(dancer: Dancer, time: float, side: int) -> None:
    """Sways from foot to foot in place, arms passing low, ready for the next turn."""
    score, beat = dancer.score, dancer.beat
    facing = float(score.heading.now[0])
    for count in range(3):
        on, sign = time + count * beat, OUTWARD[side]
        toe_out = facing + sign * TOE_OUT
        score.step(side, on - 0.6 * beat, on - 0.05, dancer.place(side, 0.15), toe_out)
        score.weight.move(on - 0.5 * beat, on + 0.45 * beat, 0.7 * sign)
        sway_hips(dancer, on, side, 0.8)
        near, far = (0.48, 0.12, 0.20, 1.0), (0.02, -0.14, 0.40, 0.9)
        move_arms(dancer, on, near if side == LEFT else far, near if side == RIGHT else far, long=0.9)
        side = 1 - side
