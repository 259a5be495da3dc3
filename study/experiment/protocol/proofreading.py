"""Proofreading: what of a protocol's texts has still to be written, or contradicts its numbers.

A protocol comes in; sentences for its owner go out. Nothing here keeps a study from being run: it is what a person
would say who reads the protocol before participants do.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from study.experiment.protocol.languages import has_words
from study.tasks.registry import task_of

if TYPE_CHECKING:
    from study.experiment.protocol.whole import Protocol, StudySpec

TO_FILL_IN = "FILL IN"
"""Marks of a text that is still to be written."""


def to_do(protocol: Protocol) -> list[str]:
    """What has still to be written or looks contradictory before people read it, one sentence each."""
    notes = [
        f"{where} says {_short(text)!r}: write it before participants read it."
        for where, text in _own_texts(protocol)
        if TO_FILL_IN in text
    ]
    if not protocol.consent.text:
        notes.append('consent.text is empty: nobody is asked for consent; "{standard}" takes the built-in text.')
    elif "{standard}" in protocol.consent.text and not protocol.consent.contact:
        notes.append("consent.contact is empty: participants do not learn whom to ask; write who runs the study.")
    notes += [
        f'texts.{key} is empty: participants read none; "{{standard}}" takes the built-in text.'
        for key in ("welcome", "debrief")
        if not getattr(protocol.texts, key)
    ]
    notes += [
        f"studies.{study.name}.instructions is empty: participants see films and are not told their task before; "
        '"{standard}" takes the built-in text.'
        for study in protocol.studies
        if not study.instructions.strip()
    ]
    if not has_words(protocol.language) and (left := still_english(protocol)):
        notes.append(f"language is {protocol.language!r}, but these texts are still in English: {', '.join(left)}.")
    for study in protocol.studies:
        notes += [f"studies.{study.name}.instructions {why}" for why in _other_windows(protocol, study)]
    return notes


def _short(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= 60 else f"{line[:57]}..."


def _own_texts(protocol: Protocol) -> list[tuple[str, str]]:
    """Texts that the protocol can have of its own, with the key of each."""
    found = [(f"consent.{name}", getattr(protocol.consent, name)) for name in type(protocol.consent).model_fields]
    found += [(f"texts.{name}", getattr(protocol.texts, name)) for name in type(protocol.texts).model_fields]
    for study in protocol.studies:
        found += [(f"studies.{study.name}.{key}", getattr(study, key)) for key in ("question", "instructions")]
        found += [(f"studies.{study.name}.items.{item.name}", item.question) for item in study.items]
    return found


def still_english(protocol: Protocol) -> list[str]:
    """The keys of texts that a protocol in a language without built-in words has not written itself."""
    left = []
    for where, part in (("consent", protocol.consent), ("texts", protocol.texts)):
        fields = type(part).model_fields
        left += [
            f"{where}.{key}" for key in fields if fields[key].default and getattr(part, key) == fields[key].default
        ]
    own = [(where, text) for where, text in _own_texts(protocol) if "{standard}" in text]
    built_in = [where for where, _ in own if not _asks_by_items(protocol, where)]
    return [*left, *built_in]


def _asks_by_items(protocol: Protocol, where: str) -> bool:
    """Whether a question's built-in text is empty, since items ask in its place."""
    return any(where == f"studies.{study.name}.question" and not task_of(study).question for study in protocol.studies)


_NUMBERS = {
    **dict.fromkeys(("one", "eine", "einer", "une"), 1),
    **dict.fromkeys(("two", "zwei", "deux"), 2),
    **dict.fromkeys(("three", "drei", "trois"), 3),
    **dict.fromkeys(("four", "vier", "quatre"), 4),
    **dict.fromkeys(("five", "fünf", "cinq"), 5),
    **dict.fromkeys(("six", "sechs"), 6),
    **dict.fromkeys(("seven", "sieben", "sept"), 7),
    **dict.fromkeys(("eight", "acht", "huit"), 8),
    **dict.fromkeys(("nine", "neun", "neuf"), 9),
    **dict.fromkeys(("ten", "zehn", "dix"), 10),
}
# A number or a word is looked at from its beginning only, so that one long word is run through once.
_SECONDS = re.compile(
    r"((?<!\d)\d+(?:[.,]\d+)?|(?<!\w)[^\W\d]+)\s*(?:(?:seconds?|secondes?|Sekunden?)(?!\w)|秒)", re.IGNORECASE
)


def _other_windows(protocol: Protocol, study: StudySpec) -> list[str]:
    """What instructions say of seconds that the timing doesn't have."""
    timing = protocol.timing
    known = {timing.answer_s, timing.gap_s, timing.pause_s, protocol.stimuli.entry_s, protocol.stimuli.exit_s}
    found = []
    for number in _SECONDS.findall(study.instructions):
        seconds = _NUMBERS.get(number.lower()) or _as_number(number)
        if not task_of(study).timed and seconds is not None:
            known -= {timing.answer_s}
        if seconds is not None and seconds not in known:
            found.append(
                f"speaks of {number} seconds, but timing.answer_s is {timing.answer_s:g}; write {{answer_s}} there."
            )
    return found


def _as_number(text: str) -> float | None:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        return None
