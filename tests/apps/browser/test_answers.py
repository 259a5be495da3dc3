"""Real browsers give every kind of answer: no difference, how sure, sliders, free text; reloads lose nothing."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from serving import Site
from test_pages import CONTRASTS, LAPTOP
from walking import LOOK, SHORT, answers, go_on, read_on, slide

from study.experiment.store.answers import stored_answers, stored_form
from study.experiment.store.sessions import find_session

pytestmark = pytest.mark.gl

ANSWERS = (
    SHORT[: SHORT.index("[[studies]]")].replace("[timing]", "[timing]\nshow_again = 0")
    + """
[[studies]]
name = "liking"
task = "preference"
instructions = ""
reference = "geodesic"
comparison = "fixed"
order = "both"
ties = true
confidence_points = 5

[[studies.form]]
name = "remarks"
label = "What did you pay attention to?"
kind = "free-text"

[[studies]]
name = "rating"
task = "rating"
slider = "ticks"
instructions = ""
reference = "geodesic"
comparison = "cut"
order = "random"

[[studies.items]]
name = "natural"
question = "How natural was it?"
low = "not at all"
middle = "so-so"
high = "very"
"""
)
PHONE = (390, 700)
PICTURES = os.environ.get("SEGUE_PICTURES")
"""Where the tests leave pictures of the pages, where somebody wants to look at them."""


# What follows from another size is on the screen.
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


def looked_at(tab: Any, name: str) -> None:
    """What is on the page is legible and not too large, on a laptop and on a telephone."""
    for size, where in ((LAPTOP, "laptop"), (PHONE, "phone")):
        tab.size(*size)
        tab.wait(f"window.innerWidth === {size[0]}")
        tab.run(DRAWN)
        if PICTURES:
            tab.picture(Path(PICTURES) / f"{name}-{where}.png")
        assert [one for one in tab.run(CONTRASTS) if one[1] < one[2]] == []
        over = tab.run(
            "[document.documentElement.scrollWidth - innerWidth, document.documentElement.scrollHeight - innerHeight]"
        )
        assert max(over) <= 0, (name, where)
        fields = "[...document.querySelectorAll('input, textarea')]"
        unnamed = f"{fields}.filter((one) => !one.labels?.length && !one.ariaLabel).length"
        assert tab.run(unnamed) == 0
    tab.size(*LAPTOP)
    tab.wait(f"window.innerWidth === {LAPTOP[0]}")
    tab.run(DRAWN)


def to(tab: Any, script: str) -> None:
    while not tab.run(script):
        if tab.run(LOOK) not in ("question", "films"):
            read_on(tab)


def test_no_difference_how_sure_sliders_and_free_text(
    make_site: Callable[..., Site], make_tab: Callable[..., Any]
) -> None:
    site, tab = make_site(ANSWERS), make_tab()
    tab.size(*LAPTOP)
    tab.open(site.address)
    for trial in (1, 2):
        to(tab, "document.querySelectorAll('button.answer:not(.point)').length === 3")
        if trial == 1:
            looked_at(tab, "equal")
        time.sleep(1.0)
        tab.key("0" if trial == 1 else "2")
        chosen_s = time.monotonic()
        tab.wait("document.body.innerText.includes('How sure')", every=0.01)
        if trial == 1:
            looked_at(tab, "sure")
            tab.reload()  # the films come again, then the question that is left
            to(tab, "document.body.innerText.includes('How sure')")
        tab.key(str(trial))
        sure_s = time.monotonic() - chosen_s
    tab.wait("!!document.querySelector('textarea')")
    looked_at(tab, "free-text")
    tab.run("document.querySelector('textarea').value = 'The feet,\\nmostly.'")
    tab.click("Continue")
    to(tab, "!!document.querySelector('.track input')")
    assert tab.run("document.querySelector('main button').disabled")
    looked_at(tab, "slider")
    slide(tab, 50)
    to(tab, "!!document.querySelector('.track input:not(:disabled)')")
    tab.run("document.querySelector('.track input').focus()")
    tab.key("ArrowRight")
    tab.click("Continue")
    go_on(tab)
    table = answers(site)
    assert list(table["answer"][:2]) == ["equal", "second"]
    assert list(table["confidence"][:2]) == [1, 2]
    assert table["chose_a"].isna().tolist()[:2] == [True, False]
    assert [abs(int(value) - wanted) <= 1 for value, wanted in zip(table["answer"][2:], (50, 51), strict=True)] == [
        True
    ] * 2
    record = find_session(site.responses, table["participant"][0])
    assert record is not None
    # A further question is timed from when it was asked, not from the end of the films.
    choice, sure = (answer for answer in stored_answers(site.responses, record.id) if answer.trial == 2)
    assert sure.response_s < sure_s
    assert choice.response_s > 1.0
    assert stored_form(site.responses, record.id) == {"liking.remarks": "The feet,\nmostly."}
