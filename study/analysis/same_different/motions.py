"""Whether performance in a same-different task differs across motions (2004 section 5.1): answers in, tests out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from study.analysis import estimates
from study.arrays import FloatArray
from study.counting import counted

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class AcrossMotions:
    """Tests that performance is the same across motions; `note` says why one can't be given.

    The chi-square is of correct and wrong answers by motion, every answer taken as independent; F is Hotelling's test
    on the participants' own percentages correct, which asks neither independence nor equal variances.
    """

    chi_square: float | None = None
    chi_square_degrees_of_freedom: int | None = None
    chi_square_p_value: float | None = None
    f: float | None = None
    f_degrees_of_freedom: tuple[int, int] | None = None
    f_p_value: float | None = None
    note: str = ""


def across_motions(given: pd.DataFrame) -> AcrossMotions:
    """Test that performance is the same across motions."""
    if "motion" not in given.columns or given["motion"].nunique() < 2:
        return AcrossMotions(note="fewer than two motions")
    correct = ((given["answer"] == "different") == (given["difference_frames"] != 0)).astype(float)
    motion = given["motion"].astype(str)
    found = _pooled_chi_square(correct.groupby(motion).sum(), correct.groupby(motion).size())
    shares = correct.groupby([given["participant"].astype(str), motion]).mean().unstack().dropna()
    return _with_hotelling(found, shares.to_numpy(dtype=np.float64))


def _pooled_chi_square(right: pd.Series[float], shown: pd.Series[int]) -> AcrossMotions:
    yes, total = right.to_numpy(dtype=np.float64), shown.to_numpy(dtype=np.float64)
    share, freedom = yes.sum() / total.sum(), len(yes) - 1
    if share in (0.0, 1.0):
        return AcrossMotions()
    statistic = float(((yes - total * share) ** 2 / (total * share * (1 - share))).sum())
    return AcrossMotions(statistic, freedom, estimates.chi_square_probability(statistic, freedom))


def _with_hotelling(found: AcrossMotions, shares: FloatArray) -> AcrossMotions:
    """Hotelling's one-sample test that all columns have one mean; rows are participants."""
    count, motions = shares.shape
    contrasts = shares[:, 1:] - shares[:, :1]
    size = motions - 1
    if count <= size + 1:
        who = counted(count, "participant is", "participants are")
        return replace(found, note=f"{who} too few for a test across {counted(motions, 'motion')}")
    spread = np.atleast_2d(np.cov(contrasts, rowvar=False))
    if np.linalg.matrix_rank(spread, tol=1e-9) < size:
        return replace(found, note="participants' differences between motions do not vary enough for a test")
    mean = contrasts.mean(axis=0)
    squared = count * float(mean @ np.linalg.solve(spread, mean))
    statistic = squared * (count - size) / (size * (count - 1))
    probability = estimates.f_probability(statistic, size, count - size)
    return replace(found, f=statistic, f_degrees_of_freedom=(size, count - size), f_p_value=probability)
