"""A same-different study as a whole: its answers in, the just noticeable difference as published and corrected out.

2004 section 5.1: percentages and 75% crossings for all motions together, and the statement that performance did not
differ across motions. Beside it the differencing model, d-prime at each level, and both per motion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from study.analysis import estimates
from study.analysis.headline import NO_TEST, Headline, holds_for
from study.analysis.same_different.counts import (
    PRINTED,
    Counts,
    PercentDifferent,
    Side,
    Threshold,
    count_answers,
    percent_different,
    same_different_answers,
)
from study.analysis.same_different.d_prime import LevelDPrime, d_prime_table
from study.analysis.same_different.interpolation import crossings
from study.analysis.same_different.mixed import MixedThresholds, fit_mixed_thresholds
from study.analysis.same_different.model import ModelFit, fit_model
from study.analysis.same_different.motions import AcrossMotions, across_motions
from study.analysis.same_different.order import OrderTest, order_test
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
    across_motions: AcrossMotions
    order_test: OrderTest
    answer: str
    """The thresholds in sentences."""
    staircases: Staircases | None = None
    """Thresholds as means of reversals, where trials were chosen by staircases."""

    def sentences(self, alpha: float) -> list[str]:
        """Return the thresholds in words; they rest on no level of significance."""
        del alpha
        return [self.answer]

    def headlines(self, study: str, alpha: float, confidence: float) -> list[Headline]:
        """Return the threshold of the median observer on each side; that of the group where it can't be fitted."""
        del alpha, confidence
        found, whose = (self.mixed.typical, "median observer") if self.mixed else ({}, "")
        if not found and self.model is not None:
            found, whose = self.model.jnd, "group" if self.participants > 1 else "participant"
        return [
            Headline(
                study=study,
                statement=f"The {whose}'s just noticeable difference is {_sides_in_words({side: threshold})}.",
                estimate=threshold.frames,
                unit=f"frames {side} than the reference",
                interval=threshold.interval,
                p=None,
                p_adjusted=None,
                test=threshold.method,
                generalises_to=holds_for(self.participants),
                note="; ".join(filter(None, (threshold.note, NO_TEST))),
            )
            for side, threshold in found.items()
        ]


def analyse_jnd(
    answers: pd.DataFrame, *, level: float = 0.75, confidence: float = 0.95, resamples: int = 1000, seed: int = 0
) -> SameDifferent:
    """Analyse one same-different study.

    Parameters
    ----------
    level
        Share of "different" at threshold.
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
    found = _thresholds(counts, level, confidence, resamples, rng)
    mixed = fit_mixed_thresholds(counts, level=level, confidence=confidence)
    moved = counts.differences != 0
    given = same_different_answers(answers)
    chosen = answers[answers["task"] == "same-different"] if "task" in answers.columns else answers
    return SameDifferent(
        **vars(found),
        participants=len(counts.participants),
        missed=len(chosen) - len(given),
        level=level,
        mixed=mixed if isinstance(mixed, MixedThresholds) else None,
        mixed_note=mixed.note if isinstance(mixed, MixedThresholds) else mixed,
        d_prime=d_prime_table(counts, confidence),
        clustering=estimates.clustering(counts.different[:, moved].sum(axis=1), counts.shown[:, moved].sum(axis=1)),
        motions=_by_motion(given, level, confidence, resamples, rng),
        across_motions=across_motions(given),
        order_test=order_test(given),
        answer=in_words(found, mixed, level),
    )


def _thresholds(
    counts: Counts, level: float, confidence: float, resamples: int, rng: np.random.Generator
) -> Thresholds:
    fitted = fit_model(counts, level=level, confidence=confidence)
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


def in_words(found: Thresholds, mixed: MixedThresholds | str, level: float) -> str:
    """Return the thresholds in sentences: as published, corrected, and those of the median observer."""
    first = f"By linear interpolation, as published, {100 * level:.0f}% of the answers are “different” at "
    first += _sides_in_words(found.published)
    if found.model is None:
        return f"{first}. No model was fitted: {found.model_note}."
    jnd = _sides_in_words(found.model.jnd)
    text = f"{first}. By the differencing model the just noticeable difference is {jnd}."
    if isinstance(mixed, str):
        return text
    return f"{text} This is the group's; the median observer's is {_sides_in_words(mixed.typical)}."


def _sides_in_words(thresholds: Mapping[Side, Threshold]) -> str:
    parts = []
    for side, sign in PRINTED.items():
        found = thresholds.get(side)
        if found is None:
            continue
        if found.frames is None:
            parts.append(f"nothing where the blend is {side} ({found.note})")
            continue
        error = f" ± {found.standard_error:.1f}" if found.standard_error is not None else ""
        parts.append(f"k {sign} {found.frames:.1f}{error} frames")
    return " and ".join(parts)


def _by_motion(
    given: pd.DataFrame, level: float, confidence: float, resamples: int, rng: np.random.Generator
) -> tuple[MotionThresholds, ...]:
    if "motion" not in given.columns:
        return ()
    rows = []
    for motion, part in given.groupby(given["motion"].astype(str), sort=False):
        counts = count_answers(part)
        moved = counts.differences != 0
        rows.append(
            MotionThresholds(
                **vars(_thresholds(counts, level, confidence, resamples, rng)),
                motion=str(motion),
                note="" if moved.any() and not moved.all() else "pairs with a difference only, or without one",
            )
        )
    return tuple(rows)
