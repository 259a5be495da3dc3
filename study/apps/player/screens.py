"""Screens: the page of each step of a session, in the words of its protocol. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from study.apps.player.pages import AGAIN, POINTS, Button, Page, cells_of
from study.experiment.protocol.texts import FormField
from study.experiment.protocol.whole import Protocol
from study.experiment.steps import Step, answer_keys, answer_words
from study.tasks.registry import layout_of, orders_of
from study.tasks.task import Kind


def reading_page(protocol: Protocol, step: Step, progress: tuple[int, int]) -> Page:
    """Welcome, instructions (with an example where there is one), feedback, a break, the debriefing."""
    texts = protocol.texts
    buttons = [Button("go-on", texts.go_on, "space", texts.space_key)]
    if step.kind == "instructions" and step.stimulus:
        buttons.append(Button("example", texts.example, "e", "E"))
    note = texts.practice if step.role == "practice" else ""
    return _with_progress(protocol, Page(step.text, buttons=tuple(buttons), note=note), progress, step.kind == "break")


def _with_progress(protocol: Protocol, page: Page, progress: tuple[int, int], shown: bool) -> Page:
    if not shown:
        return page
    words = protocol.texts.progress.replace("{done}", str(progress[0])).replace("{total}", str(progress[1]))
    return replace(page, progress=progress, progress_words=words)


def consent_page(protocol: Protocol, step: Step) -> Page:
    """What is agreed to."""
    consent = protocol.consent
    return Page(
        step.text, buttons=(Button("agree", consent.agree, "1", "1"), Button("decline", consent.decline, "2", "2"))
    )


def answer_page(protocol: Protocol, step: Step, progress: tuple[int, int]) -> Page:
    """The question after the stimuli, a button for each legal answer."""
    page = ANSWERS[step.answered_by](protocol, step)
    note = protocol.texts.practice if step.role == "practice" else ""
    page = _beside(protocol, step, replace(page, note=note))
    return _with_progress(protocol, page, progress, step.role != "practice")


def _beside(protocol: Protocol, step: Step, page: Page) -> Page:
    """Films that are shown at once stay over the question, and may be played again."""
    study = protocol.study(step.study)
    if layout_of(study) != "side by side":
        return page
    return fewer_replays(protocol, step, replace(page, cells=cells_of(step.sliders or len(orders_of(study)[0]))), 1)


def fewer_replays(protocol: Protocol, step: Step, page: Page, plays: int) -> Page:
    """The same page after films were played so many times."""
    study, texts = protocol.study(step.study), protocol.texts
    left = study.replays + 1 - plays
    others = tuple(button for button in page.buttons if button.name != AGAIN)
    again = (Button(AGAIN, f"{texts.play_again} ({left})", "r", "R"),) if left > 0 else ()
    return replace(page, buttons=(*others, *again), chosen=-1)


def _buttons(protocol: Protocol, step: Step) -> tuple[Button, ...]:
    keys = answer_keys(protocol, step.legal)
    buttons = []
    for value in step.legal:
        words, key = answer_words(protocol, value, protocol.study(step.study)), keys.get(value, "")
        # A digit on its own button says which key it is.
        buttons.append(Button(value, words, key, "" if words == key else key.upper()))
    return tuple(buttons)


def _words(protocol: Protocol, step: Step) -> Page:
    return Page(question=step.text, buttons=_buttons(protocol, step))


def _points(protocol: Protocol, step: Step) -> Page:
    scale = Page(question=step.text, buttons=_buttons(protocol, step), style=POINTS)
    return replace(scale, low=step.low, middle=step.middle, high=step.high)


def _slider(protocol: Protocol, step: Step) -> Page:
    texts, ticks = protocol.texts, protocol.study(step.study).slider == "ticks"
    button = Button("go-on", texts.go_on, "space", texts.space_key)
    scale = Page(question=step.text, buttons=(button,), sliders=(None,) * step.sliders, ticks=ticks)
    return replace(scale, low=step.low, middle=step.middle, high=step.high)


ANSWERS: Mapping[Kind, Callable[[Protocol, Step], Page]] = {"word": _words, "point": _points, "slider": _slider}
"""What each kind of answer looks like."""


def field_page(
    protocol: Protocol, field: FormField, heading: str, entry: str, *, first: bool, complaint: bool = False
) -> Page:
    """One question of the form.

    Parameters
    ----------
    entry
        What is filled in so far.
    first
        Whether no question comes before it, so that there is no way back.
    complaint
        Whether what was typed can't be taken.
    """
    texts = protocol.texts
    back = None if first else Button("back", texts.previous, "up", "↑")
    if field.kind == "choice":
        buttons = [
            Button(f"choice-{number}", choice, str(number) if number <= 9 else "", str(number) if number <= 9 else "")
            for number, choice in enumerate(field.choices, start=1)
        ]
        if not field.required:
            buttons.append(Button("go-on", texts.skip, "0", "0"))
        before = field.choices.index(entry) if entry in field.choices else -1
        return Page("", field.label, tuple(buttons), note=heading, chosen=before, back=back)
    words = texts.go_on if entry or field.required else texts.skip
    hint = _range(field)
    if complaint:
        hint = f"{texts.not_taken} {hint}".strip()
    button = Button("go-on", words, "enter", texts.enter_key)
    return Page("", field.label, (button,), note=heading, entry=entry, hint=hint, back=back)


def _range(field: FormField) -> str:
    if field.least is None and field.most is None:
        return ""
    least = "" if field.least is None else f"{field.least:g}"
    most = "" if field.most is None else f"{field.most:g}"
    return f"{least} – {most}"


def stop_page(protocol: Protocol) -> Page:
    """Whether the participant really wants to stop."""
    texts = protocol.texts
    buttons = (Button("stay", texts.stay, "space", texts.space_key), Button("stop", texts.stop, "x", "X"))
    return Page(question=texts.stop_question, buttons=buttons, hint=texts.stop_note)


def away_page(protocol: Protocol) -> Page:
    """The window has lost the keyboard."""
    texts = protocol.texts
    return Page(texts.away, buttons=(Button("go-on", texts.go_on, "space", texts.space_key),))


def last_page(protocol: Protocol, text: str) -> Page:
    """The very last words."""
    texts = protocol.texts
    return Page(text, buttons=(Button("go-on", texts.close, "space", texts.space_key),))
