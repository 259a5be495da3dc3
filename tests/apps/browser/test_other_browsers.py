"""Firefox and WebKit walk through whole sessions of every task, as Chromium does in test_sessions.py."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from bidi import FirefoxTab
from every import HEAD, check_walked, every_page, track
from serving import Site
from test_together import check_together
from walking import answers, check_frames, details, go_on, happened, reloading
from webdriver import WebKitTab

pytestmark = pytest.mark.gl


def walk(site: Site, tab: Any, keys: bool = True, on_step: Any = lambda: None) -> Any:
    """A whole session; returns how its films were shown."""
    tab.open(site.address)
    try:
        slowest = go_on(tab, keys, on_step)
    except AssertionError as error:
        raise AssertionError(f"{error}; faults that the page told: {happened(site, 'fault')}") from error
    table = check_walked(site.responses, site.host.protocol)
    assert not table["missed"].any()
    assert ((table["response_s"] > 0) & (table["response_s"] < slowest + 1)).all()
    assert happened(site, "finished") == [{}]
    assert happened(site, "fault") == []
    return details(site)


@pytest.mark.parametrize("keys", [True, pytest.param(False, marks=pytest.mark.slow)], ids=["keys", "buttons"])
def test_firefox_walks_through_every_task(make_site: Callable[..., Site], firefox_tab: FirefoxTab, keys: bool) -> None:
    site = make_site(every_page())
    shown = walk(site, firefox_tab, keys, reloading(firefox_tab))
    check_frames(shown)
    pages = [row for row in shown if row["place"] == "fourth"]
    assert len({row["trial"] for row in pages}) == 3
    check_together([row for row in shown if row["trial"] == pages[0]["trial"] and row["attempt"] == 1], 4)
    assert "Firefox" in happened(site, "display")[0]["user_agent"]


def test_firefox_walks_through_levels_that_are_rendered_on_demand(
    make_site: Callable[..., Site], firefox_tab: FirefoxTab
) -> None:
    site = make_site(HEAD + track("yes-no", "quest-plus"), on_demand=True)
    before = len(list((site.folder / "stimuli").glob("*.mp4")))
    firefox_tab.open(site.address)
    go_on(firefox_tab, True)
    assert happened(site, "finished") == [{}]
    assert happened(site, "fault") == []
    shown = set(answers(site)["difference_frames"])
    assert len(shown) > 2
    rendered = len(list((site.folder / "stimuli").glob("*.mp4"))) - before
    assert len(shown - {0}) <= rendered <= 9


def test_without_frame_callbacks_the_record_says_so(make_site: Callable[..., Site], firefox_tab: FirefoxTab) -> None:
    """An older browser: sessions go on, and nothing claims that frames were measured."""
    site = make_site()
    firefox_tab.before_each_page("delete HTMLVideoElement.prototype.requestVideoFrameCallback;")
    shown = walk(site, firefox_tab)
    assert happened(site, "display")[0]["frame_callback"] is False
    assert {row["method"] for row in shown} == {"ended"}
    for row in shown:
        assert (row["frames_presented"], row["longest_gap_frames"]) == (None, None)
        assert json.loads(row["detail_json"])["times_ms"] == []


@pytest.mark.slow
@pytest.mark.parametrize("keys", [True, False], ids=["keys", "buttons"])
def test_webkit_walks_through_every_task(make_site: Callable[..., Site], webkit_tab: WebKitTab, keys: bool) -> None:
    site = make_site(every_page())
    check_frames(walk(site, webkit_tab, keys))
    assert "AppleWebKit" in happened(site, "display")[0]["user_agent"]
