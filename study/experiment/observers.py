"""Observers: simulated participants whose sensitivity, criterion, lapses and preferences are known.

Settings and a name come in; a person goes out who responds to the questions of a session, and the truth that an
analysis should find (`truth`). `simulation` takes such people through whole sessions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from study.experiment.chance import generator
from study.experiment.protocol.whole import Protocol
from study.experiment.steps import Step
from study.models.population import LEAST_CRITERION
from study.models.up_down import UpDown
from study.tasks.answer import CONFIDENCE
from study.tasks.observer import ObserverSettings, Person
from study.tasks.registry import task_of, task_of_trial
from study.tasks.trial import Pair, Trial

if TYPE_CHECKING:
    from study.experiment.stimuli.manifest import Manifest
    from study.experiment.stimuli.stimulus import StimulusSet


def knowing(settings: ObserverSettings, protocol: Protocol) -> ObserverSettings:
    """The observer with the utilities that a protocol gives to methods of its own, where it has none for them."""
    own = {method.name: method.utility for method in protocol.methods}
    if not own:
        return settings
    preference = replace(settings.preference, utility={**own, **settings.preference.utility})
    return replace(settings, preference=preference)


def lengths_apart(protocol: Protocol, stimuli: StimulusSet | Manifest) -> dict[str, int]:
    """Frames by which the second blend of a pair of methods is longer, by the pair's name, where nothing else differs:
    the same points, and blends of one make.
    """
    records = {record.id: record for record in stimuli.records}
    found = {}
    for pair in stimuli.pairs:
        shown = [records[stimulus] for stimulus in pair.stimuli if stimulus in records]
        if len(shown) == 2 and pair.difference_frames is None:
            makes = [protocol.methods_of(protocol.study(pair.study))[name].make for name in pair.methods]
            points = [(one.source.frame, one.destination.frame) for one in shown]
            if makes[0] == makes[1] and points[0] == points[1]:
                found[pair.name] = shown[1].blend_frames - shown[0].blend_frames
    return found


def truth(
    protocol: Protocol, settings: ObserverSettings, pairs: Sequence[Pair] = (), apart: Mapping[str, int] | None = None
) -> dict[str, Any]:
    """What an analysis should find: the observer's parameters, and study by study what follows from them.

    Of a study with staircases there is also what they aim at (`staircase`). Rounded to six digits, so that it is the
    same everywhere. `pairs` and `apart` (from `lengths_apart`) say how visible differences are; without them, wholly.
    """
    typical, studies = Person("", 0, settings, 0.0, 0.0, apart=apart or {}), {}
    for study in protocol.studies:
        task = task_of(study)
        seen = [typical.sees(pair.name) for pair in pairs if pair.study == study.name] or [1.0]
        found = task.truth(settings, study, protocol.analysis.threshold, seen)
        rule = study.procedure.rule_of(study.task)
        if found is not None and isinstance(rule, UpDown):
            found = {**found, "staircase": task.truth(settings, study, rule.target, seen)}
        if found is not None:
            studies[study.name] = found
    return {"observer": asdict(settings), "studies": studies}


def person(settings: ObserverSettings, name: str, seed: int, apart: Mapping[str, int] | None = None) -> Person:
    """Draw a participant's deviations; they depend on the seed and the name alone. `apart` is from `lengths_apart`."""
    rng = generator(seed, "person", name)
    sensitivity, criterion, leaning, leniency = rng.standard_normal(4)
    typical = settings.same_different
    factor = float(np.exp(typical.log_sensitivity_sd * sensitivity))
    own = replace(
        typical,
        d_prime_shorter=typical.d_prime_shorter * factor,
        d_prime_longer=typical.d_prime_longer * factor,
        criterion=max(typical.criterion + typical.criterion_sd * float(criterion), LEAST_CRITERION),
    )
    return Person(
        name,
        seed,
        replace(settings, same_different=own),
        settings.preference.participant_sd * float(leaning),
        settings.rating.participant_sd * float(leniency),
        bool(generator(seed, "careless", name).random() < settings.careless),
        apart or {},
    )


_CARELESS_S = 0.25
"""Median response time of those who do not look."""


def shown_well(who: Person, trial: Trial, step: Step) -> bool:
    """Whether a showing went well; by chance that depends on person, trial and attempt alone."""
    if not who.settings.badly_shown:
        return True
    rng = generator(who.seed, "showing", who.name, trial.trial, step.attempt)
    return bool(rng.random() >= who.settings.badly_shown)


def respond(who: Person, trial: Trial, step: Step) -> tuple[str | None, float | None]:
    """A participant's answer and response time in seconds; None twice where the answer is missed.

    Chance depends only on person, trial, item and attempt, so an interrupted session continues as it would
    have gone.
    """
    sure = step.item == CONFIDENCE  # of the very answer that they gave
    rng = generator(who.seed, "answer", who.name, trial.trial, "" if sure else step.item, step.attempt)
    if who.careless:
        value, ease = " ".join(map(str, rng.choice(step.legal, max(step.sliders, 1)))), 1.0
    elif trial.role == "check":
        value, ease = " ".join([trial.expected] * max(step.sliders, 1)), 1.0
    else:
        value, ease = task_of_trial(trial).judge(who, trial, step.legal, rng)
        if sure:
            value = step.legal[round(ease * (len(step.legal) - 1))]
    # Near the threshold people take longer: up to half as long again.
    median = _CARELESS_S if who.careless else who.settings.response_median_s * (1.5 - 0.5 * ease)
    response_s = float(median * np.exp(who.settings.response_log_sd * rng.standard_normal()))
    inattentive = rng.random() < who.settings.missed
    if step.duration_s is not None and (inattentive or response_s > step.duration_s):
        return None, None
    return value, round(response_s, 4)
