"""Whether the order of presentation matters in a same-different task: answers in, shares by order and tests out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from study.analysis import estimates

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class OrderShare:
    """Percent "different", at pairs with a difference, where the reference came first or second."""

    reference_first: bool
    answers: int
    percent: float


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
    degrees_of_freedom: int | None = None
    p_value: float | None = None
    note: str = ""


def shares_by_order(given: pd.DataFrame) -> tuple[OrderShare, ...]:
    """Return the share of "different" where the reference came first and where it came second.

    Under the differencing rule the order does not matter; a gap points to a drift between first and second, or to
    another rule.
    """
    if "reference_first" not in given.columns:
        return ()
    known = given[given["reference_first"].notna() & (given["difference_frames"] != 0)]
    return tuple(
        OrderShare(bool(first), len(part), 100 * int((part["answer"] == "different").sum()) / len(part))
        for first, part in known.groupby(known["reference_first"].astype(bool), sort=True)
    )


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
