"""Whether the order of presentation matters in a same-different task: answers in, a test out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from study.analysis import estimates

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class OrderTest:
    """Test that a pair is answered alike in both orders; `note` says why something can't be given.

    `difference_percent`, with interval and t over participants, is the share "different" where the reference came first
    less where second, mean over levels.
    """

    difference_percent: float | None = None
    low: float | None = None
    high: float | None = None
    t: float | None = None
    degrees_of_freedom: float | None = None
    p_value: float | None = None
    note: str = ""


def order_test(given: pd.DataFrame) -> OrderTest:
    """Test that a pair is answered alike in both orders, as differencing has it.

    Parameters
    ----------
    given
        Answers with `participant`, `difference_frames`, `reference_first`, `answer`; pairs without a difference have
        no order.
    """
    if "reference_first" not in given.columns or given["reference_first"].isna().all():
        return OrderTest(note="the order of presentation is not known")
    known = given[given["reference_first"].notna() & (given["difference_frames"] != 0)]
    different = (known["answer"] == "different").astype(float)
    first = known["reference_first"].astype(bool)
    if first.all() or not first.any():
        return OrderTest(note="every pair was shown in the same order")
    keys = [known["participant"].astype(str), known["difference_frames"], first]
    shares = different.groupby(keys).mean().unstack().dropna()
    gaps = (shares[True] - shares[False]).groupby(level=0).mean().to_numpy(dtype=np.float64)
    test = estimates.in_percent(estimates.mean_test(gaps, 0.0))
    return OrderTest(
        difference_percent=test.mean,
        low=test.low,
        high=test.high,
        t=test.t,
        degrees_of_freedom=test.degrees_of_freedom,
        p_value=test.p_value,
        note=test.note,
    )
