"""Ratings of pairs: turned by order, over participants, by order as in 2003, and what can't be told from little."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from study.analysis.analyse import analyse
from study.analysis.ratings.analyse import PairRatings, Ratings
from study.analysis.ratings.answers import of_pairs
from study.analysis.ratings.pairs import NO_RANKS, AllAnswers, pair_ratings, pair_sentences
from study.analysis.study_result import Settings
from study.errors import AnalysisError


def rows(scores: list[list[int]], *, by_group: bool = True, points: int = 5) -> pd.DataFrame:
    """Answers as they are given, from the scores that they mean: a list a participant, one a motion."""
    found: list[dict[str, Any]] = []
    for person, own in enumerate(scores):
        for motion, score in enumerate(own):
            a_first = (person if by_group else person + motion) % 2 == 0
            given = score if a_first else points - 1 - score
            found.append(
                {"participant": f"p{person}", "task": "rating", "study": "compared", "motion": f"m{motion}"}
                | {"item": "better", "method_a": "old", "method_b": "new", "a_first": a_first, "answer": str(given)}
            )
    return pd.DataFrame(found)


def test_answers_are_turned_so_that_the_comparison_is_judged() -> None:
    """The second of a pair is the comparison where the reference came first, else the reference."""
    answers = rows([[4], [4], [3], [2]])
    assert list(answers["answer"]) == ["4", "0", "3", "2"]  # a middle answer stays in the middle
    (found,) = pair_ratings(answers, 5)
    assert (found.method_a, found.method_b, found.of) == ("old", "new", "new compared with old")
    assert found.distribution == {"0": 0, "1": 0, "2": 1, "3": 1, "4": 2}
    spread = pytest.approx(np.std([4, 4, 3, 2], ddof=1))
    assert found.published == AllAnswers(mean=3.25, standard_deviation=spread, note="")
    assert found.middle == 2


def test_two_answers_and_both_groups_that_say_the_second_is_better_cancel() -> None:
    """A leaning towards whatever comes second is no preference for either method."""
    answers = rows([[3], [1], [3], [1], [4], [0]])
    assert set(answers["answer"]) == {"3", "4"}
    (found,) = pair_ratings(answers, 5)
    assert found.participants.mean == 2
    assert not found.order_note


def test_the_tests_are_those_of_participants_means() -> None:
    rng = np.random.default_rng(7)
    scores = rng.integers(0, 5, (26, 3)).tolist()
    (found,) = pair_ratings(rows(scores), 5)
    assert found.participants.generalises_to == "participants and motions"
    (found,) = pair_ratings(rows(scores).drop(columns="motion"), 5)
    means = np.mean(scores, axis=1)
    own = stats.ttest_1samp(means, 2.0)
    test = found.participants
    assert (test.t, test.p_value) == (pytest.approx(own.statistic), pytest.approx(own.pvalue))
    assert [test.low, test.high] == pytest.approx(own.confidence_interval(0.95))
    assert test.standard_deviation == pytest.approx(means.std(ddof=1))


def test_the_signed_ranks_are_those_of_distances_from_the_middle() -> None:
    scores = [[4], [4], [3], [1], [4], [3], [2], [3]]
    (found,) = pair_ratings(rows(scores), 5)
    apart = np.array([2, 2, 1, -1, 2, 1, 1])
    ranks = stats.rankdata(np.abs(apart))
    signs = np.array(np.meshgrid(*[[0, 1]] * 7)).reshape(7, -1).T
    sums, own = signs @ ranks, ranks[apart > 0].sum()
    exact = np.mean(np.abs(sums - ranks.sum() / 2) >= abs(own - ranks.sum() / 2) - 1e-9)
    assert found.participants.signed_rank_p_value == pytest.approx(exact)


@pytest.mark.parametrize("points", [4, 7])
def test_other_scales_have_their_own_middle(points: int) -> None:
    (found,) = pair_ratings(rows([[points - 1], [0], [points - 1], [0]], points=points), points)
    assert found.middle == (points - 1) / 2 == found.participants.mean
    assert len(found.distribution) == points


@pytest.mark.parametrize(
    ("scores", "why", "order"),
    [
        ([[3]], "one participant: no spread to estimate", "one order of presentation"),
        ([[3], [3], [3], [3]], "all 4 participants gave the same value", ""),
        ([[3], [1]], "", ""),
    ],
)
def test_what_little_data_can_not_tell_is_said(scores: list[list[int]], why: str, order: str) -> None:
    (found,) = pair_ratings(rows(scores), 5)
    assert found.participants.note.startswith(why)
    assert (found.participants.t is None) == bool(why)
    assert found.participants.p_value == (0.125 if len(scores) == 4 else found.participants.p_value)
    assert found.order_note.startswith(order)
    assert bool(found.order_note) == bool(order)
    (sentence,) = pair_sentences([found], 0.05)
    assert ("at 0.05" in sentence) != bool(why)
    assert "None" not in sentence


def test_ranks_that_can_not_be_told_are_said_and_others_are_not() -> None:
    (told,) = pair_ratings(rows([[4, 3], [3, 3], [4, 2], [1, 2], [4, 4], [3, 2]]), 5)
    assert told.participants.signed_rank_p_value is not None
    assert NO_RANKS not in told.participants.note
    (untold,) = pair_ratings(rows([[2], [2], [2]]), 5)
    assert untold.participants.signed_rank_p_value is None
    assert NO_RANKS in untold.participants.note


def test_no_answers_are_no_questions_and_missed_ones_are_left_out() -> None:
    answers = rows([[3], [4], [2]])
    answers.loc[0, "answer"] = None
    (found,) = pair_ratings(answers, 5)
    assert (found.answers, found.participants.participants) == (2, 2)
    assert pair_ratings(answers.iloc[:1], 5) == ()


def test_what_makes_no_sense_is_refused() -> None:
    answers = rows([[3], [4]])
    with pytest.raises(AnalysisError, match=r"expected ratings of 0 to 3, found 4; recode"):
        pair_ratings(answers.assign(answer="4"), 4)
    with pytest.raises(AnalysisError, match="expected true or false in the column `a_first`, found nothing in 2 rows"):
        pair_ratings(answers.assign(a_first=None), 5)
    with pytest.raises(AnalysisError, match="found none named a_first"):
        pair_ratings(answers.drop(columns="a_first"), 5)
    with pytest.raises(AnalysisError, match="how many points the scale of 'compared' has"):
        analyse(answers)


def test_single_ratings_and_pairs_are_told_apart() -> None:
    pairs = rows([[3], [4], [2], [3]])
    singles = pairs.assign(study="single", method_b="", a_first=None)
    points = Settings(scale_points={"compared": 5, "single": 5})
    found = analyse(pd.concat([pairs, singles], ignore_index=True), points)
    assert (set(found.of(PairRatings)), set(found.of(Ratings))) == ({"compared"}, {"single"})
    assert (of_pairs(pairs), of_pairs(singles), of_pairs(singles.drop(columns="method_b"))) == (True, False, False)
    assert found.of(PairRatings)["compared"].questions[0].participants.mean == 3


def test_no_preference_is_found_as_often_as_it_should_be() -> None:
    """Type I error at .05 with 26 people and one rating each, whatever way the second is favoured."""
    rng = np.random.default_rng(2003)
    given = np.clip(np.round(2.4 + 0.95 * rng.standard_normal((1000, 26))), 0, 4).astype(int)
    scores = np.where(np.arange(26) % 2 == 0, given, 4 - given)
    found = [pair_ratings(rows(study[:, None].tolist()), 5)[0].participants.p_value for study in scores[:200]]
    # The order adds to the spread between participants, so the test is careful rather than not.
    assert np.mean(np.array(found) < 0.05) <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / 200)
