"""Clip: a skeleton in motion; forward kinematics, resampling, trimming, mirroring, retargeting.

Y is up; metres, radians, seconds; quaternions scalar first. A clip is frozen, and its arrays are read-only:
every function here returns a new clip.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from study.errors import MotionError
from study.motion import quaternions as quat
from study.motion.skeleton import Skeleton

FloatArray = NDArray[np.float64]

_UNIT_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Clip:
    """A motion.

    Parameters
    ----------
    skeleton
        Joints and rest offsets.
    root_positions : (frames, 3)
        The root joint in the world, metres.
    rotations : (frames, joints, 4)
        Each joint's rotation in its parent's frame (the root's in the world), unit quaternions; stored with
        signs continuous over the frames and `w >= 0` in the first.
    fps
        Frames per second; never rounded.
    name
        What the clip is called in libraries, plans and reports.
    history
        What was done to it, in order, in words; manifests and reports print it.
    synthetic
        Whether a program made the motion up, rather than a person moved.
    start_s
        Seconds from the first frame of the file to frame 0, for clips that are a part of their file.
    file_fps
        Frames per second of the file, where the clip is at another rate.
    metres_per_unit
        Metres in a length unit of the file that the clip was read from; it is written in that unit again.

    Raises
    ------
    MotionError
        For shapes that don't fit, values that are not finite, quaternions that are not unit, no frames,
        or a frame rate that is not positive.
    """

    skeleton: Skeleton
    root_positions: FloatArray
    rotations: FloatArray
    fps: float
    name: str = ""
    history: tuple[str, ...] = field(default=())
    synthetic: bool = False
    start_s: float = 0.0
    file_fps: float | None = None
    metres_per_unit: float = 0.01

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
    # The tolerance keeps the last frame where (frames - 1) / ratio is whole but for rounding.
    count = int(np.floor((clip.frames - 1) / ratio + 1e-6)) + 1
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
    after = np.minimum(before + 1, clip.frames - 1)
    weight = times - before
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


def moved(clip: Clip, yaw: float, translation: FloatArray) -> Clip:
    """The whole clip turned about the vertical through the origin by `yaw` radians, then shifted `(3,)` metres."""
    turn = quat.yaw(yaw)
    rotations = clip.rotations.copy()
    rotations[:, 0] = quat.multiply(turn, rotations[:, 0])
    return replace(clip, root_positions=quat.rotate(turn, clip.root_positions) + translation, rotations=rotations)


def retarget(clip: Clip, skeleton: Skeleton) -> Clip:
    """The motion on another body with the same joint tree: rotations kept, root path scaled by leg length.

    Scaling the root by the ratio of leg lengths keeps the feet from sliding when stature differs.

    Raises
    ------
    MotionError
        Where names or parents of the joints differ.
    """
    if clip.skeleton is skeleton:
        return clip
    if not clip.skeleton.matches(skeleton):
        missing = sorted(set(clip.skeleton.names) ^ set(skeleton.names))
        raise MotionError(
            f"Expected the same joint tree to move {clip.name or 'the clip'} to another skeleton; "
            f"joints found in only one of them: {', '.join(missing) or 'none, but the parents differ'}. "
            "Use clips of one rig."
        )
    if np.array_equal(clip.skeleton.offsets, skeleton.offsets) and np.array_equal(
        clip.skeleton.end_offsets, skeleton.end_offsets
    ):
        return replace(clip, skeleton=skeleton)
    scale = skeleton.leg_length / clip.skeleton.leg_length
    return replace(
        clip,
        skeleton=skeleton,
        root_positions=clip.root_positions * scale,
        history=(*clip.history, f"retargeted to another skeleton of the rig, root path times {scale:.3f}"),
    )
