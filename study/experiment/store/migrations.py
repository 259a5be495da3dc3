"""Migrations of the responses database: one named function a version brings an older database up to date.

A migration adds; it never drops data. The table `schema_version` has one row for each migration that ran. The
databases themselves (SQLite by triggers, PostgreSQL by triggers and a function) refuse to change a recorded row, and
to delete one whose session was not withdrawn.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime

import sqlalchemy as sa

from study.errors import SessionError
from study.experiment.store.databases import alone
from study.experiment.store.tables import (
    answer_stimuli,
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


def make_tables(connection: sa.Connection) -> None:
    """Make the tables of a new database; from then on it accepts additions only, and no change to what is recorded."""
    metadata.create_all(connection, tables=_FIRST_TABLES)
    if connection.dialect.name != "sqlite":
        connection.exec_driver_sql(_REFUSE)
    for table, column in {**_SESSION_OF, "withdrawals": ""}.items():
        _guard(connection, table, column)


def list_stimuli_of_answers(connection: sa.Connection) -> None:
    """Make the table of the stimuli that a trial showed, however many; those of earlier answers are entered."""
    answer_stimuli.create(connection)
    own, columns = answers.c, [column.name for column in answer_stimuli.c]
    a_first = sa.func.coalesce(own.a_first, own.reference_first, sa.true())
    for slot, stimulus, is_a in ((1, own.first, a_first), (2, own.second, sa.not_(a_first))):
        member, method = sa.case((is_a, 0), else_=1), sa.case((is_a, own.method_a), else_=own.method_b)
        found = sa.select(
            own.session_id, own.trial, own.item, own.attempt, sa.literal(slot), stimulus, member, method
        ).where(stimulus != "")
        connection.execute(sa.insert(answer_stimuli).from_select(columns, found))
    _guard(connection, answer_stimuli.name, "session_id")


def name_the_page(connection: sa.Connection) -> None:
    """Add the column for the tab that shows a session; a new database has it."""
    if "page" not in {column["name"] for column in sa.inspect(connection).get_columns("participants")}:
        connection.exec_driver_sql("ALTER TABLE participants ADD COLUMN page TEXT NOT NULL DEFAULT ''")


_FIRST_TABLES = [sessions, answers, events, presentations, form_values, participants, withdrawals]
# The column that names the session whose withdrawal allows its rows to be deleted. Rows of participants also change
# (token, last seen, page).
_SESSION_OF = {
    "answers": "session_id",
    "events": "session_id",
    "presentations": "session_id",
    "form_values": "session_id",
    "sessions": "id",
    "participants": "session_id",
}


def _guard(connection: sa.Connection, table: str, column: str) -> None:
    """Let the database refuse changes to a table, and deletions but those that a withdrawal allows by this column."""
    guard = _guard_sqlite if connection.dialect.name == "sqlite" else _guard_postgresql
    guard(connection, table, column)


def _guard_sqlite(connection: sa.Connection, table: str, column: str) -> None:
    unless = f"WHEN NOT EXISTS (SELECT 1 FROM withdrawals WHERE session_id = OLD.{column})" if column else ""
    rules = {"DELETE": unless} if table == "participants" else {"UPDATE": "", "DELETE": unless}
    for action, condition in rules.items():
        connection.exec_driver_sql(
            f"CREATE TRIGGER {table}_no_{action.lower()} BEFORE {action} ON {table} {condition} "
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


def _guard_postgresql(connection: sa.Connection, table: str, column: str) -> None:
    actions = "DELETE" if table == "participants" else "UPDATE OR DELETE"
    for name, when, each in (("no_change", actions, "ROW"), ("no_truncate", "TRUNCATE", "STATEMENT")):
        connection.exec_driver_sql(
            f"CREATE TRIGGER {table}_{name} BEFORE {when} ON {table} "
            f"FOR EACH {each} EXECUTE FUNCTION segue_append_only('{column}')"
        )


# No database of a version below 6 was ever released.
FIRST_VERSION = 6
MIGRATIONS: tuple[Callable[[sa.Connection], None], ...] = (make_tables, list_stimuli_of_answers, name_the_page)
VERSION = FIRST_VERSION + len(MIGRATIONS) - 1


def migrate(engine: sa.Engine, place: str) -> None:
    """Run the migrations that a database has not had, all of them or none; two programs at once run them once.

    Raises
    ------
    SessionError
        For a database of a newer Segue or of one before its first release, and for tables that another program made.
    """
    with engine.connect() as connection:
        if _version(connection, place) == VERSION:
            return
    # Check again while nobody else may write: another program may have made the tables in the meantime.
    with alone(engine) as connection:
        found = _version(connection, place)
        if found is None:
            _refuse_strangers(connection, place)
        schema_version.create(connection, checkfirst=True)
        following = FIRST_VERSION if found is None else found + 1
        for version, migration in enumerate(MIGRATIONS[following - FIRST_VERSION :], start=following):
            row = {"version": version, "migration": migration.__name__, "applied_at": datetime.now(UTC)}
            connection.execute(sa.insert(schema_version).values(row))
            migration(connection)


def _version(connection: sa.Connection, place: str) -> int | None:
    """The newest migration that a database has had; None for a database without tables of Segue."""
    if not sa.inspect(connection).has_table(schema_version.name):
        return None
    found = connection.execute(sa.select(sa.func.max(schema_version.c.version))).scalar()
    if found is not None and found > VERSION:
        raise SessionError(
            f"{place}: expected a database of version {VERSION} or older, found version {found}; "
            "open it with the newer Segue that wrote it."
        )
    if found is not None and found < FIRST_VERSION:
        raise SessionError(
            f"{place}: expected a database of version {FIRST_VERSION} or newer, found version {found}, which was never "
            "released; export its answers with the Segue that wrote it, and start a new database."
        )
    return found


def _refuse_strangers(connection: sa.Connection, place: str) -> None:
    there = set(sa.inspect(connection).get_table_names())
    if strangers := sorted(there & set(metadata.tables) - {schema_version.name}):
        raise SessionError(
            f"{place}: expected an empty database or one of Segue's, found tables of another program by the names "
            f"{', '.join(strangers)}; make a database for Segue alone."
        )
