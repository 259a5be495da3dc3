"""Ratings of one method compared with another: answers of a rating task on pairs in, a table by question out.

Wang & Bodenheimer 2003, Table 2: how the optimised motion compares with the original one, from 0 (much worse) to 4
(much better), as mean and standard deviation. Participants compare the second of a pair with the first; their answers
are turned by the order of presentation, so that a score says how method b, the comparison, compares with method a, the
reference. The middle of the scale means no difference, and stays where it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from study.analysis import estimates
from study.analysis.crossed import GeneralTest, general_test
from study.analysis.rank_tests import NO_RANKS, signed_rank
from study.analysis.ratings.answers import rated
from study.counting import counted
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd

NEEDED_COLUMNS = ("participant", "answer", "method_a", "method_b", "a_first")
ONE_ORDER = "one order of presentation: a difference cannot be separated from its effect"


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
class PairQuestion:
    """How method b compares with method a in one question.

    `middle` is the score that means no difference; `published` is of all answers, `participants` against the middle,
    over motions too where there are enough; `order_note` says so where one of the two was always shown first.
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
    order_note: str


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
                order_note="" if part["a_first"].nunique() > 1 else ONE_ORDER,
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
