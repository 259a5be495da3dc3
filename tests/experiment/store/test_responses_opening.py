"""Opening a database: commits that wait for the disk, older versions, and refusals that are clear and keep secrets."""

from __future__ import annotations

import builtins
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from postgres_server import PASSWORD, ROLE, PostgresServer, without_password
from toys import FakeStimuli, keep_answer

from study.errors import SessionError
from study.experiment.plan import Plan, draw_plan
from study.experiment.protocol.whole import Protocol
from study.experiment.store import databases
from study.experiment.store import participants as people
from study.experiment.store import tables as response_tables
from study.experiment.store.responses import Responses, open_responses
from study.experiment.store.sessions import begin_session, find_session
from study.tasks.answer import Answer

ANSWER = Answer(1, "", 1, "same", 1.0)


@pytest.fixture
def plan(toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> Plan:
    return draw_plan(toy_protocol, toy_stimuli.pairs, "p01")


def scalar(responses: Responses, query: Any) -> Any:
    with responses.engine.connect() as connection:
        return connection.execute(sa.text(query)).scalar_one()


def test_sqlite_writes_through(tmp_path: Path) -> None:
    with open_responses(tmp_path) as responses:
        assert scalar(responses, "PRAGMA journal_mode") == "wal"
        assert scalar(responses, "PRAGMA synchronous") == 2
        assert scalar(responses, "PRAGMA foreign_keys") == 1


def test_postgresql_writes_through_whatever_its_settings_say(postgres_server: PostgresServer) -> None:
    """The server of these tests has synchronous_commit = off."""
    postgres_server.administer(f"CREATE DATABASE hurried OWNER {ROLE}")
    postgres_server.administer("ALTER DATABASE hurried SET default_transaction_isolation = 'serializable'")
    with open_responses(postgres_server.url("hurried")) as responses:
        assert scalar(responses, "SHOW synchronous_commit") == "on"
        assert scalar(responses, "SHOW transaction_isolation") == "read committed"
        assert scalar(responses, "SHOW lock_timeout") == f"{databases.BUSY_SECONDS}s"
        with responses.engine.connect() as connection:
            connection.rollback()  # settings are the connection's, not its first transaction's
            assert connection.execute(sa.text("SHOW synchronous_commit")).scalar_one() == "on"


def test_a_server_that_waits_for_more_than_its_own_disk_goes_on_doing_so(postgres_server: PostgresServer) -> None:
    postgres_server.administer(f"CREATE DATABASE doubled OWNER {ROLE}")
    postgres_server.administer("ALTER DATABASE doubled SET synchronous_commit = 'remote_apply'")
    with open_responses(postgres_server.url("doubled")) as responses:
        assert scalar(responses, "SHOW synchronous_commit") == "remote_apply"


def test_a_server_that_does_not_write_to_disk_is_refused(postgres_server: PostgresServer, postgres_url: str) -> None:
    with (
        postgres_server.setting("fsync", "off"),
        pytest.raises(SessionError, match="found fsync = off, which may lose"),
    ):
        open_responses(postgres_url)
    open_responses(postgres_url).close()


def test_a_database_in_another_encoding_is_refused(postgres_server: PostgresServer) -> None:
    postgres_server.administer(f"CREATE DATABASE latin OWNER {ROLE} ENCODING 'LATIN1' TEMPLATE template0")
    with pytest.raises(
        SessionError, match=r"latin at 127\.0\.0\.1, port \d+: expected a database in UTF8, found LATIN1"
    ):
        open_responses(postgres_server.url("latin"))


def test_a_database_before_the_first_release_is_refused(database: str) -> None:
    with open_responses(database) as responses, responses.engine.begin() as connection:
        version = response_tables.schema_version.c.version
        connection.execute(sa.delete(response_tables.schema_version).where(version > 6))
        connection.execute(sa.update(response_tables.schema_version).values(version=5))
    with pytest.raises(SessionError, match="version 6 or newer, found version 5, which was never released; export"):
        open_responses(database)


def test_a_newer_database_is_refused(database: str) -> None:
    with open_responses(database) as responses, responses.engine.begin() as connection:
        row = {"version": 99, "migration": "from_the_future", "applied_at": datetime.now(UTC)}
        connection.execute(sa.insert(response_tables.schema_version).values(row))
    with pytest.raises(SessionError, match="found version 99; open it with the newer Segue"):
        open_responses(database)


def test_tables_of_another_program_are_left_alone(database: str) -> None:
    engine = databases.open_engine(database)
    with engine.begin() as connection:
        connection.execute(sa.text("CREATE TABLE sessions (session_key TEXT)"))
    with pytest.raises(SessionError, match="found tables of another program by the names sessions; make a database"):
        open_responses(database)
    assert sa.inspect(engine).get_table_names() == ["sessions"]
    engine.dispose()


def test_another_file_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "other.sqlite"
    other.write_text("this is no database, but a text that is long enough to have a header" * 9)
    with pytest.raises(SessionError, match="found one that can't be opened"):
        open_responses(other)


def refusal(url: str) -> str:
    with pytest.raises(SessionError) as refused:
        open_responses(url)
    return str(refused.value)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"password": "wrong"}, "password authentication failed for user .*; check the user and the password"),
        ({"database": "nothing"}, 'database "nothing" does not exist.*; make it first: CREATE DATABASE'),
        ({"host": "no-such-host.invalid"}, "check the host's name in the URL"),
        ({"port": 1}, "Connection refused.*; check that the server runs, and the host and the port"),
        ({"username": "postgres", "database": "postgres"}, "authentication failed"),
    ],
)
def test_what_is_wrong_with_a_connection_is_said_without_the_password(
    postgres_url: str, change: dict[str, int] | dict[str, str], expected: str
) -> None:
    import re

    url = sa.make_url(postgres_url).set(**change)
    said = refusal(url.render_as_string(hide_password=False))
    assert re.search(expected, said)
    assert str(url.password) not in said.replace("wrong with", "")
    assert "***" in said


