"""Session: what comes next, and what is a legal answer. Pure: it shows nothing, waits for nothing, stores nothing.

A plan, a protocol and the answers so far come in; steps go out, one after another: consent, form, welcome, and for
each study its instructions, practice, trials and breaks; at the end the debriefing. A front end (window, browser or
simulated observer) shows the current step and then says that it was shown (`advanced`), what was filled in (`filled`),
or what was answered (`answered`, `missed`). A trial is: first stimulus, gap, second stimulus, the questions, pause
(2004 section 4.2). Starting and resuming are one thing: `open_session` with the answers that there are.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from study.errors import SessionError
from study.experiment import wording
from study.experiment.plan import Plan, Trial, legal_answers
from study.experiment.protocol.texts import FormField
from study.experiment.protocol.whole import Protocol, StudySpec

__all__ = [
    "Answer",
    "Kind",
    "Session",
    "Step",
    "advanced",
    "answer_keys",
    "answer_words",
    "answered",
    "current",
    "field_value",
    "filled",
    "legal_answers",
    "missed",
    "open_session",
    "progress",
    "restarted",
    "right_answer",
]

Kind = Literal[
    "consent",
    "form",
    "instructions",
    "first",
    "gap",
    "second",
    "answer",
    "feedback",
    "pause",
    "break",
    "debrief",
    "done",
]

LONGEST_TEXT = 1000
"""Characters of a text that a participant may write in the form."""


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
        `first` and `second` play a stimulus to its end; `gap` and `pause` wait; `answer` asks; `form` is filled in;
        the others are read. Passing over `consent` means agreeing.
    study
        Name of the study; empty before the first and after the last.
    text
        What the participant reads.
    stimulus
        Id of the stimulus to play; with `instructions`, of the example that can be played.
    duration_s
        How long a gap, pause or answer window lasts; None for as long as it takes.
    trial, attempt
        The trial's number in the plan (0 outside trials), and which showing of it this is, from 1.
    item
        The rating item that is asked.
    legal
        The answers that count.
    low, middle, high
        Words at the ends and in the middle of a rating scale.
    role
        What the trial is for: `trial`, `practice` or `check`; empty outside trials.
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
    middle: str = ""
    high: str = ""
    role: str = ""


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
    films = wording.NO_FILMS if frames is None else _film_times(protocol, plan, frames)
    steps = _steps(protocol, plan, before, passed, films)
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
    if step.kind not in ("first", "gap", "second"):
        raise SessionError(f"Expected a trial before its question to start again, found the session at {step.kind!r}.")
    firsts = (i for i in range(session.position, -1, -1) if session.steps[i].kind == "first")
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


def field_value(field: FormField, value: str) -> str:
    """A field's value as it is stored, or a `SessionError` that says what the field takes."""
    if not value:
        if field.required:
            raise SessionError(f"Expected {field.name} to be filled in, found nothing.")
        return ""
    if field.kind == "choice" and value not in field.choices:
        raise SessionError(f"Expected one of {', '.join(field.choices)} as {field.name}, found {value!r}.")
    if field.kind == "number":
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if "_" in value:  # which Python takes within a number, and nobody else
            number = math.nan
        least = -math.inf if field.least is None else field.least
        most = math.inf if field.most is None else field.most
        if not (math.isfinite(number) and least <= number <= most):
            raise SessionError(f"Expected a number from {least:g} to {most:g} as {field.name}, found {value!r}.")
    if len(value) > LONGEST_TEXT:
        raise SessionError(f"Expected at most {LONGEST_TEXT} characters as {field.name}, found {len(value)}.")
    return value


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
        feedback = Step("feedback", here.study, _feedback(session.protocol, trial, answer), role=trial.role)
        session = _with_steps(session, session.position, [feedback])
    shown_well = showing not in badly_shown
    if not _comes_again(session.protocol, trial, answer.attempt, shown_well) or trial_goes_on:
        return session, answer
    end = max(i for i, step in enumerate(session.steps) if step.study == trial.study) + 1
    repeat = _trial_steps(session.protocol, trial, answer.attempt + 1, frozenset())
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


def _comes_again(protocol: Protocol, trial: Trial, attempt: int, shown_well: bool) -> bool:
    """Whether a trial is queued again: badly shown, and not too often yet, so that no slow machine keeps anyone."""
    return not shown_well and attempt <= protocol.timing.show_again and trial.role != "practice"


def right_answer(trial: Trial) -> str | None:
    """What the right answer to a trial is; None where none is right."""
    if trial.role == "check":
        return trial.expected
    if trial.task == "same-different":
        return "different" if trial.difference_frames else "same"
    return None


def _feedback(protocol: Protocol, trial: Trial, answer: Answer) -> str:
    texts, right = protocol.texts, right_answer(trial)
    if answer.missed:
        return texts.missed
    if right is None:
        return texts.practice_noted
    if answer.value == right:
        return texts.practice_right
    return texts.practice_wrong.replace("{answer}", answer_words(protocol, right))


def answer_words(protocol: Protocol, value: str) -> str:
    """What stands on the button of an answer; points of a scale are their own words."""
    return str(getattr(protocol.texts, value, value))


def answer_keys(protocol: Protocol, legal: Sequence[str]) -> dict[str, str]:
    """The key of each legal answer; points of a scale have their digit, and 10 has none."""
    keys = {value: getattr(protocol.keys, value, value) for value in legal}
    return {value: key for value, key in keys.items() if len(key) == 1}


def _film_times(protocol: Protocol, plan: Plan, frames: Mapping[str, int]) -> wording.Films:
    shown: dict[str, dict[bool, list[int]]] = {}
    for trial in plan.trials:
        own = shown.setdefault(trial.study, {True: [], False: []})
        own[trial.role == "practice"].append(sum(frames[name] for name in (trial.first, trial.second) if name))
    return {
        study: wording.FilmTimes(*(sum(own) / len(own) / protocol.fps if own else 0.0 for own in (of[False], of[True])))
        for study, of in shown.items()
    }


