"""Session: what comes next, and what is a legal answer. Pure: it shows nothing, waits for nothing, stores nothing.

A plan, a protocol and the answers so far come in; steps go out, one after another (`steps`). A front end (window,
browser or simulated observer) shows the current step and then says that it was shown (`advanced`), what was filled in
(`filled`), or what was answered (`answered`, `missed`). Starting and resuming are one thing: `open_session` with the
answers that there are.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from study.errors import SessionError
from study.experiment import wording
from study.experiment.form import field_value
from study.experiment.plan import Plan
from study.experiment.protocol.whole import Protocol
from study.experiment.steps import Step, comes_again, feedback_text, film_times, steps_left, trial_steps
from study.tasks.answer import Answer


@dataclass(frozen=True)
class Session:
    """Where a sitting stands. Use `open_session`, `current`, `advanced`, `answered` and `missed`.

    `trials_left` has for each step how many trials have steps from there on: an answer then costs the same however
    long the plan is. `badly_shown` are the showings (trial and attempt) of which an answer says that they were faulty:
    a trial with several items comes again where any of them does.
    """

    plan: Plan
    protocol: Protocol
    steps: tuple[Step, ...]
    trials_left: tuple[int, ...]
    position: int = 0
    badly_shown: frozenset[tuple[int, int]] = frozenset()


def open_session(
    protocol: Protocol,
    plan: Plan,
    answers: Iterable[Answer] = (),
    *,
    passed: Collection[str] = (),
    frames: Mapping[str, int] | None = None,
) -> Session:
    """A sitting at its start, or where its answers left it; a trial half answered is shown again from its start.

    Parameters
    ----------
    passed
        Which of `consent`, `form` and `debrief` are behind the participant.
    frames
        Frames of each stimulus, so that texts say how long the films really take; an estimate unless given.
    """
    if plan.protocol_sha256 != protocol.sha256:
        raise SessionError(
            f"Expected the protocol under which the plan was drawn (sha256 {plan.protocol_sha256[:12]}), found "
            f"{protocol.name!r} with {protocol.sha256[:12]}; use the protocol.toml of the results folder."
        )
    before = tuple(answers)
    films = wording.NO_FILMS if frames is None else film_times(protocol, plan, frames)
    steps = steps_left(protocol, plan, before, passed, films)
    badly_shown = frozenset((answer.trial, answer.attempt) for answer in before if not answer.shown_well)
    return Session(plan, protocol, steps, _trials_left(steps), badly_shown=badly_shown)


def current(session: Session) -> Step:
    """What to do now; `done` at the end, for ever."""
    return session.steps[session.position]


def progress(session: Session) -> tuple[int, int]:
    """Trials finished and trials in all, as the plan counts them (repeats of faulty ones not counted)."""
    total = len(session.plan.trials)
    return total - session.trials_left[session.position], total


def advanced(session: Session) -> Session:
    """After the current step was shown, read, agreed to or waited for."""
    step = current(session)
    if step.kind == "form":
        raise SessionError("Expected what was filled into the form; call filled.")
    if step.kind == "answer":
        raise SessionError(
            f"Expected an answer to trial {step.trial} ({', '.join(step.legal)}), or that it was missed; "
            "an answer can't be passed over."
        )
    if step.kind == "done":
        raise SessionError("Expected no further step: the session is done.")
    return _at(session, session.position + 1)


def _at(session: Session, position: int) -> Session:
    # Not `replace`, which takes as long as the rest of an answer.
    return Session(session.plan, session.protocol, session.steps, session.trials_left, position, session.badly_shown)


def restarted(session: Session) -> Session:
    """After a trial was interrupted between its stimuli: at its first one again, as the same showing."""
    step = current(session)
    if step.kind not in ("stimulus", "gap"):
        raise SessionError(f"Expected a trial before its question to start again, found the session at {step.kind!r}.")
    firsts = (i for i in range(session.position, -1, -1) if session.steps[i].slot == 1)
    return _at(session, next(firsts))


def filled(session: Session, values: Mapping[str, str]) -> tuple[Session, dict[str, str]]:
    """After the form was filled in: the session and what is stored, field by field; empty ones are left out.

    Raises
    ------
    SessionError
        Where no form is shown now, for fields that it does not have, and for values that a field does not take.
    """
    if current(session).kind != "form":
        raise SessionError(f"Expected no form now: the session is at {current(session).kind!r}.")
    fields = {field.name: field for field in session.protocol.form}
    if strays := sorted(set(values) - set(fields)):
        raise SessionError(f"Expected the form's fields {', '.join(fields)}, found {', '.join(map(repr, strays))}.")
    taken = {name: field_value(field, values.get(name, "").strip()) for name, field in fields.items()}
    return _at(session, session.position + 1), {name: value for name, value in taken.items() if value}


def answered(session: Session, value: str, response_s: float, *, shown_well: bool = True) -> tuple[Session, Answer]:
    """After a legal answer within the answer window. The caller stores the `Answer` before it goes on.

    Raises
    ------
    SessionError
        Where nothing is asked now, for an answer that is not legal, and for one outside the answer window.
    """
    step = _asked(session)
    if value not in step.legal:
        raise SessionError(f"Expected one of {', '.join(step.legal)} in trial {step.trial}, found {value!r}.")
    longest_s = math.inf if step.duration_s is None else step.duration_s
    if not (math.isfinite(response_s) and 0 <= response_s <= longest_s):
        raise SessionError(
            f"Expected a response time from 0 to {longest_s} s in trial {step.trial}, found {response_s:g} s; "
            "a late answer counts as missed."
        )
    return _record(session, Answer(step.trial, step.item, step.attempt, value, float(response_s), shown_well))


def missed(session: Session, *, shown_well: bool = True) -> tuple[Session, Answer]:
    """After the answer window closed without an answer: recorded as missed, never guessed."""
    step = _asked(session)
    return _record(session, Answer(step.trial, step.item, step.attempt, None, None, shown_well))


def _asked(session: Session) -> Step:
    step = current(session)
    if step.kind != "answer":
        raise SessionError(f"Expected no answer now: the session is at {step.kind!r}, and asks after the stimuli.")
    return step


def _record(session: Session, answer: Answer) -> tuple[Session, Answer]:
    """Move on; where the trial was shown badly, add it once more to the end of its study. Practice gets feedback."""
    here, showing = current(session), (answer.trial, answer.attempt)
    badly_shown = session.badly_shown if answer.shown_well else session.badly_shown | {showing}
    session = replace(session, position=session.position + 1, badly_shown=badly_shown)
    following = current(session)
    trial_goes_on = following.kind == "answer" and following.trial == answer.trial
    trial = session.plan.trial(answer.trial)
    if trial.role == "practice" and not trial_goes_on:
        feedback = Step("feedback", here.study, feedback_text(session.protocol, trial, answer), role=trial.role)
        session = _with_steps(session, session.position, [feedback])
    shown_well = showing not in badly_shown
    if not comes_again(session.protocol, trial, answer.attempt, shown_well) or trial_goes_on:
        return session, answer
    end = max(i for i, step in enumerate(session.steps) if step.study == trial.study) + 1
    repeat = trial_steps(session.protocol, trial, answer.attempt + 1, frozenset())
    return _with_steps(session, end, repeat), answer


def _with_steps(session: Session, at: int, added: Sequence[Step]) -> Session:
    steps = (*session.steps[:at], *added, *session.steps[at:])
    return replace(session, steps=steps, trials_left=_trials_left(steps))


def _trials_left(steps: Sequence[Step]) -> tuple[int, ...]:
    left: list[int] = []
    ahead: set[int] = set()
    for step in reversed(steps):
        if step.trial:
            ahead.add(step.trial)
        left.append(len(ahead))
    return tuple(reversed(left))
