"""The window as the player needs it, so that tests can bring another."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from renderer.events import Event
from renderer.pacing import Pacing

RGB = tuple[int, int, int]


class Display(Protocol):
    """What the player needs of a window: `renderer.window.Window`, or a scripted one."""

    pacing: Pacing

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""

    @property
    def focused(self) -> bool:
        """Whether keys come here."""

    @property
    def monitor(self) -> Hashable:
        """What shows it; another value on another monitor."""

    def settle(self, colour: RGB) -> bool:
        """Find the pacing anew where the window has come to another monitor; whether it had."""

    def describe(self) -> dict[str, Any]:
        """For the record."""

    def now(self) -> float:
        """The time, seconds."""

    def next_flip_s(self) -> float:
        """When a flip that is asked for now will be presented."""

    def flip(self) -> float:
        """Present what was drawn; returns when that was."""

    def picture(self, rgb: NDArray[np.uint8]) -> Any:
        """Load a picture; it has a `release`."""

    def drawing(self, positions: Any, figure: Any, camera: Any, fps: float, *, height: float) -> Any:
        """Prepare a motion, in a picture of that height in pixels; it has `frames` and `place`."""

    def clear(self, colour: RGB) -> None:
        """One colour."""

    def paint(self, picture: Any, background: RGB) -> None:
        """Draw a picture."""

    def paint_frame(self, drawing: Any, frame: int) -> None:
        """Draw a frame of a motion."""

    def poll(self) -> tuple[Event, ...]:
        """What happened."""

    def wait(self, timeout_s: float | None = None) -> tuple[Event, ...]:
        """Sleep until something happens."""

    def cursor(self, visible: bool) -> None:
        """Show or hide the pointer."""