def test_a_role_that_may_not_make_tables_is_told_so(postgres_server: PostgresServer) -> None:
    postgres_server.administer("CREATE DATABASE of_somebody_else")
    said = refusal(postgres_server.url("of_somebody_else"))
    assert "permission denied for schema public" in said
    assert "make the user of the URL the owner of the database" in said


def test_a_role_that_owns_nothing_runs_sessions_and_cannot_take_the_guard_away(
    postgres_server: PostgresServer, postgres_url: str, toy_protocol: Protocol, plan: Plan
) -> None:
    """As `docs/serving.md` says: the owner makes the tables, another role writes to them."""
    open_responses(postgres_url).close()
    postgres_server.administer("DROP ROLE IF EXISTS writer; CREATE ROLE writer LOGIN PASSWORD 'w'")
    rights = (
        "GRANT SELECT, INSERT, DELETE ON ALL TABLES IN SCHEMA public TO writer",
        "GRANT UPDATE ON participants, sessions TO writer",  # sessions to lock, for no row of them can be changed
        "GRANT USAGE ON ALL SEQUENCES IN SCHEMA public TO writer",
    )
    owner = sa.create_engine(postgres_url)
    with owner.begin() as connection:
        for right in rights:
            connection.execute(sa.text(right))
    owner.dispose()
    as_writer = sa.make_url(postgres_url).set(username="writer", password="w").render_as_string(hide_password=False)
    with open_responses(as_writer) as responses:
        newcomer = people.Newcomer("p01", "token")
        people.admit(responses, toy_protocol, newcomer, people.Places(), lambda _: plan)
        record = find_session(responses, "p01")
        keep_answer(responses, record, ANSWER)
        people.seen(responses, [record.id])
        for statement in ("ALTER TABLE answers DISABLE TRIGGER ALL", "DROP FUNCTION segue_append_only() CASCADE"):
            with pytest.raises(sa.exc.ProgrammingError, match="must be owner"), responses.engine.begin() as connection:
                connection.execute(sa.text(statement))
        people.erase(responses, record.id)
        assert find_session(responses, "p01") is None


def test_a_password_is_hidden_wherever_it_stands(postgres_server: PostgresServer, postgres_url: str) -> None:
    in_query = sa.make_url(without_password(postgres_url)).update_query_dict({"password": PASSWORD})
    with open_responses(in_query.render_as_string(hide_password=False)) as responses:
        assert "wombat" not in responses.place
        assert f"127.0.0.1:{postgres_server.port}" in responses.place
    said = refusal(f"postgresql+psycopg://{ROLE}:{PASSWORD}@127.0.0.1:port/x")
    assert "wombat" not in said
    assert "write @ as %40" in said


def test_the_driver_may_be_left_out_and_others_are_refused(postgres_url: str) -> None:
    for name in ("postgresql", "postgres"):
        with open_responses(postgres_url.replace("postgresql+psycopg", name)) as responses:
            assert responses.engine.driver == "psycopg"
    for url in ("mysql://u:secret@h/d", "postgresql+asyncpg://u:secret@h/d"):
        assert "secret" not in refusal(url)
        assert "which Segue does not know; use one of these" in refusal(url)


def test_without_psycopg_it_is_said_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def without(name: str, *arguments, **more) -> Any:
        if name.split(".")[0] == "psycopg":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return real(name, *arguments, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    said = refusal("postgresql+psycopg://u:secret@127.0.0.1/d")
    assert "pip install 'psycopg[binary]'" in said
    assert "secret" not in said


def test_a_connection_that_the_server_cut_is_made_anew(
    postgres_server: PostgresServer, postgres_url: str, toy_protocol: Protocol, plan: Plan
) -> None:
    with open_responses(postgres_url) as responses:
        record = begin_session(responses, toy_protocol, plan)
        postgres_server.administer(f"SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE usename = '{ROLE}'")
        assert keep_answer(responses, record, ANSWER)
