"""A same-different study as a whole: its answers in, the just noticeable difference as published and corrected out.

2004 section 5.1: percentages and 75% crossings for all motions together. Beside it the differencing model, d-prime at
each level, and both per motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from study.analysis import estimates
from study.analysis.headline import NO_TEST, Headline, holds_for
from study.analysis.same_different.counts import (
    Counts,
    PercentDifferent,
    Side,
    Threshold,
    count_answers,
    percent_different,
    same_different_answers,
    sides_in_words,
)
from study.analysis.same_different.d_prime import LevelDPrime, d_prime_table
from study.analysis.same_different.interpolation import crossings
from study.analysis.same_different.mixed import MixedThresholds, fit_mixed_thresholds
from study.analysis.same_different.model import ModelFit, fit_model
from study.analysis.same_different.order import OrderTest, order_test
from study.analysis.same_different.own import OwnThresholds, own_thresholds
from study.analysis.same_different.staircases import Staircases, staircase_thresholds
from study.analysis.study_result import Settings

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class Thresholds:
    """What all motions together and each by itself have."""

    answers: int
    percent_different: tuple[PercentDifferent, ...]
    """The points of Figure 6."""
    published: dict[Side, Threshold]
    """Where linear interpolation between them crosses."""
    model: ModelFit | None
    model_note: str
    """The differencing model of the group's curve, and what to be careful about, or why there is none."""


@dataclass(frozen=True)
class MotionThresholds(Thresholds):
    """A same-different study by one motion."""

    motion: str
    note: str


@dataclass(frozen=True)
class BelievedThresholds:
    """Whose thresholds the headline gives: by their own criterion, free of it, and what the intervals hold for."""

    whose: str
    jnd: dict[Side, Threshold]
    criterion_free: dict[Side, Threshold]
    generalises_to: str

    def in_words(self, level: float, side: Side | None = None) -> str:
        """Return both thresholds in a sentence, and what each means in a second; of one side, or of all."""
        own, free = (
            {one: found for one, found in part.items() if side in (None, one)}
            for part in (self.jnd, self.criterion_free)
        )
        share = f"{100 * level:.0f}%"
        return (
            f"Across {self.generalises_to}, the {self.whose}'s just noticeable difference is {sides_in_words(own)}, "
            f"and {sides_in_words(free)} whatever the criterion. At the first, {share} of the answers are "
            f"“different”, which moves with how readily one says so; at the second, {share} are right by the best "
            "criterion, which sensitivity alone decides."
        )


@dataclass(frozen=True)
class SameDifferent(Thresholds):
    """The result of a same-different study."""

    keys: ClassVar[Mapping[str, str]] = {"jnd": ""}

    participants: int
    missed: int
    level: float
    """Share of "different" at threshold."""
    mixed: MixedThresholds | None
    """The differencing model of participants who differ; its note says what to be careful about, or why there is
    none."""
    mixed_note: str
    d_prime: tuple[LevelDPrime, ...]
    clustering: estimates.Clustering
    """How alike the answers of a participant are, at the pairs with a difference."""
    motions: tuple[MotionThresholds, ...]
    own: tuple[OwnThresholds, ...]
    """What each participant's responses give by themselves."""
    order_test: OrderTest
    answer: str
    """The thresholds in sentences."""
    staircases: Staircases | None = None
    """Thresholds as means of reversals, where trials were chosen by staircases."""

    def sentences(self, alpha: float) -> list[str]:
        """Return the thresholds in words; they rest on no level of significance."""
        del alpha
        return [self.answer]

    @property
    def believed(self) -> BelievedThresholds | None:
        """Return the thresholds that the headline gives."""
        return _believed(self.model, self.mixed, self.participants)

    def headlines(self, study: str, alpha: float, confidence: float) -> list[Headline]:
        """Return the threshold to be believed on each side, with the criterion-free one beside it."""
        del alpha, confidence
        if (found := self.believed) is None:
            return []
        caution = self.mixed.note if self.mixed else self.model_note
        return [
            Headline(
                study=study,
                statement=found.in_words(self.level, side),
                estimate=threshold.frames,
                unit=f"frames {side} than the reference",
                interval=threshold.interval,
                p=None,
                p_adjusted=None,
                test=threshold.method,
                generalises_to=found.generalises_to,
                note="; ".join(filter(None, (threshold.note, caution, NO_TEST))),
            )
            for side, threshold in found.jnd.items()
        ]


