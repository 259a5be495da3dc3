"""Staircases: the difference of a trial depends on the answers before it (Levitt 1971; Kaernbach 1991).

Trials that show no difference tell how often "different" is answered where nothing differs, and move no staircase.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le

from study.experiment.procedures.interleaved import Interleaving
from study.models.up_down import UpDown, fewest_trials, reachable
from study.settings import SettingsError, required, setting


@dataclass(frozen=True)
class Staircase(Interleaving):
    """The keys of `[studies.procedure]` with `name = "staircase"`."""

    name: ClassVar[str] = "staircase"
    title: ClassVar[str] = "adaptive staircases"
    sources: ClassVar[tuple[str, ...]] = (
        "Levitt, H. (1971). Transformed up-down methods in psychoacoustics. Journal of the Acoustical Society of "
        "America, 49, 467–477.",
        "Kaernbach, C. (1991). Simple adaptive testing with the weighted up-down method. Perception & Psychophysics, "
        "49, 227–229.",
    )

    start_frames: Annotated[int, Ge(1), Le(400)] = required("Difference of the first trial. [frames]")
    most_frames: Annotated[int, Ge(1), Le(400)] = required("Largest difference that is shown. [frames]")
    least_frames: Annotated[int, Ge(1), Le(400)] = setting(1, "Smallest difference that is shown. [frames]")
    steps_frames: tuple[Annotated[int, Ge(1), Le(400)], ...] = setting(
        (4, 2, 1),
        "Sizes of the steps down: the first until the first reversal, the second until the second, and so on; the last "
        "one stays. [frames]",
    )
    down: Annotated[int, Ge(1), Le(10)] = setting(
        2, "Right responses in a row after which the difference becomes smaller."
    )
    up: Annotated[int, Ge(1), Le(10)] = setting(1, "Wrong responses in a row after which it becomes larger.")
    up_times: Annotated[int, Ge(1), Le(20)] = setting(
        1, "How many times as large as steps down the steps up are; with `down = 1`, 3 aims at 75% and 4 at 80%."
    )
    side: Literal["both", "shared", "shorter", "longer"] = setting(
        "both", "Which blends are compared with the reference; `shared`: both, with one threshold and one track."
    )
    reversals: Annotated[int, Ge(2), Le(100)] = setting(8, "Number of reversals after which a staircase stops.")
    averaged: Annotated[int, Ge(1), Le(100)] = setting(6, "Number of last reversals whose mean is the threshold.")
    most_trials: Annotated[int, Ge(2), Le(1000)] = setting(
        50, "Trials after which a staircase stops in any case. [trials]"
    )
    catch_every: Annotated[int, Ge(0), Le(1000)] = setting(
        5, "One trial in this number shows no difference; 0 for none. [trials]"
    )

    def __post_init__(self) -> None:
        if not self.least_frames <= self.start_frames <= self.most_frames:
            raise SettingsError(
                "start_frames",
                f"expected from least_frames to most_frames, {self.least_frames} to {self.most_frames}, found "
                f"{self.start_frames}; change one",
            )
        if not self.steps_frames:
            raise SettingsError("steps_frames", "expected one step or more, found none; add one")
        if self.averaged > self.reversals:
            raise SettingsError(
                "averaged", f"expected at most the {self.reversals} reversals, found {self.averaged}; lower it"
            )
        if self.catch_every == 1:
            raise SettingsError(
                "catch_every", "expected 0 or 2 and more, found 1, which leaves no other trial; raise it"
            )

    def rule_of(self, task: str = "") -> UpDown:
        """The rule by which each staircase moves, whatever the task."""
        del task
        return UpDown(
            self.start_frames,
            self.steps_frames,
            self.least_frames,
            self.most_frames,
            self.down,
            self.up,
            self.up_times,
            self.reversals,
            self.most_trials,
            self.averaged,
            self.side == "shared",
        )

    def levels(self) -> tuple[int, ...]:
        """All levels that the rule can come to."""
        return reachable(self.rule_of())

    def fewest(self) -> int:
        """The trials of a staircase that reaches its reversals as soon as it can."""
        return fewest_trials(self.rule_of())

    def in_words(self) -> str:
        """The rule, its target, and the differences that may come."""
        weights = f" with steps up {self.up_times} times as large as steps down" if self.up_times > 1 else ""
        return (
            f"{self.up}-up/{self.down}-down staircases{weights}, which aim at {100 * self.rule_of().target:.1f}% right "
            f"responses, with {self.range_in_words()}"
        )
