"""A scripted window: stands in for `renderer.window.Window`, clock and participant included, so that whole sessions run
in milliseconds without a display. It draws nothing; it keeps what was shown, and when.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.events import Click, Event, Key
from renderer.pacing import Pacing, next_flip
from study.errors import SessionError


@dataclass(frozen=True)
class Act:
    """What the participant does at a page: events, and how long after the page was presented; none is patience."""

    events: tuple[Event, ...] = ()


def press(name: str, after_s: float = 0.4) -> Act:
    """Press one key."""
    return Act((Key(name, after_s),))


def click(x: float, y: float, after_s: float = 0.4) -> Act:
    """Click with the mouse."""
    return Act((Click(x, y, after_s),))


class Shown:
    """A picture or a motion in the scripted window's memory."""

    def __init__(self, rgb: NDArray[np.uint8] | None, frames: int = 0) -> None:
        self.rgb, self.frames, self.released = rgb, frames, False
        self.place = (0, 0, 0, 0)

    def release(self) -> None:
        """Nothing to free; remembered, to find what is shown after it was freed."""
        self.released = True


class ScriptedWindow:
    """A window whose time passes only in flips and waits, and whose participant follows a script.

    Parameters
    ----------
    script
        One act for each page that is put up, in order; a page that is merely drawn again takes none.
    refresh_hz, own_clock
        The display.
    late_s
        Seconds by which a flip comes too late, by its number, counted from 0.
    at_flip
        Events that arrive right after a flip, by its number; their own times are not looked at.
    size
        In pixels.
    """

    def __init__(
        self,
        script: Iterable[Act] = (),
        *,
        refresh_hz: float = 60.0,
        own_clock: bool = False,
        late_s: Mapping[int, float] | None = None,
        at_flip: Mapping[int, Event] | None = None,
        size: tuple[int, int] = (640, 480),
    ) -> None:
        self.pacing = Pacing(refresh_hz, 0.0 if own_clock else refresh_hz, 1.0 / refresh_hz, own_clock)
        self.size, self.focused = size, True
        self.monitor, self.other_hz = "scripted", refresh_hz
        self.shown: list[tuple[str, Any, float]] = []
        self._script = iter(script)
        self._late, self._at_flip = dict(late_s or {}), dict(at_flip or {})
        self._now_s = self._last_flip_s = 0.0
        self._drawn: tuple[str, Any] = ("nothing", None)
        self._page: Shown | None = None
        self._coming: list[Event] = []

    def settle(self, colour: tuple[int, int, int]) -> bool:
        """Takes the rate `other_hz`, where a test has moved the window there (`monitor`)."""
        del colour
        moved = self.monitor != "scripted" and self.pacing.refresh_hz != self.other_hz
        if moved:
            self.pacing = replace(self.pacing, refresh_hz=self.other_hz)
        return moved

    def describe(self) -> dict[str, Any]:
        """As the real one, in short."""
        return {"display": "scripted", "own_clock": self.pacing.own_clock, "timing_measured": self.pacing.measured}

    def now(self) -> float:
        """The scripted time."""
        return self._now_s

    def next_flip_s(self) -> float:
        """The next beat of the display."""
        return next_flip(self._last_flip_s, self.pacing.period_s, self._now_s)

    def flip(self) -> float:
        """Advance the time to the next beat, or past it if the script says so."""
        number = len(self.shown)
        at = self.next_flip_s()
        if number in self._late:
            at = next_flip(at, self.pacing.period_s, at + self._late[number] - 0.001)
        self._now_s = self._last_flip_s = at
        self.shown.append((*self._drawn, at))
        if number in self._at_flip:
            self._coming.append(replace(self._at_flip[number], time_s=at))
        kind, thing = self._drawn
        if kind == "page" and thing is not self._page:
            act = next(self._script, Act())
            self._coming += [replace(event, time_s=at + event.time_s) for event in act.events]
        self._page = thing if kind == "page" else None
        return at

    def picture(self, rgb: NDArray[np.uint8]) -> Shown:
        """Keeps the picture."""
        return Shown(rgb)

    def drawing(self, positions: Any, figure: Any, camera: Any, fps: float, *, height: float, cell: Any) -> Shown:
        """Keeps how many frames there are, and how large they are."""
        del figure, fps, cell
        shown = Shown(None, len(positions))
        wide, high = camera.size
        shown.place = (0, 0, round(height * wide / high), round(height))
        return shown

    def clear(self, colour: tuple[int, int, int]) -> None:
        """The next flip shows nothing."""
        self._drawn = ("blank", colour)

    def paint(self, picture: Shown, background: tuple[int, int, int]) -> None:
        """The next flip shows a page."""
        del background
        if picture.released:
            raise SessionError("Expected a loaded image, found one that was released.")
        self._drawn = ("page", picture)

    def paint_frame(self, drawing: Shown, frame: int, *, over: bool = False) -> None:
        """The next flip shows a frame of a motion; one `over` others or a page is beside them."""
        if not 0 <= frame < drawing.frames:
            raise SessionError(f"Expected a frame from 0 to {drawing.frames - 1}, found {frame}.")
        if not over:
            self._drawn = ("frame", (drawing, frame))
        elif self._drawn[0] == "frame":
            self._drawn = ("frame", (*self._drawn[1], drawing, frame))

    def poll(self) -> tuple[Event, ...]:
        """Events that have arrived by now."""
        due = tuple(event for event in self._coming if event.time_s <= self._now_s)
        self._coming = [event for event in self._coming if event.time_s > self._now_s]
        return due

    def wait(self, timeout_s: float | None = None) -> tuple[Event, ...]:
        """Advance the time to the next event, or to the timeout."""
        if not self._coming and timeout_s is None:
            raise SessionError("Expected an act for this page, found the end of the script.")
        until = min((event.time_s for event in self._coming), default=np.inf)
        self._now_s = max(self._now_s, min(until, np.inf if timeout_s is None else self._now_s + timeout_s))
        return self.poll()

    def cursor(self, visible: bool) -> None:
        """Nothing to see."""
