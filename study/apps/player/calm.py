"""Calm: what keeps this process from being late. No garbage collection in mid-trial, and precedence where allowed."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager

NICE = -10
"""Priority over other processes, as usual for programs with real-time audio or video."""


def take_precedence() -> bool:
    """Go before other processes from now on, where the system allows that; whether it does.

    Unprivileged users are allowed to where their limit `nice` says so (`ulimit -e`, limits.conf), root always. A
    process that somebody gave another place than the usual one stays there.
    """
    try:
        if os.getpriority(os.PRIO_PROCESS, 0) != 0:
            return False
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
    except (OSError, AttributeError):  # not allowed, or not on this system
        return False
    return True


@contextmanager
def calm() -> Iterator[None]:
    """No garbage collection meanwhile: it can take longer than a frame."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@contextmanager
def settled() -> Iterator[None]:
    """What was loaded up to here is not looked through again by the garbage collector, so that it is quick."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
