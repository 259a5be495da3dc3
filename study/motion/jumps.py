"""Which steps between two frames of a clip are jumps, and where its motion starts and stops.

A jump is a step that is large, larger than people move, and several times as large as those around it: fast motion is
fast over several frames, a fault of capture is not.
"""

from __future__ import annotations

import numpy as np

from study.arrays import FloatArray, IntArray
from study.motion import quaternions as quat
from study.motion.clip import Clip
from study.motion.flips import FLIP_RAD, LegFlips, leg_flips

# Faults show in single frames, so an angle or a length decides at capture rates; at low rates one frame of fast motion
# is larger, so a speed or an acceleration does. Fast people (boxing, ballet, sprinting in the CMU and Bandai data)
# stay under 26 rad/s in the joints that carry weight, or under 50 with the tremble that capture leaves in them.
JOINT_JUMP = (0.6, 50.0)  # rad, rad/s
TRUNK_JUMP = (0.3, 24.0)
_END_JUMP = (0.25, 12.0)
_ROOT_JUMP = (0.025, 80.0)  # m, m/s^2
_TIMES_AROUND = 4.0
_AROUND_S = 0.08
# A jump of the whole body this near to an end of the clip cuts off frames that are no part of the motion.
_END_S = 0.05
_END_JOINTS = 3

_TRUNK = ("pelvis", "spine", "chest", "neck", "head")
_LIMBS = tuple(f"{part}.{side}" for part in ("hip", "knee", "ankle", "shoulder", "elbow") for side in "LR")


class Jumps:
    """The steps between a clip's frames, computed once, with the frames where its motion starts and stops."""

    def __init__(self, clip: Clip) -> None:
        self.clip = clip
        roles = clip.skeleton.roles
        self.trunk = sorted({0, *(roles[r] for r in _TRUNK if r in roles)})
        self.limbs = sorted({roles[r] for r in _LIMBS if r in roles} - set(self.trunk))
        # steps[k] leads from frame k to frame k + 1.
        self.steps = 2.0 * quat.half_angle_between(clip.rotations[1:], clip.rotations[:-1])
        self.shifts = np.diff(clip.root_positions, axis=0)
        self.around = max(2, round(_AROUND_S * clip.fps))
        self.start, self.stop = 0, clip.frames
        if clip.frames > 2:
            self.start, self.stop = self._ends()

    def limit(self, angle_and_speed: tuple[float, float]) -> float:
        """The smallest step that counts, radians."""
        angle, speed = angle_and_speed
        return max(angle, speed / self.clip.fps)

    def jumps(self, joint: int, limits: tuple[float, float]) -> IntArray:
        """The frames that a joint jumps into, between the clip's ends."""
        steps = self.steps[self.start : max(self.stop - 1, self.start), joint]
        large = np.flatnonzero(steps > self.limit(limits))
        return self.start + 1 + np.array([k for k in large if self._stands_out(steps, int(k))], dtype=np.int64)

    def _stands_out(self, steps: FloatArray, k: int) -> bool:
        others = np.concatenate([steps[max(k - self.around, 0) : k], steps[k + 1 : k + 1 + self.around]])
        return bool(not others.size or steps[k] > _TIMES_AROUND * np.median(others))

    def root_jump(self, k: int) -> float:
        """How far the step into frame `k` leads away from where the root was heading, metres; 0 if within reason."""
        limit = _ROOT_JUMP[0] + _ROOT_JUMP[1] / self.clip.fps**2
        beside = self.shifts[[max(k - 2, 0), min(k, len(self.shifts) - 1)]] - self.shifts[k - 1]
        if np.max(np.abs(beside)) < limit / 4.0:
            return 0.0  # a quick look that spares most frames the medians
        low, high = max(k - 1 - self.around, 0), k + self.around
        others = np.delete(self.shifts[low:high], k - 1 - low, axis=0)
        stray = float(np.linalg.norm(self.shifts[k - 1] - np.median(others, axis=0))) if len(others) else 0.0
        usual = float(np.median(np.linalg.norm(others - np.median(others, axis=0), axis=1))) if len(others) else 0.0
        return stray if stray > max(limit, _TIMES_AROUND * usual) else 0.0

    def _ends(self) -> tuple[int, int]:
        """Where the motion starts and stops: behind and before jumps of the whole body near the clip's ends."""
        reach = min(max(2, round(_END_S * self.clip.fps)), (self.clip.frames - 1) // 4)
        start = max((k for k in range(1, reach + 1) if self._whole_body(k, 1)), default=0)
        last = self.clip.frames - 1
        stop = min((k for k in range(last - reach + 1, last + 1) if self._whole_body(k, -1)), default=self.clip.frames)
        return start, stop

    def _whole_body(self, k: int, direction: int) -> bool:
        """Whether the body jumps into frame `k`, compared with the steps of the motion's side of it."""
        inside = self.steps[k : k + self.around] if direction > 0 else self.steps[max(k - 1 - self.around, 0) : k - 1]
        if not len(inside):
            return False
        joints = [*self.trunk, *self.limbs]
        usual = _TIMES_AROUND * np.median(inside[:, joints], axis=0)
        steps = self.steps[k - 1, joints]
        several = int(np.sum(steps > np.maximum(self.limit(_END_JUMP), usual))) >= _END_JOINTS
        # One arm left in its rest pose is no part of the motion either.
        return several or bool(np.any(steps > np.maximum(self.limit(JOINT_JUMP), usual)))


def flipping_legs(found: Jumps) -> list[LegFlips]:
    """The legs whose hip jumps by as much as a flip, with the frames in which they are flipped."""
    clip, legs = found.clip, []
    for side in "LR":
        if all(f"{part}.{side}" in clip.skeleton.roles for part in ("hip", "knee", "ankle")):
            hip = clip.skeleton.roles[f"hip.{side}"]
            jumps = found.jumps(hip, JOINT_JUMP)
            jumps = jumps[found.steps[jumps - 1, hip] >= FLIP_RAD]
            if len(jumps):
                legs.append(leg_flips(clip, side, jumps))
    return legs


def clusters(jumps: IntArray, gap: int) -> list[IntArray]:
    """Jumps at most `gap` frames apart, together."""
    return [c for c in np.split(jumps, np.flatnonzero(np.diff(jumps) > gap) + 1) if len(c)]
