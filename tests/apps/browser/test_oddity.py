"""Real Chromium walks through a study of three films a trial."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import sqlalchemy as sa
from walking import SHORT, answers, go_on

from study.experiment.store.tables import answer_stimuli, presentations

pytestmark = pytest.mark.gl

ODDITY = (
    SHORT.replace('task = "same-different"', 'task = "oddity"')
    .replace("differences_frames = [-2, 0]", "differences_frames = [4]")
    .replace("Were they the same?", "Which one differed?")
)


def test_three_films_are_shown_and_one_is_named(make_site: Callable[..., Any], make_tab: Callable[..., Any]) -> None:
    site, tab = make_site(ODDITY), make_tab()
    tab.open(site.address)
    go_on(tab, True)
    table = answers(site)
    assert len(table) == 3
    assert set(table["task"]) == {"oddity"}
    assert set(table["answer"]) <= {"first", "second", "third"}
    assert not table["missed"].any()
    with site.responses.engine.connect() as connection:
        shown = connection.execute(
            sa.select(presentations.c.trial, presentations.c.place, presentations.c.stimulus, presentations.c.attempt)
        ).all()
        listed = connection.execute(sa.select(answer_stimuli)).all()
    places = {1: "first", 2: "second", 3: "third"}
    assert {(row.trial, row.attempt, places[row.slot], row.stimulus) for row in listed} == {
        (row.trial, row.attempt, row.place, row.stimulus) for row in shown
    }
    assert len(shown) == len(listed) == 3 * len({(row.trial, row.attempt) for row in listed})
    for trial in {row.trial for row in listed}:
        first_showing = [row for row in listed if row.trial == trial and row.attempt == 1]
        assert sorted(row.member for row in first_showing) == [0, 0, 1]
