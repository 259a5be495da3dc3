"""Feet that stand where they bear weight: the root is carried by the foot that stands, the legs follow.

In: a blended transition, since blending makes planted feet slide, sink and float. Out: the transition with another way
of its root and with its legs turned by inverse kinematics, as Wang & Bodenheimer 2004 (section 3) correct their support
legs. Kovar et al. 2002, "Footskate cleanup for motion capture editing", also move the root and ease the correction in
and out. Here root and feet are found together: of all that holds the standing feet, the change that is least and
smoothest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from study.arrays import FloatArray, runs
from study.counting import counted
from study.errors import TransitionError
from study.motion.clip import Clip, joint_positions, retarget, trim
from study.motion.feet import toes
from study.motion.legs import reach
from study.transitions.blending import Transition
from study.transitions.support import Support, find_support, footwork

RELEASE_S = 0.2
"""A correction may end so long after the blend."""

_HOLD = 1e4
"""How much worse it is that a held foot moves than that a leg takes its foot elsewhere."""
_FOOT_S, _ROOT_S = 0.07, 0.15
"""Time constants: what is quicker is left to the leg (and eased over as much), what is slower moves the root."""
_ROOT_SPEED_S = 0.5
"""Over so long a time a speed of the root costs what its acceleration does."""
_OWN_SHARE, _LEG_SHARE, _TOE_TIMES = 0.85, 0.6, 1.25
"""Share of the motions' own largest accelerations that root and toes may have, that a leg may add, and how many times
these a toe may have where the blend itself has more."""
_REACH = 0.985
"""Share of a leg's length that is used: beyond it a small way of the foot turns the knee far."""
_DROP_M = 0.04
"""How far the pelvis may come down so that a leg reaches its foot's place."""
_LIFT_M, _LIFT_SHARE = 0.06, 0.25
"""How high a foot is lifted that goes elsewhere, at most and as a share of its way."""
_SLIP_M = 0.02
"""A foot that is held and yet slips further than this takes a step, where the other foot stands meanwhile."""
_MOST_STEPS = 4
_STEP_S, _STEP_S_PER_M = 0.3, 0.2
"""How long a step takes: at least, and more for each metre."""
_ROUNDS, _STIFF, _CLOSE_M = 100, 3e3, 5e-5
"""Rounds of looking for the least change within bounds, how firmly these are approached, and what is near enough."""


def plant_feet(transition: Transition, source: Clip, destination: Clip) -> Transition:
    """The transition with feet that stand where they bear weight, neither sink nor float, and step where they must.

    Parameters
    ----------
    transition
        A blend of the two clips.
    source, destination
        What it was made from; they say which foot bears weight.

    Notes
    -----
    Frames before the blend are unchanged. The destination comes to stand elsewhere; its frames are unchanged but for
    a foot that is eased to its place within 0.2 s after the blend. The last sentence of the note says how much was
    changed, and whether a foot that bears weight still slips because there was no time for a step.

    Raises
    ------
    TransitionError
        For a cut, which has no blended frames.
    """
    if transition.blend_frames == 0:
        raise TransitionError("Expected a blended transition to plant the feet in; a cut has no blended frames.")
    clip = transition.clip
    source, destination = (retarget(each, clip.skeleton) for each in (source, destination))
    support = find_support(transition, source, destination, round(RELEASE_S * clip.fps))
    body = _body(clip, (source, destination), support)
    way, feet = _over_floor(support, body, clip.fps)
    steps = 0
    while steps < _MOST_STEPS and (stepping := _with_step(support, way, feet, clip.fps)):
        steps, support = steps + 1, stepping
        way, feet = _over_floor(support, body, clip.fps)
    way[:, 1], feet[..., 1] = _above_floor(support, body, clip.fps, way, feet)
    return _corrected(transition, support, way, feet, steps)


