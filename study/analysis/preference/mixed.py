"""What a typical participant prefers: answers to one pair of methods in, a logistic mixed model out.

Answers of one participant belong together: each has a preference of their own, drawn from a normal distribution of
logits. A typical participant's percentage lies further from one half than the mean over participants who differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from study.analysis.regression.mixed import fit_mixed

if TYPE_CHECKING:
    import pandas as pd

NO_ORDER = "without a term for the order of presentation, which is not known or never changed"


@dataclass(frozen=True)
class MixedPreference:
    """A typical participant's percentage for the first method, orders balanced; `note` says why something is None.

    `order_logit` is what coming first adds, `participants_spread` how much participants differ, in logits.
    """

    percent: float | None = None
    low: float | None = None
    high: float | None = None
    p_value: float | None = None
    order_logit: float | None = None
    order_p_value: float | None = None
    participants_spread: float | None = None
    note: str = ""


def mixed_preference(part: pd.DataFrame, confidence: float = 0.95) -> MixedPreference:
    """Fit the logistic mixed model of one pair of methods, with a term for the order where it is known and varies.

    Parameters
    ----------
    part
        Columns `participant`, `chose_a` (0 or 1), and `a_first` where it is known.
    """
    ordered = "a_first" in part.columns and part["a_first"].notna().all() and part["a_first"].nunique() == 2
    order = np.where(part["a_first"].astype(bool), 0.5, -0.5) if ordered else np.zeros(len(part))
    counts = part["chose_a"].groupby([part["participant"].astype(str), order]).agg(["sum", "count"])
    who, place = (counts.index.get_level_values(level).to_numpy() for level in (0, 1))
    every = np.ones((len(counts), 1))
    fit = fit_mixed(
        np.column_stack([every, place.astype(np.float64)]) if ordered else every,
        every,
        counts["sum"],
        counts["count"],
        who,
        names=("preference", "order"),
        confidence=confidence,
    )
    without = "" if ordered else NO_ORDER
    if isinstance(fit, str):
        return MixedPreference(note="; ".join(filter(None, (fit, without))))
    preference, *others = fit.effects
    return MixedPreference(
        percent=_percent(preference.value) if preference.standard_error is not None else None,
        low=_percent(preference.interval.low),
        high=_percent(preference.interval.high),
        p_value=preference.p_value,
        order_logit=others[0].value if others else None,
        order_p_value=others[0].p_value if others else None,
        participants_spread=fit.spread[0],
        note="; ".join(filter(None, (fit.note, without))),
    )


def _percent(logit: float | None) -> float | None:
    from scipy.special import expit

    return None if logit is None else 100 * float(expit(logit))
