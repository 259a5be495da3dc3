"""Tests of a preference that hold for other motions too (Clark 1973): answers in, p-values and intervals out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from study.analysis import estimates
from study.analysis.crossed import FEWEST_MOTIONS, crossed

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class BothVary:
    """The share with an error that lets participants and motions vary, by Student's t; see `crossed`."""

    percent: float
    standard_error: float
    low: float
    high: float
    t: float
    degrees_of_freedom: float
    p_value: float


@dataclass(frozen=True)
class MotionsAsSample:
    """The test that takes participants and motions for samples; `note` says why it can't be given."""

    both: BothVary | None
    note: str


def motions_as_sample(part: pd.DataFrame, confidence: float = 0.95) -> MotionsAsSample:
    """Test the preference with the motions as a sample of all motions that could have been shown.

    Parameters
    ----------
    part
        Columns `participant`, `motion`, `chose_a` (0, 1, or one half for a tie).
    """
    if "motion" not in part.columns or part["motion"].nunique() < 2:
        return MotionsAsSample(None, "fewer than two motions: they can't represent other motions")
    if part["motion"].astype(str).nunique() < FEWEST_MOTIONS:
        return MotionsAsSample(None, "fewer than three motions: how far motions differ is not known")
    return MotionsAsSample(*_both_vary(part, confidence))


def _both_vary(part: pd.DataFrame, confidence: float) -> tuple[BothVary | None, str]:
    names = [part[column].astype(str).to_numpy() for column in ("participant", "motion")]
    groups = [np.unique(name, return_inverse=True)[1] for name in names]
    shape = tuple(int(group.max()) + 1 for group in groups)
    if min(shape) < 2:
        return None, "one participant: results do not generalise to others"
    chosen, shown = np.zeros(shape), np.zeros(shape)
    np.add.at(chosen, (groups[0], groups[1]), part["chose_a"].to_numpy(dtype=np.float64))
    np.add.at(shown, (groups[0], groups[1]), 1.0)
    found = crossed(chosen, shown)
    share, error, freedom = (float(value) for value in (found.mean, found.error, found.freedom))
    if error <= 1e-6:
        return None, "all answers are the same: there is no spread to estimate"
    half = estimates.t_quantile(confidence, freedom) * error
    return BothVary(
        percent=100 * share,
        standard_error=100 * error,
        low=100 * max(share - half, 0.0),
        high=100 * min(share + half, 1.0),
        t=(share - 0.5) / error,
        degrees_of_freedom=freedom,
        p_value=float(found.p_values()),
    ), ""
