from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from study.analysis.ratings.analyse import anova_sentences
from study.analysis.ratings.comparisons import rating_anova
from study.analysis.variance.effect_sizes import sizes
from study.analysis.variance.two_way import two_way
from study.errors import AnalysisError

NAMES = ("cost", "order")


def balanced(rng: np.random.Generator, per_cell: int = 13) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    a, b = np.repeat([0, 0, 1, 1], per_cell), np.repeat([0, 1, 0, 1], per_cell)
    return 2.0 + 0.7 * a + 0.2 * b + rng.normal(size=4 * per_cell), a, b


def test_a_balanced_design_gives_the_textbook_sums() -> None:
    y, a, b = balanced(np.random.default_rng(0))
    rows = {row.source: row for row in two_way(y, a, b, NAMES)}
    cells = np.array([[y[(a == i) & (b == j)].mean() for j in (0, 1)] for i in (0, 1)])
    within = sum(np.sum((y[(a == i) & (b == j)] - cells[i, j]) ** 2) for i in (0, 1) for j in (0, 1))
    expected = {
        "cost": 26 * np.sum((cells.mean(axis=1) - y.mean()) ** 2),
        "order": 26 * np.sum((cells.mean(axis=0) - y.mean()) ** 2),
    }
    expected["cost x order"] = np.sum((y - y.mean()) ** 2) - within - sum(expected.values())
    for name, squares in expected.items():
        assert rows[name].sum_of_squares == pytest.approx(squares)
        assert (rows[name].degrees_of_freedom, rows[name].error_degrees_of_freedom) == (1, 48)
        f = squares / (within / 48)
        assert rows[name].f == pytest.approx(f)
        assert rows[name].p_value == pytest.approx(stats.f.sf(f, 1, 48))
    assert rows["residual"].sum_of_squares == pytest.approx(within)
    assert rows["residual"].degrees_of_freedom == 48


def test_an_unbalanced_design_compares_with_and_without_each_effect() -> None:
    rng = np.random.default_rng(1)
    y, a, b = balanced(rng)
    keep = rng.random(len(y)) < 0.7
    y, a, b = y[keep], a[keep], b[keep]
    # Type III of a 2 x 2 is the test of unweighted means of cells, here by the contrast's own variance.
    cells = [(i, j) for i in (0, 1) for j in (0, 1)]
    means = np.array([y[(a == i) & (b == j)].mean() for i, j in cells])
    counts = np.array([np.sum((a == i) & (b == j)) for i, j in cells])
    within = sum(np.sum((y[(a == i) & (b == j)] - m) ** 2) for (i, j), m in zip(cells, means, strict=True))
    left = len(y) - 4
    rows = {row.source: row for row in two_way(y, a, b, NAMES)}
    for name, contrast in (("cost", [-1, -1, 1, 1]), ("order", [-1, 1, -1, 1]), ("cost x order", [1, -1, -1, 1])):
        value, variance = np.dot(contrast, means), np.sum(np.square(contrast) / counts)
        assert rows[name].f == pytest.approx(value**2 / variance / (within / left))
        assert rows[name].error_degrees_of_freedom == left


def test_unequal_cells_against_statsmodels() -> None:
    import statsmodels.formula.api as smf
    from statsmodels.stats.anova import anova_lm

    rng = np.random.default_rng(6)
    a, b = rng.integers(0, 3, 70), rng.integers(0, 2, 70)
    data = pd.DataFrame({"y": 0.4 * a * b + rng.normal(size=70), "a": a, "b": b})
    expected = anova_lm(smf.ols("y ~ C(a, Sum) * C(b, Sum)", data).fit(), typ=3)
    rows = two_way(data["y"], data["a"], data["b"], ("a", "b"))
    for row, name in zip(rows, ["C(a, Sum)", "C(b, Sum)", "C(a, Sum):C(b, Sum)", "Residual"], strict=True):
        assert row.sum_of_squares == pytest.approx(expected.loc[name, "sum_sq"])
        assert row.degrees_of_freedom == expected.loc[name, "df"]
    assert rows[0].p_value == pytest.approx(expected.loc["C(a, Sum)", "PR(>F)"])


