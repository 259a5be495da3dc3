"""Ratings of several methods compared: answers of a rating task in, tests of every question out.

As published (2003 section 4.2): a 2 x 2 analysis of variance between subjects, method by order of presentation. It
takes the ratings of one participant for independent. Beside it stand tests that do not: the difference over
participants, the mixed design with participants as random, ranks, and an ordinal model that takes the points of a scale
for no more than ordered.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from study.analysis import estimates
from study.analysis.anova import two_way
from study.analysis.ordinal import OrdinalFit, fit_ordinal
from study.analysis.rank_tests import anova_type, friedman, signed_rank
from study.analysis.ratings import rated
from study.analysis.repeated_measures import likeness, mixed_design
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]


def rating_anova(answers: pd.DataFrame, confidence: float = 0.95, *, models: bool = True) -> list[dict[str, Any]]:
    """Analyse each question of a rating study by method and by order of presentation.

    Parameters
    ----------
    answers
        Answers of one rating study: `participant`, `method_a`, `answer`, `trial`, and `item` where there are several
        questions. The order is the method that a participant saw first.
    confidence
        Of intervals; of effect sizes they are of 1 - 2 alpha (see `effect_sizes`).
    models
        Whether to fit the ordinal model too, which takes longer.

    Returns
    -------
    list of dict
        One entry a question: `item`, `participants`, `answers`, `anova` (see `two_way`, type III; empty where it can't
        be had), `balanced` (whether all combinations have as many answers), `type_ii` (the same by type II where they
        have not, else None), `difference` (of each participant's mean ratings, where there are two methods: `of`,
        `mean`, `low`, `high`, `t`, `degrees_of_freedom`, `p_value`), `mixed_design` (`effects`, `participants`,
        `left_out`, `factors`, `intraclass_correlation` with what that does to the published test, `note`), `ranks`
        (`between`, `participants`, `note`), `ordinal` (`effects`, `spread`, `likelihood_ratio`, `degrees_of_freedom`,
        `p_value`, `note`; None without models), `note`.

    Raises
    ------
    AnalysisError
        When an answer is not a number.
    """
    part = rated(answers)
    if part.empty or "method_a" not in part.columns or part["method_a"].nunique() < 2:
        return []
    shown = answers.sort_values("trial", kind="stable") if "trial" in answers.columns else answers
    first_seen = shown.groupby(shown["participant"].astype(str))["method_a"].first().astype(str)
    part["participant"], part["method_a"] = part["participant"].astype(str), part["method_a"].astype(str)
    part["order"] = part["participant"].map(first_seen) + " first"
    return [
        dict(estimates.plain(_question(str(name), group, confidence, models)))
        for name, group in part.groupby("item", sort=False)
    ]


def _question(name: str, part: pd.DataFrame, confidence: float, models: bool) -> dict[str, Any]:
    table, type_ii, note = _as_published(part, 1 - confidence)
    return {
        "item": name,
        "participants": int(part["participant"].nunique()),
        "answers": len(part),
        "anova": table,
        "balanced": bool(part.groupby(["method_a", "order"]).size().nunique() == 1),
        "type_ii": type_ii,
        "difference": _difference(part, confidence),
        "mixed_design": _mixed_design(part, 1 - confidence),
        "ranks": _ranks(part),
        "ordinal": _ordinal(part, confidence) if models else None,
        "note": note,
    }


def _as_published(part: pd.DataFrame, alpha: float) -> tuple[list[dict[str, Any]], list[dict[str, Any]] | None, str]:
    """The analysis of variance between subjects by type III, by type II where that differs, and why not."""
    factors = (part["rating"], part["method_a"], part["order"], ("method", "order"))
    try:
        table = two_way(*factors, alpha=alpha)
    except AnalysisError as error:
        return [], None, f"no analysis of variance: {error}"
    uneven = part.groupby(["method_a", "order"]).size().nunique() > 1
    return table, two_way(*factors, squares="II", alpha=alpha) if uneven else None, ""


def _means(part: pd.DataFrame) -> pd.DataFrame:
    """Each participant's mean rating of each method, NaN where there is none."""
    return part.groupby(["participant", "method_a"])["rating"].mean().unstack()


