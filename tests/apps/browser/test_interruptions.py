"""What disturbs a trial in a real browser: hidden tabs, closed lids, lost networks, double clicks, keys held down."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from devtools import Browser, Tab
from serving import Site
from walking import (
    HURRIED,
    KEPT,
    QUESTION,
    RATED,
    SHORT,
    answers,
    details,
    go_on,
    happened,
    press,
    to_films,
    to_question,
)

pytestmark = pytest.mark.gl


@pytest.fixture(scope="session")
def browser(whole_browser: Browser) -> Browser:
    """Chromium with its windows, as people have it."""
    return whole_browser


TRIALS = 4  # of SHORT
AWAY_S = 3.5  # longer than the page takes to give a film up that does not go on


@contextmanager
def minimised(tab: Any) -> Iterator[None]:
    tab.window("minimized")
    yield
    tab.window("normal")


@contextmanager
def behind_another_tab(tab: Any) -> Iterator[None]:
    target = tab.browser.call("Target.createTarget", url="about:blank", browserContextId=tab.context)["targetId"]
    tab.wait("document.hidden")
    yield
    tab.browser.call("Target.closeTarget", targetId=target)


@contextmanager
def frozen(tab: Any) -> Iterator[None]:
    """As browsers do with pages that nobody looks at, to save power."""
    tab.window("minimized")
    tab.call("Page.setWebLifecycleState", state="frozen")
    yield
    tab.call("Page.setWebLifecycleState", state="active")
    tab.window("normal")


@contextmanager
def lid_closed(tab: Any) -> Iterator[None]:
    with tab.browser.stopped():
        yield


AWAY = [
    pytest.param(minimised, "hidden", id="minimised"),
    pytest.param(lid_closed, "stood still", id="lid"),
    pytest.param(behind_another_tab, "hidden", id="tab", marks=pytest.mark.slow),
    pytest.param(frozen, "hidden", id="frozen", marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("away", "why"), AWAY)
@pytest.mark.parametrize("place", [0, pytest.param(1, marks=pytest.mark.slow)], ids=["first", "second"])
def test_films_that_nobody_can_have_seen_start_again_and_the_trial_is_queued(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab], away: Callable[..., Any], why: str, place: int
) -> None:
    site, tab = make_site(SHORT), make_tab()
    tab.open(site.address)
    to_films(tab, place)
    time.sleep(0.2)
    with away(tab):
        time.sleep(AWAY_S)
    # The pair starts again by itself: no page is in between.
    to_films(tab, 0)
    to_question(tab)
    press(tab)
    go_on(tab)
    table = answers(site, all_attempts=True)
    first = table[table["trial"] == table["trial"].iloc[0]]
    assert list(first["attempt"]) == [1, 2]
    assert not first["shown_well"].iloc[0]
    assert len(answers(site)) == TRIALS
    # It was answered at once, however long the films had stood.
    assert (first["response_s"] < AWAY_S).all()
    shown = details(site)
    assert all(why in row["detail"]["faults"] for row in shown[:2])
    # What is on record is the showing that was seen: whole.
    assert all(row["frames_presented"] >= 10 for row in shown[:2])
    assert any(why in event.get("how", "") for event in happened(site, "interrupted"))
    assert happened(site, "fault") == []


def test_a_lid_closed_while_a_question_stands(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> None:
    """The time to answer is over when the lid opens: missed, flagged, and so asked again later."""
    site, tab = make_site(HURRIED), make_tab()
    tab.open(site.address)
    to_question(tab)
    with tab.browser.stopped():
        time.sleep(4)
    tab.wait(f"!({KEPT})")
    go_on(tab)
    table = answers(site, all_attempts=True)
    trial = table["trial"].iloc[0]
    assert list(table[table["trial"] == trial]["missed"]) == [True, False]
    assert len(answers(site)) == TRIALS
    assert not answers(site)["missed"].any()


def test_a_window_that_loses_the_focus_flags_the_trial(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab]
) -> None:
    """As in the window: the films go on, for they can be seen, but who knows where the participant looked."""
    site, tab = make_site(SHORT), make_tab()
    tab.open(site.address)
    to_films(tab)
    tab.run("window.dispatchEvent(new Event('blur')); 1")
    to_question(tab)
    press(tab)
    go_on(tab)
    table = answers(site, all_attempts=True)
    assert list(table[table["trial"] == table["trial"].iloc[0]]["attempt"]) == [1, 2]
    assert details(site)[0]["detail"]["faults"] == "focus lost"


@pytest.mark.parametrize("closed", [False, True], ids=["reloaded", "closed"])
def test_an_answer_survives_a_minute_without_network(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab], closed: bool
) -> None:
    """The page is loaded again, or its tab closed, while there is no network: the answer arrives once there is."""
    site, tab = make_site(SHORT), make_tab()
    tab.open(site.address)
    to_question(tab)
    tab.offline(True)
    press(tab)
    tab.wait_text("The connection is interrupted")
    assert len(answers(site)) == 0
    if closed:
        tab.close()
        tab = make_tab(tab.context)
        tab.open(site.address)
        # Nobody could tell the server that the first tab was closed; or it could, with its last breath.
        tab.wait("document.getElementById('main')?.innerText.trim()")
        tab.try_click("Go on here instead")
    else:
        tab.reload()
        tab.wait("!document.getElementById('main')")
        tab.offline(False)
        tab.open(site.address)
    tab.wait(f"document.getElementById('main') && !({KEPT})")
    assert len(answers(site)) == 1
    go_on(tab)
    assert len(answers(site)) == TRIALS
    assert not answers(site)["missed"].any()


def test_nobodys_answer_is_sent_as_anothers(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> None:
    """On a shared computer the next participant begins while the last one's answer still waits."""
    site, tab = make_site(SHORT), make_tab()
    one, other = (f"{site.address}/?PROLIFIC_PID={who}&SESSION_ID={who}-1" for who in ("ann", "bob"))
    tab.open(one)
    to_question(tab)
    tab.call("Network.setBlockedURLs", urls=["*/api/answer"])
    press(tab)
    tab.wait(KEPT)
    tab.call("Network.setBlockedURLs", urls=[])
    tab.call("Network.setBlockedURLs", urls=["*/api/answer"])
    tab.open(other)
    to_films(tab)
    tab.call("Network.setBlockedURLs", urls=[])
    assert len(answers(site)) == 0
    assert tab.run(KEPT)
    tab.open(one)
    tab.wait(f"document.getElementById('main') && !({KEPT})")
    assert list(answers(site)["answer"]) == ["same"]


