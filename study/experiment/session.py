"""Session: what comes next, and what is a legal answer. Pure: it shows nothing, waits for nothing, stores nothing.

A plan, a protocol and the answers so far come in; steps go out, one after another (`steps`). A front end (window,
browser or simulated observer) shows the current step and then says that it was shown (`advanced`), what was filled in
(`filled`), or what was answered (`answered`, `missed`). Starting and resuming are one thing: `open_session` with the
answers that there are.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Literal

from study.errors import SessionError
from study.experiment import wording
from study.experiment.folding import Folded, continued, finished, fold
from study.experiment.form import field_value
from study.experiment.plan import Plan
from study.experiment.protocol.whole import Protocol
from study.experiment.steps import (
    Step,
    break_step,
    breaks_of,
    comes_again,
    feedback_text,
    film_times,
    practice_due,
    steps_left,
    trial_steps,
)
from study.tasks.answer import CONFIDENCE, Answer
from study.tasks.registry import is_right
from study.tasks.trial import Trial

Outcome = Literal["finished", "failed-checks"]


@dataclass(frozen=True)
class Session:
    """The state of a session. Use `open_session`, `current`, `advanced`, `answered` and `missed`.

    `steps` are those of all trials that are known; where a procedure waits for an answer (`folding`), the steps of its
    next trial are added after it. `trials_left` has for each step how many trials have steps from there on: an answer
    then costs the same however long the plan is. `badly_shown` are the showings (trial and attempt) of which an answer
    says that they were faulty: a trial with several items comes again where any of them does. `chosen` is the last
    answer that is not about how sure the one before it was; `failed` counts the attention checks that were failed.
    `practised` are the answers to practice trials.
    """

    plan: Plan
    protocol: Protocol
    steps: tuple[Step, ...]
    trials_left: tuple[int, ...]
    folded: Folded
    position: int = 0
    badly_shown: frozenset[tuple[int, int]] = frozenset()
    chosen: Answer | None = None
    failed: int = 0
    practised: tuple[Answer, ...] = ()

    def trial(self, number: int) -> Trial:
        """A trial by its number: one that is known beforehand, or that the answers so far led to."""
        return self.folded.trial(number)


def open_session(
    protocol: Protocol,
    plan: Plan,
    answers: Iterable[Answer] = (),
    *,
    passed: Collection[str] = (),
    frames: Mapping[str, int] | None = None,
) -> Session:
    """A session at its start, or where its answers left it; a partly answered trial is shown again from its start.

    Parameters
    ----------
    passed
        What is behind the participant of `consent`, `form`, the forms after studies (`form_event`) and `debrief`.
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
    folded = fold(protocol, plan, before)
    breaks = breaks_of(protocol, plan) - folded.breaks
    steps = steps_left(protocol, folded.trials.values(), before, passed, breaks, films, plan.examples)
    badly_shown = frozenset((answer.trial, answer.attempt) for answer in before if not answer.shown_well)
    failed = sum(_failed(folded.trial(answer.trial), answer) for answer in before)
    chosen = next((answer for answer in reversed(before) if answer.item != CONFIDENCE), None)
    practised = tuple(answer for answer in before if folded.trial(answer.trial).role == "practice")
    known = Session(plan, protocol, steps, _trials_left(steps), folded, badly_shown=badly_shown, chosen=chosen)
    return _unless_failed(replace(known, failed=failed, practised=practised), "debrief" in passed)


def current(session: Session) -> Step:
    """What to do now; `done` from the end on."""
    return session.steps[session.position]


def progress(session: Session) -> tuple[int, int]:
    """Trials finished and trials in all, as the plan counts them; repeats of faulty ones and further rounds of practice
    are not counted. The first never falls.

    Of trials that depend on answers the most that there may be count; what was not needed is finished, too.
    """
    plan = session.plan
    total = len(plan.trials) + sum(course.most for course in plan.courses)
    return total - session.trials_left[session.position] - sum(session.folded.unknown.values()), total


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


def outcome(session: Session) -> Outcome:
    """How a session ends: `failed-checks` where more attention checks were failed than the protocol allows."""
    most = session.protocol.failed_checks.most
    return "finished" if most is None or session.failed <= most else "failed-checks"


def _failed(trial: Trial, answer: Answer) -> bool:
    """Whether an attention check was failed; one after a display failure counts for nothing."""
    return trial.role == "check" and answer.shown_well and not is_right(trial, answer.value or "", trial.expected)


