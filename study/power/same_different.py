"""The effect of a same-different study: thresholds, to be told with a stated precision."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from study.analysis.analyse import Analysis
from study.analysis.estimates import Interval
from study.analysis.same_different.analyse import SameDifferent
from study.analysis.same_different.counts import Counts
from study.analysis.same_different.mixed import MixedThresholds, fit_mixed_thresholds
from study.arrays import BoolArray, FloatArray
from study.experiment.observers import person
from study.experiment.protocol.studies import AnalysisSettings
from study.experiment.protocol.whole import StudySpec
from study.models.population import SameDifferentObserver, probability_different
from study.power.curve import Run
from study.power.design import Design, Effect, kept_of, times
from study.tasks.observer import ObserverSettings, default_observer


def same_different_effect(study: StudySpec, options: Mapping[str, float], decided: AnalysisSettings) -> Effect:
    """Return thresholds shorter and longer, how participants differ, and how precisely both are to be told."""
    precision = options["precision"]
    return Effect(
        **threshold_numbers(same_different_observer, options),
        test=f"width of the median observer's {100 - 100 * decided.alpha:g}% intervals, mixed differencing model",
        aim=f"tell both thresholds to ± {precision:g} frames",
        study=lambda design: same_different_study(design, precision, decided.threshold, 1 - decided.alpha),
        found=lambda analysis: thresholds_found(analysis, study.name, precision),
    )


def threshold_numbers(
    observer: Callable[[float, float, float, float], ObserverSettings], options: Mapping[str, float]
) -> dict[str, Any]:
    """Return what effects of thresholds share: the observer, the numbers that are stated, few studies."""
    stated = {name: options[name] for name in ("shorter", "longer", "spread", "precision")}
    who = observer(options["shorter"], options["longer"], options["spread"], options["missed"])
    return {"observer": who, "stated": stated, "icc": None, "slow": True}


def narrow(ends: Collection[Interval], precision: float) -> bool:
    """Return whether there are intervals, and each reaches at most this far to both sides."""
    return bool(ends) and all(
        end.low is not None and end.high is not None and end.high - end.low <= 2 * precision for end in ends
    )


def thresholds_found(analysis: Analysis, name: str, precision: float) -> bool:
    """Return whether the intervals of both thresholds of the median observer are as narrow as asked."""
    result = analysis.of(SameDifferent).get(name)
    return _told(result.mixed if result else None, precision)


def _told(mixed: MixedThresholds | str | None, precision: float) -> bool:
    return isinstance(mixed, MixedThresholds) and narrow([one.interval for one in mixed.typical.values()], precision)


def same_different_observer(shorter: float, longer: float, spread: float, missed: float) -> ObserverSettings:
    """An observer with these thresholds over participants, who differ by `spread`."""
    settings = default_observer(shorter, longer)
    typical = replace(settings.same_different, log_sensitivity_sd=spread, criterion_sd=spread)
    return replace(settings, same_different=typical, missed=missed)


def same_different_study(design: Design, precision: float, level: float, confidence: float) -> Run:
    """Whether the median observer's intervals of both thresholds are as narrow as asked (half their width, frames)."""

    def told(conditions: Conditions, different: FloatArray, shown: FloatArray) -> bool:
        names = tuple(str(place) for place in range(len(shown)))
        counts = Counts(names, conditions.differences, different, shown, conditions.motions)
        return _told(fit_mixed_thresholds(counts, level=level, confidence=confidence) if names else None, precision)

    return level_study(design, probability_different, 0.5, told)


@dataclass(frozen=True, eq=False)
class Conditions:
    """What was shown: the motion and the difference in frames of each column of counts."""

    motions: tuple[str, ...]
    differences: FloatArray


def level_study(
    design: Design,
    probability: Callable[[SameDifferentObserver, FloatArray], FloatArray],
    hardest: float,
    found: Callable[[Conditions, FloatArray, FloatArray], bool],
) -> Run:
    """Studies over differences of blend length.

    Parameters
    ----------
    probability
        Of the response that is counted ("different", or a right one), by an observer and differences in frames.
    hardest
        Where that response takes longest: the probability of an observer who does not know.
    found
        What a study found, from counts of the responses and of all, shape (participants, conditions).
    """
    trials = design.trials()
    asked = np.array([[float(trial.difference_frames or 0) for trial in own] for own in trials])
    shown_in = [[(trial.motion, float(trial.difference_frames or 0)) for trial in own] for own in trials]
    pairs = sorted({pair for own in shown_in for pair in own})
    conditions = Conditions(tuple(motion for motion, _ in pairs), np.array([level for _, level in pairs]))
    place_of = {pair: place for place, pair in enumerate(pairs)}
    column = np.array([[place_of[pair] for pair in own] for own in shown_in])

    def run(rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> BoolArray:
        people = max(sizes)
        verdicts = np.zeros((studies, len(sizes)), dtype=bool)
        for number in range(studies):
            seed = int(rng.integers(2**31))
            who = [
                person(design.settings, f"power-{place:03}", seed).settings.same_different for place in range(people)
            ]
            chance = np.array([probability(one, own) for one, own in zip(who, asked, strict=False)])
            counted = rng.random(chance.shape) < chance
            response_s, given = times(design, rng, (np.abs(chance - hardest) / (1 - hardest))[None])
            kept = kept_of(design, rng, response_s, given)[0]
            at = column[:people, :, None] == np.arange(len(pairs))
            shown = (at & kept[:, :, None]).sum(axis=1).astype(float)
            yes = (at & (kept & counted)[:, :, None]).sum(axis=1).astype(float)
            for place, size in enumerate(sizes):
                there = shown[:size].sum(axis=1) > 0
                verdicts[number, place] = found(conditions, yes[:size][there], shown[:size][there])
        return verdicts

    return run
