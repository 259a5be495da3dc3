"""Which of two methods participants find more natural: answers of a preference task in, percentages and tests out.

As published (2004 section 5.2, Table 2): percent favouring and chi-square with one degree of freedom over all answers.
The answers of a participant are not independent, so the test to believe takes one number a participant; the
intraclass correlation and the design effect say how far the two can differ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from study.analysis import estimates
from study.analysis.preference.bradley_terry import fit_bradley_terry
from study.analysis.preference.models import preference_models
from study.analysis.preference.no_effect import MARGIN, no_preference
from study.analysis.preference.participants import motions_as_sample, participant_tests
from study.counting import counted
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

_TRUTH = {"true": "1", "false": "0"}
NEEDED_COLUMNS = ("participant", "chose_a", "method_a", "method_b")


@dataclass(frozen=True)
class Published:
    """The pooled test of 2004 Table 2.

    Attributes
    ----------
    favouring, answers, percent
        How many of how many answers favoured the first method.
    chi_square, degrees_of_freedom, p_value
        Against an even split, every answer taken as independent.
    exact_p_value
        Two-sided binomial test of the same.
    interval
        Wilson's interval of the share (0 to 1).
    note
        Why nothing can be given; empty where all can.
    """

    favouring: int
    answers: int
    percent: float | None
    chi_square: float | None
    degrees_of_freedom: int
    p_value: float | None
    exact_p_value: float | None
    interval: estimates.Interval
    note: str = ""


def published_test(favouring: int, answers: int, confidence: float = 0.95) -> Published:
    """Test a count against an even split, as 2004 section 5.2 does.

    Parameters
    ----------
    favouring, answers
        How many of how many answers favoured the first method.
    confidence
        Of Wilson's interval.

    Raises
    ------
    AnalysisError
        When the counts are impossible.

    Examples
    --------
    >>> round(published_test(270, 280).chi_square, 1)
    241.4
    """
    if not 0 <= favouring <= answers:
        raise AnalysisError(f"expected 0 <= favouring <= answers, found {favouring} of {answers}; check the counts")
    interval = estimates.wilson_interval(favouring, answers, confidence)
    if answers == 0:
        return Published(0, 0, None, None, 1, None, None, interval, "no answer chose between the two")
    chi_square = (2 * favouring - answers) ** 2 / answers
    return Published(
        favouring=favouring,
        answers=answers,
        percent=100 * favouring / answers,
        chi_square=chi_square,
        degrees_of_freedom=1,
        p_value=estimates.chi_square_probability(chi_square, 1),
        exact_p_value=estimates.binomial_probability(favouring, answers),
        interval=interval,
    )


def preference_answers(answers: pd.DataFrame) -> pd.DataFrame:
    """Return the answers given in preference tasks, missed ones left out, `chose_a` as 0, 1, or one half for a tie.

    Raises
    ------
    AnalysisError
        When a column is missing, or `chose_a` holds anything else.
    """
    import pandas as pd

    missing = [name for name in NEEDED_COLUMNS if name not in answers.columns]
    if missing:
        raise AnalysisError(
            f"expected columns {', '.join(NEEDED_COLUMNS)} for a preference analysis, found none named "
            f"{', '.join(missing)}; name them in the table of answers"
        )
    chosen = answers[answers["task"] == "preference"] if "task" in answers.columns else answers
    given = chosen[chosen["chose_a"].notna()].copy()
    numbers = pd.to_numeric(given["chose_a"].astype(object).astype(str).str.lower().replace(_TRUTH), errors="coerce")
    strange = ~numbers.isin([0.0, 0.5, 1.0])
    if strange.any():
        found = given.loc[strange, "chose_a"].iloc[0]
        raise AnalysisError(
            f"expected true, false, or 0.5 for a tie in the column `chose_a`, found {str(found)!r}; recode it"
        )
    given["chose_a"] = numbers.astype(float)
    return given


def compare(
    answers: pd.DataFrame,
    confidence: float = 0.95,
    alpha: float = 0.05,
    *,
    models: bool = True,
    margin: float = MARGIN,
) -> list[dict[str, Any]]:
    """Analyse every pair of methods that was compared.

    Parameters
    ----------
    answers
        Of one study.
    confidence
        Of the intervals.
    alpha
        Level of significance that the sentence in `answer` speaks of.
    models
        Whether to fit mixed models and estimating equations too, which takes longer.
    margin
        Of the equivalence test: the difference from an even split that still counts as none (0.1 is 40 to 60%).

    Returns
    -------
    list of dict
        One entry a pair of methods, in the order of first appearance: `method_a`, `method_b`, `published` (pooled
        test, ties left out), `ties` (answers for neither), `participants` (one share a participant against one half, a
        tie as half an answer; Wilcoxon's test; robust chi-square), `clustering`, `motions` (the pooled test a motion
        pair, p-values adjusted by Holm), `motions_as_sample` (tests that hold for other motions too), `order` (effect
        of the order of presentation), `no_preference` (equivalence test and Bayes factor), `models` (mixed model,
        GEE), `answer` (a sentence).
    """
    given = preference_answers(answers)
    results = []
    for (method_a, method_b), part in given.groupby(["method_a", "method_b"], sort=False):
        result = _compare_two(str(method_a), str(method_b), part, confidence, alpha, margin)
        results.append({**result, "models": preference_models(part, confidence) if models else None})
    return results


def _compare_two(
    method_a: str, method_b: str, part: pd.DataFrame, confidence: float, alpha: float, margin: float
) -> dict[str, Any]:
    by_participant = part.groupby(part["participant"].astype(str))["chose_a"].agg(["sum", "count"])
    chosen, shown = by_participant["sum"].to_numpy(dtype=np.float64), by_participant["count"].to_numpy(dtype=np.float64)
    published = _without_ties(part, confidence)
    participants = participant_tests(chosen, shown, confidence)
    order = order_effect(part, confidence)
    said = _in_words(method_a, method_b, published, participants, order, alpha)
    return {
        "method_a": method_a,
        "method_b": method_b,
        "published": estimates.plain(published),
        "ties": int((part["chose_a"] == 0.5).sum()),
        "participants": participants,
        "clustering": estimates.plain(estimates.clustering(chosen, shown)),
        "motions": estimates.plain(motion_table(part, confidence).to_dict("records")),
        "motions_as_sample": motions_as_sample(part, confidence),
        "order": order,
        "no_preference": estimates.plain(no_preference(chosen[shown > 0] / shown[shown > 0], margin)),
        "answer": _order_in_words(method_a, method_b, order, alpha) or said,
    }


def _without_ties(part: pd.DataFrame, confidence: float) -> Published:
    """The pooled test of the answers that chose; like a sign test, it leaves out those that did not."""
    clear = part["chose_a"] != 0.5
    return published_test(int(part.loc[clear, "chose_a"].sum()), int(clear.sum()), confidence)


def strengths(answers: pd.DataFrame, confidence: float = 0.95) -> dict[str, Any] | None:
    """Return Bradley-Terry strengths of the methods of one study; None where only two were compared.

    With two methods the strengths say nothing that their percentage does not.
    """
    given = preference_answers(answers)
    if len({*given["method_a"].astype(str), *given["method_b"].astype(str)}) < 3:
        return None
    ordered = "a_first" in given.columns and given["a_first"].notna().all()
    a_first = given["a_first"].astype(bool).to_numpy() if ordered else np.ones(len(given), dtype=bool)
    a, b = given["method_a"].astype(str).to_numpy(), given["method_b"].astype(str).to_numpy()
    first, second = np.where(a_first, a, b), np.where(a_first, b, a)
    chosen = given["chose_a"].to_numpy(dtype=np.float64)
    favoured = np.where(a_first, chosen, 1 - chosen)
    found = fit_bradley_terry(
        [str(name) for name in first],
        [str(name) for name in second],
        favoured,
        np.ones(len(given)),
        with_order=bool(ordered),
        confidence=confidence,
        participants=[str(name) for name in given["participant"]],
    )
    return {"note": found} if isinstance(found, str) else dict(estimates.plain(found))


def strengths_in_words(found: dict[str, Any]) -> str:
    """Return the strengths of the methods in a sentence, and what can't be told of them."""
    if not found.get("strengths"):
        return f"Strengths of the methods: {found['note']}."
    told = [row for row in found["strengths"] if row["value"] is not None and row["method"] != found["reference"]]
    parts = [
        f"{row['method']} {row['value']:+.2f}"
        + ("" if row["standard_error"] is None else f" ({row['interval']['low']:.2f} to {row['interval']['high']:.2f})")
        for row in told
    ]
    said = f"Strengths in logits beside {found['reference']}: {', '.join(parts) or 'none is finite'}"
    return f"{said}. {found['note'][:1].upper()}{found['note'][1:]}." if found["note"] else f"{said}."


