"""Agresti 2013, Categorical Data Analysis, section 11.6: Bradley-Terry with a home advantage, baseball 1987.

Table 11.10: wins of the home team over the visitors, American League East. Printed: home advantage 0.302, standard
error 0.131; strengths beside Baltimore from 1.62 (Milwaukee) to 0.70 (Cleveland).
"""

from __future__ import annotations

import pytest

from study.analysis.bradley_terry import BradleyTerry, fit_bradley_terry

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


def test_without_the_order_the_home_advantage_is_gone() -> None:
    found = fit_bradley_terry(*games(), with_order=False, reference="Baltimore")
    assert isinstance(found, BradleyTerry)
    assert found.order is None
    assert {row.method: row.value for row in found.strengths}["Milwaukee"] == pytest.approx(1.58, abs=0.01)
