"""All analyses of all answers: one table in, a typed result of each study out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeVar

from study.analysis.confidence import HowSure, how_sure
from study.analysis.confirmatory import ConfirmatoryTest, confirmatory
from study.analysis.exclusions import Exclusions, Rules, exclude, rules_of
from study.analysis.headline import Headline
from study.analysis.preference.analyse import Preference
from study.analysis.quality import Quality, quality
from study.analysis.registry import ANALYSES, analysis_of
from study.analysis.study_result import Settings, StudyResult
from study.analysis.to_json import to_json
from study.errors import AnalysisError
from study.models.tracks import Rule

if TYPE_CHECKING:
    import pandas as pd

Kind = TypeVar("Kind", bound=StudyResult)
Data = Literal["collected", "simulated", "mixed", "none"]
"""Who answered: people, simulated observers, or both."""


class Decisions(Protocol):
    """What a protocol decides about the analysis: see `Settings`, `analyse` and `Rules`."""

    threshold: float
    alpha: float
    equivalence_points: float
    confirmatory: tuple[str, ...]
    exclusions: Any


class Decided(Protocol):
    """The part of a protocol that an analysis reads."""

    @property
    def analysis(self) -> Decisions:
        """What was decided."""

    @property
    def scale_points(self) -> Mapping[str, int]:
        """Points of the scale of each rating study."""

    @property
    def tracks(self) -> Mapping[str, Rule]:
        """The rule of each study whose trials were chosen in tracks."""


@dataclass(frozen=True)
class Results:
    """What answers say."""

    studies: Mapping[str, StudyResult]
    """By name."""
    confirmatory: tuple[ConfirmatoryTest, ...]
    """The default tests of preference studies, adjusted together by Holm's method."""
    how_sure: tuple[HowSure, ...] = ()
    """How sure participants were, where they were asked."""

    def of(self, kind: type[Kind]) -> dict[str, Kind]:
        """Return the results of one kind, by name of the study."""
        return {name: found for name, found in self.studies.items() if isinstance(found, kind)}

    def headlines(self, alpha: float, confidence: float) -> tuple[Headline, ...]:
        """Return what each study found: see `headline`."""
        found = (one for name, study in self.studies.items() for one in study.headlines(name, alpha, confidence))
        return _adjusted(found, self.confirmatory)


@dataclass(frozen=True, kw_only=True)
class Analysis(Results):
    """What answers say, and what it rests on."""

    exclusions: Exclusions
    without_exclusions: Results | None
    """`exclusions`, `without_exclusions`: what each rule excluded, and the same results for all answers; None if
    nothing was excluded."""
    quality: Quality
    """Of all answers."""
    data: Data
    """Who answered."""
    confidence: float
    alpha: float

    @property
    def headline(self) -> tuple[Headline, ...]:
        """What each study found: see `headline`."""
        return self.headlines(self.alpha, self.confidence)

    def sentences(self) -> list[str]:
        """Return the answers of all studies in words."""
        return [sentence for study in self.studies.values() for sentence in study.sentences(self.alpha)]


def analyse(
    answers: pd.DataFrame,
    settings: Settings | None = None,
    *,
    family: Sequence[str] | None = None,
    rules: Rules | None = None,
    checks: pd.DataFrame | None = None,
) -> Analysis:
    """Analyse every study in a table of answers.

    Parameters
    ----------
    answers
        One row an answer: `participant`, `task`, `study`, `answer`, and the columns that the tasks need (see
        `docs/analysis.md`). Missed answers have no `answer`.
    settings
        The preregistered settings; by default the usual ones.
    family
        Names of the studies whose tests were declared confirmatory before there was data; all preference studies where
        it is None.
    rules, checks
        The preregistered exclusions, and the answers to attention checks.

    Raises
    ------
    AnalysisError
        When a column is missing or holds what can't be understood.
    """
    missing = [name for name in ("participant", "task", "answer") if name not in answers.columns]
    if missing:
        raise AnalysisError(f"expected the columns participant, task and answer, found none named {', '.join(missing)}")
    settings, rules = settings or Settings(), rules or Rules()
    kept, left_out = exclude(answers, rules, checks)
    found = _results(kept, settings, family)
    return Analysis(
        studies=found.studies,
        confirmatory=found.confirmatory,
        how_sure=found.how_sure,
        exclusions=left_out,
        without_exclusions=_results(answers, settings, family) if left_out.answers_left_out else None,
        quality=quality(answers),
        data=kind_of_data(answers),
        confidence=settings.confidence,
        alpha=settings.alpha,
    )


