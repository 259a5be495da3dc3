"""Monitors: which there are, and which one a window is on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from renderer.events import Size


@dataclass(frozen=True)
class Monitor:
    """A monitor in its present mode.

    Parameters
    ----------
    number
        Counted from 0, the primary one.
    name
        As the system calls it.
    millimetres
        Its size; 0 where it is not known.
    place
        Its left top corner on the desktop, in the desktop's units.
    size
        In those units too; pixels, where they are the same.
    reported_hz
        Its refresh rate as it says itself, a whole number; 0 where it says nothing.
    """

    number: int
    name: str
    millimetres: Size
    place: tuple[int, int]
    size: Size
    reported_hz: float

    def describe(self) -> dict[str, Any]:
        """For the record of a session."""
        return {
            "display": self.name,
            "display_number": self.number,
            "display_mm": list(self.millimetres),
            "display_pixels": list(self.size),
        }


def find_monitors(glfw: Any) -> tuple[Monitor, ...]:
    """All monitors that are connected."""
    found = []
    for number, handle in enumerate(glfw.get_monitors()):
        mode, name = glfw.get_video_mode(handle), glfw.get_monitor_name(handle)
        found.append(
            Monitor(
                number,
                name.decode(errors="replace") if isinstance(name, bytes) else name or "",
                tuple(glfw.get_monitor_physical_size(handle)),
                tuple(glfw.get_monitor_pos(handle)),
                (mode.size.width, mode.size.height),
                float(mode.refresh_rate),
            )
        )
    return tuple(found)


def monitor_of(monitors: Sequence[Monitor], place: tuple[int, int], size: Size) -> Monitor:
    """The monitor that shows the largest part of a window; the first one, where none shows any."""

    def shared(monitor: Monitor) -> int:
        sides = (
            min(monitor.place[i] + monitor.size[i], place[i] + size[i]) - max(monitor.place[i], place[i])
            for i in (0, 1)
        )
        wide, high = (max(0, side) for side in sides)
        return wide * high

    return max(monitors, key=lambda monitor: (shared(monitor), -monitor.number))
