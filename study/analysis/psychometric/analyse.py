"""Psychometric functions of a whole study: trials of several participants in, every estimate side by side out.

Each participant's own function, the function of all answers taken as one person's, and what is to be believed of the
group, since answers of one participant are not independent of each other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from study.analysis import estimates
from study.analysis.conditions import SLOPE, OwnEstimate
from study.analysis.estimates import Interval, NotFitted
from study.analysis.headline import NO_TEST, Headline, holds_for
from study.analysis.psychometric.likelihood import LikelihoodFit, fit_likelihood
from study.analysis.psychometric.mixed import TypicalThreshold, psychometric_mixed
from study.analysis.psychometric.model import Model, make_model
from study.analysis.psychometric.posterior import Estimate, curve_of, fit_psychometric
from study.analysis.regression.mixed import Link
from study.counting import counted, noun

if TYPE_CHECKING:
    import pandas as pd

NEEDED_COLUMNS = ("participant", "level", "yes", "shown")
LINKS_OF: dict[str, Link] = {"normal": "probit", "logistic": "logit"}


@dataclass(frozen=True)
class Function:
    """A fitted function with points (level, share) of its curve; `note` says why where nothing was fitted."""

    threshold: Estimate | None = None
    width: Estimate | None = None
    lapse: Estimate | None = None
    guess: Estimate | None = None
    overdispersion: Estimate | None = None
    sigmoid: str | None = None
    curve: tuple[tuple[float, float], ...] = ()
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class OwnFunction(Function):
    """A participant's own function."""

    participant: str
    answers: int


@dataclass(frozen=True)
class GroupThreshold:
    """The mean over participants of their own thresholds (of the logarithms for Weibull), with Student's interval."""

    participants: int
    mean_threshold: float | None
    low: float | None
    high: float | None
    standard_deviation: float | None
    note: str


@dataclass(frozen=True)
class LevelAnswers:
    """Answers "yes" at a level."""

    level: float
    yes: float
    shown: float
    percent: float | None


@dataclass(frozen=True)
class BelievedThreshold:
    """A threshold on the scale of the levels, over participants if there are several; `note` says whose it is."""

    value: float | None
    low: float | None
    high: float | None
    note: str
    generalises_to: str = ""


@dataclass(frozen=True)
class PsychometricStudy:
    """The result of a 2AFC or yes-no study.

    `pooled` and `likelihood` are of all answers taken as one person's; `group` is the mean over participants of their
    thresholds, `mixed` the threshold of a typical one, and `mixed_note` says why it can't be had.
    """

    confidence: float
    participants: tuple[OwnFunction, ...]
    pooled: Function
    likelihood: LikelihoodFit | NotFitted
    group: GroupThreshold
    mixed: TypicalThreshold | None
    mixed_note: str
    levels: tuple[LevelAnswers, ...]
    answer: str

    @property
    def believed(self) -> BelievedThreshold:
        """Return the threshold that `answer` is about: of a typical participant, the mean over them, or of one."""
        mixed, group, alone = self.mixed, self.group, self.pooled.threshold
        if mixed is not None and mixed.threshold is not None:
            whose = "of a typical participant"
            return BelievedThreshold(mixed.threshold, mixed.low, mixed.high, whose, mixed.generalises_to)
        if group.participants > 1 and group.mean_threshold is not None:
            return BelievedThreshold(group.mean_threshold, group.low, group.high, "mean over participants")
        if alone is None:
            return BelievedThreshold(None, None, None, self.pooled.note)
        return BelievedThreshold(alone.value, alone.interval.low, alone.interval.high, alone.note or "of all answers")

    def headlines(self, study: str, alpha: float, confidence: float) -> list[Headline]:
        """Return the threshold to be believed."""
        del alpha
        found = self.believed
        return [
            Headline(
                study=study,
                statement=self.answer,
                estimate=found.value,
                unit="the unit of the levels",
                interval=Interval(found.low, found.high, confidence),
                p=None,
                p_adjusted=None,
                test=found.note,
                generalises_to=found.generalises_to or holds_for(len(self.participants)),
                note=NO_TEST,
            )
        ]


