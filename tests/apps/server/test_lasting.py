"""What has to last: a finished session counts, places are held, background work goes on, memory is given back."""

from __future__ import annotations

import asyncio
import gc
import threading
import time
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
import sqlalchemy as sa
from serving import Serving, answer_to

from study.apps.server import hosting, live, web
from study.apps.server.hosting import MOST_EVENTS
from study.experiment.store import participants as people
from study.experiment.store.responses import Responses
from study.experiment.store.tables import events


def count(responses: Responses, *kinds) -> Any:
    with responses.engine.connect() as connection:
        query = sa.select(sa.func.count()).where(events.c.kind.in_(kinds))
        return connection.execute(query).scalar_one()


def later(hours: float) -> Any:
    class Later(datetime):
        @classmethod
        def now(cls, tz: Any = None) -> Any:
            return datetime.now(tz) + timedelta(hours=hours)

    return Later


# A finished session


@pytest.mark.parametrize("restarted", [False, True])
def test_a_session_of_many_events_is_finished_all_the_same(
    serve: Callable[..., Serving], responses: Responses, monkeypatch: pytest.MonkeyPatch, restarted: bool
) -> None:
    monkeypatch.setattr(hosting, "MOST_EVENTS", 30)
    serving = serve(most_participants=1)
    person = serving.person()
    view = person.begin()
    for _ in range(50):  # before the consent, too, which is no page's event either
        person.post("/api/happened", {"kind": "focus-lost"})
    view = person.until(view, "trial")
    for number in range(5):
        person.begin(f"page-{number:04d}", force=True)
    if restarted:
        cookies, serving = person.client.cookies, serve(most_participants=1)
        person = serving.person(person.page)
        person.client.cookies = cookies
        for _ in range(50):
            person.post("/api/happened", {"kind": "focus-lost"})
    person.until(person.begin("page-last", force=True), "done")
    assert [count(responses, kind) for kind in ("consent", "finished")] == [1, 1]
    assert 25 <= count(responses, "focus-lost", "interrupted", "display") <= 30
    assert serving.ask("overview").json()["counts"]["finished"] == 1
    # An hour later it keeps its place.
    monkeypatch.setattr(serving.host, "clock", lambda: datetime.now(UTC) + timedelta(hours=2))
    assert serving.person().begin() == {"kind": "full"}


def test_the_cap_is_far_above_what_a_session_has() -> None:
    assert MOST_EVENTS == 2000


def test_who_closes_the_page_over_the_debriefing_has_finished(
    serve: Callable[..., Serving], responses: Responses
) -> None:
    serving = serve(completion_code="C1")
    person = serving.person()
    view = person.until(person.begin(), "debrief")
    assert "withdrawal_code" in view
    assert count(responses, "finished") == 1
    # It can still be read, and after it the last page stays the last.
    again = person.begin("page-two", previous="page-one")
    assert again["kind"] == "debrief"
    assert person.done(again)["completion_code"] == "C1"
    assert person.begin("page-three", previous="page-two")["completion_code"] == "C1"
    assert count(responses, "finished") == 1


# Places


@pytest.mark.parametrize("hours", [2, 48, -48])
def test_a_clock_that_is_set_frees_no_place_and_holds_none(
    serve: Callable[..., Serving], monkeypatch: pytest.MonkeyPatch, hours: int
) -> None:
    serving = serve(most_participants=1)
    first = serving.person()
    view = first.until(first.begin(), "trial")
    for module in (people, hosting):
        monkeypatch.setattr(module, "datetime", later(hours))
    assert people._utc_now() - datetime.now(UTC) > timedelta(hours=1) or hours < 0
    assert serving.person().begin() == {"kind": "full"}
    serving.client.portal.call(serving.host.note_who_is_here)
    assert serving.person().begin() == {"kind": "full"}
    listed = serving.ask("overview").json()
    assert (listed["counts"]["in progress"], listed["groups"]) == (1, [1, 0])
    first.answer(view)
    # What is recorded has the time that the machine shows; who is gone is told by the time that passed.
    steady = serving.host.clock
    monkeypatch.setattr(serving.host, "clock", lambda: steady() + timedelta(hours=1.1))
    assert serving.person().begin()["kind"] == "consent"


