"""Clips without their defects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from study.arrays import FloatArray
from study.errors import MotionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, trim
from study.motion.defects import Defect, find_defects
from study.motion.flips import turn_back
from study.motion.jumps import Jumps, clusters, flipping_legs

# Joints of the fourth group are mended across any gap: they carry no weight in any cost and are hardly seen.
_LONGEST_GAP_S = 0.3
_BRIDGE_RAD_PER_S = 20.0


def mend(clip: Clip, defects: Sequence[Defect] | None = None) -> Clip:
    """The clip mended; best before resampling, as single frames tell faults from fast motion.

    Frames at the ends that are no part of the motion are cut off, flipped legs turned back, short jumps bridged by
    slerp, and the floor is put at height 0. `defects` are those to deal with; without them, all that `find_defects`
    finds.

    Raises
    ------
    MotionError
        Where less than half of the clip could be kept.
    """
    defects = find_defects(clip) if defects is None else tuple(defects)
    if not defects:
        return clip
    mended = _mend_all(clip, defects)
    # Turning a leg back can leave a step in its foot that stood hidden among larger ones.
    left = []
    if any(d.kind == "joint-flip" for d in defects):
        left = [d for d in find_defects(mended) if d.kind == "joint-jump" and d.severity == "major"]
    return _mend_all(mended, left) if left else mended


def _mend_all(clip: Clip, defects: Sequence[Defect]) -> Clip:
    found = Jumps(clip)
    rotations, positions = clip.rotations.copy(), clip.root_positions.copy()
    notes: list[str] = []
    names = list(clip.skeleton.names)
    flipped = {d.joint for d in defects if d.kind == "joint-flip"}
    for leg in flipping_legs(found):
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
    found: Jumps, defects: Sequence[Defect], rotations: FloatArray, positions: FloatArray, notes: list[str]
) -> list[int]:
    """Bridge the whole pose where the root jumps away and back; the frames where it doesn't come back are returned."""
    jumps = sorted({d.frame_start + 1 for d in defects if d.kind == "root-jump"})
    inside = np.array([k for k in jumps if found.start < k < found.stop], dtype=np.int64)
    breaks = []
    for cluster in clusters(inside, found.around):
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


def _bridge_joint(found: Jumps, defect: Defect, path: FloatArray) -> None:
    """Slerp one joint's rotations `(frames, 4)`, in place, over a gap wide enough for a speed that people reach."""
    before, after = defect.frame_start, defect.frame_stop - 1
    widest = after - before + 2 * found.around
    while after - before < widest:
        angle = 2.0 * float(quat.half_angle_between(path[before], path[after]))
        if after - before >= 2 and angle * found.clip.fps <= _BRIDGE_RAD_PER_S * (after - before):
            break
        before, after = max(before - 1, found.start), min(after + 1, found.stop - 1)
        if (before, after) == (found.start, found.stop - 1):
            break
    share = np.linspace(0.0, 1.0, after - before + 1)
    path[before : after + 1] = quat.slerp(path[before], path[after], share)
