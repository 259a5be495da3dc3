"""No word of Segue's own reaches a participant in the window where the protocol has its own."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest
from greek import GREEK, latin
from scripted import ScriptedWindow

from renderer.events import Key, Typed
from study.apps.player import desk, loop
from study.apps.player.lettering import default_font
from study.apps.player.pages import Look, Page
from study.experiment.plan import draw_plan
from study.experiment.protocol.whole import parse_protocol
from study.experiment.session import open_session
from study.experiment.stimuli.prepare import prepare
from study.motion.library import open_library


def words_of(page: Page) -> str:
    """Everything that can be read on a page."""
    own = [getattr(page, one.name) for one in fields(page) if isinstance(getattr(page, one.name), str)]
    return " ".join([*own, *(f"{button.words} {button.key_words}" for button in page.buttons)])


class Patient(ScriptedWindow):
    """A participant who fills in the form, answers with the first button, and once asks to stop and stays."""

    def __init__(self) -> None:
        super().__init__()
        self.page: Page | None = None
        self.asked_to_stop = False
        self.typed_wrongly = False

    def wait(self, timeout_s: float | None = None) -> tuple[Any, ...]:
        if self._drawn[0] != "page" or self.page is None or self._coming:
            return super().wait(timeout_s)
        self._now_s += 0.2
        if self.page.entry is not None and not self.page.entry and not self.typed_wrongly:
            self.typed_wrongly = True
            return (Typed("7", self._now_s), Key("enter", self._now_s + 0.1))
        if self.page.entry == "7":
            return (Typed("7", self._now_s), Key("enter", self._now_s + 0.1))
        if not self.asked_to_stop and not self.page.progress and self.page.entry is None:
            self.asked_to_stop = True
            return (Key("escape", self._now_s),)
        button = self.page.buttons[0]
        return (Key(button.key or "enter", self._now_s),)


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> list[Page]:
    """Every page that is drawn."""
    pages: list[Page] = []
    for module in (desk, loop):
        drawn = module.draw_page

        def keep(page: Page, *more: Any, _drawn: Any = drawn, **options: Any) -> Any:
            pages.append(page)
            return _drawn(page, *more, **options)

        monkeypatch.setattr(module, "draw_page", keep)
    return pages


def test_every_page_of_the_window_is_in_the_protocol_s_words(seen: list[Page], store: Any) -> None:
    protocol = parse_protocol(GREEK)
    stimuli = prepare(protocol, open_library("synthetic"))
    session = open_session(protocol, draw_plan(protocol, stimuli.pairs, "p1"))
    window = Patient()
    look = Look((222, 223, 225), (default_font(),))
    shown = desk.Desk.show_page

    def follow(self: Any, page: Page) -> Any:
        window.page = page
        return shown(self, page)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(desk.Desk, "show_page", follow)
        assert loop.play(window, session, stimuli.stimulus, store, look).end == "finished"
    assert store.all("form")[0]["age"] == "77"
    read = {words_of(page) for page in seen}
    assert len(read) > 15
    assert {word for text in read for word in latin(text)} <= {"E", "X"}, "but for the names of keys"
