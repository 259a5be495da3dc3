"""Geodesic blend lengths by the thousand: all start and end frames that one wants of two clips at once.

In: two clips of one rig at one frame rate, many start frames and as many end frames. Out: the cheapest length and its
cost for each. The same as `study.transitions.blend_length` gives one by one (2004 Eqs. 1 and 2): in the table of
distances of all frames, the window of every length lies on the diagonal that begins at the source's start frame, or
ends at the destination's end frame, so running sums along the diagonals serve all transitions of the two clips.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from study.errors import TransitionError
from study.motion.clip import Clip
from study.transitions.blend_length import LONGEST_S, SHORTEST_S, default_frames
from study.transitions.distances import check_same_rig, distance_matrix
from study.transitions.weights import joint_weights

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Costs looked up at once: 64 MB of them.
_BLOCK = 8_000_000


def geodesic_lengths(
    source: Clip,
    destination: Clip,
    start_frames: ArrayLike,
    end_frames: ArrayLike,
    *,
    shortest: int | None = None,
    longest: int | None = None,
    weights: str | Mapping[str, float] = "wang2003",
) -> tuple[IntArray, FloatArray]:
    """The geodesic blend length of many transitions between two clips.

    Parameters
    ----------
    source, destination
        Clips of one rig at one frame rate.
    start_frames, end_frames : (transitions,)
        Whole frame numbers, as `blend_length` takes them one at a time.
    shortest, longest, weights
        As in `blend_length`.

    Returns
    -------
    lengths : (transitions,)
        Frames; the shortest of those that cost least.
    costs : (transitions,)
        What they cost. Running sums round a little: good to about 1e-13.

    Raises
    ------
    TransitionError
        Where the clips don't supply the longest blend at some of the frames; the message says how many.
    """
    check_same_rig(source, destination)
    low = default_frames(source.fps, SHORTEST_S) if shortest is None else shortest
    high = default_frames(source.fps, LONGEST_S) if longest is None else longest
    if not 1 <= low <= high:
        raise TransitionError(f"Expected 1 <= shortest <= longest blend length in frames, got {low} and {high}.")
    starts, ends = np.asarray(start_frames, dtype=np.int64), np.asarray(end_frames, dtype=np.int64)
    if starts.ndim != 1 or starts.shape != ends.shape:
        raise TransitionError(
            f"Expected as many start frames as end frames in one row each, got shapes {starts.shape} and {ends.shape}."
        )
    lacking = (starts < 0) | (starts + high > source.frames) | (ends - high + 1 < 0) | (ends >= destination.frames)
    if lacking.any():
        first = int(np.argmax(lacking))
        raise TransitionError(
            f"Expected start frames from 0 to {source.frames - high} in {source.name or 'the source'} and end frames "
            f"from {high - 1} to {destination.frames - 1} in {destination.name or 'the destination'}, so that both "
            f"supply blends of {high} frames; {np.count_nonzero(lacking)} of {len(starts)} transitions do not, the "
            f"first from {starts[first]} to {ends[first]}."
        )
    sums = _diagonal_sums(distance_matrix(source, destination, joint_weights(source.skeleton, weights)))
    lengths = np.arange(low, high + 1)
    best, cost = np.empty(len(starts), dtype=np.int64), np.empty(len(starts))
    block = max(1, _BLOCK // len(lengths))
    for at in range(0, len(starts), block):
        i, j = starts[at : at + block, None], ends[at : at + block, None]
        # Pairs (i, j-b+1) to (i+b-1, j): the sum to the last of them less the sum to the one before the first.
        costs = (sums[i + lengths, j + 1] - sums[i, j + 1 - lengths]) / lengths
        found = np.argmin(costs, axis=1)
        best[at : at + block] = lengths[found]
        cost[at : at + block] = costs[np.arange(len(found)), found]
    return best, cost


def _diagonal_sums(distances: FloatArray) -> FloatArray:
    """`(rows + 1, columns + 1)`: each entry adds the distances on its diagonal before it, from the table's edge on."""
    sums = np.zeros((distances.shape[0] + 1, distances.shape[1] + 1))
    for row in range(distances.shape[0]):
        np.add(sums[row, :-1], distances[row], out=sums[row + 1, 1:])
    return sums
