"""One clip out of two: aligned in facing and floor position, then cut or blended.

In: a source and a destination clip of one rig at one frame rate, a start frame, an end frame and a blend length.
Out: a `Transition`. Wang & Bodenheimer 2004, section 3: slerp of every joint under a linear or sigmoid weight, with
facing and floor position aligned during the blend; 2003, section 4.2: the hard cut.

How the root is blended. Placing the destination once and mixing the two root positions would add the distance
between them, times the slope of the weight, to the velocity: two walkers at different speeds would hop at both
ends of the blend and slide between. So the global degrees of freedom are blended as rates (after Rose et al. 1998):
each clip's step from frame to frame, seen in its own facing, and its turn from frame to frame are mixed and added
up. The velocity runs over from one clip's to the other's without a jump, straight ahead stays straight ahead, and
turning or moving either clip on the floor changes nothing. The height above the floor is mixed directly, since the
floor is the same for both, and so is the lean that is left of the root's rotation when its facing is taken away.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from study.arrays import FloatArray
from study.counting import counted
from study.errors import TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip, joint_positions, moved, picked, retarget
from study.motion.skeleton import Skeleton
from study.transitions.windows import joined_at, shortfall, window

WEIGHTS = ("linear", "sigmoid")


@dataclass(frozen=True)
class Alignment:
    """How the destination was placed: turned about the vertical through the origin, then shifted on the floor.

    `study.motion.clip.moved(destination, yaw, translation)` repeats it.
    """

    yaw: float
    translation: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Transition:
    """A clip that goes from one motion into another."""

    clip: Clip
    """The result, on the source's skeleton. Frames before the blend are the source's own; frames after it are the
    destination's, moved by `alignment`."""
    blend_start: int
    blend_stop: int
    """The blended frames of the result, as a slice counts them; equal for a cut."""
    source_frames: tuple[int, int]
    destination_frames: tuple[int, int]
    """The stretch of each clip that went into the blend, as a slice counts it. Frame `f < blend_start` of the result is
    frame `f` of the source; frame `f >= blend_stop` is frame `f - blend_stop + destination_frames[1]` of the
    destination."""
    blend_frames: int
    """The blend length, `blend_stop - blend_start`; 0 for a cut."""
    alignment: Alignment
    """How the destination (on the source's skeleton) was placed."""
    note: str = ""
    """How it was made, in words."""


def blend_weights(blend_frames: int, weight: str = "linear") -> FloatArray:
    """The destination's share in each blended frame, `(blend_frames,)`, rising within 0 and 1.

    Linear: `n / (b + 1)` for n from 1 to b, so that the last frame before the blend (0) and the first one after it (1)
    continue the ramp: no frame is a mere copy and no step is skipped, down to a blend of one frame, which is half
    of each. Sigmoid: the same ramp through `x * x * (3 - 2 * x)`. Both are symmetric: reversing the roles of the clips
    reverses the shares.
    """
    ramp = np.arange(1, blend_frames + 1) / (blend_frames + 1.0)
    if weight == "linear":
        return ramp
    if weight == "sigmoid":
        return np.asarray(ramp * ramp * (3.0 - 2.0 * ramp))
    raise TransitionError(f"Expected a weight of {' or '.join(map(repr, WEIGHTS))}, got {weight!r}.")


def facing(clip: Clip) -> FloatArray:
    """Where the figure faces, `(frames,)`, radians about the vertical, 0 along +Z, continuous over the frames.

    Square to the mean of the hip line and the shoulder line, which turn against each other in walking. Geometry
    rather than the root's rotation, so that it means the same on any rig.
    """
    positions = joint_positions(clip)
    across = np.zeros((clip.frames, 3))
    for part in ("hip", "shoulder"):
        line = positions[:, clip.skeleton.role(f"{part}.L")] - positions[:, clip.skeleton.role(f"{part}.R")]
        across += line / np.maximum(np.linalg.norm(line, axis=1, keepdims=True), 1e-9)
    return np.unwrap(np.arctan2(-across[:, 2], across[:, 0]))


