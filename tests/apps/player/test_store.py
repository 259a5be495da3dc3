"""The player's store in a real database: it waits while PostgreSQL is away, and loses nothing that it said it kept."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from study.apps.player.store import ResponsesStore
from study.experiment.plan import draw_plan
from study.experiment.store.answers import has_event, stored_form
from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import open_responses
from study.experiment.store.sessions import find_session
from study.tasks.answer import Answer


def participant(responses: Any, small: Any, name: str) -> ResponsesStore:
    plan = draw_plan(small.protocol, small.stimuli.pairs, name)
    return ResponsesStore(responses, small.protocol, plan, "toy", True)


def test_nothing_is_written_before_the_session_begins(database: str, make_small: Any) -> None:
    with open_responses(database) as responses:
        store = participant(responses, make_small(), "p01")
        store.event("display", {"hz": 60})
        assert find_session(responses, "p01") is None
        store.form({"age": "33"}, "")
        record = find_session(responses, "p01")
        assert record is not None
        assert has_event(responses, record, "display")
        assert stored_form(responses, record.id) == {"age": "33"}
        answers, passed, finished = participant(responses, make_small(), "p01").before()
        assert (answers, finished) == ((), False)
        assert "form" in passed
        assert "consent" not in passed


@pytest.mark.parametrize("kills", [1, pytest.param(20, marks=pytest.mark.slow)])
def test_answers_outlive_a_killed_postgresql(
    postgres_server: Any, postgres_url: str, make_small: Any, kills: int
) -> None:
    """The server is killed as by a power cut while sessions are written as fast as can be, and is started again."""
    small, ended = make_small(), threading.Event()
    kept: list[tuple[str, int]] = []

    def write() -> None:
        with open_responses(postgres_url) as responses:
            number = 0
            while not ended.is_set():
                name = f"p{number:05d}"
                store = participant(responses, small, name)
                for trial in draw_plan(small.protocol, small.stimuli.pairs, name).trials:
                    store.answer(trial, Answer(trial.trial, "", 1, "same", 1.0), ())
                    kept.append((name, trial.trial))
                number += 1

    writer = threading.Thread(target=write)
    writer.start()
    try:
        for _ in range(kills):
            before = len(kept)
            while len(kept) < before + 20:
                assert writer.is_alive()
                ended.wait(0.01)
            postgres_server.kill()
            postgres_server.start()
        before = len(kept)
        while len(kept) < before + 20:
            assert writer.is_alive()
            ended.wait(0.01)
    finally:
        ended.set()
        writer.join()
    with open_responses(postgres_url) as responses:
        table = answers_frame(responses)
    assert sorted(zip(table["participant"], table["trial"], strict=True)) == sorted(kept)