def analyse_jnd(
    answers: pd.DataFrame,
    *,
    level: float = 0.75,
    confidence: float = 0.95,
    lapse: float | None = None,
    resamples: int = 1000,
    seed: int = 0,
) -> SameDifferent:
    """Analyse one same-different study.

    Parameters
    ----------
    level
        Share of "different" at threshold.
    lapse
        The lapse rate, held; estimated where it is None, and levels are enough for it.
    confidence, resamples, seed
        Of the intervals, and of the bootstrap behind the standard errors.

    Raises
    ------
    AnalysisError
        When a column is missing or can't be read, or confidence or level is none.
    """
    estimates.check_share(confidence, "confidence")
    estimates.check_share(level, "level")
    rng = np.random.default_rng(seed)
    counts = count_answers(answers)
    model = fit_model(counts, level=level, confidence=confidence, lapse=lapse)
    found = _thresholds(counts, model, level, confidence, resamples, rng)
    by_motion = count_answers(answers, by_motion=True)
    mixed = fit_mixed_thresholds(by_motion, level=level, confidence=confidence, lapse=lapse)
    among = mixed if isinstance(mixed, MixedThresholds) else None
    moved = counts.differences != 0
    given = same_different_answers(answers)
    chosen = answers[answers["task"] == "same-different"] if "task" in answers.columns else answers
    return SameDifferent(
        **vars(found),
        participants=len(counts.participants),
        missed=len(chosen) - len(given),
        level=level,
        mixed=among,
        mixed_note=mixed.note if isinstance(mixed, MixedThresholds) else mixed,
        d_prime=d_prime_table(counts, confidence),
        clustering=estimates.clustering(counts.different[:, moved].sum(axis=1), counts.shown[:, moved].sum(axis=1)),
        motions=_by_motion(given, level, confidence, resamples, rng),
        own=own_thresholds(counts, level, lapse),
        order_test=order_test(given),
        answer=in_words(found, _believed(found.model, among, len(counts.participants)), level),
    )


def _believed(model: ModelFit | None, mixed: MixedThresholds | None, participants: int) -> BelievedThresholds | None:
    """The median observer's thresholds; without a mixed model the group's."""
    if mixed is not None:
        return BelievedThresholds("median observer", mixed.typical, mixed.criterion_free, mixed.generalises_to)
    if model is None:
        return None
    whose = "group" if participants > 1 else "participant"
    return BelievedThresholds(whose, model.jnd, model.corrected, holds_for(participants))


def _thresholds(
    counts: Counts,
    fitted: ModelFit | str,
    level: float,
    confidence: float,
    resamples: int,
    rng: np.random.Generator,
) -> Thresholds:
    return Thresholds(
        answers=int(counts.shown.sum()),
        percent_different=percent_different(counts, confidence),
        published=crossings(counts, level=level, confidence=confidence, resamples=resamples, rng=rng),
        model=fitted if isinstance(fitted, ModelFit) else None,
        model_note=fitted.note if isinstance(fitted, ModelFit) else fitted,
    )


def analyse_same_different(answers: pd.DataFrame, name: str, settings: Settings) -> SameDifferent:
    """Analyse one same-different study by the preregistered settings."""
    found = analyse_jnd(
        answers,
        level=settings.threshold,
        confidence=settings.confidence,
        resamples=settings.resamples,
        seed=settings.seed,
    )
    if name not in settings.tracks:
        return found
    own = staircase_thresholds(answers, settings.tracks[name], settings.confidence)
    return replace(found, staircases=own, answer=f"{own.in_words()} The following rest on all trials. {found.answer}")


def in_words(found: Thresholds, believed: BelievedThresholds | None, level: float) -> str:
    """Return the thresholds in sentences: those to be believed, and as published."""
    share = f"{100 * level:.0f}%"
    published = f"y linear interpolation, as published, {share} are “different” at {sides_in_words(found.published)}."
    if believed is None:
        return f"B{published} No model was fitted: {found.model_note}."
    return f"{believed.in_words(level)} B{published}"


def _by_motion(
    given: pd.DataFrame, level: float, confidence: float, resamples: int, rng: np.random.Generator
) -> tuple[MotionThresholds, ...]:
    if "motion" not in given.columns:
        return ()
    rows = []
    for motion, part in given.groupby(given["motion"].astype(str), sort=False):
        counts = count_answers(part)
        model = fit_model(counts, level=level, confidence=confidence)
        moved = counts.differences != 0
        rows.append(
            MotionThresholds(
                **vars(_thresholds(counts, model, level, confidence, resamples, rng)),
                motion=str(motion),
                note="" if moved.any() and not moved.all() else "pairs with a difference only, or without one",
            )
        )
    return tuple(rows)
