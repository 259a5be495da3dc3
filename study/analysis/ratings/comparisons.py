"""Ratings of several methods compared: answers of a rating task in, tests of every question out.

As published (2003 section 4.2): a 2 x 2 analysis of variance between subjects, method by order of presentation. It
treats the ratings of one participant as independent. Beside it are tests that do not: the difference over
participants (and motions), the mixed design with participants as random, and ranks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from study.analysis import estimates
from study.analysis.crossed import OVER_BOTH, GeneralTest, general_test
from study.analysis.rank_tests import NO_RANKS, Friedman, RankTest, friedman, signed_rank
from study.analysis.ratings.answers import first_seen, rated
from study.analysis.variance.repeated_measures import WithinEffect, mixed_design
from study.analysis.variance.two_way import TwoWay, two_way
from study.arrays import FloatArray
from study.errors import AnalysisError

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class MethodDifference(GeneralTest):
    """How much higher the other of two methods was rated: mean of each participant's own differences, with its test.

    The differences are those within a motion, where there are enough motions to generalise over; `holm_p_value` is
    adjusted over the pairs of methods.
    """

    of: str
    holm_p_value: float | None = None


@dataclass(frozen=True)
class MixedDesign:
    """Participants as random; those who did not rate every combination of `factors` are excluded."""

    effects: tuple[WithinEffect, ...]
    factors: tuple[str, ...]
    participants: int
    left_out: int
    note: str


@dataclass(frozen=True)
class Ranks:
    """The methods over participants on ranks; `note` says why they can't be compared."""

    participants: RankTest | None
    note: str


@dataclass(frozen=True)
class Question:
    """Methods compared in one question.

    `anova` is as published, by type III sums of squares; `difference` is the only one of `differences` where there are
    two methods. `note` says what can't be had.
    """

    item: str
    participants: int
    answers: int
    anova: TwoWay | tuple[()]
    differences: tuple[MethodDifference, ...]
    difference: MethodDifference | None
    mixed_design: MixedDesign
    ranks: Ranks
    note: str


def rating_anova(answers: pd.DataFrame, confidence: float = 0.95) -> tuple[Question, ...]:
    """Analyse each question of a rating study by method and by order of presentation.

    Parameters
    ----------
    answers
        Answers of one rating study: `participant`, `method_a`, `answer`, `trial`, and `item` where there are several
        questions. The order is the method that a participant saw first; methods that are shown at once have none.
    confidence
        Of intervals; of effect sizes they are of 1 - 2 alpha (see `effect_sizes`).

    Raises
    ------
    AnalysisError
        When an answer is not a number.
    """
    part = rated(answers)
    if part.empty or "method_a" not in part.columns or part["method_a"].nunique() < 2:
        return ()
    part["participant"], part["method_a"] = part["participant"].astype(str), part["method_a"].astype(str)
    at_once = "slot" in part.columns and bool(part["slot"].notna().all())
    part["order"] = "" if at_once else part["participant"].map(first_seen(answers)) + " first"
    return tuple(_question(str(name), group, confidence) for name, group in part.groupby("item", sort=False))


def _question(name: str, part: pd.DataFrame, confidence: float) -> Question:
    table, note = _as_published(part, 1 - confidence)
    differences, over = _differences(part, confidence), _ranks(part)
    return Question(
        item=name,
        participants=int(part["participant"].nunique()),
        answers=len(part),
        anova=table,
        differences=differences,
        difference=differences[0] if len(differences) == 1 else None,
        mixed_design=_mixed_design(part, 1 - confidence),
        ranks=Ranks(over, _ranks_note(over)),
        note=note,
    )


def _as_published(part: pd.DataFrame, alpha: float) -> tuple[TwoWay | tuple[()], str]:
    """The analysis of variance between subjects, and why there is none, or no F; nothing of methods shown at once."""
    if not part["order"].any():
        return (), ""
    try:
        table = two_way(part["rating"], part["method_a"], part["order"], ("method", "order"), alpha)
    except AnalysisError as error:
        return (), f"no analysis of variance: {error}"
    return table, "the ratings of each combination are all the same: no F" if table[0].f is None else ""


def _means(part: pd.DataFrame, *within: str) -> pd.DataFrame:
    """Each participant's mean rating of each method (within each motion, say), NaN where there is none."""
    return part.groupby(["participant", *within, "method_a"])["rating"].mean().unstack()


def _differences(part: pd.DataFrame, confidence: float) -> tuple[MethodDifference, ...]:
    """The difference of each two methods, p-values adjusted over the pairs by Holm's method."""
    means, cells = _means(part), None
    if "motion" in part.columns:  # of some methods it may be unknown
        cells = _means(part, "motion").reindex(columns=means.columns)
    rows = [_difference(means, cells, one, other, confidence) for one, other in combinations(sorted(means.columns), 2)]
    adjusted = estimates.holm([row.p_value for row in rows])
    return tuple(replace(row, holm_p_value=p) for row, p in zip(rows, adjusted, strict=True))


def _difference(
    means: pd.DataFrame, cells: pd.DataFrame | None, one: str, other: str, confidence: float
) -> MethodDifference:
    """How much higher the other method was rated, over participants and motions where that can be told."""
    apart = (means[other] - means[one]).dropna()
    test = general_test(apart, 0.0, confidence)
    if cells is not None:
        within = general_test((cells[other] - cells[one]).dropna(), 0.0, confidence)
        test = within if within.test == OVER_BOTH and within.participants == test.participants else test
    note = "everybody rated the two equally" if len(apart) > 1 and not apart.any() else test.note
    note = note if len(apart) else "no participant rated both"
    return MethodDifference(**vars(test) | {"note": note}, of=f"{other} minus {one}")


def _mixed_design(part: pd.DataFrame, alpha: float) -> MixedDesign:
    """Participants as random: method (and motion, where everybody rated each motion by each method) within them."""
    people = part["participant"].nunique()
    values, who, factors = _complete(part, people)
    group = part.drop_duplicates("participant").set_index("participant")["order"][who].to_numpy()
    found = (
        mixed_design(values, group, factors, between="order", alpha=alpha)
        if len(who)
        else "no participant rated every method"
    )
    effects: tuple[WithinEffect, ...] = () if isinstance(found, str) else found
    note = found if isinstance(found, str) else ""
    if still := [row.source for row in effects if row.f is None]:
        note = f"participants do not vary in {', '.join(still)}: no F"
    return MixedDesign(
        effects=effects,
        factors=factors,
        participants=len(who),
        left_out=people - len(who),
        note=note,
    )


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


def _ranks(part: pd.DataFrame) -> RankTest | None:
    wide = _means(part).dropna()
    if len(wide) < 2:
        return None
    if wide.shape[1] == 2:
        p_value = signed_rank(wide.iloc[:, 1] - wide.iloc[:, 0])
        return None if p_value is None else RankTest("Wilcoxon's signed ranks", p_value)
    return friedman(wide)


def _ranks_note(found: RankTest | None) -> str:
    if isinstance(found, Friedman) and found.f is None:
        return "all participants rank the methods alike: no F by ranks, but an exact p-value"
    return NO_RANKS if found is None else ""
