"""The database, in SQLite and in PostgreSQL: nothing lost, doubled or mixed, and a table that the analysis can take."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import sqlalchemy as sa
from toys import FakeStimuli, keep_answer

from study.errors import SessionError
from study.experiment.plan import Plan, draw_plan
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.store import participants as people
from study.experiment.store import tables as response_tables
from study.experiment.store.answers import (
    Presentation,
    has_event,
    record_event,
    record_form,
    stored_answers,
    stored_form,
)
from study.experiment.store.frames import ANSWER_COLUMNS, answers_frame, export_csv
from study.experiment.store.responses import Responses, open_responses
from study.experiment.store.sessions import all_sessions, begin_session, find_session, session_table
from study.experiment.store.variables import EXPORTED
from study.tasks.answer import Answer
from study.tasks.trial import Trial


@pytest.fixture
def responses(database: str) -> Iterator[Responses]:
    with open_responses(database) as opened:
        yield opened


@pytest.fixture
def plan(toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> Plan:
    return draw_plan(toy_protocol, toy_stimuli.pairs, "p01")


def answer(trial: Trial, value: str = "same", response_s: float = 1.0, **more) -> Any:
    return Answer(trial, "", more.pop("attempt", 1), value, response_s, **more)


def test_a_session_stores_protocol_plan_seed_and_versions(
    responses: Responses, toy_protocol: Protocol, plan: Plan
) -> None:
    record = begin_session(responses, toy_protocol, plan, library="toy", library_synthetic=True)
    assert find_session(responses, "p01") == record
    assert record.plan == plan
    row = session_table(responses).iloc[0]
    assert (row["seed"], row["library"], row["library_synthetic"], row["answers"]) == (5, "toy", True, 0)
    assert row["protocol_sha256"] == toy_protocol.sha256
    assert row["segue_version"]
    assert row["python_version"]
    assert row["numpy_version"]
    assert not row["simulated"]
    with responses.engine.connect() as connection:
        stored = connection.execute(sa.select(response_tables.sessions.c.protocol_text)).scalar_one()
    assert stored == toy_protocol.text


def test_answers_come_back_as_they_were(responses: Responses, toy_protocol: Protocol, plan: Plan) -> None:
    record = begin_session(responses, toy_protocol, plan)
    given = (answer(1), answer(2, "different", 0.123), answer(3, None, None), answer(4, shown_well=False))
    assert all(keep_answer(responses, record, one) for one in given)
    assert stored_answers(responses, record.id) == given


def test_the_stimuli_of_earlier_answers_are_listed_when_an_older_database_is_opened(
    database: str, rating_protocol: Protocol, make_stimuli: Callable[[Protocol], FakeStimuli]
) -> None:
    """A database of version 6 had two columns for them; what is listed now is what its trials showed."""
    plan = draw_plan(rating_protocol, make_stimuli(rating_protocol).pairs, "p01")
    listed = sa.select(response_tables.answer_stimuli).order_by(*response_tables.answer_stimuli.primary_key)
    with open_responses(database) as responses:
        record = begin_session(responses, rating_protocol, plan)
        for trial in plan.trials:
            keep_answer(responses, record, answer(trial.trial, None, None))
        with responses.engine.begin() as connection:
            written = connection.execute(listed).all()
            response_tables.answer_stimuli.drop(connection)
            version = response_tables.schema_version.c.version
            connection.execute(sa.delete(response_tables.schema_version).where(version >= 7))
            connection.exec_driver_sql("ALTER TABLE participants DROP COLUMN page")
    shown = [(trial.trial, *each) for trial in plan.trials for each in zip(trial.stimuli, trial.members, strict=True)]
    assert [(row.trial, row.stimulus, row.member) for row in written] == shown
    assert {row.slot for row in written} == {1, 2}
    with open_responses(database) as responses, responses.engine.connect() as connection:
        assert connection.execute(listed).all() == written
        with pytest.raises(sa.exc.IntegrityError, match="answer_stimuli are append-only"):
            connection.execute(sa.delete(response_tables.answer_stimuli))


def test_an_answer_sent_twice_counts_once_and_another_one_is_refused(
    responses: Responses, toy_protocol: Protocol, plan: Plan
) -> None:
    record = begin_session(responses, toy_protocol, plan)
    assert keep_answer(responses, record, answer(1))
    assert not keep_answer(responses, record, answer(1))
    with pytest.raises(SessionError, match=r"first answer of 'p01' to trial 1 \(showing 1\), found that one is stored"):
        keep_answer(responses, record, answer(1, "different"))
    assert stored_answers(responses, record.id) == (answer(1),)


RECORDS = ("answers", "events", "presentations", "form_values", "sessions", "participants", "withdrawals")


@pytest.fixture
def full(responses: Responses, toy_protocol: Protocol, plan: Plan) -> Any:
    """A database with a row in every table, and one session withdrawn."""
    gone = begin_session(responses, toy_protocol, replace(plan, participant="gone"))
    people.erase(responses, gone.id)
    people.admit(responses, toy_protocol, people.Newcomer("p01", "token"), people.Places(), lambda _: plan)
    record = find_session(responses, "p01")
    keep_answer(responses, record, answer(1), [Presentation(1, 1, "first", "x", "swap", 9, 9, 1.0, True)])
    record_form(responses, record, {"age": "33"})
    return responses


@pytest.mark.parametrize("table", RECORDS)
def test_records_can_be_neither_changed_nor_deleted(full: Any, table: str) -> None:
    column = {"sessions": "id"}.get(table, "session_id")
    statements = [f"DELETE FROM {table}"]
    if table != "participants":  # their tokens change, and when they were last seen
        statements.append(f"UPDATE {table} SET {column} = {column}")
    if full.engine.dialect.name == "postgresql":
        statements.append(f"TRUNCATE {table} CASCADE")
    for statement in statements:
        with pytest.raises(sa.exc.IntegrityError, match="append-only"), full.engine.begin() as connection:
            connection.execute(sa.text(statement))
    with full.engine.connect() as connection:
        assert connection.execute(sa.text(f"SELECT count(*) FROM {table}")).scalar_one() > 0


def test_a_withdrawn_session_can_be_deleted_from_every_table(full: Any, plan: Plan) -> None:
    record = find_session(full, plan.participant)
    people.erase(full, record.id)
    with full.engine.connect() as connection:
        counts = {table: connection.execute(sa.text(f"SELECT count(*) FROM {table}")).scalar_one() for table in RECORDS}
        line = connection.execute(sa.select(response_tables.withdrawals).order_by(sa.text("session_id DESC"))).first()
    assert counts == {**dict.fromkeys(RECORDS, 0), "withdrawals": 2}
    assert (line.session_id, line.answers) == (record.id, 1)


def test_what_no_database_can_store_is_replaced(responses: Responses, toy_protocol: Protocol, plan: Plan) -> None:
    """PostgreSQL takes no NUL, and half a surrogate pair is no text: a page may send both."""
    record = begin_session(responses, toy_protocol, plan)
    record_form(responses, record, {"remark": "a\0b\ud83dc \U0001f600"})
    record_event(responses, record, "fault", {"what": "a\0b"})
    assert stored_form(responses, record.id) == {"remark": "a\ufffdb\ufffdc \U0001f600"}


def test_a_seed_that_no_database_can_store_is_refused(responses: Responses, toy_protocol: Protocol, plan: Plan) -> None:
    with pytest.raises(SessionError, match="Expected a seed below 2 to the power of 63, found 9223372036854775808"):
        begin_session(responses, toy_protocol, replace(plan, seed=2**63))
    assert begin_session(responses, toy_protocol, replace(plan, seed=2**63 - 1)).plan.seed == 2**63 - 1


def test_a_missed_answer_has_no_value(responses: Responses, toy_protocol: Protocol, plan: Plan) -> None:
    """The database itself refuses what would contradict itself."""
    record = begin_session(responses, toy_protocol, plan)
    keep_answer(responses, record, answer(1, None, None))
    with pytest.raises(sa.exc.IntegrityError, match="missed_has_no_answer"), responses.engine.begin() as connection:
        connection.execute(
            sa.insert(response_tables.answers).values(
                session_id=record.id, trial=2, item="", attempt=1, study="s", task="t", repeat=1, pair="p", motion="m",
                category="c", first="a", second="b", method_a="x", method_b="y", answer="same", missed=True,
                shown_well=True, answered_at=datetime.now(UTC),
            )
        )  # fmt: skip


def test_the_table_says_what_each_answer_means(responses: Responses, toy_protocol: Protocol, plan: Plan) -> None:
    record = begin_session(responses, toy_protocol, plan)
    for trial in plan.trials:
        value = "different" if trial.task == "same-different" else "first"
        keep_answer(responses, record, answer(trial.trial, value))
    table = answers_frame(responses)
    assert tuple(table.columns) == ANSWER_COLUMNS
    assert len(table) == 8
    jnd = table[table["study"] == "jnd"]
    assert list(jnd["correct"]) == [difference != 0 for difference in jnd["difference_frames"]]
    assert jnd["chose_a"].isna().all()
    liking = table[table["study"] == "liking"]
    assert list(liking["chose_a"]) == list(liking["a_first"])
    assert liking["correct"].isna().all()
    assert liking["difference_frames"].isna().all()
    assert table["answered_at"].str.endswith("+00:00").all()


def test_missed_answers_are_neither_right_nor_wrong(responses: Responses, toy_protocol: Protocol, plan: Plan) -> None:
    record = begin_session(responses, toy_protocol, plan)
    keep_answer(responses, record, answer(1, None, None))
    row = answers_frame(responses).iloc[0]
    assert row["missed"]
    assert pd.isna(row["answer"])
    assert pd.isna(row["correct"])
    assert pd.isna(row["response_s"])


def test_the_last_showing_counts_and_all_can_be_had(responses: Responses, toy_protocol: Protocol, plan: Plan) -> None:
    record = begin_session(responses, toy_protocol, plan)
    keep_answer(responses, record, answer(1, "same", shown_well=False))
    keep_answer(responses, record, answer(1, "different", attempt=2))
    assert list(answers_frame(responses)["answer"]) == ["different"]
    assert list(answers_frame(responses, all_attempts=True)["answer"]) == ["same", "different"]


def test_an_empty_database_gives_an_empty_table(responses: Responses) -> None:
    assert tuple(answers_frame(responses).columns) == ANSWER_COLUMNS
    assert len(answers_frame(responses)) == 0
    assert len(session_table(responses)) == 0


def test_a_session_is_taken_up_not_begun_again(responses: Responses, toy_protocol: Protocol, plan: Plan) -> None:
    first = begin_session(responses, toy_protocol, plan)
    keep_answer(responses, first, answer(1))
    second = begin_session(responses, toy_protocol, plan)
    assert second == first
    assert len(all_sessions(responses)) == 1
    assert len(stored_answers(responses, second.id)) == 1
    assert has_event(responses, second, "resumed")
    assert not has_event(responses, second, "finished")
    record_event(responses, second, "finished", {"why": "done"})
    assert has_event(responses, second, "finished")


def test_protocols_are_not_mixed(
    responses: Responses, toy_protocol: Protocol, toy_stimuli: FakeStimuli, plan: Plan
) -> None:
    begin_session(responses, toy_protocol, plan)
    other = parse_protocol(toy_protocol.text + "# changed\n")
    with pytest.raises(
        SessionError, match=f"sha256 {other.sha256[:12]}, found some of 'toy' with {toy_protocol.sha256[:12]}"
    ):
        begin_session(responses, other, draw_plan(other, toy_stimuli.pairs, "p02"))


def test_answers_of_merged_protocols_are_not_mixed_silently(
    responses: Responses, toy_protocol: Protocol, plan: Plan
) -> None:
    record = begin_session(responses, toy_protocol, plan)
    keep_answer(responses, record, answer(1))
    with responses.engine.begin() as connection:
        row = dict(connection.execute(sa.select(response_tables.sessions)).mappings().one())
        row |= {"id": 2, "participant": "p02", "protocol_sha256": "f" * 64}
        connection.execute(sa.insert(response_tables.sessions).values(row))
    other = find_session(responses, "p02")
    keep_answer(responses, other, answer(1))
    with pytest.raises(SessionError, match="expected answers under one protocol, found 2"):
        answers_frame(responses)
    assert list(answers_frame(responses, protocol_sha256="f" * 64)["participant"]) == ["p02"]


def test_a_real_participant_never_becomes_a_simulated_one(
    responses: Responses, toy_protocol: Protocol, plan: Plan
) -> None:
    begin_session(responses, toy_protocol, plan)
    with pytest.raises(SessionError, match="Expected a simulated participant 'p01', found a real one"):
        begin_session(responses, toy_protocol, plan, simulated=True)


def test_another_plan_for_the_same_participant_is_refused(
    responses: Responses, toy_protocol: Protocol, toy_stimuli: FakeStimuli, plan: Plan
) -> None:
    begin_session(responses, toy_protocol, plan)
    with pytest.raises(SessionError, match=r"stored plan of participant 'p01' \(seed 5\), found another \(seed 6\)"):
        begin_session(responses, toy_protocol, draw_plan(toy_protocol, toy_stimuli.pairs, "p01", seed=6))


def test_csv_holds_every_showing(responses: Responses, toy_protocol: Protocol, plan: Plan, tmp_path: Path) -> None:
    record = begin_session(responses, toy_protocol, plan)
    keep_answer(responses, record, answer(1, "same", shown_well=False))
    keep_answer(responses, record, answer(1, "different", attempt=2))
    table = pd.read_csv(export_csv(responses, tmp_path / "answers.csv", {}, {}))
    assert tuple(table.columns) == tuple(EXPORTED)
    assert list(table["attempt"]) == [1, 2]
    assert not list(tmp_path.glob("*.part"))
