"""Psychometric functions of a whole study: trials of several participants in, every estimate side by side out.

Each participant's own function, the function of all answers taken as one person's, and what is to be believed of the
group, since answers of one participant are not independent of each other.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.analysis import estimates
from study.analysis.preference.models import psychometric_mixed
from study.analysis.psychometric.likelihood import LikelihoodFit, fit_likelihood
from study.analysis.psychometric.posterior import (
    Estimate,
    Model,
    PsychometricFit,
    curve_of,
    fit_psychometric,
    make_model,
)
from study.analysis.regression.mixed import Link
from study.counting import counted, noun

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]

NEEDED_COLUMNS = ("participant", "level", "yes", "shown")
LINKS_OF: dict[str, Link] = {"normal": "probit", "logistic": "logit"}


def analyse_psychometric(
    trials: pd.DataFrame, model: Model | None = None, *, confidence: float = 0.95, simulations: int = 0
) -> dict[str, Any]:
    """Analyse one 2AFC or yes-no study.

    Parameters
    ----------
    trials
        Columns `participant`, `level`, `yes`, `shown`.
    model
        From `psychometric.make_model`; 2AFC unless given.
    confidence
        Of the intervals.
    simulations
        Data sets drawn for the p-value of the deviance of the pooled fit; 0 takes chi-square.

    Returns
    -------
    dict
        JSON-able: `confidence`, `participants` (one fit each), `pooled` (all answers as one person's), `likelihood`
        (maximum, profile interval and deviance of the same), `group` (mean over participants of their thresholds, with
        Student's interval), `mixed` (threshold of a typical participant by a mixed model; None for one participant),
        `mixed_note` (why it can't be had), `levels` (answers by level), `answer` (a sentence).

    Raises
    ------
    AnalysisError
        When a column is missing, or a count can't be.
    """
    estimates.check_columns(trials, NEEDED_COLUMNS, "a psychometric function")
    estimates.check_participants(trials)
    chosen = model or make_model()
    own = []
    for name, part in trials.groupby(trials["participant"].astype(str), sort=True):
        own.append({"participant": str(name), "answers": int(part["shown"].sum()), **_one(part, chosen, confidence)})
    levels, yes, shown = (trials[column].to_numpy(dtype=np.float64) for column in ("level", "yes", "shown"))
    best = fit_likelihood(levels, yes, shown, chosen, confidence=confidence, simulations=simulations)
    pooled = _one(trials, chosen, confidence)
    mixed = _typical(trials, chosen, best, confidence)
    result: dict[str, Any] = {
        "confidence": confidence,
        "participants": own,
        "pooled": pooled,
        "likelihood": {"note": best} if isinstance(best, str) else estimates.plain(best),
        "group": _group(own, chosen, confidence),
        "mixed": None if isinstance(mixed, str) else mixed,
        "mixed_note": mixed if isinstance(mixed, str) else mixed["note"],
        "levels": _by_level(trials),
    }
    return {**dict(estimates.plain(result)), "answer": _in_words(result)}


def _one(part: pd.DataFrame, model: Model, confidence: float) -> dict[str, Any]:
    levels, yes, shown = (part[column].to_numpy(dtype=np.float64) for column in ("level", "yes", "shown"))
    fit = fit_psychometric(levels, yes, shown, model, confidence=confidence)
    if isinstance(fit, str):
        return {"threshold": None, "note": fit}
    return describe(fit)


def describe(fit: PsychometricFit) -> dict[str, Any]:
    """Return a fit as plain numbers, without the grid."""
    parts = ("threshold", "width", "lapse", "guess", "overdispersion")
    estimated: dict[str, Estimate] = {name: getattr(fit, name) for name in parts}
    return {
        **{name: estimates.plain(value) for name, value in estimated.items()},
        "sigmoid": fit.model.sigmoid.name,
        "curve": curve_of(fit),
        "note": fit.note,
    }


def _typical(trials: pd.DataFrame, model: Model, best: LikelihoodFit | str, confidence: float) -> dict[str, Any] | str:
    """The threshold of a typical participant, rates held at those of all answers; or why there is none."""
    if isinstance(best, str):
        return best
    if trials["participant"].nunique() < 2:
        return "one participant: nothing can be said about others"
    if model.sigmoid.name not in LINKS_OF:
        return f"mixed models are fitted with the sigmoids {' and '.join(LINKS_OF)} only"
    link = LINKS_OF[model.sigmoid.name]
    found = psychometric_mixed(trials, link=link, guess=best.guess, lapse=best.lapse, confidence=confidence)
    shown = trials.loc[trials["shown"] > 0, "level"]
    if found["threshold"] is None or shown.min() <= found["threshold"] <= shown.max():
        return found
    note = f"outside the levels shown ({shown.min():g} to {shown.max():g})"
    return {**found, "threshold": None, "note": "; ".join(filter(None, (note, found["note"])))}


def _group(own: list[dict[str, Any]], model: Model, confidence: float) -> dict[str, Any]:
    """The mean over participants of their own thresholds; of the logarithms for Weibull."""
    found = [row["threshold"]["value"] for row in own if row["threshold"] and row["threshold"]["value"] is not None]
    left_out = len(own) - len(found)
    axis = model.sigmoid.axis(np.array(found)) if found else np.zeros(0)
    test = estimates.mean_test(axis, 0.0, confidence)

    def back(value: float | None) -> float | None:
        return None if value is None else float(model.sigmoid.levels(np.array(value)))

    note = test.note
    if left_out:
        note = "; ".join(
            filter(
                None,
                (
                    note,
                    f"{left_out} of {counted(len(own), 'participant')} {noun(left_out, 'has', 'have')} no "
                    "threshold within the levels",
                ),
            )
        )
    return {
        "participants": test.participants,
        "mean_threshold": back(test.mean),
        "low": back(test.interval.low),
        "high": back(test.interval.high),
        "standard_deviation": float(axis.std(ddof=1)) if len(axis) > 1 else None,
        "note": note,
    }


def _by_level(trials: pd.DataFrame) -> list[dict[str, Any]]:
    sums = trials.groupby("level", sort=True)[["yes", "shown"]].sum()
    return [
        {
            "level": float(level),
            "yes": float(yes),
            "shown": float(shown),
            "percent": 100 * yes / shown if shown else None,
        }
        for level, yes, shown in zip(sums.index, sums["yes"], sums["shown"], strict=True)
    ]


def _in_words(result: dict[str, Any]) -> str:
    """The threshold to be believed: of a group over participants, of one participant that participant's own."""
    pooled, own, group, mixed = (result[name] for name in ("pooled", "participants", "group", "mixed"))
    if not pooled["threshold"]:
        return f"No psychometric function can be fitted: {pooled['note']}."
    if len(own) == 1:
        if pooled["threshold"]["value"] is None:
            return f"No threshold can be given: {pooled['threshold']['note']}."
        return f"The threshold is {_with_interval(pooled['threshold']['value'], **pooled['threshold']['interval'])}."
    if mixed and mixed["threshold"] is not None:
        found = _with_interval(mixed["threshold"], mixed["low"], mixed["high"], result["confidence"])
        people = counted(mixed["participants"], "participant")
        text = f"The threshold of a typical one of {people} is {found}, by a mixed model"
    elif group["mean_threshold"] is not None:
        found = _with_interval(group["mean_threshold"], group["low"], group["high"], result["confidence"])
        people = counted(group["participants"], "participant")
        text = f"The mean threshold of {people} is {found}, by Student's t over them"
    else:
        return f"No threshold of the group can be given: {group['note']}."
    if pooled["threshold"]["value"] is None:
        return f"{text}."
    found = pooled["threshold"]
    alone = _with_interval(found["value"], found["interval"]["low"], found["interval"]["high"])
    return f"{text}. All answers taken as one person's give {alone}, which is too sure where people differ."


def _with_interval(value: float, low: float | None, high: float | None, confidence: float | None = None) -> str:
    """A number and its interval; open ends are said."""
    ends = f"{'open' if low is None else format(low, '.4g')} to {'open' if high is None else format(high, '.4g')}"
    return f"{value:.4g} ({f'{100 * confidence:g}% interval ' if confidence else ''}{ends})"
