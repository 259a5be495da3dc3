"""Wording: what participants read, with what the protocol leaves to Segue put in; and how long it all takes.

A protocol comes in; texts go out. In the texts of consent, welcome, instructions, question and debriefing
`{standard}` stands for the built-in text of the protocol's language, and other words in braces for numbers that follow
from the protocol (`protocol_parts.SLOTS`), so that no text can say another number than the study has.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from study.experiment.protocol.languages import words
from study.experiment.protocol.whole import Protocol, StudySpec
from study.tasks.registry import layout_of, orders_of, task_of

_ANSWER_S = 2.0
_ITEM_S = 6.0
_FIELD_S = 8.0
_BREAK_S = 30.0
_LETTERS_A_SECOND = 15.0


@dataclass(frozen=True)
class Read:
    """One text that a participant reads: where in the protocol it comes from, and its words."""

    where: str
    text: str


@dataclass(frozen=True)
class FilmTimes:
    """Seconds of film in a trial of a study, and in a practice trial, on average."""

    trial_s: float
    practice_s: float


Films = Mapping[str, FilmTimes]
"""What is known of the films, by study."""

NO_FILMS: Films = {}


def consent_text(protocol: Protocol, films: Films = NO_FILMS) -> str:
    """The consent text; empty if there is none."""
    return _filled(protocol.consent.text, _standard(protocol, "consent"), _slots(protocol, films))


def welcome_text(protocol: Protocol, films: Films = NO_FILMS) -> str:
    """What is read first; empty for nothing."""
    return _filled(protocol.texts.welcome, _welcome_standard(protocol), _slots(protocol, films))


def _welcome_standard(protocol: Protocol) -> str:
    """The built-in welcome: by how many films a trial shows, or that it differs from part to part."""
    kinds = {
        "welcome_together" if layout_of(study) == "side by side" else task_of(study).welcome
        for study in protocol.studies
    }
    name = "welcome_films_and_pairs" if kinds == {"welcome_films", "welcome_pairs"} else "welcome_mixed"
    name = kinds.pop() if len(kinds) == 1 else name
    parts = ["parts"] if len(protocol.studies) > 1 else []
    return "\n\n".join(_standard(protocol, each) for each in (name, *parts))


def instructions_text(protocol: Protocol, study: StudySpec, films: Films = NO_FILMS) -> str:
    """What is read before a study; empty for nothing."""
    return _filled(study.instructions, _instructions_standard(protocol, study), _slots(protocol, films))


def _instructions_standard(protocol: Protocol, study: StudySpec) -> str:
    besides = {"ties": study.ties, "confidence": study.confidence_points, "practice": study.practice}
    own = "preference_together" if study.side_by_side else task_of(study).instructions
    named = (own, *(name for name, there in besides.items() if there))
    return "\n\n".join(_standard(protocol, name) for name in named)


def question_text(protocol: Protocol, study: StudySpec) -> str:
    """What is asked after each pair; the items of a rating study ask for themselves."""
    own = "question_preference_together" if study.side_by_side else task_of(study).question
    return _filled(study.question, _standard(protocol, own), {})


def debrief_text(protocol: Protocol, films: Films = NO_FILMS) -> str:
    """What is read at the end; empty for nothing."""
    return _filled(protocol.texts.debrief, _standard(protocol, "debrief"), _slots(protocol, films))


def _standard(protocol: Protocol, name: str) -> str:
    return str(words(protocol.language)["standard"].get(name, "")).strip()


def _filled(text: str, standard: str, slots: Mapping[str, str]) -> str:
    filled = text.strip().replace("{standard}", standard)
    for slot, value in slots.items():
        filled = filled.replace(f"{{{slot}}}", value.strip())
        filled = re.sub(rf"\{{{slot}:(.*?)\|(.*?)\}}", r"\1" if value == "1" else r"\2", filled)
    # A slot that is empty leaves no hole.
    return re.sub(r"\n\s*\n(\s*\n)+", "\n\n", filled).strip()


def _slots(protocol: Protocol, films: Films) -> dict[str, str]:
    fewest = sum(protocol.fewest_trials_of(study) for study in protocol.studies)
    most = sum(protocol.trials_of(study) for study in protocol.studies)
    return {
        "minutes": str(minutes(duration_s(protocol, films=films))),
        "trials": str(most) if fewest == most else f"{fewest}–{most}",
        "studies": str(len(protocol.studies)),
        "answer_s": f"{protocol.timing.answer_s:g}",
        "contact": protocol.consent.contact,
    }


def duration_s(protocol: Protocol, *, at_most: bool = False, films: Films = NO_FILMS) -> float:
    """How long a session takes, in seconds: films, gaps, answers, pauses, breaks, practice, the form and reading.

    Parameters
    ----------
    at_most
        With every answer at the end of its window, and every trial shown again because its films stalled.
    films
        What is known of the films, by study. Where nothing is, they are taken to be a second longer than entry and
        exit, and a film with a hop two blends and a stay longer.

    Notes
    -----
    Two seconds for an answer (six for an item of a rating), and 15 letters read a second.
    """
    total, counted = 0.0, 0
    for study in protocol.studies:
        again = 1 + (protocol.timing.show_again if at_most else 0)
        most = protocol.trials_of(study)
        trials = most if at_most else (most + protocol.fewest_trials_of(study)) / 2
        shown = again * (trials + study.attention_checks)
        known = films.get(study.name) or _estimated(protocol, study)
        besides_s = _besides_s(protocol, study, at_most)
        total += shown * (known.trial_s + besides_s) + study.practice * (known.practice_s + besides_s)
        counted += protocol.trials_of(study) + study.attention_checks
    if protocol.timing.break_after:
        total += _BREAK_S * ((counted - 1) // protocol.timing.break_after)
    fields = sum(len(protocol.form_of(name)) for name in ("", *(study.name for study in protocol.studies)))
    return total + _FIELD_S * fields + _letters(protocol) / _LETTERS_A_SECOND


def _estimated(protocol: Protocol, study: StudySpec) -> FilmTimes:
    stimuli = protocol.stimuli
    usual_s = (method.make.usual_s(method.length, protocol.fps) for method in protocol.methods_of(study).values())
    film_s = stimuli.entry_s + stimuli.exit_s + max(usual_s)
    shown_s = film_s if layout_of(study) == "side by side" else len(orders_of(study)[0]) * film_s
    return FilmTimes(shown_s, shown_s)


def _besides_s(protocol: Protocol, study: StudySpec, at_most: bool) -> float:
    """What a trial takes in addition to its films."""
    timing = protocol.timing
    answer_s = timing.answer_s if at_most else min(_ANSWER_S, timing.answer_s)
    gap_s = timing.gap_s * (len(orders_of(study)[0]) - 1) if layout_of(study) == "one after another" else 0.0
    sure_s = _ANSWER_S if study.confidence_points else 0.0
    return gap_s + (_ITEM_S * len(study.items) or answer_s) + sure_s + timing.pause_s


def _letters(protocol: Protocol) -> int:
    """How much there is to read before, between and after the trials, slots not filled in."""
    texts = [
        (protocol.consent.text, _standard(protocol, "consent")),
        (protocol.texts.welcome, _welcome_standard(protocol)),
        *((study.instructions, _instructions_standard(protocol, study)) for study in protocol.studies),
        (protocol.texts.debrief, _standard(protocol, "debrief")),
    ]
    return sum(len(text.strip().replace("{standard}", standard)) for text, standard in texts)


def minutes(seconds: float) -> int:
    """Whole minutes to tell participants: rounded up, and to fives above ten."""
    whole = max(1, math.ceil(seconds / 60.0))
    return whole if whole <= 10 else 5 * math.ceil(whole / 5)


def all_texts(protocol: Protocol, films: Films = NO_FILMS) -> tuple[Read, ...]:
    """Every text of a session that participants read, in its order, and then the small words of the front ends."""
    consent = protocol.consent
    found = [Read("consent.text", consent_text(protocol, films))]
    found += [Read(f"consent.{name}", getattr(consent, name)) for name in ("agree", "decline", "declined")]
    for field in protocol.form:
        found.append(Read(f"form: {field.name}", " | ".join([field.label, *field.choices])))
    found.append(Read("texts.welcome", welcome_text(protocol, films)))
    for study in protocol.studies:
        found.append(Read(f"{study.name}: instructions", instructions_text(protocol, study, films)))
        found.append(Read(f"{study.name}: question", question_text(protocol, study)))
        for item in study.items:
            scale = " ... ".join(filter(None, (item.low, item.middle, item.high)))
            ends = f" [{scale}]" if scale else ""
            found.append(Read(f"{study.name}: item {item.name}", item.question + ends))
        for field in study.form:
            found.append(Read(f"{study.name}: form: {field.name}", " | ".join([field.label, *field.choices])))
    found.append(Read("texts.debrief", debrief_text(protocol, films)))
    small = [name for name in type(protocol.texts).model_fields if name not in ("welcome", "debrief")]
    found += [Read(f"texts.{name}", getattr(protocol.texts, name)) for name in small]
    return tuple(read for read in found if read.text)
