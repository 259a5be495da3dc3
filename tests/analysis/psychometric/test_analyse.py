"""Psychometric functions of several people: what is said of the group rests on people, not on answers."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm, t

from study.analysis.psychometric.analyse import analyse_psychometric
from study.analysis.psychometric.mixed import psychometric_mixed
from study.analysis.psychometric.model import make_model

LEVELS = np.arange(1.0, 8.0)


def trials(thresholds: list[float], answers: int = 40, seed: int = 0, guess: float = 0.5) -> pd.DataFrame:
    rng, rows = np.random.default_rng(seed), []
    for person, threshold in enumerate(thresholds):
        share = guess + (0.98 - guess) * norm.cdf(LEVELS, threshold, 1.0)
        rows += [
            {"participant": f"p{person}", "level": level, "yes": rng.binomial(answers, p), "shown": answers}
            for level, p in zip(LEVELS, share, strict=True)
        ]
    return pd.DataFrame(rows)


def test_people_who_differ_are_not_taken_for_one_person() -> None:
    result = analyse_psychometric(trials([2.6, 3.2, 3.6, 4.2, 4.8, 5.4]))
    pooled, mixed, group = result.pooled.threshold.interval, result.mixed, result.group
    assert mixed.high - mixed.low > 1.5 * (pooled.high - pooled.low)
    assert group.high - group.low > 1.5 * (pooled.high - pooled.low)
    assert mixed.low < 4.0 < mixed.high
    assert result.answer.startswith(f"The threshold of a typical one of 6 participants is {mixed.threshold:.4g}")
    assert "too sure where people differ" in result.answer


def test_one_person_has_the_own_interval() -> None:
    result = analyse_psychometric(trials([4.0]))
    found = result.participants[0].threshold
    assert result.mixed is None
    low, high = found.interval.low, found.interval.high
    assert result.answer == f"The threshold is {found.value:.2f} (95% interval {low:.2f} to {high:.2f})."


def test_without_a_mixed_model_the_mean_over_people_stands() -> None:
    result = analyse_psychometric(trials([3.6, 4.0, 4.4]), make_model(sigmoid="gumbel"))
    assert result.mixed is None
    assert "mean threshold of 3 participants" in result.answer
    assert "by Student's t over them" in result.answer


@pytest.mark.parametrize(
    ("thresholds", "says"),
    [([20.0] * 4, "threshold"), ([-20.0] * 4, "below the levels shown")],
    ids=["chance", "perfect"],
)
def test_a_group_without_a_threshold_gets_none(thresholds: list[float], says: str) -> None:
    answers = trials(thresholds)
    if says == "below the levels shown":
        answers["yes"] = answers["shown"]
    result = analyse_psychometric(answers)
    assert result.group.mean_threshold is None
    assert result.mixed is None or result.mixed.threshold is None
    assert result.answer.startswith("No threshold")
    assert says in str(result.participants)


def test_motions_that_differ_have_a_mean_threshold_that_holds_for_others() -> None:
    """Thresholds 3, 4 and 5: the mean, with Student's interval of three where answers and people are many."""
    rng = np.random.default_rng(21)
    rows = [
        (f"p{person}", f"m{motion}", level, rng.binomial(20, norm.cdf(level - 3 - motion - lean)), 20)
        for person, lean in enumerate(0.3 * rng.standard_normal(40))
        for motion in range(3)
        for level in range(1, 8)
    ]
    table = pd.DataFrame(rows, columns=["participant", "motion", "level", "yes", "shown"])
    found = psychometric_mixed(table)
    assert found.threshold == pytest.approx(4, abs=0.15)
    assert found.motion_spread == pytest.approx(1, abs=0.1)
    assert found.standard_error == pytest.approx(1 / 3**0.5, rel=0.1)
    assert found.high - found.threshold == pytest.approx(found.standard_error * t.ppf(0.975, 2), rel=0.4)
    assert found.generalises_to == "participants and motions"
    alone = psychometric_mixed(table.drop(columns="motion"))
    assert alone.generalises_to == "participants, for these motions"
    assert alone.standard_error < found.standard_error / 3
    assert alone.slope < 0.9 * found.slope
