"""Links whose slots nobody filled in: they name no person, whatever the notation; real identifiers are left alone."""

from __future__ import annotations

import json
import random
import secrets
import uuid
from collections.abc import Callable
from typing import Any
from urllib.parse import quote

import pytest
import sqlalchemy as sa
from serving import Serving

from study.apps.server.links import filled_in
from study.experiment.store.responses import Responses
from study.experiment.store.sessions import session_table
from study.experiment.store.tables import events

SLOTS = [
    "{{%PROLIFIC_PID%}}", "%PROLIFIC_PID%", "{PROLIFIC_PID}", "{{PROLIFIC_PID}}", "${PROLIFIC_PID}",
    "[[PROLIFIC_PID]]", "${e://Field/PROLIFIC_PID}", "[PROLIFIC_PID]", "<PROLIFIC_PID>", "<<PROLIFIC_PID>>",
    "<%= pid %>", "{% pid %}", "#{pid}", "PROLIFIC_PID", "{prolific_pid}", "prolific_id", "your PROLIFIC PID",
    "%PROLIFIC_PID", "$PROLIFIC_PID", "$(pid)", "__PROLIFIC_PID__", "@PROLIFIC_PID@", "##PID##", ":pid", "*|PID|*",
    "|pid|", "«PID»", "%7B%7BPROLIFIC_PID%7D%7D", "%257Bpid%257D", "%25PROLIFIC_PID%25", "\ufffdonnent%", "p-{{pid}}",
    "{}", "[]", "{0}", "(null)", "[object Object]", "", " ", "\t", "\u200b", "-", "?", "undefined", "null", "None",
    "NONE", "NaN", "nil", "N/A", "Undefined ", "'null'", "XXXX", "ASSIGNMENT_ID_NOT_AVAILABLE", "[survey id]",
]  # fmt: skip

PEOPLE = [
    "5f1", "5e9a8c0f1b2d3c4a5b6d7e8f", "p01", "-2-3", "A3TPS9Z1XKO0", "anna@example.org", "Müller, Anna", "日本", "x",
    "xx", "Nona", "nullagh", "anna (2)", "Id7", "0", "=1+1", "a_b", "NA", "a%b", "<img src=x onerror='1'>", "5%",
    "#7", "$5 and 3", "undefined1",
]  # fmt: skip


def happenings(responses: Responses) -> list[Any]:
    with responses.engine.connect() as connection:
        rows = connection.execute(sa.select(events.c.detail_json).where(events.c.kind == "fault")).scalars()
        return [json.loads(row) for row in rows]


@pytest.mark.parametrize("slot", SLOTS)
@pytest.mark.parametrize("name", ["PROLIFIC_PID", "participant"])
def test_a_slot_names_nobody(name: str, slot: str) -> None:
    slot = slot.replace("PROLIFIC_PID", name).replace("PROLIFIC PID", name.replace("_", " ").upper())
    kept, unfilled = filled_in({name: slot, "STUDY_ID": "s"}, ("PROLIFIC_PID", "participant"))
    assert (kept, unfilled) == ({"STUDY_ID": "s"}, {name: slot})


@pytest.mark.parametrize("person", PEOPLE)
def test_who_is_named_is_named(person: str) -> None:
    assert filled_in({"participant": f" {person} "}, ("participant",)) == ({"participant": person}, {})


def test_identifiers_that_programs_make_are_people() -> None:
    chance = random.Random(4)
    for _ in range(20_000):
        one = chance.choice(
            [lambda: f"{chance.getrandbits(96):024x}", lambda: secrets.token_urlsafe(16), lambda: str(uuid.uuid4()),
             lambda: str(chance.randrange(10**6)), lambda: quote(secrets.token_bytes(8).hex().upper())]
        )()  # fmt: skip
        assert filled_in({"participant": one}, ("participant",)) == ({"participant": one}, {}), one


def test_parameters_that_name_nobody_are_data_as_they_are() -> None:
    given = {"STUDY_ID": "{{%STUDY_ID%}}", "condition": "none"}
    assert filled_in(given, ("PROLIFIC_PID",)) == (given, {})


@pytest.mark.parametrize("slot", ["{{%PROLIFIC_PID%}}", "%PROLIFIC_PID%", "{PROLIFIC_PID}", "", "undefined"])
def test_two_browsers_with_one_unfilled_link_are_two_participants(
    serve: Callable[..., Serving], responses: Responses, slot: str
) -> None:
    serving = serve()
    link = {"PROLIFIC_PID": slot, "STUDY_ID": "s", "SESSION_ID": "{{%SESSION_ID%}}"}
    first, second = serving.person(), serving.person()
    first.until(first.begin(parameters=link), "trial")
    assert second.begin(parameters=link)["kind"] == "consent"
    assert session_table(responses)["participant"].nunique() == 2
    # In its own browser each goes on, as without an identifier.
    assert first.begin("page-two", previous="page-one", parameters=link)["kind"] == "trial"
    listed = serving.ask("overview").json()
    assert [one["parameters"] for one in listed["sessions"]] == [{"STUDY_ID": "s"}] * 2
    assert (
        happenings(responses)
        == [{"what": "link not filled in", "PROLIFIC_PID": slot, "SESSION_ID": "{{%SESSION_ID%}}"}] * 2
    )


def test_a_person_with_an_unfilled_visit_goes_on_in_the_same_browser_only(serve: Callable[..., Serving]) -> None:
    serving = serve()
    link = {"PROLIFIC_PID": "5f1", "SESSION_ID": "{{%SESSION_ID%}}"}
    first = serving.person()
    first.begin(parameters=link)
    assert serving.person().begin(parameters=link) == {"kind": "taken"}
    assert first.begin("page-two", previous="page-one", parameters=link)["kind"] == "consent"
