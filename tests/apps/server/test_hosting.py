"""The server as a participant's page meets it: what is shown, what counts, what survives, who is let in."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from serving import PROTOCOL, QUESTIONS, Serving, answer_to, protocol_of

from study.apps.server import views
from study.experiment.plan import draw_plan
from study.experiment.simulation import simulate
from study.experiment.stimuli.manifest import Manifest
from study.experiment.store.answers import stored_form
from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import Responses, open_responses
from study.experiment.store.sessions import session_table
from study.experiment.store.tables import events, presentations


def happenings(responses: Responses, kind: str) -> list[Any]:
    with responses.engine.connect() as connection:
        rows = connection.execute(sa.select(events.c.detail_json).where(events.c.kind == kind)).scalars().all()
    return [json.loads(row) if row else None for row in rows]


def test_a_whole_session_of_every_task(serve: Callable[..., Serving], stimuli: Manifest, responses: Responses) -> None:
    person = serve(completion_code="C1").person()
    view = person.begin()
    kinds = []
    while view["kind"] != "done":
        kinds.append(view["kind"])
        view = person.step(view)
    assert kinds[:6] == ["consent", "form", "instructions", "instructions", "trial", "feedback"]
    assert kinds[-1] == "debrief"
    assert "break" in kinds
    assert view["completion_code"] == "C1"
    table = answers_frame(responses, roles=("trial", "practice", "check"))
    assert len(table) == QUESTIONS
    assert sorted(set(table["role"])) == ["check", "practice", "trial"]
    assert set(answers_frame(responses)["role"]) == {"trial"}
    assert set(table["task"]) == {"same-different", "preference", "rating"}
    assert stored_form(responses, 1) == {"age": "33"}
    with responses.engine.connect() as connection:
        shown = connection.execute(sa.select(presentations)).mappings().all()
    assert len(shown) == 2 * 8 + 2
    frames = {record.id: record.frames for record in stimuli.records}
    assert all(row["frames_expected"] == frames[row["stimulus"]] for row in shown)
    assert happenings(responses, "finished") == [None]
    assert happenings(responses, "consent") == [None]
    assert person.begin("page-two", previous="page-one")["kind"] == "done"
    assert len(happenings(responses, "finished")) == 1


def test_the_trial_table_is_that_of_the_simulation(
    serve: Callable[..., Serving], stimuli: Manifest, responses: Responses, tmp_path: Path
) -> None:
    person = serve().person()
    person.until(person.begin(parameters={"participant": "sim-001"}), "done")
    columns = ["participant", "study", "task", "trial", "item", "repeat", "pair", "motion", "first", "second",
               "difference_frames", "reference_first", "method_a", "method_b", "a_first", "role",
               "expected"]  # fmt: skip
    with open_responses(tmp_path / "simulated.sqlite") as others:
        simulate(protocol_of(), stimuli, others, 1)
        roles = ("trial", "practice", "check")
        there = answers_frame(others, roles=roles)[columns]
        assert answers_frame(responses, roles=roles)[columns].equals(there)


def test_an_answer_counts_once_whatever_comes_after(serve: Callable[..., Serving], responses: Responses) -> None:
    person = serve().person()
    view = person.until(person.begin(), "trial")
    message = answer_to(view, "same")
    first = person.post("/api/answer", message).json()
    again = person.post("/api/answer", message).json()
    assert (first["counted"], again["counted"]) == (True, True)
    other = person.post("/api/answer", {**message, "value": "different"}).json()
    assert other["counted"] is False
    assert {key: other[key] for key in ("kind", "step")} == {key: first[key] for key in ("kind", "step")}
    assert len(answers_frame(responses, roles=("practice",))) == 1


def test_only_what_is_asked_now_counts(serve: Callable[..., Serving], responses: Responses) -> None:
    person = serve().person()
    view = person.until(person.begin(), "trial")
    for change in ({"trial": 5}, {"attempt": 2}, {"item": "natural"}):
        assert person.post("/api/answer", {**answer_to(view), **change}).json()["counted"] is False
    film = {"method": "none", "shown_well": True}
    for change, why in (
        ({"value": "first"}, "Expected one of same, different"),
        ({"response_s": None}, "Expected response_s"),
        ({"response_s": -1}, "response_s"),
        ({"nonsense": 1}, "nonsense"),
        ({"trial": "x"}, "trial"),
        ({"shown": [{**film, "slot": 3}]}, "Expected one of the 2 films of trial 1, found 3"),
        ({"shown": [{**film, "slot": 0}]}, "slot"),
    ):
        refused = person.post("/api/answer", {**answer_to(view), **change})
        assert refused.status_code == 422
        assert why in refused.json()["error"]
    assert len(answers_frame(responses, roles=("practice", "trial", "check"))) == 0


def test_a_late_or_missing_answer_is_missed_never_guessed(serve: Callable[..., Serving], responses: Responses) -> None:
    person = serve().person()
    view = person.until(person.begin(), "trial")
    view = person.until(person.answer(view, "same", response_s=3.2), "trial")
    person.answer(view, None, response_s=None)
    table = answers_frame(responses, roles=("practice", "trial", "check"))
    assert list(table["missed"]) == [True, True]
    assert table["answer"].isna().all()


def test_a_trial_shown_badly_comes_again_at_the_end_of_its_study(serve: Callable[..., Serving]) -> None:
    person = serve().person()
    view = person.until(person.begin(), "trial")
    view = person.until(person.step(view), "trial")
    shown = answer_to(view)["shown"]
    bad = view["trial"]
    view = person.answer(view, shown=[shown[0], {**shown[1], "longest_gap_frames": 2.0, "shown_well": False}])
    order = []
    while (view := person.until(view, "trial"))["question"]["options"][0]["value"] == "same":
        order.append((view["trial"], view["attempt"]))
        view = person.step(view)
    assert order[-1] == (bad, 2)


def test_a_restarted_server_goes_on_where_it_was(serve: Callable[..., Serving], responses: Responses) -> None:
    first = serve().person()
    view = first.until(first.begin(), "trial")
    for _ in range(3):
        view = first.until(first.step(view), "trial")
    after = serve().person()
    after.client.cookies = first.client.cookies
    # The page does not even notice: its answer to the trial that it shows is taken.
    counted = after.answer(view)
    assert counted["counted"] is True
    view = after.until(counted, "done")
    assert len(answers_frame(responses, roles=("practice", "trial", "check"))) == QUESTIONS


def test_a_restart_between_two_items_of_a_rating_loses_neither(
    serve: Callable[..., Serving], responses: Responses
) -> None:
    first = serve().person()
    view = first.until(first.begin(), "trial")
    while view["kind"] != "trial" or view["question"]["item"] != "noticeable":
        view = first.step(view)
    after = serve().person()
    after.client.cookies = first.client.cookies
    assert after.answer(view)["counted"] is True
    again = serve().person()
    again.client.cookies = first.client.cookies
    view = again.until(again.begin(), "done")
    assert len(answers_frame(responses, roles=("practice", "trial", "check"))) == QUESTIONS


def test_a_reload_in_a_trial_shows_it_again_and_says_so(serve: Callable[..., Serving], responses: Responses) -> None:
    person = serve().person()
    view = person.until(person.begin(), "trial")
    again = person.begin("page-two", previous="page-one")
    assert (again["kind"], again["trial"], again["attempt"]) == ("trial", view["trial"], view["attempt"])
    assert happenings(responses, "interrupted") == [{"trial": 1, "attempt": 1}]


def test_a_second_tab_is_refused_until_it_insists(serve: Callable[..., Serving]) -> None:
    person = serve().person()
    view = person.until(person.begin(), "trial")
    assert person.begin("page-two") == {"kind": "elsewhere"}
    assert person.post("/api/alive", {}).status_code == 409
    assert person.begin("page-two", force=True)["kind"] == "trial"
    assert person.post("/api/answer", answer_to(view), page="page-one").status_code == 409
    person.client.post("/api/leave", content="page-two")
    assert person.begin("page-three")["kind"] == "trial"


def test_reading_twice_or_late_changes_nothing(serve: Callable[..., Serving]) -> None:
    person = serve().person()
    consent = person.begin()
    form = person.done(consent)
    assert person.done(consent)["kind"] == "form"
    refused = person.post("/api/done", {"step": form["step"], "values": {"age": "12"}})
    assert refused.status_code == 422
    assert "from 18" in refused.json()["error"]
    assert person.begin()["kind"] == "form"
    assert person.done(form)["kind"] == "instructions"


def test_declining_leaves_nothing(serve: Callable[..., Serving], responses: Responses) -> None:
    person = serve().person()
    assert person.done(person.begin(), declined=True) == {"kind": "declined"}
    assert len(session_table(responses)) == 0
    assert person.post("/api/alive", {}).status_code == 401


def test_a_page_learns_nothing_of_what_answers_mean(serve: Callable[..., Serving], stimuli: Manifest) -> None:
    person = serve().person()
    view = person.begin()
    films, said = [], []
    while view["kind"] != "done":
        said.append(json.dumps(view))
        films += [film["url"] for film in view.get("films", [])]
        view = person.step(view)
    assert len(films) == len(set(films)) == 2 * 8 + 2
    words = {record.id for record in stimuli.records} | {"difference_frames", "geodesic", "fixed", "cut", "expected"}
    assert not [word for word in words for text in said if word in text]


def test_films_are_for_the_participant_whose_trial_it_is(serve: Callable[..., Serving]) -> None:
    serving = serve()
    person, other = serving.person(), serving.person()
    view = person.until(person.begin(), "trial")
    other.until(other.begin(), "trial")
    url = view["films"][0]["url"]
    whole = person.client.get(url)
    assert whole.status_code == 200
    assert whole.headers["content-type"] == "video/mp4"
    part = person.client.get(url, headers={"range": "bytes=10-19"})
    assert (part.status_code, part.content) == (206, whole.content[10:20])
    assert other.client.get(url).status_code == 404
    assert serving.person().client.get(url).status_code == 404
    for path in ("/films/../manifest.mp4", "/films/%2e%2e%2fmanifest.json.mp4", "/films/.mp4", "/pages/../../cli.py"):
        assert person.client.get(path).status_code == 404
    assert person.client.get(view["ahead"][0]["url"]).status_code == 200
    view = person.until(person.step(view), "trial")
    view = person.until(person.step(view), "trial")
    assert person.client.get(url).status_code == 404


def test_a_page_may_load_the_films_of_this_trial_and_of_the_next_and_no_others(serve: Callable[..., Serving]) -> None:
    serving = serve()
    person = serving.person()
    person.until(person.begin(), "trial")
    (live,) = serving.host.live_sessions.values()
    showings = [step for step in live.state.steps if step.slot and step.role != "practice"]
    due = [step.trial for step in views.films_due(live.state)]
    assert len(set(due)) == 2
    assert due == [trial for trial in dict.fromkeys(due) for _ in range(2)]
    later = [step for step in showings if step.trial not in due]
    assert later
    for step in later:
        name = views.film_name(live.participant, step)
        assert person.client.get(f"/films/{name}.mp4").status_code == 404


def test_identical_films_look_different_from_outside(serve: Callable[..., Serving], stimuli: Manifest) -> None:
    person = serve().person()
    view = person.until(person.begin(parameters={"participant": "p01"}), "trial")
    plan = draw_plan(protocol_of(), stimuli.pairs, "p01")
    while plan.trials[view["trial"] - 1].stimuli[0] != plan.trials[view["trial"] - 1].stimuli[1]:
        view = person.until(person.step(view), "trial")
    heads = [person.client.head(film["url"]).headers for film in view["films"]]
    heads = heads if heads[0].get("etag") else [person.client.get(film["url"]).headers for film in view["films"]]
    assert heads[0]["etag"] != heads[1]["etag"]
    assert heads[0]["last-modified"] == heads[1]["last-modified"] == "Thu, 01 Jan 1970 00:00:00 GMT"


def test_a_damaged_film_is_a_fault_on_record(
    serve: Callable[..., Serving], stimuli: Manifest, responses: Responses
) -> None:
    person = serve().person()
    view = person.until(person.begin(), "trial")
    stimulus = draw_plan(protocol_of(), stimuli.pairs, session_table(responses)["participant"][0]).trials[0].stimuli[0]
    file = stimuli.video(stimulus)
    whole = file.read_bytes()
    try:
        file.write_bytes(whole[:100])
        assert person.client.get(view["films"][0]["url"]).status_code == 422
        file.unlink()
        assert person.client.get(view["films"][0]["url"]).status_code == 422
    finally:
        file.write_bytes(whole)
    assert [(fault["stimulus"], fault["bytes"]) for fault in happenings(responses, "fault")] == [
        (stimulus, 100),
        (stimulus, None),
    ]


def test_every_answer_carries_strict_headers(serve: Callable[..., Serving]) -> None:
    client = serve().client
    for path in ("/", "/pages/main.js", "/api/study", "/researcher", "/withdraw", "/no-such-page"):
        headers = client.get(path).headers
        assert headers["content-security-policy"].startswith("default-src 'none'; script-src 'self'; style-src 'self'")
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["cross-origin-opener-policy"] == "same-origin"
    person = serve().person()
    answer = person.post("/api/begin", {"page": "page-one"})
    cookie = answer.headers["set-cookie"].lower()
    assert "httponly" in cookie
    assert "samesite=strict" in cookie


def test_requests_of_other_sites_and_of_any_size_are_refused(serve: Callable[..., Serving]) -> None:
    person = serve().person()
    person.begin()
    body = {"kind": "fault", "detail": {}}
    assert person.post("/api/happened", body).status_code == 200
    assert person.post("/api/happened", body, origin="https://elsewhere.example").status_code == 403
    plain = person.client.post("/api/happened", content=json.dumps(body), headers={"content-type": "text/plain"})
    assert plain.status_code == 403
    large = json.dumps({"kind": "fault", "detail": {"what": "x" * 1_100_000}})
    assert person.post("/api/happened", large).status_code == 413

    def pieces() -> Iterator[Any]:
        for _ in range(30):
            yield b" " * 50_000

    headers = {"x-segue-page": "page-one", "content-type": "application/json"}
    assert person.client.post("/api/happened", content=pieces(), headers=headers).status_code == 413
    for nonsense in (b"", b"[]", b"{", b'{"kind": "other"}', b"\xff\xfe"):
        answer = person.client.post("/api/happened", content=nonsense, headers=headers)
        assert answer.status_code == 422, nonsense
    assert person.client.get("/api/begin").status_code == 405
    person.client.cookies.clear()
    assert person.post("/api/happened", body).status_code == 401


def test_the_token_is_all_that_lets_in(serve: Callable[..., Serving]) -> None:
    serving = serve()
    person, thief = serving.person(), serving.person()
    person.begin()
    for token in ("", "1", "x" * 43, "' OR 1=1 --"):
        thief.client.cookies.set(serving.host.cookie, token)
        assert thief.post("/api/alive", {}).status_code == 401


def test_the_protocol_stands_in_no_page(serve: Callable[..., Serving]) -> None:
    serving = serve()
    served = serving.client.get("/api/study").text + serving.client.get("/").text
    assert "geodesic" not in served
    assert PROTOCOL[:50] not in served
