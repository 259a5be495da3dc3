"""The X server's milliseconds as times of this process, as plain arithmetic; `test_window` asks a real server."""

from __future__ import annotations

import pytest

from renderer.server_times import agrees, pressed_at

AROUND = 2**32


@pytest.mark.parametrize(
    ("arrived_s", "server_ms", "pressed_s"),
    [
        (5.0003, 5000, 5.0003),  # within the server's millisecond: arrival is nearer
        (5.0000, 5000, 5.0000),
        (5.0031, 5000, 5.0010),  # 3 ms late: the end of that millisecond
        (5.2000, 5000, 5.0010),
        (4.9998, 5000, 4.9998),  # the server's rounding
        ((AROUND + 250) / 1000, 50, (AROUND + 51) / 1000),  # its count began anew
        ((AROUND + 3) / 1000, AROUND - 7, (AROUND - 6) / 1000),
    ],
)
def test_a_late_event_gets_the_end_of_the_servers_millisecond(
    arrived_s: float, server_ms: int, pressed_s: float
) -> None:
    assert pressed_at(arrived_s, server_ms) == pytest.approx(pressed_s, abs=1e-6)


def test_no_error_is_larger_than_a_millisecond() -> None:
    for true_ms in (7000.0, 7000.4, 7000.999):
        for late_ms in (0.0, 0.3, 0.8, 5.0, 4000.0):
            error_ms = pressed_at((true_ms + late_ms) / 1000, int(true_ms)) * 1000 - true_ms
            assert -1e-6 <= error_ms <= 1.0 + 1e-6


@pytest.mark.parametrize(
    ("before_s", "server_ms", "after_s", "same"),
    [
        (5.0002, 5000, 5.0004, True),
        (5.0009, 5001, 5.0012, True),
        (5.0002, 5010, 5.0004, False),
        (5.0002, 4990, 5.0004, False),
        ((AROUND + 0.4) / 1000, 0, (AROUND + 0.6) / 1000, True),
        (5.0, 987_654_321, 5.2, False),  # another machine, started on another day
    ],
)
def test_another_clock_is_found_out(before_s: float, server_ms: int, after_s: float, same: bool) -> None:
    assert agrees(before_s, server_ms, after_s) is same
