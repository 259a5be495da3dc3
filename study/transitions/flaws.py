"""Flaws of a transition that its method did not intend: sliding, sunken and jumping feet, and sudden changes of
velocity.

In: a transition as it is shown, the frames of its blend, and the motions that it was made from. Out: `Flaws`, each
figure beside that of the motions themselves. Nothing here knows how the transition was made or corrected: where the
floor is and how fast a standing foot moves is decided from the heights and speeds in the motions alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from study.arrays import BoolArray, FloatArray
from study.motion import quaternions as quat
from study.motion.clip import Clip, retarget
from study.motion.feet import foot_points, toes

_BAND_M = 0.03
"""A point of a foot is down within this height over its own lowest."""
_SLOWEST_M_PER_S, _FASTEST_M_PER_S = 0.2, 0.6
"""Bounds of the speed up to which a foot counts as standing."""
_AFTER_S = 0.25
"""Frames so long after a blend are looked at too: a correction may end after it."""

_LEAST_M_PER_S2, _LEAST_RAD_PER_S, _LEAST_M_PER_S = 1.0, 0.5, 0.03
"""What motions that hardly move are taken to show, so that a ratio to it says something."""

SHARE_OVER, SINK_M, ACCELERATION_TIMES, CHANGE_TIMES = 0.1, 0.02, 1.5, 1.1
"""What `told` names: shares that exceed the motions' own by so much, feet that sink further, larger ratios.

Shares of single blends are coarse (a blend of ten frames counts in tenths), so a frame or two are not named.
"""


@dataclass(frozen=True)
class FootFlaws:
    """One foot in a transition, each figure beside that of the motions."""

    skating_share: float
    own_skating_share: float
    """Share of the blended frames (of all frames of the motions) in which the foot is at floor height, yet no point of
    it that is down stands. A foot that swings low over the floor counts too, in the motions as well."""
    sink_m: float
    """How far its lowest point in and shortly after the blend is under its lowest in the motions; below 0 where over
    it."""
    toe_acceleration_m_per_s2: float
    own_toe_acceleration_m_per_s2: float
    """Largest acceleration of the toe (without a toe, the ankle) in and shortly after the blend; the motions' largest,
    of either foot."""


@dataclass(frozen=True)
class Flaws:
    """Flaws of a transition, each figure beside that of the motions that it was made from."""

    left: FootFlaws
    right: FootFlaws
    """The feet."""
    unsupported_share: float
    own_unsupported_share: float
    """Share of the blended frames (of all frames of the motions) in which no foot stands though one is at floor height.
    """
    airborne_share: float
    own_airborne_share: float
    """The same for frames in which no foot is at floor height."""
    joint_velocity_change_rad_per_s: float
    own_joint_velocity_change_rad_per_s: float
    """Largest change of any joint's velocity from one frame to the next, in and shortly after the blend; the motions'.
    """
    root_velocity_change_m_per_s: float
    own_root_velocity_change_m_per_s: float
    """The same of the root in the world."""

    @property
    def toe_acceleration_times(self) -> float:
        """Largest acceleration of a toe over the motions' own."""
        most = max(foot.toe_acceleration_m_per_s2 for foot in (self.left, self.right))
        return most / max(self.left.own_toe_acceleration_m_per_s2, _LEAST_M_PER_S2)

    @property
    def joint_velocity_change_times(self) -> float:
        """Largest change of a joint's velocity over the motions' own."""
        return self.joint_velocity_change_rad_per_s / max(self.own_joint_velocity_change_rad_per_s, _LEAST_RAD_PER_S)

    @property
    def root_velocity_change_times(self) -> float:
        """Largest change of the root's velocity over the motions' own."""
        return self.root_velocity_change_m_per_s / max(self.own_root_velocity_change_m_per_s, _LEAST_M_PER_S)

    @property
    def sink_m(self) -> float:
        """How far the deeper foot sinks."""
        return max(self.left.sink_m, self.right.sink_m)

    @property
    def severity(self) -> float:
        """The largest figure over what is named, so that over 1 something is."""
        return max(
            (self.unsupported_share - self.own_unsupported_share) / SHARE_OVER,
            self.sink_m / SINK_M,
            self.toe_acceleration_times / ACCELERATION_TIMES,
            self.joint_velocity_change_times / CHANGE_TIMES,
            self.root_velocity_change_times / CHANGE_TIMES,
        )

    def told(self) -> Iterator[str]:
        """What the transition shows that its motions don't, each as a part of a sentence; see `SHARE_OVER`."""
        if self.unsupported_share > self.own_unsupported_share + SHARE_OVER:
            yield (
                f"no foot stands in {self.unsupported_share:.0%} of the blended frames though one is at floor height "
                f"({self.own_unsupported_share:.0%} in the motions)"
            )
        if self.sink_m > SINK_M:
            yield f"a foot sinks {100 * self.sink_m:.0f} cm under its lowest in the motions"
        for what, times, limit in (
            ("acceleration of a toe", self.toe_acceleration_times, ACCELERATION_TIMES),
            ("change of a joint's velocity", self.joint_velocity_change_times, CHANGE_TIMES),
            ("change of the root's velocity", self.root_velocity_change_times, CHANGE_TIMES),
        ):
            if times > limit:
                yield f"the largest {what} is {times:.1f} times the motions' own"


