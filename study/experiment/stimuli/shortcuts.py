"""Shortcut observers: what could be answered by seeing one property of a pair's stimuli and not the transition.

The audit of a protocol's pairs (`audit`) comes in; shares of answers go out. A shortcut observer sees the duration
alone, or where or how large the figure is in the first or in the last frame, with the noise of human percepts, and
decides by the task's own model. What it achieves is the most that this property alone can explain.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from study.experiment.protocol.whole import Protocol, StudySpec
from study.experiment.stimuli.audit import FrameAudit, PairAudit, Seen, compared, view
from study.tasks.registry import task_of
from study.tasks.trial import Pair

if TYPE_CHECKING:
    from renderer.camera import Camera
    from renderer.shapes import Poses
    from study.tasks.task import Shortcut

DURATION_SD, POSITION_SD, SIZE_SD = 0.05, 0.1, 0.03
"""Standard deviations of one percept: of a duration, as a share of it (Weber fraction); of a place in the picture, in
heights of the figure; of a size, as a share of it."""


@dataclass(frozen=True)
class Cue:
    """A property that a shortcut observer sees, in standard deviations of one percept.

    `apart` is how far the stimuli of a pair differ; `more` how much more of it the comparison has, where `prefers` says
    what more is.
    """

    name: str
    prefers: str
    apart: Callable[[PairAudit], float]
    more: Callable[[PairAudit], float]


def _duration(pair: PairAudit) -> float:
    return float(np.log(pair.seconds[1] / pair.seconds[0])) / DURATION_SD


def _place_cue(name: str, frame: Callable[[PairAudit], FrameAudit]) -> Cue:
    def apart(pair: PairAudit) -> float:
        return float(np.hypot(frame(pair).right, frame(pair).down)) / POSITION_SD

    return Cue(
        f"place in the {name} frame",
        f"figure further left in the {name} frame",
        apart,
        lambda pair: -frame(pair).right / POSITION_SD,
    )


def _size_cue(name: str, frame: Callable[[PairAudit], FrameAudit]) -> Cue:
    def more(pair: PairAudit) -> float:
        return float(np.log(frame(pair).size)) / SIZE_SD

    return Cue(f"size in the {name} frame", f"larger figure in the {name} frame", more, more)


CUES: tuple[Cue, ...] = (
    Cue("duration", "longer stimulus", _duration, _duration),
    _place_cue("first", lambda pair: pair.first),
    _size_cue("first", lambda pair: pair.first),
    _place_cue("last", lambda pair: pair.last),
    _size_cue("last", lambda pair: pair.last),
)


def largest_cue(pairs: Sequence[Sequence[Hashable]], ends: Mapping[Any, Poses], camera: Camera, fps: float) -> float:
    """The largest difference in place or size within any pair, in standard deviations of a percept.

    `pairs` name the stimuli that are compared, `ends` are the `first_and_last` of each, which the camera sees.
    """
    seen: dict[Any, Seen] = {name: view(one, camera, fps) for name, one in ends.items()}
    audits = [compared("", seen[pair[0]], seen[other]) for pair in pairs for other in pair[1:]]
    return max((abs(cue.apart(one)) for one in audits for cue in CUES[1:]), default=0.0)


@dataclass(frozen=True)
class ShortcutShare:
    """What one shortcut observer achieves at one level of a study, as shares from 0 to 1.

    Parameters
    ----------
    study, level
        `level` is the difference in blend length, in frames; None where methods are compared.
    method
        The method that answers are counted for; empty where right ones are.
    cue
        The property; see `CUES`.
    share
        Right answers, or answers for the method by an observer who chooses what has more: over all transitions.
    furthest, motion
        The same for the transition at which it is furthest from chance, and that transition.
    """

    study: str
    level: int | None
    method: str
    cue: str
    share: float
    furthest: float
    motion: str


def shortcuts_of(protocol: Protocol, pairs: Sequence[Pair], audits: Sequence[PairAudit]) -> tuple[ShortcutShare, ...]:
    """What shortcut observers achieve in every study of a protocol."""
    found = (
        shortcut_shares(study, [one.name for one in protocol.transitions_of(study)], pairs, audits)
        for study in protocol.studies
    )
    return tuple(share for own in found for share in own)


def shortcut_shares(
    study: StudySpec, transitions: Sequence[str], pairs: Sequence[Pair], audits: Sequence[PairAudit]
) -> list[ShortcutShare]:
    """What shortcut observers achieve in one study, for each level and property; empty where single stimuli are rated.

    Parameters
    ----------
    transitions
        Those of the study's trials; practice counts for nothing.
    pairs, audits
        Of the whole protocol.
    """
    shortcut = task_of(study).shortcut
    known = {one.pair: one for one in audits}
    own = [pair for pair in pairs if pair.study == study.name and pair.motion in transitions and pair.name in known]
    if shortcut is None or not own:
        return []
    levels = sorted({pair.difference_frames for pair in own if pair.difference_frames != 0}, key=lambda n: n or 0)
    # Of two methods, what is not for the one is for the other.
    methods = study.methods if study.others else (study.comparison or "",)
    found = []
    for level, method, cue in product(levels, methods if shortcut.counts == "comparison" else ("",), CUES):
        told = [pair for pair in own if pair.difference_frames in (level, 0) and (not method or method in pair.methods)]
        shares = {motion: _share(shortcut, cue, method, part, known) for motion, part in _by_motion(told, level)}
        everyone = _share(shortcut, cue, method, told, known)
        motion = max(shares, key=lambda name: abs(shares[name] - shortcut.chance))
        found.append(ShortcutShare(study.name, level, method, cue.name, everyone, shares[motion], motion))
    return found


def _by_motion(pairs: Sequence[Pair], level: int | None) -> Iterator[tuple[str, list[Pair]]]:
    """For each transition its pairs of a level and those without a difference."""
    for motion in dict.fromkeys(pair.motion for pair in pairs):
        chosen = [pair for pair in pairs if pair.motion == motion]
        if any(pair.difference_frames == level for pair in chosen):
            yield motion, chosen


def _share(shortcut: Shortcut, cue: Cue, method: str, pairs: Sequence[Pair], known: Mapping[str, PairAudit]) -> float:
    """The share over some pairs, of which those without a difference are there to be told from the others."""

    def read(pair: Pair) -> float:
        if not method:
            return cue.apart(known[pair.name])
        return cue.more(known[pair.name]) * (1.0 if pair.methods[-1] == method else -1.0)

    differ = [read(pair) for pair in pairs if pair.difference_frames != 0]
    same = [read(pair) for pair in pairs if pair.difference_frames == 0]
    return round(shortcut.share(np.array(differ), np.array(same or [0.0])), 6)


def needed_share(protocol: Protocol, study: StudySpec) -> float | None:
    """What people need at threshold; None where methods are compared."""
    shortcut = task_of(study).shortcut
    if shortcut is None or shortcut.counts == "comparison":
        return None
    return shortcut.needed or protocol.analysis.threshold


def shares_in_words(study: StudySpec, needed: float | None) -> str:
    """What the numbers of a study's table mean, for somebody who reads it the first time."""
    if needed is None:
        which, neither = ("each method", "no method") if study.others else (study.comparison, "neither method")
        return (
            f"responses for {which}, in percent, of observers who see one property of the stimuli alone and "
            f"choose the one with more of it (longer, figure further left, larger); 50 favours {neither}"
        )
    chance = 0.0 if (shortcut := task_of(study).shortcut) is None else shortcut.chance
    return (
        "right responses, in percent, of observers who see one property of the stimuli alone, for the transition that "
        f"gives most away; {100 * chance:.0f} is guessing, {100 * needed:.0f} the threshold"
    )


def told_away(protocol: Protocol, shares: Sequence[ShortcutShare]) -> Iterator[str]:
    """Studies whose threshold an observer reaches without seeing the transition, one sentence each."""
    for study in protocol.studies:
        needed = needed_share(protocol, study)
        over = [one for one in shares if one.study == study.name and needed is not None and one.furthest >= needed]
        if over:
            most = max(over, key=lambda one: one.furthest)
            cues = ", ".join(dict.fromkeys(one.cue for one in over))
            yield (
                f"{study.name}: stimuli of a pair differ in more than the transition: an observer who sees only one "
                f"property reaches the threshold of {100 * (needed or 0):.0f}% by {cues} (up to "
                f"{100 * most.furthest:.0f}%, {most.motion} {most.level:+d} frames). In [stimuli], match = "
                '"duration" removes the difference.'
            )
