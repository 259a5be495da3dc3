"""What a group's answers say, by several models side by side: answers in, estimates and how they differ out.

A mixed model speaks of a typical participant; generalised estimating equations (GEE) and percentages speak of the
population's mean, which lies nearer to one half where participants differ. Both respect that answers of one
participant belong together.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.analysis import estimates
from study.analysis.regression.estimating_equations import estimating_equations
from study.analysis.regression.mixed import Link, MixedFit, fit_mixed, marginal_share
from study.analysis.regression.random_effects import LARGEST_EFFECT, LARGEST_ERROR
from study.counting import counted
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]

FEWEST_FOR_GEE = 4
NO_ORDER = "without a term for the order of presentation, which is not known or never changed"


def preference_models(part: pd.DataFrame, confidence: float = 0.95) -> dict[str, Any]:
    """Return the logistic mixed model and the GEE of one pair of methods, each with a term for the order.

    Parameters
    ----------
    part
        Columns `participant`, `chose_a` (0 or 1), and `a_first` where it is known.

    Returns
    -------
    dict
        `mixed` and `gee`: `percent`, `low`, `high` (favouring the first method, order balanced), `p_value`,
        `order_logit`, `order_p_value`, `note`; `mixed` also has `participants_spread` (logits), `population_percent`
        (over participants, not of a typical one). `differ`: a sentence on how the two differ.
    """
    order = _order(part)
    design = np.column_stack([np.ones(len(part)), order]) if order is not None else np.ones((len(part), 1))
    chosen = part["chose_a"].to_numpy(dtype=np.float64)
    who = part["participant"].astype(str).to_numpy()
    mixed = _mixed(design, chosen, who, confidence)
    gee = _gee(design, chosen, who, confidence)
    if order is None:
        for model in (mixed, gee):
            model["note"] = "; ".join(filter(None, (model["note"], NO_ORDER)))
    return {"mixed": mixed, "gee": gee, "differ": _differ(mixed, gee)}


def _order(part: pd.DataFrame) -> FloatArray | None:
    """One half where the first method came first, minus one half where second; None where that is not known."""
    if "a_first" not in part.columns or part["a_first"].isna().any() or part["a_first"].nunique() < 2:
        return None
    return np.where(part["a_first"].astype(bool), 0.5, -0.5)


def _mixed(design: FloatArray, chosen: FloatArray, who: NDArray[Any], confidence: float) -> dict[str, Any]:
    rows = _counted(design, chosen, who)
    names = ("preference", "order")[: design.shape[1]]
    fit = fit_mixed(rows[0], np.ones((len(rows[1]), 1)), *rows[1:], names=names, confidence=confidence)
    if isinstance(fit, str):
        return {"percent": None, "low": None, "high": None, "p_value": None, "note": fit}
    main = fit.effects[0]
    known = main.standard_error is not None
    second = fit.effects[1] if len(fit.effects) > 1 else None
    population = marginal_share(fit, [1.0, 0.0][: design.shape[1]])
    return {
        "percent": _percent(main.value) if known else None,
        "low": _percent(main.interval.low),
        "high": _percent(main.interval.high),
        "p_value": main.p_value,
        "population_percent": 100 * population if known else None,
        "participants_spread": fit.spread[0],
        "order_logit": second.value if second else None,
        "order_p_value": second.p_value if second else None,
        "note": fit.note,
    }


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


def _gee(design: FloatArray, chosen: FloatArray, who: NDArray[Any], confidence: float) -> dict[str, Any]:
    """Population mean by GEE, exchangeable within participants, with the covariance corrected for few of them."""
    people = len(set(who))
    nothing = {"percent": None, "low": None, "high": None, "p_value": None, "order_logit": None, "order_p_value": None}
    if people < FEWEST_FOR_GEE:
        return {
            **nothing,
            "note": f"{counted(people, 'participant is', 'participants are')} too few for estimating equations",
        }
    if chosen.min() == chosen.max():
        return {**nothing, "note": "all answers alike: effects can't be estimated"}
    too_alike = {**nothing, "note": "the answers vary too little between participants for estimating equations"}
    try:
        found = estimating_equations(design, chosen, who)
    except AnalysisError:
        return too_alike
    values, errors = found.values, found.errors
    if not (np.isfinite(values).all() and np.isfinite(errors).all()) or (errors <= 1e-9).any():
        return too_alike
    if (np.abs(values) >= LARGEST_EFFECT).any() or (errors > LARGEST_ERROR).any():
        return {**nothing, "note": "the answers separate, or nearly so: effects can't be estimated by these equations"}
    times = estimates.t_quantile(confidence, people - 1)
    tests = [estimates.t_probability(float(v / e), people - 1) for v, e in zip(values, errors, strict=True)]
    return {
        "percent": _percent(float(values[0])),
        "low": _percent(float(values[0] - times * errors[0])),
        "high": _percent(float(values[0] + times * errors[0])),
        "p_value": tests[0],
        "order_logit": float(values[1]) if len(values) > 1 else None,
        "order_p_value": tests[1] if len(values) > 1 else None,
        "note": "",
    }


def _differ(mixed: dict[str, Any], gee: dict[str, Any]) -> str:
    if mixed["percent"] is None or gee["percent"] is None:
        return ""
    if mixed["participants_spread"] < 0.1:
        return "Participants hardly differ, so a typical participant and the population's mean are the same."
    return (
        f"A typical participant favours the first method in {mixed['percent']:.1f}% (mixed model); over the population "
        f"the mean is {gee['percent']:.1f}% (estimating equations), nearer to one half because participants differ by "
        f"{mixed['participants_spread']:.2f} logits."
    )


def psychometric_mixed(
    trials: pd.DataFrame,
    *,
    link: Link = "probit",
    guess: float = 0.0,
    lapse: float = 0.0,
    confidence: float = 0.95,
) -> dict[str, Any]:
    """Return the threshold of a typical participant: random intercept and slope over participants.

    Parameters
    ----------
    trials
        Columns `participant`, `level`, `yes`, `shown`.
    link, guess, lapse
        The curve; one half is guessed in 2AFC.

    Returns
    -------
    dict
        `threshold` (where the curve is half way), `standard_error`, `low`, `high` (delta method, Student's t),
        `slope`, `intercept_spread`, `slope_spread`, `correlation`, `participants`, `note`.
    """
    levels = trials["level"].to_numpy(dtype=np.float64)
    yes, shown = trials["yes"].to_numpy(dtype=np.float64), trials["shown"].to_numpy(dtype=np.float64)
    nothing = dict.fromkeys(("threshold", "standard_error", "low", "high", "slope", "intercept_spread", "slope_spread"))
    centre, unit = float(levels.mean()), float(levels.std())
    if unit == 0:
        return {**nothing, "note": "one level only"}
    design = np.column_stack([np.ones(len(levels)), (levels - centre) / unit])
    who = trials["participant"].astype(str).to_numpy()
    fit = fit_mixed(design, design, yes, shown, who, link=link, guess=guess, lapse=lapse, confidence=confidence)
    if isinstance(fit, str):
        return {**nothing, "note": fit}
    return {**nothing, **_threshold(fit, centre, unit, confidence), "participants": fit.participants}


def _threshold(fit: MixedFit, centre: float, unit: float, confidence: float) -> dict[str, Any]:
    intercept, slope = fit.effects[0].value, fit.effects[1].value
    shape = {
        "intercept_spread": fit.spread[0],
        "slope_spread": fit.spread[1] / unit,
        "correlation": fit.correlation,
        "slope": slope / unit,
    }
    if slope <= 0 or fit.effects[1].standard_error is None or not np.isfinite(fit.covariance).all():
        return {**shape, "note": fit.note or "the answers do not rise with the level: no threshold"}
    gradient = np.array([-1 / slope, intercept / slope**2])
    error = unit * math.sqrt(max(float(gradient @ fit.covariance @ gradient), 0.0))
    place = centre - unit * intercept / slope
    half = estimates.t_quantile(confidence, fit.participants - 1) * error
    return {
        **shape,
        "threshold": place,
        "standard_error": error,
        "low": place - half,
        "high": place + half,
        "note": fit.note,
    }