def analyse_psychometric(
    trials: pd.DataFrame, model: Model | None = None, *, confidence: float = 0.95, simulations: int = 0
) -> PsychometricStudy:
    """Analyse one 2AFC or yes-no study.

    Parameters
    ----------
    trials
        Columns `participant`, `level`, `yes`, `shown`, and `motion` where it is known.
    model
        From `make_model`; 2AFC unless given.
    simulations
        Data sets drawn for the p-value of the deviance of the pooled fit; 0 takes chi-square.

    Raises
    ------
    AnalysisError
        When a column is missing, or a count can't be.
    """
    estimates.check_columns(trials, NEEDED_COLUMNS, "a psychometric function")
    estimates.check_participants(trials)
    chosen = model or make_model()
    own = tuple(
        OwnFunction(
            **vars(function_of(part, chosen, confidence)), participant=str(name), answers=int(part["shown"].sum())
        )
        for name, part in trials.groupby(trials["participant"].astype(str), sort=True)
    )
    levels, yes, shown = (trials[column].to_numpy(dtype=np.float64) for column in ("level", "yes", "shown"))
    best = fit_likelihood(levels, yes, shown, chosen, confidence=confidence, simulations=simulations)
    pooled, group = function_of(trials, chosen, confidence), _group(own, chosen, confidence)
    typical = _typical(trials, chosen, best, confidence)
    mixed = None if isinstance(typical, str) else typical
    return PsychometricStudy(
        confidence=confidence,
        participants=own,
        pooled=pooled,
        likelihood=NotFitted(best) if isinstance(best, str) else best,
        group=group,
        mixed=mixed,
        mixed_note=typical if isinstance(typical, str) else typical.note,
        levels=_by_level(trials),
        answer=_in_words(pooled, own, group, mixed, confidence),
    )


def typical_threshold(trials: pd.DataFrame, model: Model, confidence: float) -> TypicalThreshold | str:
    """Return the threshold of a typical participant as `analyse_psychometric` finds it, alone; or why there is none."""
    levels, yes, shown = (trials[column].to_numpy(dtype=np.float64) for column in ("level", "yes", "shown"))
    return _typical(trials, model, fit_likelihood(levels, yes, shown, model, confidence=confidence), confidence)


def own_functions(trials: pd.DataFrame, condition: str, model: Model, confidence: float) -> Iterator[OwnEstimate]:
    """Return each participant's threshold and slope in one condition, with their errors, to compare conditions."""
    reach = 2 * estimates.normal_quantile(confidence)
    for name, part in trials.groupby(trials["participant"].astype(str), sort=True):
        found = function_of(part, model, confidence)
        if found.threshold is None or found.threshold.value is None or found.width is None or not found.width.value:
            continue
        low, high = found.threshold.interval.low, found.threshold.interval.high
        error = None if low is None or high is None else (high - low) / reach
        yield OwnEstimate(str(name), condition, "threshold", found.threshold.value, error)
        low, high = found.width.interval.low, found.width.interval.high
        error = None if low is None or high is None else math.log(high / low) / reach
        yield OwnEstimate(str(name), condition, SLOPE, -math.log(found.width.value), error)


def function_of(trials: pd.DataFrame, model: Model, confidence: float) -> Function:
    """Return the function of all answers in a table, taken as one person's."""
    levels, yes, shown = (trials[column].to_numpy(dtype=np.float64) for column in ("level", "yes", "shown"))
    fit = fit_psychometric(levels, yes, shown, model, confidence=confidence)
    if isinstance(fit, str):
        return Function(note=fit)
    estimated = (fit.threshold, fit.width, fit.lapse, fit.guess, fit.overdispersion)
    return Function(*estimated, fit.model.sigmoid.name, curve_of(fit), fit.note)