def test_going_back_and_forth_loses_nothing(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> None:
    site, tab = make_site(SHORT), make_tab()
    tab.open(site.address)
    to_question(tab)
    press(tab)
    to_films(tab)
    tab.open(f"{site.address}/withdraw")
    tab.wait("document.getElementById('code') !== null")
    tab.run("history.back(); 1")
    tab.wait("document.getElementById('code') === null && document.querySelector('.stage, button.answer') !== null")
    go_on(tab)
    assert len(answers(site)) == TRIALS
    table = answers(site, all_attempts=True)
    assert not table.duplicated(["trial", "item", "attempt"]).any()


def test_a_page_that_is_brought_back_as_it_was_left_starts_again(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab]
) -> None:
    """Some browsers keep whole pages for the back button; what such a page shows may have long been answered."""
    site, tab = make_site(SHORT), make_tab()
    tab.open(site.address)
    to_question(tab)
    tab.run("window.old = true; window.dispatchEvent(new PageTransitionEvent('pageshow', { persisted: true })); 1")
    tab.wait("window.old === undefined")
    go_on(tab)
    assert len(answers(site)) == TRIALS


def test_keys_before_the_question_and_keys_held_down_answer_nothing(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab]
) -> None:
    slow = SHORT.replace("entry_s = 0.3", "entry_s = 1.5").replace("exit_s = 0.3", "exit_s = 1.5")
    site, tab = make_site(slow), make_tab()
    tab.open(site.address)
    to_films(tab)
    tab.key("d")
    tab.key_down("d")
    assert not tab.run(QUESTION)
    end = time.monotonic() + 60
    while not tab.run(QUESTION):
        assert time.monotonic() < end
        tab.key_down("d", repeated=True)
        time.sleep(0.03)
    for _ in range(10):
        tab.key_down("d", repeated=True)
        time.sleep(0.03)
    assert tab.run(QUESTION)
    assert len(answers(site)) == 0
    tab.key_up("d")
    tab.key("s")
    tab.wait(f"!({QUESTION}) && !({KEPT})")
    assert list(answers(site)["answer"]) == ["same"]


def test_a_double_click_answers_one_question(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> None:
    """The next item's buttons stand where the last one's stood."""
    site, tab = make_site(RATED), make_tab()
    tab.open(site.address)
    to_question(tab)
    assert tab.try_click("1", times=2)
    tab.wait_text("How noticeable was the passage?")
    time.sleep(0.6)
    assert tab.run(QUESTION)
    assert list(answers(site)["item"]) == ["natural"]
    # A click of its own counts.
    assert tab.try_click("1")
    tab.wait(f"!({QUESTION}) && !({KEPT})")
    assert sorted(answers(site)["item"]) == ["natural", "noticeable"]


def test_enter_held_down_turns_one_page(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> None:
    site, tab = make_site(), make_tab()
    tab.open(site.address)
    tab.click("I agree")
    tab.wait("document.getElementById('field-age') !== null")
    tab.run("document.getElementById('field-age').value = '33'; 1")
    tab.click("Continue")
    tab.wait_text("Thank you for taking part")
    tab.key_down("Enter")
    tab.wait_text("Say whether they were the same")
    for _ in range(10):
        tab.key_down("Enter", repeated=True)
        time.sleep(0.03)
    assert "Say whether they were the same" in tab.text()
    tab.key_up("Enter")
