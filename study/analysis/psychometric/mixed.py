"""The threshold of a typical participant by a mixed model: counts by participant and level in, a threshold out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from study.analysis import estimates
from study.analysis.regression.mixed import Link, MixedFit, fit_mixed

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class TypicalThreshold:
    """Where a typical participant's curve is half way, with Student's interval; None where there is none, see `note`.

    Slope and spreads are on the scale of the link.
    """

    threshold: float | None = None
    standard_error: float | None = None
    low: float | None = None
    high: float | None = None
    slope: float | None = None
    intercept_spread: float | None = None
    slope_spread: float | None = None
    note: str = ""
    correlation: float | None = None
    participants: int | None = None


def psychometric_mixed(
    trials: pd.DataFrame,
    *,
    link: Link = "probit",
    guess: float = 0.0,
    lapse: float = 0.0,
    confidence: float = 0.95,
) -> TypicalThreshold:
    """Return the threshold of a typical participant: random intercept and slope over participants.

    Parameters
    ----------
    trials
        Columns `participant`, `level`, `yes`, `shown`.
    link, guess, lapse
        The curve; one half is guessed in 2AFC.
    """
    levels = trials["level"].to_numpy(dtype=np.float64)
    yes, shown = trials["yes"].to_numpy(dtype=np.float64), trials["shown"].to_numpy(dtype=np.float64)
    centre, unit = float(levels.mean()), float(levels.std())
    if unit == 0:
        return TypicalThreshold(note="one level only")
    design = np.column_stack([np.ones(len(levels)), (levels - centre) / unit])
    who = trials["participant"].astype(str).to_numpy()
    fit = fit_mixed(design, design, yes, shown, who, link=link, guess=guess, lapse=lapse, confidence=confidence)
    if isinstance(fit, str):
        return TypicalThreshold(note=fit)
    return _threshold(fit, centre, unit, confidence)


def _threshold(fit: MixedFit, centre: float, unit: float, confidence: float) -> TypicalThreshold:
    intercept, slope = fit.effects[0].value, fit.effects[1].value
    found = TypicalThreshold(
        slope=slope / unit,
        intercept_spread=fit.spread[0],
        slope_spread=fit.spread[1] / unit,
        correlation=fit.correlation,
        participants=fit.participants,
        note=fit.note,
    )
    if slope <= 0 or fit.effects[1].standard_error is None or not np.isfinite(fit.covariance).all():
        return replace(found, note=fit.note or "the answers do not rise with the level: no threshold")
    gradient = np.array([-1 / slope, intercept / slope**2])
    error = unit * math.sqrt(max(float(gradient @ fit.covariance @ gradient), 0.0))
    place = centre - unit * intercept / slope
    half = estimates.t_quantile(confidence, fit.participants - 1) * error
    return replace(found, threshold=place, standard_error=error, low=place - half, high=place + half)
