"""Cells that no spreadsheet runs."""

from __future__ import annotations

import pandas as pd
import pytest

from study.report import tables
from study.spreadsheets import safe_cell, safe_table

SIGNS = ["=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠", " =", "\ufeff=", "\u200b@", "\xa0+", "\x00="]


@pytest.mark.parametrize("sign", SIGNS)
def test_cells_that_begin_like_formulas_are_text(sign: str) -> None:
    kept = sign.replace("\r", "\n")
    assert safe_cell(f"{sign}1+1") == f"'{kept}1+1"
    table = safe_table(pd.DataFrame({"said": [f"{sign}cmd|x"], "n": [-1]}))
    assert table.to_dict("records") == [{"said": f"'{kept}cmd|x", "n": -1}]


def test_a_carriage_return_begins_no_row() -> None:
    text = safe_table(pd.DataFrame({"said": ["harmless\r=1+1", "harmless\r\n=1+1"]})).to_csv(index=False)
    assert text == 'said\n"harmless\n=1+1"\n"harmless\n=1+1"\n'


@pytest.mark.parametrize("cell", ["a=b", "", -1.5, 3, None, True, " x", "-3.2", "+4", "-1e-5", ".5", "1-2"])
def test_cells_that_are_none_stay_what_they_are(cell: object) -> None:
    assert safe_cell(cell) == cell


def test_tables_of_a_report_are_safe_too() -> None:
    made = tables.make("t", "", "motion percent", [{"motion": "=1+1", "percent": -3.2}])
    assert tables.as_csv(made) == "motion,percent\n'=1+1,-3.2\n"
