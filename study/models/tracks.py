"""Tracks: sequences of trials whose level is chosen by the answers before. A rule says how they go on, when they stop,
and which threshold they have found; procedures, simulations and analyses all follow it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar


@dataclass(frozen=True)
class Found:
    """The threshold that a track has found, in frames."""

    frames: float
    spread: float | None = None
    """How far it is off: standard deviation of the averaged reversals, or of the posterior."""
    low: float | None = None
    high: float | None = None
    """`low`, `high`: ends of its own interval, where the rule gives one."""


class Rule(ABC):
    """How tracks go on. A track is a value that is never changed; levels are whole numbers, harder downwards."""

    title: ClassVar[str]
    """What a track is called: "staircase"."""
    trials: int
    """A track stops after so many trials in any case."""
    shared: bool
    """Whether a track asks about shorter and longer blends in turn, whose threshold is one."""

    @property
    @abstractmethod
    def target(self) -> float:
        """The share of right answers at the threshold that its tracks look for."""

    def meaning(self, right: str) -> str:
        """What holds at that threshold, as a clause; `right` is what right responses are called."""
        return f"{100 * self.target:.1f}% of the responses are {right}"

    @property
    @abstractmethod
    def estimate(self) -> str:
        """How a track's threshold is found: "mean of the last 6 reversals"."""

    @abstractmethod
    def begin(self) -> Any:
        """A track before its first trial."""

    @abstractmethod
    def due(self, track: Any) -> int:
        """The level of its next trial."""

    @abstractmethod
    def after(self, track: Any, level: int, right: bool | None) -> Any:
        """The track after a trial at this level, which was answered right or wrong, or not at all (None)."""

    def beside(self, track: Any, right: bool) -> Any:
        """The track after a trial that showed no difference and was answered right or wrong."""
        del right
        return track

    @abstractmethod
    def over(self, track: Any) -> bool:
        """Whether it has stopped."""

    @abstractmethod
    def asked(self, track: Any) -> int:
        """How many trials it has had, those without an answer among them."""

    @abstractmethod
    def found(self, track: Any) -> Found | None:
        """The threshold, in units of the level; None where the track is too short for one."""

    def posterior(self, track: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Thresholds in frames, and the probability of each; none without a posterior."""
        del track
        return (), ()

    def turns(self, track: Any) -> int:
        """How often its direction has changed, where that means anything."""
        del track
        return 0
