"""Headlines: one entry a question, with the numbers of the estimate that the rule names and nothing more certain."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest

from study.analysis.analyse import analyse, analysis_json
from study.analysis.preference.analyse import Preference
from study.analysis.same_different.analyse import SameDifferent
from study.analysis.study_result import Settings

Make = Callable[..., pd.DataFrame]
KEYS = {"study", "statement", "estimate", "unit", "interval", "p", "p_adjusted", "test", "generalises_to", "note"}


def told(answers: pd.DataFrame) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = analysis_json(analyse(answers, Settings(resamples=20)))["headline"]
    for one in found:
        assert set(one) == KEYS
        assert set(one["interval"]) == {"low", "high", "confidence"}
        assert one["statement"].endswith(".")
        assert one["p"] is not None or one["note"]
    return found


def test_preferences_have_the_share_over_participants_and_motions_adjusted_over_their_family(
    preference_study: Make,
) -> None:
    rng = np.random.default_rng(3)
    answers = pd.concat([preference_study(rng, share=0.75).assign(study=name) for name in ("one", "other")])
    found = told(answers)
    analysis = analyse(answers, Settings(resamples=20))
    for one, test in zip(found, analysis.confirmatory, strict=True):
        (compared,) = analysis.of(Preference)[one["study"]].comparisons
        both = compared.motions_as_sample.both
        assert both is not None
        assert (one["estimate"], one["interval"]["low"], one["p"]) == (both.percent, both.low, both.p_value)
        assert one["generalises_to"] == "participants and motions"
        assert one["p_adjusted"] == test.holm_p_value
    assert max(one["p_adjusted"] / one["p"] for one in found) == pytest.approx(2.0)


def test_a_preference_over_two_motions_holds_for_these_alone(preference_study: Make) -> None:
    answers = preference_study(np.random.default_rng(4), share=0.7)
    two = answers[answers["motion"].isin(["motion 0", "motion 1"])]
    (compared,) = analyse(two, Settings(resamples=20)).of(Preference)["geodesic"].comparisons
    assert compared.motions_as_sample.both is None
    assert "fewer than three motions" in compared.motions_as_sample.note
    (one,) = told(two)
    assert one["generalises_to"] == "participants, for these motions"
    assert "for these motions" in one["statement"]
    assert one["test"] == "Student's t over participants"


def test_thresholds_are_those_of_the_median_observer_or_of_the_group(same_different_study: Make) -> None:
    answers = same_different_study(np.random.default_rng(5))
    result = analyse(answers, Settings(resamples=20)).of(SameDifferent)["jnd"]
    assert result.mixed is not None
    assert {one["unit"]: one["estimate"] for one in told(answers)} == {
        f"frames {side} than the reference": threshold.frames for side, threshold in result.mixed.typical.items()
    }
    alone = told(answers[answers["participant"] == "p00"])
    assert all("participant's" in one["statement"] for one in alone)
    assert {one["generalises_to"] for one in alone} == {"further responses of this participant"}


def test_one_method_has_the_mean_of_its_ratings() -> None:
    rows = [(f"p{person}", "rating", "cut", trial, str(person % 3 + 1)) for person in range(6) for trial in (1, 2)]
    answers = pd.DataFrame(rows, columns=["participant", "task", "method_a", "trial", "answer"])
    (one,) = told(answers)
    assert (one["estimate"], one["p"], one["unit"]) == (2.0, None, "points of the scale, cut")
    assert one["statement"] == "cut: mean 2.00 over 6 participants."
    assert one["interval"]["low"] < 2 < one["interval"]["high"]
