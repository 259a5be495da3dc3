"""What is wrong with a captured clip.

In: a `Clip`. Out: `Defect`s: the pose that converters add as the first frame, other frames at the ends that are no
part of the motion, jumps of the root, legs that flip (`study.motion.flips`), other joints that jump
(`study.motion.jumps`), a floor that is not at height 0, and a motion several times too slow or too quick
(`study.motion.tempo`). `study.motion.mending` deals with them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from study.arrays import FloatArray
from study.motion.clip import Clip, joint_positions, trim
from study.motion.jumps import JOINT_JUMP, TRUNK_JUMP, Jumps, clusters, flipping_legs
from study.motion.tempo import wrong_tempo
from study.motion.upright import lying_axis

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

_FLOOR_M = 0.03
_FLOATING_M = 0.10
# An ankle stands about this high; toes that point through the floor don't make the floor lower.
_ANKLE_M = 0.09


@dataclass(frozen=True)
class Defect:
    """Something wrong with a clip."""

    kind: Kind
    """`"t-pose"` (an added pose at the start), `"end-jump"` (frames at an end that don't continue into the motion),
    `"root-jump"`, `"joint-flip"` (a leg turned to its wrong side), `"joint-jump"`, `"below-floor"`, `"floating"`,
    `"not-upright"` (a body that lies, or a file with another axis up; not mended), `"frame-time"` (the motion is
    several times too slow or too quick; not mended)."""
    frame_start: int
    frame_stop: int
    """The frames concerned, as a slice counts them; a jump concerns the frames before and after it."""
    joint: str
    """The joint's name; empty where the whole body is meant."""
    size: float
    unit: str
    """How large, in `"rad"` or `"m"`; of a frame time, `"times"` too long."""
    message: str
    """The same in words."""
    severity: Literal["major", "minor"]
    """`"major"` where a viewer or a cost function would notice, else `"minor"` (hands, fingers, the floor's height)."""


def find_defects(clip: Clip) -> tuple[Defect, ...]:
    """All that is wrong with a clip, in the order of frames."""
    found = Jumps(clip)
    defects = [*_end_defects(found), *_root_defects(found), *_flip_defects(found), *_jump_defects(found)]
    defects += [*_floor_defects(found), *_tempo_defects(clip)]
    return tuple(sorted(defects, key=lambda d: (d.frame_start, d.frame_stop, d.kind, d.joint)))


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


def _end_defects(found: Jumps) -> list[Defect]:
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
    if not clip.skeleton.has("hip", "ankle", "shoulder", "elbow", "wrist"):
        return False
    pose = joint_positions(trim(clip, frame, frame + 1))[0]

    def direction(start: str, stop: str) -> FloatArray:
        bone = pose[roles[stop]] - pose[roles[start]]
        return np.asarray(bone / max(float(np.linalg.norm(bone)), 1e-9))

    across = direction("shoulder.R", "shoulder.L")
    arms = [direction("shoulder.L", "wrist.L") @ across, -(direction("shoulder.R", "wrist.R") @ across)]
    legs = [-direction(f"hip.{side}", f"ankle.{side}")[1] for side in "LR"]
    return bool(min(arms) > np.cos(np.radians(30.0)) and min(legs) > np.cos(np.radians(20.0)))


def _root_defects(found: Jumps) -> list[Defect]:
    clip, defects = found.clip, []
    for k in range(1, clip.frames):
        if size := found.root_jump(k):
            message = f"the root jumps by {size * 100:.1f} cm between frames {k - 1} and {k}"
            defects.append(Defect("root-jump", k - 1, k + 1, clip.skeleton.names[0], size, "m", message, "major"))
    for k in found.jumps(0, TRUNK_JUMP).tolist():
        size = float(found.steps[k - 1, 0])
        message = f"the root turns by {np.degrees(size):.0f} degrees between frames {k - 1} and {k}"
        defects.append(Defect("root-jump", k - 1, k + 1, clip.skeleton.names[0], size, "rad", message, "major"))
    return defects


def _flip_defects(found: Jumps) -> list[Defect]:
    clip, defects = found.clip, []
    for leg in flipping_legs(found):
        name = clip.skeleton.names[clip.skeleton.roles[f"hip.{leg.side}"]]
        for start, stop in leg.runs:
            size = float(np.max(np.abs(leg.angles[start:stop])))
            message = (
                f"{name} flips: the leg is turned by up to {np.degrees(size):.0f} degrees about the line from hip to "
                f"ankle in frame{f's {start} to {stop - 1}' if stop - start > 1 else f' {start}'}"
            )
            defects.append(Defect("joint-flip", start, stop, name, size, "rad", message, "major"))
    return defects


def _jump_defects(found: Jumps) -> list[Defect]:
    clip, defects = found.clip, []
    flipping = {side: leg.runs for leg in flipping_legs(found) for side in leg.side}
    for joint in range(1, clip.skeleton.joints):
        name = clip.skeleton.names[joint]
        jumps = found.jumps(joint, TRUNK_JUMP if joint in found.trunk else JOINT_JUMP)
        jumps = np.array([k for k in jumps if not _explained(clip, joint, int(k), flipping)], dtype=np.int64)
        for cluster in clusters(jumps, found.around):
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


def _tempo_defects(clip: Clip) -> list[Defect]:
    tempo = wrong_tempo(clip)
    if tempo is None:
        return []
    return [Defect("frame-time", 0, clip.frames, "", tempo.times, "times", tempo.message(clip.fps), "major")]


def _floor_defects(found: Jumps) -> list[Defect]:
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
