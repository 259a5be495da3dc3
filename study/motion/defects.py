"""What is wrong with a captured clip, and what to do about it: drop, mend, refuse or keep.

In: a `Clip`. Out: `Defect`s, or a clip without them. Found are the pose that converters add as the first frame, other
frames at the ends that belong to no motion, jumps of the root, legs that flip (`study.motion.flips`), other joints that
jump, a floor that is not at height 0, and a motion several times too slow or too quick (`study.motion.tempo`). A jump
is a step between two frames that is large, larger than people move, and several times those around it: fast motion is
fast over several frames, a fault is not.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from study.counting import counted
from study.errors import MotionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, trim
from study.motion.flips import FLIP_RAD, LegFlips, leg_flips, turn_back
from study.motion.tempo import wrong_tempo
from study.motion.upright import lying_axis

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

Kind = Literal[
    "t-pose",
    "end-jump",
    "root-jump",
    "joint-flip",
    "joint-jump",
    "below-floor",
    "floating",
    "not-upright",
    "frame-time",
]
Policy = Literal["mend", "drop", "refuse", "keep"]

# Faults show in single frames, so an angle or a length decides at capture rates; at low rates one frame of fast motion
# is larger, so a speed or an acceleration does. Fast people (boxing, ballet, sprinting in the CMU and Bandai data)
# stay under 26 rad/s in the joints that carry weight, or under 50 with the tremble that capture leaves in them.
_JOINT_JUMP = (0.6, 50.0)  # rad, rad/s
_TRUNK_JUMP = (0.3, 24.0)
_END_JUMP = (0.25, 12.0)
_ROOT_JUMP = (0.025, 80.0)  # m, m/s^2
_TIMES_AROUND = 4.0
_AROUND_S = 0.08
# A jump of the whole body this near to an end of the clip cuts off frames that are no part of the motion.
_END_S = 0.05
_END_JOINTS = 3
# Joints of the fourth group are mended across any gap: they carry no weight in any cost and are hardly seen.
_LONGEST_GAP_S = 0.3
_BRIDGE_RAD_PER_S = 20.0
_FLOOR_M = 0.03
_FLOATING_M = 0.10
# An ankle stands about this high; toes that point through the floor don't make the floor lower.
_ANKLE_M = 0.09

_TRUNK = ("pelvis", "spine", "chest", "neck", "head")
_LIMBS = tuple(f"{part}.{side}" for part in ("hip", "knee", "ankle", "shoulder", "elbow") for side in "LR")


@dataclass(frozen=True)
class Defect:
    """Something wrong with a clip.

    Parameters
    ----------
    kind
        `"t-pose"` (an added pose at the start), `"end-jump"` (frames at an end that don't continue into the motion),
        `"root-jump"`, `"joint-flip"` (a leg turned to its wrong side), `"joint-jump"`, `"below-floor"`, `"floating"`,
        `"not-upright"` (a body that lies, or a file with another axis up; not mended), `"frame-time"` (the motion is
        several times too slow or too quick; not mended).
    frame_start, frame_stop
        The frames concerned, as a slice counts them; a jump concerns the frames before and after it.
    joint
        The joint's name; empty where the whole body is meant.
    size, unit
        How large, in `"rad"` or `"m"`; of a frame time, `"times"` too long.
    message
        The same in words.
    severity
        `"major"` where a viewer or a cost function would notice, else `"minor"` (hands, fingers, the floor's height).
    """

    kind: Kind
    frame_start: int
    frame_stop: int
    joint: str
    size: float
    unit: str
    message: str
    severity: Literal["major", "minor"]


def find_defects(clip: Clip) -> tuple[Defect, ...]:
    """All that is wrong with a clip, in the order of frames."""
    found = _Findings(clip)
    defects = [*_end_defects(found), *_root_defects(found), *_flip_defects(found), *_jump_defects(found)]
    defects += [*_floor_defects(found), *_tempo_defects(clip)]
    return tuple(sorted(defects, key=lambda d: (d.frame_start, d.frame_stop, d.kind, d.joint)))


def mend(clip: Clip, defects: Sequence[Defect] | None = None, *, policy: Policy = "mend") -> Clip:
    """The clip with its defects dealt with; best before resampling, as single frames tell faults from fast motion.

    Parameters
    ----------
    clip
        The clip.
    defects
        What `find_defects` found; found anew by default. Only those given are dealt with.
    policy
        `"mend"`: cut off frames at the ends, turn flipped legs back, bridge short jumps by slerp, put the floor at
        height 0. `"drop"`: keep the longest run of frames without a major defect. `"refuse"`: refuse a clip with major
        defects. `"keep"`: change nothing.

    Raises
    ------
    MotionError
        By `"refuse"`; by `"mend"` and `"drop"` where less than half of the clip could be kept.
    """
    if policy not in ("mend", "drop", "refuse", "keep"):
        raise MotionError(f"Expected a policy out of mend, drop, refuse, keep, got {policy!r}.")
    defects = find_defects(clip) if defects is None else tuple(defects)
    major = [d for d in defects if d.severity == "major"]
    if policy == "keep" or not defects or (policy == "refuse" and not major):
        return clip
    if policy == "refuse":
        raise MotionError(
            f"Expected a clip without defects, found {len(major)} in {clip.name or 'the clip'}: "
            + "; ".join(d.message for d in major[:3])
            + ("; ..." if len(major) > 3 else "")
            + ". Mend them, drop their frames, or use another clip."
        )
    if policy == "drop":
        return _longest_clean(clip, [(d.frame_start, d.frame_stop) for d in major])
    mended = _mend_all(clip, defects)
    # Turning a leg back can leave a step in its foot that stood hidden among larger ones.
    left = []
    if any(d.kind == "joint-flip" for d in defects):
        left = [d for d in find_defects(mended) if d.kind == "joint-jump" and d.severity == "major"]
    return _mend_all(mended, left) if left else mended


# What the line in a clip's history about its defects begins with.
TOLD = "defects "
_MENDABLE = {
    "t-pose": ("an added T-pose", "added T-poses"),
    "end-jump": ("an end that is no part of the motion", "ends that are no part of the motion"),
    "root-jump": ("a jump of the root", "jumps of the root"),
    "joint-flip": ("a flip of a leg", "flips of a leg"),
    "joint-jump": ("a jump of a joint", "jumps of joints"),
    "below-floor": ("feet below the floor", "feet below the floor"),
    "floating": ("feet above the floor", "feet above the floor"),
}


def told(defects: Sequence[Defect], *, kept: bool, first_frame: int) -> str:
    """A clip's defects and what became of them, in one line for its history.

    Parameters
    ----------
    defects
        What was found.
    kept
        Whether they are still there.
    first_frame
        The frame of the file that is frame 0 of the clip.
    """
    counts: Counter[str] = Counter(defect.kind for defect in defects)
    found = {kind: words for kind, words in _MENDABLE.items() if counts[kind]}
    mended = [one if counts[kind] == 1 else f"{counts[kind]} {many}" for kind, (one, many) in found.items()]
    left = [defect.message for defect in defects if defect.kind not in _MENDABLE]
    parts = [f"{'kept' if kept else 'dropped or mended'}: {', '.join(mended)}"] if mended else []
    parts += [f"not mended: {'; '.join(left)}"] if left else []
    parts += [f"frame 0 is frame {first_frame} of the file"] if first_frame else []
    return TOLD + "; ".join(parts)


# -- Finding --------------------------------------------------------------------------------------------------------


class _Findings:
    """What several kinds of defects are found from, computed once: steps between frames, and the clip's ends."""

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
        return several or bool(np.any(steps > np.maximum(self.limit(_JOINT_JUMP), usual)))


def _end_defects(found: _Findings) -> list[Defect]:
    clip, defects = found.clip, []
    for start, stop, jump, word in (
        (0, found.start, found.start, "first"),
        (found.stop, clip.frames, found.stop, "last"),
    ):
        if stop > start:
            size = float(np.max(found.steps[jump - 1, [*found.trunk, *found.limbs]]))
            count = stop - start
            what = "an added T-pose" if _is_t_pose(clip, start) else "no part of the motion"
            kind: Kind = "t-pose" if _is_t_pose(clip, start) else "end-jump"
            frames = f"the {word} frame is" if count == 1 else f"the {word} {count} frames are"
            message = f"{frames} {what}: the body jumps by up to {np.degrees(size):.0f} degrees"
            defects.append(Defect(kind, start, stop, "", size, "rad", message, "major"))
    return defects


def _is_t_pose(clip: Clip, frame: int) -> bool:
    """Whether both arms stretch out sideways, level and straight, and the legs stand straight."""
    roles = clip.skeleton.roles
    if not all(f"{part}.{side}" in roles for part in ("hip", "ankle", "shoulder", "elbow", "wrist") for side in "LR"):
        return False
    pose = joint_positions(trim(clip, frame, frame + 1))[0]

    def direction(start: str, stop: str) -> FloatArray:
        bone = pose[roles[stop]] - pose[roles[start]]
        return np.asarray(bone / max(float(np.linalg.norm(bone)), 1e-9))

    across = direction("shoulder.R", "shoulder.L")
    arms = [direction("shoulder.L", "wrist.L") @ across, -(direction("shoulder.R", "wrist.R") @ across)]
    legs = [-direction(f"hip.{side}", f"ankle.{side}")[1] for side in "LR"]
    return bool(min(arms) > np.cos(np.radians(30.0)) and min(legs) > np.cos(np.radians(20.0)))


def _root_defects(found: _Findings) -> list[Defect]:
    clip, defects = found.clip, []
    for k in range(1, clip.frames):
        if size := found.root_jump(k):
            message = f"the root jumps by {size * 100:.1f} cm between frames {k - 1} and {k}"
            defects.append(Defect("root-jump", k - 1, k + 1, clip.skeleton.names[0], size, "m", message, "major"))
    for k in found.jumps(0, _TRUNK_JUMP).tolist():
        size = float(found.steps[k - 1, 0])
        message = f"the root turns by {np.degrees(size):.0f} degrees between frames {k - 1} and {k}"
        defects.append(Defect("root-jump", k - 1, k + 1, clip.skeleton.names[0], size, "rad", message, "major"))
    return defects


def _legs(found: _Findings) -> list[LegFlips]:
    clip, legs = found.clip, []
    for side in "LR":
        if all(f"{part}.{side}" in clip.skeleton.roles for part in ("hip", "knee", "ankle")):
            hip = clip.skeleton.roles[f"hip.{side}"]
            jumps = found.jumps(hip, _JOINT_JUMP)
            jumps = jumps[found.steps[jumps - 1, hip] >= FLIP_RAD]
            if len(jumps):
                legs.append(leg_flips(clip, side, jumps))
    return legs


def _flip_defects(found: _Findings) -> list[Defect]:
    clip, defects = found.clip, []
    for leg in _legs(found):
        name = clip.skeleton.names[clip.skeleton.roles[f"hip.{leg.side}"]]
        for start, stop in leg.runs:
            size = float(np.max(np.abs(leg.angles[start:stop])))
            message = (
                f"{name} flips: the leg is turned by up to {np.degrees(size):.0f} degrees about the line from hip to "
                f"ankle in frame{f's {start} to {stop - 1}' if stop - start > 1 else f' {start}'}"
            )
            defects.append(Defect("joint-flip", start, stop, name, size, "rad", message, "major"))
    return defects


def _jump_defects(found: _Findings) -> list[Defect]:
    clip, defects = found.clip, []
    flipping = {side: leg.runs for leg in _legs(found) for side in leg.side}
    for joint in range(1, clip.skeleton.joints):
        name = clip.skeleton.names[joint]
        jumps = found.jumps(joint, _TRUNK_JUMP if joint in found.trunk else _JOINT_JUMP)
        jumps = np.array([k for k in jumps if not _explained(clip, joint, int(k), flipping)], dtype=np.int64)
        for cluster in _clusters(jumps, found.around):
            first, last = int(cluster[0]), int(cluster[-1])
            size = float(np.max(found.steps[cluster - 1, joint]))
            where = f"between frames {first - 1} and {first}" if first == last else f"in frames {first - 1} to {last}"
            times = "" if len(cluster) == 1 else f" {len(cluster)} times"
            message = f"{name} jumps{times} by up to {np.degrees(size):.0f} degrees {where}"
            severity: Literal["major", "minor"] = "major" if joint in found.trunk or joint in found.limbs else "minor"
            defects.append(Defect("joint-jump", first - 1, last + 1, name, size, "rad", message, severity))
    return defects


def _explained(clip: Clip, joint: int, jump: int, flipping: dict[str, tuple[tuple[int, int], ...]]) -> bool:
    """Whether a hip or an ankle jumps because its leg flips there; mending the flip mends it too."""
    for side, runs in flipping.items():
        if joint in (clip.skeleton.roles[f"hip.{side}"], clip.skeleton.roles[f"ankle.{side}"]):
            return any(start <= jump <= stop for start, stop in runs)
    return False


def _clusters(jumps: IntArray, gap: int) -> list[IntArray]:
    return [c for c in np.split(jumps, np.flatnonzero(np.diff(jumps) > gap) + 1) if len(c)]


def _tempo_defects(clip: Clip) -> list[Defect]:
    tempo = wrong_tempo(clip)
    if tempo is None:
        return []
    return [Defect("frame-time", 0, clip.frames, "", tempo.times, "times", tempo.message(clip.fps), "major")]


def _floor_defects(found: _Findings) -> list[Defect]:
    clip = found.clip
    if (lying := lying_axis(clip)) is not None:
        message = f"the body lies along {lying}, but not in its rest pose: if it stands, export the file with Y up"
        return [Defect("not-upright", 0, clip.frames, "", np.pi / 2, "rad", message, "major")]
    feet = _foot_heights(trim(clip, found.start, max(found.stop, found.start + 1)))
    if not feet:
        return []
    defects = []
    level = max(max(foot.tip, foot.ankle - _ANKLE_M) for foot in feet)
    if not -_FLOOR_M <= level <= _FLOATING_M:
        below = level < 0.0
        message = f"the feet stand {abs(level) * 100:.0f} cm {'below' if below else 'above'} the floor"
        kind: Kind = "below-floor" if below else "floating"
        defects.append(Defect(kind, 0, clip.frames, "", abs(level), "m", message, "minor"))
    for foot in feet:
        depth = min(level, 0.0) - foot.tip
        if depth > 2.0 * _FLOOR_M:
            message = f"{foot.name} points through the floor, up to {depth * 100:.0f} cm deep"
            defects.append(Defect("below-floor", 0, clip.frames, foot.name, depth, "m", message, "minor"))
    return defects


class _Foot(NamedTuple):
    """How high a foot is while it stands, metres: its ankle, and its lowest joint or tip."""

    name: str
    ankle: float
    tip: float


def _foot_heights(clip: Clip) -> list[_Foot]:
    """The twentieth part of each foot's lowest frames, as feet roll, hop and are captured badly now and then."""
    skeleton = clip.skeleton
    heights = joint_positions(clip, ends=True)[..., 1]
    feet = []
    for side in "LR":
        parts = [skeleton.roles[role] for role in (f"ankle.{side}", f"toe.{side}") if role in skeleton.roles]
        tips = [skeleton.joints + e for e, parent in enumerate(skeleton.end_parents) if parent in parts]
        if f"ankle.{side}" in skeleton.roles:
            ankle = float(np.quantile(heights[:, parts[0]], 0.05))
            lowest = float(np.quantile(heights[:, [*parts, *tips]].min(axis=1), 0.05))
            feet.append(_Foot(skeleton.names[parts[0]], ankle, lowest))
    return feet


# -- Mending --------------------------------------------------------------------------------------------------------


def _longest_clean(clip: Clip, spans: Sequence[tuple[int, int]]) -> Clip:
    """The longest run of frames outside the spans."""
    clean = np.ones(clip.frames, dtype=bool)
    for start, stop in spans:
        # Of the two frames of a jump at an end, the one on the motion's side may stay.
        clean[start:stop] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], clean, [False]]).astype(np.int8)))
    runs = sorted(zip(edges[::2], edges[1::2], strict=True), key=lambda run: run[0] - run[1])
    if not runs or 2 * (runs[0][1] - runs[0][0]) < clip.frames:
        raise MotionError(
            f"Expected at least half of {clip.name or 'the clip'} to be free of defects, found "
            f"{int(runs[0][1] - runs[0][0]) if runs else 0} of {counted(clip.frames, 'frame')} in a row. "
            "Mend it, or use another clip."
        )
    return trim(clip, int(runs[0][0]), int(runs[0][1]))


