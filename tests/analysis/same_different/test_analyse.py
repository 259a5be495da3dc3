"""Figure 6's percentages and crossings: hand-made tables, and what must be said where nothing can be read off."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

from study.analysis.same_different.counts import Counts, count_answers, percent_different
from study.analysis.same_different.interpolation import crossing_of_lines, crossings
from study.errors import AnalysisError

LEVELS = np.array([-15.0, -10, -5, 0, 5, 10, 20])


def counts_of(shares: list[list[float]], levels: np.ndarray = LEVELS, answers: int = 6) -> Counts:
    shown = np.full((len(shares), len(levels)), float(answers))
    return Counts(tuple(f"p{i}" for i in range(len(shares))), levels, np.array(shares) * shown, shown)


def test_percent_and_standard_error_are_over_participants() -> None:
    """Three participants with 0, 1 and 2 of 2: mean 50%, standard error 50% / sqrt 3."""
    answers = pd.DataFrame(
        {
            "participant": ["a", "a", "b", "b", "c", "c"],
            "difference_frames": 5,
            "answer": ["same", "same", "same", "different", "different", "different"],
        }
    )
    (row,) = percent_different(count_answers(answers))
    assert (row.participants, row.answers, row.different) == (3, 6, 3)
    assert row.percent == pytest.approx(50.0)
    assert row.standard_error == pytest.approx(50 / np.sqrt(3))


def test_participants_count_alike_however_many_answers_they_missed() -> None:
    answers = pd.DataFrame(
        {
            "participant": ["a", "a", "b", "b"],
            "difference_frames": 5,
            "answer": ["different", None, "same", "same"],
        }
    )
    (row,) = percent_different(count_answers(answers))
    assert row.answers == 3
    assert row.percent == pytest.approx(50.0)


@pytest.mark.parametrize(
    ("shares", "expected"),
    [
        ([0.1, 0.5, 1.0, 1.0], 7.5),
        ([0.1, 0.75, 0.9, 1.0], 5.0),
        ([0.1, 0.2, 0.3, 0.7], np.inf),
        ([0.8, 0.9, 0.9, 1.0], 0.0),
        ([0.1, 0.8, 0.6, 0.9], 5 * 0.65 / 0.7),
    ],
    ids=["between", "on a level", "never", "from the start", "the first of several"],
)
def test_where_straight_lines_cross(shares: list[float], expected: float) -> None:
    assert crossing_of_lines(np.array([0.0, 5, 10, 20]), np.array(shares)) == pytest.approx(expected)


def test_crossings_on_both_sides() -> None:
    shares = [1.0, 0.9, 0.5, 0.1, 0.6, 0.9, 1.0]
    spread = np.array([0.0, 0.05, 0.1, 0.05, 0.1, 0.05, 0.0])
    found = crossings(counts_of([list(np.array(shares) + sign * spread) for sign in (-1, 0, 1)] * 4))
    assert found["shorter"].frames == pytest.approx(5 + 5 * 0.25 / 0.4)
    assert found["longer"].frames == pytest.approx(5 + 5 * 0.15 / 0.3)
    for threshold in found.values():
        assert threshold.standard_error is not None
        assert threshold.interval.low is not None
        assert threshold.interval.high is not None
        assert threshold.interval.low < (threshold.frames or 0) < threshold.interval.high


def test_a_threshold_beyond_the_levels_is_not_extrapolated() -> None:
    shares = [0.5, 0.4, 0.2, 0.1, 0.6, 0.9, 1.0]
    found = crossings(counts_of([list(np.clip(np.array(shares) + shift, 0, 1)) for shift in (-0.1, 0, 0.1)]))["shorter"]
    assert found.frames is None
    assert found.status == "not reached"
    assert "not reached within the levels shown (largest 15 frames: 50%)" in found.note
    assert found.interval.high is None


def test_a_curve_above_threshold_from_the_start_has_no_crossing() -> None:
    found = crossings(counts_of([[1.0] * 7, [0.9] * 7]))
    assert {threshold.status for threshold in found.values()} == {"above"}
    assert "no crossing to find" in found["longer"].note


def test_all_participants_alike_do_not_make_certainty() -> None:
    found = crossings(counts_of([[1.0, 1, 0.5, 0, 0.5, 1, 1]] * 5))["longer"]
    assert found.frames == pytest.approx(7.5)
    assert found.interval.low is None or found.interval.low < 7.0
    assert found.interval.high is None or found.interval.high > 8.0


def test_one_participant_has_a_crossing_and_no_interval() -> None:
    found = crossings(counts_of([[1.0, 0.9, 0.5, 0.1, 0.6, 0.9, 1.0]]))["longer"]
    assert found.frames is not None
    assert found.standard_error is None
    assert (found.interval.low, found.interval.high) == (None, None)
    assert "one participant" in found.note


def test_one_side_only() -> None:
    found = crossings(counts_of([[0.1, 0.6, 0.9]] * 2 + [[0.2, 0.7, 0.9]], np.array([0.0, 5, 10])))
    assert found["shorter"].status == "not estimable"
    assert found["shorter"].note == "no pair was shorter"
    assert found["longer"].frames is not None


def test_no_answers_at_all() -> None:
    answers = pd.DataFrame({"participant": ["a"], "difference_frames": [5], "answer": [None]})
    assert count_answers(answers).participants == ()
    assert {threshold.status for threshold in crossings(count_answers(answers)).values()} == {"not estimable"}
    assert percent_different(count_answers(answers)) == ()


def test_refusals_name_what_was_found() -> None:
    with pytest.raises(AnalysisError, match="found none named difference_frames"):
        count_answers(pd.DataFrame({"participant": ["a"], "answer": ["same"]}))
    with pytest.raises(AnalysisError, match="found 'yes'"):
        count_answers(pd.DataFrame({"participant": ["a"], "difference_frames": [0], "answer": ["yes"]}))


def test_missing_answers_leave_numbers_finite(same_different_study: Callable[..., pd.DataFrame]) -> None:
    answers = same_different_study(np.random.default_rng(4), participants=6, missed=0.7)
    counts = count_answers(answers)
    assert (counts.shown == 0).any(), "the case this test is for"
    for threshold in crossings(counts, resamples=200).values():
        assert threshold.frames is None or np.isfinite(threshold.frames)


def test_intervals_of_crossings_cover_the_crossing_of_the_true_percentages() -> None:
    """Eight observers a study, 300 studies; 95% intervals are wanted, and fewer than 91% would be noticed."""
    rng = np.random.default_rng(20)
    truth = np.array([0.98, 0.87, 0.49, 0.2, 0.55, 0.92, 0.98])
    true_crossing = float(crossing_of_lines(np.array([0.0, 5, 10, 20]), truth[3:]))
    inside = 0
    for _ in range(300):
        shares = rng.binomial(6, truth, size=(8, 7)) / 6
        interval = crossings(counts_of(shares.tolist()), resamples=2)["longer"].interval
        inside += (interval.low or 0) <= true_crossing <= (interval.high or np.inf)
    assert 0.91 <= inside / 300 <= 0.99
