"""Ratings of one method compared with another: answers of a rating task on pairs in, a table by question out.

Wang & Bodenheimer 2003, Table 2: how the optimised motion compares with the original one, from 0 (much worse) to 4
(much better), as mean and standard deviation. Participants compare the second of a pair with the first; their answers
are turned by the order of presentation, so that a score says how method b, the comparison, compares with method a, the
reference. The middle of the scale means no difference, and stays where it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from study.analysis import estimates
from study.analysis.crossed import GeneralTest, general_test
from study.analysis.estimates import Mean, MeanTest, mean_of, mean_test
from study.analysis.rank_tests import NO_RANKS, signed_rank
from study.analysis.ratings.answers import rated
from study.counting import counted
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

NEEDED_COLUMNS = ("participant", "answer", "method_a", "method_b", "a_first")


@dataclass(frozen=True)
class AllAnswers:
    """Mean and standard deviation of all answers, as 2003 Table 2 gives them."""

    mean: float
    standard_deviation: float | None
    note: str


@dataclass(frozen=True)
class ScoreTest(GeneralTest):
    """The mean score against the middle of the scale by the test that generalises furthest; and one a participant, by
    its standard deviation and by signed ranks.
    """

    standard_deviation: float | None
    signed_rank_p_value: float | None


@dataclass(frozen=True)
class MotionScore(MeanTest):
    """The same for one motion, by Student's t, adjusted over the motions by Holm's method."""

    motion: str
    answers: int
    holm_p_value: float | None


@dataclass(frozen=True)
class OrderScore(Mean):
    """Scores where the method `first` was shown first."""

    first: str
    answers: int


@dataclass(frozen=True)
class OrderTest:
    """How far a score depends on which method was shown first.

    `kind` is "between" where each participant saw one order, as in 2003, else "within", and empty where there is one
    order alone. F is of participants' means by order; within participants, t squared of their own differences.
    """

    rows: tuple[OrderScore, ...] = ()
    kind: str = ""
    f: float | None = None
    degrees_of_freedom: int | None = None
    error_degrees_of_freedom: int | None = None
    p_value: float | None = None
    balanced_mean: float | None = None
    note: str = ""


@dataclass(frozen=True)
class PairQuestion:
    """How method b compares with method a in one question.

    `middle` is the score that means no difference; `published` is of all answers, `participants` against the middle,
    over motions too where there are enough, `motions` of one motion over participants.
    """

    item: str
    method_a: str
    method_b: str
    of: str
    answers: int
    middle: float
    distribution: dict[str, int]
    published: AllAnswers
    participants: ScoreTest
    order: OrderTest
    motions: tuple[MotionScore, ...]


def pair_ratings(answers: pd.DataFrame, points: int, confidence: float = 0.95) -> tuple[PairQuestion, ...]:
    """Analyse each pair of methods and question of a study in which pairs were rated.

    Parameters
    ----------
    answers
        Of one study: `participant`, `answer` (second compared with first), `method_a`, `method_b`, `a_first`, and where
        there are several `item` and `motion`.
    points
        Of the scale, which is counted from 0.

    Raises
    ------
    AnalysisError
        When a column is missing, an answer lies off the scale, or it is not known which was shown first.
    """
    scores = _scores(answers, points)
    middle = (points - 1) / 2
    found = []
    for (item, method_a, method_b), part in scores.groupby(["item", "method_a", "method_b"], sort=False):
        several = len(part) > 1
        counts = np.bincount(part["score"].astype(int), minlength=points)
        found.append(
            PairQuestion(
                item=str(item),
                method_a=str(method_a),
                method_b=str(method_b),
                of=f"{method_b} compared with {method_a}",
                answers=len(part),
                middle=middle,
                distribution={str(point): int(count) for point, count in enumerate(counts)},
                published=AllAnswers(
                    mean=float(part["score"].mean()),
                    standard_deviation=float(part["score"].std(ddof=1)) if several else None,
                    note="" if several else "one answer: no spread",
                ),
                participants=_over_participants(part, middle, confidence),
                order=order_effect(part, confidence),
                motions=_motions(part, middle, confidence),
            )
        )
    return tuple(found)


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


def _over_participants(part: pd.DataFrame, middle: float, confidence: float) -> ScoreTest:
    means = _means(part)
    cells = part.set_index([column for column in ("participant", "motion") if column in part.columns])["score"]
    found, by_ranks = general_test(cells, middle, confidence), signed_rank(means - middle)
    note = "; ".join(filter(None, (found.note, NO_RANKS if by_ranks is None else "")))
    spread = float(means.std(ddof=1)) if len(means) > 1 else None
    return ScoreTest(**vars(found) | {"note": note}, standard_deviation=spread, signed_rank_p_value=by_ranks)


def order_effect(part: pd.DataFrame, confidence: float = 0.95) -> OrderTest:
    """Return how far a score depends on which method was shown first.

    Parameters
    ----------
    part
        Of one question: `participant`, `a_first`, `score`.
    """
    rows, groups = [], []
    for a_first in (True, False):
        own = part[part["a_first"] == a_first]
        if len(own):
            groups.append(_means(own))
            first = str(own.iloc[0]["method_a" if a_first else "method_b"])
            rows.append(OrderScore(**vars(mean_of(groups[-1], confidence)), first=first, answers=len(own)))
    if len(groups) < 2:
        return OrderTest(tuple(rows), note="one order of presentation: its effect can't be estimated")
    balanced = float(np.mean([group.mean() for group in groups]))
    between = not set(groups[0].index) & set(groups[1].index)
    found = _between(*groups) if between else _within(*groups)
    return replace(found, rows=tuple(rows), kind="between" if between else "within", balanced_mean=balanced)


def _between(first: pd.Series[float], second: pd.Series[float]) -> OrderTest:
    """Participants' means by order, between subjects as in 2003."""
    left = len(first) + len(second) - 2
    if left < 1:
        return OrderTest(note="one participant in each order: the effect of order cannot be estimated")
    squares = sum(float(((group - group.mean()) ** 2).sum()) for group in (first, second))
    if squares <= 1e-12:
        return OrderTest(note="all participants of an order gave the same scores: the effect of order can't be tested")
    apart = float(first.mean() - second.mean())
    return _tested(apart**2 / (1 / len(first) + 1 / len(second)) / (squares / left), left)


