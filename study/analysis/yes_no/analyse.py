"""Yes-no studies: answers in; false alarms, d' and thresholds out, by equal-variance signal detection.

A typical participant's "yes" rises with the difference as Phi(d' x - c), to each side with a d' a frame of its own, by
a mixed probit model; trials without a difference tell the criterion c (DeCarlo 1998). The lapse rate is
that at which such a model of both sides is likeliest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from study.analysis import estimates
from study.analysis.estimates import Interval
from study.analysis.headline import NO_TEST, Headline, holds_for
from study.analysis.oddity.analyse import OddityLevel
from study.analysis.psychometric.analyse import BelievedThreshold
from study.analysis.psychometric.mixed import TypicalThreshold, psychometric_mixed
from study.analysis.regression.mixed import fit_mixed
from study.analysis.same_different.counts import SIDES, SIGNS, Side
from study.analysis.same_different.staircases import Staircases, staircase_thresholds
from study.analysis.study_result import Settings
from study.arrays import FloatArray
from study.models.detection import BEST_D_PRIME, said_yes

if TYPE_CHECKING:
    import pandas as pd

NEEDED_COLUMNS = ("participant", "difference_frames", "answer")
MOST_LAPSES = 0.2
FEW_NODES, UNLIKELY = 5, 1e9
"""Nodes of the integral over participants that do for a lapse rate; a misfit in place of one that can't be had."""


@dataclass(frozen=True)
class Sensitivity:
    """How well departures to one side are seen."""

    threshold: BelievedThreshold
    """The difference at which this share of the answers is "yes"; it depends on the criterion."""
    d_prime: float | None
    low: float | None
    high: float | None
    """`d_prime`, `low`, `high`: d' a frame, with its interval."""
    criterion_free: float | None
    """The difference at which an observer with the best criterion would be right in 75% of the trials."""
    criterion: float | None
    """Distance of the criterion from what no difference leaves, in standard deviations of one percept."""
    lapse: float
    curve: tuple[tuple[float, float], ...]
    """Points (difference, share of "yes")."""


@dataclass(frozen=True)
class YesNo:
    """The result of a yes-no study."""

    keys: ClassVar[Mapping[str, str]] = {"yes_no": ""}

    share: float
    """Of "yes", at threshold."""
    levels: tuple[OddityLevel, ...]
    """By difference, rising: `percent` is of "yes", `p_value` that it is as often as without a difference, `d_prime`
    that of an observer with these rates of "yes" here and without a difference."""
    sides: Mapping[Side, Sensitivity]
    staircases: Staircases | None = None
    """Thresholds of tracks, where trials were chosen by staircases or QUEST+."""

    @property
    def false_alarms(self) -> float | None:
        """Return the percentage of "yes" where nothing differs."""
        return next((one.percent for one in self.levels if not one.difference_frames), None)

    @property
    def thresholds(self) -> dict[Side, BelievedThreshold]:
        """Return the threshold of each side."""
        return {side: found.threshold for side, found in self.sides.items()}

    def headlines(self, study: str, alpha: float, confidence: float) -> list[Headline]:
        """Return the threshold of each side."""
        del alpha
        return [
            Headline(
                study=study,
                statement=f"Blends that are {side}: {self.in_words(side)}",
                estimate=found.value,
                unit=f"frames {side} than the reference",
                interval=Interval(found.low, found.high, confidence),
                p=None,
                p_adjusted=None,
                test=found.note,
                generalises_to=found.generalises_to,
                note=NO_TEST,
            )
            for side, found in self.thresholds.items()
        ]

    def in_words(self, side: Side) -> str:
        """Return the threshold and d' of one side."""
        own = self.sides[side]
        found = own.threshold
        if found.value is None:
            place = f"no threshold is known ({found.note})"
        else:
            ends = "" if found.low is None else f" ({found.low:.1f} to {found.high:.1f})"
            place = f"{self.share:.0%} of the answers are “yes” at {found.value:.1f} frames{ends}, {found.note}"
        if own.d_prime is None:
            return f"{place}."
        ends = "" if own.low is None else f" ({own.low:.3f} to {own.high:.3f})"
        free = "" if own.criterion_free is None else f"; whatever the criterion, {own.criterion_free:.1f} frames"
        return f"{place}; d-prime rises by {own.d_prime:.3f} a frame{ends}{free}."

    def sentences(self, alpha: float) -> list[str]:
        """Return false alarms, thresholds and d' in words."""
        del alpha
        if not self.levels:
            return ["No answers were given."]
        alarms = self.false_alarms
        told = [
            "No trial was without a difference: criterion and d' cannot be distinguished."
            if alarms is None
            else f"Without a difference {alarms:.0f}% of the answers were “yes” (false alarms)."
        ]
        told += [self.staircases.in_words()] if self.staircases else []
        return [*told, *(f"Blends that are {side}: {self.in_words(side)}" for side in self.sides)]


