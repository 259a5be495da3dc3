"""Joint weights from transitions that people called good or bad.

In: labelled cuts between frames of clips. Out: symmetric weights of zero or more, the largest one, and how far the best
transitions move in leave-one-out cross-validation. Wang & Bodenheimer 2003, section 3, Eq. 3, and section 4.1.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from study.arrays import FloatArray
from study.counting import counted
from study.errors import TransitionError
from study.motion import quaternions as quat
from study.motion.clip import Clip
from study.motion.joint_names import CENTRE_ROLES, SIDED_ROLES
from study.motion.skeleton import Skeleton
from study.transitions.blending import facing
from study.transitions.cost_matrix import cost_matrix, velocities
from study.transitions.distances import on_joints_of
from study.transitions.windows import joined_at

# Within one clip, frames nearer than this are no transition; seconds.
_APART_S = 0.5


@dataclass(frozen=True, eq=False)
class LabelledCut:
    """A cut from a frame of one clip to a frame of another, and what people said of it."""

    source: Clip
    destination: Clip
    """Clips of one rig at one frame rate."""
    source_frame: int
    destination_frame: int
    """The frames that the cut joins."""
    bad: float
    """1 for a bad transition, 0 for a good one: what the cost should be (Eq. 3). Anything between will do, too."""


@dataclass(frozen=True)
class FittedWeights:
    """What the least squares gave."""

    weights: Mapping[str, float]
    """By role, both sides of a pair the same, the largest one; zeros included."""
    scale: float
    """What the largest weight was before it was scaled to one: times this, bad transitions cost about 1."""
    residual: float
    """Root mean square of what is left of the labels."""
    good: int
    bad: int
    """How many cuts of each there were."""


@dataclass(frozen=True)
class CrossValidation:
    """How far the best transitions move in leave-one-out cross-validation (2003 section 4.1)."""

    deviations: tuple[int, ...]
    """For each cut: frames between the best transition of its two clips by all labels, and by all labels but its own
    (the larger of the distances in source and destination)."""
    mean_frames: float
    median_frames: float
    """Of these."""
    transfer: tuple[int, ...] = ()
    """The same for each cut that is held out and a pair of clips that no label is about; empty where there is no such
    pair."""
    transfer_same: int = 0
    """How many of those agree exactly."""


def weight_groups(skeleton: Skeleton) -> tuple[tuple[str, ...], ...]:
    """The roles that share a weight: left and right of a pair, and each joint of the trunk; each joint once."""
    groups: list[tuple[str, ...]] = []
    taken: set[int] = set()
    for group in (*((role,) for role in CENTRE_ROLES), *((f"{role}.L", f"{role}.R") for role in SIDED_ROLES)):
        joints = {skeleton.roles[role] for role in group if role in skeleton.roles}
        if len(joints) == len(group) and not joints & taken:
            groups.append(group)
            taken |= joints
    return tuple(groups)


def cost_terms(cuts: Sequence[LabelledCut], groups: Sequence[Sequence[str]], nu: float = 1.0) -> FloatArray:
    """The matrix A of Eq. 3: what each group of joints adds to the cost of each cut per unit of weight.

    Squared half angles of pose, plus `nu` times those of velocity, summed over each group's joints `(cuts, groups)`.
    The root's position carries no weight in Eq. 2, and a cut matches it on the floor, so it is not in A.
    """
    return np.array([_terms_of(cut, groups, nu) for cut in cuts]).reshape(len(cuts), len(groups))


def _terms_of(cut: LabelledCut, groups: Sequence[Sequence[str]], nu: float) -> list[float]:
    destination = joined_at(cut.source, cut.destination, cut.source_frame, cut.destination_frame)
    (pose_a, speed_a), (pose_b, speed_b) = (
        _pose(cut.source, cut.source_frame),
        _pose(destination, cut.destination_frame),
    )
    by_joint = quat.half_angle_between(pose_a, pose_b) ** 2 + nu * np.sum((speed_a - speed_b) ** 2, axis=-1)
    return [float(sum(by_joint[cut.source.skeleton.role(role)] for role in group)) for group in groups]


def _pose(clip: Clip, frame: int) -> tuple[FloatArray, FloatArray]:
    """Rotations `(joints, 4)`, the root's without the facing, and half-angle velocities `(joints, 3)` at a frame."""
    around = slice(max(frame - 1, 0), frame + 2)
    near = Clip(clip.skeleton, clip.root_positions[around], clip.rotations[around], clip.fps)
    at = frame - around.start
    pose = near.rotations[at].copy()
    pose[0] = quat.multiply(quat.yaw(-facing(near)[at]), pose[0])
    return pose, velocities(near, np.arange(clip.skeleton.joints))[at]


