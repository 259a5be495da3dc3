"""Precedence where it is allowed, and no garbage collection in mid-trial."""

from __future__ import annotations

import gc
import os
from typing import Any

import pytest

from study.apps.player import calm


@pytest.fixture
def priority(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    state: dict[str, Any] = {"nice": 0, "allowed": True}

    def set_it(_: int, __: int, nice: int) -> None:
        if not state["allowed"]:
            raise PermissionError(13, "Permission denied")
        state["nice"] = nice

    monkeypatch.setattr(os, "getpriority", lambda *_: state["nice"])
    monkeypatch.setattr(os, "setpriority", set_it)
    return state


def test_precedence_is_taken_where_it_is_allowed(priority: dict[str, Any]) -> None:
    assert calm.take_precedence()
    assert priority["nice"] == calm.NICE


@pytest.mark.parametrize(("nice", "allowed"), [(0, False), (19, True), (-15, True)])
def test_precedence_is_left_where_it_is_not_allowed_or_somebody_set_it(
    priority: dict[str, Any], nice: int, allowed: bool
) -> None:
    priority.update(nice=nice, allowed=allowed)
    assert not calm.take_precedence()
    assert priority["nice"] == nice


def test_no_garbage_is_collected_in_calm() -> None:
    assert gc.isenabled()
    with calm.calm():
        assert not gc.isenabled()
        with calm.calm():
            pass
        assert not gc.isenabled()
    assert gc.isenabled()


def test_settled_things_are_not_looked_through_again() -> None:
    with calm.settled():
        assert gc.get_freeze_count() > 1000
    assert gc.get_freeze_count() == 0
