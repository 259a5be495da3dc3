"""Recruiting, withdrawal and the researcher's page; in both databases, since they read and change most tables."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator
from datetime import timedelta

import pytest
import sqlalchemy as sa
from serving import QUESTIONS, TOKEN, Person, Serving, answer_to, make_host
from starlette.testclient import TestClient

from study.apps.server.web import make_app
from study.experiment.stimuli.manifest import Manifest
from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import Responses, open_responses
from study.experiment.store.sessions import session_table
from study.experiment.store.tables import withdrawals


@pytest.fixture
def responses(database: str) -> Iterator[Responses]:
    with open_responses(database) as opened:
        yield opened


LINK = {"PROLIFIC_PID": "5f1", "STUDY_ID": "s", "SESSION_ID": "9a8", "wave": "2", "unknown": "x"}


def test_parameters_of_the_link_are_kept_and_no_others(serve: Callable[..., Serving]) -> None:
    serving = serve(parameters=("PROLIFIC_PID", "STUDY_ID", "SESSION_ID", "participant", "wave"))
    serving.person().begin(parameters=LINK)
    kept = serving.ask("overview").json()["sessions"][0]["parameters"]
    assert kept == {name: value for name, value in LINK.items() if name != "unknown"}


def test_the_same_link_goes_on_and_the_same_person_begins_once(
    serve: Callable[..., Serving], responses: Responses
) -> None:
    serving = serve()
    first = serving.person()
    view = first.until(first.begin(parameters=LINK), "trial")
    first.answer(view)
    elsewhere = serving.person()
    again = elsewhere.begin("page-two", parameters=LINK, force=True)
    assert again["kind"] != "consent"
    assert first.post("/api/alive", {}).status_code == 401
    for other in ({"SESSION_ID": "guess"}, {"SESSION_ID": ""}):
        assert serving.person().begin(parameters={**LINK, **other}) == {"kind": "taken"}
    assert len(session_table(responses)) == 1


def test_another_person_at_the_same_computer_is_another_participant(
    serve: Callable[..., Serving], responses: Responses
) -> None:
    person = serve().person()
    person.until(person.begin(parameters={"participant": "p01"}), "trial")
    assert person.begin("page-two", parameters={"participant": "p02"})["kind"] == "consent"
    assert list(session_table(responses)["participant"]) == ["p01", "p02"]


def test_groups_are_filled_evenly_and_drop_outs_given_back(serve: Callable[..., Serving]) -> None:
    serving = serve(dropped_after=timedelta(seconds=-1))
    for _ in range(3):
        serving.person().begin()
    # Everybody dropped out at once: all three got the first group.
    groups = [one["group"] for one in serving.ask("overview").json()["sessions"]]
    assert groups == [0, 0, 0]
    serving = serve()
    for _ in range(4):
        person = serving.person()
        person.until(person.begin(), "done")
    overview = serving.ask("overview").json()
    assert [one["group"] for one in overview["sessions"]] == [0, 1, 1, 1, 0, 0, 0]
    assert (overview["groups"], overview["counts"]["finished"]) == ([4, 3], 4)


def test_no_more_than_are_wanted(serve: Callable[..., Serving]) -> None:
    serving = serve(most_participants=2)
    first, second = serving.person(), serving.person()
    first.begin()
    consent = second.begin()
    assert serving.person().begin() == {"kind": "full"}
    assert first.begin()["kind"] == "consent"
    second.done(consent, declined=True)
    assert serving.person().begin()["kind"] == "consent"


def test_a_place_of_a_drop_out_is_free_again_and_its_participant_may_still_come_back(
    serve: Callable[..., Serving],
) -> None:
    serving = serve(most_participants=1, dropped_after=timedelta(seconds=-1))
    first, second = serving.person(), serving.person()
    view = first.until(first.begin(), "trial")
    assert second.begin()["kind"] == "consent"
    assert first.answer(view)["counted"] is True
    # Whoever finished keeps the place for good.
    first.until(first.begin(), "done")
    assert serving.person().begin() == {"kind": "full"}


def test_at_the_end_a_code_and_the_way_back_each_once_the_session_is_done(serve: Callable[..., Serving]) -> None:
    back = "https://app.prolific.example/submissions/complete?cc=C1"
    person = serve(completion_code="C1", completion_url=back).person()
    view = person.begin(parameters=LINK)
    while view["kind"] != "done":
        assert not {"completion_code", "completion_url"} & set(view)
        view = person.step(view)
    assert (view["completion_code"], view["completion_url"]) == ("C1", back)
    assert person.begin("page-two", previous="page-one")["completion_url"] == back


def test_withdrawing_deletes_and_the_server_forgets(serve: Callable[..., Serving], responses: Responses) -> None:
    serving = serve()
    person, other = serving.person(), serving.person()
    other.until(other.begin(), "done")
    end = person.until(person.begin(), "done")
    code = end["withdrawal_code"]
    stranger = serving.person()
    assert stranger.post("/api/withdraw", {"code": "aaaa-bbbb-cccc-dddd"}).json() == {"withdrawn": False}
    assert stranger.post("/api/withdraw", {"code": code.upper()}).json() == {"withdrawn": True}
    assert stranger.post("/api/withdraw", {"code": code}).json() == {"withdrawn": False}
    assert person.post("/api/alive", {}).status_code == 401
    assert len(session_table(responses)) == 1
    assert answers_frame(responses)["participant"].nunique() == 1
    assert serving.ask("overview").json()["withdrawn"] == 1
    with responses.engine.connect() as connection:
        lines = connection.execute(sa.select(withdrawals)).mappings().all()
    assert [(line["session_id"], line["answers"]) for line in lines] == [(2, QUESTIONS)]


def test_the_researchers_page_needs_the_token(serve: Callable[..., Serving]) -> None:
    serving = serve()
    for path in ("overview", "answers.csv", "nothing.csv"):
        for token in ("", "guess", TOKEN[:-1]):
            assert serving.ask(path, token).status_code == 401
        assert serving.client.get(f"/api/researcher/{path}").status_code == 401
    assert serving.ask("nothing.csv").status_code == 404


def test_the_researcher_sees_who_is_where_and_takes_the_tables(serve: Callable[..., Serving]) -> None:
    serving = serve()
    person, finished = serving.person(), serving.person()
    finished.until(finished.begin(), "done")
    view = person.until(person.begin(), "trial")
    person.post("/api/happened", {"kind": "fault", "detail": {"what": "stalled"}})
    person.post("/api/happened", {"kind": "focus-lost"})
    overview = serving.ask("overview").json()
    assert overview["counts"] == {"in progress": 1, "finished": 1, "dropped out": 0, "declined": 0, "failed checks": 0}
    row = overview["sessions"][0]
    assert (row["state"], row["step"], row["answers"], row["faults"], row["focus_losses"]) == (
        "in progress",
        "first",
        0,
        1,
        1,
    )
    assert overview["faults"][0]["detail"] == '{"what": "stalled"}'
    person.answer(view)
    answers = list(csv.DictReader(io.StringIO(serving.ask("answers.csv").text)))
    assert len(answers) == QUESTIONS + 1
    assert {answer["participant"] for answer in answers} == {one["participant"] for one in overview["sessions"]}
    for table in overview["tables"]:
        assert serving.ask(f"{table}.csv").status_code == 200


def test_nothing_that_a_participant_typed_is_run(serve: Callable[..., Serving]) -> None:
    """In JSON it is text, in a spreadsheet it is text; pages set text, never markup (see the browser's tests)."""
    serving = serve()
    typed = '=HYPERLINK("http://x")<script>alert(1)</script>'
    person = serving.person()
    form = person.done(person.begin(parameters={"PROLIFIC_PID": typed}))
    person.done(form, values={"age": "20", "remark": typed})
    rows = list(csv.DictReader(io.StringIO(serving.ask("form.csv").text)))
    assert [row["value"] for row in rows if row["name"] == "remark"] == ["'" + typed]
    overview = serving.ask("overview")
    assert overview.headers["content-type"] == "application/json"
    assert overview.json()["sessions"][0]["parameters"]["PROLIFIC_PID"] == typed


def test_two_servers_on_one_database_share_places_and_count_an_answer_once(stimuli: Manifest, database: str) -> None:
    """As behind a proxy that spreads the load, or while one server takes another's place."""
    with open_responses(database) as one, open_responses(database) as other:
        hosts = [make_host(stimuli, responses, most_participants=1) for responses in (one, other)]
        with TestClient(make_app(hosts[0])) as first, TestClient(make_app(hosts[1])) as second:
            person, again = Person(first), Person(second)
            view = person.until(person.begin(), "trial")
            again.client.cookies.update(first.cookies)
            assert again.begin(page="another-page", force=True)["kind"] == "instructions"
            assert Person(TestClient(second.app)).begin()["kind"] == "full"
            message = answer_to(view)
            values = [option["value"] for option in view["question"]["options"]]
            # The first server has the session in memory as it was before the other tab took it over.
            assert person.post("/api/answer", message).status_code == 409
            assert person.post("/api/alive", {}).status_code == 409
            assert again.post("/api/answer", message).json()["counted"] is True
            view = person.until(person.begin(page="page-three", force=True), "trial")
            # Now it is the other server that has it as it was before.
            assert again.post("/api/answer", answer_to(view)).status_code == 409
            assert person.post("/api/answer", {**message, "value": values[1]}).json()["counted"] is False
            assert person.post("/api/answer", message).json()["counted"] is True
        assert len(answers_frame(one, roles=("trial", "practice", "check"))) == 1