def test_three_levels_have_two_degrees_of_freedom() -> None:
    rng = np.random.default_rng(2)
    a, b = np.tile([0, 1, 2], 20), np.repeat([0, 1], 30)
    rows = two_way(rng.normal(size=60), a, b, NAMES)
    assert [row.degrees_of_freedom for row in rows] == [2, 1, 2, 54]


def test_the_published_f_has_its_degrees_of_freedom() -> None:
    """2003 section 4.2: 26 participants, two sequences each, F = 6.39, p = 0.01: with 1 and 48, p = 0.0148."""
    assert stats.f.sf(6.39, 1, 48) == pytest.approx(0.0148, abs=2e-4)
    y, a, b = balanced(np.random.default_rng(0))
    assert two_way(y, a, b, NAMES)[0].error_degrees_of_freedom == 26 * 2 - 4


@pytest.mark.parametrize(
    ("a", "b", "words"),
    [
        ([0, 0, 0, 0], [0, 1, 0, 1], "two levels of cost, found 0"),
        ([0, 0, 1, 1], [0, 1, 0, 0], "found none for 1 with 1"),
        ([0, 0, 1, 1], [0, 1, 0, 1], "more answers than the 4"),
    ],
)
def test_designs_that_tell_nothing_are_refused(a: list[int], b: list[int], words: str) -> None:
    with pytest.raises(AnalysisError, match=words):
        two_way([1.0, 2.0, 3.0, 4.0], a, b, NAMES)


def rating_answers(rng: np.random.Generator, participants: int = 26, better: float = 0.73) -> pd.DataFrame:
    """2003's study: two groups by order, two sequences, a question."""
    rows = []
    for number in range(participants):
        methods = ["cut-lee2002", "cut-wang2003"]
        shown = methods if number % 2 == 0 else methods[::-1]
        own = rng.normal(scale=0.5)
        for trial, method in enumerate(shown, start=1):
            rating = 2.0 + own + better * (method == "cut-wang2003") + rng.normal(scale=0.9)
            answer = str(int(np.clip(round(rating), 0, 4)))
            one = {"participant": f"p{number:02d}", "task": "rating", "trial": trial, "method_a": method}
            rows += [{**one, "item": item, "answer": answer} for item in ("realistic", "natural")]
    return pd.DataFrame(rows)


def test_the_rating_study_is_analysed_as_published_and_by_participants() -> None:
    answers = rating_answers(np.random.default_rng(3))
    found = rating_anova(answers)
    assert [question.item for question in found] == ["realistic", "natural"]
    question = found[0]
    assert [row.source for row in question.anova] == ["method", "order", "method x order", "residual"]
    assert question.anova[0].error_degrees_of_freedom == 48
    # The method's effect is of the size that was put in, and its test by participants has 25 degrees of freedom.
    assert question.difference.of == "cut-wang2003 minus cut-lee2002"
    assert question.difference.mean == pytest.approx(0.73, abs=0.5)
    assert question.difference.degrees_of_freedom == 25
    one = answers[answers["item"] == "realistic"].assign(answer=lambda rows: rows["answer"].astype(float))
    wide = one.pivot_table(index="participant", columns="method_a", values="answer")
    paired = stats.ttest_rel(wide["cut-wang2003"], wide["cut-lee2002"])
    assert question.difference.t == pytest.approx(paired.statistic)
    assert question.difference.p_value == pytest.approx(paired.pvalue)
    sentences = anova_sentences(found, 0.05)
    assert len(sentences) == 8
    assert sum("F(1, 48) = " in sentence for sentence in sentences) == 6
    assert "cut-wang2003 minus cut-lee2002 over participants" in sentences[3]
    assert "t(25) = " in sentences[3]


