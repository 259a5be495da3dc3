"""Walking, running, starting, stopping and turning: a speed and a heading over time become a motion.

The pelvis follows the path that speed and heading draw. The rhythm of steps follows the speed; each footprint lies
where the pelvis will pass during its contact, shifted against the acceleration as balance asks (the point of
support lies ahead of the body when it brakes, outside when it turns: Winter 1995, Patla et al. 1999).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from study.arrays import FloatArray
from study.motion.synthetic import body, gait
from study.motion.synthetic.curves import (
    GRID_STEP,
    blur,
    running_integral,
    slope,
    slow_noise,
    smooth_step,
)
from study.motion.synthetic.legs import FOREVER, Contact, hip_height, on_grid, solve_legs, under_limit
from study.motion.synthetic.targets import LEFT, OUTWARD, RIGHT, Targets

GRAVITY = 9.81
_AHEAD_S = 0.30
# How far ahead of the hips a foot may land, and how far behind them leave, as a leg of this body reaches.
_AHEAD_M = 0.44
_BEHIND_M = 0.66
MARGIN_S = 2.0
"""The motion is planned this much longer at both ends, so that steps under way at the edges are whole."""


@dataclass(frozen=True)
class Course:
    """What the person is to do: speed and heading on the grid, and when the feet begin and cease to step."""

    times: FloatArray
    speed: FloatArray
    """`(n,)` m/s."""
    heading: FloatArray
    """`(n,)` radians, to the left; 0 faces +Z."""
    start: float | None = None
    """When the body begins to move from standing; None where it moves all along."""
    stop: float | None = None
    """When it has come to stand; None where it goes on."""


@dataclass(frozen=True)
class Person:
    """What differs from seed to seed and lasts: habits and asymmetries, drawn once."""

    phase: float
    first_foot: int
    step_noise: float
    arm_scale: FloatArray
    toe_out: FloatArray
    width: float
    bounce: float
    lean: float
    head_pitch: float
    shoulder_drop: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Person:
        """A person of ordinary habits."""
        return cls(
            phase=float(rng.uniform(0.0, 1.0)),
            first_foot=int(rng.integers(2)),
            step_noise=0.009,
            arm_scale=1.0 + 0.09 * np.clip(rng.standard_normal(2), -2, 2),
            toe_out=np.radians(6.0 + 2.0 * np.clip(rng.standard_normal(2), -2, 2)),
            width=float(1.0 + 0.12 * np.clip(rng.standard_normal(), -2, 2)),
            bounce=float(1.0 + 0.06 * np.clip(rng.standard_normal(), -2, 2)),
            lean=float(np.radians(0.8) * np.clip(rng.standard_normal(), -2, 2)),
            head_pitch=float(np.radians(2.0 + 1.5 * np.clip(rng.standard_normal(), -2, 2))),
            shoulder_drop=float(np.radians(1.0) * np.clip(rng.standard_normal(), -2, 2)),
        )


def grid(seconds: float) -> FloatArray:
    """The planning grid of a motion of `seconds`, margins included."""
    points = int(np.ceil((seconds + 2 * MARGIN_S) / GRID_STEP)) + 1
    return np.asarray(GRID_STEP * np.arange(points, dtype=np.float64) - MARGIN_S)


def travel(course: Course, rng: np.random.Generator) -> Targets:
    """The motion of one person along a course."""
    person = Person.drawn(rng)
    times = course.times
    speed = blur(course.speed, 0.05)
    pace = blur(course.speed, 0.18)
    # Who gets under way moves already as fast as a little later.
    pace = np.maximum(pace, np.interp(times + _AHEAD_S, times, pace) - 0.25)
    path = running_integral(speed[:, None] * np.column_stack([np.sin(course.heading), np.cos(course.heading)]))
    path = path - np.array([np.interp(0.0, times, path[:, axis]) for axis in range(2)])
    pull = blur(slope(slope(path)), 0.10)
    support = path - 0.60 * (0.55 * body.STATURE / GRAVITY) * pull
    phase = _phase(course, person)
    ahead = np.column_stack([np.sin(course.heading), np.cos(course.heading)])
    shift = np.sum((support - path) * ahead, axis=1)
    contacts = _contacts(_Going(course, running_integral(course.speed), pace, support, shift), person, phase, rng)
    return _whole_body(course, person, rng, pace, path, pull, phase, contacts)


def _phase(course: Course, person: Person) -> FloatArray:
    """Stride phase on the grid: the left foot strikes at whole numbers, the right half-way between."""
    times = course.times
    quickest = float(np.max(course.speed))
    # People get up to rhythm faster than up to speed: the first and last steps are short rather than slow.
    rate = gait.stride_rate(np.maximum(course.speed, 0.42 * quickest))
    phase = running_integral(rate)
    if course.start is None:
        return np.asarray(phase - np.interp(0.0, times, phase) + person.phase)
    # The first foot leaves the floor a third of a second after the weight begins to shift (Jian et al. 1993).
    lift = course.start + 0.34
    stance = float(gait.by_speed("stance", 0.6))
    first = stance - 0.5 if person.first_foot == RIGHT else stance
    return np.asarray(phase - np.interp(lift, times, phase) + first)


@dataclass(frozen=True)
class _Going:
    """A course as the feet see it, all `(n, ...)` on the grid."""

    course: Course
    way: FloatArray
    """Distance gone, metres."""
    pace: FloatArray
    """Speed as the rhythm feels it."""
    support: FloatArray
    """`(n, 2)` where support would be on average: the path, shifted as balance asks."""
    shift: FloatArray
    """How far the support is shifted ahead."""

    def at(self, time: float, values: FloatArray) -> float:
        return float(np.interp(time, self.course.times, values))

    def when(self, way: float) -> float:
        """The first time at which this distance is reached; infinite if it never is."""
        return float(np.interp(way, self.way, self.course.times, right=FOREVER))


def _contacts(
    going: _Going, person: Person, phase: FloatArray, rng: np.random.Generator
) -> tuple[list[Contact], list[Contact]]:
    """Footprints of both feet from the rhythm and the path."""
    course, times = going.course, going.course.times
    sides: tuple[list[Contact], list[Contact]] = ([], [])
    lift = -FOREVER if course.start is None else course.start + 0.30
    for side in (LEFT, RIGHT):
        for count in range(int(np.floor(phase[0])) - 1, int(np.ceil(phase[-1])) + 2):
            strike_phase = count + 0.5 * side
            start = float(np.interp(strike_phase, phase, times, left=-FOREVER, right=FOREVER))
            stance = float(gait.by_speed("stance", max(going.at(start, going.pace), going.at(start + 0.2, going.pace))))
            stop = float(np.interp(strike_phase + stance, phase, times, left=-FOREVER, right=FOREVER))
            if stop <= max(lift, times[0]) or start >= times[-1]:
                continue
            if start < lift:
                start = -FOREVER
            sides[side].append(_contact(side, start, _latest(going, start, stop), going, person, rng))
    return _settled(sides[0], course), _settled(sides[1], course)


def _latest(going: _Going, start: float, stop: float) -> float:
    """When a foot leaves the floor: as the rhythm says, or before, when the body has gone as far as a leg allows."""
    if start > -FOREVER:
        return min(stop, going.when(going.at(start, going.way) + _AHEAD_M + _BEHIND_M))
    if going.course.start is not None:
        return min(stop, going.when(going.at(going.course.start, going.way) + _BEHIND_M))
    return stop


def _passing(going: _Going, start: float, stop: float, share: float) -> float:
    """When the body passes over a foot that is down from `start` to `stop`, within the reach of the leg."""
    course = going.course
    if start <= -FOREVER:
        # Standing, or beyond the margin of the plan.
        return course.start if course.start is not None else stop - 0.3
    if stop >= FOREVER:
        return min(start + 0.3, float(course.times[-1]))
    first, last = going.at(start, going.way), going.at(stop, going.way)
    shift = going.at(start + share * (stop - start), going.shift)
    place = max(first + share * (last - first), last - _BEHIND_M - shift)
    return min(going.when(min(place, first + _AHEAD_M - shift)), stop)


def _contact(side: int, start: float, stop: float, going: _Going, person: Person, rng: np.random.Generator) -> Contact:
    noise = person.step_noise * np.clip(rng.standard_normal(2), -2, 2)
    v_start, v_stop = going.at(start, going.pace), going.at(stop, going.pace)
    v = 0.5 * (v_start + v_stop)
    over = _passing(going, start, stop, float(gait.landing_share(v)))
    yaw = going.at(over, going.course.heading)
    aside = OUTWARD[side] * (float(gait.by_speed("half_width", v)) * person.width + 0.5 * noise[0])
    along = noise[1] * (1.0 if start > -FOREVER else 0.0)
    x = going.at(over, going.support[:, 0]) + aside * np.cos(yaw) + along * np.sin(yaw)
    z = going.at(over, going.support[:, 1]) - aside * np.sin(yaw) + along * np.cos(yaw)
    running = float(gait.running_share(v))
    return Contact(
        start=start,
        stop=stop,
        x=float(x),
        z=float(z),
        yaw=yaw + OUTWARD[side] * person.toe_out[side] * (1.0 - 0.5 * running),
        nominal_s=float(gait.by_speed("stance", v) / gait.stride_rate(v)),
        strike_pitch=float(gait.by_speed("strike_pitch", v_start)),
        off_pitch=float(gait.by_speed("off_pitch", v_stop)),
        flat_from=0.19 + 0.02 * running,
        heel_off=0.46 - 0.02 * running,
        loading=float(gait.by_speed("loading", v_start)),
        knee=float(gait.by_speed("knee", v)),
        off_knee=float(gait.by_speed("off_knee", v_stop)),
        swing_knee=float(gait.by_speed("swing_knee", v_stop)),
        swing_peak=0.26 + 0.17 * running,
        swing_reach=np.radians(2.0 + 1.0 * running) * min(1.0, v / 1.3),
        swing_lag=0.12 - 0.18 * running,
        running=running,
    )


def _settled(contacts: list[Contact], course: Course) -> list[Contact]:
    """The same contacts, ended for good with the first that lies where the body comes to stand."""
    if course.stop is None:
        return on_grid(contacts, course.times)
    last = contacts[-1]
    for index, contact in enumerate(contacts):
        apart = np.hypot(contact.x - last.x, contact.z - last.z)
        if contact.stop > course.stop - 0.45 and apart < 0.16:
            contacts = [*contacts[:index], replace(contact, stop=FOREVER, loading=0.3 * contact.loading)]
            break
    return on_grid(contacts, course.times)


def _whole_body(
    course: Course,
    person: Person,
    rng: np.random.Generator,
    pace: FloatArray,
    path: FloatArray,
    pull: FloatArray,
    phase: FloatArray,
    contacts: tuple[list[Contact], list[Contact]],
) -> Targets:
    """Pelvis, trunk and arms over the steps, at each of the course's times.

    `pace` is the speed in m/s, `path` the way over the ground in metres (times, 2), `pull` the acceleration in m/s²
    (times, 2), `phase` the place in the cycle of steps, in cycles; `contacts` are those of the left and the right foot.
    """
    times, heading = course.times, course.heading
    turn = 2 * np.pi * phase
    moving = np.clip(pace / 0.5, 0.0, 1.0)
    # The body changes from walking to running less abruptly than the feet.
    running = blur(gait.running_share(pace), 0.16)
    ahead = np.column_stack([np.sin(heading), np.cos(heading)])
    aside = np.column_stack([np.cos(heading), -np.sin(heading)])
    lean_ahead = np.sum(pull * ahead, axis=1) / GRAVITY
    lean_aside = np.sum(pull * aside, axis=1) / GRAVITY

    # Over the bearing foot sideways (most in mid-stance, near 31 % of the cycle); quickest in double support.
    stance = gait.by_speed("stance", pace)
    sway = gait.by_speed("sway", pace, running) * moving * np.cos(turn - np.pi * stance)
    surge = 0.006 * moving * np.sin(2 * turn - 0.6) * (1 - 0.5 * running)
    ground = path + sway[:, None] * aside + surge[:, None] * ahead
    wander = slow_noise(rng, times, 0.004, 2, (0.1, 0.5))
    standing = 1.0 - moving
    ground = ground + (1.0 - 0.6 * standing[:, None]) * wander
    if course.start is not None:
        ground = ground + _first_shift(course.start, person, times)[:, None] * aside

    # The side of the leading leg goes forward; the side of the swinging leg sinks after toe-off.
    pelvis_yaw = heading - gait.by_speed("pelvis_yaw", pace, running) * np.cos(turn - 0.2 + 0.5 * running)
    roll = gait.by_speed("pelvis_list", pace, running) * np.cos(turn - 2 * np.pi * (0.14 + 0.02 * running))
    bank = -0.35 * np.arctan(lean_aside)
    pitch = (
        gait.by_speed("pelvis_pitch", pace, running)
        + 0.018 * moving * np.cos(2 * turn - 0.8)
        + 0.4 * np.arctan(lean_ahead)
    )
    pelvis_angles = np.column_stack([pelvis_yaw, pitch, roll + bank])

    level = np.column_stack([ground[:, 0], np.zeros(len(times)), ground[:, 1]])
    height = _height(contacts, times, level, pelvis_angles, pace, phase, person)
    position = level + np.column_stack([np.zeros_like(height), height, np.zeros_like(height)])
    ankles, feet, toes = solve_legs(contacts, times, position, pelvis_angles, heading)

    chest, head = _trunk(person, rng, times, course, pace, turn, roll, lean_ahead, lean_aside)
    arms, wrists, collars = _arms(person, rng, times, pace, turn, moving)
    return Targets(
        times=times,
        pelvis_position=position,
        pelvis_angles=pelvis_angles,
        chest_angles=chest,
        head_angles=head,
        ankles=ankles,
        feet_angles=feet,
        toes=toes,
        knees_out=np.zeros((len(times), 2)),
        arms=arms,
        wrists=wrists,
        collars=collars,
    )


def _first_shift(start: float, person: Person, times: FloatArray) -> FloatArray:
    """Before the first step the weight goes over to the foot that stays (Jian et al. 1993)."""
    toward = OUTWARD[1 - person.first_foot]
    shift = smooth_step(times, start - 0.25, start + 0.45) * (1.0 - smooth_step(times, start + 0.45, start + 1.1))
    return np.asarray(toward * 0.030 * shift)


def _height(
    contacts: tuple[list[Contact], list[Contact]],
    times: FloatArray,
    level: FloatArray,
    pelvis_angles: FloatArray,
    pace: FloatArray,
    phase: FloatArray,
    person: Person,
) -> FloatArray:
    """Height of the hips: over the bearing leg in walking, as on a spring in running.

    In running the rise and fall is the one whose peak acceleration in flight is that of a free fall (the
    spring-mass model: Blickhan 1989), so its size follows from the step rate.
    """
    walking, limit = hip_height(contacts, times, level, pelvis_angles)
    running = blur(gait.running_share(pace), 0.12)
    swing = 0.98 * person.bounce * GRAVITY / (4 * np.pi * gait.stride_rate(pace)) ** 2
    stance = gait.by_speed("stance", pace)
    middle = 0.851 - 0.008 * (pace - 3.3)
    bounce = middle - swing * np.cos(4 * np.pi * (phase - 0.5 * stance))
    return under_limit((1 - running) * blur(walking, 0.045) + running * bounce, limit)


def _trunk(
    person: Person,
    rng: np.random.Generator,
    times: FloatArray,
    course: Course,
    pace: FloatArray,
    turn: FloatArray,
    roll: FloatArray,
    lean_ahead: FloatArray,
    lean_aside: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Chest and head in the world: the chest turns against the pelvis, the head holds still and leads a turn."""
    running = blur(gait.running_share(pace), 0.16)
    sway = slow_noise(rng, times, np.radians(0.7), 3)
    yaw_swing = gait.by_speed("chest_yaw", pace, running) * np.cos(turn - 0.35)
    # The head looks into a turn a third of a second before the body goes there (Grasso et al. 1998).
    ahead = blur(np.interp(times + 0.32, times, course.heading), 0.12)
    chest_yaw = 0.75 * course.heading + 0.25 * ahead + yaw_swing + sway[:, 0]
    pitch = gait.by_speed("chest_pitch", pace, running) + person.lean + 0.9 * np.arctan(lean_ahead) + sway[:, 1]
    pitch = pitch + np.radians(1.2) * np.clip(pace / 1.3, 0, 1.5) * np.cos(2 * turn - 1.2)
    chest_roll = -0.25 * roll - 0.75 * np.arctan(lean_aside) + sway[:, 2]
    chest = np.column_stack([chest_yaw, pitch, chest_roll])
    look = slow_noise(rng, times, np.radians(1.8), 2, (0.05, 0.3))
    head_yaw = ahead + 0.18 * yaw_swing + look[:, 0]
    # Down as the head rises, so that the gaze stays where it is (Pozzo et al. 1990; Hirasaki et al. 1999).
    nod = np.radians(1.0) * np.clip(pace / 1.3, 0, 1.5) * np.cos(2 * turn - 3.0)
    head_pitch = person.head_pitch + 0.30 * pitch + nod * (1 - 0.4 * running) + 0.5 * look[:, 1]
    head = np.column_stack([head_yaw, head_pitch, -0.35 * np.arctan(lean_aside) + 0.3 * sway[:, 2]])
    return chest, head