def analyse_yes_no(answers: pd.DataFrame, name: str, settings: Settings) -> YesNo:
    """Analyse one yes-no study.

    Parameters
    ----------
    answers
        Columns `participant`, `difference_frames`, `answer` ("yes" or "no"; empty for no response), and `motion` where
        it is known; with tracks also `trial`, `repeat`, `correct`.
    name
        Of the study.
    settings
        The share at threshold and the level of confidence count, and the rule of the study's tracks.

    Raises
    ------
    AnalysisError
        When a column is missing.
    """
    estimates.check_columns(answers, NEEDED_COLUMNS, "an analysis of yes and no")
    given = answers[answers["answer"].isin(("yes", "no")) & answers["difference_frames"].notna()]
    estimates.check_participants(given)
    trials = given.assign(
        participant=given["participant"].astype(str),
        difference=given["difference_frames"].astype(float),
        yes=(given["answer"] == "yes").astype(float),
        shown=1.0,
    )
    sides = sensitivities(trials, settings.threshold, settings.confidence)
    rule = settings.tracks.get(name)
    staircases = None if rule is None else staircase_thresholds(answers, rule, settings.confidence, "“yes”")
    return YesNo(settings.threshold, _levels(trials, settings.confidence), sides, staircases)


def sensitivities(trials: pd.DataFrame, share: float, confidence: float) -> dict[Side, Sensitivity]:
    """Return d' and threshold of each side that was shown.

    Parameters
    ----------
    trials
        Columns `participant`, `difference`, `yes`, `shown`, and `motion` where it is known.
    share
        Of "yes", at threshold.
    """
    place = trials["difference"].to_numpy(dtype=np.float64)
    shown_sides = [side for side in SIDES if (place * SIGNS[side] > 0).any()]
    if not (place == 0).any():
        return dict.fromkeys(shown_sides, _unknown("no trials without a difference"))
    frames = np.column_stack([np.maximum(place * SIGNS[side], 0) for side in shown_sides] or [place])
    yes, shown = (trials[name].to_numpy(dtype=np.float64) for name in ("yes", "shown"))
    criterion, slopes, lapse = pooled(frames, yes, shown, shared_lapse(trials, shown_sides))
    return {
        side: _sensitivity(
            trials[place * SIGNS[side] >= 0].assign(level=lambda own: own["difference"].abs()),
            (criterion, slope, lapse),
            share,
            confidence,
        )
        for side, slope in zip(shown_sides, slopes, strict=False)
    }


def _sensitivity(
    trials: pd.DataFrame, alone: tuple[float, float, float], share: float, confidence: float
) -> Sensitivity:
    """That of a typical participant; `alone` is criterion, d' a frame and lapse rate of all answers."""
    from scipy.special import ndtri

    criterion, d_prime, lapse = alone
    without = (share - lapse / 2) / (1 - lapse)
    if not 0 < without < 1:
        return _unknown(f"lapses keep the answers from {share:.0%}")
    at, rate, low, high = float(ndtri(without)), lapse / 2, None, None
    typical = TypicalThreshold(note="one participant")
    if trials["participant"].nunique() > 1:
        typical = psychometric_mixed(trials, link="probit", guess=rate, lapse=rate, confidence=confidence, at=at)
    place = BelievedThreshold(None, None, None, typical.note or "the answers do not rise with the difference")
    if typical.threshold is not None and typical.slope is not None:
        d_prime, criterion = typical.slope, typical.slope * typical.threshold - at
        people = typical.participants or 2
        half = estimates.t_quantile(confidence, people - 1) * (typical.slope_error or np.inf)
        low, high = d_prime - half, d_prime + half
        to = typical.generalises_to or holds_for(people)
        place = BelievedThreshold(typical.threshold, typical.low, typical.high, "of a typical participant", to)
    elif d_prime > 0:
        place = BelievedThreshold((at + criterion) / d_prime, None, None, f"of all answers ({typical.note})")
    most = float(trials["level"].max())
    if place.value is not None and not 0 <= place.value <= most:
        note = f"outside the differences shown (0 to {most:g})" if place.value > 0 else "false alarms are above it"
        place = BelievedThreshold(None, None, None, note)
    x = np.linspace(0, most, 101)
    curve = tuple(zip(x.tolist(), said_yes(d_prime * x, 2 * criterion, lapse).tolist(), strict=True))
    free = BEST_D_PRIME / d_prime if d_prime > 0 else None
    return Sensitivity(place, d_prime, low, high, free, criterion, lapse, curve)


