"""Foot contacts, and feet that stay where they are planted.

In: a clip, as a rule a blended one, since blending makes planted feet slide. Out: the clip with its support legs
corrected by inverse kinematics, as Wang & Bodenheimer 2004 (section 3) correct theirs, and the slide before and
after. The method is in the manner of Kovar et al. 2002, "Footskate cleanup for motion capture editing": find when a
foot is planted, hold it in one place for as long, and ease the correction in and out over the frames around.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from study.errors import MotionError, TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions
from study.motion.legs import beyond_reach, reach
from study.transitions.blending import Transition

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

SIDES = ("L", "R")

# Captured walks and runs at 30 fps: a planted toe goes at 0.02-0.3 m/s within 3 cm of its lowest, a swinging one at
# 1-6 m/s. A contact begins below the first of each pair and lasts while both stay below the second.
PLANTED_SPEED, HELD_SPEED = 0.3, 0.6
PLANTED_HEIGHT, HELD_HEIGHT = 0.03, 0.05
SHORTEST_CONTACT_S = 0.08
RELEASE_S = 0.2
# A foot whose place is further out of reach takes a step instead; how high, at most and as a share of its way.
_OUT_OF_REACH_M = 0.01
_LIFT_M, _LIFT_SHARE = 0.06, 0.25
# Steps that are put into the contacts of one clip, one after the other.
_MOST_STEPS = 4


@dataclass(frozen=True, eq=False)
class FootslideResult:
    """A clip without foot slide, and how much there was.

    Parameters
    ----------
    clip
        The corrected clip.
    slide_before_m, slide_after_m
        How far both feet together travel on the floor while planted, within the region, metres.
    contact_s
        How long they are planted there, both feet added, seconds.
    contacts : (frames, 2)
        Where the left and the right foot are planted.
    largest_change
        The largest turn of any joint that the correction made, radians.
    """

    clip: Clip
    slide_before_m: float
    slide_after_m: float
    contact_s: float
    contacts: BoolArray
    largest_change: float

    @property
    def slide_after_m_per_s(self) -> float:
        """Mean slide speed of a planted foot after the correction."""
        return self.slide_after_m / self.contact_s if self.contact_s else 0.0


def planted_points(clip: Clip) -> FloatArray:
    """The point of each foot to plant, `(frames, 2, 3)`, left then right: the toe, or the ankle where none is."""
    positions = joint_positions(clip)
    roles = clip.skeleton.roles
    return positions[:, [roles.get(f"toe.{side}", clip.skeleton.role(f"ankle.{side}")) for side in SIDES]]


def find_contacts(clip: Clip) -> BoolArray:
    """When each foot is planted, `(frames, 2)`, by height and speed with hysteresis.

    A contact starts where the point is low and slow, and reaches, both ways, as far as it is fairly low and
    fairly slow; shorter ones than 0.08 s are dropped. Height counts from the point's own lowest (its 5% quantile).
    """
    points = planted_points(clip)
    height = points[..., 1] - np.quantile(points[..., 1], 0.05, axis=0)
    velocity = np.gradient(points, axis=0) * clip.fps if clip.frames > 1 else np.zeros_like(points)
    speed = np.linalg.norm(velocity, axis=-1)
    sure = (height < PLANTED_HEIGHT) & (speed < PLANTED_SPEED)
    held = (height < HELD_HEIGHT) & (speed < HELD_SPEED)
    contacts = np.zeros((clip.frames, 2), dtype=bool)
    for foot in range(2):
        for start, stop in _runs(held[:, foot]):
            if sure[start:stop, foot].any() and stop - start >= max(2, SHORTEST_CONTACT_S * clip.fps):
                contacts[start:stop, foot] = True
    return contacts


def transition_contacts(transition: Transition, source: Clip, destination: Clip) -> BoolArray:
    """When each foot of a transition is planted, `(frames, 2)`, with what the two clips know.

    A sliding foot may be too fast to be found in the blend itself. So a foot counts as planted there if it is found
    planted, or planted in both clips at once, or planted in the clip that has the larger share while the blended foot
    is still low. Outside the blend the clips' own contacts hold.
    """
    first, last = transition.blend_start, transition.blend_stop
    frames, count = transition.clip.frames, transition.blend_frames
    from_source, from_destination = np.zeros((2, frames, 2), dtype=bool)
    before, after = find_contacts(source), find_contacts(destination)
    from_source[:first] = before[:first]
    from_destination[last:] = after[transition.destination_frames[1] :]
    # In a time-warped blend a clip has fewer frames than the blend, and each of them serves several times.
    share = (np.arange(count) + 0.5) / max(count, 1)
    for contacts, known, (start, stop) in (
        (from_source, before, transition.source_frames),
        (from_destination, after, transition.destination_frames),
    ):
        contacts[first:last] = known[start + np.floor(share * (stop - start)).astype(np.int64)]
    half = (first + last) // 2
    larger = np.where(np.arange(frames)[:, None] < half, from_source, from_destination)
    height = planted_points(transition.clip)[..., 1]
    low = height - np.quantile(height, 0.05, axis=0) < HELD_HEIGHT
    blended = find_contacts(transition.clip) | (from_source & from_destination) | (larger & low)
    inside = (np.arange(frames) >= first) & (np.arange(frames) < last)
    return np.where(inside[:, None], blended, larger)


def plant_feet(transition: Transition, source: Clip, destination: Clip) -> tuple[Transition, FootslideResult]:
    """A transition whose feet stand still in its blend while they are planted, and what that took.

    `remove_foot_slide` with `transition_contacts` over the blended frames. Frames before the blend are unchanged, and
    so are those after it except for a foot that stays planted from early in the blend until it lifts, and the easing
    out.
    """
    if transition.blend_frames == 0:
        raise TransitionError("Expected a blended transition to plant the feet in; a cut has no blended frames.")
    contacts = transition_contacts(transition, source, destination)
    result = remove_foot_slide(transition.clip, contacts, (transition.blend_start, transition.blend_stop))
    return replace(transition, clip=result.clip, note=f"{transition.note}; {result.clip.history[-1]}"), result


def foot_slide(clip: Clip, contacts: BoolArray, region: tuple[int, int] | None = None) -> tuple[float, float]:
    """How far planted feet travel on the floor, metres, and for how long they are planted, seconds.

    Steps between two planted frames within the region (all frames by default) count, both feet added.
    """
    start, stop = region or (0, clip.frames)
    floor = planted_points(clip)[start:stop][..., [0, 2]]
    steps = np.linalg.norm(np.diff(floor, axis=0), axis=-1)
    both = contacts[start : stop - 1] & contacts[start + 1 : stop]
    return float(np.sum(steps[both])), float(np.count_nonzero(both)) / clip.fps


def remove_foot_slide(
    clip: Clip, contacts: BoolArray | None = None, region: tuple[int, int] | None = None
) -> FootslideResult:
    """Hold planted feet in place by two-bone inverse kinematics of the support legs.

    Parameters
    ----------
    clip
        A clip on a rig with hips, knees and ankles; toes where there are any.
    contacts : (frames, 2)
        When the left and the right foot are planted; `find_contacts` by default.
    region
        Frames `(start, stop)` within which feet are held, as a slice counts them; all by default. For a transition,
        its blend: no frame before it changes. A foot that was planted before the blend, or comes down within 0.2 s
        of its start, stays where it stood until it lifts; one that comes down later and stays planted after the blend
        comes to stand where it will.

    Returns
    -------
    FootslideResult

    Notes
    -----
    A planted point is held on the floor, not in height, and the foot keeps its rotation in the world. Corrections
    ease in and out over 0.2 s beside a contact, so the lock releases without a pop. A leg is never stretched beyond
    its length nor beyond where it was already; where the place is out of reach, the pelvis comes down, at most 3 cm.
    Where that is not enough, as when someone who stood is under way before the blend is over, the foot takes a step:
    it is released where it moves fastest, and lifted on its way to its next stance.
    """
    contacts = find_contacts(clip) if contacts is None else np.asarray(contacts, dtype=bool)
    if contacts.shape != (clip.frames, 2):
        raise MotionError(f"Expected foot contacts of shape {(clip.frames, 2)}, got {contacts.shape}.")
    start, stop = region or (0, clip.frames)
    if not 0 <= start < stop <= clip.frames:
        raise MotionError(f"Expected a region within frames 0 to {clip.frames}, got {start} to {stop}.")
    contacts, shifts = _shifts_within_reach(clip, contacts, start, stop)
    corrected = reach(clip, shifts, start) if shifts.any() else clip
    # A margin of one frame, so that the steps into and out of the region count.
    margin = (max(0, start - 1), min(clip.frames, stop + 1))
    before, seconds = foot_slide(clip, contacts, margin)
    after, _ = foot_slide(corrected, contacts, margin)
    change = float(np.max(2.0 * quat.half_angle_between(clip.rotations, corrected.rotations)))
    corrected = replace(
        corrected,
        history=(*clip.history, f"foot slide reduced from {100 * before:.1f} to {100 * after:.1f} cm"),
    )
    return FootslideResult(corrected, before, after, seconds, contacts, change)


def _shifts_within_reach(clip: Clip, contacts: BoolArray, start: int, stop: int) -> tuple[BoolArray, FloatArray]:
    """Contacts, with a step in those that no leg could hold through, and how far to move each foot in each frame."""
    points = planted_points(clip)
    contacts = contacts.copy()
    lifts = np.zeros((clip.frames, 2))
    for attempt in range(_MOST_STEPS + 1):
        shifts = np.stack(
            [_shifts(points[:, foot], contacts[:, foot], start, stop, clip.fps) for foot in range(2)], axis=1
        )
        excess = np.where(contacts, beyond_reach(clip, shifts), 0.0)
        if attempt == _MOST_STEPS or not (excess > _OUT_OF_REACH_M).any():
            break
        for foot in range(2):
            for run in _runs(contacts[:, foot]):
                within = run[0] < stop and run[1] > start
                if within and excess[run[0] : run[1], foot].max() > _OUT_OF_REACH_M:
                    first, last = _step(points[:, foot], run, (start, stop), clip.fps)
                    contacts[first:last, foot] = False
                    travel = np.linalg.norm((points[last - 1, foot] - points[first, foot])[[0, 2]])
                    bump = np.sin(np.pi * np.arange(1, last - first + 1) / (last - first + 1)) ** 2
                    lifts[first:last, foot] = min(_LIFT_M, _LIFT_SHARE * travel) * bump
    shifts[..., 1] += lifts
    return contacts, shifts


def _step(point: FloatArray, run: tuple[int, int], region: tuple[int, int], fps: float) -> tuple[int, int]:
    """The frames of a contact, within the region, in which the foot had better step: around where it goes fastest."""
    first, last = max(run[0], region[0]), min(run[1], region[1])
    speed = np.linalg.norm(np.gradient(point, axis=0)[first:last, [0, 2]], axis=1)
    fastest = int(np.argmax(speed))
    quick = speed >= 0.5 * speed[fastest]
    half = max(1, round(0.5 * RELEASE_S * fps))
    low, high = max(fastest - half, 0), min(fastest + half + 1, len(speed))
    while low > 0 and quick[low - 1]:
        low -= 1
    while high < len(speed) and quick[high]:
        high += 1
    return first + low, first + high


def _runs(flags: BoolArray) -> list[tuple[int, int]]:
    """Stretches of true, as slices count them."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


