"""Exclusions: only by rules that were stated, counted once, with results with and without."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from study.analysis.analyse import analyse
from study.analysis.exclusions import Rules, exclude
from study.analysis.preference.analyse import Preference
from study.analysis.study_result import Settings

FEW = Settings(resamples=10)


@pytest.fixture
def answers(preference_study: Callable[..., pd.DataFrame]) -> pd.DataFrame:
    """Ten participants; the first misses half, the second answers at once, the third saw one stimulus stall."""
    data = preference_study(np.random.default_rng(1), participants=10)
    data["shown_well"] = True
    data["chose_a"] = data["chose_a"].astype("boolean")
    data.loc[data.index[:4], ["answer", "chose_a"]] = None
    data.loc[data.index[8:16], "response_s"] = 0.05
    data.loc[data.index[17], "shown_well"] = False
    data.loc[data.index[40], "response_s"] = 0.1
    return data


def test_nothing_is_left_out_without_rules(answers: pd.DataFrame) -> None:
    kept, left_out = exclude(answers, Rules())
    assert len(kept) == 80
    assert left_out.rules == ()
    result = analyse(answers, FEW)
    assert result.exclusions.answers_left_out == 0
    assert result.without_exclusions is None


def test_each_is_counted_under_the_first_rule_it_breaks(answers: pd.DataFrame) -> None:
    rules = Rules(fastest_s=0.2, badly_shown=True, most_missed=0.25, most_too_fast=0.5)
    _, kept = exclude(answers, rules)
    assert [row.participants for row in kept.rules] == [1, 1, 0, 0]
    assert [row.answers for row in kept.rules] == [8, 8, 1, 1]
    assert kept.answers_left_out == 18
    assert [row.participant for row in kept.participants] == ["p00", "p01"]
    assert "missed 50%" in kept.participants[0].reason
    assert "no response in more than 25%" in kept.rules[0].rule


def test_failed_attention_checks(answers: pd.DataFrame) -> None:
    checks = pd.DataFrame(
        {"participant": ["p05", "p05", "p06"], "answer": ["first", None, "second"], "expected": ["second"] * 3}
    )
    _, kept = exclude(answers, Rules(most_failed_checks=0.5), checks)
    assert [row.participant for row in kept.participants] == ["p05"]
    assert exclude(answers, Rules(most_failed_checks=0.5))[1].participants == ()


def test_results_stand_with_and_without(answers: pd.DataFrame) -> None:
    result = analyse(answers, FEW, rules=Rules(most_missed=0.25))
    assert result.exclusions.participants[0].participant == "p00"
    assert result.of(Preference)["geodesic"].comparisons[0].published.answers == 72
    assert result.without_exclusions is not None
    assert result.without_exclusions.of(Preference)["geodesic"].comparisons[0].published.answers == 76
    assert result.quality.participants == 10


def test_everybody_left_out_is_no_crash(answers: pd.DataFrame) -> None:
    result = analyse(answers, FEW, rules=Rules(fastest_s=5.0))
    assert result.exclusions.answers_left_out == 80
    assert result.data == "simulated"
    assert result.of(Preference) == {}
    assert result.without_exclusions is not None
    assert len(result.without_exclusions.of(Preference)["geodesic"].comparisons) == 1


def test_what_lies_exactly_on_a_limit_is_kept(answers: pd.DataFrame) -> None:
    """Rules say "more than" and "sooner than"."""
    answers["response_s"] = 1.0
    answers["shown_well"] = True
    assert exclude(answers, Rules(fastest_s=1.0))[1].answers_left_out == 0
    assert exclude(answers, Rules(fastest_s=1.0 + 1e-9))[1].answers_left_out == 80
    assert exclude(answers, Rules(most_missed=0.5))[1].participants == ()
    assert [row.participant for row in exclude(answers, Rules(most_missed=0.499))[1].participants] == ["p00"]
    answers.loc[answers.index[8:12], "response_s"] = 0.05
    assert exclude(answers, Rules(most_too_fast=0.5))[1].participants == ()
    assert [row.participant for row in exclude(answers, Rules(most_too_fast=0.499))[1].participants] == ["p01"]
    assert exclude(answers, Rules(most_too_fast=0.4, fastest_s=0.05))[1].participants == ()
    checks = pd.DataFrame({"participant": ["p05"] * 2, "answer": ["first", None], "expected": ["first"] * 2})
    assert exclude(answers, Rules(most_failed_checks=0.5), checks)[1].participants == ()