def _unknown(note: str) -> Sensitivity:
    return Sensitivity(BelievedThreshold(None, None, None, note), None, None, None, None, None, 0.0, ())


def shared_lapse(trials: pd.DataFrame, sides: Sequence[Side]) -> float | None:
    """Return the lapse rate at which the mixed model of both sides is likeliest; None with one participant.

    That of all answers taken as one person's would be too high: where participants differ, their mean rises less
    steeply than each of them, as lapses make it do.
    """
    from scipy.optimize import minimize_scalar

    if trials["participant"].nunique() < 2 or not sides:
        return None
    table = trials.groupby(["participant", "difference"])[["yes", "shown"]].sum().reset_index()
    place = table["difference"].to_numpy(dtype=np.float64) / trials["difference"].abs().max()
    one = np.ones(len(place))
    fixed = np.column_stack([one, *(np.maximum(place * SIGNS[side], 0) for side in sides)])
    own = np.column_stack([one, np.abs(place)])
    counts = table["yes"].to_numpy(), table["shown"].to_numpy(), table["participant"].to_numpy()

    def misfit(lapse: float) -> float:
        fit = fit_mixed(fixed, own, *counts, link="probit", guess=lapse / 2, lapse=lapse / 2, nodes=FEW_NODES)
        return UNLIKELY if isinstance(fit, str) else -fit.log_likelihood

    return float(minimize_scalar(misfit, bounds=(0, MOST_LAPSES), method="bounded", options={"xatol": 0.01}).x)


def pooled(
    frames: FloatArray, yes: FloatArray, shown: FloatArray, lapse: float | None
) -> tuple[float, list[float], float]:
    """Return criterion, d' a frame of each side and lapse rate of all answers as one person's: maximum likelihood.

    Parameters
    ----------
    frames : ndarray, shape (answers, sides)
        Size of the difference in the column of its side, 0 in the other.
    yes, shown : ndarray, shape (answers,)
    lapse
        Where it is known.
    """
    from scipy.optimize import minimize

    unit, sides = max(float(frames.max()), 1.0), frames.shape[1]

    def misfit(point: FloatArray) -> float:
        share = np.clip(said_yes(frames @ point[2:] / unit, 2 * point[0], point[1]), 1e-12, 1 - 1e-12)
        return -float(yes @ np.log(share) + (shown - yes) @ np.log1p(-share))

    lapses = (0.0, MOST_LAPSES) if lapse is None else (lapse, lapse)
    bounds = [(-4.0, 6.0), lapses, *[(-60.0, 60.0)] * sides]
    best = minimize(misfit, [1.0, lapses[0], *[2.0] * sides], method="L-BFGS-B", bounds=bounds).x
    return float(best[0]), [float(slope) / unit for slope in best[2:]], float(best[1])


def _levels(trials: pd.DataFrame, confidence: float) -> tuple[OddityLevel, ...]:
    from scipy.special import ndtri

    found = []
    each = trials.groupby(["difference", "participant"])["yes"].mean().unstack("difference")
    alarms = each.get(0.0)
    for difference in sorted(each.columns):
        own = each[difference].dropna()
        mean = estimates.mean_of(own.to_list(), confidence)
        low, high = (None if end is None else 100 * min(max(end, 0.0), 1.0) for end in (mean.low, mean.high))
        share, p_value, d_prime = float(own.mean()), None, None
        if difference and alarms is not None:
            p_value = estimates.mean_test((own - alarms).dropna().to_numpy(), 0.0, confidence).p_value
            rates = np.array([share, float(alarms.mean())])
            d_prime = float(np.subtract(*ndtri(rates))) if (rates > 0).all() and (rates < 1).all() else None
        count = int((trials["difference"] == difference).sum())
        found.append(OddityLevel(int(difference), len(own), count, 100 * share, low, high, p_value, d_prime))
    return tuple(found)