def _unless_failed(session: Session, read: bool = False) -> Session:
    """The session, or where it ends early the one that goes to its end, past a page that says so unless it was read."""
    if outcome(session) == "finished" or session.protocol.failed_checks.then == "flag":
        return session
    last = [] if read else [Step("debrief", text=session.protocol.texts.checks_failed)]
    steps = (*session.steps[: session.position], *last, Step("done"))
    return replace(session, steps=steps, trials_left=_trials_left(steps))


def _at(session: Session, position: int, badly_shown: frozenset[tuple[int, int]] | None = None) -> Session:
    # Not `replace`, which takes as long as the rest of an answer.
    known = session.plan, session.protocol, session.steps, session.trials_left, session.folded
    badly_shown = session.badly_shown if badly_shown is None else badly_shown
    return Session(*known, position, badly_shown, session.chosen, session.failed, session.practised)


def near(session: Session) -> tuple[list[Step], list[Step]]:
    """The steps of the present trial, or else of the next one; and the stimuli of which some come after it.

    Where the trial after it depends on the answer, those are the stimuli of all trials that may come.
    """
    shown: dict[tuple[int, int], list[Step]] = {}
    for step in islice(session.steps, session.position, None):
        if step.trial:
            of = shown.setdefault((step.trial, step.attempt), [])
            if len(shown) > 2:
                break
            of.append(step)
    none: list[Step] = []
    own, after, *_ = (*shown.values(), none, none)
    if own and not (after and after[0].study == own[0].study):
        study, folded = own[0].study, session.folded
        candidates = folded.procedures[study].candidates(folded.given[study])
        may_come = [trial_steps(session.protocol, one, 1, frozenset()) for one in candidates if one is not None]
        after = [*(step for steps in may_come for step in steps), *(after if None in candidates else ())]
    return own, [step for step in after if step.slot]


def restarted(session: Session) -> Session:
    """After a trial was interrupted between its stimuli: at its first one again, as the same showing."""
    step = current(session)
    if step.kind not in ("stimulus", "gap"):
        raise SessionError(f"Expected a trial before its question to start again, found the session at {step.kind!r}.")
    firsts = (i for i in range(session.position, -1, -1) if session.steps[i].slot == 1)
    return _at(session, next(firsts))


def filled(session: Session, values: Mapping[str, str]) -> tuple[Session, dict[str, str]]:
    """After the form was filled in: the session and what is stored, field by field; without empty ones.

    Raises
    ------
    SessionError
        Where no form is shown now, for fields that it does not have, and for values that a field does not take.
    """
    step = current(session)
    if step.kind != "form":
        raise SessionError(f"Expected no form now: the session is at {step.kind!r}.")
    fields = {field.name: field for field in session.protocol.form_of(step.study)}
    if strays := sorted(set(values) - set(fields)):
        raise SessionError(f"Expected the form's fields {', '.join(fields)}, found {', '.join(map(repr, strays))}.")
    taken = {name: field_value(field, values.get(name, "").strip()) for name, field in fields.items()}
    prefix = f"{step.study}." if step.study else ""
    return _at(session, session.position + 1), {prefix + name: value for name, value in taken.items() if value}


def answered(session: Session, value: str, response_s: float, *, shown_well: bool = True) -> tuple[Session, Answer]:
    """After a legal answer within the answer window. The caller stores the `Answer` before it goes on.

    Raises
    ------
    SessionError
        Where nothing is asked now, for an answer that is not legal, and for one outside the answer window.
    """
    step = _asked(session)
    given = value.split(" ") if step.sliders else [value]
    if len(given) != max(step.sliders, 1) or not set(given) <= set(step.legal):
        legal = f"{step.sliders} of 0 to 100 with a space between two" if step.sliders else ", ".join(step.legal)
        raise SessionError(f"Expected one of {legal} in trial {step.trial}, found {value!r}.")
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