def find_flaws(clip: Clip, blend: tuple[int, int], motions: Sequence[Clip]) -> Flaws:
    """Measure a transition.

    Parameters
    ----------
    clip
        The transition as it is shown, of a rig with hips, knees and ankles.
    blend
        Its blended frames, as a slice counts them; equal numbers for a cut, whose shares are 0.
    motions
        The motions that it was made from, at its frame rate.
    """
    own = [_measured(retarget(motion, clip.skeleton)) for motion in motions]
    made = _Measured(clip)
    # A foot's floor may lie a little higher in one motion than in another; both are floor to the transition.
    lows = [np.max([each.lows[foot] for each in own], axis=0) for foot in range(2)]
    standing = max(each.standing_speed() for each in own)
    inside = slice(*blend)
    around = slice(max(blend[0] - 1, 0), blend[1] + round(_AFTER_S * clip.fps))
    down, stands = (flags[inside] for flags in made.contact(lows, standing))
    own_down, own_stands = (
        np.concatenate(flags) for flags in zip(*(each.contact(each.lows, standing) for each in own), strict=True)
    )
    own_lowest = np.min([each.lowest.min(axis=0) for each in own], axis=0)
    left, right = (
        FootFlaws(
            _share(down[:, foot] & ~stands[:, foot]),
            _share(own_down[:, foot] & ~own_stands[:, foot]),
            _most(own_lowest[foot] - made.lowest[around, foot]),
            _most(made.toe_acceleration[around, foot]),
            max(_most(each.toe_acceleration) for each in own),
        )
        for foot in range(2)
    )
    return Flaws(
        left,
        right,
        _share(_either(down) & ~_either(stands)),
        _share(_either(own_down) & ~_either(own_stands)),
        _share(~_either(down)),
        _share(~_either(own_down)),
        _most(made.joint_change[around]),
        max(_most(each.joint_change) for each in own),
        _most(made.root_change[around]),
        max(_most(each.root_change) for each in own),
    )


class _Measured:
    """What is measured on one clip: heights and speeds of its feet, accelerations, changes of velocity."""

    def __init__(self, clip: Clip) -> None:
        self.feet = foot_points(clip)
        self.lows = [np.quantile(points[..., 1], 0.02, axis=0) for points in self.feet]
        self.lowest = np.stack([points[..., 1].min(axis=1) for points in self.feet], axis=1)
        self.speeds = [_slower(points, clip.fps) for points in self.feet]
        self.toe_acceleration = _changes(toes(clip)) * clip.fps**2
        self.root_change = _changes(clip.root_positions) * clip.fps
        turns = 2.0 * quat.log(quat.multiply(quat.conjugate(clip.rotations[:-1, 1:]), clip.rotations[1:, 1:]))
        self.joint_change = np.zeros(clip.frames)
        if clip.frames > 2:
            self.joint_change[1:-1] = np.linalg.norm(np.diff(turns, axis=0), axis=-1).max(axis=1) * clip.fps

    def standing_speed(self) -> float:
        """Speed up to which the supporting foot stands, m/s: most of the clip's own frames with a foot down do."""
        slowest = np.min(
            [
                np.where(points[..., 1] < low + _BAND_M, speed, np.inf).min(axis=1)
                for points, low, speed in zip(self.feet, self.lows, self.speeds, strict=True)
            ],
            axis=0,
        )
        found = slowest[np.isfinite(slowest)]
        quick = float(np.quantile(found, 0.9)) if len(found) else 0.0
        return float(np.clip(quick, _SLOWEST_M_PER_S, _FASTEST_M_PER_S))

    def contact(self, lows: Sequence[FloatArray], standing: float) -> tuple[BoolArray, BoolArray]:
        """Whether each foot is at floor height, and whether a point of it that is down is slow: two `(frames, 2)`."""
        down = [points[..., 1] < low + _BAND_M for points, low in zip(self.feet, lows, strict=True)]
        slow = [speed < standing for speed in self.speeds]
        stands = [(a & b).any(axis=1) for a, b in zip(down, slow, strict=True)]
        return np.stack([each.any(axis=1) for each in down], axis=1), np.stack(stands, axis=1)


@lru_cache(maxsize=8)
def _measured(motion: Clip) -> _Measured:
    """The measurements of a motion, kept for the last few: many transitions are made of the same two."""
    return _Measured(motion)


def _slower(points: FloatArray, fps: float) -> FloatArray:
    """Speeds over the floor of `(frames, points, 3)`, m/s: the slower of the steps before and after a frame."""
    steps = np.linalg.norm(np.diff(points[..., [0, 2]], axis=0), axis=-1) * fps
    if not len(steps):
        return np.zeros(points.shape[:-1])
    return np.asarray(np.minimum(np.concatenate([steps[:1], steps]), np.concatenate([steps, steps[-1:]])))


def _changes(positions: FloatArray) -> FloatArray:
    """Change of the step from frame to frame, `(frames, ...)`, metres; 0 in the first and the last frame."""
    changes = np.zeros(positions.shape[:-1])
    if len(positions) > 2:
        changes[1:-1] = np.linalg.norm(np.diff(positions, n=2, axis=0), axis=-1)
    return changes


def _either(feet: BoolArray) -> BoolArray:
    """Whether one of both feet is, `(frames,)`."""
    return np.asarray(feet[:, 0] | feet[:, 1])


def _share(flags: BoolArray) -> float:
    return round(float(flags.mean()), 6) if len(flags) else 0.0


def _most(values: FloatArray) -> float:
    """The largest, rounded so that a manifest does not depend on the last bits of a machine's arithmetic."""
    return round(float(values.max()), 6)
