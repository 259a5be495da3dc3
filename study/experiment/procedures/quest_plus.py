"""QUEST+: each trial asks the difference whose answer is expected to tell most of the threshold (Watson 2017)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Gt, Le

from study.counting import counted
from study.experiment.procedures.interleaved import Interleaving
from study.models.quest_plus import QuestRule
from study.settings import SettingsError, required, setting


@dataclass(frozen=True)
class Quest(Interleaving):
    """The keys of `[studies.procedure]` with `name = "quest-plus"`."""

    name: ClassVar[str] = "quest-plus"
    title: ClassVar[str] = "QUEST+"
    sources: ClassVar[tuple[str, ...]] = (
        "Watson, A. B. (2017). QUEST+: A general multidimensional Bayesian adaptive psychometric method. Journal of "
        "Vision, 17(3):10, 1–27.",
    )

    most_frames: Annotated[int, Ge(1), Le(400)] = required("Largest difference that is shown. [frames]")
    least_frames: Annotated[int, Ge(1), Le(400)] = setting(1, "Smallest difference that is shown. [frames]")
    step_frames: Annotated[int, Ge(1), Le(400)] = setting(
        1, "From one difference that may be shown to the next; every one is a stimulus to render. [frames]"
    )
    threshold_frames: Annotated[float, Gt(0), Le(400)] = setting(
        8.0,
        "Prior of the threshold: its median. In same-different and yes-no studies the threshold is "
        "criterion-free. [frames]",
    )
    threshold_spread: Annotated[float, Ge(0.1), Le(3)] = setting(
        0.8, "Prior of the threshold: standard deviation of its natural logarithm; 0.7 is a factor of two."
    )
    criterion: Annotated[float, Gt(0), Le(10)] = setting(
        2.0,
        "Prior of a same-different criterion: its mean, in standard deviations of one percept. In yes-no studies half "
        "of it: with 2, 16% false alarms in both tasks.",
    )
    criterion_spread: Annotated[float, Ge(0.05), Le(5)] = setting(
        1.0, "Prior of a same-different criterion: its standard deviation; in yes-no studies half of it."
    )
    slope_spread: Annotated[float, Ge(0), Le(2)] = setting(
        0.45,
        "Prior of the power of the difference with which d' grows in oddity and 2AFC: its median is 1, this the "
        "standard deviation of its natural logarithm; 0 for exactly 1.",
    )
    most_lapses: Annotated[float, Ge(0.001), Le(0.5)] = setting(
        0.1, "Prior of the lapse rate: falls in a straight line from 0 to nothing just beyond this value."
    )
    side: Literal["both", "shared", "shorter", "longer"] = setting(
        "both", "Which blends are compared with the reference; `shared`: both, with one threshold and one track."
    )
    narrow: Annotated[float, Ge(1), Le(100)] = setting(
        1.0,
        "A track stops once the upper end of its threshold's 95% interval is at most so many times the lower; 1 for "
        "never.",
    )
    least_trials: Annotated[int, Ge(1), Le(1000)] = setting(12, "Trials before which no track stops. [trials]")
    most_trials: Annotated[int, Ge(2), Le(1000)] = setting(40, "Trials after which a track stops. [trials]")
    then_constant: tuple[Annotated[float, Gt(0), Le(10)], ...] = setting(
        (), "Constant stimuli that a track shows once QUEST+ has stopped, at so many times the threshold found."
    )
    then_repeats: Annotated[int, Ge(1), Le(100)] = setting(8, "How often a track shows each of these.")
    catch_every: Annotated[int, Ge(0), Le(1000)] = setting(
        3, "One trial in this number shows no difference; 0 for none. [trials]"
    )

    def __post_init__(self) -> None:
        if self.least_frames > self.most_frames:
            raise SettingsError(
                "least_frames", f"expected at most most_frames, {self.most_frames}, found {self.least_frames}; lower it"
            )
        if self.least_trials > self.most_trials:
            raise SettingsError(
                "least_trials", f"expected at most most_trials, {self.most_trials}, found {self.least_trials}; lower it"
            )
        if self.catch_every == 1:
            raise SettingsError(
                "catch_every", "expected 0 or 2 and more, found 1, which leaves no other trial; raise it"
            )

    def levels(self) -> tuple[int, ...]:
        """All differences, the largest among them."""
        stepped = range(self.least_frames, self.most_frames, self.step_frames)
        return (*stepped, self.most_frames)

    def fewest(self) -> int:
        """The trials of a track that soon knows enough, constant stimuli among them."""
        return (self.least_trials if self.narrow > 1 else self.most_trials) + self._constant

    @property
    def _constant(self) -> int:
        """How many constant stimuli a track shows."""
        return len(self.then_constant) * self.then_repeats

    def rule_of(self, task: str) -> QuestRule:
        """The rule of its tracks."""
        return QuestRule(
            task,
            self.levels(),
            self.threshold_frames,
            self.threshold_spread,
            self.criterion,
            self.criterion_spread,
            self.most_lapses,
            self.slope_spread,
            self.least_trials,
            self.most_trials + self._constant,
            self.narrow,
            self.side == "shared",
            self.then_constant,
            self.then_repeats,
        )

    def in_words(self) -> str:
        """What is varied, the priors, and when a track stops."""
        stops = f"after {counted(self.most_trials, 'trial')}"
        if self.narrow > 1:
            stops = f"once the 95% interval of its threshold was narrower than a factor of {self.narrow:g}, or {stops}"
        then = ""
        if self.then_constant:
            times = ", ".join(f"{times:g}" for times in self.then_constant)
            then = (
                "; constant stimuli followed in random order, "
                f"{self.then_repeats} at each of {times} times the threshold that the track had found"
            )
        return (
            f"QUEST+ with {self.range_in_words()}, a log-normal prior of the threshold (median "
            f"{self.threshold_frames:g} frames, standard deviation {self.threshold_spread:g} in natural logarithms), "
            f"and as nuisance parameters the lapse rate (up to {100 * self.most_lapses:g}%, smaller ones likelier) and "
            f"the criterion (same-different; normal prior, {self.criterion:g} ± {self.criterion_spread:g}, half of "
            f"both in yes-no) or the slope "
            f"(oddity, 2AFC; log-normal prior, median 1, {self.slope_spread:g}); each track stopped {stops}{then}"
        )
