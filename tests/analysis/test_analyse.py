"""The whole analysis and its JSON, on usual and on hopeless data."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from study.analysis.analyse import analyse, analysis_json, kind_of_data
from study.analysis.preference.analyse import Preference
from study.analysis.quality import quality
from study.analysis.ratings.analyse import Ratings
from study.analysis.same_different.analyse import SameDifferent
from study.analysis.study_result import Settings
from study.analysis.to_json import to_json
from study.errors import AnalysisError

Simulate = Callable[..., pd.DataFrame]
COLUMNS = ["participant", "simulated", "study", "task", "motion", "difference_frames", "answer", "response_s"]


def test_all_tasks_in_one_table(same_different_study: Simulate, preference_study: Simulate) -> None:
    rng = np.random.default_rng(0)
    rating = pd.DataFrame(
        {"participant": ["p00", "p01"] * 3, "simulated": True, "study": "rate", "task": "rating",
         "method_a": ["geodesic"] * 4 + ["fixed"] * 2, "answer": ["4", "5", "3", "4", "1", "2"]}
    )  # fmt: skip
    answers = pd.concat([same_different_study(rng, participants=6), preference_study(rng, participants=6), rating])
    result = analysis_json(analyse(answers, Settings(resamples=100)))
    text = json.dumps(result, allow_nan=False)
    assert json.loads(text) == result
    assert set(result) >= {"jnd", "preference", "ratings", "quality", "data"}
    assert result["jnd"]["jnd"]["published"]["longer"]["frames"] > 0
    assert result["jnd"]["jnd"]["participants"] == 6
    assert len(result["jnd"]["jnd"]["motions"]) == 3
    assert result["preference"]["geodesic"][0]["published"]["answers"] == 48
    assert [(row["method"], row["mean"]) for row in result["ratings"]["rate"]] == [("fixed", 1.5), ("geodesic", 4.0)]
    assert result["data"] == "simulated"


def test_the_same_seed_gives_the_same_result(same_different_study: Simulate) -> None:
    answers = same_different_study(np.random.default_rng(0), participants=5)
    assert analyse(answers, Settings(resamples=50)) == analyse(answers, Settings(resamples=50))


@pytest.mark.parametrize("answer", ["same", "different", None])
@pytest.mark.parametrize("participants", [1, 3])
def test_hopeless_answers_give_a_statement(
    same_different_study: Simulate, answer: str | None, participants: int
) -> None:
    answers = same_different_study(np.random.default_rng(0), participants=participants)
    answers["answer"] = answer
    result = analyse(answers, Settings(resamples=50)).of(SameDifferent)["jnd"]
    assert result.model is None
    assert result.model_note
    for threshold in result.published.values():
        assert threshold.frames is None
        assert threshold.note
    json.dumps(to_json(result), allow_nan=False)


def test_no_rows() -> None:
    result = analyse(pd.DataFrame({name: [] for name in COLUMNS}))
    assert (result.of(SameDifferent), result.of(Preference), result.of(Ratings)) == ({}, {}, {})
    assert result.data == "none"
    assert result.quality.trials == 0
    assert {"jnd", "preference", "ratings", "pair_ratings"} <= set(analysis_json(result))


def test_refusals() -> None:
    with pytest.raises(AnalysisError, match="none named task"):
        analyse(pd.DataFrame({"participant": [], "answer": []}))
    with pytest.raises(AnalysisError, match="found 'guessing'"):
        analyse(pd.DataFrame({"participant": ["a"], "answer": ["same"], "task": ["guessing"]}))


@pytest.mark.parametrize(
    ("simulated", "kind"), [([True, True], "simulated"), ([False, True], "mixed"), ([False, False], "collected")]
)
def test_who_answered(simulated: list[bool], kind: str) -> None:
    assert kind_of_data(pd.DataFrame({"simulated": simulated})) == kind


def test_quality_counts_what_is_missing_and_implausible(same_different_study: Simulate) -> None:
    answers = same_different_study(np.random.default_rng(5), participants=3)
    answers.loc[answers.index[:10], "answer"] = None
    quick = answers["participant"] == "p01"
    answers.loc[quick, "response_s"] = 0.05
    answers.loc[answers["participant"] == "p02", "answer"] = "same"
    answers["shown_well"] = answers.index != 60
    result = quality(answers)
    first, second, third = result.table
    assert first.missed == 10
    assert "missed 10 of 42" in first.flags
    assert second.too_fast == 42
    assert "answers sooner than 0.2 s" in second.flags
    assert 'always "same"' in third.flags
    assert result.missed == 10
    assert result.flagged == 3
    assert result.shown_badly == second.shown_badly == 1


def test_quality_counts_false_alarms_of_pairs_that_do_not_differ() -> None:
    rows = [(0, "different"), (0, "same"), (0, "different"), (1, "different"), (1, "different"), (-5, "same")]
    table = pd.DataFrame(rows, columns=["difference_frames", "answer"])
    (row,) = quality(table.assign(participant="p", trial=range(1, 7), task="same-different", study="jnd")).table
    assert (row.false_alarms, row.same_pairs) == (2, 3)


def test_quality_without_times(same_different_study: Simulate) -> None:
    answers = same_different_study(np.random.default_rng(5), participants=2).drop(columns=["response_s", "simulated"])
    result = quality(answers)
    assert result.response_s == {}
    assert result.table[0].median_response_s is None
    assert result.simulated_participants == 0


def test_margin_and_family_are_what_was_declared(preference_study: Simulate) -> None:
    one, two = (preference_study(np.random.default_rng(seed), 12).assign(study=f"s{seed}") for seed in (1, 2))
    both = pd.concat([one, two], ignore_index=True)
    found = analyse(both, Settings(margin=0.2, resamples=20), family=["s2"])
    assert [row.study for row in found.confirmatory] == ["s2"]
    assert found.confirmatory[0].holm_p_value == found.confirmatory[0].p_value
    assert {study.comparisons[0].no_preference.margin for study in found.of(Preference).values()} == {0.2}
    assert [row.study for row in analyse(both, Settings(resamples=20)).confirmatory] == ["s1", "s2"]