def confirmatory(
    comparisons: dict[str, list[dict[str, Any]]], family: Sequence[str] | None = None
) -> list[dict[str, Any]]:
    """Return the default tests of the confirmatory comparisons of a sitting, adjusted together by Holm's method.

    Parameters
    ----------
    comparisons
        By study, what `compare` gave.
    family
        Names of the studies whose tests were declared confirmatory before there was data; all of them where None.
    """
    rows = [
        {
            "study": study,
            "method_a": compared["method_a"],
            "method_b": compared["method_b"],
            "test": compared["participants"]["test"],
            "p_value": compared["participants"]["p_value"],
            "note": compared["participants"]["note"] if compared["participants"]["p_value"] is None else "",
        }
        for study, found in comparisons.items()
        if family is None or study in family
        for compared in found
    ]
    known = np.array([np.nan if row["p_value"] is None else row["p_value"] for row in rows], dtype=np.float64)
    adjusted = estimates.holm(known)
    return [{**row, "holm_p_value": estimates.finite(p)} for row, p in zip(rows, adjusted, strict=True)]


def motion_table(part: pd.DataFrame, confidence: float = 0.95) -> pd.DataFrame:
    """Return the pooled test for every motion.

    Where every participant saw a motion pair once, its answers are independent and these tests hold as they stand.

    Returns
    -------
    DataFrame
        `motion`, `favouring`, `answers`, `percent`, `low`, `high` (percent, Wilson), `chi_square`, `p_value`,
        `exact_p_value`, `holm_p_value` (the exact one, adjusted over the motions), `note`.
    """
    import pandas as pd

    column = "motion" if "motion" in part.columns else "pair" if "pair" in part.columns else None
    rows = []
    for motion, answers in part.groupby(part[column].astype(str) if column else np.full(len(part), "all"), sort=False):
        test = _without_ties(answers, confidence)
        rows.append(
            {
                "motion": str(motion),
                "favouring": test.favouring,
                "answers": test.answers,
                "percent": test.percent,
                "low": None if test.interval.low is None else 100 * test.interval.low,
                "high": None if test.interval.high is None else 100 * test.interval.high,
                "chi_square": test.chi_square,
                "p_value": test.p_value,
                "exact_p_value": test.exact_p_value,
                "note": test.note,
            }
        )
    table = pd.DataFrame(rows)
    if len(table):
        table["holm_p_value"] = estimates.holm(table["exact_p_value"].to_numpy(dtype=np.float64))
    return table


