"""When the X server took a key or a button, whatever the window's own process was doing then.

glfw hands an event over when its process gets to it: some tenths of a millisecond after the key on an idle machine, but
milliseconds later on one whose processors are busy. The server notes the millisecond in which it took each event, and
glfw passes that over; it is read here, out of the queue of events, before glfw takes them. The time of an event is
then that of its arrival, but never later than the end of the server's millisecond.

Only where glfw runs on X11 and the server counts the same clock as this process (it does on one machine; a display
across a network is found out by asking). Elsewhere arrival is all there is.
"""

from __future__ import annotations

import ctypes
import select
import time
from typing import Any

from renderer.xlib import InputEvent, Predicate, load_xlib

_KEY_PRESS, _BUTTON_PRESS = 2, 4
_PROPERTY_CHANGES = 1 << 22
_XA_STRING, _APPEND, _INPUT_ONLY = 31, 2, 2
_AFTER_READING, _AFTER_FLUSH = 1, 2
_COMPARISONS = 5

TICK_MS = 1.0
"""The server counts whole milliseconds."""


class _PropertyEvent(ctypes.Structure):
    _fields_ = (
        ("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("sent", ctypes.c_int), ("display", ctypes.c_void_p),
        ("window", ctypes.c_ulong), ("atom", ctypes.c_ulong), ("time", ctypes.c_ulong), ("rest", ctypes.c_long * 18),
    )  # fmt: skip


def pressed_at(arrived_s: float, server_ms: int) -> float:
    """When a key was pressed, from when its event arrived and the millisecond in which the server took it.

    Both on the same clock; the server's count wraps after 2^32 milliseconds.
    """
    behind_ms = (arrived_s * 1000.0 - server_ms) % 2.0**32
    if behind_ms >= 2.0**31:  # the server is ahead, by rounding
        return arrived_s
    return arrived_s - max(0.0, behind_ms - TICK_MS) / 1000.0


class ServerTimes:
    """The times of the events that wait in one connection's queue; made by `server_times`."""

    def __init__(self, x: Any, display: int) -> None:
        self._x, self._display = x, ctypes.c_void_p(display)
        self._socket = int(x.XConnectionNumber(self._display))
        self._found: dict[tuple[int, int], list[float]] = {}
        self._predicate = Predicate(self._look_at)
        self._unused = InputEvent()

    def wait(self, timeout_s: float | None) -> None:
        """Sleep until there are events, or until the time is over."""
        if not self._x.XEventsQueued(self._display, _AFTER_FLUSH):
            select.select([self._socket], [], [], timeout_s)

    def read(self) -> None:
        """Look through all events that have arrived, and leave them where they are."""
        self._found.clear()
        self._x.XEventsQueued(self._display, _AFTER_READING)
        self._x.XCheckIfEvent(self._display, ctypes.byref(self._unused), self._predicate, None)

    def key(self, code: int, handled_s: float) -> float:
        """When the next key of that code was pressed; all times by `time.monotonic`."""
        return self._next(_KEY_PRESS, code, handled_s)

    def button(self, number: int, handled_s: float) -> float:
        """When the next mouse button of that number, from 1, was pressed."""
        return self._next(_BUTTON_PRESS, number, handled_s)

    def _next(self, kind: int, code: int, handled_s: float) -> float:
        found = self._found.get((kind, code))
        return found.pop(0) if found else handled_s

    def _look_at(self, _: int, event: Any, __: int) -> int:
        one = event.contents
        if one.type in (_KEY_PRESS, _BUTTON_PRESS):
            at = pressed_at(time.monotonic(), one.time)
            self._found.setdefault((one.type, one.code), []).append(at)
        return 0  # none is taken out


def server_times(glfw: Any) -> ServerTimes | None:
    """Server times of glfw's connection; None where it has none, or where the server counts another clock."""
    if glfw.get_platform() != glfw.PLATFORM_X11:
        return None
    x = load_xlib()
    if x is None or not _same_clock(x):
        return None
    return ServerTimes(x, int(ctypes.cast(glfw.get_x11_display(), ctypes.c_void_p).value or 0))


def _same_clock(x: Any) -> bool:
    """Ask the server for its time now, on a connection of our own: it has to lie between our before and after."""
    display = x.XOpenDisplay(None)
    if not display:
        return False
    try:
        root = x.XDefaultRootWindow(display)
        window = x.XCreateWindow(display, root, 0, 0, 1, 1, 0, 0, _INPUT_ONLY, None, 0, None)
        x.XSelectInput(display, window, _PROPERTY_CHANGES)
        event = _PropertyEvent()
        for _ in range(_COMPARISONS):
            before_s = time.monotonic()
            x.XChangeProperty(display, window, _XA_STRING, _XA_STRING, 8, _APPEND, None, 0)
            x.XWindowEvent(display, window, _PROPERTY_CHANGES, ctypes.byref(event))
            if not agrees(before_s, int(event.time), time.monotonic()):
                return False
    finally:
        x.XCloseDisplay(display)
    return True


def agrees(before_s: float, server_ms: int, after_s: float) -> bool:
    """Whether the server's millisecond lies between two moments of our clock."""
    since_before_ms = (server_ms + TICK_MS - before_s * 1000.0) % 2.0**32
    return since_before_ms <= (after_s - before_s) * 1000.0 + TICK_MS