def analyse_folder(
    protocol: Decided,
    answers: pd.DataFrame,
    checks: pd.DataFrame,
    *,
    resamples: int = Settings.resamples,
    rules: Rules | None = None,
) -> Analysis:
    """Analyse the answers to a protocol as it decided.

    Parameters
    ----------
    protocol
        What was decided.
    answers, checks
        One row an answer; answers to attention checks apart.
    resamples
        Bootstrap samples behind standard errors.
    rules
        Exclusions in place of those of the protocol.
    """
    decided = protocol.analysis
    settings = Settings(
        threshold=decided.threshold,
        alpha=decided.alpha,
        confidence=1 - decided.alpha,
        resamples=resamples,
        margin=decided.equivalence_points / 100.0,
        scale_points=protocol.scale_points,
        tracks=protocol.tracks,
    )
    rules = rules or rules_of(decided.exclusions)
    return analyse(answers, settings, family=decided.confirmatory or None, rules=rules, checks=checks)


def _results(answers: pd.DataFrame, settings: Settings, family: Sequence[str] | None) -> Results:
    """Every study of a table of answers."""
    studies: dict[str, StudyResult] = {}
    names = answers["study" if "study" in answers.columns else "task"].astype(str)
    for (task, name), part in answers.groupby([answers["task"].astype(str), names], sort=False):
        if str(name) in studies:
            raise AnalysisError(f"expected one task a study, found {task!r} in {name!r} too; name the studies apart")
        studies[str(name)] = analysis_of(str(task)).analyse(part, str(name), settings)
    found = Results(studies, ())
    return Results(studies, confirmatory(found.of(Preference), family), how_sure(answers, settings.confidence))


def analysis_json(analysis: Analysis) -> dict[str, Any]:
    """Return what JSON holds of an analysis: the results of each kind under keys of their own, by name of the study."""
    other = analysis.without_exclusions
    return _results_json(analysis) | {
        "headline": to_json(analysis.headline),
        "exclusions": to_json(analysis.exclusions),
        "without_exclusions": None if other is None else _results_json(other),
        "quality": to_json(analysis.quality),
        "data": analysis.data,
        "confidence": analysis.confidence,
        "alpha": analysis.alpha,
    }


def _results_json(results: Results) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for kind in (kind for task in ANALYSES.values() for kind in task.kinds):
        own = results.of(kind)
        for key, attribute in kind.keys.items():
            found[key] = {name: to_json(getattr(one, attribute) if attribute else one) for name, one in own.items()}
    return found | {"confirmatory": to_json(results.confirmatory), "how_sure": to_json(results.how_sure)}


def _adjusted(headlines: Iterable[Headline], tests: Iterable[ConfirmatoryTest]) -> tuple[Headline, ...]:
    """The headlines, those of confirmatory tests with their adjusted p-values; each study's tests come in its order."""
    waiting: dict[str, list[ConfirmatoryTest]] = {}
    for test in tests:
        waiting.setdefault(test.study, []).append(test)
    return tuple(
        replace(one, p_adjusted=waiting[one.study].pop(0).holm_p_value) if waiting.get(one.study) else one
        for one in headlines
    )


def kind_of_data(answers: pd.DataFrame) -> Data:
    """Return who answered."""
    if answers.empty:
        return "none"
    if "simulated" not in answers.columns:
        return "collected"
    simulated = answers["simulated"].astype(bool)
    return "simulated" if simulated.all() else "mixed" if simulated.any() else "collected"
