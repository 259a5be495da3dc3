"""From footprints to legs: where each ankle is, how each foot rolls, and how high the hips ride.

In: the contacts of each foot (when, where, with what roll) and the path of the pelvis on the planning grid. Out:
ankle, foot and toe channels of `Targets`. A foot in contact turns about its heel, lies flat, then turns about the
joint of its toes (the three rockers of Perry 1992); neither point moves while it is the pivot. A foot in the air
goes by the length and direction of its leg, seen from the hip, so that the knee bends as published curves have it,
and leaves and meets the floor with the velocity of the contact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from study.arrays import FloatArray
from study.motion.synthetic import body
from study.motion.synthetic.curves import GRID_STEP, blur, clamped_spline, hermite, smooth_step
from study.motion.synthetic.targets import bend_for, bent_length, hip_positions

FOREVER = 1e6
_STRAIGHTEST_STANCE = np.radians(7.0)
_STRAIGHTEST_SWING = np.radians(4.0)
# The tips of the toes begin to carry the foot when the heel is this high, and the more the higher.
_TOE_ROLL_FROM = np.radians(22.0)
_TOE_ROLL = 0.75


@dataclass(frozen=True)
class Contact:
    """One footprint, and the swing that follows it.

    Times are in seconds, `-FOREVER` and `FOREVER` where the foot was there before, or stays after, the motion.
    """

    start: float
    stop: float
    x: float
    z: float
    yaw: float
    nominal_s: float = 0.65
    """How long such a contact lasts, to place the roll where start or stop lies outside the motion."""
    strike_pitch: float = 0.0
    """Toes up at the start."""
    off_pitch: float = 0.0
    """Heel up at the end (as a positive angle)."""
    flat_from: float = 0.16
    """Share of the contact at which the foot is flat."""
    heel_off: float = 0.5
    """Share of the contact at which the heel rises."""
    loading: float = 0.0
    """How much the knee yields under the load in early stance, on top of `knee`."""
    knee: float = 0.1
    """Bend of the knee in the middle of the contact."""
    off_knee: float = 0.6
    """Bend of the knee at the end of the contact."""
    swing_knee: float = 1.05
    """Largest bend of the knee in the swing after this contact."""
    swing_peak: float = 0.3
    """Share of the swing at which the knee is bent most."""
    swing_reach: float = 0.0
    """How far beyond its landing angle the leg swings forward before it comes back to land."""
    swing_lag: float | None = None
    """Share of the way forward that the leg has gone when the knee is bent most; None for an even swing."""
    heel_up: float = 0.0
    """By how much the heel stays off the floor all through the contact."""
    turned: float = 0.0
    """The pivot's yaw when the foot was set down; it turns by what comes on top."""
    running: float = 0.0
    """1 for a running step, 0 for a walking step."""


def on_grid(contacts: list[Contact], times: FloatArray) -> list[Contact]:
    """The same contacts with times on grid points, so that stance and swing meet on one."""

    def snap(time: float) -> float:
        return time if abs(time) >= FOREVER else float(times[0] + GRID_STEP * round((time - times[0]) / GRID_STEP))

    return [replace(c, start=snap(c.start), stop=snap(c.stop)) for c in contacts]


def progress(contact: Contact, times: FloatArray) -> FloatArray:
    """How far a contact has come, 0 to 1; a foot that is there for good stays in mid-stance at that end."""
    if contact.start <= -FOREVER and contact.stop >= FOREVER:
        return np.full_like(times, 0.4)
    if contact.start <= -FOREVER:
        return np.maximum(1.0 - (contact.stop - times) / contact.nominal_s, 0.4)
    if contact.stop >= FOREVER:
        return np.minimum((times - contact.start) / contact.nominal_s, 0.4)
    return np.asarray((times - contact.start) / (contact.stop - contact.start))