def blend(
    source: Clip,
    destination: Clip,
    start_frame: int,
    end_frame: int,
    blend_frames: int,
    *,
    weight: str = "linear",
    specification: str = "start-end",
    joint_frames: Mapping[str, int] | None = None,
) -> Transition:
    """Source, then a blend, then destination (2004 section 3).

    Parameters
    ----------
    source, destination
        Clips of one rig at one frame rate; the destination is put on the source's skeleton.
    start_frame, end_frame
        With the specification `"start-end"`: the first source frame in the blend and the last destination frame in
        it. See `study.transitions.windows` for `"centre"` and `"left"`.
    blend_frames
        Blended frames, at least 1.
    weight
        `"linear"` or `"sigmoid"`; see `blend_weights`.
    joint_frames
        Shorter blends for some joints, by role, each in the middle of the blend; 2004 (section 3.1.4) tried this and
        advises against it, since it breaks the coherence of the body.

    Returns
    -------
    Transition
        With `source_frames[0] + blend_frames + (destination.frames - destination_frames[1])` frames.

    Raises
    ------
    TransitionError
        Where the clips don't supply the frames (the message counts them), or differ in rig or frame rate.
    """
    destination = joined_at(source, destination, start_frame, end_frame)
    frames = window(start_frame, end_frame, blend_frames, specification)
    if lacking := shortfall(source, destination, frames):
        raise TransitionError(
            f"Expected clips with frames for a blend of {counted(blend_frames, 'frame')} at source frame "
            f"{start_frame} and "
            f"destination frame {end_frame}, but {lacking}. Choose other frames, extend the clip or blend shorter."
        )
    destination = retarget(destination, source.skeleton)
    return join(
        source,
        destination,
        _margins(source, frames.source_start, blend_frames),
        _margins(destination, frames.destination_start, blend_frames),
        (frames.source_start, frames.source_stop),
        (frames.destination_start, frames.destination_stop),
        blend_weights(blend_frames, weight),
        joint_shares(source.skeleton, blend_frames, weight, joint_frames),
        f"{weight} blend of {counted(blend_frames, 'frame')}, {specification}",
    )


def joint_shares(
    skeleton: Skeleton, blend_frames: int, weight: str, joint_frames: Mapping[str, int] | None
) -> FloatArray:
    """The destination's share by blended frame and joint, `(blend_frames, joints)`; `joint_frames` as in `blend`."""
    shares = np.tile(blend_weights(blend_frames, weight)[:, None], (1, skeleton.joints))
    for role, own_frames in (joint_frames or {}).items():
        if not 1 <= own_frames <= blend_frames:
            raise TransitionError(
                f"Expected a blend of 1 to {counted(blend_frames, 'frame')} for the role {role!r}, got {own_frames}; "
                "no joint blends for longer than the figure."
            )
        first = (blend_frames - own_frames) // 2
        own = np.zeros(blend_frames)
        own[first : first + own_frames] = blend_weights(own_frames, weight)
        own[first + own_frames :] = 1.0
        shares[:, skeleton.role(role)] = own
    return shares


def cut(source: Clip, destination: Clip, start_frame: int, end_frame: int) -> Transition:
    """Source up to the frame before `start_frame`, then destination from `end_frame`, with no blend (2003 section 4.2).

    The destination's frame `end_frame` stands where the source's frame `start_frame`, whose place it takes, stood,
    and faces as it faced. Cutting a clip to itself at one frame gives the clip.
    """
    destination = joined_at(source, destination, start_frame, end_frame)
    destination = retarget(destination, source.skeleton)
    turn = float(facing(picked(source, [start_frame]))[0] - facing(picked(destination, [end_frame]))[0])
    alignment = alignment_of(turn, source.root_positions[start_frame], destination.root_positions[end_frame])
    clip = assemble(source, start_frame, None, destination, end_frame, alignment, f"cut at frame {start_frame}")
    return Transition(
        clip, start_frame, start_frame, (start_frame, start_frame), (end_frame, end_frame), 0, alignment, "cut"
    )


