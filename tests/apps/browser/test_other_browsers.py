"""Firefox and WebKit walk through whole sessions of every task, as Chromium does in test_sessions.py."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
import sqlalchemy as sa
from bidi import FirefoxTab
from serving import QUESTIONS, Site
from walking import QUEST, answers, check_frames, go_on, happened
from webdriver import WebKitTab

from study.experiment.store.tables import presentations

pytestmark = pytest.mark.gl


def walk(site: Site, tab: Any, keys: bool = True) -> Any:
    """A whole session; returns how its films were shown."""
    tab.open(site.address)
    try:
        slowest = go_on(tab, keys)
    except AssertionError as error:
        raise AssertionError(f"{error}; faults that the page told: {happened(site, 'fault')}") from error
    table = answers(site)
    assert len(table) == QUESTIONS
    assert set(table["task"]) == {"same-different", "preference", "rating"}
    assert not table["missed"].any()
    assert ((table["response_s"] > 0) & (table["response_s"] < slowest + 1)).all()
    assert happened(site, "finished") == [{}]
    assert happened(site, "fault") == []
    with site.responses.engine.connect() as connection:
        return connection.execute(sa.select(presentations)).mappings().all()


@pytest.mark.parametrize("keys", [True, pytest.param(False, marks=pytest.mark.slow)], ids=["keys", "buttons"])
def test_firefox_walks_through_every_task(make_site: Callable[..., Site], firefox_tab: FirefoxTab, keys: bool) -> None:
    site = make_site()
    check_frames(walk(site, firefox_tab, keys))
    assert "Firefox" in happened(site, "display")[0]["user_agent"]


def test_firefox_walks_through_levels_that_are_rendered_on_demand(
    make_site: Callable[..., Site], firefox_tab: FirefoxTab
) -> None:
    site = make_site(QUEST, on_demand=True)
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
    site = make_site()
    check_frames(walk(site, webkit_tab, keys))
    assert "AppleWebKit" in happened(site, "display")[0]["user_agent"]
