"""Who took part: means and counts of the form, none of them so small that it tells who somebody is."""

from __future__ import annotations

from typing import Any

import pytest

from study.experiment.protocol.texts import FormField
from study.report.demographics import demographics_rows, demographics_sentence, demographics_table

AGE = FormField(name="age", label="Your age?", kind="number")
HAND = FormField(name="hand", label="Which hand?", kind="choice", choices=("left", "right", "both", "neither"))
NOTE = FormField(name="note", label="Anything else?", kind="text")


def counts(**given: int) -> dict[str, Any]:
    rows = demographics_rows([HAND], {"hand": [word for word, count in given.items() for _ in range(count)]})
    return {row["reading"]: row["participants"] for row in rows}


def test_numbers_are_summed_up_and_texts_are_never_shown() -> None:
    ages = ["20", "22", "24", "26", "28", ""]
    (row,) = demographics_rows([AGE, NOTE], {"age": ages, "note": ["I am the mayor"] * 9})
    assert row == {"item": "Your age", "participants": 5, "mean": 24, "standard_deviation": pytest.approx(10**0.5)}
    assert demographics_sentence([row]) == "They answered in the form: Your age: mean 24.0 (SD 3.2). "
    assert not demographics_rows([AGE], {"age": ages[:4]})
    assert demographics_sentence([]) == ""


def test_small_counts_are_merged_until_none_can_be_had_by_subtraction() -> None:
    assert counts(left=6, right=20) == {"left": 6, "right": 20}
    assert counts(left=3, right=20, both=2) == {"right": 20, "left and both together": 5}
    assert counts(left=3, right=20) == {"left and right together": 23}
    assert counts(left=1, right=9, both=30) == {"both": 30, "left and right together": 10}
    assert counts(left=4) == {}
    for left in range(8):
        for right in range(8):
            for both in range(8):
                assert min(counts(left=left, right=right, both=both).values(), default=5) >= 5


def test_the_table_names_the_questions() -> None:
    table = demographics_table(demographics_rows([HAND], {"hand": ["left"] * 5 + ["right"] * 7}))
    assert [[text for text, _ in row][:3] for row in table.cells] == [
        ["Which hand", "left", "5"],
        ["Which hand", "right", "7"],
    ]
