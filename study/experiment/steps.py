"""Steps: what a participant goes through, one after another.

A protocol, a plan and the answers so far come in; the steps that are left go out: consent, form, welcome, and for each
study its instructions, practice, trials and breaks; at the end the debriefing. A trial is: its stimuli with a gap
between two, the questions, a pause (2004 section 4.2). `session` walks over them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from study.experiment import wording
from study.experiment.plan import Plan
from study.experiment.protocol.whole import Protocol, StudySpec
from study.tasks.answer import CONFIDENCE, Answer
from study.tasks.registry import is_right, kind_of, layout_of, right_answer, task_of
from study.tasks.task import Kind as AnswerKind
from study.tasks.task import scale
from study.tasks.trial import PLACES, Pair, Trial

Kind = Literal[
    "consent", "form", "instructions", "stimulus", "gap", "answer", "feedback", "pause", "break", "debrief", "done"
]


@dataclass(frozen=True, slots=True)
class Step:
    """What to do now."""

    kind: Kind
    """`stimulus` plays one to its end; `gap` and `pause` wait; `answer` asks; `form` is filled in; the others are read.
    Passing over `consent` means agreeing."""
    study: str = ""
    """Name of the study; empty before the first and after the last."""
    text: str = ""
    """What the participant reads."""
    stimulus: str = ""
    """Id of the stimulus to play; with `instructions`, of the example that can be played."""
    slot: int = 0
    """Which slot of the trial the stimulus fills, from 1; 0 outside stimuli."""
    duration_s: float | None = None
    """How long a gap, pause or answer window lasts; None for as long as it takes."""
    trial: int = 0
    attempt: int = 0
    """The trial's number in the plan (0 outside trials), and which showing of it this is, from 1."""
    item: str = ""
    """The rating item that is asked, or `CONFIDENCE`."""
    answered_by: AnswerKind = "word"
    """What kind of answer is given."""
    sliders: int = 0
    """How many sliders there are, where the answer has a value for each, with a space between two."""
    legal: tuple[str, ...] = ()
    """The answers that count."""
    low: str = ""
    middle: str = ""
    high: str = ""
    """Words at the ends and in the middle of a rating scale."""
    role: str = ""
    """What the trial is for: `trial`, `practice` or `check`; empty outside trials."""

    @property
    def place(self) -> str:
        """What records call it: the slot of a stimulus (`first`, `second`), or else the kind of step."""
        return PLACES[self.slot - 1] if self.slot else self.kind


def comes_again(protocol: Protocol, trial: Trial, attempt: int, shown_well: bool) -> bool:
    """Whether a trial is queued again: after a display failure, up to a limit, so that a slow machine ends too."""
    return not shown_well and attempt <= protocol.timing.show_again and trial.role != "practice"


def feedback_text(protocol: Protocol, trial: Trial, answer: Answer) -> str:
    """What is read after the last answer to a practice trial."""
    texts, right = protocol.texts, right_answer(trial)
    if answer.missed:
        return texts.missed
    if right is None:
        return texts.practice_noted
    if answer.value == right:
        return texts.practice_right
    return texts.practice_wrong.replace("{answer}", answer_words(protocol, right))


def answer_words(protocol: Protocol, value: str, study: StudySpec | None = None) -> str:
    """What stands on the button of an answer; points of a scale are their own words, slots side by side have places."""
    beside = {"first": "left", "second": "right"} if study and study.side_by_side else {}
    return str(getattr(protocol.texts, beside.get(value, value), value))


def answer_keys(protocol: Protocol, legal: Sequence[str]) -> dict[str, str]:
    """The key of each legal answer; points of a scale have their digit, and 10 has none."""
    keys = {value: getattr(protocol.keys, value, value) for value in legal}
    return {value: key for value, key in keys.items() if len(key) == 1}


def answer_options(protocol: Protocol, legal: Sequence[str], study: StudySpec | None = None) -> list[dict[str, str]]:
    """Answers, each with its word and its key."""
    keys = answer_keys(protocol, legal)
    return [
        {"value": value, "label": answer_words(protocol, value, study), "key": keys.get(value, "")} for value in legal
    ]


def film_times(protocol: Protocol, plan: Plan, frames: Mapping[str, int]) -> wording.Films:
    """How long the films of a plan's trials take, by study; `frames` has those of each stimulus.

    Where trials depend on the answers, all pairs that they may show count alike.
    """
    shown: dict[str, dict[bool, list[int]]] = {}
    for trial in plan.trials:
        own = shown.setdefault(trial.study, {True: [], False: []})
        own[trial.role == "practice"].append(_frames_of(protocol, trial, frames))
    for course in plan.courses:
        own = shown.setdefault(course.study, {True: [], False: []})
        own[False] += [_frames_of(protocol, pair, frames) for pair in course.pairs]
    return {
        study: wording.FilmTimes(*(sum(own) / len(own) / protocol.fps if own else 0.0 for own in (of[False], of[True])))
        for study, of in shown.items()
    }