def fit_weights(cuts: Sequence[LabelledCut], *, nu: float = 1.0) -> FittedWeights:
    """Weights that make bad transitions cost one and good ones nothing, by least squares (2003 Eq. 3).

    Raises
    ------
    TransitionError
        Without both good and bad cuts, for cuts of different rigs, or where no weights tell bad from good.
    """
    if not any(cut.bad > 0 for cut in cuts) or not any(cut.bad <= 0 for cut in cuts):
        raise TransitionError(
            f"Expected both good and bad transitions to fit weights to, found {counted(len(cuts), 'transition')}, "
            f"{sum(cut.bad > 0 for cut in cuts)} of them bad. Label more of them."
        )
    for cut in cuts[1:]:
        on_joints_of(cuts[0].source, cut.source)
    groups = weight_groups(cuts[0].source.skeleton)
    return _fit(cost_terms(cuts, groups, nu), np.array([cut.bad for cut in cuts], dtype=np.float64), groups)


def _fit(terms: FloatArray, bad: FloatArray, groups: Sequence[Sequence[str]]) -> FittedWeights:
    from scipy.optimize import nnls

    found, left = nnls(terms, bad)
    scale = float(found.max(initial=0.0))
    if scale <= 0.0:
        raise TransitionError(
            "Expected labels that some joint differences follow, found none: no joint differs more in bad "
            "transitions than in good ones. Check the labels."
        )
    weights = {role: float(value / scale) for group, value in zip(groups, found, strict=True) for role in group}
    good = int(np.count_nonzero(bad <= 0))
    return FittedWeights(
        MappingProxyType(weights), scale, float(left / np.sqrt(len(bad))), good=good, bad=len(bad) - good
    )


def best_transition(
    source: Clip, destination: Clip, weights: Mapping[str, float], *, nu: float = 1.0
) -> tuple[int, int]:
    """Source and destination frame of the globally cheapest transition; within one clip, at least 0.5 s apart."""
    costs = cost_matrix(source, destination, weights=weights, nu=nu)
    if source is destination:
        frames = np.arange(source.frames)
        near = np.abs(frames[:, None] - frames) < _APART_S * source.fps
        if near.all():
            raise TransitionError(
                f"Expected a clip of more than {_APART_S:g} s to find transitions within it, got {source.frames} "
                f"frames of {source.name or 'the clip'}."
            )
        costs[near] = np.inf
    row, column = np.unravel_index(int(np.argmin(costs)), costs.shape)
    return int(row), int(column)


def cross_validate(
    cuts: Sequence[LabelledCut],
    *,
    nu: float = 1.0,
    transfer: tuple[Clip, Clip] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> CrossValidation:
    """Leave each label out in turn and see how far the best transitions move (2003 section 4.1).

    Parameters
    ----------
    cuts
        As `fit_weights` takes them, at least two good and two bad.
    nu
        Weight of velocities.
    transfer
        Source and destination of a motion that no label is about, for the second of the paper's tests.
    progress
        Called with cuts done and the number of them.
    """
    if min(sum(cut.bad > 0 for cut in cuts), sum(cut.bad <= 0 for cut in cuts)) < 2:
        raise TransitionError(
            "Expected at least two good and two bad transitions, so that both are left when one is taken out; found "
            f"{counted(len(cuts), 'transition')}, {sum(cut.bad > 0 for cut in cuts)} of them bad. Label more of them."
        )
    groups = weight_groups(cuts[0].source.skeleton)
    terms, bad = cost_terms(cuts, groups, nu), np.array([cut.bad for cut in cuts], dtype=np.float64)
    whole = _fit(terms, bad, groups).weights
    known: dict[tuple[int, int], tuple[int, int]] = {}

    def best(source: Clip, destination: Clip) -> tuple[int, int]:
        key = (id(source), id(destination))
        if key not in known:
            known[key] = best_transition(source, destination, whole, nu=nu)
        return known[key]

    deviations: list[int] = []
    moved: list[int] = []
    for left_out, cut in enumerate(cuts):
        rest = np.arange(len(cuts)) != left_out
        weights = _fit(terms[rest], bad[rest], groups).weights
        for source, destination, found in (
            (cut.source, cut.destination, deviations),
            *(((*transfer, moved),) if transfer else ()),
        ):
            own = best_transition(source, destination, weights, nu=nu)
            found.append(max(abs(a - b) for a, b in zip(own, best(source, destination), strict=True)))
        if progress:
            progress(left_out + 1, len(cuts))
    return CrossValidation(
        tuple(deviations),
        float(np.mean(deviations)),
        float(np.median(deviations)),
        tuple(moved),
        sum(frames == 0 for frames in moved),
    )
