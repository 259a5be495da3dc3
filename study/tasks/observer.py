"""The simulated observer: one set of parameters for all tasks, and one person who deviates from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from study.errors import SessionError
from study.models.choice import PreferenceObserver
from study.models.ordinal import RatingObserver
from study.models.population import SameDifferentObserver, crossing, visibility
from study.transitions.methods.registry import METHODS

UTILITIES: Mapping[str, float] = {method.name: method.utility for method in METHODS.values()}
"""Of the built-in methods; they give 2004 Table 2."""


@dataclass(frozen=True)
class ObserverSettings:
    """All that a simulated participant is: how they judge, how fast, and how often they miss an answer.

    Response times are log-normal: median and standard deviation of the logarithm; those beyond the answer window are
    missed, besides a proportion `missed` of inattention. Of all presentations a proportion `badly_shown` stalls, so
    that the trial comes again, and a proportion `careless` of the participants looks at nothing: they answer at random
    and fast, attention checks too. `observers.truth` is of those who look.
    """

    same_different: SameDifferentObserver
    preference: PreferenceObserver = field(default_factory=lambda: PreferenceObserver(dict(UTILITIES)))
    rating: RatingObserver = field(default_factory=RatingObserver)
    response_median_s: float = 1.2
    response_log_sd: float = 0.35
    missed: float = 0.005
    badly_shown: float = 0.0
    careless: float = 0.0

    def __post_init__(self) -> None:
        for name in ("missed", "badly_shown", "careless"):
            share = getattr(self, name)
            if not 0.0 <= share <= 1.0:
                raise SessionError(f"Expected {name} as a share from 0 to 1, found {share:g}; change it.")


@dataclass(frozen=True)
class Person:
    """One simulated participant: the settings with this person's deviations, and where their chance comes from."""

    name: str
    seed: int
    settings: ObserverSettings
    lean: float
    leniency: float
    careless: bool = False
    apart: Mapping[str, int] = field(default_factory=dict)
    """Frames by which the second blend of a pair is longer, by the pair's name, where they differ in nothing else."""

    def sees(self, pair: str) -> float:
        """How visible the difference of a pair is, 0 to 1; 1 where it is not one of lengths alone."""
        return visibility(self.settings.same_different, self.apart[pair]) if pair in self.apart else 1.0


def default_observer(shorter_frames: float = 8.0, longer_frames: float = 7.0) -> ObserverSettings:
    """The observer of 2004 section 5.1: over participants, 75% "different" at 8 frames shorter and 7 longer."""
    unit = SameDifferentObserver(1.0, 1.0)
    # Thresholds scale with 1 / d': the crossing of an observer with a d' of 1 a frame gives the others. Rounded, so
    # that a database is taken up again under another version of scipy.
    reached = crossing(unit, 0.75, unit.d_prime_longer)
    shorter, longer = round(reached / shorter_frames, 9), round(reached / longer_frames, 9)
    return ObserverSettings(replace(unit, d_prime_shorter=shorter, d_prime_longer=longer))
