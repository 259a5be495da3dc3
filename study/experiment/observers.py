"""Observers: simulated participants whose sensitivity, criterion, lapses and preferences are known.

A protocol's pairs and a database come in; sessions that are marked as simulated for ever go out, with the truth that
an analysis should find (`truth`). They go through the same `session` as real front ends.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any
from typing import Protocol as Shape

import numpy as np

from study.errors import SessionError
from study.experiment.chance import generator
from study.experiment.plan import Plan, draw_plan
from study.experiment.protocol.whole import Protocol
from study.experiment.session import open_session, walk
from study.experiment.steps import Step
from study.experiment.store.answers import has_event, record_answer, record_event, stored_answers
from study.experiment.store.responses import Responses
from study.experiment.store.sessions import SessionRecord, begin_session, find_session
from study.models.population import LEAST_CRITERION
from study.models.up_down import target
from study.tasks.observer import ObserverSettings, Person, default_observer
from study.tasks.registry import task_of, task_of_trial
from study.tasks.trial import Pair, Trial


def knowing(settings: ObserverSettings, protocol: Protocol) -> ObserverSettings:
    """The observer with the utilities that a protocol gives to methods of its own, where it has none for them."""
    own = {method.name: method.utility for method in protocol.methods}
    if not own:
        return settings
    preference = replace(settings.preference, utility={**own, **settings.preference.utility})
    return replace(settings, preference=preference)


def truth(protocol: Protocol, settings: ObserverSettings) -> dict[str, Any]:
    """What an analysis should find: the observer's parameters, and study by study what follows from them.

    Of a study with staircases there is also what they aim at (`staircase`). Rounded to six digits, so that it is the
    same everywhere.
    """
    studies = {}
    for study in protocol.studies:
        task = task_of(study)
        found = task.truth(settings, study, protocol.analysis.threshold)
        if found is not None and study.procedure.rule is not None:
            found = {**found, "staircase": task.truth(settings, study, target(study.procedure.rule))}
        if found is not None:
            studies[study.name] = found
    return {"observer": asdict(settings), "studies": studies}


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
    if who.careless:
        value, ease = str(rng.choice(step.legal)), 1.0
    elif trial.role == "check":
        value, ease = trial.expected, 1.0
    else:
        value, ease = task_of_trial(trial).judge(who, trial, step.legal, rng)
    # Near the threshold people take longer: up to half as long again.
    median = _CARELESS_S if who.careless else who.settings.response_median_s * (1.5 - 0.5 * ease)
    response_s = float(median * np.exp(who.settings.response_log_sd * rng.standard_normal()))
    inattentive = rng.random() < who.settings.missed
    if step.duration_s is not None and (inattentive or response_s > step.duration_s):
        return None, None
    return value, round(response_s, 4)


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
