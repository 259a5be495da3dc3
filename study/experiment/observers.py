"""Observers: simulated participants whose sensitivity, criterion, lapses and preferences are known.

A protocol's pairs and a database come in; sessions that are marked as simulated for ever go out, with the truth that
an analysis should find (`observer_models.truth`). They go through the same `session` as real front ends.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any
from typing import Protocol as Shape

import numpy as np

from study.errors import SessionError
from study.experiment.chance import generator
from study.experiment.observer_models import (
    LEAST_CRITERION,
    ObserverSettings,
    PreferenceObserver,
    RatingObserver,
    SameDifferentObserver,
    default_observer,
    knowing,
    lean,
    probability_different,
    truth,
)
from study.experiment.plan import Plan, draw_plan
from study.experiment.protocol.whole import Protocol
from study.experiment.session import open_session, walk
from study.experiment.steps import Step
from study.experiment.store.answers import has_event, record_answer, record_event, stored_answers
from study.experiment.store.responses import Responses
from study.experiment.store.sessions import SessionRecord, begin_session, find_session
from study.tasks.trial import Pair, Trial

__all__ = [
    "ObserverSettings",
    "PreferenceObserver",
    "RatingObserver",
    "SameDifferentObserver",
    "SimulationSummary",
    "StimulusSource",
    "default_observer",
    "person",
    "respond",
    "shown_well",
    "simulate",
    "truth",
]


@dataclass(frozen=True)
class Person:
    """One simulated participant: the settings with this person's deviations, and where their chance comes from."""

    name: str
    seed: int
    settings: ObserverSettings
    lean: float
    leniency: float
    careless: bool = False


def person(settings: ObserverSettings, name: str, seed: int) -> Person:
    """Draw a participant's deviations; they depend on the seed and the name alone."""
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

    Chance depends on person, trial, item and attempt alone, so a session that was interrupted goes on as it would
    have gone.
    """
    rng = generator(who.seed, "answer", who.name, trial.trial, step.item, step.attempt)
    value, ease = _judge(who, trial, step, rng)
    # Near the threshold people take longer: up to half as long again.
    median = _CARELESS_S if who.careless else who.settings.response_median_s * (1.5 - 0.5 * ease)
    response_s = float(median * np.exp(who.settings.response_log_sd * rng.standard_normal()))
    inattentive = rng.random() < who.settings.missed
    if step.duration_s is not None and (inattentive or response_s > step.duration_s):
        return None, None
    return value, round(response_s, 4)


def _judge(who: Person, trial: Trial, step: Step, rng: np.random.Generator) -> tuple[str, float]:
    """The answer, and how easy it was from 0 to 1."""
    if who.careless:
        return str(rng.choice(step.legal)), 1.0
    if trial.role == "check":
        return trial.expected, 1.0
    if trial.task == "same-different":
        different = float(probability_different(who.settings.same_different, float(trial.difference_frames or 0)))
        return ("different" if rng.random() < different else "same"), abs(2 * different - 1)
    if trial.task == "preference":
        from scipy.special import expit

        preference = who.settings.preference
        leaning = lean(preference, *trial.methods) + who.lean
        towards_first = (leaning if trial.a_first else -leaning) + preference.order_bias
        chance = preference.lapse / 2 + (1 - preference.lapse) * float(expit(towards_first))
        return ("first" if rng.random() < chance else "second"), abs(2 * chance - 1)
    rating = who.settings.rating
    higher = rating.utility_weight * _rated(who.settings.preference, trial) + who.leniency
    middle = (len(step.legal) - 1) / 2 + (higher if trial.a_first else -higher)
    point = int(np.clip(round(middle + rating.noise_sd * float(rng.standard_normal())), 0, len(step.legal) - 1))
    return step.legal[point], 0.5


def _rated(preference: PreferenceObserver, trial: Trial) -> float:
    """Utility of what is rated: of the one stimulus, or of method b over method a."""
    if len(trial.methods) > 1:
        return lean(preference, trial.methods[1], trial.methods[0])
    return preference.utility.get(trial.methods[0], 0.0)


class StimulusSource(Shape):
    """What a simulation needs to know of the stimuli: a `StimulusSet` or the manifest of a results folder."""

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """All pairs, in the protocol's order."""

    @property
    def library(self) -> str:
        """Name of the motion library."""

    @property
    def synthetic(self) -> bool:
        """Whether its motions are synthetic."""


