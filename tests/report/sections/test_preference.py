"""The section of a preference study, where its answers say little."""

from __future__ import annotations

from itertools import combinations

import pandas as pd
import pytest

from study.analysis.preference.analyse import Preference, compare, strengths
from study.report.sections.preference.section import preference_section
from study.report.sections.section import About, Section


def section_of(rows: list[tuple[str, str, str, str, bool, float]]) -> Section:
    names = ["participant", "motion", "method_a", "method_b", "a_first", "chose_a"]
    answers = pd.DataFrame(rows, columns=names)
    section = preference_section(Preference(compare(answers), strengths(answers)), About("s", "Pairs"))
    assert section is not None
    return section


@pytest.mark.parametrize("others", [[], [("q", "run", "a", "b", True, 1.0)]], ids=["all", "of one motion"])
def test_answers_that_all_chose_neither_are_drawn_without_a_share(
    others: list[tuple[str, str, str, str, bool, float]],
) -> None:
    section = section_of([(f"p{n}", "walk", "a", "b", bool(n % 2), 0.5) for n in range(4)] + others)
    assert "answers chose neither" in section.notes[1]
    if not others:
        assert section.headlines[0].statement == "There are no answers that choose between a and b."


def test_an_order_that_decided_everything_is_the_headline() -> None:
    section = section_of(
        [(f"p{n}", "walk", "a", "b", first, float(first)) for n in range(6) for first in (True, False)]
    )
    assert section.headlines[0].statement.startswith("Each of 12 answers favoured the one shown first: the order of")


def test_a_method_that_never_loses_has_a_note_and_no_strength() -> None:
    rows = [(f"p{n}", "walk", a, b, bool(n % 2), won) for n in range(8)
            for a, b, won in (("a", "b", 1.0), ("a", "c", 1.0), ("b", "c", float(n < 5)))]  # fmt: skip
    section = section_of(rows)
    table = next(table for table in section.tables if table.name == "s_strengths")
    assert {row["method"]: row["value"] is None for row in table.rows if row["method"] != "order"}["a"]
    assert any("so its distance from" in note for note in section.notes)


def test_many_methods_have_their_strengths_and_a_row_for_each_pair() -> None:
    methods = ("geodesic", "fixed", "cut", "one-hop")
    rows = [(f"p{n}", f"m{m}", a, b, bool((n + m) % 2), float((n * 7 + m * 3 + k) % 5 < 3))
            for n in range(9) for m in range(4) for k, (a, b) in enumerate(combinations(methods, 2))]  # fmt: skip
    section = section_of(rows)
    assert [drawing.name for drawing in section.drawings] == ["s_strengths"]
    strongest, pairs = section.tables
    assert len(strongest.rows) == 5, "four methods and the order"
    assert len(pairs.rows) == 6
    assert section.headlines[0].statement.startswith("Strengths in logits beside ")
    assert section.headlines[0].detail == "95% intervals over 9 participants and 4 motions."
