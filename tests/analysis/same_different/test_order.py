"""The test that pairs are answered alike in both orders."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from study.analysis.same_different.order import order_test


def test_order_is_tested_over_participants(same_different_study: Callable[..., pd.DataFrame]) -> None:
    alike = order_test(same_different_study(np.random.default_rng(1), participants=30))
    assert alike.p_value > 0.01
    assert abs(alike.difference_percent) < 5
    data = same_different_study(np.random.default_rng(2), participants=30)
    flip = data["reference_first"] & (np.random.default_rng(3).random(len(data)) < 0.7)
    data.loc[flip, "answer"] = "different"
    biased = order_test(data)
    assert biased.p_value < 0.001
    assert biased.difference_percent > 5


def test_an_order_that_never_changed_or_is_not_known_is_said() -> None:
    one = pd.DataFrame({"participant": ["a"], "difference_frames": [5], "reference_first": [True], "answer": ["same"]})
    assert "same order" in order_test(one).note
    assert "not known" in order_test(one.drop(columns="reference_first")).note