def stance_foot(contact: Contact, times: FloatArray, pivot: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Ankle `(n, 3)`, yaw and pitch (toes up) `(n, 2)`, and bend of the toes `(n,)` of a foot in contact.

    The foot turns about the heel's contact point, then lies flat, then turns about the joint of the toes; as the
    heel gets high the toes roll too, over their tip. `pivot (n, 2)` turns it on the spot besides: by a yaw about the
    joint of the toes, and with the heel lifted.
    """
    share = progress(contact, times)
    heel_pitch = contact.strike_pitch * np.clip(1.0 - share / contact.flat_from, 0.0, None) ** 2.2
    rise = np.clip((share - contact.heel_off) / (1.0 - contact.heel_off), 0.0, None)
    lifted = contact.heel_up + pivot[:, 1]
    toe_pitch = lifted + np.maximum(contact.off_pitch - lifted, 0.0) * rise**2.4
    tip_pitch = _TOE_ROLL * np.clip(toe_pitch - _TOE_ROLL_FROM, 0.0, None) ** 2
    # One of the two pitches is always zero, so the two rockers add up.
    across, along = body.HEEL_BACK, body.TOE_FORWARD
    drop, toe = body.ANKLE_HEIGHT - body.TOE_HEIGHT, body.TOE_LENGTH
    forward = across * (np.cos(heel_pitch) - 1.0) - body.ANKLE_HEIGHT * np.sin(heel_pitch)
    height = body.ANKLE_HEIGHT * np.cos(heel_pitch) + across * np.sin(heel_pitch)
    forward += along * (1.0 - np.cos(toe_pitch)) + drop * np.sin(toe_pitch) + toe * (1.0 - np.cos(tip_pitch))
    height += drop * (np.cos(toe_pitch) - 1.0) + along * np.sin(toe_pitch) + toe * np.sin(tip_pitch)
    yaw = contact.yaw + pivot[:, 0] - contact.turned
    behind = forward - along
    ankle = np.empty((len(times), 3))
    ankle[:, 0] = contact.x + along * np.sin(contact.yaw) + behind * np.sin(yaw)
    ankle[:, 1] = height
    ankle[:, 2] = contact.z + along * np.cos(contact.yaw) + behind * np.cos(yaw)
    return ankle, np.column_stack([yaw, heel_pitch - toe_pitch]), toe_pitch - tip_pitch


def stance_knee(contact: Contact, times: FloatArray) -> FloatArray:
    """The bend that the knee is meant to have in stance: it yields, straightens, and gives way before toe-off.

    The shape is that of Winter 1991 and Perry 1992 (peaks near 15 % of the cycle, least near 40 %).
    """
    share = progress(contact, times)
    yielding = np.where(share < 0.23, smooth_step(share, -0.05, 0.23), 1.0 - smooth_step(share, 0.23, 0.66))
    giving = np.clip((share - 0.62) / 0.38, 0.0, 1.2) ** 1.9
    return np.asarray(contact.knee + contact.loading * yielding + (contact.off_knee - contact.knee) * giving)


def loads(sides: tuple[list[Contact], list[Contact]], times: FloatArray) -> FloatArray:
    """How much each foot bears, `(n, 2)`, 0 to 1: rises after a contact's start, falls before its stop."""
    result = np.zeros((len(times), 2))
    for side, contacts in enumerate(sides):
        for c in contacts:
            over = 0.19 * c.nominal_s
            result[:, side] += smooth_step(times, c.start, c.start + over) * (
                1.0 - smooth_step(times, c.stop - over, c.stop)
            )
    return result


def hip_height(
    sides: tuple[list[Contact], list[Contact]],
    times: FloatArray,
    pelvis_position: FloatArray,
    pelvis_angles: FloatArray,
    pivots: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Height of the middle of the hips that gives the bearing legs the bend they are meant to have.

    Returns
    -------
    height : (n,)
        Weighted over the bearing legs; interpolated where no foot is down.
    limit : (n,)
        The greatest height at which every foot in contact can be reached.
    """
    bearing = loads(sides, times)
    level = pelvis_position * np.array([1.0, 0.0, 1.0])
    offsets = hip_positions(level, pelvis_angles)
    pivots = np.zeros((len(times), 2, 2)) if pivots is None else pivots
    total, limit = np.zeros(len(times)), np.full(len(times), 2.0)
    for side, contacts in enumerate(sides):
        for c in contacts:
            inside = np.flatnonzero((times > c.start - 1e-9) & (times < c.stop + 1e-9))
            if not len(inside):
                continue
            ankle, _, _ = stance_foot(c, times[inside], pivots[inside, side])
            away = ankle - offsets[inside, side]
            flat_square = away[:, 0] ** 2 + away[:, 2] ** 2
            bend = np.maximum(stance_knee(c, times[inside]), _STRAIGHTEST_STANCE)
            length = bent_length(body.THIGH, body.SHANK, bend)
            # Knees meet and leave the floor bent, more so where all goes fast.
            least = max(_STRAIGHTEST_STANCE, 0.75 * c.knee) + 0.05 * (
                1.0 - smooth_step(progress(c, times[inside]), 0, 0.3)
            )
            longest = bent_length(body.THIGH, body.SHANK, least)
            total[inside] += bearing[inside, side] * (away[:, 1] + np.sqrt(np.maximum(length**2 - flat_square, 0.04)))
            reach = away[:, 1] + np.sqrt(np.maximum(longest**2 - flat_square, 0.04))
            limit[inside] = np.minimum(limit[inside], reach)
    weight = bearing.sum(axis=1)
    known = weight > 0.05
    height = np.interp(times, times[known], total[known] / weight[known])
    return height, limit


def under_limit(height: FloatArray, limit: FloatArray, spread_s: float = 0.08) -> FloatArray:
    """The height, lowered smoothly around each place where it would rise above the limit.

    What is too much is widened by `spread_s` both ways, then averaged over the same width, so that it takes off at
    least as much as is needed everywhere.
    """
    reach = round(spread_s / GRID_STEP)
    over = np.pad(np.maximum(height - limit, 0.0), 2 * reach, mode="edge")
    if over.max() == 0.0:
        return height
    widest = np.lib.stride_tricks.sliding_window_view(over, 2 * reach + 1).max(axis=-1)
    window = np.hanning(2 * reach + 3)[1:-1]
    return np.asarray(height - np.convolve(widest, window / window.sum(), mode="valid"))


def solve_legs(
    sides: tuple[list[Contact], list[Contact]],
    times: FloatArray,
    pelvis_position: FloatArray,
    pelvis_angles: FloatArray,
    heading: FloatArray,
    pivots: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Ankles `(n, 2, 3)`, feet angles `(n, 2, 3)` and toes `(n, 2)` for contacts and a pelvis (height included)."""
    n = len(times)
    ankles, feet, toes = np.zeros((n, 2, 3)), np.zeros((n, 2, 3)), np.zeros((n, 2))
    hips = hip_positions(pelvis_position, pelvis_angles)
    pivots = np.zeros((n, 2, 2)) if pivots is None else pivots
    for side, contacts in enumerate(sides):
        for c in contacts:
            inside = (times > c.start - 1e-9) & (times < c.stop + 1e-9)
            found = stance_foot(c, times[inside], pivots[inside, side])
            ankles[inside, side], feet[inside, side, :2], toes[inside, side] = found
        for before, after in pairwise(contacts):
            first, last = (round((t - times[0]) / GRID_STEP) for t in (before.stop, after.start))
            if first < 3 or last > n - 4:
                continue
            part = slice(first, last + 1)
            swing = _swing(before, after, times, hips[:, side], heading, pivots[:, side], (first, last))
            ankles[part, side], feet[part, side], toes[part, side] = swing
    return ankles, feet, toes


def _swing(
    before: Contact,
    after: Contact,
    times: FloatArray,
    hip: FloatArray,
    heading: FloatArray,
    pivot: FloatArray,
    span: tuple[int, int],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Ankle, foot angles and toes of one swing, on grid points `span[0] .. span[1]`."""
    first, last = span
    part = slice(first, last + 1)
    count = last - first
    share = np.linspace(0.0, 1.0, count + 1)
    per_share = count * GRID_STEP
    ends, rates, toe_ends, yaws = [], [], [], []
    for contact, at in ((before, np.arange(first - 2, first + 1)), (after, np.arange(last, last + 3))):
        ankle, turned, bend = stance_foot(contact, times[at], pivot[at])
        polar = _leg_polar(ankle - hip[at], heading[at])
        values = np.column_stack([polar, turned[:, 1] - _shank_pitch(polar)])
        here = 2 if contact is before else 0
        sign = 1.0 if contact is before else -1.0
        away = values[::-1] if contact is before else values
        ends.append(values[here])
        toe_ends.append(bend[here])
        yaws.append(turned[here, 0])
        rates.append(sign * (3.0 * away[0] - 4.0 * away[1] + away[2]) / (2.0 * GRID_STEP) * per_share)
    peak_at = before.swing_peak
    peak = max(before.swing_knee, ends[0][0] + 0.1, ends[1][0] + 0.1)
    late_at = 0.8 - 0.1 * before.running
    knots = (0.0, peak_at, peak_at + 0.33 * (1 - peak_at), peak_at + late_at * (1 - peak_at), 1.0)
    middle = ends[1][0] + (peak - ends[1][0]) * 0.62
    late = ends[1][0] + 0.06 * (peak - ends[1][0])
    knee = clamped_spline(share, knots, [ends[0][0], peak, middle, late, ends[1][0]], (rates[0][0], rates[1][0]))
    rest = hermite(share, (ends[0][1:], ends[1][1:]), (rates[0][1:], rates[1][1:]))
    angle, aside, ankle_bend = rest.T
    if before.swing_lag is not None:
        # The thigh follows the shank: the leg hangs back until the knee is bent, then swings through.
        way = ends[1][1] - ends[0][1]
        passed = [ends[0][1], ends[0][1] + before.swing_lag * way, ends[0][1] + 0.77 * way, ends[1][1]]
        when = (0.0, peak_at, peak_at + 0.45 * (1 - peak_at), 1.0)
        angle = clamped_spline(share, when, passed, (rates[0][1], rates[1][1]))
    angle = angle + before.swing_reach * smooth_step(share, 0.3, 0.85) * (1.0 - smooth_step(share, 0.8, 1.0))
    lifted = 1.0 - smooth_step(share, 0.0, 0.45)
    level = smooth_step(share, 0.0, 0.3) * (1.0 - smooth_step(share, 0.75, 1.0))
    above = knee - _STRAIGHTEST_SWING
    knee = _STRAIGHTEST_SWING + 0.5 * (above + np.hypot(above, 0.03))
    polar = np.column_stack([np.minimum(knee, 2.4), angle, aside])
    ankle_bend = ankle_bend * (1.0 - level) + level * (0.02 - 0.12 * lifted)
    yaw = yaws[0] + (yaws[1] - yaws[0]) * smooth_step(share, 0.05, 0.95)
    angles = np.column_stack([yaw, ankle_bend + _shank_pitch(polar), np.zeros(count + 1)])
    toes = (
        toe_ends[0] * (1.0 - smooth_step(share, 0.0, 0.4))
        + toe_ends[1] * smooth_step(share, 0.5, 1.0)
        + 0.12 * smooth_step(share, 0.3, 0.8) * (1.0 - smooth_step(share, 0.85, 1.0))
    )
    ankle = hip[part] + _from_polar(polar, heading[part])
    ankle[:, 1] += _clearing(ankle[:, 1], angles[:, 1], toes, share)
    return ankle, angles, toes


def _clearing(ankle_height: FloatArray, pitch: FloatArray, toes: FloatArray, share: FloatArray) -> FloatArray:
    """How much to lift a swinging foot so that heel and toes clear the floor: by 15 mm in mid-swing (Winter 1992)."""
    toe = ankle_height + body.TOE_FORWARD * np.sin(pitch) - (body.ANKLE_HEIGHT - body.TOE_HEIGHT) * np.cos(pitch)
    tip = toe + body.TOE_LENGTH * np.sin(pitch + toes)
    heel = ankle_height - body.HEEL_BACK * np.sin(pitch) - body.ANKLE_HEIGHT * np.cos(pitch)
    spare = np.minimum(np.minimum(toe, tip) - body.TOE_HEIGHT, heel)
    wanted = 0.015 * smooth_step(share, 0.1, 0.4) * (1.0 - smooth_step(share, 0.7, 1.0))
    ends = smooth_step(share, 0.0, 0.1) * (1.0 - smooth_step(share, 0.9, 1.0))
    lift = np.zeros_like(share)
    for _ in range(8):
        short = np.maximum(wanted - spare - lift, 0.0)
        if short.max() < 5e-4:
            break
        spread = blur(np.pad(short, 60), 0.03)[60:-60] * ends
        lift = lift + spread * (short.max() / max(float(spread.max()), 1e-9))
    return lift


def _leg_polar(away: FloatArray, heading: FloatArray) -> FloatArray:
    """Hip to ankle `(n, 3)` as knee bend, angle forward of straight down, and angle to the left, `(n, 3)`."""
    cos, sin = np.cos(heading), np.sin(heading)
    left, ahead = away[:, 0] * cos - away[:, 2] * sin, away[:, 0] * sin + away[:, 2] * cos
    bend = bend_for(body.THIGH, body.SHANK, np.linalg.norm(away, axis=1))
    down = -away[:, 1]
    return np.column_stack([bend, np.arctan2(ahead, down), np.arctan2(left, np.hypot(ahead, down))])


def _from_polar(polar: FloatArray, heading: FloatArray) -> FloatArray:
    length = bent_length(body.THIGH, body.SHANK, polar[:, 0])
    sagittal = length * np.cos(polar[:, 2])
    left, ahead, down = length * np.sin(polar[:, 2]), sagittal * np.sin(polar[:, 1]), sagittal * np.cos(polar[:, 1])
    cos, sin = np.cos(heading), np.sin(heading)
    return np.column_stack([left * cos + ahead * sin, -down, ahead * cos - left * sin])


def _shank_pitch(polar: FloatArray) -> FloatArray:
    """By how much a foot square to its shank points its toes up."""
    bend, angle = polar[:, 0], polar[:, 1]
    inner = np.arctan2(body.SHANK * np.sin(bend), body.THIGH + body.SHANK * np.cos(bend))
    return np.asarray(angle + inner - bend)
