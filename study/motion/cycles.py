"""Continue a clip beyond its start or end: by the gait cycles found in it, or by drawing out its standing still.

In: a `Clip` that begins or ends in steps, or near standstill. Out: an `Extension`, whose clip has the captured frames
untouched, with frames added before and after. Captured runs and turns last little over a second, and a stimulus shows
two seconds on either side of a blend (Wang & Bodenheimer 2004, section 4.1).

How a cycle is found: the limbs, seen from the trunk, are compared with themselves one period earlier, and mirrored
half a period earlier (the right step is the mirror image of the left one). How it is carried on is in `continuing`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from study.arrays import FloatArray
from study.counting import counted
from study.errors import MotionError
from study.motion.clip import Clip, joint_positions, picked
from study.motion.continuing import carry_on, linger
from study.motion.feet import heading

End = Literal["start", "end"]

# Times of one step (half a cycle), seconds: a sprint has 0.22, a very slow walk 0.9.
_SHORTEST_STEP_S, _LONGEST_STEP_S = 0.22, 0.95
# Slowest pelvis that counts as going somewhere, m/s, over this time.
_SLOWEST_GAIT, _SPEED_S = 0.4, 0.3
# How unlike two periods may be, as a share of how much the limbs move. Captured walks and straight runs have 0.1-0.4,
# runs that speed up or end a turn up to 0.7; boxing, dancing and martial forms cut anywhere have 0.6 and more, nearly
# always above 1, and hardly ever go as fast as a run.
_UNLIKE, _UNLIKE_RUNNING, _RUNNING = 0.45, 0.75, 1.8
# The comparison looks back from the end, nearer frames counting more, with these time constants; seconds. A captured
# run can hold less than two cycles, so that little more than the seam itself can be compared.
_MEMORY_S, _MEMORY_RUNNING_S = 0.15, 0.06
# Frames that must be there beyond one period to be compared; seconds.
_OVERLAP_S = 0.05
# A cycle differs from twice a step by no more than this share.
_LIMP = 0.15
# A reflected step represents the whole cycle if it fits better by this factor, ...
_BETTER = 0.1
# ... or where the cycle turns by more than the first of these, and it is no steady bend: a bend turns by no more than
# the second, and by as much in the cycle before.
_STRAIGHT, _TURNING = np.radians(12.0), np.radians(30.0)
# Standing still: feet, pelvis and everything else (hands sway) no faster than these, m/s, for at least so long; no more
# than so much of it is drawn out.
_STILL_FEET, _STILL_PELVIS, _STILL_SPEED = 0.15, 0.15, 0.5
_STILL_S, _LONGEST_STILL_S = 0.2, 4.0

_LIMBS = ("knee", "ankle", "toe", "shoulder", "elbow", "wrist")


@dataclass(frozen=True)
class Cycle:
    """What a clip can be continued by."""

    kind: Literal["gait", "step", "still"]
    """`"gait"`: a whole cycle, two steps; `"step"`: one step and its mirror image; `"still"`: standing."""
    at: End
    """`"start"` or `"end"` of the clip."""
    period_frames: float
    """Frames of what is repeated: a cycle, a step, or the still part. Not whole in general."""
    unlikeness: float
    """How much a period differs from the one before, as a share of how much the limbs move; 0 is a perfect cycle, above
    1 nothing is alike. 0 for `"still"`."""
    turn: float = 0.0
    """Radians that the direction changes in a period, as it is carried on; 0 where it goes straight on."""
    curving: bool = False
    """Whether the captured period turns although it is carried on straight, as after a turn."""

    @property
    def cycle_frames(self) -> float:
        """Frames of a whole gait cycle (of the still part, for `"still"`)."""
        return 2.0 * self.period_frames if self.kind == "step" else self.period_frames


@dataclass(frozen=True)
class Extension:
    """A continued clip: its frames `added_before` to `added_before + frames - 1` are the clip as it was.

    `note` says it in words, with the number of gait cycles, for the manifest.
    """

    clip: Clip
    added_before: int
    added_after: int
    note: str


def find_cycle(clip: Clip, at: End = "end") -> Cycle | None:
    """What the clip can be continued by at one end, or None where it is neither in steps nor still there.

    A gait needs a pelvis that goes somewhere, and limbs that do again what they did one period ago: a whole cycle
    where the clip has more than one, else one step and its mirror image. Needs hips, knees and ankles.

    Raises
    ------
    MotionError
        Where `at` is neither end.
    """
    if at not in ("start", "end"):
        raise MotionError(f"Expected 'start' or 'end' of the clip, got {at!r}.")
    clip = reversed_in_time(clip) if at == "start" else clip
    if not clip.skeleton.has("hip", "knee", "ankle"):
        return None
    still = _still_frames(clip)
    if still >= max(3, round(_STILL_S * clip.fps)):
        return Cycle("still", at, float(min(still, round(_LONGEST_STILL_S * clip.fps))), 0.0)
    if _end_speed(clip) < _SLOWEST_GAIT:
        return None
    return _gait(clip, at)


def extend(clip: Clip, *, frames_before: int = 0, frames_after: int = 0) -> Extension:
    """Continue a clip by at least the frames asked for, no more, without changing the frames that it has.

    Parameters
    ----------
    clip
        The clip; the more frames a second, the better (120 rather than 30).
    frames_before, frames_after
        Frames wanted in front and behind; 0 leaves that end as it is.

    Raises
    ------
    MotionError
        For negative numbers, or an end that is neither in steps nor still.
    """
    if frames_before < 0 or frames_after < 0:
        raise MotionError(f"Expected numbers of frames from 0 to add, got {frames_before} and {frames_after}.")
    result, notes = clip, []
    # The end first: what is added there is not used for the start.
    wanted: tuple[tuple[End, int], ...] = (("end", frames_after), ("start", frames_before))
    for at, frames in wanted:
        if frames == 0:
            continue
        cycle = find_cycle(clip, at)
        if cycle is None:
            raise MotionError(_refusal(clip, at, frames))
        added = _continuation(clip, cycle, frames)
        result = _joined(result, added, at)
        notes.append(_words(clip, cycle, frames))
    note = "; ".join(reversed(notes))
    if note:
        result = replace(result, history=(*clip.history, note))
    return Extension(result, frames_before, frames_after, note)


def reversed_in_time(clip: Clip) -> Clip:
    """The clip played backwards."""
    return picked(clip, slice(None, None, -1))


def _continuation(clip: Clip, cycle: Cycle, frames: int) -> Clip:
    """The frames to add at the cycle's end of the clip, in the order in which they are shown."""
    forwards = clip if cycle.at == "end" else reversed_in_time(clip)
    if cycle.kind == "still":
        added = linger(forwards, cycle.period_frames, frames)
    else:
        added = carry_on(
            forwards, cycle.period_frames, frames, reflect=cycle.kind == "step", turn=cycle.turn, curving=cycle.curving
        )
    return added if cycle.at == "end" else reversed_in_time(added)


