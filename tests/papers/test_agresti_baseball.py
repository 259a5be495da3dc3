"""Agresti, Categorical Data Analysis (2nd edition 2002, section 10.6; 3rd 2013, 11.6): baseball 1987, home advantage.

Wins of the home team over the visitors, American League East. The 42 records agree with the data set `baseball` of the
R package BradleyTerry2, whose documentation gives page 438 of the second edition as their source, and whose tests hold
columns 3 and 5 of its Table 10.11: strengths without the home advantage, and shares with it. The standard error of the
home advantage, 0.131, and the strengths 1.62 and 0.70 are the book's as far as they were remembered.
"""

from __future__ import annotations

import numpy as np
import pytest

from study.analysis.preference.bradley_terry import BradleyTerry, fit_bradley_terry

TEAMS = ("Milwaukee", "Detroit", "Toronto", "New York", "Boston", "Cleveland", "Baltimore")
# Wins and losses of the home team (row) against the visitors (column).
HOME = (
    ("", "4-3", "4-2", "4-3", "6-1", "4-2", "6-0"),
    ("3-3", "", "4-2", "4-3", "6-0", "6-1", "4-3"),
    ("2-5", "4-3", "", "2-4", "4-3", "4-2", "6-0"),
    ("3-3", "5-1", "2-5", "", "4-3", "4-2", "6-1"),
    ("5-1", "2-5", "3-3", "4-2", "", "5-2", "6-0"),
    ("2-5", "3-3", "3-4", "4-3", "4-2", "", "2-4"),
    ("2-5", "1-5", "1-6", "2-4", "1-6", "3-4", ""),
)


def games() -> tuple[list[str], list[str], list[int], list[int]]:
    home, away, won, played = [], [], [], []
    for team, row in zip(TEAMS, HOME, strict=True):
        for other, record in zip(TEAMS, row, strict=True):
            if record:
                wins, losses = map(int, record.split("-"))
                home.append(team)
                away.append(other)
                won.append(wins)
                played.append(wins + losses)
    return home, away, won, played


def test_each_pair_of_teams_met_13_times() -> None:
    assert sum(games()[3]) == 13 * 21


def test_home_advantage_and_strengths() -> None:
    found = fit_bradley_terry(*games(), reference="Baltimore")
    assert isinstance(found, BradleyTerry)
    assert found.order is not None
    assert found.order.value == pytest.approx(0.302, abs=0.0005)
    assert found.order.standard_error == pytest.approx(0.131, abs=0.0005)
    strengths = {row.method: row.value for row in found.strengths}
    assert strengths["Milwaukee"] == pytest.approx(1.62, abs=0.005)
    assert strengths["Cleveland"] == pytest.approx(0.70, abs=0.01)
    assert strengths["Baltimore"] == 0
    assert found.strengths[0].method == "Milwaukee"


def test_table_10_11_column_5() -> None:
    """Strengths with the home advantage, as shares that sum to one."""
    found = fit_bradley_terry(*games(), reference="Baltimore")
    assert isinstance(found, BradleyTerry)
    worth = np.exp([row.value for row in reversed(found.strengths)])
    assert np.round(worth / worth.sum(), 3) == pytest.approx([0.044, 0.088, 0.137, 0.157, 0.164, 0.190, 0.220])


def test_without_the_order_the_home_advantage_is_gone() -> None:
    found = fit_bradley_terry(*games(), with_order=False, reference="Baltimore")
    assert isinstance(found, BradleyTerry)
    assert found.order is None
    # Table 10.11, column 3; the text says that standard errors are about 0.3.
    others = [row for row in reversed(found.strengths) if row.method != "Baltimore"]
    assert [round(row.value or 0.0, 2) for row in others] == [0.68, 1.11, 1.25, 1.29, 1.44, 1.58]
    assert all(round(row.standard_error or 0.0, 1) == 0.3 for row in others)
