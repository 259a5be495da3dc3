"""Simulation: simulated participants in whole sessions, stored like those of people.

A protocol's pairs and a database come in; sessions that are always marked as simulated go out. They use the
same `session` as real front ends.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import takewhile
from typing import TYPE_CHECKING, Any

from study.errors import SessionError
from study.experiment.observers import knowing, lengths_apart, person, respond, shown_well, truth
from study.experiment.plan import Plan, draw_plan, questions
from study.experiment.protocol.whole import Protocol
from study.experiment.session import open_session, walk
from study.experiment.steps import form_event
from study.experiment.store.answers import has_event, record_answer, record_event, stored_answers
from study.experiment.store.responses import Responses
from study.experiment.store.sessions import SessionRecord, begin_session, find_session
from study.tasks.answer import Answer
from study.tasks.observer import ObserverSettings, default_observer

if TYPE_CHECKING:
    from study.experiment.stimuli.manifest import Manifest
    from study.experiment.stimuli.stimulus import StimulusSet


@dataclass(frozen=True)
class SimulationSummary:
    """What a simulation did: participants in all, answers made now, answers that were there already."""

    participants: int
    answers: int
    found: int
    truth: dict[str, Any]


def simulate(
    protocol: Protocol,
    stimuli: StimulusSet | Manifest,
    responses: Responses,
    participants: int,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
    *,
    settings: ObserverSettings | None = None,
) -> SimulationSummary:
    """Run simulated participants `sim-001`, `sim-002`, ... through their whole sessions.

    Run again after an interruption, it finishes the work: existing sessions resume where they stopped, and
    the answers are those of an uninterrupted run.

    Parameters
    ----------
    participants
        How many there should be in the end.
    seed
        Seed of the observers; plans use the protocol's seed.
    progress
        Called with the answers there are and the number of them in all, after each answer.
    settings
        The observer; by default that of 2004 section 5.

    Raises
    ------
    SessionError
        Where sessions of the same names were begun by another observer, seed, protocol or plan.
    """
    if participants < 1:
        raise SessionError(f"Expected one participant or more to simulate, found {participants}.")
    settings = knowing(settings or default_observer(), protocol)
    apart = lengths_apart(protocol, stimuli)
    known = {**truth(protocol, settings, stimuli.pairs, apart), "seed": seed}
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
        who = person(settings, plan.participant, seed, apart)
        state = open_session(protocol, plan, before, passed=before_trials(protocol))
        for trial, answer in walk(state, partial(respond, who), partial(shown_well, who)):
            record_answer(responses, record, trial, answer)
            made += 1
            if progress:
                # Trials that come again are more than the plans ask for.
                progress(found + made, max(total, found + made))
        record_event(responses, record, "finished")
    return SimulationSummary(participants, made, found, known)


def answers_before(protocol: Protocol, plan: Plan, number: int) -> tuple[Answer, ...]:
    """The answers of a simulated participant to all trials before one, for a preview that jumps to it.

    Raises
    ------
    SessionError
        For a trial that the plan does not have.
    """
    if not 1 <= number <= plan.last:
        raise SessionError(f"Expected a trial from 1 to {plan.last}, found {number}.")
    who = person(knowing(default_observer(), protocol), plan.participant, protocol.seed)
    state = open_session(protocol, plan, passed=before_trials(protocol))
    given = walk(state, partial(respond, who))
    return tuple(answer for trial, answer in takewhile(lambda one: one[0].trial < number, given))


def before_trials(protocol: Protocol) -> tuple[str, ...]:
    """What is behind simulated participants: consent, and every form."""
    return ("consent", *(form_event(name) for name in ("", *(study.name for study in protocol.studies))))


def _open(
    protocol: Protocol, stimuli: StimulusSet | Manifest, responses: Responses, plan: Plan, known: Mapping[str, Any]
) -> SessionRecord:
    """A simulated participant's session: new, resumed, or already finished."""
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