@dataclass(frozen=True, eq=False)
class _Body:
    """What bounds a correction, over the frames that may change and two on either side, metres.

    `root (frames + 4, 3)` and `toes (frames + 4, 2, 3)` are the blend's; `legs (frames, 2, 3)` from hip to ankle, and
    `reach (frames, 2)` how long they may be. `root_bends` and `toe_bends` as `Footwork` has them, of both motions.
    """

    root: FloatArray
    toes: FloatArray
    legs: FloatArray
    reach: FloatArray
    root_bends: FloatArray
    toe_bends: FloatArray


def _body(clip: Clip, motions: tuple[Clip, Clip], support: Support) -> _Body:
    first, last = support.first, support.first + support.frames
    part = trim(clip, max(first - 2, 0), min(last + 2, clip.frames))
    missing = (max(2 - first, 0), max(last + 2 - clip.frames, 0))
    positions = joint_positions(part)
    inside = positions[2 - missing[0] :][: support.frames]
    hips, knees, ankles = (
        inside[:, [clip.skeleton.role(f"{joint}.{side}") for side in "LR"]] for joint in ("hip", "knee", "ankle")
    )
    lengths = np.linalg.norm(knees - hips, axis=-1) + np.linalg.norm(ankles - knees, axis=-1)
    own = [footwork(motion) for motion in motions]
    return _Body(
        _continued(positions[:, 0], missing),
        _continued(toes(part), missing),
        ankles - hips,
        np.maximum(_REACH * lengths, np.linalg.norm(ankles - hips, axis=-1)),
        np.max([each.root_bends for each in own], axis=0),
        np.max([each.toe_bends for each in own], axis=0),
    )


def _continued(path: FloatArray, missing: tuple[int, int]) -> FloatArray:
    """A path `(frames, ...)` with so many frames before and after it, at the speed that it has there."""
    step_before, step_after = (path[1] - path[0], path[-1] - path[-2]) if len(path) > 1 else (0.0 * path[0],) * 2
    before = [path[0] - k * step_before for k in range(missing[0], 0, -1)]
    after = [path[-1] + k * step_after for k in range(1, missing[1] + 1)]
    return np.stack([*before, *path, *after])


def _corrected(transition: Transition, support: Support, way: FloatArray, feet: FloatArray, steps: int) -> Transition:
    """The transition with its root moved by `way (frames, 3)` and each foot beyond that by `feet (frames, 2, 3)`."""
    clip, first, last = transition.clip, support.first, support.first + support.frames
    moves, shifts = np.zeros((clip.frames, 3)), np.zeros((clip.frames, 2, 3))
    moves[first:last], moves[last:] = way, way[-1] * [1.0, 0.0, 1.0]
    shifts[first:last] = np.where(np.linalg.norm(feet, axis=-1, keepdims=True) < _CLOSE_M, 0.0, feet)
    done = reach(replace(clip, root_positions=clip.root_positions + moves), shifts)
    farthest = [100 * float(np.linalg.norm(each, axis=-1).max()) for each in (way, feet)]
    told = f"feet held by moving the root up to {farthest[0]:.1f} cm and feet up to {farthest[1]:.1f} cm beyond it"
    if steps:
        told += f", with {counted(steps, 'step')}"
    slip = float((_slip(support, way, feet) * (support.held[:-1] > 0.5)).sum(axis=0).max())
    if slip > _SLIP_M:
        told += f"; a foot that bears weight still slips {100 * slip:.0f} cm, as the blend leaves no time for a step"
    x, y, z = transition.alignment.translation
    alignment = replace(transition.alignment, translation=(x + float(moves[-1, 0]), y, z + float(moves[-1, 2])))
    note = f"{transition.note}; {told}"
    return replace(transition, clip=done.noting(told), alignment=alignment, note=note)


def _slip(support: Support, way: FloatArray, feet: FloatArray) -> FloatArray:
    """How far each foot is from moving as a held one in the step into each frame, `(frames, 2)`, metres."""
    moved = np.diff(way[:, None] + feet, axis=0, prepend=0.0) + support.excess[:-1]
    return np.asarray(np.linalg.norm(moved[..., [0, 2]], axis=-1))


