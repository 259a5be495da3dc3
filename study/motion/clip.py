"""Clip: a skeleton in motion; forward kinematics, resampling, trimming, mirroring, retargeting.

Y is up; metres, radians, seconds; quaternions scalar first. A clip is frozen, and its arrays are read-only:
every function here returns a new clip.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from study.arrays import FloatArray, IntArray
from study.errors import MotionError
from study.motion import quaternions as quat
from study.motion.rigs import find_roles
from study.motion.same_rig import shared_joints
from study.motion.skeleton import Skeleton

_UNIT_TOLERANCE = 1e-6
# Frames looked at to tell which joint plays which role.
_POSES = 12

MOST_POSES = 20_000_000
"""Frames times joints that a clip may have: half an hour at 120 frames a second of a body with hands, in 640 MB."""
# A file of few numbers can require many joints in many frames; up to this number it may.
_FEW_POSES, _POSES_A_NUMBER = 1_000_000, 8
LOWEST_FPS, HIGHEST_FPS = 1 / 3600, 100_000.0


@dataclass(frozen=True, eq=False)
class Clip:
    """A motion.

    Raises
    ------
    MotionError
        For shapes that don't fit, values that are not finite, quaternions that are not unit, no frames,
        or a frame rate that is not positive.
    """

    skeleton: Skeleton
    """Joints and rest offsets."""
    root_positions: FloatArray
    """`(frames, 3)`: the root joint in the world, metres."""
    rotations: FloatArray
    """`(frames, joints, 4)`: each joint's rotation in its parent's frame (the root's in the world), unit quaternions;
    stored with signs continuous over the frames and `w >= 0` in the first."""
    fps: float
    """Frames per second; never rounded."""
    name: str = ""
    """What the clip is called in libraries, plans and reports."""
    history: tuple[str, ...] = field(default=())
    """What was done to it, in order, in words; manifests and reports print it."""
    synthetic: bool = False
    """Whether a program made the motion up, rather than a person moved."""
    start_s: float = 0.0
    """Seconds from the first frame of the file to frame 0, for clips that are a part of their file."""
    file_fps: float | None = None
    """Frames per second of the file, where the clip is at another rate."""
    metres_per_unit: float = 0.01
    """Metres in a length unit of the file that the clip was read from; it is written in that unit again."""

    def __post_init__(self) -> None:
        positions = np.array(self.root_positions, dtype=np.float64)
        rotations = np.asarray(self.rotations, dtype=np.float64)
        who = f"clip {self.name!r}" if self.name else "the clip"
        if positions.ndim != 2 or positions.shape[1] != 3 or len(positions) == 0:
            raise MotionError(
                f"Expected root positions of shape (frames, 3), frames >= 1, in {who}, got {positions.shape}."
            )
        expected = (len(positions), self.skeleton.joints, 4)
        if rotations.shape != expected:
            raise MotionError(f"Expected rotations of shape {expected} in {who}, got {rotations.shape}.")
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise MotionError(f"Expected a frame rate above 0 in {who}, got {self.fps}.")
        for label, array in (("root positions", positions), ("rotations", rotations)):
            # A sum is finite where all of its terms are (they are small), and quicker than looking at each.
            if not np.isfinite(array.sum()) and not np.isfinite(array).all():
                frame = int(np.argwhere(~np.isfinite(array))[0][0])
                raise MotionError(
                    f"Expected finite {label} in {who}, found {array[frame].ravel()[:4]} in frame {frame}."
                )
        rotations = _by_part(rotations)
        if np.max(np.abs(np.einsum("kjf,kjf->jf", rotations, rotations) - 1.0)) > 2 * _UNIT_TOLERANCE:
            raise MotionError(f"Expected unit quaternions in {who}; normalise them first.")
        rotations = _with_continuous_signs(rotations).transpose(2, 1, 0)
        for array in (positions, rotations):
            array.setflags(write=False)
        object.__setattr__(self, "root_positions", positions)
        object.__setattr__(self, "rotations", rotations)
        object.__setattr__(self, "fps", float(self.fps))

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.root_positions)

    @property
    def seconds(self) -> float:
        """Duration, counting each frame as shown for `1 / fps` seconds."""
        return self.frames / self.fps

    def noting(self, what: str) -> Clip:
        """The same clip with one more line in its history."""
        return replace(self, history=(*self.history, what))


def refuse_large(frames: int, joints: int, who: str, values: int | None = None) -> None:
    """`MotionError` where a clip would fill the memory, or is far larger than the numbers that a file has for it.

    Parameters
    ----------
    frames, joints
        Of the clip.
    who
        What it is called, for the message.
    values
        Numbers that the file holds.
    """
    if values is not None and frames * joints > max(_FEW_POSES, _POSES_A_NUMBER * values):
        raise MotionError(
            f"Expected most joints of {who} to move, found {joints:,} joints and {values // frames} numbers a frame. "
            "Leave out the joints that have no channels."
        )
    if frames * joints > MOST_POSES:
        raise MotionError(
            f"Expected at most {MOST_POSES:,} frames times joints in {who}, found {frames:,} x {joints:,}. "
            "Cut it into pieces, or take a lower frame rate."
        )


def _by_part(rotations: FloatArray) -> FloatArray:
    """A new array `(4, joints, frames)`: whole rows of one part of one joint, which products run through quickly.

    A clip stores its rotations so, and shows them as `(frames, joints, 4)`.
    """
    return np.array(rotations.transpose(2, 1, 0), order="C")


def _with_continuous_signs(rotations: FloatArray) -> FloatArray:
    """`(4, joints, frames)` with `w >= 0` in the first frame and each sign nearest to the frame before; in place."""
    turns = np.einsum("kjf,kjf->jf", rotations[..., 1:], rotations[..., :-1]) < 0.0
    negative = rotations[0, :, :1] < 0.0
    if turns.any() or negative.any():
        flips = np.logical_xor.accumulate(np.concatenate([negative, turns], axis=1), axis=1)
        np.negative(rotations, out=rotations, where=np.broadcast_to(flips, rotations.shape))
    return rotations


def global_rotations(clip: Clip) -> FloatArray:
    """Each joint's rotation in the world, `(frames, joints, 4)`."""
    return np.ascontiguousarray(_global_parts(clip).transpose(2, 1, 0))


def _global_parts(clip: Clip) -> FloatArray:
    """Each joint's rotation in the world, `(4, joints, frames)`, one level of the tree after the other."""
    world: FloatArray = clip.rotations.transpose(2, 1, 0).copy(order="C")
    for joints, parents in clip.skeleton.levels:
        world[:, joints] = quat.multiply_parts(world[:, parents], world[:, joints])
    return world


def joint_positions(clip: Clip, *, ends: bool = False) -> FloatArray:
    """Forward kinematics: each joint in the world, `(frames, joints, 3)`, metres.

    With `ends`, the end sites follow the joints: `(frames, joints + ends, 3)`, as `Skeleton.bones` counts them.
    """
    skeleton = clip.skeleton
    world = _global_parts(clip)
    count = skeleton.joints + (len(skeleton.end_parents) if ends else 0)
    positions = np.empty((3, count, clip.frames))
    positions[:, 0] = clip.root_positions.T
    for joints, parents in skeleton.levels:
        arms = quat.rotate_parts(world[:, parents], skeleton.offsets[joints].T[..., None])
        positions[:, joints] = positions[:, parents] + arms
    if ends:
        arms = quat.rotate_parts(world[:, skeleton.end_parents], skeleton.end_offsets.T[..., None])
        positions[:, skeleton.joints :] = positions[:, skeleton.end_parents] + arms
    return np.ascontiguousarray(positions.transpose(2, 1, 0))


def rest_positions(skeleton: Skeleton, *, ends: bool = False) -> FloatArray:
    """The joints of the rest pose, root at the origin, `(joints, 3)`, metres; `ends` as `joint_positions` takes it."""
    return np.asarray(joint_positions(at_rest(skeleton), ends=ends)[0])


def at_rest(skeleton: Skeleton) -> Clip:
    """One frame of the rest pose, the root at the origin."""
    return Clip(skeleton, np.zeros((1, 3)), np.tile(quat.IDENTITY, (1, skeleton.joints, 1)), 1.0)


def some_frames(frames: int, most: int = _POSES) -> IntArray:
    """Up to `most` of so many frames, as far apart as can be."""
    return np.unique(np.linspace(0, frames - 1, min(frames, most)).astype(np.int64))


def with_roles(clip: Clip, mapping: Mapping[str, str] | None = None) -> Clip:
    """The clip with its joints' roles found again, also from its poses; `mapping` as `rigs.find_roles` takes it."""
    poses, rig = joint_positions(picked(clip, some_frames(clip.frames)), ends=True), clip.skeleton
    known = find_roles(
        rig.names, rig.parents, rig.offsets, rig.end_parents, rig.end_offsets, poses=poses, mapping=mapping
    )
    return replace(clip, skeleton=replace(rig, known=known))


def resample(clip: Clip, fps: float) -> Clip:
    """The clip at another frame rate: slerp for rotations, linear for the root; the first frame stays.

    Frames that fall on frames of the original come back exactly. The last frame is the last one within the
    original's span.
    """
    if not (np.isfinite(fps) and fps > 0):
        raise MotionError(f"Expected a frame rate above 0 to resample to, got {fps}.")
    if fps == clip.fps:
        return clip
    ratio = clip.fps / fps
    # The tolerance keeps the last frame where (frames - 1) / ratio is whole except for rounding.
    count = int(np.floor((clip.frames - 1) / ratio + 1e-6)) + 1
    refuse_large(count, clip.skeleton.joints, f"{clip.name or 'the clip'} at {fps:g} fps")
    times = np.minimum(np.arange(count) * ratio, clip.frames - 1)
    nearest = np.round(times)
    times = np.where(np.abs(times - nearest) < 1e-6, nearest, times)
    resampled = sample(clip, times)
    return replace(
        resampled,
        fps=float(fps),
        file_fps=clip.file_fps or clip.fps,
        history=(*clip.history, f"resampled from {clip.fps:g} to {fps:g} fps"),
    )


def file_frame(clip: Clip, frame: int) -> float:
    """The frame of the clip's own file, at the file's rate, that a frame of the clip shows; a fraction between two."""
    return (clip.start_s + frame / clip.fps) * (clip.file_fps or clip.fps)


def sample(clip: Clip, frames: FloatArray | Sequence[float]) -> Clip:
    """Poses at fractional frame numbers `(n,)`, within `0 .. frames - 1`: slerp, and linear for the root."""
    times = np.asarray(frames, dtype=np.float64)
    if times.size and (times.min() < 0 or times.max() > clip.frames - 1):
        raise MotionError(
            f"Expected frame numbers from 0 to {clip.frames - 1} in {clip.name or 'the clip'}, "
            f"got {times.min():g} to {times.max():g}."
        )
    before = np.floor(times).astype(np.int64)
    weight = times - before
    if not weight.any():
        return picked(clip, before)
    after = np.minimum(before + 1, clip.frames - 1)
    rotations = quat.slerp(clip.rotations[before], clip.rotations[after], weight[:, None])
    whole = weight == 0.0
    rotations[whole] = clip.rotations[before[whole]]
    positions = clip.root_positions[before]
    positions = positions + weight[:, None] * (clip.root_positions[after] - positions)
    return replace(clip, root_positions=positions, rotations=rotations)


def trim(clip: Clip, start: int, stop: int) -> Clip:
    """Frames `start .. stop - 1`, as a slice counts them; negative numbers are refused."""
    if not 0 <= start < stop <= clip.frames:
        raise MotionError(
            f"Expected 0 <= start < stop <= {clip.frames} frames in {clip.name or 'the clip'}, "
            f"got start {start} and stop {stop}."
        )
    if (start, stop) == (0, clip.frames):
        return clip
    return replace(
        clip,
        root_positions=clip.root_positions[start:stop],
        rotations=clip.rotations[start:stop],
        start_s=clip.start_s + start / clip.fps,
        history=(*clip.history, f"trimmed to frames {start} to {stop - 1} of {clip.frames}"),
    )


def picked(clip: Clip, frames: IntArray | Sequence[int] | slice) -> Clip:
    """A clip of these frames alone, in their order."""
    return replace(clip, root_positions=clip.root_positions[frames], rotations=clip.rotations[frames])


def moved(clip: Clip, yaw: float, translation: FloatArray) -> Clip:
    """The whole clip turned about the vertical through the origin by `yaw` radians, then shifted `(3,)` metres."""
    turn = quat.yaw(yaw)
    rotations = clip.rotations.copy()
    rotations[:, 0] = quat.multiply(turn, rotations[:, 0])
    return replace(clip, root_positions=quat.rotate(turn, clip.root_positions) + translation, rotations=rotations)


def retarget(clip: Clip, skeleton: Skeleton) -> Clip:
    """The motion on another body of the rig: rotations kept, root path scaled by leg length.

    Scaling the root by the ratio of leg lengths keeps the feet from sliding when stature differs. The bodies may differ
    in leaf joints, such as fingers: those that only the clip has are removed, those that only the skeleton has stay at
    rest.

    Raises
    ------
    MotionError
        Where the rigs differ in more than leaf joints and lengths, or in the directions of limbs at rest.
    """
    if clip.skeleton is skeleton:
        return clip
    taken = shared_joints(clip.skeleton, skeleton, clip.name or "the clip")
    has = taken >= 0
    left_out = sorted(set(range(clip.skeleton.joints)) - set(taken.tolist()))
    notes = []
    rotations: FloatArray = clip.rotations
    if left_out or not np.array_equal(taken, np.arange(skeleton.joints)):
        rotations = np.tile(quat.IDENTITY, (clip.frames, skeleton.joints, 1))
        rotations[:, has] = clip.rotations[:, taken[has]]
        notes += [f"removed joints {_some([clip.skeleton.names[j] for j in left_out])}"] if left_out else []
        added = [name for name, there in zip(skeleton.names, has, strict=True) if not there]
        notes += [f"joints at rest {_some(added)}"] if added else []
    same = all(
        np.array_equal(getattr(clip.skeleton, name), getattr(skeleton, name)) for name in ("offsets", "end_offsets")
    )
    if same and not notes:
        return replace(clip, skeleton=skeleton, rotations=rotations)
    legs = clip.skeleton.has("hip", "ankle") and skeleton.has("hip", "ankle")
    scale = skeleton.leg_length / clip.skeleton.leg_length if legs else 1.0
    notes.insert(0, f"retargeted to another skeleton of the rig, root path times {scale:.3f}")
    history = (*clip.history, ", ".join(notes))
    return replace(
        clip, skeleton=skeleton, root_positions=clip.root_positions * scale, rotations=rotations, history=history
    )


def _some(names: Sequence[str]) -> str:
    """The first names of a list, and how many more there are."""
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
