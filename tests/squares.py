"""Jobs that other processes can import: numbers that are squared, and workers that are killed at it."""

from __future__ import annotations

import os
import signal
from pathlib import Path

from renderer.errors import RendererError


def square(number: int) -> int:
    """Refuses 13."""
    if number == 13:
        raise RendererError("13 is not squared")
    return number * number


def die_once(mark: Path, number: int) -> int:
    """The first process to come to 2 is killed, as one that takes too much memory."""
    if number == 2 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def die(number: int) -> int:
    """Every process that comes to 2 is killed."""
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return number
