"""What a group's answers say, by several models side by side: answers in, estimates and how they differ out.

A mixed model speaks of a typical participant; generalised estimating equations (GEE) and percentages speak of the
population's mean, which lies nearer to one half where participants differ. Both respect that answers of one
participant belong together.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.analysis import estimates
from study.analysis.regression.estimating_equations import estimating_equations
from study.analysis.regression.mixed import fit_mixed, marginal_share
from study.analysis.regression.random_effects import LARGEST_EFFECT, LARGEST_ERROR
from study.counting import counted
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]

FEWEST_FOR_GEE = 4
NO_ORDER = "without a term for the order of presentation, which is not known or never changed"


@dataclass(frozen=True)
class GroupModel:
    """What a model says of the group: percent for the first method, orders balanced, and what coming first adds."""

    percent: float | None = None
    low: float | None = None
    high: float | None = None
    p_value: float | None = None
    order_logit: float | None = None
    order_p_value: float | None = None
    note: str = ""


@dataclass(frozen=True)
class TypicalModel(GroupModel):
    """A mixed model: a typical participant, and the mean over participants who differ by so many logits."""

    population_percent: float | None = None
    participants_spread: float | None = None


@dataclass(frozen=True)
class PreferenceModels:
    """The mixed model and the estimating equations side by side, and a sentence on how the two differ."""

    mixed: TypicalModel
    gee: GroupModel
    differ: str


def preference_models(part: pd.DataFrame, confidence: float = 0.95) -> PreferenceModels:
    """Return the logistic mixed model and the GEE of one pair of methods, each with a term for the order.

    Parameters
    ----------
    part
        Columns `participant`, `chose_a` (0 or 1), and `a_first` where it is known.
    """
    order = _order(part)
    design = np.column_stack([np.ones(len(part)), order]) if order is not None else np.ones((len(part), 1))
    chosen = part["chose_a"].to_numpy(dtype=np.float64)
    who = part["participant"].astype(str).to_numpy()
    mixed = _mixed(design, chosen, who, confidence)
    gee = _gee(design, chosen, who, confidence)
    if order is None:
        mixed = replace(mixed, note="; ".join(filter(None, (mixed.note, NO_ORDER))))
        gee = replace(gee, note="; ".join(filter(None, (gee.note, NO_ORDER))))
    return PreferenceModels(mixed, gee, _differ(mixed, gee))


def _order(part: pd.DataFrame) -> FloatArray | None:
    """One half where the first method came first, minus one half where second; None where that is not known."""
    if "a_first" not in part.columns or part["a_first"].isna().any() or part["a_first"].nunique() < 2:
        return None
    return np.where(part["a_first"].astype(bool), 0.5, -0.5)


def _mixed(design: FloatArray, chosen: FloatArray, who: NDArray[Any], confidence: float) -> TypicalModel:
    rows = _counted(design, chosen, who)
    names = ("preference", "order")[: design.shape[1]]
    fit = fit_mixed(rows[0], np.ones((len(rows[1]), 1)), *rows[1:], names=names, confidence=confidence)
    if isinstance(fit, str):
        return TypicalModel(note=fit)
    main = fit.effects[0]
    known = main.standard_error is not None
    second = fit.effects[1] if len(fit.effects) > 1 else None
    population = marginal_share(fit, [1.0, 0.0][: design.shape[1]])
    return TypicalModel(
        percent=_percent(main.value) if known else None,
        low=_percent(main.interval.low),
        high=_percent(main.interval.high),
        p_value=main.p_value,
        order_logit=second.value if second else None,
        order_p_value=second.p_value if second else None,
        note=fit.note,
        population_percent=100 * population if known else None,
        participants_spread=fit.spread[0],
    )


def _counted(
    design: FloatArray, chosen: FloatArray, who: NDArray[Any]
) -> tuple[FloatArray, FloatArray, FloatArray, NDArray[Any]]:
    """Answers of one participant in one order put together."""
    last = design[:, -1]
    people, person = np.unique(who, return_inverse=True)
    _, key = np.unique(np.column_stack([person, last]), axis=0, return_inverse=True)
    key = key.ravel()
    first = np.array([int(np.flatnonzero(key == cell)[0]) for cell in range(int(key.max()) + 1)])
    yes, shown = np.bincount(key, chosen).astype(np.float64), np.bincount(key).astype(np.float64)
    return np.asarray(design[first]), yes, shown, np.asarray(people[person[first]])


def _percent(logit: float | None) -> float | None:
    from scipy.special import expit

    return None if logit is None else 100 * float(expit(logit))


def _gee(design: FloatArray, chosen: FloatArray, who: NDArray[Any], confidence: float) -> GroupModel:
    """Population mean by GEE, exchangeable within participants, with the covariance corrected for few of them."""
    people = len(set(who))
    if people < FEWEST_FOR_GEE:
        few = counted(people, "participant is", "participants are")
        return GroupModel(note=f"{few} too few for estimating equations")
    if chosen.min() == chosen.max():
        return GroupModel(note="all answers are the same: effects cannot be estimated")
    too_alike = GroupModel(note="the answers vary too little between participants for estimating equations")
    try:
        found = estimating_equations(design, chosen, who)
    except AnalysisError:
        return too_alike
    values, errors = found.values, found.errors
    if not (np.isfinite(values).all() and np.isfinite(errors).all()) or (errors <= 1e-9).any():
        return too_alike
    if (np.abs(values) >= LARGEST_EFFECT).any() or (errors > LARGEST_ERROR).any():
        return GroupModel(note="the answers separate, or nearly so: effects can't be estimated by these equations")
    times = estimates.t_quantile(confidence, people - 1)
    tests = [estimates.t_probability(float(v / e), people - 1) for v, e in zip(values, errors, strict=True)]
    return GroupModel(
        percent=_percent(float(values[0])),
        low=_percent(float(values[0] - times * errors[0])),
        high=_percent(float(values[0] + times * errors[0])),
        p_value=tests[0],
        order_logit=float(values[1]) if len(values) > 1 else None,
        order_p_value=tests[1] if len(values) > 1 else None,
    )


def _differ(mixed: TypicalModel, gee: GroupModel) -> str:
    spread = mixed.participants_spread
    if mixed.percent is None or gee.percent is None or spread is None:
        return ""
    if spread < 0.1:
        return "Participants hardly differ, so a typical participant and the population's mean are the same."
    return (
        f"A typical participant favours the first method in {mixed.percent:.1f}% (mixed model); over the population "
        f"the mean is {gee.percent:.1f}% (estimating equations), nearer to one half because participants differ by "
        f"{spread:.2f} logits."
    )