def _difference(part: pd.DataFrame, confidence: float) -> dict[str, Any] | None:
    """The difference of the two methods over participants; None where there are not two."""
    methods = sorted(part["method_a"].unique())
    if len(methods) != 2:
        return None
    means = _means(part)
    apart = (means[methods[1]] - means[methods[0]]).dropna().to_numpy(dtype=np.float64)
    test = estimates.mean_test(apart, 0.0, confidence)
    return {
        "of": f"{methods[1]} minus {methods[0]}",
        "mean": test.mean,
        "low": test.interval.low,
        "high": test.interval.high,
        "t": test.statistic,
        "degrees_of_freedom": test.degrees_of_freedom,
        "p_value": test.p_value,
    }


def _mixed_design(part: pd.DataFrame, alpha: float) -> dict[str, Any]:
    """Participants as random: method (and motion, where everybody rated each motion by each method) within them."""
    people = part["participant"].nunique()
    values, who, factors = _complete(part, people)
    group = part.drop_duplicates("participant").set_index("participant")["order"]
    found = (
        mixed_design(values, group[who].to_numpy(), factors, between="order", alpha=alpha)
        if len(who)
        else "no participant rated every method"
    )
    return {
        "effects": [] if isinstance(found, str) else found,
        **likeness(values, group[who].to_numpy()),
        "factors": factors,
        "participants": len(who),
        "left_out": people - len(who),
        "note": found if isinstance(found, str) else "",
    }


def _complete(part: pd.DataFrame, people: int) -> tuple[FloatArray, list[str], tuple[str, ...]]:
    """Values of those who rated every combination, who they are, and what varies within them.

    Motions are a factor only where that costs no participant who rated every method.
    """
    wide = _means(part).dropna()
    if "motion" in part.columns and part["motion"].nunique() > 1:
        cells = part.groupby(["participant", "method_a", "motion"])["rating"].mean().unstack([1, 2])
        cells = cells.sort_index(axis=1).dropna()
        levels = part["method_a"].nunique(), part["motion"].nunique()
        if len(cells) == min(people, len(wide)) and cells.shape[1] == levels[0] * levels[1]:
            return cells.to_numpy(dtype=np.float64).reshape(-1, *levels), list(cells.index), ("method", "motion")
    return wide.to_numpy(dtype=np.float64), list(wide.index), ("method",)


def _ranks(part: pd.DataFrame) -> dict[str, Any]:
    """The published design on ranks, and the methods over participants on ranks."""
    methods, orders = sorted(part["method_a"].unique()), sorted(part["order"].unique())
    between: list[dict[str, Any]] | str = "fewer than two orders, or more than two of either: no 2 x 2 design"
    if len(methods) == len(orders) == 2:
        first = (part["method_a"] == methods[1]).to_numpy(dtype=int)
        second = (part["order"] == orders[1]).to_numpy(dtype=int)
        a, b = np.array([-1.0, -1, 1, 1]), np.array([-1.0, 1, -1, 1])
        contrasts = {"method": a[None], "order": b[None], "method x order": (a * b)[None]}
        cells = 2 * first + second
        counted = np.bincount(cells, minlength=4)
        between = (
            anova_type(part["rating"], cells, contrasts)
            if counted.min() > 0
            else "a combination of method and order has no answers"
        )
    note = between if isinstance(between, str) else ""
    return {
        "between": [] if isinstance(between, str) else between,
        "participants": _ranks_over_participants(part),
        "note": note,
    }