def _frames_of(protocol: Protocol, shown: Trial | Pair, frames: Mapping[str, int]) -> int:
    at_once = layout_of(protocol.study(shown.study)) == "side by side"
    return (max if at_once else sum)(frames[name] for name in shown.stimuli)


Earlier = Mapping[int, Sequence[tuple[int, Answer]]]
"""The answers of each trial that has any, with their places among all."""


def by_trial(answers: Sequence[Answer]) -> Earlier:
    """Answers by the number of their trial."""
    earlier: dict[int, list[tuple[int, Answer]]] = {}
    for place, answer in enumerate(answers):
        earlier.setdefault(answer.trial, []).append((place, answer))
    return earlier


def steps_left(
    protocol: Protocol,
    trials: Iterable[Trial],
    answers: Sequence[Answer],
    passed: Collection[str],
    breaks: Collection[int],
    films: wording.Films,
    examples: Mapping[str, str],
) -> tuple[Step, ...]:
    """All that is left to do, in order, of the trials that are known.

    `breaks` are the trials that a break follows, `examples` the stimuli that instructions show, by study, where they
    are not the first.
    """
    steps: list[Step] = []
    if "consent" not in passed and (text := wording.consent_text(protocol, films)):
        steps.append(Step("consent", text=text))
    if protocol.form and "form" not in passed:
        steps.append(Step("form", text=protocol.texts.form.strip()))
    if not answers and (text := wording.welcome_text(protocol, films)):
        steps.append(Step("instructions", text=text))
    earlier = by_trial(answers)
    studies: dict[str, list[Trial]] = {}
    for trial in trials:
        studies.setdefault(trial.study, []).append(trial)
    for own in studies.values():
        steps += _study_steps(protocol, own, earlier, passed, breaks, films, examples)
    if "debrief" not in passed and (text := wording.debrief_text(protocol, films)):
        steps.append(Step("debrief", text=text))
    return (*steps, Step("done"))


def _study_steps(
    protocol: Protocol,
    trials: Sequence[Trial],
    earlier: Earlier,
    passed: Collection[str],
    breaks: Collection[int],
    films: wording.Films,
    examples: Mapping[str, str],
) -> list[Step]:
    """What is left of a study: its instructions, trials with breaks, and those that come again, as they were queued."""
    study = protocol.study(trials[0].study)
    steps: list[Step] = []
    again: list[tuple[int, list[Step]]] = []
    begun = any(trial.trial in earlier for trial in trials if trial.role != "practice")
    practised = trials[0].role == "practice" and not begun
    practice = [trial for trial in trials if trial.role == "practice"]
    given = [answer for trial in practice for _, answer in earlier.get(trial.trial, ())]
    due = practice_due(protocol, practice, given) if practised else None
    for trial in trials:
        if practised and trial.role != "practice" and protocol.texts.practice_over.strip():
            steps.append(Step("instructions", study.name, protocol.texts.practice_over.strip()))
        practised = practised and trial.role == "practice"
        attempt, done = showing_due(protocol, trial, earlier)
        if trial.role == "practice" and due is not None and attempt < due:
            attempt, done = due, frozenset()
        if done is None:
            continue
        if attempt > 1 and trial.role != "practice":
            queued = max(place for place, answer in earlier[trial.trial] if answer.attempt == attempt - 1)
            again.append((queued, trial_steps(protocol, trial, attempt, done)))
            continue
        steps += trial_steps(protocol, trial, attempt, done)
        if trial.trial in breaks:
            steps.append(break_step(protocol, trial))
    steps += [step for _, repeated in sorted(again, key=lambda one: one[0]) for step in repeated]
    if steps and (text := wording.instructions_text(protocol, study, films)):
        example = examples.get(study.name, trials[0].stimuli[0]) if study.example else ""
        steps.insert(0, Step("instructions", study.name, text, stimulus=example))
    if study.form and form_event(study.name) not in passed:
        steps.append(Step("form", study.name, protocol.texts.study_form.strip()))
    return steps


def form_event(study: str) -> str:
    """What records that a form was filled in: the one at the start, where the name is empty, or one after a study."""
    return f"form/{study}" if study else "form"


