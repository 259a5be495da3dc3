"""The threshold of a typical participant by a mixed model: counts by participant and level in, a threshold out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from study.analysis import estimates
from study.analysis.crossed import BOTH, FEWEST_MOTIONS, between_motions
from study.analysis.headline import holds_for
from study.analysis.regression.mixed import Link, MixedFit, fit_mixed
from study.arrays import FloatArray

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class TypicalThreshold:
    """Where a typical participant's curve is half way or as asked, with Student's interval; None where there is none.

    `note` says why there is none. Slope and spreads are on the scale of the link.
    """

    threshold: float | None = None
    standard_error: float | None = None
    low: float | None = None
    high: float | None = None
    slope: float | None = None
    intercept_spread: float | None = None
    slope_spread: float | None = None
    slope_error: float | None = None
    note: str = ""
    correlation: float | None = None
    participants: int | None = None
    motion_spread: float = 0.0
    """Standard deviation of the threshold across motions; 0 where they are no sample, or differ as chance has it."""
    generalises_to: str = ""
    """What the interval holds for."""


def psychometric_mixed(
    trials: pd.DataFrame,
    *,
    link: Link = "probit",
    guess: float = 0.0,
    lapse: float = 0.0,
    confidence: float = 0.95,
    at: float = 0.0,
) -> TypicalThreshold:
    """Return the threshold of a typical participant: random intercept and slope over participants.

    Parameters
    ----------
    trials
        Columns `participant`, `level`, `yes`, `shown`, and `motion` where it is known.
    link, guess, lapse
        The curve; one half is guessed in 2AFC.
    at
        Where on the scale of the link the threshold lies; 0 is half way.

    Notes
    -----
    Each motion has an intercept of its own, so that motions that differ don't flatten the curve; the threshold is the
    mean over them, and with three or more its interval takes them for a sample (`crossed.between_motions`).
    """
    columns = [column for column in ("participant", "motion", "level") if column in trials.columns]
    table = trials.groupby(columns, observed=True, sort=True)[["yes", "shown"]].sum().reset_index()
    levels = table["level"].to_numpy(dtype=np.float64)
    centre, unit = float(levels.mean()), float(levels.std())
    if unit == 0:
        return TypicalThreshold(note="one level only")
    motions = table["motion"].astype(str) if "motion" in columns else table["participant"].astype(str).str[:0]
    fit = _fit(table, (levels - centre) / unit, motions.to_numpy(), link, guess, lapse, confidence)
    if isinstance(fit, str):
        return TypicalThreshold(note=fit)
    return _threshold(fit, centre, unit, confidence, at)


def _fit(
    table: pd.DataFrame,
    level: FloatArray,
    motions: NDArray[np.object_],
    link: Link,
    guess: float,
    lapse: float,
    confidence: float,
) -> MixedFit | str:
    """The model with an intercept for each motion; with one for all where the answers to a motion are too few."""
    yes, shown = (table[name].to_numpy(dtype=np.float64) for name in ("yes", "shown"))
    own = np.column_stack([np.ones(len(level)), level])
    each = (motions[:, None] == np.unique(motions)).astype(np.float64)
    who = table["participant"].astype(str).to_numpy()

    def fitted(design: FloatArray) -> MixedFit | str:
        return fit_mixed(design, own, yes, shown, who, link=link, guess=guess, lapse=lapse, confidence=confidence)

    fit = fitted(np.column_stack([each, level]))
    return fit if each.shape[1] == 1 or (not isinstance(fit, str) and _sound(fit)) else fitted(own)


def _sound(fit: MixedFit) -> bool:
    """Whether every effect could be estimated."""
    return all(effect.standard_error is not None for effect in fit.effects) and bool(np.isfinite(fit.covariance).all())


def _threshold(fit: MixedFit, centre: float, unit: float, confidence: float, at: float) -> TypicalThreshold:
    motions = len(fit.effects) - 1
    own, slope = np.array([effect.value - at for effect in fit.effects[:motions]]), fit.effects[-1].value
    error = fit.effects[-1].standard_error
    found = TypicalThreshold(
        slope=slope / unit,
        intercept_spread=fit.spread[0],
        slope_spread=fit.spread[1] / unit,
        slope_error=None if error is None else error / unit,
        correlation=fit.correlation,
        participants=fit.participants,
        note=fit.note,
    )
    if slope <= 0 or not _sound(fit):
        return replace(found, note=fit.note or "the answers do not rise with the level: no threshold")
    between = between_motions(-unit * own / slope, fit.covariance[:motions, :motions] * (unit / slope) ** 2)
    gradient = np.append(np.full(motions, -1 / slope / motions), own.mean() / slope**2)
    known, others = unit**2 * max(float(gradient @ fit.covariance @ gradient), 0.0), fit.participants - 1
    variance = known + between.added
    freedom = variance**2 / (known**2 / others + between.satterthwaite) if variance > 0 else others
    place, half = centre - unit * own.mean() / slope, estimates.t_quantile(confidence, freedom) * math.sqrt(variance)
    return replace(
        found,
        threshold=float(place),
        standard_error=math.sqrt(variance),
        low=float(place - half),
        high=float(place + half),
        motion_spread=between.deviation,
        generalises_to=BOTH if motions >= FEWEST_MOTIONS else holds_for(fit.participants),
    )