@dataclass(frozen=True)
class SimulationSummary:
    """What a simulation did: participants in all, answers made now, answers that were there already."""

    participants: int
    answers: int
    found: int
    truth: dict[str, Any]


def simulate(
    protocol: Protocol,
    stimuli: StimulusSource,
    responses: Responses,
    participants: int,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
    *,
    settings: ObserverSettings | None = None,
) -> SimulationSummary:
    """Run simulated participants `sim-001`, `sim-002`, ... through their whole sessions.

    Run again after an interruption it finishes the work: sessions that are there are taken up where they stopped, and
    the answers are those of an uninterrupted run.

    Parameters
    ----------
    participants
        How many there should be in the end.
    seed
        Where chance comes from, besides the protocol's own seed for the plans.
    progress
        Called with the answers there are and the number of them in all, after each answer.
    settings
        The observer; that of 2004 section 5 where it is left out.

    Raises
    ------
    SessionError
        Where sessions of the same names were begun by another observer, seed, protocol or plan.
    """
    if participants < 1:
        raise SessionError(f"Expected one participant or more to simulate, found {participants}.")
    settings = knowing(settings or default_observer(), protocol)
    known = {**truth(protocol, settings), "seed": seed}
    names = [f"sim-{number:03d}" for number in range(1, participants + 1)]
    plans = [draw_plan(protocol, stimuli.pairs, name, group=group) for group, name in enumerate(names)]
    total = sum(questions(protocol, plan) for plan in plans)
    made = found = 0
    for plan in plans:
        record = _open(protocol, stimuli, responses, plan, known)
        before = stored_answers(responses, record.id)
        found += len(before)
        if has_event(responses, record, "finished"):
            continue
        who = person(settings, plan.participant, seed)
        state = open_session(protocol, plan, before, passed=("consent", "form"))
        for trial, answer in walk(state, partial(respond, who), partial(shown_well, who)):
            record_answer(responses, record, trial, answer)
            made += 1
            if progress:
                # Trials that come again are more than the plans ask for.
                progress(found + made, max(total, found + made))
        record_event(responses, record, "finished")
    return SimulationSummary(participants, made, found, known)


def _open(
    protocol: Protocol, stimuli: StimulusSource, responses: Responses, plan: Plan, known: Mapping[str, Any]
) -> SessionRecord:
    """A simulated participant's session, begun, taken up, or finished already."""
    stored = find_session(responses, plan.participant)
    if stored is not None and stored.simulated and stored.truth != dict(known):
        # Half a session by one observer and half by another would have no truth.
        raise SessionError(
            f"Expected the observer and seed under which {plan.participant!r} was begun, found others; "
            "use the same ones, or another results folder."
        )
    if stored is not None and stored.plan == plan and stored.simulated and has_event(responses, stored, "finished"):
        return stored
    return begin_session(
        responses,
        protocol,
        plan,
        simulated=True,
        library=stimuli.library,
        library_synthetic=stimuli.synthetic,
        truth=known,
    )


def questions(protocol: Protocol, plan: Plan) -> int:
    """How many answers a plan asks for at most, repeats of trials that were badly shown apart."""
    items = {study.name: max(1, len(study.items)) for study in protocol.studies}
    known = sum(1 if trial.role == "check" else items[trial.study] for trial in plan.trials)
    return known + sum(course.most * items[course.study] for course in plan.courses)