@dataclass(frozen=True, eq=False)
class _Hold:
    """Frames `first .. last - 1` in which a foot is held, and by how much it is moved in each, `(last - first, 3)`."""

    first: int
    last: int
    shift: FloatArray
    ease_in: bool
    ease_out: bool


def _hold(point: FloatArray, contact: tuple[int, int], region: tuple[int, int], release: int) -> _Hold:
    """How a contact is held, so that no frame before the region moves, and none after it without need.

    A foot that comes down before the region, or too soon after its start to be led to a place, stays where it came
    down, until it lifts. One that stays down after the region stands where it will stand. Any other has its mean place.
    """
    (first, last), (start, stop) = contact, region
    ease_in = ease_out = True
    if first < start + release:
        place, ease_in = point[max(first, start - 1)], False
        first = max(first, start)
    elif last > stop:
        place, last, ease_out = point[stop], stop, False
    else:
        place = np.mean(point[first:last], axis=0)
    return _Hold(first, last, (place - point[first:last]) * np.array([1.0, 0.0, 1.0]), ease_in, ease_out)


def _shifts(point: FloatArray, contacts: BoolArray, start: int, stop: int, fps: float) -> FloatArray:
    """How far to move one foot in each frame, `(frames, 3)`, metres: to its place while planted, eased around."""
    release = max(1, round(RELEASE_S * fps))
    runs = [run for run in _runs(contacts) if run[1] > start and run[0] < stop]
    holds = [_hold(point, run, (start, stop), release) for run in runs]
    shifts = np.zeros_like(point)
    for k, hold in enumerate(holds):
        shifts[hold.first : hold.last] = hold.shift
        # A contact that is nearer than the release takes over that much sooner.
        room_before = min(release, hold.first - holds[k - 1].last) if k else release
        room_after = min(release, holds[k + 1].first - hold.last) if k + 1 < len(holds) else release
        if hold.ease_in:
            ramp = hold.shift[0] * _ease_out(room_before)[::-1, None]
            frames = np.arange(hold.first - room_before, hold.first)
            shifts[frames[frames >= 0]] += ramp[frames >= 0]
        if hold.ease_out:
            frames = np.arange(hold.last, hold.last + room_after)
            ramp = hold.shift[-1] * _ease_out(room_after)[:, None]
            shifts[frames[frames < len(point)]] += ramp[frames < len(point)]
    return shifts


def _ease_out(count: int) -> FloatArray:
    """Shares `(count,)` that fall smoothly from 1 (the frame before them) to 0 (the frame after them)."""
    x = 1.0 - np.arange(1, count + 1) / (count + 1.0)
    return x * x * (3.0 - 2.0 * x)
