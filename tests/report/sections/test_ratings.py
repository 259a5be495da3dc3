"""The section of a rating study: its comparison of two methods as 2003 published it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from study.analysis.crossed import GeneralTest
from study.analysis.estimates import MeanTest
from study.analysis.ratings.analyse import Ratings
from study.analysis.ratings.comparisons import MethodDifference, MixedDesign, Question, Ranks, rating_anova
from study.analysis.ratings.table import MethodRating, rating_table
from study.analysis.variance.two_way import VarianceEffect, VarianceRow
from study.report.sections.ratings.section import ratings_section
from study.report.sections.section import About, Section


def question(item: str, mean: float, f: float, p: float) -> Question:
    effect = VarianceEffect("method", f, 1, f, f, 48, p, partial_eta_squared=0.1)
    test = MeanTest(26, mean, 0.2, 0.0, 1.0, "", t=2.0, degrees_of_freedom=25, p_value=p)
    general = GeneralTest(**vars(test), test="Student's t over participants", generalises_to="participants")
    difference = MethodDifference(**vars(general), of="cut-wang2003 minus cut-lee2002", holm_p_value=p)
    return Question(
        item=item,
        participants=26,
        answers=52,
        anova=(effect, effect, effect, VarianceRow("residual", 48.0, 48, 1.0)),
        differences=(difference,),
        difference=difference,
        mixed_design=MixedDesign((), ("method",), 26, 0, ""),
        ranks=Ranks(None, ""),
        note="",
    )


ROWS = tuple(
    MethodRating(26, mean, 0.2, mean - 0.4, mean + 0.4, "", "natural", method, 26, 1.0, 2.0, {"2": 26})
    for method, mean in (("cut-lee2002", 1.5), ("cut-wang2003", 2.2))
)


def shown(result: Ratings, about: About) -> Section:
    section = ratings_section(result, about)
    assert section is not None
    return section


def test_the_headline_says_how_many_questions_and_with_which_f() -> None:
    questions = (question("natural", 0.7, 6.39, 0.0148), question("smooth", 0.3, 1.2, 0.28))
    section = shown(Ratings(ROWS, questions), About("cuts", "Cuts"))
    (headline,) = section.headlines
    assert "was rated higher than" in headline.statement
    assert "in 2 of 2 questions, in 1 of them significantly at 0.05 across participants" in headline.statement
    start = "Natural: as published F(1, 48) = 6.39, p = .015; over participants: 0.70 [0.00, 1.00], t(25) = "
    assert headline.detail.startswith(start)
    assert "Smooth: as published F(1, 48) = 1.20, p = .28" in headline.detail
    assert [table.name for table in section.tables] == ["cuts_ratings", "cuts_anova", "cuts_differences"]
    assert {"degrees_of_freedom", "error_degrees_of_freedom"} <= {column.key for column in section.tables[1].columns}


def test_the_worse_method_is_not_called_better() -> None:
    result = Ratings(ROWS, (question("natural", -0.7, 6.39, 0.0148),))
    (headline,) = shown(result, About("cuts", "Cuts")).headlines
    assert headline.statement == (
        "Cut-lee2002 was rated 0.70 points higher than cut-wang2003 on average, on a scale of 0 to 4; across "
        "participants, this is significant (p = .015)."
    )


def ratings_of(values: dict[str, list[float]]) -> pd.DataFrame:
    """One rating of each method a participant, all shown in the same order."""
    rows = [
        (f"p{person}", "rating", method, trial, str(value))
        for trial, (method, own) in enumerate(values.items())
        for person, value in enumerate(own)
    ]
    return pd.DataFrame(rows, columns=["participant", "task", "method_a", "trial", "answer"])


def section_of(values: dict[str, list[float]]) -> Section:
    answers = ratings_of(values)
    return shown(Ratings(rating_table(answers), rating_anova(answers)), About("s", "Sliders", points=101))


def test_three_methods_are_tested_together_and_in_pairs() -> None:
    """F by statsmodels' repeated-measures analysis of variance, p-values of pairs by Holm's method."""
    from statsmodels.stats.anova import AnovaRM

    rng = np.random.default_rng(4)
    values = {
        name: [round(float(x), 2) for x in rng.normal(mean, 15, 16)]
        for name, mean in zip("abc", (30, 45, 60), strict=True)
    }
    section = section_of(values)
    table = ratings_of(values).astype({"answer": float})
    expected = AnovaRM(table, "answer", "participant", within=["method_a"]).fit().anova_table.iloc[0]["F Value"]
    assert f"all methods over participants F(2, 30) = {expected:.2f}, p" in section.headlines[0].detail
    assert "by ranks (Friedman) p" in section.headlines[0].detail
    differences = next(shown for shown in section.tables if shown.name == "s_differences")
    assert [row["of"] for row in differences.rows] == ["b minus a", "c minus a", "c minus b"]
    assert all(row["holm_p_value"] >= row["p_value"] for row in differences.rows)


def test_participants_who_all_differ_alike_are_tested_by_signs() -> None:
    section = section_of({"a": [5.0] * 12, "b": [1.0] * 12})
    assert "A was rated 4.00 points higher than b" in section.headlines[0].statement
    told = "over participants, for these motions: −4.00 for every participant, exact sign test p < .001"
    assert told in section.headlines[0].detail


def test_a_single_method_has_no_comparison() -> None:
    section = shown(Ratings(ROWS[:1], ()), About("cuts", "Cuts"))
    assert [table.name for table in section.tables] == ["cuts_ratings"]
    assert section.headlines[0].statement == "Natural: cut-lee2002 was rated 1.50 on average, on a scale of 0 to 4."
    assert "26 participants" in section.headlines[0].detail
