"""Blend lengths by the thousand: all start and end frames that one wants of two clips at once.

In: two clips of one rig at one frame rate, many start frames and as many end frames. Out: the length by the geodesic or
the velocity method and its cost for each. The same as `study.transitions.blend_length` gives one by one (2004 Eqs. 1 to
4): in the table of distances of all frames, the window of every length lies on the diagonal that begins at the source's
start frame, or ends at the destination's end frame, so running sums along the diagonals serve all transitions of the
two clips.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from study.arrays import FloatArray, IntArray
from study.counting import counted
from study.errors import TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip
from study.transitions.blend_length import joint_speeds, length_range
from study.transitions.distances import distance_matrix, on_joints_of
from study.transitions.weights import MAJOR_ROLES, joint_weights

# Numbers held at once: 64 MB of them.
_BLOCK = 8_000_000


def geodesic_lengths(
    source: Clip, destination: Clip, start_frames: ArrayLike, end_frames: ArrayLike
) -> tuple[IntArray, FloatArray]:
    """The geodesic blend length of many transitions between two clips of one rig at one frame rate, and their costs.

    `start_frames` and `end_frames (transitions,)` are whole frame numbers, as `geodesic_length` takes them one at a
    time. Lengths and costs are `(transitions,)`: frames, the shortest of those that cost least, and what they cost
    (running sums round a little: good to about 1e-13). `TransitionError` where the clips don't supply even the shortest
    blend at some of the frames; the message says how many.
    """
    destination = on_joints_of(source, destination)
    starts, ends, low, longest_there = _transitions(source, destination, start_frames, end_frames)
    sums = _diagonal_sums(distance_matrix(source, destination, joint_weights(source.skeleton)))
    flat, row = sums.ravel(), sums.shape[1]
    at = starts * row + ends + 1
    best, cost = np.zeros(len(starts), dtype=np.int64), np.full(len(starts), np.inf)
    for length in range(low, longest_there.max(initial=low) + 1):
        held = np.minimum(length, longest_there)
        # Pairs (i, j-b+1) to (i+b-1, j): the sum to the last of them less the sum to the one before the first.
        costs = (flat[at + held * row] - flat[at - held]) / held
        less = costs < cost
        best[less], cost[less] = length, costs[less]
    return best, cost


def velocity_lengths(
    source: Clip, destination: Clip, start_frames: ArrayLike, end_frames: ArrayLike
) -> tuple[IntArray, FloatArray]:
    """The velocity method's blend length of many transitions between two clips, and what it costs by Eq. 1.

    Parameters, returns and errors are those of `geodesic_lengths`; lengths outside the range are clipped to it.
    """
    destination = on_joints_of(source, destination)
    starts, ends, low, longest_there = _transitions(source, destination, start_frames, end_frames)
    joints = np.array([source.skeleton.role(role) for role in MAJOR_ROLES])
    speeds = [joint_speeds(clip, joints) for clip in (source, destination)]
    sums = _diagonal_sums(distance_matrix(source, destination, joint_weights(source.skeleton)))
    lengths = np.empty(len(starts), dtype=np.int64)
    block = max(1, _BLOCK // (16 * len(joints)))
    for at in range(0, len(starts), block):
        i, j = starts[at : at + block], ends[at : at + block]
        differences = quat.half_angle_between(source.rotations[i][:, joints], destination.rotations[j][:, joints])
        most = np.argmax(differences, axis=1)
        rows = np.arange(len(i))
        speed = 0.5 * (speeds[0][i, most] + speeds[1][j, most])
        gap = differences[rows, most]
        seconds = np.divide(gap, speed, out=np.where(gap > 0, np.inf, 0.0), where=speed > 0)
        lengths[at : at + block] = np.rint(np.clip(seconds * source.fps, low, longest_there[at : at + block]))
    return lengths, (sums[starts + lengths, ends + 1] - sums[starts, ends + 1 - lengths]) / lengths


def _transitions(
    source: Clip, destination: Clip, start_frames: ArrayLike, end_frames: ArrayLike
) -> tuple[IntArray, IntArray, int, IntArray]:
    """The frames as arrays, the shortest length, and for each transition the longest that the clips supply; checked."""
    low, high = length_range(source.fps, None)
    starts, ends = np.asarray(start_frames, dtype=np.int64), np.asarray(end_frames, dtype=np.int64)
    if starts.ndim != 1 or starts.shape != ends.shape:
        raise TransitionError(
            f"Expected as many start frames as end frames in one row each, got shapes {starts.shape} and {ends.shape}."
        )
    lacking = (starts < 0) | (starts + low > source.frames) | (ends - low + 1 < 0) | (ends >= destination.frames)
    if lacking.any():
        first = int(np.argmax(lacking))
        raise TransitionError(
            f"Expected start frames from 0 to {source.frames - low} in {source.name or 'the source'} and end frames "
            f"from {low - 1} to {destination.frames - 1} in {destination.name or 'the destination'}, so that both "
            f"supply blends of {counted(low, 'frame')}; {np.count_nonzero(lacking)} of "
            f"{counted(len(starts), 'transition')} do not, the first from {starts[first]} to {ends[first]}."
        )
    return starts, ends, low, np.minimum(high, np.minimum(source.frames - starts, ends + 1))


def _diagonal_sums(distances: FloatArray) -> FloatArray:
    """`(rows + 1, columns + 1)`: each entry adds the distances on its diagonal before it, from the table's edge on."""
    sums = np.zeros((distances.shape[0] + 1, distances.shape[1] + 1))
    for row in range(distances.shape[0]):
        np.add(sums[row, :-1], distances[row], out=sums[row + 1, 1:])
    return sums
