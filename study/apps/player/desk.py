"""The desk: puts pages before the participant and waits for what they choose, whatever else happens to the window.

Used by `loop`, which knows what the pages are for. Escape and a window that is asked to close lead to a question first;
focus and sizes are logged; a page is drawn again where the window changed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from renderer.events import CloseAsked, Event, Focus, Key, Resized, Typed
from study.apps.player import screens
from study.apps.player.pages import Button, DrawnPage, Look, Page, changed, chosen
from study.apps.player.sheet import draw_page
from study.apps.player.showing import Showing
from study.errors import SessionError
from study.experiment.form import LONGEST_TEXT, field_value
from study.experiment.protocol.texts import FormField
from study.experiment.session import Session, current

if TYPE_CHECKING:
    from renderer.window import Window
    from study.apps.player.store import ResponsesStore

_KEPT_PAGES = 6


class Stopped(Exception):  # noqa: N818 - not an error: the participant leaves
    """The participant leaves, at any point of the session."""

    def __init__(self, end: str) -> None:
        super().__init__(end)
        self.end = end


class Desk:
    """A window with pages on it, and what was shown and went wrong in the present trial.

    `stills` are films that stay on a page with cells, each with the frame that it stands at; `standing` is the page as
    it was when its last button was chosen.
    """

    def __init__(self, window: Window, session: Session, store: ResponsesStore, look: Look) -> None:
        self.window, self.session, self.store, self.look = window, session, store, look
        self.protocol = session.protocol
        self.pages: dict[tuple[Page, tuple[int, int]], tuple[DrawnPage, Any]] = {}
        self.showings: list[Showing] = []
        self.faults: list[str] = []
        self.size = window.size
        self.stills: list[tuple[Any, int]] = []
        self.standing: Page | None = None

    def drawn(self, page: Page) -> tuple[DrawnPage, Any]:
        """A page's picture, in the window's memory; the latest few are kept."""
        key = (page, self.window.size)
        if key not in self.pages:
            drawn = draw_page(page, self.window.size, self.look)
            while len(self.pages) >= _KEPT_PAGES:
                self.pages.pop(next(iter(self.pages)))[1].release()
            self.pages[key] = (drawn, self.window.picture(drawn.rgb))
        return self.pages[key]

    def show_page(self, page: Page) -> tuple[DrawnPage, float]:
        """Put a page up; with it comes when it was presented."""
        drawn, picture = self.drawn(page)
        self.window.paint(picture, self.look.ground)
        for drawing, frame in self.stills if page.cells else ():
            self.window.paint_frame(drawing, frame, over=True)
        return drawn, self.flip_away()

    def flip_away(self) -> float:
        """Flip to something that is no stimulus: the last frame of the stimulus before ends here."""
        at = self.window.flip()
        self.showings = [one if one.ended_s is not None else replace(one, ended_s=at) for one in self.showings]
        return at

    def ask(self, page: Page, deadline_s: float | None = None) -> tuple[Button | None, float, float]:
        """Show a page until one of its buttons is chosen: the button and when, or None once the time is over; and when
        the page was presented first.
        """
        self.window.cursor(True)
        drawn, asked_s = self.show_page(page)
        # Keys pressed before the page appeared are ignored, even if they arrive later.
        self.notice(self.window.poll())
        while True:
            left = None if deadline_s is None else deadline_s - self.window.now()
            if left is not None and left <= 0:
                return None, self.window.now(), asked_s
            events = self.window.wait(left)
            for number, event in enumerate(events):
                button = chosen(drawn, event)
                in_time = asked_s <= event.time_s and (deadline_s is None or event.time_s <= deadline_s)
                if button is not None and in_time:
                    self.standing = drawn.page
                    self.notice(events[number + 1 :])  # a second key counts for nothing; a lost focus is logged
                    return button, event.time_s, asked_s
                if (turned := changed(drawn, event)) is not None:
                    drawn, _ = self.show_page(turned)
                elif self.notice((event,)):
                    self.ask_to_stop()
                    drawn, _ = self.show_page(drawn.page)
                elif isinstance(event, Resized):
                    drawn, _ = self.show_page(drawn.page)

    def read_until(self, page: Page) -> str:
        """Show a page that has no time limit; the name of the button that was chosen."""
        button, _, _ = self.ask(page)
        assert button is not None, "without a deadline there is a button"
        return button.name

    def notice(self, events: tuple[Event, ...]) -> bool:
        """Log what is to be logged; True where somebody wants to leave."""
        leave = False
        for event in events:
            if isinstance(event, Resized) and event.size != self.size:
                self.size = event.size
                self.store.event("resized", {"viewport": list(event.size)})
            leave = leave or isinstance(event, CloseAsked) or (isinstance(event, Key) and event.name == "escape")
            if isinstance(event, Focus) and not event.focused:
                self.fault("focus lost")
            if isinstance(event, Focus):
                step = current(self.session)
                self.store.event("focus", {"focused": event.focused, "trial": step.trial, "step": step.place})
        return leave

    def fault(self, what: str) -> None:
        """Note what went wrong in a trial that has begun to be shown."""
        if self.showings and what not in self.faults:
            self.faults.append(what)

    def ask_to_stop(self) -> None:
        """Whether the participant wants to leave; asks inside the question change nothing."""
        drawn, _ = self.show_page(screens.stop_page(self.protocol))
        self.window.cursor(True)
        self.fault("interrupted")
        while True:
            for event in self.window.wait(None):
                button = chosen(drawn, event)
                if button is not None and button.name == "stop":
                    step = current(self.session)
                    self.store.event("stopped", {"trial": step.trial, "step": step.place})
                    raise Stopped("stopped")
                if button is not None or (isinstance(event, Key) and event.name == "escape"):
                    return
                if (turned := changed(drawn, event)) is not None:
                    drawn, _ = self.show_page(turned)
                elif isinstance(event, Resized):
                    drawn, _ = self.show_page(drawn.page)

    def field(self, field: FormField, heading: str, before: str, *, first: bool) -> str | None:
        """Ask one question of the form until what is filled in can be taken.

        Parameters
        ----------
        heading
            Of the form.
        before
            What was filled in when this question was asked the last time.
        first
            Whether no question comes before it.

        Returns
        -------
        str or None
            Empty where it was skipped; None where the participant goes back.
        """
        if field.kind == "choice":
            name = self.read_until(screens.field_page(self.protocol, field, heading, before, first=first))
            if name == "back":
                return None
            return "" if name == "go-on" else field.choices[int(name.removeprefix("choice-")) - 1]
        entry, complaint = before, False
        drawn, _ = self.show_page(screens.field_page(self.protocol, field, heading, entry, first=first))
        while True:
            for event in self.window.wait(None):
                button = chosen(drawn, event)
                if button is not None and button.name == "back":
                    return None
                if button is not None:
                    try:
                        return field_value(field, entry.strip())
                    except SessionError:
                        complaint = True
                elif isinstance(event, Typed):
                    entry, complaint = (entry + event.character)[:LONGEST_TEXT], False
                elif isinstance(event, Key) and event.name == "backspace":
                    entry, complaint = entry[:-1], False
                elif self.notice((event,)):
                    self.ask_to_stop()
                elif not isinstance(event, Resized):
                    continue
                page = screens.field_page(self.protocol, field, heading, entry, first=first, complaint=complaint)
                drawn, _ = self.show_page(page)