def _joined(clip: Clip, added: Clip, at: End) -> Clip:
    first, second = (added, clip) if at == "start" else (clip, added)
    return replace(
        clip,
        root_positions=np.concatenate([first.root_positions, second.root_positions]),
        rotations=np.concatenate([first.rotations, second.rotations]),
    )


def _gait(clip: Clip, at: End) -> Cycle | None:
    """The gait cycle, or the step, that ends a clip; None where no period fits."""
    limbs, mirrored = _limbs_seen_from_the_trunk(clip)
    recent = limbs[-max(3, round(_LONGEST_STEP_S * clip.fps)) :]
    scale = float(np.sqrt(np.mean(np.sum((recent - recent.mean(axis=0)) ** 2, axis=-1))))
    if scale == 0.0:
        return None
    speed = _end_speed(clip)
    runs = speed >= _RUNNING
    limit, memory = (_UNLIKE_RUNNING, _MEMORY_RUNNING_S) if runs else (_UNLIKE, _MEMORY_S)
    memory *= clip.fps
    shortest, longest = _SHORTEST_STEP_S * clip.fps, _longest_step_s(speed) * clip.fps
    step, step_unlike = _best_lag(limbs, mirrored, shortest, longest, memory, _OVERLAP_S * clip.fps)
    if step_unlike / scale <= limit:
        # Two steps make a cycle, give or take a limp; anything longer is a second time round, or chance.
        shortest, longest = step * (1.0 - _LIMP), step * (1.0 + _LIMP)
    whole, whole_unlike = _best_lag(limbs, limbs, 2 * shortest, 2 * longest, memory, _OVERLAP_S * clip.fps)
    step_unlike, whole_unlike = step_unlike / scale, whole_unlike / scale
    if min(step_unlike, whole_unlike) > limit:
        return None
    turn, steady = _turning(clip, whole) if np.isfinite(whole_unlike) else (0.0, False)
    bends = bool(abs(turn) > _STRAIGHT) and not (steady and abs(turn) < _TURNING)
    if step_unlike <= limit and (bends or step_unlike < whole_unlike - _BETTER):
        step_turn, _ = _turning(clip, 2 * step)
        return Cycle("step", at, step, step_unlike, curving=bends or abs(step_turn) > _STRAIGHT)
    return Cycle("gait", at, whole, whole_unlike, turn if abs(turn) > _STRAIGHT and not bends else 0.0, bends)