@dataclass(frozen=True, eq=False)
class Stretch:
    """The poses of one clip that go into a blend, with one before and one after them, and whether these exist.

    Where they don't, the nearest pose is used without its step.
    """

    clip: Clip
    has_before: bool
    has_after: bool


def _margins(clip: Clip, start: int, blend_frames: int) -> Stretch:
    wanted = np.arange(start - 1, start + blend_frames + 1)
    inside = np.clip(wanted, 0, clip.frames - 1)
    return Stretch(picked(clip, inside), bool(wanted[0] >= 0), bool(wanted[-1] < clip.frames))


def join(
    source: Clip,
    destination: Clip,
    source_stretch: Stretch,
    destination_stretch: Stretch,
    source_frames: tuple[int, int],
    destination_frames: tuple[int, int],
    share: FloatArray,
    shares: FloatArray,
    note: str,
) -> Transition:
    """The transition whose blended frames mix two stretches of equally many poses.

    Parameters
    ----------
    source, destination
        Clips on one skeleton.
    source_stretch, destination_stretch
        What is mixed; `len(share) + 2` poses each.
    source_frames, destination_frames
        The frames of each clip that the stretches cover, as slices count them; the rest before and after is kept.
    share, shares : (blend_frames,), (blend_frames, joints)
        The destination's share in the root and in each joint.
    note
        What is done, in words.
    """
    count = len(share)
    rotations = slerp_one_way(source_stretch.clip.rotations[1:-1], destination_stretch.clip.rotations[1:-1], shares)
    positions, rotations[:, 0], end_facing, end_position = _blend_root(source_stretch, destination_stretch, share)
    last = count + (1 if destination_stretch.has_after else 0)
    alignment = alignment_of(
        end_facing - float(facing(destination_stretch.clip)[last]),
        end_position,
        destination_stretch.clip.root_positions[last],
    )
    blended = replace(source, root_positions=positions, rotations=rotations)
    note = f"{note}, from source frame {source_frames[0]} to destination frame {destination_frames[1] - 1}"
    clip = assemble(source, source_frames[0], blended, destination, destination_frames[1], alignment, note)
    return Transition(
        clip, source_frames[0], source_frames[0] + count, source_frames, destination_frames, count, alignment, note
    )


def slerp_one_way(a: FloatArray, b: FloatArray, share: FloatArray) -> FloatArray:
    """Slerp of two stretches of motion `(frames, joints, 4)` under shares `(frames, joints)`, each joint one way round.

    Each joint takes the way that is shorter over the whole stretch. If chosen again at each frame, two rotations
    about half a turn apart would swap sides from one frame to the next, and the limb would jump. Both stretches have
    signs continuous over the frames, as `Clip` stores them.
    """
    dots = np.sum(a * b, axis=-1)
    sign = np.where(np.sum(dots, axis=0) < 0.0, -1.0, 1.0)
    angle = np.arctan2(np.linalg.norm(a - b * sign[:, None], axis=-1), np.linalg.norm(a + b * sign[:, None], axis=-1))
    angle = 2.0 * angle[..., None]
    weight = share[..., None]
    near = np.sin(angle) < 1e-6
    safe = np.where(near, 1.0, np.sin(angle))
    share_a = np.where(near, 1.0 - weight, np.sin((1.0 - weight) * angle) / safe)
    share_b = np.where(near, weight, np.sin(weight * angle) / safe)
    # Opposite quaternions are one rotation, with no way round to prefer: that rotation it is.
    opposite = near & (angle > 1.0)
    mixed = np.where(opposite, a, share_a * a + share_b * (b * sign[:, None]))
    return quat.normalise(mixed)


