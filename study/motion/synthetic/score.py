"""A score for motions that are not gait: boxing, dancing, a slow form.

A generator writes moves into tracks (weight, crouch, turns, hands) and steps into a plan of footprints; `perform`
turns the score into `Targets`. Every move is a smooth step from the value before, so moves may overlap, and all
tracks have continuous acceleration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from study.arrays import FloatArray
from study.motion import quaternions as quat
from study.motion.synthetic import body
from study.motion.synthetic.curves import blur, slow_noise, smooth_step
from study.motion.synthetic.legs import FOREVER, Contact, hip_height, on_grid, solve_legs, under_limit
from study.motion.synthetic.targets import LEFT, OUTWARD, RIGHT, Targets, girdle_shift, orientation

# Height of the middle of the hips of one who stands upright.
_STANDING_M = 0.905
_ARM = body.UPPER_ARM + body.FOREARM
_SHOULDER = np.array([body.SHOULDER_HALF_WIDTH, 0.125, 0.004])


class Track:
    """A value over time `(n, channels)`, written as moves from what it was to what it shall be."""

    def __init__(self, times: FloatArray, start: ArrayLike) -> None:
        self.times = times
        self.now = np.atleast_1d(np.asarray(start, dtype=np.float64))
        self.values = np.tile(self.now, (len(times), 1))

    def reset(self, to: ArrayLike) -> None:
        """Start from another value."""
        self.values += np.asarray(to, dtype=np.float64) - self.now
        self.now = np.atleast_1d(np.asarray(to, dtype=np.float64))

    def move(self, start: float, stop: float, to: ArrayLike) -> None:
        """Go to a value between two times; moves are written in the order of their starts."""
        to = np.atleast_1d(np.asarray(to, dtype=np.float64))
        self.values += smooth_step(self.times, start, stop)[:, None] * (to - self.now)
        self.now = to

    def visit(self, start: float, top: float, stop: float, to: ArrayLike) -> None:
        """Go to a value and back to the one before; it arrives at `top`."""
        before = self.now
        self.move(start, top, to)
        self.move(top, stop, before)


@dataclass
class Feet:
    """The footprints: where each foot stands, and its steps in order of time."""

    style: dict[str, Any]
    """Fields of `Contact` that every footprint has here."""
    places: list[list[Contact]] = field(default_factory=lambda: [[], []])

    def stand(self, side: int, x: float, z: float, yaw: float, **changes: Any) -> None:
        """Where a foot is at first."""
        self.places[side] = [Contact(-FOREVER, FOREVER, x, z, yaw, **{**self.style, **changes})]

    def step(self, side: int, lift: float, land: float, x: float, z: float, yaw: float, **changes: Any) -> None:
        """Lift a foot at one time and set it down elsewhere at another."""
        now = self.places[side][-1]
        self.places[side][-1] = replace(now, stop=lift)
        self.places[side].append(Contact(land, FOREVER, x, z, yaw, **{**self.style, **changes}))

    def raise_last_swing(self, side: int, knee: float, peak: float, reach: float) -> None:
        """How high the knee goes in the latest step, when, and how far ahead the leg reaches meanwhile."""
        self.places[side][-2] = replace(self.places[side][-2], swing_knee=knee, swing_peak=peak, swing_reach=reach)

    def at(self, side: int) -> Contact:
        """The latest footprint."""
        return self.places[side][-1]


class Score:
    """Tracks and footprints of one performance; angles in radians, turns to the left, lengths in metres."""

    def __init__(self, times: FloatArray, style: dict[str, Any]) -> None:
        self.times = times
        self.feet = Feet(style)
        self.heading = Track(times, 0.0)
        self.weight = Track(times, 0.0)
        """+1 all on the left foot, -1 all on the right."""
        self.shift = Track(times, [0.0, 0.0])
        """Of the pelvis against the weight: to the left and ahead."""
        self.crouch = Track(times, 0.0)
        self.pelvis = Track(times, [0.0, 0.0, 0.0])
        """Yaw against the heading, pitch, roll; likewise chest and head."""
        self.chest = Track(times, [0.0, 0.0, 0.0])
        self.head = Track(times, [0.0, 0.0, 0.0])
        self.hands = [Track(times, [0.1, -0.5, 0.05, 0.2]) for _ in (LEFT, RIGHT)]
        """Wrist against the shoulder in the chest's frame, outward, up and ahead, and the elbow's angle outward."""
        self.aims = [Track(times, [0.0, 0.2, 0.6]) for _ in (LEFT, RIGHT)]
        """Wrist against the chest's joint in the heading's frame: to the left, up, ahead."""
        self.aimed = [Track(times, 0.0) for _ in (LEFT, RIGHT)]
        """How far a hand follows its aim (1) rather than its place before the chest (0)."""
        self.wrists = [Track(times, np.radians([40.0, 5.0])) for _ in (LEFT, RIGHT)]
        self.collars = [Track(times, [0.0, 0.0]) for _ in (LEFT, RIGHT)]
        self.pivots = [Track(times, [0.0, 0.0]) for _ in (LEFT, RIGHT)]
        """Yaw of a standing foot about its ball, and lift of its heel."""

    def begin(self, **values: ArrayLike) -> None:
        """Set tracks of the trunk to where they are at first, by name."""
        for name, value in values.items():
            getattr(self, name).reset(value)

    def step(self, side: int, lift: float, land: float, place: tuple[float, float], yaw: float, **changes: Any) -> None:
        """Lift a foot at one time and set it down at `place` (x, z) at another; `weight` moves apart."""
        turned = float(self.pivots[side].now[0])
        self.feet.step(side, lift, land, place[0], place[1], yaw, turned=turned, **changes)

    def pivot(self, side: int, start: float, stop: float, by: float, heel: float = 0.3) -> None:
        """Turn a standing foot about its ball, heel lifted meanwhile."""
        track, middle = self.pivots[side], 0.5 * (start + stop)
        track.move(start, stop, [track.now[0] + by, track.now[1]])
        track.visit(start - 0.05, middle, stop + 0.05, [track.now[0], track.now[1] + heel])

    def sweep(self, side: int, start: float, stop: float, via: ArrayLike, to: ArrayLike) -> None:
        """Move a hand to a place through another, on one rounded path."""
        long = stop - start
        self.hands[side].move(start, start + 0.66 * long, via)
        self.hands[side].move(start + 0.34 * long, stop, to)


def perform(score: Score, rng: np.random.Generator, *, unrest: float) -> Targets:
    """The body that follows a score, with the small unrest of a living one."""
    times, n = score.times, len(score.times)
    heading = score.heading.values[:, 0]
    sides = (on_grid(score.feet.places[LEFT], times), on_grid(score.feet.places[RIGHT], times))
    pivots = np.stack([track.values for track in score.pivots], axis=1)
    pivots[..., 1] = np.maximum(pivots[..., 1], 0.0)

    share = 0.5 + 0.5 * score.weight.values
    ground = share * _footing(sides[LEFT], times) + (1.0 - share) * _footing(sides[RIGHT], times)
    cos, sin = np.cos(heading), np.sin(heading)
    left, ahead = (score.shift.values + unrest * slow_noise(rng, times, 0.004, 2, (0.1, 0.7))).T
    ground = blur(ground, 0.05) + np.column_stack([left * cos + ahead * sin, ahead * cos - left * sin])

    wander = unrest * np.radians(0.9) * slow_noise(rng, times, 1.0, 9, (0.1, 0.8))
    turned = np.column_stack([heading, np.zeros(n), np.zeros(n)])
    pelvis = turned + score.pelvis.values + 0.4 * wander[:, :3]
    chest = turned + score.chest.values + wander[:, 3:6]
    chest[:, 1] += np.radians(0.6) * np.sin(2 * np.pi * 0.3 * times + rng.uniform(0, 6.3))
    head = turned + score.head.values + wander[:, 6:9]

    level = np.column_stack([ground[:, 0], np.zeros(n), ground[:, 1]])
    _, limit = hip_height(sides, times, level, pelvis, pivots)
    level[:, 1] = under_limit(_STANDING_M - score.crouch.values[:, 0], limit, 0.12)
    ankles, feet, toes = solve_legs(sides, times, level, pelvis, heading, pivots)
    hands = np.stack([_hand(score, side, heading, chest, rng, unrest) for side in (LEFT, RIGHT)], axis=1)
    return Targets(
        times=times,
        pelvis_position=level,
        pelvis_angles=pelvis,
        chest_angles=chest,
        head_angles=head,
        ankles=ankles,
        feet_angles=feet,
        toes=toes,
        knees_out=np.full((n, 2), np.radians(6.0)),
        arms=np.zeros((n, 2, 4)),
        wrists=np.stack([track.values for track in score.wrists], axis=1),
        collars=np.stack([track.values for track in score.collars], axis=1),
        hands=hands,
    )


def _footing(contacts: Sequence[Contact], times: FloatArray) -> FloatArray:
    """Where a foot gives support, `(n, 2)`: its middle while it stands, passing smoothly to the next footprint."""

    def middle(c: Contact) -> FloatArray:
        return np.array([c.x + 0.04 * np.sin(c.yaw), c.z + 0.04 * np.cos(c.yaw)])

    support = Track(times, middle(contacts[0]))
    for before, after in pairwise(contacts):
        support.move(before.stop, after.start, middle(after))
    return support.values


def _hand(
    score: Score, side: int, heading: FloatArray, chest: FloatArray, rng: np.random.Generator, unrest: float
) -> FloatArray:
    """Wrist in the chest's frame against the shoulder, and the elbow's angle, `(n, 4)`; never quite out of reach."""
    times = score.times
    place = score.hands[side].values.copy()
    place[:, 0] *= OUTWARD[side]
    place[:, :3] += unrest * slow_noise(rng, times, 0.006, 3, (0.1, 0.8))
    shoulder = _SHOULDER * np.array([OUTWARD[side], 1.0, 1.0])
    frame = quat.multiply(quat.conjugate(orientation(chest)), quat.yaw(heading))
    aim = quat.rotate(frame, score.aims[side].values) - shoulder
    share = score.aimed[side].values
    place[:, :3] = (1.0 - share) * place[:, :3] + share * aim
    # Nearing full reach of the shoulder as its girdle has it, the hand slows down: no elbow snaps straight.
    moved = girdle_shift(score.collars[side].values, side)
    reach = place[:, :3] - moved
    distance = np.linalg.norm(reach, axis=1, keepdims=True)
    near = 0.88 * _ARM
    soft = near + (0.992 * _ARM - near) * np.tanh((distance - near) / (0.992 * _ARM - near))
    place[:, :3] = moved + reach * (np.where(distance > near, soft, distance) / distance)
    return place
