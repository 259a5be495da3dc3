"""Published data of designed experiments with openly documented analyses: between, within, and points on a scale."""

from __future__ import annotations

import numpy as np
import pytest

from study.analysis.variance.repeated_measures import mixed_design
from study.analysis.variance.two_way import two_way

# Crampton 1947, length of teeth by delivery of vitamin C and dose: `ToothGrowth` in R, ten animals a cell.
TEETH = {
    ("OJ", 0.5): [15.2, 21.5, 17.6, 9.7, 14.5, 10.0, 8.2, 9.4, 16.5, 9.7],
    ("OJ", 1.0): [19.7, 23.3, 23.6, 26.4, 20.0, 25.2, 25.8, 21.2, 14.5, 27.3],
    ("OJ", 2.0): [25.5, 26.4, 22.4, 24.5, 24.8, 30.9, 26.4, 27.3, 29.4, 23.0],
    ("VC", 0.5): [4.2, 11.5, 7.3, 5.8, 6.4, 10.0, 11.2, 11.2, 5.2, 7.0],
    ("VC", 1.0): [16.5, 16.5, 15.2, 17.3, 22.5, 17.3, 13.6, 14.5, 18.8, 15.5],
    ("VC", 2.0): [23.6, 18.5, 33.9, 25.5, 26.4, 32.5, 26.7, 21.5, 23.3, 29.5],
}


def test_two_factors_between_as_r_prints_them() -> None:
    """R's documentation of `aov`: supp F(1, 54) = 15.572, dose F(2, 54) = 92.000, interaction 4.107, p = 0.021860."""
    cells = [(value, *cell) for cell, values in TEETH.items() for value in values]
    length, supp, dose = zip(*cells, strict=True)
    rows = two_way(length, supp, dose, ("supp", "dose"))
    assert [row.sum_of_squares for row in rows] == pytest.approx([205.4, 2426.4, 108.3, 712.1], abs=0.05)
    assert [row.degrees_of_freedom for row in rows] == [1, 2, 2, 54]
    assert [row.f for row in rows[:3]] == pytest.approx([15.572, 92.000, 4.107], abs=5e-4)
    assert rows[0].p_value == pytest.approx(0.000231, abs=5e-7)
    assert rows[2].p_value == pytest.approx(0.021860, abs=5e-7)


def test_one_factor_within_with_its_corrections() -> None:
    """Maxwell & Delaney, Designing Experiments, chapter 11: McCarthy scores of 12 children at 4 ages.

    Printed: SS 552 and 2,006, F(3, 33) = 3.03, epsilon 0.61 (Greenhouse-Geisser) and 0.725 (Huynh-Feldt), so that
    p = .042 becomes .075. The numbers were remembered; that they give the printed sums is what speaks for them.
    """
    scores = np.array(
        [
            [108, 96, 110, 122], [103, 117, 127, 133], [96, 107, 106, 107], [84, 85, 92, 99], [118, 125, 125, 116],
            [110, 107, 96, 91], [129, 128, 123, 128], [90, 84, 101, 113], [84, 104, 100, 88], [96, 100, 103, 105],
            [105, 114, 105, 112], [113, 117, 132, 130],
        ]
    )  # fmt: skip
    found = mixed_design(scores, ["all"] * 12, ["age"])
    assert not isinstance(found, str)
    (age,) = found
    assert (age.sum_of_squares, age.error_sum_of_squares) == (pytest.approx(552), pytest.approx(2006))
    assert age.f == pytest.approx(3.03, abs=0.005)
    assert age.p_value == pytest.approx(0.042, abs=0.002)
    assert age.epsilon == pytest.approx(0.61, abs=0.005)
    assert age.corrected_p_value == pytest.approx(0.075, abs=0.0005)
