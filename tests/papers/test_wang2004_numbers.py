"""Numbers printed in Wang & Bodenheimer 2004, "Computing the Duration of Motion Transitions", section 5."""

from __future__ import annotations

import pandas as pd
import pytest

from study.analysis.preference.analyse import compare
from study.analysis.preference.published import published_test


@pytest.mark.parametrize(
    ("favouring", "percent", "chi_square", "to_two_places"),
    [(270, "96.4", "241.4", "241.43"), (184, "65.7", "27.7", "27.66"), (156, "55.7", "3.66", "3.66")],
    ids=["geodesic over fixed", "velocity over fixed", "geodesic over time-warping"],
)
def test_table_2(favouring: int, percent: str, chi_square: str, to_two_places: str) -> None:
    test = published_test(favouring, 280)
    assert test.percent is not None
    assert test.chi_square is not None
    assert f"{test.percent:.1f}" == percent
    assert f"{test.chi_square:.{len(chi_square.split('.')[1])}f}" == chi_square
    assert f"{test.chi_square:.2f}" == to_two_places
    assert test.degrees_of_freedom == 1


@pytest.mark.parametrize(("favouring", "significant"), [(270, True), (184, True), (156, False)])
def test_section_5_2_decides_at_the_level_01(favouring: int, significant: bool) -> None:
    """The alpha level is .01, the critical value 6.64 (more exactly 6.635)."""
    test = published_test(favouring, 280)
    assert test.p_value is not None
    assert test.chi_square is not None
    assert (test.p_value < 0.01) is significant
    assert (test.chi_square > 6.64) is significant


def test_table_2_from_answers_of_35_participants() -> None:
    """270 of 35 x 8 answers, given as a table of answers, print the same."""
    favouring = [True] * 270 + [False] * 10
    answers = pd.DataFrame(
        {
            "participant": [f"p{place % 35}" for place in range(280)],
            "task": "preference",
            "motion": [f"motion {place // 35}" for place in range(280)],
            "method_a": "geodesic",
            "method_b": "fixed",
            "chose_a": favouring,
        }
    )
    (result,) = compare(answers)
    assert result.published.answers == 280
    assert f"{result.published.percent:.1f}" == "96.4"
    assert f"{result.published.chi_square:.2f}" == "241.43"
    assert len(result.motions) == 8