def break_step(protocol: Protocol, trial: Trial) -> Step:
    """The break after a trial."""
    return Step("break", trial.study, protocol.texts.break_text.strip())


def breaks_of(protocol: Protocol, plan: Plan) -> set[int]:
    """The trials that a break follows: every n trials, without practice, and never the last one.

    All trials that may come count, whether they do or not.
    """
    counted = [trial.trial for trial in plan.trials if trial.role != "practice"]
    counted += [number for course in plan.courses for number in range(course.first, course.first + course.most)]
    every = protocol.timing.break_after
    return set(sorted(counted)[every - 1 : -1 : every]) if every else set()


def showing_due(protocol: Protocol, trial: Trial, earlier: Earlier) -> tuple[int, frozenset[str] | None]:
    """Which showing of a trial is due and which of its items are answered; None for the items where it is finished."""
    answers = [answer for _, answer in earlier.get(trial.trial, ())]
    attempt = max((answer.attempt for answer in answers), default=1)
    latest = [answer for answer in answers if answer.attempt == attempt]
    done = frozenset(answer.item for answer in latest)
    if not _all_asked(protocol, trial, latest):
        return attempt, done
    if not comes_again(protocol, trial, attempt, all(answer.shown_well for answer in latest)):
        return attempt, None
    return attempt + 1, frozenset()


def _all_asked(protocol: Protocol, trial: Trial, showing: Sequence[Answer]) -> bool:
    """Whether everything that one showing of a trial asks was answered, or missed."""
    items = {step.item for step in _questions(protocol, trial, Step("answer"))}
    if any(answer.missed and not answer.item for answer in showing):
        items = {""}
    return items <= {answer.item for answer in showing}


def practice_due(protocol: Protocol, trials: Sequence[Trial], answers: Sequence[Answer]) -> int | None:
    """Which round of a study's practice is due, from 1, by the answers to its trials; None where it is over."""
    study = protocol.study(trials[0].study)
    rounds = max((answer.attempt for answer in answers), default=1)
    latest = [answer for answer in answers if answer.attempt == rounds]
    if not all(_all_asked(protocol, one, [each for each in latest if each.trial == one.trial]) for one in trials):
        return rounds
    right = sum(
        is_right(one, each.value or "", right_answer(one) or "")
        for one in trials
        for each in latest
        if each.trial == one.trial and each.item != CONFIDENCE
    )
    enough = study.practice_until is None or right >= study.practice_until * len(trials) - 1e-9
    return None if enough or rounds >= study.practice_most else rounds + 1


def trial_steps(protocol: Protocol, trial: Trial, attempt: int, done: frozenset[str]) -> list[Step]:
    """A trial from its first stimulus to its pause; items that are `done` are not asked again."""
    timing = protocol.timing
    base = Step("stimulus", trial.study, trial=trial.trial, attempt=attempt, role=trial.role)
    steps: list[Step] = []
    for slot, stimulus in enumerate(trial.stimuli, start=1):
        if slot > 1 and layout_of(protocol.study(trial.study)) == "one after another":
            steps.append(replace(base, kind="gap", duration_s=timing.gap_s))
        steps.append(replace(base, stimulus=stimulus, slot=slot))
    steps += [step for step in _questions(protocol, trial, base) if step.item not in done]
    steps.append(replace(base, kind="pause", duration_s=timing.pause_s))
    return steps


def _questions(protocol: Protocol, trial: Trial, base: Step) -> list[Step]:
    """What is asked after the stimuli of a trial."""
    study, texts = protocol.study(trial.study), protocol.texts
    task, question = task_of(study), wording.question_text(protocol, study)
    ask = replace(base, kind="answer", text=question, legal=task.legal(study), answered_by=kind_of(study))
    sliders = (len(trial.stimuli) if layout_of(study) == "side by side" else 1) if kind_of(study) == "slider" else 0
    ask = replace(ask, sliders=sliders, duration_s=protocol.timing.answer_s if task.timed else None)
    if trial.role == "check":
        return [
            replace(ask, text=texts.attention_check.replace("{answer}", answer_words(protocol, trial.expected, study)))
        ]
    if study.items:
        return [
            replace(ask, item=item.name, text=item.question, low=item.low, middle=item.middle, high=item.high)
            for item in study.items
        ]
    if study.confidence_points is None:
        return [ask]
    sure = replace(base, kind="answer", item=CONFIDENCE, text=texts.how_sure, answered_by="point")
    sure = replace(sure, low=texts.least_sure, high=texts.most_sure, legal=scale(study.confidence_points))
    return [ask, sure]
