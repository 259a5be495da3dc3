"""The part of Xlib that glfw does not hand on: times of events, and what to do when the X server is gone."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any


class InputEvent(ctypes.Structure):
    """`XKeyEvent` and `XButtonEvent`, which are alike, and room for every other."""

    _fields_ = (
        ("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("sent", ctypes.c_int), ("display", ctypes.c_void_p),
        ("window", ctypes.c_ulong), ("root", ctypes.c_ulong), ("child", ctypes.c_ulong), ("time", ctypes.c_ulong),
        ("x", ctypes.c_int), ("y", ctypes.c_int), ("x_root", ctypes.c_int), ("y_root", ctypes.c_int),
        ("state", ctypes.c_uint), ("code", ctypes.c_uint), ("same_screen", ctypes.c_int), ("rest", ctypes.c_long * 12),
    )  # fmt: skip


Predicate = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(InputEvent), ctypes.c_void_p)
LostHandler = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)

_kept: list[Any] = []
"""Functions that Xlib may call as long as the process runs."""


def when_server_is_lost(leave: Callable[[], None]) -> None:
    """Have a function called when the connection to the X server breaks, which has to end the process.

    Xlib ends it otherwise, with a line about an IO error: it can't go on without a server.
    """
    x = load_xlib()
    if x is None:
        return

    def lost(_: int) -> int:
        leave()
        return 0

    _kept.append(LostHandler(lost))
    x.XSetIOErrorHandler(_kept[-1])


def load_xlib() -> Any:
    """Xlib with the types of its functions; None where there is none. It is the one that glfw has loaded."""
    try:
        x = ctypes.CDLL("libX11.so.6")
    except OSError:
        return None
    pointer, number = ctypes.c_void_p, ctypes.c_ulong
    x.XOpenDisplay.restype, x.XOpenDisplay.argtypes = pointer, [ctypes.c_char_p]
    x.XDefaultRootWindow.restype, x.XDefaultRootWindow.argtypes = number, [pointer]
    x.XCreateWindow.restype = number
    x.XCreateWindow.argtypes = [
        pointer, number, *[ctypes.c_int] * 2, *[ctypes.c_uint] * 3, ctypes.c_int, ctypes.c_uint,
        pointer, number, pointer,
    ]  # fmt: skip
    x.XSelectInput.argtypes = [pointer, number, ctypes.c_long]
    x.XChangeProperty.argtypes = [pointer, number, number, number, ctypes.c_int, ctypes.c_int, pointer, ctypes.c_int]
    x.XWindowEvent.argtypes = [pointer, number, ctypes.c_long, pointer]
    x.XCloseDisplay.argtypes = x.XConnectionNumber.argtypes = [pointer]
    x.XEventsQueued.argtypes = [pointer, ctypes.c_int]
    x.XCheckIfEvent.argtypes = [pointer, pointer, Predicate, pointer]
    x.XSetIOErrorHandler.argtypes = [LostHandler]
    return x
