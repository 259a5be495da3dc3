"""Preferences and ratings of hopeless data: statements, never a crash, a NaN in silence, or a false certainty."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
import pytest

from study.analysis.analyse import analyse, analysis_json
from study.analysis.confirmatory import confirmatory
from study.analysis.preference.analyse import Preference, compare, strengths
from study.analysis.ratings.analyse import anova_sentences
from study.analysis.ratings.comparisons import rating_anova
from study.analysis.ratings.table import rating_table
from study.analysis.study_result import Settings
from study.analysis.to_json import to_json
from study.errors import AnalysisError


def preference_table(rng: np.random.Generator) -> pd.DataFrame:
    """A small, mostly unreasonable study: few people, missing cells, one-sided answers, orders that never change."""
    people, motions = int(rng.integers(1, 7)), int(rng.integers(1, 5))
    methods = ["order", "fixed", "none"][: int(rng.integers(2, 4))]
    chance = rng.choice([0.0, 0.5, 1.0])
    one_order = rng.random() < 0.3
    rows = []
    for person in range(people):
        own = rng.choice([0.0, 1.0]) if rng.random() < 0.3 else chance
        for motion in range(motions):
            for a, b in [(a, b) for place, a in enumerate(methods) for b in methods[place + 1 :]]:
                if rng.random() < 0.25:
                    continue
                chose: float | bool | None = bool(rng.random() < own)
                if rng.random() < 0.1:
                    chose = rng.choice([None, 0.5])
                first = True if one_order else bool(rng.integers(2))
                rows.append((f"p{person}", "preference", f"m{motion}", a, b, first, chose))
    names = ["participant", "task", "motion", "method_a", "method_b", "a_first", "chose_a"]
    table = pd.DataFrame(rows, columns=names).astype({"chose_a": object})
    table["answer"] = table["chose_a"]
    if rng.random() < 0.2:
        table["a_first"] = None
    if rng.random() < 0.2:
        table = table.drop(columns="motion")
    return table


def rating_answers(rng: np.random.Generator) -> pd.DataFrame:
    """Ratings with few people, methods without answers, points nobody or everybody chose."""
    people, methods = int(rng.integers(1, 6)), ["a", "b", "c"][: int(rng.integers(1, 4))]
    points = rng.choice([1, 2, 5])
    rows = []
    for person in range(people):
        for trial, method in enumerate(rng.permutation(methods)):
            for item in ("natural", "quality"):
                if rng.random() < 0.2:
                    continue
                point: str | None = str(rng.integers(points)) if rng.random() > 0.1 else None
                if rng.random() < 0.2:
                    point = "4" if method == "b" else "0"
                rows.append((f"p{person}", "rating", trial, method, item, point, f"m{trial % 2}"))
    return pd.DataFrame(rows, columns=["participant", "task", "trial", "method_a", "item", "answer", "motion"])


def numbers(value: Any, place: str = "") -> Iterator[tuple[str, float]]:
    """All numbers of a result, with the way to them."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from numbers(inner, f"{place}.{key}")
    elif isinstance(value, list | tuple):
        for number, inner in enumerate(value):
            yield from numbers(inner, f"{place}[{number}]")
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield place, float(value)


def check(result: Any) -> None:
    """Plain JSON; p-values are probabilities, percentages shares, spreads and errors above zero."""
    result = to_json(result)
    json.dumps(result, allow_nan=False)
    for place, number in numbers(result):
        assert math.isfinite(number), place
        if place.endswith("p_value"):
            assert 0 <= number <= 1, place
        if "percent" in place.rpartition(".")[2]:
            assert -1e-9 <= number <= 100 + 1e-9, place
        if place.endswith(("standard_error", "spread", "eta_squared", "epsilon")):
            assert number >= 0, place


@pytest.mark.parametrize("seed", [*range(20), 1059])
def test_unreasonable_preferences(seed: int) -> None:
    rng = np.random.default_rng([seed, 1])
    table = preference_table(rng)
    results = compare(table)
    check(results)
    check(strengths(table))
    check(confirmatory({"one": Preference(results, None)}))
    for result in results:
        assert result.answer
        people = result.participants
        if people.participants < 2:
            assert people.p_value is None
            assert result.motions_as_sample.both is None
        if people.p_value is None or people.low is None:
            assert people.note or result.published.answers == 0


@pytest.mark.parametrize("seed", range(20))
def test_unreasonable_ratings(seed: int) -> None:
    rng = np.random.default_rng([seed, 2])
    table = rating_answers(rng)
    check(rating_table(table))
    questions = rating_anova(table)
    check(questions)
    for question in questions:
        assert question.anova or question.note
        assert question.mixed_design.effects or question.mixed_design.note
    anova_sentences(questions, 0.05)


@pytest.mark.parametrize("seed", range(6))
def test_both_together_through_the_whole_analysis(seed: int) -> None:
    rng = np.random.default_rng([seed, 3])
    answers = pd.concat([preference_table(rng), rating_answers(rng)], ignore_index=True)
    check(analysis_json(analyse(answers, Settings(resamples=10))))


def test_a_perfect_preference_is_no_certainty() -> None:
    """Six people always chose one method: the interval stays open, and the exact test speaks."""
    table = pd.DataFrame(
        [(f"p{p}", f"m{m}", "a", "b", bool(m % 2), True) for p in range(6) for m in range(4)],
        columns=["participant", "motion", "method_a", "method_b", "a_first", "chose_a"],
    )
    (result,) = compare(table)
    people = result.participants
    assert (people.test, people.low, people.high) == ("exact sign test", None, None)
    assert people.p_value == pytest.approx(2 * 0.5**6)
    assert result.published.interval.low < 1
    assert "all answers are the same" in result.motions_as_sample.note
    assert result.no_preference.equivalence_p_value is None


@pytest.mark.parametrize("answer", ["good", "", "3 points", "inf", "1e308", True, "nan "])
def test_ratings_that_are_no_numbers_are_refused(answer: object) -> None:
    table = pd.DataFrame({"participant": ["a", "b"], "method_a": ["x", "y"], "trial": [1, 1], "answer": ["3", answer]})
    for function in (rating_table, rating_anova):
        with pytest.raises(AnalysisError, match="expected ratings as numbers, found"):
            function(table)


def test_nobody_rated_both_methods() -> None:
    table = pd.DataFrame(
        {"participant": list("abcdefgh"), "method_a": ["x", "y"] * 4, "trial": 1, "answer": list("12342345")}
    )
    (question,) = rating_anova(table)
    assert question.anova == ()
    assert "no answers for every combination" in question.note or "expected answers for every" in question.note
    assert question.mixed_design.note == "no participant rated every method"
    assert question.ranks.participants is None
    assert question.difference.p_value is None
    check(question)
