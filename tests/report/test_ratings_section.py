"""The section of a rating study: its comparison of two methods as 2003 published it."""

from __future__ import annotations

from typing import Any

from study.report.ratings_section import ratings_section


def question(item: str, mean: float, f: float, p: float) -> dict[str, Any]:
    effect = {"degrees_of_freedom": 1, "error_degrees_of_freedom": 48, "sum_of_squares": f, "mean_square": f}
    effect |= {"source": "method", "f": f, "p_value": p, "partial_eta_squared": 0.1}
    rest = {"source": "residual", "degrees_of_freedom": 48, "sum_of_squares": 48.0, "mean_square": 1.0}
    difference = {"of": "cut-wang2003 minus cut-lee2002", "mean": mean, "low": 0.0, "high": 1.0, "t": 2.0}
    difference |= {"degrees_of_freedom": 25, "p_value": p}
    nothing = {"type_ii": None, "ordinal": None, "participants": 26, "answers": 52, "note": ""}
    nothing |= {"mixed_design": {"effects": [], "note": ""}, "ranks": {"between": [], "participants": None, "note": ""}}
    return {"item": item, "anova": [effect, rest], "difference": difference, **nothing}


ROWS = [
    {"item": "natural", "method": method, "answers": 26, "participants": 26, "mean": mean, "standard_error": 0.2}
    | {"low": mean - 0.4, "high": mean + 0.4, "median": 2.0, "standard_deviation": 1.0, "distribution": {"2": 26}}
    for method, mean in (("cut-lee2002", 1.5), ("cut-wang2003", 2.2))
]


def test_the_headline_says_how_many_questions_and_with_which_f() -> None:
    variance = [question("natural", 0.7, 6.39, 0.0148), question("smooth", 0.3, 1.2, 0.28)]
    section = ratings_section("cuts", "Cuts", ROWS, variance, mark="", points=5, alpha=0.05)
    (headline,) = section.headlines
    assert "was rated higher than" in headline.statement
    assert "in 2 of 2 questions, in 1 of them significantly at 0.05 across 26 participants" in headline.statement
    start = "Natural: as published F(1, 48) = 6.39, p = .015; over participants 0.70 [0.00, 1.00], t(25) = "
    assert headline.detail.startswith(start)
    assert "Smooth: as published F(1, 48) = 1.20, p = .28" in headline.detail
    assert [table.name for table in section.tables] == ["cuts_ratings", "cuts_anova", "cuts_differences"]
    assert {"degrees_of_freedom", "error_degrees_of_freedom"} <= {column.key for column in section.tables[1].columns}


def test_the_worse_method_is_not_called_better() -> None:
    variance = [question("natural", -0.7, 6.39, 0.0148)]
    (headline,) = ratings_section("cuts", "Cuts", ROWS, variance, mark="", points=5).headlines
    assert headline.statement == (
        "Cut-lee2002 was rated 0.70 points higher than cut-wang2003 on average, on a scale of 0 to 4; across "
        "participants "
        "this is not chance (p = .015)."
    )


def test_a_single_method_has_no_comparison() -> None:
    section = ratings_section("cuts", "Cuts", ROWS[:1], (), mark="", points=5)
    assert [table.name for table in section.tables] == ["cuts_ratings"]
    assert section.headlines[0].statement == "Natural: cut-lee2002 was rated 1.50 on average, on a scale of 0 to 4."
    assert "26 participants" in section.headlines[0].detail