def _mend_all(clip: Clip, defects: Sequence[Defect]) -> Clip:
    found = _Findings(clip)
    rotations, positions = clip.rotations.copy(), clip.root_positions.copy()
    notes: list[str] = []
    names = list(clip.skeleton.names)
    flipped = {d.joint for d in defects if d.kind == "joint-flip"}
    for leg in _legs(found):
        name = names[clip.skeleton.roles[f"hip.{leg.side}"]]
        if name in flipped:
            turn_back(clip, rotations, leg)
            notes.append(f"turned {name} back in {sum(b - a for a, b in leg.runs)} flipped frames")
    breaks = _bridge_root(found, defects, rotations, positions, notes)
    jumps = [d for d in defects if d.kind == "joint-jump" and not _reaches(d, breaks)]
    for defect in jumps:
        if defect.severity == "minor" or defect.frame_stop - defect.frame_start - 2 <= _LONGEST_GAP_S * clip.fps:
            _bridge_joint(found, defect, rotations[:, names.index(defect.joint)])
    if jumps:
        joints = sorted({d.joint for d in jumps})
        notes.append(f"bridged {len(jumps)} jumps of {', '.join(joints[:4])}{' and others' if len(joints) > 4 else ''}")
    mended = replace(clip, rotations=rotations, root_positions=positions, history=(*clip.history, *notes))
    ends = [(d.frame_start, d.frame_stop) for d in defects if d.kind in ("t-pose", "end-jump")]
    start = max((stop for first, stop in ends if first == 0), default=0)
    stop = min((first for first, stop in ends if stop == clip.frames), default=clip.frames)
    pieces = [start, *(k for k in breaks if start < k < stop), stop]
    longest = max(range(len(pieces) - 1), key=lambda i: pieces[i + 1] - pieces[i])
    start, stop = pieces[longest], pieces[longest + 1]
    if 2 * (stop - start) < clip.frames:
        raise MotionError(
            f"Expected at least half of {clip.name or 'the clip'} in one piece, found {stop - start} of {clip.frames} "
            "frames between jumps of the root. Use another clip."
        )
    mended = trim(mended, start, stop)
    floor = next((d for d in defects if d.kind in ("below-floor", "floating") and not d.joint), None)
    if floor is None:
        return mended
    shift = floor.size if floor.kind == "below-floor" else -floor.size
    moved = mended.root_positions + np.array([0.0, shift, 0.0])
    return replace(mended, root_positions=moved).noting(f"moved by {shift * 100:+.1f} cm onto the floor")