def _steps(
    protocol: Protocol, plan: Plan, answers: Sequence[Answer], passed: Collection[str], films: wording.Films
) -> tuple[Step, ...]:
    """All that is left to do, in order."""
    known = {trial.trial for trial in plan.trials}
    if strays := sorted({answer.trial for answer in answers} - known):
        raise SessionError(f"Expected answers to the plan's trials 1 to {len(plan.trials)}, found trials {strays}.")
    steps: list[Step] = []
    if "consent" not in passed and (text := wording.consent_text(protocol, films)):
        steps.append(Step("consent", text=text))
    if protocol.form and "form" not in passed:
        steps.append(Step("form", text=protocol.texts.form.strip()))
    if not answers and (text := wording.welcome_text(protocol, films)):
        steps.append(Step("instructions", text=text))
    earlier: dict[int, list[tuple[int, Answer]]] = {}
    for place, answer in enumerate(answers):
        earlier.setdefault(answer.trial, []).append((place, answer))
    studies: dict[str, list[Trial]] = {}
    for trial in plan.trials:
        studies.setdefault(trial.study, []).append(trial)
    breaks = _breaks(protocol, plan)
    for trials in studies.values():
        steps += _study_steps(protocol, trials, earlier, breaks, films)
    if "debrief" not in passed and (text := wording.debrief_text(protocol, films)):
        steps.append(Step("debrief", text=text))
    return (*steps, Step("done"))


def _study_steps(
    protocol: Protocol,
    trials: Sequence[Trial],
    earlier: Mapping[int, Sequence[tuple[int, Answer]]],
    breaks: Collection[int],
    films: wording.Films,
) -> list[Step]:
    """What is left of a study: its instructions, trials with breaks, and those that come again, as they were queued.

    `earlier` has the answers of each trial that has any, with their places among all; `breaks` the trials with a break
    after them.
    """
    study = protocol.study(trials[0].study)
    steps: list[Step] = []
    again: list[tuple[int, list[Step]]] = []
    begun = any(trial.trial in earlier for trial in trials if trial.role != "practice")
    practised = trials[0].role == "practice" and not begun
    for trial in trials:
        if practised and trial.role != "practice" and protocol.texts.practice_over.strip():
            steps.append(Step("instructions", study.name, protocol.texts.practice_over.strip()))
        practised = practised and trial.role == "practice"
        answers = earlier.get(trial.trial, ())
        attempt, done = _state(protocol, study, trial, [answer for _, answer in answers])
        if done is None:
            continue
        if attempt > 1:
            queued = max(place for place, answer in answers if answer.attempt == attempt - 1)
            again.append((queued, _trial_steps(protocol, trial, attempt, done)))
            continue
        steps += _trial_steps(protocol, trial, attempt, done)
        if trial.trial in breaks:
            steps.append(Step("break", study.name, protocol.texts.break_text.strip()))
    steps += [step for _, repeated in sorted(again, key=lambda one: one[0]) for step in repeated]
    if steps and (text := wording.instructions_text(protocol, study, films)):
        steps.insert(0, Step("instructions", study.name, text, stimulus=trials[0].first if study.example else ""))
    return steps


def _breaks(protocol: Protocol, plan: Plan) -> set[int]:
    """The trials that a break follows: every so many, practice not counted, and never the last one."""
    counted = [trial.trial for trial in plan.trials if trial.role != "practice"]
    every = protocol.timing.break_after
    return set(counted[every - 1 : -1 : every]) if every else set()


def _state(
    protocol: Protocol, study: StudySpec, trial: Trial, answers: Sequence[Answer]
) -> tuple[int, frozenset[str] | None]:
    """Which showing of a trial is due and which of its items are answered; None for the items where it is finished."""
    items = {""} if trial.role == "check" else {item.name for item in study.items} or {""}
    attempt = max((answer.attempt for answer in answers), default=1)
    latest = [answer for answer in answers if answer.attempt == attempt]
    done = frozenset(answer.item for answer in latest)
    if not items <= done:
        return attempt, done
    if not _comes_again(protocol, trial, attempt, all(answer.shown_well for answer in latest)):
        return attempt, None
    return attempt + 1, frozenset()


def _trial_steps(protocol: Protocol, trial: Trial, attempt: int, done: frozenset[str]) -> list[Step]:
    study, timing = protocol.study(trial.study), protocol.timing
    base = Step("first", trial.study, stimulus=trial.first, trial=trial.trial, attempt=attempt, role=trial.role)
    steps = [base]
    if trial.second:
        steps.append(replace(base, kind="gap", stimulus="", duration_s=timing.gap_s))
        steps.append(replace(base, kind="second", stimulus=trial.second))
    legal = legal_answers(study)
    # A rating is a questionnaire: it has no answer window (2003 section 4.2).
    window_s = None if study.task == "rating" else timing.answer_s
    ask = replace(
        base, kind="answer", stimulus="", text=wording.question_text(protocol, study), duration_s=window_s, legal=legal
    )
    if trial.role == "check":
        words = protocol.texts.attention_check.replace("{answer}", answer_words(protocol, trial.expected))
        steps.append(replace(ask, text=words))
    elif study.items:
        steps += [
            replace(ask, item=item.name, text=item.question, low=item.low, middle=item.middle, high=item.high)
            for item in study.items
            if item.name not in done
        ]
    else:
        steps.append(ask)
    steps.append(replace(base, kind="pause", stimulus="", duration_s=timing.pause_s))
    return steps