def _arms(
    person: Person, rng: np.random.Generator, times: FloatArray, pace: FloatArray, turn: FloatArray, moving: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arms swing against the legs of their side; the elbow bends more in front, and follows a little later."""
    n = len(times)
    running = blur(gait.running_share(pace), 0.16)
    arms, wrists, collars = np.zeros((n, 2, 4)), np.zeros((n, 2, 2)), np.zeros((n, 2, 2))
    for side in (LEFT, RIGHT):
        drift = slow_noise(rng, times, 1.0, 4)
        own = turn - np.pi * side
        forward = -np.cos(own - 0.30 + 0.15 * running)
        scale = person.arm_scale[side] * (1.0 + 0.06 * drift[:, 0])
        swing = gait.by_speed("arm_swing", pace, running) * scale
        # The swing forward is quicker than the swing back.
        wave = forward + 0.07 * np.cos(2 * own - 0.4)
        arms[:, side, 0] = gait.by_speed("arm_mean", pace, running) + swing * wave + np.radians(1.2) * drift[:, 1]
        arms[:, side, 1] = gait.by_speed("abduction", pace, running) - np.radians(4.0) * running * forward
        arms[:, side, 1] += np.radians(0.8) * drift[:, 2]
        # Turned in, so that the forearm comes across in front, more in running.
        arms[:, side, 2] = -np.radians(12.0 - 4.0 * running) - np.radians(5.0) * running * forward
        late = -np.cos(own - 0.62 + 0.3 * running)
        bend = gait.by_speed("elbow_swing", pace, running) * scale * (late + 0.12 * np.cos(2 * own))
        arms[:, side, 3] = gait.by_speed("elbow_mean", pace, running) + bend + np.radians(1.5) * drift[:, 3]
        wrists[:, side, 0] = np.radians(35.0 + 10.0 * running)
        wrists[:, side, 1] = np.radians(10.0) + np.radians(3.0) * moving * np.cos(own - 1.0)
        collars[:, side, 0] = OUTWARD[side] * person.shoulder_drop + np.radians(2.0) * running
        collars[:, side, 1] = np.radians(3.0) * np.clip(pace / 1.3, 0, 2) * forward
    return arms, wrists, collars
