"""The effect of a same-different study: thresholds, to be told with a stated precision."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from study.analysis.analyse import Analysis
from study.analysis.estimates import Interval
from study.analysis.same_different.analyse import SameDifferent
from study.analysis.same_different.counts import Counts
from study.analysis.same_different.model import ModelFit, fit_model
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
        test="width of the differencing model's 95% intervals",
        aim=f"tell both thresholds to ± {precision:g} frames",
        study=lambda design: same_different_study(design, precision, decided.threshold),
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
    """Return whether the model's intervals of both thresholds are as narrow as asked."""
    result = analysis.of(SameDifferent).get(name)
    return _told(result.model if result else None, precision)


def _told(model: ModelFit | str | None, precision: float) -> bool:
    return isinstance(model, ModelFit) and narrow([found.interval for found in model.jnd.values()], precision)


def same_different_observer(shorter: float, longer: float, spread: float, missed: float) -> ObserverSettings:
    """An observer with these thresholds over participants, who differ by `spread`."""
    settings = default_observer(shorter, longer)
    typical = replace(settings.same_different, log_sensitivity_sd=spread, criterion_sd=spread)
    return replace(settings, same_different=typical, missed=missed)


def same_different_study(design: Design, precision: float, level: float) -> Run:
    """Whether the model's intervals of both thresholds are as narrow as asked (half their width, in frames)."""

    def told(levels: FloatArray, different: FloatArray, shown: FloatArray) -> bool:
        names = tuple(str(place) for place in range(len(shown)))
        fit = fit_model(Counts(names, levels, different, shown), level=level) if names else None
        return _told(fit, precision)

    return level_study(design, probability_different, 0.5, told)


def level_study(
    design: Design,
    probability: Callable[[SameDifferentObserver, FloatArray], FloatArray],
    hardest: float,
    found: Callable[[FloatArray, FloatArray, FloatArray], bool],
) -> Run:
    """Studies over differences of blend length.

    Parameters
    ----------
    probability
        Of the response that is counted ("different", or a right one), by an observer and differences in frames.
    hardest
        Where that response takes longest: the probability of an observer who does not know.
    found
        What a study found, from the differences and counts of the responses and of all, shape (participants, levels).
    """
    asked = np.array([[float(trial.difference_frames or 0) for trial in own] for own in design.trials()])
    levels = np.unique(asked)

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
            at = asked[:people, :, None] == levels
            shown = (at & kept[:, :, None]).sum(axis=1).astype(float)
            yes = (at & (kept & counted)[:, :, None]).sum(axis=1).astype(float)
            for place, size in enumerate(sizes):
                there = shown[:size].sum(axis=1) > 0
                verdicts[number, place] = found(levels, yes[:size][there], shown[:size][there])
        return verdicts

    return run