def _longest_step_s(speed: float) -> float:
    """The longest duration of a step at a speed in m/s, in seconds."""
    return float(np.clip(1.25 - 0.3 * speed, 0.45, _LONGEST_STEP_S))


def _best_lag(
    now: FloatArray, then: FloatArray, shortest: float, longest: float, memory: float, overlap: float
) -> tuple[float, float]:
    """The lag, in frames, at which `now` is most like `then` so long ago, and how unlike it is in metres.

    Differences count by `exp(age / memory)`, age measured back from the last frame. Infinite where the clip is too
    short for the shortest lag. The best whole lag is refined by a parabola through its neighbours.
    """
    frames = len(now)
    lags = np.arange(int(np.floor(shortest)), int(min(np.ceil(longest), frames - 1 - np.ceil(overlap))) + 1)
    if len(lags) < 3:
        return 0.0, np.inf
    age = np.arange(max(2, min(frames, int(np.ceil(3.0 * memory)))))
    unlike = np.empty(len(lags))
    for k, lag in enumerate(lags):
        at = frames - 1 - age[age < frames - lag]
        squares = np.mean(np.sum((now[at] - then[at - lag]) ** 2, axis=-1), axis=-1)
        weights = np.exp(-(frames - 1 - at) / memory)
        unlike[k] = np.sum(weights * squares) / np.sum(weights)
    best = int(np.argmin(unlike))
    if best in (0, len(lags) - 1):
        return 0.0, np.inf  # still falling at the edge of what can be a period: it is none
    left, middle, right = unlike[best - 1 : best + 2]
    bow = left - 2.0 * middle + right
    shift = 0.5 * (left - right) / bow if bow > 0 else 0.0
    return float(lags[best] + np.clip(shift, -0.5, 0.5)), float(np.sqrt(middle))


def _limbs_seen_from_the_trunk(clip: Clip) -> tuple[FloatArray, FloatArray]:
    """Joints of arms and legs in the trunk's own axes `(frames, limbs, 3)`, metres, and as a mirror shows them.

    The axes lean with the trunk, so that a runner who leans into a turn is still seen running.
    """
    roles = clip.skeleton.roles
    positions = joint_positions(clip)
    left, right = positions[:, roles["hip.L"]], positions[:, roles["hip.R"]]
    middle = 0.5 * (left + right)
    top = next((roles[role] for role in ("neck", "chest", "head", "spine") if role in roles), None)
    up = positions[:, top] - middle if top is not None else np.tile([0.0, 1.0, 0.0], (clip.frames, 1))
    across = _unit(left - right)
    up = _unit(up - np.sum(up * across, axis=-1, keepdims=True) * across)
    axes = np.stack([across, up, np.cross(across, up)], axis=-2)
    seen = np.einsum("fij,fkj->fki", axes, positions - middle[:, None])
    pairs = [role for role in _LIMBS if f"{role}.L" in roles and f"{role}.R" in roles]
    here = seen[:, [roles[f"{role}.{side}"] for role in pairs for side in "LR"]]
    there = seen[:, [roles[f"{role}.{side}"] for role in pairs for side in "RL"]]
    return here, there * np.array([-1.0, 1.0, 1.0])


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9))


