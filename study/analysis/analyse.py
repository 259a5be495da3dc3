"""All analyses of all answers: one table in, one JSON-able dictionary out, for the command line and the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from study.analysis import estimates
from study.analysis.exclusions import Rules, exclude
from study.analysis.preference.analyse import compare, confirmatory, strengths
from study.analysis.preference.no_effect import MARGIN
from study.analysis.quality import quality
from study.analysis.ratings.cells import rating_cells
from study.analysis.ratings.comparisons import rating_anova
from study.analysis.ratings.pairs import of_pairs, pair_ratings
from study.analysis.ratings.table import rating_table
from study.analysis.same_different.analyse import analyse_jnd
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

TASKS = ("same-different", "preference", "rating")


@dataclass(frozen=True)
class _Settings:
    """What was decided about the analysis, as `analyse` takes it."""

    threshold: float
    confidence: float
    alpha: float
    resamples: int
    seed: int
    margin: float
    family: tuple[str, ...] | None
    scale_points: Mapping[str, int]


def analyse(
    answers: pd.DataFrame,
    *,
    threshold: float = 0.75,
    confidence: float = 0.95,
    alpha: float = 0.05,
    resamples: int = 1000,
    seed: int = 0,
    margin: float = MARGIN,
    family: Sequence[str] | None = None,
    rules: Rules | None = None,
    checks: pd.DataFrame | None = None,
    scale_points: Mapping[str, int] | None = None,
) -> dict[str, Any]:
    """Analyse every study in a table of answers.

    Parameters
    ----------
    answers
        One row an answer: `participant`, `task`, `study`, `answer`, and the columns that the tasks need (see
        `docs/analysis.md`). Missed answers have no `answer`.
    threshold
        Share of "different" that defines the just noticeable difference; above one half.
    confidence
        Of all intervals.
    alpha
        Level of significance that sentences speak of.
    resamples, seed
        Of the bootstrap over participants behind the standard errors; the same seed gives the same numbers.
    margin
        How far from an even split a preference may lie and count as none; 0.1 is 40 to 60%.
    family
        Names of the studies whose tests were declared confirmatory before there was data; all preference studies where
        it is None.
    rules, checks
        What is left out, as stated before there was data, and the answers to attention checks.
    scale_points
        Points of the scale of each rating study, by its name; needed where pairs were rated.

    Returns
    -------
    dict
        `jnd` (by name of a same-different study), `preference` (by name of a preference study, a list of compared
        pairs of methods), `confirmatory` (their default tests, adjusted together by Holm's method), `bradley_terry`
        (strengths by study, where more than two methods were compared), `ratings`, `rating_anova` and `rating_cells`
        (by name of a rating study), `pair_ratings` (by name of a study in which pairs were rated), each empty where
        there is none;
        `exclusions` (what was left out by which rule), `without_exclusions` (the same results of all answers; None
        where none was left out), `quality` (of all answers),
        `data` ("collected", "simulated", "mixed" or "none"), `confidence`, `alpha`.

    Raises
    ------
    AnalysisError
        When a column is missing or holds what can't be understood.
    """
    missing = [name for name in ("participant", "task", "answer") if name not in answers.columns]
    if missing:
        raise AnalysisError(f"expected the columns participant, task and answer, found none named {', '.join(missing)}")
    strange = sorted(set(answers["task"].astype(str)) - set(TASKS))
    if strange:
        raise AnalysisError(f"expected one of the tasks {', '.join(TASKS)}, found {strange[0]!r}")
    kept = exclude(answers, rules or Rules(), checks)
    declared = None if family is None else tuple(family)
    settings = _Settings(threshold, confidence, alpha, resamples, seed, margin, declared, scale_points or {})
    result = _studies_analysed(kept.answers, settings)
    left_out = {name: getattr(kept, name) for name in ("rules", "participants", "answers_left_out")}
    result |= {
        "exclusions": left_out,
        "without_exclusions": _studies_analysed(answers, settings) if kept.answers_left_out else None,
        "quality": quality(answers),
        "data": kind_of_data(answers),
        "confidence": confidence,
        "alpha": alpha,
    }
    return dict(estimates.plain(result))


def _studies_analysed(answers: pd.DataFrame, settings: _Settings) -> dict[str, Any]:
    """Every study of a table of answers."""
    confidence = settings.confidence
    kinds = ("jnd", "preference", "bradley_terry", "ratings", "rating_anova", "rating_cells", "pair_ratings")
    result: dict[str, Any] = {kind: {} for kind in kinds}
    for (task, study), part in answers.groupby([answers["task"].astype(str), _studies(answers)], sort=False):
        if task == "same-different":
            result["jnd"][study] = analyse_jnd(
                part,
                level=settings.threshold,
                confidence=confidence,
                resamples=settings.resamples,
                seed=settings.seed,
            )
        elif task == "preference":
            result["preference"][study] = compare(part, confidence, settings.alpha, margin=settings.margin)
            result["bradley_terry"][study] = strengths(part, confidence)
        elif of_pairs(part):
            result["pair_ratings"][study] = pair_ratings(part, _points(str(study), settings), confidence)
        else:
            result["ratings"][study] = rating_table(part, confidence)
            result["rating_anova"][study] = rating_anova(part, confidence)
            result["rating_cells"][study] = rating_cells(part, confidence)
    result["confirmatory"] = confirmatory(result["preference"], settings.family)
    return result


def _points(study: str, settings: _Settings) -> int:
    if study not in settings.scale_points:
        raise AnalysisError(
            f"expected how many points the scale of {study!r} has, where pairs were rated, found none; name them in "
            "scale_points"
        )
    return settings.scale_points[study]


def _studies(answers: pd.DataFrame) -> pd.Series[str]:
    column = "study" if "study" in answers.columns else "task"
    return answers[column].astype(str)


def kind_of_data(answers: pd.DataFrame) -> str:
    """Return who answered: "collected" (people), "simulated", "mixed", or "none"."""
    if answers.empty:
        return "none"
    if "simulated" not in answers.columns:
        return "collected"
    simulated = answers["simulated"].astype(bool)
    return "simulated" if simulated.all() else "mixed" if simulated.any() else "collected"
