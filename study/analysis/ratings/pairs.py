"""Ratings of one method compared with another: answers of a rating task on pairs in, a table by question out.

Wang & Bodenheimer 2003, Table 2: how the optimised motion compares with the original one, from 0 (much worse) to 4
(much better), as mean and standard deviation. Participants compare the second of a pair with the first; their answers
are turned by the order of presentation, so that a score says how method b, the comparison, compares with method a, the
reference. The middle of the scale means no difference, and stays where it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from study.analysis import estimates
from study.analysis.rank_tests import NO_RANKS, signed_rank
from study.analysis.ratings.table import rated
from study.counting import counted
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

NEEDED_COLUMNS = ("participant", "answer", "method_a", "method_b", "a_first")


def of_pairs(answers: pd.DataFrame) -> bool:
    """Whether pairs were rated in a rating study, not single stimuli."""
    return "method_b" in answers.columns and bool((answers["method_b"].fillna("").astype(str) != "").any())


def pair_ratings(answers: pd.DataFrame, points: int, confidence: float = 0.95) -> list[dict[str, Any]]:
    """Analyse each question of a study in which pairs were rated.

    Parameters
    ----------
    answers
        Of one study: `participant`, `answer` (second compared with first), `method_a`, `method_b`, `a_first`, and where
        there are several `item` and `motion`.
    points
        Of the scale, which is counted from 0.
    confidence
        Of the intervals.

    Returns
    -------
    list of dict
        One entry a pair of methods and a question: `item`, `method_a`, `method_b`, `of` ("b compared with a"),
        `answers`, `middle`, `distribution` (answers at each point), `published` (`mean`, `standard_deviation` of all
        answers, as 2003 Table 2), `participants` (of one mean score a participant: `participants`, `mean`,
        `standard_deviation`, `standard_error`, `low`, `high`, `t`, `degrees_of_freedom`, `p_value` against the middle,
        `signed_rank_p_value`, `note`), `order` (see `order_effect`), `motions` (the same test a motion, `p_value` and,
        adjusted over the motions, `holm_p_value`).

    Raises
    ------
    AnalysisError
        When a column is missing, an answer lies off the scale, or it is not known which was shown first.
    """
    scores = _scores(answers, points)
    middle = (points - 1) / 2
    found = []
    for (item, method_a, method_b), part in scores.groupby(["item", "method_a", "method_b"], sort=False):
        counts = np.bincount(part["score"].astype(int), minlength=points)
        entry = {
            "item": str(item),
            "method_a": str(method_a),
            "method_b": str(method_b),
            "of": f"{method_b} compared with {method_a}",
            "answers": len(part),
            "middle": middle,
            "distribution": {str(point): int(count) for point, count in enumerate(counts)},
            "published": {
                "mean": float(part["score"].mean()),
                "standard_deviation": float(part["score"].std(ddof=1)) if len(part) > 1 else None,
                "note": "" if len(part) > 1 else "one answer: no spread",
            },
            "participants": _over_participants(part, middle, confidence),
            "order": order_effect(part, confidence),
            "motions": _motions(part, middle, confidence),
        }
        found.append(dict(estimates.plain(entry)))
    return found


def _scores(answers: pd.DataFrame, points: int) -> pd.DataFrame:
    """The answers given, with `score`: how method b compares with method a."""
    estimates.check_columns(answers, NEEDED_COLUMNS, "ratings of pairs")
    part = rated(answers)
    off = ~part["rating"].isin(range(points))
    if off.any():
        raise AnalysisError(
            f"expected ratings of 0 to {points - 1}, found {part.loc[off, 'rating'].iloc[0]:g}; recode the column "
            "`answer`, or name the points of the scale"
        )
    if unknown := int(part["a_first"].isna().sum()):
        raise AnalysisError(
            f"expected true or false in the column `a_first`, found nothing in {counted(unknown, 'row')}; a "
            "rating of a pair means nothing without it"
        )
    part["participant"] = part["participant"].astype(str)
    part["a_first"] = part["a_first"].astype(bool)
    part["score"] = part["rating"].where(part["a_first"], points - 1 - part["rating"])
    return part


def _means(part: pd.DataFrame) -> pd.Series[float]:
    """One mean score a participant."""
    return part.groupby("participant")["score"].mean()


def _over_participants(part: pd.DataFrame, middle: float, confidence: float) -> dict[str, Any]:
    """One mean score a participant against the middle of the scale, by Student's t and by signed ranks."""
    means = _means(part).to_numpy(dtype=np.float64)
    found, by_ranks = _against(means, middle, confidence), signed_rank(means - middle)
    return {
        **found,
        "standard_deviation": float(means.std(ddof=1)) if len(means) > 1 else None,
        "signed_rank_p_value": by_ranks,
        "note": "; ".join(filter(None, (found["note"], NO_RANKS if by_ranks is None else ""))),
    }


