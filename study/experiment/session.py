"""Session: what comes next, and what is a legal answer. Pure: it shows nothing, waits for nothing, stores nothing.

A plan, a protocol and the answers so far come in; steps go out, one after another. A front end (window, browser or
simulated observer) shows the current step and then says either that it was shown (`advanced`) or what was answered
(`answered`, `missed`). A trial is: first stimulus, gap, second stimulus, the questions, pause (2004 section 4.2).
Starting and resuming are one thing: `open_session` with the answers that there are.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from study.errors import SessionError
from study.experiment.plan import Plan, Trial
from study.experiment.protocol import Protocol, StudySpec

Kind = Literal["instructions", "first", "gap", "second", "answer", "pause", "break", "debrief", "done"]

MAX_ATTEMPTS = 2
"""A trial that was shown badly is queued again at the end of its study, this many times in all."""


@dataclass(frozen=True)
class Answer:
    """What a participant did at one question.

    `value` is None where the answer window closed first. `item` is empty but for ratings. `response_s` runs from the
    end of the last stimulus. `shown_well` is False where the presentation was faulty, so that the trial is repeated.
    """

    trial: int
    item: str
    attempt: int
    value: str | None
    response_s: float | None
    shown_well: bool = True

    @property
    def missed(self) -> bool:
        """Whether the answer window closed without an answer."""
        return self.value is None


@dataclass(frozen=True)
class Step:
    """What to do now.

    Parameters
    ----------
    kind
        `first` and `second` play a stimulus to its end; `gap` and `pause` wait; `answer` asks; the others are read.
    study
        Name of the study; empty before the first and after the last.
    text
        What the participant reads.
    stimulus
        Id of the stimulus to play.
    duration_s
        How long a gap, pause or answer window lasts; None for as long as it takes.
    trial, attempt
        The trial's number in the plan (0 outside trials), and which showing of it this is, from 1.
    item
        The rating item that is asked.
    legal
        The answers that count.
    low, high
        Words at the ends of a rating scale.
    """

    kind: Kind
    study: str = ""
    text: str = ""
    stimulus: str = ""
    duration_s: float | None = None
    trial: int = 0
    attempt: int = 0
    item: str = ""
    legal: tuple[str, ...] = ()
    low: str = ""
    high: str = ""


@dataclass(frozen=True)
class Session:
    """Where a sitting stands. Use `open_session`, `current`, `advanced`, `answered` and `missed`."""

    plan: Plan
    protocol: Protocol
    steps: tuple[Step, ...]
    position: int = 0


def open_session(protocol: Protocol, plan: Plan, answers: Iterable[Answer] = ()) -> Session:
    """A sitting at its start, or where its answers left it; a trial half answered is shown again from its start."""
    if plan.protocol_sha256 != protocol.sha256:
        raise SessionError(
            f"Expected the protocol under which the plan was drawn (sha256 {plan.protocol_sha256[:12]}), found "
            f"{protocol.name!r} with {protocol.sha256[:12]}; use the protocol.toml of the results folder."
        )
    return Session(plan, protocol, _steps(protocol, plan, tuple(answers)))


def current(session: Session) -> Step:
    """What to do now; `done` at the end, for ever."""
    return session.steps[session.position]


def progress(session: Session) -> tuple[int, int]:
    """Trials finished and trials in all, as the plan counts them (repeats of faulty ones not counted)."""
    ahead = {step.trial for step in session.steps[session.position :] if step.trial}
    total = len(session.plan.trials)
    return total - len(ahead), total


def advanced(session: Session) -> Session:
    """After the current step was shown, read or waited for."""
    step = current(session)
    if step.kind == "answer":
        raise SessionError(
            f"Expected an answer to trial {step.trial} ({', '.join(step.legal)}), or that it was missed; "
            "an answer can't be passed over."
        )
    if step.kind == "done":
        raise SessionError("Expected no further step: the session is done.")
    return replace(session, position=session.position + 1)


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
    if response_s < 0 or (step.duration_s is not None and response_s > step.duration_s):
        raise SessionError(
            f"Expected a response time from 0 to {step.duration_s} s in trial {step.trial}, found {response_s:g} s; "
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
    """Move on; where the trial was shown badly, add it once more to the end of its study."""
    following = session.steps[session.position + 1 :]
    trial_goes_on = bool(following) and following[0].kind == "answer" and following[0].trial == answer.trial
    session = replace(session, position=session.position + 1)
    if answer.shown_well or answer.attempt >= MAX_ATTEMPTS or trial_goes_on:
        return session, answer
    trial = session.plan.trial(answer.trial)
    end = max(i for i, step in enumerate(session.steps) if step.study == trial.study) + 1
    repeat = _trial_steps(session.protocol, trial, answer.attempt + 1, frozenset())
    return replace(session, steps=(*session.steps[:end], *repeat, *session.steps[end:])), answer


def legal_answers(study: StudySpec) -> tuple[str, ...]:
    """The answers that count in a study."""
    if study.task == "same-different":
        return ("same", "different")
    if study.task == "preference":
        return ("first", "second")
    return tuple(str(point) for point in range(study.scale_points))


def _steps(protocol: Protocol, plan: Plan, answers: Sequence[Answer]) -> tuple[Step, ...]:
    """All that is left to do, in order."""
    known = {trial.trial for trial in plan.trials}
    if strays := sorted({answer.trial for answer in answers} - known):
        raise SessionError(f"Expected answers to the plan's trials 1 to {len(plan.trials)}, found trials {strays}.")
    steps: list[Step] = []
    if not answers and protocol.texts.welcome:
        steps.append(Step("instructions", text=protocol.texts.welcome.strip()))
    for name in dict.fromkeys(trial.study for trial in plan.trials):
        steps += _study_steps(protocol, plan, protocol.study(name), answers)
    if protocol.texts.debrief:
        steps.append(Step("debrief", text=protocol.texts.debrief.strip()))
    return (*steps, Step("done"))


def _study_steps(protocol: Protocol, plan: Plan, study: StudySpec, answers: Sequence[Answer]) -> list[Step]:
    steps: list[Step] = []
    again: list[Step] = []
    break_after = protocol.timing.break_after
    for trial in plan.trials:
        if trial.study != study.name:
            continue
        attempt, done = _state(study, [answer for answer in answers if answer.trial == trial.trial])
        if done is None:
            continue
        (again if attempt > 1 else steps).extend(_trial_steps(protocol, trial, attempt, done))
        last = trial.trial == len(plan.trials)
        if break_after and trial.trial % break_after == 0 and not last and attempt == 1:
            steps.append(Step("break", study.name, protocol.texts.break_text.strip()))
    steps += again
    if steps and study.instructions:
        steps.insert(0, Step("instructions", study.name, study.instructions.strip()))
    return steps


def _state(study: StudySpec, answers: Sequence[Answer]) -> tuple[int, frozenset[str] | None]:
    """Which showing of a trial is due and which of its items are answered; None for the items where it is finished."""
    items = {item.name for item in study.items} or {""}
    attempt = max((answer.attempt for answer in answers), default=1)
    latest = [answer for answer in answers if answer.attempt == attempt]
    done = frozenset(answer.item for answer in latest)
    if not items <= done:
        return attempt, done
    if all(answer.shown_well for answer in latest) or attempt >= MAX_ATTEMPTS:
        return attempt, None
    return attempt + 1, frozenset()


def _trial_steps(protocol: Protocol, trial: Trial, attempt: int, done: frozenset[str]) -> list[Step]:
    study, timing = protocol.study(trial.study), protocol.timing
    base = Step("first", trial.study, stimulus=trial.first, trial=trial.trial, attempt=attempt)
    steps = [base]
    if trial.second:
        steps.append(replace(base, kind="gap", stimulus="", duration_s=timing.gap_s))
        steps.append(replace(base, kind="second", stimulus=trial.second))
    legal = legal_answers(study)
    # A rating is a questionnaire: it has no answer window (2003 section 4.2).
    window_s = None if study.task == "rating" else timing.answer_s
    ask = replace(base, kind="answer", stimulus="", text=study.question, duration_s=window_s, legal=legal)
    if study.items:
        steps += [
            replace(ask, item=item.name, text=item.question, low=item.low, high=item.high)
            for item in study.items
            if item.name not in done
        ]
    else:
        steps.append(ask)
    steps.append(replace(base, kind="pause", stimulus="", duration_s=timing.pause_s))
    return steps
