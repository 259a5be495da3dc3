"""The effect of a study with staircases or QUEST+: the thresholds of their tracks, to be told with a stated precision.

Participants go through the rule of the study's own procedure, track by track; the analysis of tracks reads
their responses as it reads stored ones. How tracks are interleaved changes nothing of what each of them asks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import product

import numpy as np
import pandas as pd

from study.analysis.analyse import Analysis
from study.analysis.exclusions import exclude
from study.analysis.oddity.analyse import ForcedChoice
from study.analysis.same_different.analyse import SameDifferent
from study.analysis.same_different.staircases import Staircases, staircase_thresholds
from study.analysis.yes_no.analyse import YesNo
from study.arrays import BoolArray, FloatArray
from study.counting import counted
from study.errors import AnalysisError
from study.experiment.observers import person
from study.experiment.procedures.interleaved import SIGNS, Interleaving
from study.experiment.protocol.studies import AnalysisSettings
from study.experiment.protocol.whole import StudySpec
from study.models.forced import FORCED
from study.models.population import SameDifferentObserver, probability_different, probability_found, probability_yes
from study.models.quest_plus import Asked, QuestRule
from study.power.curve import Run
from study.power.design import Design, Effect, times
from study.power.oddity import forced_observer
from study.power.same_different import narrow, same_different_observer, threshold_numbers
from study.power.yes_no import yes_no_observer
from study.tasks.observer import ObserverSettings

OBSERVERS: Mapping[str, Callable[[float, float, float, float], ObserverSettings]] = {
    "same-different": same_different_observer,
    "yes-no": yes_no_observer,
    **{name: partial(forced_observer, forced) for name, forced in FORCED.items()},
}
RIGHT: Mapping[str, tuple[Callable[[SameDifferentObserver, FloatArray], FloatArray], float]] = {
    "same-different": (probability_different, 0.5),
    "yes-no": (probability_yes, 0.5),
    **{name: (partial(probability_found, forced), forced.chance) for name, forced in FORCED.items()},
}
"""The probability of a right response by the difference, and what it is for an observer who does not know."""


def staircase_effect(study: StudySpec, options: Mapping[str, float], decided: AnalysisSettings) -> Effect:
    """Return thresholds shorter and longer, how participants differ, and how precisely all are to be told."""
    if study.task not in OBSERVERS:
        raise AnalysisError(f"{study.name}: expected one of the tasks {', '.join(OBSERVERS)}, found {study.task!r}")
    precision = options["precision"]
    rule = study.procedure.rule_of(study.task)
    assert rule is not None, "the registry asks for studies with tracks"
    tracks = f"{rule.title}s"
    return Effect(
        **threshold_numbers(OBSERVERS[study.task], options),
        test=f"width of the {100 - 100 * decided.alpha:g}% intervals of the {tracks}' thresholds, "
        "Student's t over participants",
        aim=f"tell the thresholds of the {tracks} to ± {precision:g} frames",
        study=lambda design: staircase_study(design, precision, 1 - decided.alpha),
        found=lambda analysis: staircases_found(analysis, study.name, precision),
        answers=trials_each,
        beside=against_constant,
    )


def staircases_found(analysis: Analysis, name: str, precision: float) -> bool:
    """Return whether the intervals of the thresholds of all sides are as narrow as asked."""
    kinds = analysis.of(SameDifferent), analysis.of(ForcedChoice), analysis.of(YesNo)
    result = kinds[0].get(name) or kinds[1].get(name) or kinds[2].get(name)
    return result is not None and result.staircases is not None and _told(result.staircases, precision)


def _told(found: Staircases, precision: float) -> bool:
    return narrow([threshold.interval for threshold in found.thresholds.values()], precision)


def trials_each(design: Design) -> int:
    """Return how many trials a participant answers on average, those without a difference among them."""
    rng = np.random.default_rng(0)
    return round(float(np.mean([sum(1 for _ in _responses(design, seed, 0, rng)) for seed in range(100)])))


SPACED, PEOPLE, AT_MOST, EVERY = 5, 60, 10, 5
"""Levels a side of the constant stimuli that QUEST+ is compared with; participants; how many times the trials of QUEST+
are tried, looking each so many trials.
"""


def against_constant(design: Design) -> str:
    """Return how many trials constant stimuli, equally far apart, take for the intervals that QUEST+ comes to."""
    rule, rng = _procedure(design).rule_of(design.study.task), np.random.default_rng(0)
    if not isinstance(rule, QuestRule):
        return ""
    rule = replace(rule, trials=rule.adaptive_trials, then_constant=())
    levels = [rule.levels[place] for place in np.linspace(0, len(rule.levels) - 1, SPACED).round().astype(int)]
    taken, wanted = [], []
    for who in range(PEOPLE):
        right = _rightly(design, f"compared-{who:03}", rng)
        track = _run(design, rule, right)
        wanted.append(track.trials)
        taken.append(_run(design, rule, right, levels, _width(rule, track)).trials)
    asked, fixed = float(np.median(wanted)), float(np.median(taken))
    saves, share = ("QUEST+", 1 - asked / fixed) if asked < fixed else ("constant stimuli", 1 - fixed / asked)
    return (
        f"for a participant's interval by QUEST+, after {counted(round(asked), 'trial')} of a track, constant stimuli "
        f"at {', '.join(map(str, levels))} frames take {round(fixed)}: {saves} saves {100 * share:.0f}%"
    )


def _rightly(design: Design, name: str, rng: np.random.Generator) -> Callable[[int], bool]:
    """Whether a simulated participant is right at a difference to the longer side, or the side that there is."""
    observer, sign = person(design.settings, name, 0).settings.same_different, SIGNS[_procedure(design).side][-1][-1]
    probability, _ = RIGHT[design.study.task]

    def right(level: int) -> bool:
        share = float(probability(observer, np.array(float(sign * level))))
        return bool(rng.random() < (share if level else 1 - share))

    return right


def _run(
    design: Design, rule: QuestRule, right: Callable[[int], bool], levels: Sequence[int] = (), goal: float = 0.0
) -> Asked:
    """A track of QUEST+ to its end; with levels, these in turn until the interval is as narrow as the goal."""
    every, track, trial = _procedure(design).catch_every, rule.begin(), 0
    while not (_enough(rule, track, goal) if levels else rule.over(track)):
        trial += 1
        if every and trial % every == 0:
            track = rule.beside(track, right(0))
        else:
            level = levels[track.trials % len(levels)] if levels else rule.due(track)
            track = rule.after(track, level, right(level))
    return track


def _enough(rule: QuestRule, track: Asked, goal: float) -> bool:
    looked = track.trials > 0 and track.trials % EVERY == 0
    return looked and (_width(rule, track) <= goal or track.trials >= AT_MOST * rule.trials)


def _width(rule: QuestRule, track: Asked) -> float:
    found = rule.found(track)
    return (found.high or np.inf) / (found.low or 1e-9)


def _procedure(design: Design) -> Interleaving:
    procedure = design.study.procedure
    assert isinstance(procedure, Interleaving), "the registry asks for studies with tracks"
    return procedure


def staircase_study(design: Design, precision: float, confidence: float) -> Run:
    """Whether the intervals of the staircases' thresholds are as narrow as asked (half their width, in frames)."""
    rule = _procedure(design).rule_of(design.study.task)

    def run(rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> BoolArray:
        verdicts = np.zeros((studies, len(sizes)), dtype=bool)
        for number in range(studies):
            seed = int(rng.integers(2**31))
            parts = [pd.DataFrame(_responses(design, seed, who, rng)) for who in range(max(sizes))]
            for place, size in enumerate(sizes):
                kept, _ = exclude(pd.concat(parts[:size], ignore_index=True), design.rules)
                verdicts[number, place] = _told(staircase_thresholds(kept, rule, confidence), precision)
        return verdicts

    return run


def _responses(design: Design, seed: int, who: int, rng: np.random.Generator) -> Iterator[dict[str, object]]:
    """The rows of one participant's responses, track after track, with those without a difference among them."""
    name, procedure = f"power-{who:03}", _procedure(design)
    rule = procedure.rule_of(design.study.task)
    observer = person(design.settings, name, seed).settings.same_different
    probability, hardest = RIGHT[design.study.task]
    course = next(course for course in design.plans[who].courses if course.study == design.study.name)
    motions = sorted({pair.motion for pair in course.pairs if pair.difference_frames})

    @cache
    def right_at(difference: int) -> float:
        """Without a difference the right answer is that there is none."""
        share = float(probability(observer, np.array(float(difference))))
        return share if difference else 1 - share

    def row(motion: str, repeat: int, difference: int) -> dict[str, object]:
        share = right_at(difference)
        response_s, given = times(design, rng, np.array(abs(share - hardest) / (1 - hardest)))
        return {
            "participant": name, "motion": motion, "repeat": repeat, "difference_frames": difference,
            "answer": "given" if given else None, "correct": bool(rng.random() < share) if given else None,
            "response_s": float(response_s) if given else np.nan, "shown_well": True,
        }  # fmt: skip

    trial = 0
    for repeat in range(1, course.repeats + 1):
        for motion, signs in product(motions, SIGNS[procedure.side]):
            track = rule.begin()
            while not rule.over(track):
                trial += 1
                if procedure.catch_every and trial % procedure.catch_every == 0:
                    response = row(motion, 1, 0)
                    if response["correct"] is not None:
                        track = rule.beside(track, bool(response["correct"]))
                else:
                    level = rule.due(track)
                    response = row(motion, repeat, signs[int(rng.integers(len(signs)))] * level)
                    track = rule.after(track, level, response["correct"])  # type: ignore[arg-type]
                yield {**response, "trial": trial}