def _over_floor(support: Support, body: _Body, fps: float) -> tuple[FloatArray, FloatArray]:
    """Where the root goes, `(frames, 3)`, and the feet beyond it, `(frames, 2, 3)`, metres: over the floor.

    Minimised are the movement of held feet, the size and the acceleration of what the legs do, and the acceleration
    and the speed of what the root does; both are at rest at the ends, the root wherever it then is. Accelerations of
    root and toes stay within those of the motions, and feet within reach.
    """
    frames, free = support.frames, min(support.blend_frames + 1, support.frames)
    # After the blend the destination goes its own way, wherever it has come to.
    parts = _Parts(_embedded(free, frames, stays=True), _embedded(frames, frames), fps)
    held = _HOLD * support.held**2
    cost, right = parts.cost((_ROOT_S * fps) ** 4 / (_ROOT_SPEED_S * fps) ** 2, 0.0), np.zeros((parts.size, 2))
    for foot in range(2):
        steps = parts.of_foot(foot, 1)[1:-1]
        cost += steps.T @ (held[:, foot, None] * steps)
        right -= steps.T @ (held[:, foot, None] * support.excess[:, foot][:, [0, 2]])
    bounds = [_calm(parts.of_root(2), np.diff(body.root[:, [0, 2]], n=2, axis=0), body.root_bends[0])]
    for foot in range(2):
        toe = np.diff(body.toes[:, foot][:, [0, 2]], n=2, axis=0)
        bounds.append(_calm(parts.of_foot(foot, 2), toe, body.toe_bends[0], _TOE_TIMES))
        bounds.append(_calm(parts.of_leg(foot, 2), 0.0 * toe, _LEG_SHARE * body.toe_bends[0]))
        high = np.maximum(-body.legs[:, foot, 1] - _DROP_M, 0.0)
        far = np.sqrt(np.maximum(body.reach[:, foot] ** 2 - high**2, 0.0))
        legs = body.legs[:, foot][:, [0, 2]]
        bounds.append(_within(parts.of_leg(foot), legs, np.maximum(far, np.linalg.norm(legs, axis=1))))
    found = _least(cost, right, bounds)
    way, feet = np.zeros((frames, 3)), np.zeros((frames, 2, 3))
    way[:, [0, 2]] = parts.of_root(0)[2:-2] @ found
    for foot in range(2):
        feet[:, foot, [0, 2]] = parts.of_leg(foot) @ found
    return way, feet


