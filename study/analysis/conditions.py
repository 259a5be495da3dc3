"""Conditions or groups compared: estimates of each participant in each condition in, differences with intervals out.

Participants who have both conditions are compared with themselves, groups of other participants by Welch's t; of one
participant alone the estimates' own errors count.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from study.analysis import estimates
from study.analysis.estimates import MeanTest, mean_test
from study.analysis.headline import Headline, headline_of, holds_for

if TYPE_CHECKING:
    import pandas as pd

WITHIN, BETWEEN, ALONE = "Student's t within participants", "Welch's t between groups", "normal, of one participant"
SLOPE = "logarithm of slope"
_NUMBERS = ("value", "error")


@dataclass(frozen=True)
class OwnEstimate:
    """An estimate of one participant in one condition; its standard error is None where it is not known."""

    participant: str
    condition: str
    quantity: str
    """`threshold`, or another of the same unit, and `SLOPE`."""
    value: float
    error: float | None


@dataclass(frozen=True)
class ConditionDifference(MeanTest):
    """How much more a quantity is in one condition than in another; `holm_p_value` is adjusted over pairs."""

    quantity: str
    of: str
    test: str
    holm_p_value: float | None = None

    def in_words(self) -> str:
        """Return the difference in a clause; of slopes, their ratio."""
        ratio = self.quantity.startswith(SLOPE)
        ends = [end for end in (self.mean, self.low, self.high) if end is not None]
        told = [math.exp(end) for end in ends] if ratio else ends
        name = self.quantity.replace(SLOPE, "slope") + (", times" if ratio else "")
        if self.p_value is None or len(told) < 3:
            return f"{name}: {self.note}"
        return f"{name} {told[0]:.3g} ({told[1]:.3g} to {told[2]:.3g}), p = {self.holm_p_value:.3g}"


def compare_conditions(own: Iterable[OwnEstimate], confidence: float = 0.95) -> tuple[ConditionDifference, ...]:
    """Return the difference of each two conditions in each quantity, p-values adjusted by Holm's method."""
    import pandas as pd

    table = pd.DataFrame([vars(one) for one in own], columns=["participant", "condition", "quantity", "value", "error"])
    found = []
    for quantity, part in table.groupby("quantity", sort=False):
        values, errors = (part.pivot(index="participant", columns="condition", values=name) for name in _NUMBERS)
        rows = [
            _difference(str(quantity), values, errors.astype(float), one, other, confidence)
            for one, other in combinations(sorted(part["condition"].unique()), 2)
        ]
        adjusted = estimates.holm([row.p_value for row in rows])
        found += [replace(row, holm_p_value=p) for row, p in zip(rows, adjusted, strict=True)]
    return tuple(found)


def _difference(
    quantity: str, values: pd.DataFrame, errors: pd.DataFrame, one: str, other: str, confidence: float
) -> ConditionDifference:
    apart = (values[other] - values[one]).dropna()
    if len(apart) == 1 and values[one].count() == values[other].count() == 1:
        error = float(np.hypot(errors[one].loc[apart.index[0]], errors[other].loc[apart.index[0]]))
        found, test = _normal(float(apart.iloc[0]), error, confidence), ALONE
    elif len(apart) > 0:
        found, test = mean_test(apart, 0.0, confidence), WITHIN
    else:
        found, test = _welch(values[one].dropna(), values[other].dropna(), confidence), BETWEEN
    return ConditionDifference(**vars(found), quantity=quantity, of=f"{other} minus {one}", test=test)


def _normal(apart: float, error: float, confidence: float) -> MeanTest:
    if not error > 0:
        return MeanTest(1, apart, None, None, None, "the error of an estimate is not known", None, None, None)
    half = estimates.normal_quantile(confidence) * error
    p_value = estimates.chi_square_probability((apart / error) ** 2, 1)
    return MeanTest(1, apart, error, apart - half, apart + half, "", apart / error, None, p_value)


def _welch(one: pd.Series[float], other: pd.Series[float], confidence: float) -> MeanTest:
    count, apart = len(one) + len(other), float(other.mean() - one.mean())
    if min(len(one), len(other)) < 2:
        return MeanTest(count, None, None, None, None, "fewer than two participants in a group", None, None, None)
    parts = [float(group.var(ddof=1)) / len(group) for group in (one, other)]
    error = math.sqrt(sum(parts))
    if error <= 1e-12:
        return MeanTest(count, apart, 0.0, None, None, "participants of a group do not vary", None, None, None)
    freedom = sum(parts) ** 2 / sum(part**2 / (len(group) - 1) for part, group in zip(parts, (one, other), strict=True))
    half, p_value = estimates.t_quantile(confidence, freedom) * error, estimates.t_probability(apart / error, freedom)
    return MeanTest(count, apart, error, apart - half, apart + half, "", apart / error, freedom, p_value)


def headlines_of(differences: Iterable[ConditionDifference], study: str, confidence: float) -> list[Headline]:
    """Return a headline for each difference."""
    return [
        headline_of(one, study, f"{one.of}: {one.in_words()}.", f"{one.quantity}, {one.of}", confidence, test=one.test,
                    generalises_to=holds_for(one.participants), adjusted=one.holm_p_value)
        for one in differences
    ]  # fmt: skip
