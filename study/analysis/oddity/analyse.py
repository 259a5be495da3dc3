"""Forced choices, oddity and 2AFC: answers in; right answers, d' and thresholds out.

For each difference in blend length the share of right answers, one number a participant, and the d' at which an
observer is right as often (`models.forced`). For each side a psychometric function that begins at chance; its threshold
lies half of the way from there to never wrong, at 67% right of three and 75% of two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

from study.analysis import estimates
from study.analysis.headline import Headline
from study.analysis.psychometric.analyse import BelievedThreshold, PsychometricStudy, analyse_psychometric
from study.analysis.psychometric.model import make_model
from study.analysis.same_different.counts import SIDES, SIGNS, Side
from study.analysis.same_different.staircases import Staircases, staircase_thresholds
from study.analysis.study_result import Settings
from study.models.forced import FORCED, Forced

if TYPE_CHECKING:
    import pandas as pd


NEEDED_COLUMNS = ("participant", "difference_frames", "correct", "answer")


@dataclass(frozen=True)
class OddityLevel:
    """Answers at one difference in blend length."""

    difference_frames: int
    """Comparison minus reference."""
    participants: int
    answers: int
    """`participants`, `answers`: who gave any, and how many."""
    percent: float
    low: float | None
    high: float | None
    """`percent`, `low`, `high`: right answers: mean over participants, with Student's interval, cut at 0 and 100%."""
    p_value: float | None
    """That participants are right as often as by chance."""
    d_prime: float | None
    """Of an observer who is right as often; None where that is always."""


@dataclass(frozen=True)
class ForcedChoice:
    """The result of a study of forced choices."""

    keys: ClassVar[Mapping[str, str]]
    forced: ClassVar[Forced]
    found: ClassVar[str]
    """What was to be found."""

    levels: tuple[OddityLevel, ...]
    """By difference, rising."""
    functions: Mapping[Side, PsychometricStudy]
    """The psychometric function of each side, over the size of the difference."""
    staircases: Staircases | None = None
    """Thresholds as means of reversals, where trials were chosen by staircases."""

    @property
    def thresholds(self) -> dict[Side, BelievedThreshold]:
        """Return the threshold to be believed of each side."""
        return {side: found.believed for side, found in self.functions.items()}

    def headlines(self, study: str, alpha: float, confidence: float) -> list[Headline]:
        """Return the threshold of each side, by the estimate to be believed."""
        found = []
        for side, function in self.functions.items():
            (own,) = function.headlines(study, alpha, confidence)
            said = f"Blends that are {side}: {own.statement}"
            found.append(replace(own, statement=said, unit=f"frames {side} than the reference"))
        return found

    def sentences(self, alpha: float) -> list[str]:
        """Return how well the odd one was found, and the thresholds, in words."""
        del alpha
        if not self.levels:
            return ["No answers were given."]
        best = max(self.levels, key=lambda level: level.percent)
        told = [
            f"{self.found.capitalize()} was found in {best.percent:.0f}% of the trials at "
            f"{best.difference_frames:+d} frames, where chance gives {100 * self.forced.chance:.0f}%."
        ]
        told += [self.staircases.in_words()] if self.staircases else []
        return [*told, *(f"Blends that are {side}: {found.answer}" for side, found in self.functions.items())]


@dataclass(frozen=True)
class Oddity(ForcedChoice):
    """The result of an oddity study."""

    keys: ClassVar[Mapping[str, str]] = {"oddity": ""}
    forced: ClassVar[Forced] = FORCED["oddity"]
    found: ClassVar[str] = "the odd one of three"


@dataclass(frozen=True)
class TwoAlternatives(ForcedChoice):
    """The result of a 2AFC study."""

    keys: ClassVar[Mapping[str, str]] = {"two_alternatives": ""}
    forced: ClassVar[Forced] = FORCED["2afc"]
    found: ClassVar[str] = "the longer one of two"


def analyse_forced(kind: type[ForcedChoice], answers: pd.DataFrame, name: str, settings: Settings) -> ForcedChoice:
    """Analyse one study of forced choices; `kind` is the class of its result.

    Parameters
    ----------
    answers
        Columns `participant`, `difference_frames`, `correct`, `answer`; trials without a response have no `answer`.
    name
        Of the study.
    settings
        The level of confidence counts, and the rule of the study's staircases.

    Raises
    ------
    AnalysisError
        When a column is missing.
    """
    estimates.check_columns(answers, NEEDED_COLUMNS, "an analysis of right answers")
    given = answers[answers["answer"].notna() & answers["correct"].notna() & answers["difference_frames"].notna()]
    estimates.check_participants(given)
    trials = given.assign(
        participant=given["participant"].astype(str),
        level=given["difference_frames"].abs().astype(float),
        yes=given["correct"].astype(float),
        shown=1.0,
    )
    model = make_model("2afc", choices=kind.forced.choices)
    functions: dict[Side, PsychometricStudy] = {}
    for side in SIDES:
        own = trials[trials["difference_frames"].astype(float) * SIGNS[side] > 0]
        if len(own):
            functions[side] = analyse_psychometric(own, model, confidence=settings.confidence)
    rule = settings.tracks.get(name)
    staircases = None if rule is None else staircase_thresholds(answers, rule, settings.confidence, "right")
    return kind(tuple(_levels(kind.forced, trials, settings.confidence)), functions, staircases)


def _levels(forced: Forced, trials: pd.DataFrame, confidence: float) -> list[OddityLevel]:
    found = []
    for difference, part in trials.groupby(trials["difference_frames"].astype(int), sort=True):
        test = estimates.mean_test(part.groupby("participant")["yes"].mean().to_numpy(), forced.chance, confidence)
        share = test.mean or 0.0
        ends = (test.low, test.high)
        low, high = (None if end is None else 100 * min(max(end, 0.0), 1.0) for end in ends)
        counts = int(difference), test.participants, len(part)
        found.append(OddityLevel(*counts, 100 * share, low, high, test.p_value, forced.d_prime_of(share)))
    return found
