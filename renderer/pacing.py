"""Pacing: what the flips of a window follow, found from trial swaps. Pure arithmetic on times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

OWN_CLOCK_HZ = 60.0
"""The rate of the own frame clock where the display names none."""


@dataclass(frozen=True)
class Pacing:
    """What flips follow.

    Parameters
    ----------
    refresh_hz
        Flips per second.
    reported_hz
        What the display says of itself; 0 where it says nothing.
    swap_s
        The median time between swaps when the window was opened, seconds.
    own_clock
        Whether flips follow the own frame clock, since swaps wait for nothing.
    """

    refresh_hz: float
    reported_hz: float
    swap_s: float
    own_clock: bool

    @property
    def measured(self) -> bool:
        """Whether the times of flips are those of the display."""
        return not self.own_clock

    @property
    def period_s(self) -> float:
        """Seconds from one flip to the next."""
        return 1.0 / self.refresh_hz


def find_pacing(swap_intervals_s: NDArray[np.float64], reported_hz: float) -> Pacing:
    """What to pace flips by, from trial swaps and the refresh rate that the display reports.

    The reported rate is a whole number (59 for 59.94), so the measured one is taken where both agree within a tenth.
    Swaps that come faster wait for nothing; slower ones do wait, and the machine only misses some at the start.
    """
    swap_s = float(np.median(swap_intervals_s))
    if reported_hz <= 0:
        return Pacing(OWN_CLOCK_HZ, 0.0, swap_s, own_clock=True)
    if swap_s < 0.9 / reported_hz:
        return Pacing(reported_hz, reported_hz, swap_s, own_clock=True)
    agrees = swap_s < 1.1 / reported_hz
    return Pacing(1.0 / swap_s if agrees else reported_hz, reported_hz, swap_s, own_clock=False)


def next_flip(last_flip_s: float, period_s: float, now_s: float) -> float:
    """When the next flip can be, if it is asked for now: the first whole number of periods after the last one.

    Half a millisecond is left for the swap itself.
    """
    periods = max(1.0, np.ceil((now_s + 0.0005 - last_flip_s) / period_s))
    return float(last_flip_s + periods * period_s)