def _above_floor(
    support: Support, body: _Body, fps: float, way: FloatArray, feet: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The change of the root's height `(frames,)` and of each foot's beyond it `(frames, 2)`, metres.

    As over the floor, with held feet at their height, the floor as a bound for all of a foot, and legs as long as they
    are.
    """
    frames, free = support.frames, support.blend_frames
    parts = _Parts(_embedded(free, frames), _embedded(frames, frames), fps)
    held = _HOLD * np.maximum(support.held[:-1], support.held[1:]) ** 2
    cost, right = parts.cost(0.0, 1.0), np.zeros((parts.size, 1))
    bounds = [_calm(parts.of_root(2), np.diff(body.root[:, [1]], n=2, axis=0), body.root_bends[1])]
    for foot in range(2):
        heights = parts.of_foot(foot, 0)[2:-2]
        cost += heights.T @ (held[:, foot, None] * heights)
        right[:, 0] -= heights.T @ (held[:, foot] * support.over[:, foot])
        toe = np.diff(body.toes[:, foot][:, [1]], n=2, axis=0)
        bounds.append(_calm(parts.of_foot(foot, 2), toe, body.toe_bends[1], _TOE_TIMES))
        bounds.append(_calm(parts.of_leg(foot, 2), 0.0 * toe, _LEG_SHARE * body.toe_bends[1]))
        bounds.append(_at_least(heights, support.room[:, foot] - _lift(support, way, feet, foot)))
        across = np.linalg.norm((body.legs[:, foot] + feet[:, foot])[:, [0, 2]], axis=1)
        least = -np.sqrt(np.maximum(body.reach[:, foot] ** 2 - across**2, 0.0))
        bounds.append(_at_least(parts.of_leg(foot), body.legs[:, foot, 1] - least))
    found = _least(cost, right, bounds)[:, 0]
    return parts.of_root(0)[2:-2] @ found, np.stack([parts.of_leg(foot) @ found for foot in range(2)], axis=1)


def _with_step(support: Support, way: FloatArray, feet: FloatArray, fps: float) -> Support | None:
    """The support with one foot let go for a step: that which slips; None where none does that could step."""
    slip = _slip(support, way, feet)
    far = np.linalg.norm(support.excess[:-1][..., [0, 2]], axis=-1)
    held = support.held[:-1] > 0.5
    both, best = held[:, 0] & held[:, 1], (0.0, 0, 0, 0)
    for start, stop in runs(both):
        if slip[start:stop].sum(axis=0).max() > _SLIP_M:
            # Two feet that go apart share the slip; the one steps that the blend moves more.
            foot = int(np.argmax(far[start:stop].sum(axis=0)))
            if (size := float(slip[start:stop].sum())) > best[0]:
                best = (size, foot, start, stop)
    size, foot, start, stop = best
    if not size:
        return None
    frames = round((_STEP_S + _STEP_S_PER_M * float(far[start:stop, foot].sum())) * fps)
    middle = start + float(np.average(np.arange(stop - start) + 0.5, weights=far[start:stop, foot] + 1e-6))
    first = int(np.clip(round(middle - frames / 2), start, max(start, stop - frames)))
    window = slice(first, min(stop, first + frames))
    released, apart = support.held.copy(), support.apart.copy()
    released[window, foot], apart[window, foot] = 0.0, 1.0
    return replace(support, held=released, apart=apart)


def _lift(support: Support, way: FloatArray, feet: FloatArray, foot: int) -> FloatArray:
    """How high one foot must be, `(frames,)`, metres: lifted where it goes while one of the motions has it stand."""
    lift = np.zeros(support.frames)
    loose = np.minimum(support.held[:-1, foot], support.held[1:, foot]) < 0.5
    moved = np.diff(way + feet[:, foot], axis=0, prepend=0.0) + support.excess[:-1, foot]
    for start, stop in runs(loose):
        travel = float(np.linalg.norm(moved[start:stop].sum(axis=0)[[0, 2]]))
        apart = float(support.apart[start : stop + 1, foot].max())
        rise = np.sin(np.pi * (np.arange(stop - start) + 0.5) / (stop - start)) ** 2
        lift[start:stop] = apart * min(_LIFT_M, _LIFT_SHARE * travel) * rise
    return lift


def _embedded(free: int, frames: int, *, stays: bool = False) -> FloatArray:
    """From `free` values to those of all frames and of two on either side, `(frames + 4, free)`.

    0 before the first, and after the last 0 or, with `stays`, the last.
    """
    rows = np.zeros((frames + 4, free))
    rows[2 : 2 + free] = np.eye(free)
    if stays:
        rows[2 + free :, -1] = 1.0
    return rows


class _Parts:
    """The unknowns (root, left leg, right leg), and their values, steps or changes of steps as rows over them."""

    def __init__(self, root: FloatArray, leg: FloatArray, fps: float) -> None:
        self._root, self._leg, self._fps = root, leg, fps
        self.size = root.shape[1] + 2 * leg.shape[1]

    def of_root(self, order: int) -> FloatArray:
        """Differences of the root's change, `(frames + 4 - order, size)`."""
        rows = np.zeros((len(self._root) - order, self.size))
        rows[:, : self._root.shape[1]] = np.diff(self._root, n=order, axis=0)
        return rows

    def of_leg(self, foot: int, order: int = 0) -> FloatArray:
        """Differences of what a leg adds to that: of order 0 in the frames alone, else `(frames + 4 - order, size)`."""
        leg = np.diff(self._leg, n=order, axis=0) if order else self._leg[2:-2]
        rows, first = np.zeros((len(leg), self.size)), self._root.shape[1] + foot * leg.shape[1]
        rows[:, first : first + leg.shape[1]] = leg
        return rows

    def of_foot(self, foot: int, order: int) -> FloatArray:
        """Differences of a foot's change, `(frames + 4 - order, size)`."""
        rows, first = self.of_root(order), self._root.shape[1] + foot * self._leg.shape[1]
        rows[:, first : first + self._leg.shape[1]] = np.diff(self._leg, n=order, axis=0)
        return rows

    def cost(self, root_speed: float, root_size: float) -> FloatArray:
        """What changes cost: accelerations of root and legs, size of the legs', and speed and size of the root's."""
        quick, slow = (_FOOT_S * self._fps) ** 4, (_ROOT_S * self._fps) ** 4
        matrix = np.zeros((self.size, self.size))
        for weight, rows in (
            (slow, self.of_root(2)),
            (root_speed, self.of_root(1)),
            (root_size, self.of_root(0)),
            *((quick, self.of_leg(foot, 2)) for foot in range(2)),
            *((1.0, self.of_leg(foot)) for foot in range(2)),
        ):
            matrix += weight * (rows.T @ rows)
        return matrix


class _Bound(NamedTuple):
    """`rows @ unknowns + base`, `(rows, axes)`, has lengths up to `high`; of one axis, values from `low` to it."""

    rows: FloatArray
    base: FloatArray
    low: FloatArray
    high: FloatArray


def _calm(rows: FloatArray, base: FloatArray, bends: FloatArray, times: float = 1.0) -> _Bound:
    """Accelerations within most of the motions' own; where the blend has larger ones, within these so many times."""
    return _within(rows, base, np.clip(np.linalg.norm(base, axis=1), _OWN_SHARE * bends[0], times * bends.max()))


def _within(rows: FloatArray, base: FloatArray, radius: FloatArray) -> _Bound:
    """Vectors no longer than a radius each."""
    return _Bound(rows, base, -radius, radius)


def _at_least(rows: FloatArray, base: FloatArray) -> _Bound:
    """Values `(rows, 1)` not below 0."""
    return _Bound(rows, base[:, None], np.zeros(len(base)), np.full(len(base), np.inf))


def _least(cost: FloatArray, right: FloatArray, bounds: Sequence[_Bound]) -> FloatArray:
    """The unknowns of least cost within bounds, `(size, axes)`, by the alternating direction method of multipliers.

    Boyd et al. (2011), Distributed optimization and statistical learning via the alternating direction method of
    multipliers, section 3.1.1. Where bounds contradict each other it ends between them.
    """
    rows, base, low, high = (np.concatenate(parts) for parts in zip(*bounds, strict=True))
    low, high = low[:, None], high[:, None]
    inverse = np.linalg.inv(cost + _STIFF * (rows.T @ rows))
    found = np.linalg.solve(cost, right)
    owed = np.zeros_like(base)
    for _ in range(_ROUNDS):
        values = rows @ found + base
        near = values + owed
        if near.shape[1] == 1:
            np.clip(near, low, high, out=near)
        else:
            near *= np.minimum(1.0, high / np.maximum(_lengths(near), 1e-12))
        apart = values - near
        if _lengths(apart).max() < _CLOSE_M:
            break
        owed += apart
        found = inverse @ (right + _STIFF * (rows.T @ (near - owed - base)))
    return np.asarray(found)


def _lengths(vectors: FloatArray) -> FloatArray:
    """`(rows, axes)` to `(rows, 1)`."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))[:, None]
