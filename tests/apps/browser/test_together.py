"""Real browsers show several films at once: they start together, can be played again, and each has its slider."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
import sqlalchemy as sa
from serving import Site
from test_answers import looked_at, to
from test_pages import LAPTOP
from walking import SHORT, answers, go_on, happened, slide

from study.experiment.store.tables import presentations

pytestmark = pytest.mark.gl

TOGETHER = (
    SHORT[: SHORT.index("[[studies]]")].replace("[timing]", "[timing]\nshow_again = 0")
    + """
[[studies]]
name = "page"
task = "parallel-rating"
instructions = ""
reference = "geodesic"
comparison = "fixed"
others = ["cut", "inertialize", "dead-blend"]
hidden_reference = "velocity"
replays = 2

[[studies.items]]
name = "natural"
question = "How natural are these motions?"
low = "not at all"
high = "completely"

[[studies]]
name = "beside"
task = "preference"
instructions = ""
reference = "geodesic"
comparison = "fixed"
order = "both"
side_by_side = true
ties = true
replays = 1
"""
)


def shown_of(site: Site, trial: int) -> list[Any]:
    with site.responses.engine.connect() as connection:
        query = sa.select(presentations).where(presentations.c.trial == trial).order_by(presentations.c.id)
        return list(connection.execute(query).mappings().all())


def check_together(shown: list[Any], films: int) -> None:
    """Each film is on record, and how far behind the first it ran: what counts as shown well is within a frame."""
    print([json.loads(row["detail_json"])["apart_frames"] for row in shown])  # shown where something fails
    assert [row["place"] for row in shown][:films] == ["first", "second", "third", "fourth", "fifth", "sixth"][:films]
    for row in shown:
        apart = json.loads(row["detail_json"])["apart_frames"]
        assert apart is not None
        assert apart <= 1 or not row["shown_well"]
    assert min(json.loads(row["detail_json"])["apart_frames"] for row in shown) == 0


def test_six_films_with_sliders_and_two_beside_each_other(
    make_site: Callable[..., Site], make_tab: Callable[..., Any]
) -> None:
    site, tab = make_site(TOGETHER), make_tab()
    tab.size(*LAPTOP)
    tab.open(site.address)
    to(tab, "!!document.querySelector('.track input:not(:disabled)')")
    looked_at(tab, "parallel")
    tab.click("Play again (2)")
    tab.wait("!!document.querySelector('.track input:not(:disabled)')")
    tab.wait_text("Play again (1)")
    slide(tab, 10, 25, 40, 53, 70, 85)
    to(tab, "!!document.querySelector('button.answer:not(:disabled)')")
    looked_at(tab, "beside")
    tab.reload()
    to(tab, "!!document.querySelector('button.answer:not(:disabled)')")
    tab.click("Play again (1)")
    tab.wait("!!document.querySelector('button.answer:not(:disabled)')")
    assert tab.run("[...document.querySelectorAll('main button')].at(-1).disabled")
    tab.click("Right")
    go_on(tab)
    table = answers(site)
    page = table[(table.study == "page") & (table.attempt == 1)]
    assert list(page.slot) == [1, 2, 3, 4, 5, 6]
    assert [int(value) for value in page.answer] == pytest.approx([10, 25, 40, 53, 70, 85], abs=1)
    assert set(page.method_a) == {"geodesic", "fixed", "cut", "inertialize", "dead-blend", "velocity"}
    beside = table[table.study == "beside"]
    assert beside.answer.iloc[0] == "second"
    first = [row for row in shown_of(site, 1) if row["attempt"] == 1]
    assert [json.loads(row["detail_json"])["play"] for row in first] == [1] * 6 + [2] * 6
    check_together(first, 6)
    check_together([row for row in shown_of(site, 2) if row["attempt"] == 1], 2)
    assert happened(site, "fault") == []