def _ranks_over_participants(part: pd.DataFrame) -> dict[str, Any] | None:
    wide = _means(part).dropna()
    if len(wide) < 2:
        return None
    if wide.shape[1] == 2:
        apart = wide.iloc[:, 1] - wide.iloc[:, 0]
        p_value = signed_rank(apart)
        return None if p_value is None else {"test": "Wilcoxon's signed ranks", "p_value": p_value}
    found = friedman(wide)
    return None if found is None else {"test": "Friedman's test (F by Iman and Davenport)", **found}


def _ordinal(part: pd.DataFrame, confidence: float) -> dict[str, Any]:
    """Cumulative-link mixed model: methods beside the first by name, and the place where each was shown once."""
    methods = sorted(part["method_a"].unique())
    columns = [(part["method_a"] == method).to_numpy(dtype=np.float64) for method in methods[1:]]
    names = [f"{method} over {methods[0]}" for method in methods[1:]]
    if not columns:
        return {"effects": [], "p_value": None, "note": "one method: nothing to compare"}
    place = _shown_later(part)
    shared = [place] if place is not None else []
    design = np.column_stack([*columns, *shared])
    who = part["participant"].to_numpy()
    fit = fit_ordinal(design, part["rating"], who, names=[*names, "shown second"], confidence=confidence)
    if isinstance(fit, str):
        return {"effects": [], "p_value": None, "note": fit}
    people = fit.participants
    without = fit_ordinal(design[:, len(columns) :], part["rating"], who, confidence=confidence)
    ratio = 2 * (fit.log_likelihood - without.log_likelihood) if isinstance(without, OrdinalFit) else None
    return {
        "effects": [
            {**estimates.plain(effect), "odds_ratio": float(np.exp(effect.value)) if effect.standard_error else None}
            for effect in fit.effects
        ],
        "spread": fit.spread,
        "points": fit.points,
        "thresholds": fit.thresholds,
        "likelihood_ratio": None if ratio is None else max(ratio, 0.0),
        "degrees_of_freedom": len(columns),
        # The chi-square finds too much with few participants; F with participants less one, as Student's t, does not.
        "p_value": None if ratio is None else estimates.f_probability(ratio / len(columns), len(columns), people - 1),
        "note": fit.note,
    }


def _shown_later(part: pd.DataFrame) -> FloatArray | None:
    """1 for what a participant saw second of two, 0 for the first; None where that is not the design, or not known."""
    if "trial" not in part.columns or part["method_a"].nunique() != 2:
        return None
    seen = part.groupby("participant")["trial"]
    if (seen.nunique() > 2).any() or part["trial"].isna().any() or part["order"].nunique() < 2:
        return None
    starts = part["method_a"] + " first" != part["order"]
    return np.asarray(starts, dtype=np.float64)


def anova_sentences(questions: list[dict[str, Any]], alpha: float) -> list[str]:
    """Each effect of each question in words, degrees of freedom always with it, and what holds over participants."""
    found = []
    for question in questions:
        for row in question["anova"]:
            if row.get("f") is None:
                continue
            verdict = "significant" if row["p_value"] < alpha else "not significant"
            found.append(
                f"{question['item'] or 'rating'}: {row['source']} F({row['degrees_of_freedom']}, "
                f"{row['error_degrees_of_freedom']}) = {row['f']:.2f}, MS = {row['mean_square']:.2f}, "
                f"p = {row['p_value']:.3g} ({verdict} at {alpha:g})"
            )
        found += _difference_in_words(question, alpha)
    return found


def _difference_in_words(question: dict[str, Any], alpha: float) -> list[str]:
    """The difference of two methods over participants; nothing where it can't be tested."""
    test = question["difference"]
    if not test or test["p_value"] is None:
        return []
    verdict = "significant" if test["p_value"] < alpha else "not significant"
    return [
        f"{question['item'] or 'rating'}: {test['of']} over participants {test['mean']:.2f} ({test['low']:.2f} to "
        f"{test['high']:.2f}), t({test['degrees_of_freedom']}) = {test['t']:.2f}, p = {test['p_value']:.3g} "
        f"({verdict} at {alpha:g})"
    ]
