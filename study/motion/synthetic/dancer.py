"""What the dances share: a dancer at a tempo, where the hands go, the bounce on the beat, and sways of the hips.

Dancers bounce at the beat with the low point on it, shift the trunk and pelvis at half its rate, and swing the arms
at a quarter to a half (Burger et al. 2013; Toiviainen et al. 2010); popular dance music has about 120 beats a minute
(Moelants 2002).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from study.motion.synthetic.curves import slow_noise
from study.motion.synthetic.locomotion import grid
from study.motion.synthetic.score import Score
from study.motion.synthetic.targets import LEFT, OUTWARD, RIGHT

_STYLE = {
    "off_pitch": 0.55,
    "heel_off": 0.7,
    "nominal_s": 0.5,
    "swing_knee": 0.85,
    "swing_peak": 0.42,
    "knee": 0.3,
}
TOE_OUT = np.radians(11.0)
_HALF = 0.11

# Hands against the shoulder: outward, up, ahead; and the elbow's angle outward.
LOW = (0.10, -0.46, 0.16, 0.35)
WAIST = (0.09, -0.27, 0.27, 0.55)
SIDE = (0.54, -0.02, 0.15, 0.95)
HIGH = (0.15, 0.54, 0.09, 1.40)
ROUND = (-0.06, -0.10, 0.38, 1.00)
OPEN = (0.40, 0.30, 0.14, 1.25)
CHEST = (-0.10, -0.08, 0.24, 0.90)


Figure = TypeVar("Figure")


@dataclass
class Dancer:
    """The score under way: where the middle of the feet is, and which foot is free."""

    score: Score
    rng: np.random.Generator
    beat: float
    x: float = 0.0
    z: float = 0.0

    def place(self, side: int, spread: float = _HALF, ahead: float = 0.0) -> tuple[float, float]:
        """A place on the floor beside the dancer, (x, z) in metres, a little off as people step."""
        jitter = self.rng.normal(0.0, 0.008, 2)
        return self.x + OUTWARD[side] * spread + jitter[0], self.z + ahead + jitter[1]

    def step(self, side: int, on: float, spread: float = _HALF, ahead: float = 0.0, bear: float = 0.75) -> None:
        """Set a foot down on a beat and go over it."""
        toe_out = OUTWARD[side] * (TOE_OUT + self.rng.normal(0, 0.05))
        self.score.step(side, on - 0.62 * self.beat, on - 0.04, self.place(side, spread, ahead), toe_out)
        self.score.weight.move(on - 0.45 * self.beat, on + 0.42 * self.beat, OUTWARD[side] * bear)


def new_dancer(seconds: float, rng: np.random.Generator, beats_per_minute: float) -> Dancer:
    """A standing dancer, arms down, with an empty score of the given duration."""
    score = Score(grid(seconds), dict(_STYLE))
    dancer = Dancer(score, rng, 60.0 / float(np.clip(beats_per_minute, 40.0, 180.0)))
    for side in (LEFT, RIGHT):
        x, z = dancer.place(side)
        score.feet.stand(side, x, z, OUTWARD[side] * TOE_OUT)
        score.hands[side].reset(LOW)
    score.begin(crouch=0.025, chest=[0.0, np.radians(2.0), 0.0], head=[0.0, np.radians(3.0), 0.0])
    return dancer


def first_beat(dancer: Dancer) -> float:
    """The time of the first beat, seconds."""
    return float(dancer.score.times[0]) + 1.2


def phrases(dancer: Dancer, figures: Sequence[Figure], beats: int, left_over: int) -> Iterator[tuple[Figure, float]]:
    """Figures of so many beats with their times, in an order drawn anew each round, until few beats are left over."""
    time, order = first_beat(dancer), list[int]()
    while time < dancer.score.times[-1] - left_over * dancer.beat:
        order = order or dancer.rng.permutation(len(figures)).tolist()
        yield figures[order.pop()], time
        time += beats * dancer.beat


def groove(dancer: Dancer, bounce: float = 1.0) -> None:
    """The bounce on every beat, and the give-and-take of chest, head and shoulders that goes with it."""
    score, rng = dancer.score, dancer.rng
    beat = 2 * np.pi * (score.times - first_beat(dancer)) / dancer.beat
    size = bounce * np.clip(1.0 + 0.25 * slow_noise(rng, score.times, 1.0)[:, 0], 0.4, 1.6)
    score.crouch.values[:, 0] += size * (0.020 + 0.018 * np.cos(beat) + 0.003 * np.cos(2 * beat))
    score.chest.values[:, 1] += size * np.radians(2.2) * np.cos(beat - 0.5)
    score.head.values[:, 1] += size * np.radians(3.0) * np.cos(beat - 0.9)
    score.pelvis.values[:, 1] -= size * np.radians(2.0) * np.cos(beat - 0.2)
    for side in (LEFT, RIGHT):
        lag = 0.7 + 0.25 * side
        score.hands[side].values[:, 1] -= 0.018 * size * np.cos(beat - lag)
        score.collars[side].values[:, 0] -= size * np.radians(2.0) * np.cos(beat - 0.4)


def sway_hips(dancer: Dancer, on: float, toward: int, size: float = 1.0) -> None:
    """The hip goes out and up over the foot that bears; the chest stays, tilting against it."""
    score, half, sign = dancer.score, 0.5 * dancer.beat, OUTWARD[toward]
    score.pelvis.move(on - half, on + half, [sign * 0.10 * size, 0.02, sign * np.radians(7.0) * size])
    score.chest.move(on - 0.8 * half, on + 1.1 * half, [-sign * 0.10 * size, 0.035, -sign * np.radians(4.0) * size])
    score.head.move(on - 0.6 * half, on + 1.2 * half, [sign * 0.10 * size, 0.05, sign * np.radians(3.0) * size])
    score.shift.move(on - half, on + half, [sign * 0.025 * size, 0.0])


def move_arms(dancer: Dancer, on: float, left: tuple[float, ...], right: tuple[float, ...], long: float = 0.8) -> None:
    """Both hands arrive at a place a little after a beat, neither at the same time nor quite where it should."""
    for side, to in ((LEFT, left), (RIGHT, right)):
        late = dancer.rng.uniform(0.0, 0.10)
        aim = np.asarray(to) + dancer.rng.normal(0.0, [0.012, 0.015, 0.012, 0.04])
        dancer.score.hands[side].move(on - long * dancer.beat + late, on + 0.12 + late, aim)