def _bridge_root(
    found: _Findings, defects: Sequence[Defect], rotations: FloatArray, positions: FloatArray, notes: list[str]
) -> list[int]:
    """Bridge the whole pose where the root jumps away and back; the frames where it doesn't come back are returned."""
    jumps = sorted({d.frame_start + 1 for d in defects if d.kind == "root-jump"})
    inside = np.array([k for k in jumps if found.start < k < found.stop], dtype=np.int64)
    breaks = []
    for cluster in _clusters(inside, found.around):
        before, after = int(cluster[0]) - 1, int(cluster[-1])
        if before == after - 1:
            breaks.append(after)
            continue
        share = np.linspace(0.0, 1.0, after - before + 1)[:, None]
        positions[before : after + 1] = positions[before] + share * (positions[after] - positions[before])
        rotations[before : after + 1] = quat.slerp(rotations[before], rotations[after], share)
        notes.append(f"bridged a jump of the root in frames {before + 1} to {after - 1}")
    return breaks


def _reaches(defect: Defect, breaks: Sequence[int]) -> bool:
    return any(defect.frame_start < k < defect.frame_stop for k in breaks)


def _bridge_joint(found: _Findings, defect: Defect, path: FloatArray) -> None:
    """Slerp one joint's rotations `(frames, 4)`, in place, over a gap wide enough for a speed that people reach."""
    before, after = defect.frame_start, defect.frame_stop - 1
    widest = after - before + 2 * max(2, round(_AROUND_S * found.clip.fps))
    while after - before < widest:
        angle = 2.0 * float(quat.half_angle_between(path[before], path[after]))
        if after - before >= 2 and angle * found.clip.fps <= _BRIDGE_RAD_PER_S * (after - before):
            break
        before, after = max(before - 1, found.start), min(after + 1, found.stop - 1)
        if (before, after) == (found.start, found.stop - 1):
            break
    share = np.linspace(0.0, 1.0, after - before + 1)
    path[before : after + 1] = quat.slerp(path[before], path[after], share)