def test_a_steady_clock_runs_with_the_time_that_passes(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = people.steady_clock()
    assert abs(clock() - datetime.now(UTC)) < timedelta(seconds=1)
    monkeypatch.setattr(people, "datetime", later(-5))
    before = clock()
    time.sleep(0.02)
    assert timedelta(seconds=0.01) < clock() - before < timedelta(seconds=5)


# Background work and threads


def test_work_in_the_background_that_fails_says_so_and_goes_on(
    serve: Callable[..., Serving], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(web, "HERE_EVERY_SECONDS", 0.02)
    happened, failing = [], [True]
    original = hosting.Host.note_who_is_here

    async def note(self: Any) -> None:
        happened.append(self.recent.copy())
        if failing[0]:
            raise RuntimeError("disk on fire")
        await original(self)

    monkeypatch.setattr(hosting.Host, "note_who_is_here", note)
    person = serve().person()
    person.begin()
    end = time.monotonic() + 10
    while len(happened) < 3:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert "Recording who is active failed" in caplog.text
    assert "disk on fire" in caplog.text
    failing[0] = False
    so_far = len(happened)
    while len(happened) < so_far + 3:
        assert time.monotonic() < end
        time.sleep(0.01)


def test_who_was_heard_of_is_not_forgotten_where_noting_it_fails(
    serve: Callable[..., Serving], monkeypatch: pytest.MonkeyPatch
) -> None:
    serving = serve()
    person = serving.person()
    person.begin()
    person.post("/api/alive", {})
    with monkeypatch.context() as broken:
        broken.setattr(people, "seen", lambda *_, **__: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            serving.client.portal.call(serving.host.note_who_is_here)
    assert len(serving.host.recent) == 1


def test_the_researcher_looks_on_while_participants_arrive(
    serve: Callable[..., Serving], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a thread goes through must not change under it: here it always does, as rarely by chance."""
    serving = serve()
    person = serving.person()
    person.begin()
    looking, arrived = threading.Event(), threading.Event()
    overview = people.overview

    def slow(responses: Responses) -> Any:
        looking.set()
        assert arrived.wait(10)
        return overview(responses)

    class Changing(dict):
        """A dictionary of which a thread other than the loop's must not take the values."""

        def values(self) -> Any:
            assert threading.current_thread() is not worker, "gone through in a thread"
            return super().values()

    monkeypatch.setattr(people, "overview", slow)
    serving.host.live_sessions = Changing(serving.host.live_sessions)
    answers = []
    worker = None

    def look() -> None:
        answers.append(serving.ask("overview"))

    thread = threading.Thread(target=look)
    thread.start()
    assert looking.wait(10)
    for _ in range(5):
        serving.person().begin()
    arrived.set()
    thread.join(20)
    assert answers[0].status_code == 200
    assert len(answers[0].json()["sessions"]) == 6


# Memory


def test_finished_sessions_leave_the_memory_and_their_pages_still_work(serve: Callable[..., Serving]) -> None:
    def sessions() -> set[int]:
        gc.collect()
        return {id(one) for one in gc.get_objects() if type(one).__name__ == "LiveSession"}

    before = sessions()  # of servers that other tests started
    serving = serve(completion_code="C1")
    host = serving.host
    people_ = [serving.person() for _ in range(3)]
    for person in people_:
        person.until(person.begin(), "done")
        assert host.live_sessions == {}
    assert sessions() <= before
    person = people_[0]
    assert person.begin("page-two")["completion_code"] == "C1"
    assert person.post("/api/alive", {}).status_code == 200
    person.client.post("/api/leave", content="page-two")
    serving.client.portal.call(host.note_who_is_here)
    assert host.live_sessions == {}


def test_who_left_in_the_middle_leaves_the_memory_and_comes_back_from_the_database(
    serve: Callable[..., Serving], monkeypatch: pytest.MonkeyPatch
) -> None:
    serving = serve()
    person = serving.person()
    view = person.until(person.begin(), "trial")
    serving.client.portal.call(serving.host.note_who_is_here)
    assert len(serving.host.live_sessions) == 1
    now = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now + live.GONE_SECONDS + 1)
    serving.client.portal.call(serving.host.note_who_is_here)
    monkeypatch.undo()
    assert serving.host.live_sessions == {}
    assert person.post("/api/answer", answer_to(view)).json()["counted"] is True


def test_messages_that_arrive_together_at_the_end_are_counted_once(
    serve: Callable[..., Serving], responses: Responses
) -> None:
    """While one waits for its turn, the session leaves the memory."""
    serving = serve()
    person = serving.person()
    view = person.until(person.begin(), "debrief")
    token = person.client.cookies[serving.host.cookie]

    async def together() -> Any:
        from study.apps.server.messages import Done

        found = [await serving.host.live_session(token) for _ in range(4)]
        return await asyncio.gather(*(serving.host.done(one, Done(step=view["step"])) for one in found))

    found = serving.client.portal.call(together)
    assert [one["kind"] for one in found] == ["done"] * 4
    assert [count(responses, kind) for kind in ("finished", "debrief")] == [1, 1]