def order_effect(part: pd.DataFrame, confidence: float = 0.95) -> dict[str, Any]:
    """Return how far the order of presentation decided the answer.

    Returns
    -------
    dict
        `first_percent` (how often the one shown first was favoured), `answers`, `p_value` (the default test of one
        share a participant against one half), `percent_a_first`, `percent_a_second` (favouring the first method, by
        place), `balanced_percent` (the mean of these two: free of the order effect), `note`.
    """
    nothing = dict.fromkeys(("first_percent", "p_value", "percent_a_first", "percent_a_second", "balanced_percent"))
    if "a_first" not in part.columns or part["a_first"].isna().all():
        return {**nothing, "answers": 0, "note": "the order of presentation is not known"}
    known = part[part["a_first"].notna()]
    a_first = known["a_first"].astype(bool)
    chose_first = known["chose_a"].where(a_first, 1 - known["chose_a"])
    shares = chose_first.groupby(known["participant"].astype(str))
    test = participant_tests(shares.sum(), shares.count(), confidence)
    first = 100 * float(known.loc[a_first, "chose_a"].mean()) if a_first.any() else None
    second = 100 * float(known.loc[~a_first, "chose_a"].mean()) if (~a_first).any() else None
    one_order = ONE_ORDER if first is None or second is None else ""
    return {
        "first_percent": 100 * float(chose_first.mean()),
        "answers": len(known),
        "p_value": test["p_value"],
        "percent_a_first": first,
        "percent_a_second": second,
        "balanced_percent": None if first is None or second is None else (first + second) / 2,
        "note": "; ".join(filter(None, (one_order, test["note"]))),
    }


ONE_ORDER = "the two were always shown in the same order: a preference can't be told from an effect of the order"


def _order_in_words(method_a: str, method_b: str, order: dict[str, Any], alpha: float) -> str:
    """What is to be said in place of a preference where the order of presentation decided every answer."""
    if order["balanced_percent"] is None or order["first_percent"] not in (0.0, 100.0):
        return ""
    if (estimates.binomial_probability(0, order["answers"]) or 1.0) >= alpha:
        return ""
    place = "first" if order["first_percent"] else "second"
    return (
        f"Each of {counted(order['answers'], 'answer')} favoured the one shown {place}: the order of presentation "
        f"decided, and nothing can be said about {method_a} and {method_b}."
    )


def _in_words(
    method_a: str,
    method_b: str,
    published: Published,
    participants: dict[str, Any],
    order: dict[str, Any],
    alpha: float,
) -> str:
    """Who was favoured, how often, whether it can be told from chance, and what the order had to do with it."""
    if published.percent is None:
        return f"There are no answers that choose between {method_a} and {method_b}."
    p_value = participants["p_value"]
    share = f"{published.percent:.1f}% of {counted(published.answers, 'answer')} favoured {method_a} over {method_b}"
    if p_value is None:
        said = f"{share}; with one participant nothing can be said about others."
    elif p_value < alpha:
        said = f"{share}; across participants this is not chance (p {_p_in_words(p_value)})."
    else:
        said = f"{share}; across participants this can't be told from chance (p {_p_in_words(p_value)})."
    if ONE_ORDER in order["note"]:
        return f"{said} {ONE_ORDER[0].upper()}{ONE_ORDER[1:]}."
    if order["p_value"] is not None and order["p_value"] < alpha:
        place, percent = ("first", order["first_percent"])
        if percent < 50:
            place, percent = "second", 100 - percent
        return (
            f"{said} The order of presentation mattered: {percent:.1f}% favoured the one shown {place} "
            f"(p {_p_in_words(order['p_value'])})."
        )
    return said


def _p_in_words(p_value: float) -> str:
    return "< .001" if p_value < 0.001 else f"= {p_value:.3f}".replace("0.", ".", 1) if p_value < 1 else "= 1"
