"""Participants of the browser: tokens, even groups, drop-outs given back, withdrawal that leaves one line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from toys import FakeStimuli, keep_answer

from study.experiment.plan import draw_plan
from study.experiment.protocol.whole import Protocol
from study.experiment.store import participants as people
from study.experiment.store.answers import (
    Presentation,
    record_event,
    record_form,
    stored_answers,
    stored_form,
)
from study.experiment.store.responses import Responses, open_responses
from study.experiment.store.sessions import session_by_id
from study.experiment.store.tables import answers, metadata, presentations, sessions, withdrawals
from study.tasks.answer import Answer

NOW = datetime(2026, 1, 1, tzinfo=UTC)


@pytest.fixture
def responses(database: str) -> Iterator[Responses]:
    with open_responses(database) as opened:
        yield opened


@pytest.fixture
def enrol(responses: Responses, toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> Any:
    """`enrol(name)`: a participant who arrived, in the group that has the fewest."""

    def enrol(name: str, groups: int = 1, at: Any = NOW, **more) -> Any:
        newcomer = people.Newcomer(name, f"token {name}", **more)
        places = people.Places(groups, dropped_after=timedelta(days=1))
        draw = lambda group: draw_plan(toy_protocol, toy_stimuli.pairs, name, group=group)  # noqa: E731
        found = people.admit(responses, toy_protocol, newcomer, places, draw, clock=lambda: at)
        return session_by_id(responses, found.session_id)

    return enrol


def code_of(responses: Responses, name: str) -> Any:
    return people.find_by_token(responses, f"token {name}").withdrawal_code


def everything(responses: Responses) -> Any:
    """All that a database gives away: for SQLite the bytes of its file, for PostgreSQL the rows of all tables."""
    if responses.engine.dialect.name == "sqlite":
        responses.close()
        return Path(responses.engine.url.database).read_bytes()
    with responses.engine.connect() as connection:
        return repr([connection.execute(sa.select(table)).all() for table in metadata.sorted_tables]).encode()


def test_a_participant_is_known_by_token_and_no_token_is_stored(responses: Responses, enrol: Any) -> None:
    record = enrol("p1", parameters={"PROLIFIC_PID": "abc"}, identifying={"PROLIFIC_PID": "abc"})
    found = people.find_by_token(responses, "token p1")
    assert (found.session_id, found.group, found.parameters) == (record.id, 0, {"PROLIFIC_PID": "abc"})
    assert people.find_by_parameters(responses, {"PROLIFIC_PID": "abc"}) == found
    assert people.find_by_token(responses, "token p2") is None
    people.give_token(responses, found, "another")
    assert people.find_by_token(responses, "token p1") is None
    assert people.find_by_token(responses, "another") == found
    assert b"token p1" not in everything(responses)


def test_tokens_and_codes_do_not_repeat() -> None:
    assert len({people.new_token() for _ in range(1000)}) == 1000
    assert len(people.new_token()) == 43
    codes = {people.Participant(1, str(secret), 0, {}, "", NOW).withdrawal_code for secret in range(1000)}
    assert len(codes) == 1000
    assert all(re.fullmatch(r"([a-z2-9]{4}-){3}[a-z2-9]{4}", code) for code in codes)


def test_groups_count_who_is_there_and_give_back_who_is_gone(responses: Responses, enrol: Any) -> None:
    finished, gone, here, declined = (
        enrol("a", 4),
        enrol("b", 4),
        enrol("c", 4, NOW + timedelta(hours=5)),
        enrol("d", 4),
    )
    record_event(responses, finished, "finished")
    record_event(responses, declined, "declined")
    later = lambda: NOW + timedelta(hours=5, minutes=1)  # noqa: E731
    assert people.filled_groups(responses, people.Places(4), clock=lambda: NOW) == [1, 1, 1, 0]
    assert people.filled_groups(responses, people.Places(4), clock=later) == [1, 0, 1, 0]
    people.seen(responses, [gone.id], clock=later)
    assert people.filled_groups(responses, people.Places(4), clock=later) == [1, 1, 1, 0]
    assert here.id


def test_a_newcomer_is_turned_away_where_there_is_no_place_or_the_name_is_known(
    responses: Responses, toy_protocol: Protocol, toy_stimuli: FakeStimuli
) -> None:
    def arrive(name: str, token: str, places: Any, **identifying) -> Any:
        draw = lambda group: draw_plan(toy_protocol, toy_stimuli.pairs, name, group=group)  # noqa: E731
        newcomer = people.Newcomer(name, token, identifying, identifying)
        return people.admit(responses, toy_protocol, newcomer, places, draw)

    roomy, narrow = people.Places(2), people.Places(2, most_participants=1)
    assert arrive("p1", "t1", narrow, PROLIFIC_PID="x").group == 0
    assert arrive("p2", "t2", narrow) == "full"
    assert arrive("p1", "t2", roomy) == "taken"
    assert arrive("p2", "t2", roomy, PROLIFIC_PID="x") == "taken"
    assert arrive("p2", "t2", roomy, PROLIFIC_PID="y").group == 1
    assert people.filled_groups(responses, roomy) == [1, 1]


def test_withdrawing_deletes_everything_and_leaves_a_line(responses: Responses, enrol: Any) -> None:
    stays, leaves = enrol("stays"), enrol("leaves")
    for record in (stays, leaves):
        shown = Presentation(1, 1, "first", "x", "swap", 9, 9, 1.0, True, {"mark": f"mark of {record.participant}"})
        keep_answer(responses, record, Answer(1, "", 1, "same", 1.0), [shown])
        record_form(responses, record, {"remark": f"words of {record.participant}"})
    assert people.withdraw(responses, "no such code", clock=lambda: NOW) is None
    assert people.withdraw(responses, f" {code_of(responses, 'leaves').upper()} ", clock=lambda: NOW) == leaves.id
    with responses.engine.connect() as connection:
        assert connection.execute(sa.select(sessions.c.participant)).scalars().all() == ["stays"]
        assert connection.execute(sa.select(presentations.c.session_id)).scalars().all() == [stays.id]
        assert connection.execute(sa.select(withdrawals)).all() == [(leaves.id, 1, NOW)]
    assert stored_form(responses, stays.id) == {"remark": "words of stays"}
    assert len(stored_answers(responses, stays.id)) == 1
    whole = everything(responses)
    assert b"words of stays" in whole
    assert b"words of leaves" not in whole
    assert b"mark of leaves" not in whole


def test_only_withdrawn_answers_can_be_deleted_and_numbers_are_not_used_again(responses: Responses, enrol: Any) -> None:
    stays, leaves = enrol("stays"), enrol("leaves")
    keep_answer(responses, stays, Answer(1, "", 1, "same", 1.0))
    people.withdraw(responses, code_of(responses, "leaves"))
    assert enrol("next").id == leaves.id + 1
    with pytest.raises(sa.exc.IntegrityError, match="append-only"), responses.engine.begin() as connection:
        connection.execute(sa.delete(answers))
