"""The effect of a rating study: points by which one method is rated higher, by participants who differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np

from study.analysis.analyse import Analysis
from study.analysis.crossed import general_p_values
from study.analysis.estimates import student_p_values
from study.analysis.ratings.analyse import PairRatings, Ratings
from study.arrays import BoolArray, FloatArray
from study.experiment.protocol.studies import AnalysisSettings
from study.experiment.protocol.whole import StudySpec
from study.models.choice import PreferenceObserver
from study.models.ordinal import RatingObserver, stretch
from study.power.curve import Run
from study.power.design import Design, Effect, kept_of, motions_of, times
from study.tasks.observer import ObserverSettings, default_observer
from study.tasks.registry import task_of


def rating_effect(study: StudySpec, options: Mapping[str, float], decided: AnalysisSettings) -> Effect:
    """Return a difference in points between the methods, and the correlation of a participant's ratings."""
    difference, correlation, alpha = options["difference"], options["correlation"], decided.alpha
    paired = task_of(study).slots > 1
    found = pair_rating_found if paired else rating_found
    return Effect(
        observer=rating_observer(study, difference, correlation, options["missed"]),
        stated={"difference": difference, "correlation": correlation},
        icc=correlation,
        test=f"Student's t of {'scores' if paired else 'differences'} (the default test) at {alpha:g}, one question",
        aim=f"find a difference of {difference:g} points in one question at the level {alpha:g}",
        study=lambda design: rating_study(design, alpha, difference),
        found=lambda analysis: found(analysis, study, difference, alpha),
    )


def rating_found(analysis: Analysis, study: StudySpec, difference: float, alpha: float) -> bool:
    """Return whether the test of the first question found the difference, in the right direction."""
    result = analysis.of(Ratings).get(study.name)
    both = {f"{one} minus {other}" for one, other in permutations((study.reference, study.comparison))}
    found = result.questions[0].differences if result and result.questions else ()
    test = next((one for one in found if one.of in both), None)
    if test is None or test.p_value is None or test.mean is None:
        return False
    # Differences are of the later method by name from the earlier; the effect is of the comparison.
    sign = 1 if test.of.startswith(f"{study.comparison} minus") else -1
    return test.p_value < alpha and (difference == 0 or (sign * test.mean > 0) == (difference > 0))


def pair_rating_found(analysis: Analysis, study: StudySpec, difference: float, alpha: float) -> bool:
    """Return whether the test of the first question against the middle of the scale found the difference."""
    result = analysis.of(PairRatings).get(study.name)
    test = result.questions[0].participants if result and result.questions else None
    if test is None or test.p_value is None or test.t is None:
        return False
    return test.p_value < alpha and (difference == 0 or (test.t > 0) == (difference > 0))


def rating_observer(study: StudySpec, difference: float, correlation: float, missed: float) -> ObserverSettings:
    """An observer who rates the comparison higher by `difference` points before they are rounded to the scale."""
    typical = RatingObserver()
    spread = typical.noise_sd * np.sqrt(correlation / (1 - correlation))
    utility: dict[str, float] = {
        study.comparison or "": difference / typical.utility_weight / stretch(len(task_of(study).legal(study)))
    }
    return replace(
        default_observer(),
        preference=PreferenceObserver(utility=utility),
        rating=replace(typical, participant_sd=float(spread)),
        missed=missed,
    )


def rating_study(design: Design, alpha: float, difference: float) -> Run:
    """Whether the default test finds how the methods differ, for one question.

    Of each participant's own differences of the two methods' ratings; where pairs are rated, of the scores less the
    middle of the scale (whether a trial showed one or the other first changes nothing).
    """
    task, study = task_of(design.study), design.study
    rating, points, paired = design.settings.rating, len(task.legal(study)), task.slots > 1
    trials = design.trials()
    if not task.slots:  # each trial shows both at once
        both = (study.reference, study.comparison or "")
        trials = [[replace(trial, methods=(name,)) for trial in own for name in both] for own in trials]
    raised = np.array([[paired or trial.methods[0] == design.study.comparison for trial in own] for own in trials])
    of_motion = motions_of(trials)

    def run(rng: np.random.Generator, studies: int, sizes: Sequence[int]) -> BoolArray:
        people, middle, wide = max(sizes), (points - 1) / 2, stretch(points)
        leniency = wide * rating.participant_sd * rng.standard_normal((studies, people, 1))
        leaning = middle + difference * raised[:people] + leniency
        given = np.clip(np.round(leaning + wide * rating.noise_sd * rng.standard_normal(leaning.shape)), 0, points - 1)
        response_s, answered = times(design, rng, np.full(given.shape, 0.5))
        kept = kept_of(design, rng, response_s, answered)

        def apart(motions: FloatArray) -> tuple[FloatArray, BoolArray]:
            mean, seen = _mean(given, kept & raised[:people], motions[:people])
            other, both = _mean(given, kept & ~raised[:people], motions[:people])
            return (mean - middle, seen) if paired else (mean - other, seen & both)

        over_all = apart(of_motion.max(axis=2, keepdims=True))
        return _found(over_all, apart(of_motion), sizes, alpha, difference)

    return run


def _mean(given: FloatArray, rows: BoolArray, motions: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Mean over these answers of each participant in each motion, and where there are any."""
    sums, count = (np.einsum("spt,ptm->spm", part, motions, optimize=True) for part in (given * rows, rows * 1.0))
    return sums / np.maximum(count, 1), count > 0


Apart = tuple[FloatArray, BoolArray]
"""How far the methods are apart, shape (studies, participants, motions), and where that is known."""


def _found(over_all: Apart, by_motion: Apart, sizes: Sequence[int], alpha: float, difference: float) -> BoolArray:
    """Significant, and in the right direction (either way where there is no difference), for each number of people."""
    found = []
    for size in sizes:
        apart, there = over_all[0][:, :size, 0], over_all[1][:, :size, 0]
        within, known = by_motion[0][:, :size], by_motion[1][:, :size]
        p_value = student_p_values(apart, there, 0.0)
        # As the analysis does: over motions only where that costs no participant.
        complete = (known.any(axis=2) == there).all(axis=1)
        general = general_p_values(p_value, within * known, known.astype(np.float64))
        p_value = np.where(complete, general, p_value)
        mean = (apart * there).sum(axis=1)
        towards = (mean > 0) == (difference > 0) if difference else np.ones(len(apart), dtype=bool)
        found.append((p_value < alpha) & towards)
    return np.column_stack(found)