def _turning(clip: Clip, period: float) -> tuple[float, bool]:
    """Radians that the hips turn in the last period, and whether they turned about as much in the one before."""
    facing = heading(clip)
    at = np.arange(clip.frames)

    def change(stop: float) -> float:
        """Between the two ends of a period, each averaged over a few frames."""
        near = np.linspace(0.0, min(_OVERLAP_S * clip.fps, stop - period), 5)
        return float(np.mean(np.interp(stop - near, at, facing) - np.interp(stop - near - period, at, facing)))

    last = change(clip.frames - 1.0)
    if clip.frames - 1.0 - period < period:
        return last, False
    before = change(clip.frames - 1.0 - period)
    return last, abs(last - before) < 0.5 * max(abs(last), abs(before)) and last * before > 0


def _end_speed(clip: Clip) -> float:
    """Speed of the pelvis over the floor at the end, m/s."""
    pelvis = joint_positions(clip)[:, clip.skeleton.role("pelvis")][:, [0, 2]]
    frames = min(clip.frames - 1, max(1, round(_SPEED_S * clip.fps)))
    if frames < 1:
        return 0.0
    return float(np.linalg.norm(pelvis[-1] - pelvis[-1 - frames])) * clip.fps / frames


def _still_frames(clip: Clip) -> int:
    """Number of frames at the end of the clip in which feet, pelvis and all else move no faster than one who stands."""
    if clip.frames < 3:
        return 0
    positions = joint_positions(clip)
    # Over a twentieth of a second, so that the noise of single frames does not count as movement.
    span = min(clip.frames - 1, max(1, round(0.05 * clip.fps)))
    speeds = np.linalg.norm(positions[span:] - positions[:-span], axis=-1) * clip.fps / span
    roles = clip.skeleton.roles
    feet = [roles[role] for role in ("ankle.L", "ankle.R", "toe.L", "toe.R") if role in roles]
    moving = (speeds > _STILL_SPEED).any(axis=1)
    moving |= (speeds[:, [roles["pelvis"]]] > _STILL_PELVIS).any(axis=1) | (speeds[:, feet] > _STILL_FEET).any(axis=1)
    last = np.flatnonzero(moving)
    return clip.frames if len(last) == 0 else int(len(speeds) - 1 - last[-1])


def _words(clip: Clip, cycle: Cycle, frames: int) -> str:
    seconds, where = frames / clip.fps, "before its start" if cycle.at == "start" else "after its end"
    if cycle.kind == "still":
        drawn = f"drawn out from {cycle.period_frames:.0f} frames"
        return f"extended {where} by {counted(frames, 'frame')} ({seconds:.2f} s) of standing, {drawn}"
    how = "gait cycles" if cycle.kind == "gait" else "gait cycles made of one captured step and its mirror image"
    return (
        f"extended {where} by {counted(frames, 'frame')} ({seconds:.2f} s): {frames / cycle.cycle_frames:.2f} {how}, "
        f"each {cycle.cycle_frames / clip.fps:.2f} s, unlike the one before by {cycle.unlikeness:.2f} of the movement"
    )


def _refusal(clip: Clip, at: End, frames: int) -> str:
    return (
        f"Expected {clip.name or 'the clip'} ({clip.seconds:.2f} s) to {at} in walking or running steps, or standing "
        f"still, to extend it there by {counted(frames, 'frame')}; it does neither, and other motion is not repeated. "
        "Use a longer clip, or a part of it that needs no extension."
    )