def _typical(
    trials: pd.DataFrame, model: Model, best: LikelihoodFit | str, confidence: float
) -> TypicalThreshold | str:
    """The threshold of a typical participant, rates held at those of all answers; or why there is none."""
    if isinstance(best, str):
        return best
    if trials["participant"].nunique() < 2:
        return "one participant: results do not generalise to others"
    if model.sigmoid.name not in LINKS_OF:
        return f"mixed models are fitted with the sigmoids {' and '.join(LINKS_OF)} only"
    link = LINKS_OF[model.sigmoid.name]
    found = psychometric_mixed(trials, link=link, guess=best.guess, lapse=best.lapse, confidence=confidence)
    shown = trials.loc[trials["shown"] > 0, "level"]
    if found.threshold is None or shown.min() <= found.threshold <= shown.max():
        return found
    note = f"outside the levels shown ({shown.min():g} to {shown.max():g})"
    return replace(found, threshold=None, note="; ".join(filter(None, (note, found.note))))


def _group(own: tuple[OwnFunction, ...], model: Model, confidence: float) -> GroupThreshold:
    """The mean over participants of their own thresholds; of the logarithms for Weibull."""
    found = [one.threshold.value for one in own if one.threshold and one.threshold.value is not None]
    left_out = len(own) - len(found)
    axis = model.sigmoid.axis(np.array(found)) if found else np.zeros(0)
    test = estimates.mean_test(axis, 0.0, confidence)

    def back(value: float | None) -> float | None:
        return None if value is None else float(model.sigmoid.levels(np.array(value)))

    have_none = f"{counted(len(own), 'participant')} {noun(left_out, 'has', 'have')} no threshold within the levels"
    return GroupThreshold(
        participants=test.participants,
        mean_threshold=back(test.mean),
        low=back(test.low),
        high=back(test.high),
        standard_deviation=float(axis.std(ddof=1)) if len(axis) > 1 else None,
        note="; ".join(filter(None, (test.note if found else "", f"{left_out} of {have_none}" if left_out else ""))),
    )


def _by_level(trials: pd.DataFrame) -> tuple[LevelAnswers, ...]:
    sums = trials.groupby("level", sort=True)[["yes", "shown"]].sum()
    return tuple(
        LevelAnswers(float(level), float(yes), float(shown), 100 * float(yes) / float(shown) if shown else None)
        for level, yes, shown in zip(sums.index, sums["yes"], sums["shown"], strict=True)
    )


def _in_words(
    pooled: Function,
    own: tuple[OwnFunction, ...],
    group: GroupThreshold,
    mixed: TypicalThreshold | None,
    confidence: float,
) -> str:
    """The threshold to be believed: of a group over participants, of one participant that participant's own."""
    alone = pooled.threshold
    if alone is None:
        return f"No psychometric function can be fitted: {pooled.note}."
    alone_in_words = "" if alone.value is None else _with_interval(alone.value, alone.interval.low, alone.interval.high)
    if len(own) == 1:
        if alone.value is None:
            return f"No threshold can be given: {alone.note}."
        return f"The threshold is {_with_interval(alone.value, **vars(alone.interval))}."
    if mixed and mixed.threshold is not None and mixed.participants is not None:
        found = _with_interval(mixed.threshold, mixed.low, mixed.high, confidence)
        people = counted(mixed.participants, "participant")
        over = f"across {mixed.generalises_to}, by a mixed model"
        text = f"The threshold of a typical one of {people} is {found}, {over}"
    elif group.mean_threshold is not None:
        found = _with_interval(group.mean_threshold, group.low, group.high, confidence)
        text = (
            f"The mean threshold of {counted(group.participants, 'participant')} is {found}, by Student's t over them"
        )
    else:
        return f"No threshold of the group can be given: {group.note}."
    if not alone_in_words:
        return f"{text}."
    return f"{text}. All answers taken as one person's give {alone_in_words}, which is too sure where people differ."


def _with_interval(value: float, low: float | None, high: float | None, confidence: float | None = None) -> str:
    """A number and its interval, to three digits of the interval's width; open ends are said."""
    width = abs(value) if low is None or high is None else high - low
    places = min(max(2 - math.floor(math.log10(width)), 0), 12) if width > 0 else 4

    def told(end: float | None) -> str:
        return "open" if end is None else f"{end:.{places}f}"

    ends = f"{told(low)} to {told(high)}"
    return f"{told(value)} ({f'{100 * confidence:g}% interval ' if confidence else ''}{ends})"
