"""Which monitor a window is on."""

from __future__ import annotations

import pytest

from renderer.monitors import Monitor, monitor_of

LEFT = Monitor(0, "left", (600, 340), (0, 0), (1920, 1080), 60.0)
RIGHT = Monitor(1, "right", (600, 340), (1920, 0), (2560, 1440), 144.0)


@pytest.mark.parametrize(
    ("place", "size", "monitor"),
    [
        ((0, 0), (1920, 1080), LEFT),
        ((1920, 0), (2560, 1440), RIGHT),
        ((1500, 100), (800, 600), LEFT),
        ((1600, 100), (800, 600), RIGHT),
        ((-3000, 0), (800, 600), LEFT),  # on none
    ],
)
def test_the_monitor_of_a_window_is_the_one_that_shows_most_of_it(
    place: tuple[int, int], size: tuple[int, int], monitor: Monitor
) -> None:
    assert monitor_of((LEFT, RIGHT), place, size) == monitor
    assert monitor_of((RIGHT, LEFT), place, size) == monitor