def test_known_effects_are_found_as_often_as_they_should_be() -> None:
    """No effect: 5% of tests; the paper's effect, 0.73 points: most of them."""
    rng = np.random.default_rng(4)
    found = {0.0: 0, 0.73: 0}
    for better in found:
        for _ in range(60):
            answers = rating_answers(rng, better=better)
            row = rating_anova(answers[answers["item"] == "natural"])[0].anova[0]
            found[better] += row.p_value < 0.05
    assert found[0.0] <= 8
    assert found[0.73] >= 30


def test_a_group_that_is_not_there_is_said() -> None:
    answers = rating_answers(np.random.default_rng(5))
    one_order = answers[answers["participant"].str[1:].astype(int) % 2 == 0]
    question = rating_anova(one_order)[0]
    assert question.anova == ()
    assert "two levels of order" in question.note
    assert not math.isnan(question.difference.mean)
    assert rating_anova(answers[answers["method_a"] == "cut-lee2002"]) == ()


def test_the_interval_of_an_effect_size_is_where_the_noncentral_f_puts_it() -> None:
    found = sizes(6.39, 1, 48)
    assert found.partial_eta_squared == pytest.approx(6.39 / (6.39 + 48))
    for end, probability in ((found.effect_low, 0.95), (found.effect_high, 0.05)):
        assert end is not None
        assert stats.ncf.cdf(6.39, 1, 48, 50 * end / (1 - end)) == pytest.approx(probability, abs=1e-6)
    assert sizes(0.5, 2, 30).effect_low == 0


def test_the_interval_of_an_effect_size_covers_as_often_as_it_says() -> None:
    rng = np.random.default_rng(7)
    a, b = np.repeat([0, 0, 1, 1], 13), np.repeat([0, 1, 0, 1], 13)
    truth = 0.35**2 / (0.35**2 + 1)  # 0.7 between the levels, in units of the error
    inside = []
    for _ in range(600):
        row = two_way(0.7 * a + rng.normal(size=52), a, b, NAMES)[0]
        inside.append(row.effect_low <= truth <= row.effect_high)
    assert np.mean(inside) == pytest.approx(0.9, abs=0.035)


def test_tests_over_participants_agree_where_they_ask_the_same() -> None:
    """Two methods, two groups: the mixed design's F of the methods is the square of a t; ranks agree."""
    question = rating_anova(rating_answers(np.random.default_rng(3), participants=40, better=1.0))[0]
    effects = {row.source: row for row in question.mixed_design.effects}
    assert list(effects) == ["order", "method", "method x order"]
    assert effects["method"].f == pytest.approx(question.difference.t**2, rel=0.05)
    assert effects["method"].error_degrees_of_freedom == 38
    assert question.ranks.participants.test == "Wilcoxon's signed ranks"
    assert max(effects["method"].p_value, question.ranks.participants.p_value) < 0.01


def test_motions_within_participants_are_a_factor_where_everybody_saw_them() -> None:
    rng = np.random.default_rng(9)
    rows = [
        {"participant": f"p{p}", "task": "rating", "trial": t, "method_a": m, "motion": n, "answer": rng.integers(0, 5)}
        for p in range(12)
        for t, (m, n) in enumerate(rng.permutation([(m, n) for m in "abc" for n in "xyz"]))
    ]
    (question,) = rating_anova(pd.DataFrame(rows))
    assert question.mixed_design.factors == ("method", "motion")
    effects = {row.source: row for row in question.mixed_design.effects}
    assert effects["method x motion"].degrees_of_freedom == 4
    assert 0.25 <= effects["method x motion"].epsilon < 1
    assert question.ranks.participants.degrees_of_freedom == 2
    (fewer,) = rating_anova(pd.DataFrame(rows[:-1]))
    assert fewer.mixed_design.factors == ("method",)
    assert fewer.mixed_design.participants == 12