def _within(first: pd.Series[float], second: pd.Series[float]) -> OrderTest:
    """Each participant's own difference between the orders; those who saw only one order are excluded."""
    test = mean_test(first - second, 0.0)
    if test.t is None or test.degrees_of_freedom is None:
        return OrderTest(note=f"effect of order: {test.note}")
    return _tested(test.t**2, int(test.degrees_of_freedom))


def _tested(f: float, left: int) -> OrderTest:
    p_value = estimates.f_probability(f, 1, left)
    return OrderTest(f=f, degrees_of_freedom=1, error_degrees_of_freedom=left, p_value=p_value)


def _motions(part: pd.DataFrame, middle: float, confidence: float) -> tuple[MotionScore, ...]:
    if "motion" not in part.columns:
        return ()
    groups = [(str(motion), own) for motion, own in part.groupby("motion", sort=False)]
    tests = [mean_test(_means(own), middle, confidence) for _, own in groups]
    adjusted = estimates.holm([test.p_value for test in tests])
    return tuple(
        MotionScore(**vars(test), motion=motion, answers=len(own), holm_p_value=p_value)
        for (motion, own), test, p_value in zip(groups, tests, adjusted, strict=True)
    )


def pair_sentences(questions: Sequence[PairQuestion], alpha: float) -> list[str]:
    """How one method compares with the other in each question, in words."""
    found = []
    for question in questions:
        test, name = question.participants, question.item or "rating"
        said = f"{name}: {question.of} {test.mean:.2f}, {question.middle:g} being the same"
        if test.t is None or test.p_value is None:
            found.append(f"{said}; {test.note}" + (f"; {test.test} p = {test.p_value:.3g}" if test.p_value else ""))
            continue
        verdict = "significant" if test.p_value < alpha else "not significant"
        found.append(
            f"{said} ({test.low:.2f} to {test.high:.2f}), t({test.degrees_of_freedom:.3g}) = {test.t:.2f}, "
            f"p = {test.p_value:.3g} ({verdict} at {alpha:g}), over {test.generalises_to}"
        )
    return found