def _blend_root(
    source: Stretch, destination: Stretch, share: FloatArray
) -> tuple[FloatArray, FloatArray, float, FloatArray]:
    """Root positions and rotations of the blended frames, and facing and position to go on from (see the module).

    The last two belong to the first frame after the blend, or to the last blended one where the destination ends.
    """
    count = len(share)
    headings = [facing(part.clip) for part in (source, destination)]
    step_share = np.convolve(np.concatenate([[0.0], share, [1.0]]), [0.5, 0.5], mode="valid")
    # Where a clip has no frame on the far side of a step, the other clip's step serves alone.
    step_share[0] *= destination.has_before
    step_share[-1] = step_share[-1] if source.has_after else 1.0
    steps = [steps_of(part.clip, heading) for part, heading in zip((source, destination), headings, strict=True)]
    turns = (1.0 - step_share) * steps[0][0] + step_share * steps[1][0]
    strides = (1.0 - step_share)[:, None] * steps[0][1] + step_share[:, None] * steps[1][1]
    first = 0 if source.has_before else 1
    heading = np.concatenate([[0.0], np.cumsum(turns)])
    heading += headings[0][first] - heading[first]
    strides = quat.rotate(quat.yaw(0.5 * (heading[1:] + heading[:-1])), strides)
    path = np.concatenate([np.zeros((1, 3)), np.cumsum(strides, axis=0)])
    path += source.clip.root_positions[first] - path[first]
    height = [part.clip.root_positions[1:-1, 1] for part in (source, destination)]
    path[1:-1, 1] = (1.0 - share) * height[0] + share * height[1]
    leans = [
        quat.continuous(quat.multiply(quat.yaw(-own[1:-1]), part.clip.rotations[1:-1, 0]))[:, None]
        for part, own in zip((source, destination), headings, strict=True)
    ]
    rotations = quat.multiply(quat.yaw(heading[1:-1]), slerp_one_way(leans[0], leans[1], share[:, None])[:, 0])
    last = count + (1 if destination.has_after else 0)
    return path[1:-1], rotations, float(heading[last]), path[last]


def steps_of(clip: Clip, heading: FloatArray) -> tuple[FloatArray, FloatArray]:
    """From frame to frame: the turn, radians, and the step on the floor as seen in the facing halfway, metres."""
    strides = np.diff(clip.root_positions, axis=0) * np.array([1.0, 0.0, 1.0])
    return np.diff(heading), quat.rotate(quat.yaw(-0.5 * (heading[1:] + heading[:-1])), strides)


def alignment_of(turn: float, place: FloatArray, position: FloatArray) -> Alignment:
    """The move on the floor that turns by `turn` and takes `position` above or below `place`."""
    turn = float(np.arctan2(np.sin(turn), np.cos(turn)))
    shift = place - quat.rotate(quat.yaw(turn), position)
    return Alignment(turn, (float(shift[0]), 0.0, float(shift[2])))


def assemble(
    source: Clip,
    source_stop: int,
    blended: Clip | None,
    destination: Clip,
    destination_start: int,
    alignment: Alignment,
    note: str,
) -> Clip:
    """The source's frames before a frame, the blended ones, and the destination's from a frame on, moved."""
    tail = moved(destination, alignment.yaw, np.array(alignment.translation))
    middle = [] if blended is None else [blended]
    names = [clip.name or kind for clip, kind in ((source, "source"), (destination, "destination"))]
    stretches = [
        (source.root_positions[:source_stop], source.rotations[:source_stop]),
        *((part.root_positions, part.rotations) for part in middle),
        (tail.root_positions[destination_start:], tail.rotations[destination_start:]),
    ]
    positions, rotations = (np.concatenate(arrays) for arrays in zip(*stretches, strict=True))
    return Clip(
        source.skeleton,
        positions,
        rotations,
        source.fps,
        metres_per_unit=source.metres_per_unit,
        name=f"{names[0]} to {names[1]}",
        history=(
            *(f"{names[0]}: {line}" for line in source.history),
            *(f"{names[1]}: {line}" for line in destination.history),
            note,
        ),
        synthetic=source.synthetic or destination.synthetic,
    )
