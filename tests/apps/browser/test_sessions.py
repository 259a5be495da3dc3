"""Real Chromium walks through sessions: every task by keys and by buttons, and all that goes wrong on the way."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import pytest
from devtools import Tab
from every import check_walked, every_page
from serving import PROTOCOL, QUESTIONS, TOKEN, Site
from walking import (
    KEPT,
    QUESTION,
    ROLES,
    SHORT,
    TRACKS,
    answers,
    check_frames,
    details,
    eventually,
    go_on,
    happened,
    press,
    read_on,
    reloading,
    to_question,
)

from study.experiment.store.answers import stored_answers
from study.experiment.store.frames import answers_frame
from study.experiment.store.sessions import all_sessions

pytestmark = pytest.mark.gl

TRIALS = 4  # of SHORT


@pytest.mark.parametrize("keys", [True, pytest.param(False, marks=pytest.mark.slow)], ids=["keys", "buttons"])
def test_a_whole_session_of_every_task(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab], keys: bool
) -> None:
    """Loaded again at every kind of question, it leaves the table that a simulation with the same answers has."""
    site, tab = make_site(every_page(), completion_code="C0DE"), make_tab()
    tab.size(1280, 640)
    scrolled = []
    reload = reloading(tab)

    def look() -> None:
        if tab.run("document.documentElement?.scrollHeight > window.innerHeight"):
            scrolled.append(tab.text())
        reload()

    tab.open(site.address)
    slowest = go_on(tab, keys, on_step=look)
    assert "C0DE" in tab.text()
    assert scrolled == []
    table = check_walked(site.responses, site.host.protocol)
    assert set(table["role"]) == {"trial", "practice", "check"}
    assert not table["missed"].any()
    assert ((table["response_s"] > 0) & (table["response_s"] < slowest + 1)).all()
    check_frames(details(site))
    display = happened(site, "display")[0]
    assert display["viewport"] == [1280, 640]
    assert display["refresh_hz"] > 10
    assert happened(site, "finished") == [{}]


def test_tracks_go_on_with_the_trial_that_was_due(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> None:
    """Levels are rendered as they are due; the page is loaded again, the server started again, and every trial is the
    one that the responses before led to."""
    site, tab = make_site(TRACKS, on_demand=True), make_tab()
    tab.open(site.address)
    for number in range(12):
        to_question(tab)
        press(tab, which=int(number % 3 != 0))
        eventually(lambda number=number: len(stored(site)) > number)
        if number % 5 == 1:
            tab.reload()
        if number % 5 == 3:
            site.stop()
            site.start()
    go_on(tab)
    table = check_walked(site.responses, site.host.protocol)
    assert (table.groupby("study")["difference_frames"].nunique() > 2).all()


def stored(site: Site) -> Any:
    (record,) = all_sessions(site.responses)
    return stored_answers(site.responses, record.id)


def test_a_restarted_server_gets_the_answer_that_waited(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab]
) -> None:
    site, tab = make_site(SHORT), make_tab()
    tab.open(site.address)
    to_question(tab, 2)
    site.stop()
    press(tab, keys=True)
    tab.wait_text("The connection is interrupted")
    assert tab.run(KEPT)
    site.start()
    tab.wait(f"!({KEPT})")
    go_on(tab)
    table = answers(site)
    assert len(table) == TRIALS
    assert not table.duplicated(["trial", "item"]).any()
    eventually(lambda: happened(site, "waited"))


@pytest.mark.parametrize("fault", ["truncated", pytest.param("stalled", marks=pytest.mark.slow)])
def test_films_that_fail_are_tried_again_then_said_clearly(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab], fault: str
) -> None:
    site, tab = make_site(), make_tab()
    tab.open(site.address)
    site.film_fault = fault
    to_fault(tab)
    assert site.films_served >= 3
    # The page says so at once; the message about the last try is still on its way.
    eventually(lambda: len(happened(site, "fault")) >= 3)
    site.film_fault = None
    tab.click("Try again")
    to_question(tab)
    press(tab, keys=True)
    go_on(tab)
    assert len(answers(site)) == QUESTIONS


def to_fault(tab: Any) -> None:
    end = time.monotonic() + 90
    while "A film could not be shown" not in tab.text():
        assert time.monotonic() < end, tab.text()
        read_on(tab, again=False)  # or the page that is waited for would be passed as it comes


def test_a_film_that_can_not_be_shown_can_be_passed_over(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab]
) -> None:
    site, tab = make_site(), make_tab()
    tab.open(site.address)
    site.film_fault = "truncated"
    for number in (1, 2):
        to_fault(tab)
        tab.click("Go on without it")
        eventually(lambda number=number: len(answers(site)) >= number)
    site.film_fault = None
    assert list(answers(site)["missed"]) == [True, True]
    assert not answers(site)["shown_well"].any()
    go_on(tab)
    # Practice is not repeated, a trial is.
    table = answers_frame(site.responses, roles=ROLES, all_attempts=True)
    assert [(row["attempt"], row["missed"]) for _, row in table[table["trial"] == 1].iterrows()] == [(1, True)]
    assert list(table[table["trial"] == 2]["attempt"]) == [1, 2]


def test_a_second_tab_is_refused_and_can_take_over(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab]
) -> None:
    site, tab = make_site(), make_tab()
    tab.open(site.address)
    tab.wait_text("Do you take part?")
    second = make_tab(tab.context)
    second.open(site.address)
    second.wait_text("open in another tab")
    tab.wait_text("Do you take part?")
    second.click("Go on here instead")
    second.wait_text("Do you take part?")
    tab.click("I agree")
    tab.wait_text("open in another tab")
    go_on(second)
    assert len(answers(site)) == QUESTIONS


def test_a_missed_answer_is_recorded_as_missed(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> None:
    site, tab = make_site(PROTOCOL), make_tab()
    tab.open(site.address)
    to_question(tab)
    tab.wait_text("The time to answer was over")
    eventually(lambda: len(answers(site)) == 1)
    row = answers(site).iloc[0]
    assert row["missed"]
    assert tab.run("document.querySelectorAll('button.answer:not(:disabled)').length") == 0


def test_only_legal_keys_count(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> None:
    site, tab = make_site(), make_tab()
    tab.open(site.address)
    to_question(tab)
    for key in ("x", "1", "Enter", " "):
        tab.key(key)
    assert tab.run(QUESTION)
    assert len(answers(site)) == 0
    tab.key("d")
    tab.wait(f"!({QUESTION})")
    tab.wait(f"!({KEPT})")
    assert list(answers(site)["answer"]) == ["different"]


def test_declining_and_withdrawing(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> None:
    site, tab = make_site(), make_tab()
    tab.open(site.address)
    tab.click("I do not take part")
    tab.wait_text("nothing about you was stored")
    tab.open(site.address)
    go_on(tab)
    code = tab.run("document.querySelector('code').innerText")
    other = make_tab()
    other.open(f"{site.address}/withdraw")
    other.wait("document.getElementById('code') !== null")
    other.run("document.getElementById('code').value = 'no-such-code'; 1")
    other.click("Delete my answers")
    other.wait_text("There is no such code")
    other.run(f"document.getElementById('code').value = {json.dumps(code)}; 1")
    other.click("Delete my answers")
    other.wait_text("Your answers were deleted")
    assert len(answers(site)) == 0


def test_nothing_that_was_typed_is_run_on_the_researchers_page(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab]
) -> None:
    site, tab = make_site(), make_tab()
    typed = "<img src=x onerror='document.title=1'><script>document.title=2</script>"
    tab.open(f"{site.address}/?PROLIFIC_PID=%3Cimg%20src%3Dx%20onerror%3D%27document.title%3D1%27%3E")
    tab.wait_text("Do you take part?")
    tab.click("I agree")
    tab.wait("document.getElementById('field-remark') !== null")
    tab.run(f"document.getElementById('field-age').value = '33'; "
            f"document.getElementById('field-remark').value = {json.dumps(typed)}; 1")  # fmt: skip
    tab.click("Continue")
    tab.wait_text("Thank you for taking part")
    researcher = make_tab()
    researcher.open(f"{site.address}/researcher")
    researcher.wait_text("Token")
    researcher.run(f"document.getElementById('token').value = {json.dumps(TOKEN)}; 1")
    researcher.click("Open")
    researcher.wait_text("onerror")
    assert researcher.run("document.querySelectorAll('main img, main script').length") == 0
    assert researcher.run("document.title") == "Sessions"


def test_a_page_for_eyes_and_ears(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> None:
    """Headings take the focus, so that they are read; buttons have names and keys; status is a live region."""
    site, tab = make_site(), make_tab()
    tab.open(site.address)
    tab.wait_text("Do you take part?")
    assert tab.run("document.activeElement.tagName") == "H1"
    assert tab.run("document.documentElement.lang") == "en"
    assert tab.run("document.getElementById('status').getAttribute('aria-live')") == "polite"
    # By keyboard alone: the first Tab leads to the button.
    tab.key("Tab")
    assert tab.run("document.activeElement.innerText").startswith("I agree")
    tab.key("Enter")
    tab.wait("document.getElementById('field-age') !== null")
    assert tab.run("document.querySelector('label[for=field-age]').innerText") == "Your age"
    tab.click("Continue")
    tab.wait("document.getElementById('field-age').getAttribute('aria-invalid') === 'true'")
    assert tab.run("document.activeElement.id") == "field-age"
    to_question(tab)
    assert tab.run("document.activeElement.innerText") == "Were they the same?"
    names = tab.call("Accessibility.getFullAXTree")["nodes"]
    buttons = {node["name"]["value"] for node in names if node.get("role", {}).get("value") == "button"}
    assert buttons == {"Same key S", "Different key D"}


def test_reaction_times_are_those_of_the_keys(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> None:
    """A page that is busy for a while handles a key late; what is recorded is when the key was pressed."""
    busy_s = 2.0
    busy = (
        f"setTimeout(() => {{ const end = performance.now() + {1000 * busy_s}; while (performance.now() < end); }}); 1"
    )
    site, tab = make_site(), make_tab()
    tab.open(site.address)
    pressed, handled = [], []
    # On a busy machine a key may overtake the timer, so that the page handles it before it is busy: then once more.
    while sum(end - key > busy_s / 2 for key, end in zip(pressed, handled, strict=True)) < 3:
        assert len(pressed) < 10, "hardly a key met a busy page"
        to_question(tab)
        option = tab.run("document.querySelector('button.answer').getAttribute('aria-keyshortcuts')")
        tab.run(busy)
        pressed.append(time.time())
        tab.key(option)
        tab.wait(f"!({QUESTION})", every=0.02)
        handled.append(time.time())
    tab.wait(f"!({KEPT})")
    recorded = sorted(
        {(one["time_origin_ms"] + one["answer_ms"]) / 1000 for one in (row["detail"] for row in details(site))}
    )
    assert len(recorded) == len(pressed)
    for key, end, at in zip(pressed, handled, recorded, strict=True):
        assert key - 0.1 < at < (end - busy_s / 2 if end - key > busy_s / 2 else end + 0.1)
