"""Migrations of the responses database: small named functions that bring an older one up to date; append-only rules.

A migration adds; it never drops data. The version stands in `schema_version`, one row for each migration that ran. The
databases themselves, SQLite by triggers and PostgreSQL by triggers and a function, refuse to change what was recorded
and to delete what nobody withdrew.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime

import sqlalchemy as sa

from study.errors import SessionError
from study.experiment.store.databases import alone
from study.experiment.store.tables import (
    answers,
    events,
    form_values,
    metadata,
    participants,
    presentations,
    schema_version,
    sessions,
    withdrawals,
)


def make_first_tables(connection: sa.Connection) -> None:
    """Version 1: sessions, answers, events."""
    metadata.create_all(connection, tables=[sessions, answers, events])


def keep_answers_append_only(connection: sa.Connection) -> None:
    """Version 2: SQLite itself refuses to change or delete an answer."""
    if connection.dialect.name != "sqlite":
        return
    for action in ("UPDATE", "DELETE"):
        connection.execute(
            sa.text(
                f"CREATE TRIGGER answers_no_{action.lower()} BEFORE {action} ON answers "
                "BEGIN SELECT RAISE(ABORT, 'answers are append-only'); END"
            )
        )


def tell_practice_and_checks_apart(connection: sa.Connection) -> None:
    """Version 3: the role of each trial, and what an attention check asks for; all earlier ones were trials."""
    there = {column["name"] for column in sa.inspect(connection).get_columns("answers")}
    for name, default in (("role", "trial"), ("expected", "")):
        if name not in there:
            connection.execute(sa.text(f"ALTER TABLE answers ADD COLUMN {name} TEXT NOT NULL DEFAULT '{default}'"))


def make_participant_tables(connection: sa.Connection) -> None:
    """Version 4: how stimuli were shown, the form, participants in the browser, withdrawals."""
    metadata.create_all(connection, tables=[presentations, form_values, participants, withdrawals])


def let_participants_withdraw(connection: sa.Connection) -> None:
    """Version 5: answers may be deleted after their withdrawal was written down, and only then."""
    if connection.dialect.name != "sqlite":
        return
    connection.execute(sa.text("DROP TRIGGER IF EXISTS answers_no_delete"))
    connection.execute(
        sa.text(
            "CREATE TRIGGER answers_no_delete BEFORE DELETE ON answers "
            "WHEN NOT EXISTS (SELECT 1 FROM withdrawals WHERE session_id = OLD.session_id) "
            "BEGIN SELECT RAISE(ABORT, 'answers are append-only'); END"
        )
    )


def keep_all_records_append_only(connection: sa.Connection) -> None:
    """Version 6: all that was recorded stays as it was, in PostgreSQL as in SQLite; a withdrawal's line for ever."""
    make = _guard_sqlite if connection.dialect.name == "sqlite" else _guard_postgresql
    make(connection)


# Where each table keeps the session whose withdrawal allows to delete; participants also change (token, last seen).
_SESSION_OF = {
    "answers": "session_id",
    "events": "session_id",
    "presentations": "session_id",
    "form_values": "session_id",
    "sessions": "id",
    "participants": "session_id",
}


def _guard_sqlite(connection: sa.Connection) -> None:
    for table, column in {**_SESSION_OF, "withdrawals": ""}.items():
        unless = f"WHEN NOT EXISTS (SELECT 1 FROM withdrawals WHERE session_id = OLD.{column})" if column else ""
        rules = {"DELETE": unless} if table == "participants" else {"UPDATE": "", "DELETE": unless}
        for action, condition in rules.items():
            name = f"{table}_no_{action.lower()}"
            connection.exec_driver_sql(f"DROP TRIGGER IF EXISTS {name}")
            connection.exec_driver_sql(
                f"CREATE TRIGGER {name} BEFORE {action} ON {table} {condition} "
                f"BEGIN SELECT RAISE(ABORT, '{table} are append-only'); END"
            )


# TG_ARGV[0] is the column of the session, or empty where no withdrawal allows anything.
_REFUSE = """
CREATE OR REPLACE FUNCTION segue_append_only() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    IF TG_OP = 'DELETE' AND TG_ARGV[0] <> '' THEN
        IF EXISTS (SELECT 1 FROM withdrawals WHERE session_id = (to_jsonb(OLD) ->> TG_ARGV[0])::integer) THEN
            RETURN OLD;
        END IF;
    END IF;
    RAISE integrity_constraint_violation USING MESSAGE = TG_TABLE_NAME || ' are append-only';
END $$
"""


def _guard_postgresql(connection: sa.Connection) -> None:
    connection.exec_driver_sql(_REFUSE)
    for table, column in {**_SESSION_OF, "withdrawals": ""}.items():
        actions = "DELETE" if table == "participants" else "UPDATE OR DELETE"
        for name, when, each in (("no_change", actions, "ROW"), ("no_truncate", "TRUNCATE", "STATEMENT")):
            connection.exec_driver_sql(
                f"CREATE TRIGGER {table}_{name} BEFORE {when} ON {table} "
                f"FOR EACH {each} EXECUTE FUNCTION segue_append_only('{column}')"
            )


MIGRATIONS: tuple[Callable[[sa.Connection], None], ...] = (
    make_first_tables,
    keep_answers_append_only,
    tell_practice_and_checks_apart,
    make_participant_tables,
    let_participants_withdraw,
    keep_all_records_append_only,
)


def migrate(engine: sa.Engine, place: str) -> None:
    """Run the migrations that a database has not seen, all of them or none; two programs at once run them once.

    Raises
    ------
    SessionError
        For a database of a newer Segue, and one whose tables another program made.
    """
    with engine.connect() as connection:
        if _version(connection, place) == len(MIGRATIONS):
            return
    # Asked again alone: another program may have made the tables in the meantime.
    with alone(engine) as connection:
        found = _version(connection, place)
        if found == 0:
            _refuse_strangers(connection, place)
        schema_version.create(connection, checkfirst=True)
        for version, migration in enumerate(MIGRATIONS[found:], start=found + 1):
            row = {"version": version, "migration": migration.__name__, "applied_at": datetime.now(UTC)}
            connection.execute(sa.insert(schema_version).values(row))
            migration(connection)


def _version(connection: sa.Connection, place: str) -> int:
    """How many migrations a database has seen; 0 for an empty one."""
    if not sa.inspect(connection).has_table(schema_version.name):
        return 0
    found = connection.execute(sa.select(sa.func.max(schema_version.c.version))).scalar() or 0
    if found > len(MIGRATIONS):
        raise SessionError(
            f"{place}: expected a database of version {len(MIGRATIONS)} or older, found version {found}; "
            "open it with the newer Segue that wrote it."
        )
    return int(found)


def _refuse_strangers(connection: sa.Connection, place: str) -> None:
    there = set(sa.inspect(connection).get_table_names())
    if strangers := sorted(there & set(metadata.tables) - {schema_version.name}):
        raise SessionError(
            f"{place}: expected an empty database or one of Segue's, found tables of another program by the names "
            f"{', '.join(strangers)}; make a database for Segue alone."
        )
