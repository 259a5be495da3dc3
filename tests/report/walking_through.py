"""Sessions of participants who do as they are told: they go through the real plan, state machine and database."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from study.experiment.folder import PROTOCOL
from study.experiment.plan import draw_plan
from study.experiment.protocol.whole import load_protocol
from study.experiment.session import open_session, walk
from study.experiment.steps import Step
from study.experiment.stimuli.manifest import read_manifest
from study.experiment.store.answers import Presentation, record_answer, record_event
from study.experiment.store.responses import open_responses
from study.experiment.store.sessions import begin_session
from study.tasks.trial import PLACES, Trial


@dataclass(frozen=True)
class Reaction:
    """An answer (None: missed), its time, and the longest gap between two frames of the stimuli before it."""

    value: str | None
    response_s: float = 1.2
    gap_frames: float = 1.02


Behaviour = Callable[[Trial, Step, np.random.Generator], Reaction]


def attentive(trial: Trial, step: Step, rng: np.random.Generator) -> Reaction:
    """Sees differences of ten frames, favours the first method in seven of ten pairs, rates at random."""
    seconds = float(rng.uniform(0.6, 2.5))
    if trial.role == "check":
        return Reaction(trial.expected, seconds)
    if trial.task == "same-different":
        chance = 0.1 + 0.85 * min(abs(trial.difference_frames or 0) / 12, 1.0)
        return Reaction("different" if rng.random() < chance else "same", seconds)
    if trial.task == "preference":
        for_a = rng.random() < 0.7
        return Reaction("first" if for_a == trial.a_first else "second", seconds)
    return Reaction(str(rng.choice(step.legal)), seconds)


def missing(trial: Trial, step: Step, rng: np.random.Generator) -> Reaction:
    """Never answers."""
    del trial, step, rng
    return Reaction(None)


def stubborn(trial: Trial, step: Step, rng: np.random.Generator) -> Reaction:
    """Always gives the first legal answer, far too soon, even where an attention check asks for another one."""
    del rng
    other = [value for value in step.legal if value != trial.expected]
    return Reaction(other[0] if trial.role == "check" else step.legal[0], 0.1)


def stuttering(trial: Trial, step: Step, rng: np.random.Generator) -> Reaction:
    """Attentive, but every fifth showing stalls."""
    reaction = attentive(trial, step, rng)
    return Reaction(reaction.value, reaction.response_s, 4.0 if rng.random() < 0.2 else 1.02)


def perfect(trial: Trial, step: Step, rng: np.random.Generator) -> Reaction:
    """Sees every difference, always favours the first method, rates everything highest."""
    del rng
    if trial.role == "check":
        return Reaction(trial.expected)
    if trial.task == "same-different":
        return Reaction("different" if trial.difference_frames else "same")
    if trial.task == "preference":
        return Reaction("first" if trial.a_first else "second")
    return Reaction(step.legal[-1])


def sit(
    folder: Path, participant: str, behave: Behaviour, *, most_answers: int = 10_000, group: int = 0, seed: int = 0
) -> int:
    """Take one participant through a session, or through its first answers; the session's number comes back."""
    protocol, manifest = load_protocol(folder / PROTOCOL), read_manifest(folder)
    rng = np.random.default_rng([seed, *participant.encode()])
    plan = draw_plan(protocol, manifest.pairs, participant, group=group)
    with open_responses(folder) as responses:
        record = begin_session(
            responses, protocol, plan, library=manifest.library, library_synthetic=manifest.synthetic
        )
        reactions: list[Reaction] = []

        def respond(trial: Trial, step: Step) -> tuple[str | None, float]:
            reactions.append(behave(trial, step, rng))
            return reactions[-1].value, reactions[-1].response_s

        session = open_session(protocol, plan, passed=("consent", "form"))
        answers = walk(session, respond, lambda _trial, _step: reactions[-1].gap_frames <= 1.5)
        for trial, answer in islice(answers, most_answers):
            frames, gap_frames = (120 if answer.shown_well else 117), reactions[-1].gap_frames
            shown = [
                Presentation(
                    trial.trial, answer.attempt, place, stimulus, "requestVideoFrameCallback", 120, frames, gap_frames,
                    answer.shown_well,
                )
                for place, stimulus in zip(PLACES, trial.stimuli, strict=False)
            ]  # fmt: skip
            record_answer(responses, record, trial, answer, shown)
        if next(answers, None) is None:
            record_event(responses, record, "finished")
    return record.id