def walk(
    session: Session,
    respond: Callable[[Trial, Step], tuple[str | None, float | None]],
    shown_well: Callable[[Trial, Step], bool] = lambda _trial, _step: True,
) -> Iterator[tuple[Trial, Answer]]:
    """Go through a session to its end: each trial with an answer to it, as soon as the answer is given.

    Steps that are shown or read are passed over; the form has to be behind the participant.

    Parameters
    ----------
    respond
        Gives the response to the question of a step, None for no response, and the response time in seconds.
    shown_well
        Says whether the stimuli of the trial were shown without a fault.
    """
    while (step := current(session)).kind != "done":
        if step.kind != "answer":
            session = advanced(session)
            continue
        trial = session.trial(step.trial)
        value, response_s = respond(trial, step)
        well = shown_well(trial, step)
        if value is None or response_s is None:
            session, given = missed(session, shown_well=well)
        else:
            session, given = answered(session, value, response_s, shown_well=well)
        yield trial, given


def _asked(session: Session) -> Step:
    step = current(session)
    if step.kind != "answer":
        raise SessionError(f"Expected no answer now: the session is at {step.kind!r}, and asks after the stimuli.")
    return step


def _record(session: Session, answer: Answer) -> tuple[Session, Answer]:
    """Move on; after a display failure, add the trial once more to the end of its study. Practice gets feedback."""
    here, showing = current(session), (answer.trial, answer.attempt)
    badly_shown = session.badly_shown if answer.shown_well else session.badly_shown | {showing}
    chosen = session.chosen if answer.item == CONFIDENCE and session.chosen else answer
    session = replace(_at(session, session.position + 1, badly_shown), chosen=chosen)
    if answer.missed and current(session).item == CONFIDENCE:  # nobody is sure of what was not said
        session = _at(session, session.position + 1)
    following = current(session)
    trial_goes_on = following.kind == "answer" and following.trial == answer.trial
    trial = session.trial(answer.trial)
    if _failed(trial, answer):
        session = _unless_failed(replace(session, failed=session.failed + 1))
        if current(session).kind == "done" or session.steps[session.position + 1].kind == "done":
            return session, answer
    if trial.role == "practice":
        session = replace(session, practised=(*session.practised, answer))
    if trial.role == "practice" and not trial_goes_on:
        feedback = Step("feedback", here.study, feedback_text(session.protocol, trial, chosen), role=trial.role)
        session = _practised_again(_with_steps(session, session.position, [feedback]), trial)
    if trial_goes_on or trial.role == "practice":
        return session, answer
    if not comes_again(session.protocol, trial, answer.attempt, showing not in badly_shown):
        return _finished(session, trial, chosen), answer
    end = max(i for i, step in enumerate(session.steps) if step.study == trial.study and step.trial) + 1
    repeat = trial_steps(session.protocol, trial, answer.attempt + 1, frozenset())
    return _with_steps(session, end, repeat), answer


def _practised_again(session: Session, trial: Trial) -> Session:
    """After a practice trial: another round after its feedback and pause, where the last one was not right enough."""
    own = session.plan.practice(trial.study)
    numbers = {one.trial for one in own}
    given = [answer for answer in session.practised if answer.trial in numbers]
    due = practice_due(session.protocol, own, given)
    if due is None or due == given[-1].attempt:
        return session
    again = [Step("instructions", trial.study, session.protocol.texts.practice_again.strip())]
    for one in own:
        again += trial_steps(session.protocol, one, due, frozenset())
    return _with_steps(session, session.position + 2, again)


def _finished(session: Session, trial: Trial, answer: Answer) -> Session:
    """After the last answer to a trial: where no other of its study is known, its procedure says how to go on."""
    session = replace(session, folded=finished(session.folded, trial, answer))
    at = session.position
    while session.steps[at].trial == trial.trial:
        at += 1
    after = next((number for i in range(at, len(session.steps)) if (number := session.steps[i].trial)), None)
    if after is not None and session.trial(after).study == trial.study:
        return session
    folded, fresh = continued(session.folded, trial.study)
    steps = [step for one in fresh for step in trial_steps(session.protocol, one, 1, frozenset())]
    if trial.trial in folded.breaks and (fresh or after):
        steps.insert(0, break_step(session.protocol, trial))
    return replace(_with_steps(session, at, steps), folded=folded)


def _with_steps(session: Session, at: int, added: Sequence[Step]) -> Session:
    steps = (*session.steps[:at], *added, *session.steps[at:])
    return replace(session, steps=steps, trials_left=_trials_left(steps))


def _trials_left(steps: Sequence[Step]) -> tuple[int, ...]:
    left: list[int] = []
    ahead: set[int] = set()
    for step in reversed(steps):
        if step.trial and not (step.role == "practice" and step.attempt > 1):
            ahead.add(step.trial)
        left.append(len(ahead))
    return tuple(reversed(left))