def _against(values: ArrayLike, expected: float, confidence: float) -> dict[str, Any]:
    test = estimates.mean_test(values, expected, confidence)
    return {
        "participants": test.participants,
        "mean": test.mean,
        "standard_error": test.standard_error,
        "low": test.interval.low,
        "high": test.interval.high,
        "t": test.statistic,
        "degrees_of_freedom": test.degrees_of_freedom,
        "p_value": test.p_value,
        "note": test.note,
    }


def order_effect(part: pd.DataFrame, confidence: float = 0.95) -> dict[str, Any]:
    """Return how far a score depends on which method was shown first.

    Parameters
    ----------
    part
        Of one question: `participant`, `a_first`, `score`.
    confidence
        Of the intervals.

    Returns
    -------
    dict
        `rows` (one an order: `first`, the method shown first, `participants`, `answers`, `mean`, `standard_error`,
        `low`, `high` over participants), `kind` ("between" where each participant saw one order, as in 2003, else
        "within", or "" where there is one order alone), `f`, `degrees_of_freedom`, `error_degrees_of_freedom`,
        `p_value` (analysis of variance of participants' means by order; within participants, t squared of their own
        differences), `balanced_mean` (the mean of both orders), `note`.
    """
    rows, groups = [], []
    for a_first in (True, False):
        own = part[part["a_first"] == a_first]
        if len(own):
            means = _means(own)
            groups.append(means)
            test = _against(means, 0.0, confidence)
            shown = {key: test[key] for key in ("participants", "mean", "standard_error", "low", "high", "note")}
            rows.append(
                {"first": str(own.iloc[0]["method_a" if a_first else "method_b"]), "answers": len(own), **shown}
            )
    nothing = dict.fromkeys(("f", "degrees_of_freedom", "error_degrees_of_freedom", "p_value", "balanced_mean"))
    if len(groups) < 2:
        return {"rows": rows, "kind": "", **nothing, "note": "one order of presentation: its effect can't be estimated"}
    balanced = float(np.mean([group.mean() for group in groups]))
    between = not set(groups[0].index) & set(groups[1].index)
    found = _between(*groups) if between else _within(*groups)
    return {"rows": rows, "kind": "between" if between else "within", **nothing, **found, "balanced_mean": balanced}


def _between(first: pd.Series[float], second: pd.Series[float]) -> dict[str, Any]:
    """Participants' means by order, between subjects as in 2003."""
    left = len(first) + len(second) - 2
    if left < 1:
        return {"note": "one participant in each order: no spread to judge the effect of order by"}
    squares = sum(float(((group - group.mean()) ** 2).sum()) for group in (first, second))
    if squares <= 1e-12:
        return {"note": "all participants of an order gave the same scores: the effect of order can't be tested"}
    apart = float(first.mean() - second.mean())
    f = apart**2 / (1 / len(first) + 1 / len(second)) / (squares / left)
    return _tested(f, left)


def _within(first: pd.Series[float], second: pd.Series[float]) -> dict[str, Any]:
    """Each participant's own difference between the orders; those who saw one order alone are left out."""
    test = estimates.mean_test((first - second).to_numpy(dtype=np.float64), 0.0)
    if test.statistic is None or test.degrees_of_freedom is None:
        return {"note": f"effect of order: {test.note}"}
    return _tested(test.statistic**2, test.degrees_of_freedom)


def _tested(f: float, left: int) -> dict[str, Any]:
    return {
        "f": f,
        "degrees_of_freedom": 1,
        "error_degrees_of_freedom": left,
        "p_value": estimates.f_probability(f, 1, left),
        "note": "",
    }


def _motions(part: pd.DataFrame, middle: float, confidence: float) -> list[dict[str, Any]]:
    if "motion" not in part.columns:
        return []
    rows = [
        {
            "motion": str(motion),
            "answers": len(own),
            **_against(_means(own), middle, confidence),
        }
        for motion, own in part.groupby("motion", sort=False)
    ]
    known = np.array([np.nan if row["p_value"] is None else row["p_value"] for row in rows], dtype=np.float64)
    return [{**row, "holm_p_value": estimates.finite(p)} for row, p in zip(rows, estimates.holm(known), strict=True)]


def pair_sentences(questions: list[dict[str, Any]], alpha: float) -> list[str]:
    """How one method compares with the other in each question, in words."""
    found = []
    for question in questions:
        test, name = question["participants"], question["item"] or "rating"
        said = f"{name}: {question['of']} {test['mean']:.2f}, {question['middle']:g} being the same"
        if test["t"] is None:
            found.append(f"{said}; {test['note']}")
            continue
        verdict = "significant" if test["p_value"] < alpha else "not significant"
        found.append(
            f"{said} ({test['low']:.2f} to {test['high']:.2f}), t({test['degrees_of_freedom']}) = {test['t']:.2f}, "
            f"p = {test['p_value']:.3g} ({verdict} at {alpha:g})"
        )
    return found
