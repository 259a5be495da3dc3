"""Tests of a preference that hold for other motions too: answers in, p-values and intervals out.

Clark 1973 asks for tests that take the motions for a sample; where participants vary with them, the variance is that of
Cameron, Gelbach & Miller 2011.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from study.analysis import estimates

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ByMotion:
    """One share a motion against one half, by Student's t; it takes the participants as they are."""

    motions: int
    mean_percent: float
    low: float | None
    high: float | None
    t: float | None
    degrees_of_freedom: int | None
    p_value: float | None


@dataclass(frozen=True)
class BothVary:
    """The pooled share with a variance that lets participants and motions vary, by Student's t.

    The degrees of freedom are the smaller number of participants and motions, less one.
    """

    percent: float
    standard_error: float
    low: float
    high: float
    t: float
    degrees_of_freedom: int
    p_value: float


@dataclass(frozen=True)
class MotionsAsSample:
    """Tests that take the motions for a sample; `note` says why something can't be given."""

    by_motion: ByMotion | None
    both: BothVary | None
    note: str


def motions_as_sample(part: pd.DataFrame, confidence: float = 0.95) -> MotionsAsSample:
    """Test the preference with the motions as a sample of all motions that could have been shown.

    Parameters
    ----------
    part
        Columns `participant`, `motion`, `chose_a` (0, 1, or one half for a tie).

    Notes
    -----
    A mixed model with crossed random effects would rest its intervals on a normal approximation over as few motions as
    there are (8 in 2004), so it is not used. The variance in `both` is that of sums over participants, plus that over
    motions, less that of single answers, each corrected for its number of groups; never below the last, so that the
    test errs too seldom rather than too often where neither participants nor motions differ.
    """
    if "motion" not in part.columns or part["motion"].nunique() < 2:
        return MotionsAsSample(None, None, "fewer than two motions: they can't represent other motions")
    shares = part.groupby(part["motion"].astype(str))["chose_a"].mean().to_numpy(dtype=np.float64)
    test = estimates.in_percent(estimates.mean_test(shares, 0.5, confidence))
    by_motion = ByMotion(
        motions=test.participants,
        mean_percent=100 * float(shares.mean()),
        low=None if test.low is None else max(test.low, 0.0),
        high=None if test.high is None else min(test.high, 100.0),
        t=test.t,
        degrees_of_freedom=test.degrees_of_freedom,
        p_value=test.p_value,
    )
    both, note = _both_vary(part, confidence)
    return MotionsAsSample(by_motion, both, note or test.note.replace("participants", "motions"))


def _both_vary(part: pd.DataFrame, confidence: float) -> tuple[BothVary | None, str]:
    chosen = part["chose_a"].to_numpy(dtype=np.float64)
    names = [part[column].astype(str).to_numpy() for column in ("participant", "motion")]
    groups = [np.unique(name, return_inverse=True)[1] for name in names]
    fewest = min(int(group.max()) + 1 for group in groups)
    if fewest < 2:
        return None, "one participant: results do not generalise to others"
    cells = np.unique(np.column_stack(groups), axis=0, return_inverse=True)[1].ravel()
    apart = chosen - chosen.mean()
    variances = [_variance_of_sums(apart, group) for group in groups]
    # Answers of one participant to one motion count in both sums, and so once too often; by themselves they are the
    # least that there can be.
    single = float((np.bincount(cells, apart) ** 2).sum()) / len(chosen) ** 2
    variance = max(sum(variances) - single, single)
    if variance <= 1e-12:
        return None, "all answers are the same: there is no spread to estimate"
    error, mean = math.sqrt(variance), float(chosen.mean())
    half = estimates.t_quantile(confidence, fewest - 1) * error
    found = BothVary(
        percent=100 * mean,
        standard_error=100 * error,
        low=100 * max(mean - half, 0.0),
        high=100 * min(mean + half, 1.0),
        t=(mean - 0.5) / error,
        degrees_of_freedom=fewest - 1,
        p_value=estimates.t_probability((mean - 0.5) / error, fewest - 1),
    )
    return found, ""


def _variance_of_sums(apart: FloatArray, group: NDArray[np.intp]) -> float:
    count = int(group.max()) + 1
    return float((np.bincount(group, apart) ** 2).sum()) * count / (count - 1) / len(apart) ** 2
