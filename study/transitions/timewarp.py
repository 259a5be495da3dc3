"""Time-warped blends: the window in the source and the window in the destination may differ in length.

In: two clips of one rig at one frame rate, a start frame and an end frame. Out: the cost of every pair of lengths, the
cheapest pair, and the blend that follows. Wang & Bodenheimer 2004, section 3.1.4, Eqs. 5 and 6, Figure 4.

The paper does not bound the ratio of the two windows. Without a bound, standing is drawn out without end, since nothing
changes in it: 60 frames of one motion meet 6 of the other. So neither window is longer than `STEEPEST` times the other.
Such a slope constraint is usual wherever motions are warped (Sakoe & Chiba 1978; Kovar & Gleicher 2003, section 3.1).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from study.arrays import FloatArray, IntArray
from study.errors import TransitionError
from study.motion.clip import Clip, retarget, sample
from study.transitions.blend_length import length_range
from study.transitions.blending import Stretch, Transition, blend_weights, join, joint_shares
from study.transitions.distances import half_angle_squares
from study.transitions.registration import registration
from study.transitions.weights import joint_weights
from study.transitions.windows import held, joined_at, lacking

STEEPEST = 2.0
"""The slope of a warp lies between one over this and this."""


@dataclass(frozen=True)
class WarpLength:
    """The cheapest pair of blend lengths."""

    source_frames: int
    destination_frames: int
    """Frames of each clip in the blend (2004: b_from and b_to)."""
    blend_frames: int
    blend_s: float
    """Blend length: the longer of the two, in frames and in seconds."""
    cost: float
    """Its cost."""
    costs: FloatArray
    """`(lengths, lengths)`: the cost of each pair, by source length, then destination length; infinite where the slope
    is too steep."""
    shortest: int
    """The length of the first row and column, frames."""
    note: str = ""
    """What a reader should know: that candidates were excluded."""

    @property
    def windows(self) -> tuple[int, int]:
        """Frames of the source and of the destination in the blend."""
        return self.source_frames, self.destination_frames


def warp_length(
    source: Clip,
    destination: Clip,
    start_frame: int,
    end_frame: int,
    *,
    longest: int | None = None,
    weights: str | Mapping[str, float] = "wang2003",
    average: bool = True,
    steepest: float = STEEPEST,
) -> WarpLength:
    """The pair of blend lengths with the least cost (2004 Eqs. 5 and 6).

    Parameters
    ----------
    source, destination, start_frame, end_frame, longest, weights
        As in `study.transitions.blend_length.geodesic_length`; the range holds for both lengths.
    average
        Divide each sum by its number of terms, as Eq. 1 does, so that equal lengths cost what the geodesic method
        says. Eqs. 5 and 6 print the sum itself (False), which favours short blends for being short.
    steepest
        The longer window has at most this many times the frames of the shorter one, 1 or more; `math.inf` considers
        all pairs, as the paper does.

    Raises
    ------
    TransitionError
        Where the clips don't supply the frames, or differ in rig or frame rate.
    """
    destination = joined_at(source, destination, start_frame, end_frame)
    low, high = length_range(source.fps, longest)
    # A warped window also looks at the frame before its first.
    high, note = held(min(source.frames - start_frame, end_frame) if start_frame else 0, low, high)
    weight = joint_weights(source.skeleton, weights)
    costs = warp_costs(source, destination, start_frame, end_frame, high, weight, average=average, steepest=steepest)[
        low - 1 :, low - 1 :
    ]
    row, column = np.unravel_index(int(np.argmin(costs)), costs.shape)
    lengths = (low + int(row), low + int(column))
    return WarpLength(*lengths, max(lengths), max(lengths) / source.fps, float(costs[row, column]), costs, low, note)


def warp_costs(
    source: Clip,
    destination: Clip,
    start_frame: int,
    end_frame: int,
    longest: int,
    weights: FloatArray,
    *,
    average: bool = True,
    steepest: float = STEEPEST,
) -> FloatArray:
    """The cost of every pair of lengths 1 to `longest` frames, `(longest, longest)`: source length, destination length.

    Eq. 5 where the source's window is no longer than the destination's, else Eq. 6; see `warp_length`. Infinite where
    one length is more than `steepest` times the other.

    Raises
    ------
    TransitionError
        Where the clips lack frames. A warped window also looks between its first frame and the frame before it, so
        one frame more is needed before the start frame and before the destination's window.

    Notes
    -----
    Poses between frames come by slerp. On the arc from `q0` to `q1`, `theta` apart, the dot product with any `p` is
    `cos(u theta) (q0 . p) + sin(u theta) ((q1 . p) - cos(theta) (q0 . p)) / sin(theta)`, so a table of dot products of
    whole frames serves all the poses between them, exactly.
    """
    _check_supply(source, destination, start_frame, end_frame, longest, longest)
    used = np.flatnonzero(weights)
    a = source.rotations[start_frame - 1 : start_frame + longest][:, used]
    b = destination.rotations[end_frame - longest : end_frame + 1][:, used]
    # Eq. 5: the source's poses move, from frame i-1 on; the destination's are frames j-b_to+1 to j.
    source_moves = _Arcs(a, b[1:], weights[used])
    # Eq. 6: the destination's poses move, from frame j-b_to on; the source's are frames i to i+b_from-1.
    destination_moves = _Arcs(b, a[1:], weights[used])
    if steepest < 1.0:
        raise TransitionError(f"Expected a steepest slope of at least 1, got {steepest}.")
    costs = np.full((longest, longest), np.inf)
    for longer in range(1, longest + 1):
        least = max(1, math.ceil(longer / steepest - 1e-9))
        costs[least - 1 : longer, longer - 1] = source_moves.sums(_pairs(least, longer, longest, False))
        costs[longer - 1, least - 1 : longer] = destination_moves.sums(_pairs(least, longer, longest, True))
    if average:
        lengths = np.arange(1, longest + 1)
        costs /= np.maximum.outer(lengths, lengths)
    return costs


@dataclass(frozen=True, eq=False)
class _Pairs:
    """Which poses meet in all windows of one longer length, for each of `shorter` lengths (rows) and each t (columns).

    A moving pose lies `share (poses,)` of the way from its `row (poses,)` to the next one; many pairs use the same
    pose, so `pose (pairs,)` says which one, and `cell (pairs,)` where its row and the fixed frame are in a table.
    """

    shorter: int
    row: IntArray
    share: FloatArray
    pose: IntArray
    cell: IntArray


@lru_cache(maxsize=512)
def _pairs(least: int, longer: int, longest: int, from_end: bool) -> _Pairs:
    """The pairs of Eq. 5, or with `from_end` those of Eq. 6, whose moving window ends at the last row.

    The shorter lengths are `least` to `longer`.
    """
    lengths, t = np.arange(least, longer + 1), np.arange(1, longer + 1)
    # In parts of 1 / longer of a frame, from the first row or to the last one.
    parts = np.outer(lengths, longer - t) if from_end else np.outer(lengths, t)
    found, pose = np.unique(parts, return_inverse=True)
    row, rest = np.divmod(longest * longer - found if from_end else found, longer)
    pose = pose.reshape(parts.shape)
    fixed = t - 1 if from_end else longest - longer + t - 1
    return _Pairs(len(lengths), row, rest / longer, pose.ravel(), (row[pose] * longest + fixed).ravel())


class _Arcs:
    """Dot products of the arcs between the poses of one clip with the frames of another, joint by joint.

    Parameters
    ----------
    moving : (frames + 1, joints, 4)
    fixed : (frames, joints, 4)
    weights : (joints,)
    """

    def __init__(self, moving: FloatArray, fixed: FloatArray, weights: FloatArray) -> None:
        # The last pose has no arc after it; its own serves, and is only asked for at its start.
        after = np.concatenate([moving[1:], moving[-1:]])
        sign = np.where(np.sum(moving * after, axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
        chord = np.linalg.norm(moving - sign * after, axis=-1)
        self.angles = 2.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0))
        dots, dots_after = (
            np.matmul(q.transpose(1, 0, 2), fixed.transpose(1, 2, 0)).transpose(1, 2, 0) for q in (moving, sign * after)
        )
        sine = np.sin(self.angles)
        across = (dots_after - np.cos(self.angles)[:, None] * dots) / np.where(sine < 1e-9, 1.0, sine)[:, None]
        self.dots, self.across = (np.ascontiguousarray(x).reshape(-1, moving.shape[1]) for x in (dots, across))
        self.weights = weights
        # Arrays of this size are returned to the system and allocated again each time, which costs more than
        # the sums do.
        self.work = np.empty((3, len(fixed) ** 2, moving.shape[1]))

    def sums(self, pairs: _Pairs) -> FloatArray:
        """The cost summed over t for each shorter length, `(shorter,)`."""
        sine = np.sin(self.angles[pairs.row] * pairs.share[:, None])
        # Arcs between frames stay far below a quarter turn of the half angle, where this would lose digits.
        cosine = np.sqrt(1.0 - sine * sine)
        dots, rest, table = self.work[:, : len(pairs.pose)]
        # "clip" lets take write in place; every index is within range.
        cosine.take(pairs.pose, axis=0, out=dots, mode="clip")
        dots *= self.dots.take(pairs.cell, axis=0, out=table, mode="clip")
        sine.take(pairs.pose, axis=0, out=rest, mode="clip")
        rest *= self.across.take(pairs.cell, axis=0, out=table, mode="clip")
        dots += rest
        return np.asarray((half_angle_squares(dots) @ self.weights).reshape(pairs.shorter, -1).sum(axis=1))


def _check_supply(
    source: Clip, destination: Clip, start_frame: int, end_frame: int, source_frames: int, destination_frames: int
) -> None:
    # A warped window also looks at the frame before its first.
    faults = [
        *lacking(source, "source", start_frame - 1, start_frame + source_frames),
        *lacking(destination, "destination", end_frame - destination_frames, end_frame + 1),
    ]
    if faults:
        raise TransitionError(
            f"Expected clips with frames for warped blends of {source_frames} source and {destination_frames} "
            f"destination frames at source frame {start_frame} and destination frame {end_frame}, but "
            f"{'; '.join(faults)}. Choose other frames, or use longer clips."
        )


def warped_blend(
    source: Clip,
    destination: Clip,
    start_frame: int,
    end_frame: int,
    source_frames: int,
    destination_frames: int,
    *,
    weight: str = "linear",
    in_step: bool = False,
) -> Transition:
    """Source, a blend in which the shorter window is slowed to the length of the longer one, destination.

    Parameters
    ----------
    source, destination, start_frame, end_frame, weight
        As in `study.transitions.blending.blend`.
    source_frames, destination_frames
        Frames of each clip that go into the blend, at least 1, as `warp_length` chooses them. The blend takes as many
        frames as the longer window has.
    in_step
        Whether the windows are warped by a registration curve (`study.transitions.registration`) and not evenly.

    Returns
    -------
    Transition
        With equal lengths and not in step, the same as `blend`.

    Raises
    ------
    TransitionError
        Where the clips don't supply the frames, one before each window among them, or differ in rig or frame rate.
    """
    destination = joined_at(source, destination, start_frame, end_frame)
    if min(source_frames, destination_frames) < 1:
        raise TransitionError(
            f"Expected at least 1 frame of each clip in a blend, got {source_frames} and {destination_frames}."
        )
    _check_supply(source, destination, start_frame, end_frame, source_frames, destination_frames)
    destination = retarget(destination, source.skeleton)
    count = max(source_frames, destination_frames)
    even = np.arange(count + 1) / count
    before, ahead = (start_frame - 1, end_frame - destination_frames), np.zeros(count + 1)
    if in_step:
        ahead = registration(
            sample(source, before[0] + source_frames * even), sample(destination, before[1] + destination_frames * even)
        ).at(even)
    return join(
        source,
        destination,
        _stretch(source, before[0] + source_frames * (even - 0.5 * ahead), source_frames / count),
        _stretch(destination, before[1] + destination_frames * (even + 0.5 * ahead), 1.0),
        (start_frame, start_frame + source_frames),
        (end_frame - destination_frames + 1, end_frame + 1),
        blend_weights(count, weight),
        joint_shares(source.skeleton, count, weight, None),
        f"{weight} {'blend along a registration curve' if in_step else 'time-warped blend'} of {source_frames} source "
        f"and {destination_frames} destination frames",
    )


def _stretch(clip: Clip, times: FloatArray, rate_after: float) -> Stretch:
    """The poses at `times (blend_frames + 1,)`, frames, of which the first lies before the blend, and the next one.

    That is `rate_after` frames after the last, which is a whole frame, where the clip has it.
    """
    last = round(float(times[-1]))  # rounding must not put the last pose beside its frame
    has_after = last + rate_after <= clip.frames - 1
    return Stretch(sample(clip, [*times[:-1], last, last + rate_after * has_after]), True, has_after)
