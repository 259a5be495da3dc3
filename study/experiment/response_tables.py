"""The tables of the responses database, their version, and the small named functions that bring older ones up to date.

A migration adds; it never drops data. The version stands in `schema_version`, one row for each migration that ran.
"""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime

import sqlalchemy as sa
from sqlalchemy.types import TypeDecorator

from study.errors import SessionError


class UtcTime(TypeDecorator[datetime]):
    """A point in time with its zone: SQLite keeps none, so it is stored as UTC and read back as UTC."""

    impl = sa.DateTime
    cache_ok = True

    def process_bind_param(self, value: datetime | None, dialect: sa.Dialect) -> datetime | None:  # noqa: ARG002
        """To UTC, without zone."""
        return None if value is None else value.astimezone(UTC).replace(tzinfo=None)

    def process_result_value(self, value: datetime | None, dialect: sa.Dialect) -> datetime | None:  # noqa: ARG002
        """From UTC, with zone."""
        return None if value is None else value.replace(tzinfo=UTC)


metadata = sa.MetaData()

schema_version = sa.Table(
    "schema_version",
    metadata,
    sa.Column("version", sa.Integer, primary_key=True, autoincrement=False),
    sa.Column("migration", sa.Text, nullable=False),
    sa.Column("applied_at", UtcTime, nullable=False),
)

sessions = sa.Table(
    "sessions",
    metadata,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("participant", sa.Text, nullable=False, unique=True),
    sa.Column("simulated", sa.Boolean, nullable=False),
    sa.Column("protocol_name", sa.Text, nullable=False),
    sa.Column("protocol_text", sa.Text, nullable=False),
    sa.Column("protocol_sha256", sa.Text, nullable=False),
    sa.Column("plan_json", sa.Text, nullable=False),
    sa.Column("seed", sa.BigInteger, nullable=False),
    sa.Column("segue_version", sa.Text, nullable=False),
    sa.Column("python_version", sa.Text, nullable=False),
    sa.Column("numpy_version", sa.Text, nullable=False),
    sa.Column("library", sa.Text, nullable=False),
    sa.Column("library_synthetic", sa.Boolean, nullable=False),
    sa.Column("truth_json", sa.Text),
    sa.Column("started_at", UtcTime, nullable=False),
)

answers = sa.Table(
    "answers",
    metadata,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("session_id", sa.ForeignKey("sessions.id"), nullable=False),
    sa.Column("trial", sa.Integer, nullable=False),
    sa.Column("item", sa.Text, nullable=False),
    sa.Column("attempt", sa.Integer, nullable=False),
    sa.Column("study", sa.Text, nullable=False),
    sa.Column("task", sa.Text, nullable=False),
    sa.Column("repeat", sa.Integer, nullable=False),
    sa.Column("pair", sa.Text, nullable=False),
    sa.Column("motion", sa.Text, nullable=False),
    sa.Column("category", sa.Text, nullable=False),
    sa.Column("first", sa.Text, nullable=False),
    sa.Column("second", sa.Text, nullable=False),
    sa.Column("difference_frames", sa.Integer),
    sa.Column("reference_first", sa.Boolean),
    sa.Column("method_a", sa.Text, nullable=False),
    sa.Column("method_b", sa.Text, nullable=False),
    sa.Column("a_first", sa.Boolean),
    sa.Column("answer", sa.Text),
    sa.Column("missed", sa.Boolean, nullable=False),
    sa.Column("correct", sa.Boolean),
    sa.Column("chose_a", sa.Boolean),
    sa.Column("response_s", sa.Float),
    sa.Column("shown_well", sa.Boolean, nullable=False),
    sa.Column("answered_at", UtcTime, nullable=False),
    sa.Column("role", sa.Text, nullable=False, server_default="trial"),
    sa.Column("expected", sa.Text, nullable=False, server_default=""),
    sa.UniqueConstraint("session_id", "trial", "item", "attempt", name="one_answer_a_showing"),
    sa.CheckConstraint("(answer IS NULL) = missed", name="missed_has_no_answer"),
)

events = sa.Table(
    "events",
    metadata,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("session_id", sa.ForeignKey("sessions.id"), nullable=False),
    sa.Column("kind", sa.Text, nullable=False),
    sa.Column("detail_json", sa.Text),
    sa.Column("at", UtcTime, nullable=False),
)

# How each stimulus was really shown; a trial that was begun again has several rows of one attempt.
presentations = sa.Table(
    "presentations",
    metadata,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("session_id", sa.ForeignKey("sessions.id"), nullable=False, index=True),
    sa.Column("trial", sa.Integer, nullable=False),
    sa.Column("attempt", sa.Integer, nullable=False),
    sa.Column("place", sa.Text, nullable=False),
    sa.Column("stimulus", sa.Text, nullable=False),
    sa.Column("method", sa.Text, nullable=False),
    sa.Column("frames_expected", sa.Integer),
    sa.Column("frames_presented", sa.Integer),
    sa.Column("longest_gap_frames", sa.Float),
    sa.Column("shown_well", sa.Boolean, nullable=False),
    sa.Column("detail_json", sa.Text),
    sa.Column("at", UtcTime, nullable=False),
)

form_values = sa.Table(
    "form_values",
    metadata,
    sa.Column("session_id", sa.ForeignKey("sessions.id"), primary_key=True),
    sa.Column("name", sa.Text, primary_key=True),
    sa.Column("value", sa.Text, nullable=False),
    sa.Column("at", UtcTime, nullable=False),
)

# Participants in the browser: how they are known again, and what the recruiting service said. Tokens only as hashes.
participants = sa.Table(
    "participants",
    metadata,
    sa.Column("session_id", sa.ForeignKey("sessions.id"), primary_key=True),
    sa.Column("token_sha256", sa.Text, nullable=False, unique=True),
    sa.Column("withdrawal_sha256", sa.Text, nullable=False, unique=True),
    sa.Column("secret", sa.Text, nullable=False),
    sa.Column("group_number", sa.Integer, nullable=False),
    sa.Column("parameters_json", sa.Text, nullable=False),
    sa.Column("parameters_sha256", sa.Text, unique=True),
    sa.Column("began_at", UtcTime, nullable=False),
    sa.Column("seen_at", UtcTime, nullable=False),
)

# What is left of a session whose participant withdrew.
withdrawals = sa.Table(
    "withdrawals",
    metadata,
    sa.Column("session_id", sa.Integer, primary_key=True, autoincrement=False),
    sa.Column("answers", sa.Integer, nullable=False),
    sa.Column("at", UtcTime, nullable=False),
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


MIGRATIONS: tuple[Callable[[sa.Connection], None], ...] = (
    make_first_tables,
    keep_answers_append_only,
    tell_practice_and_checks_apart,
    make_participant_tables,
    let_participants_withdraw,
)


def migrate(engine: sa.Engine, place: str) -> None:
    """Run the migrations that a database has not seen, each in its own transaction."""
    with engine.begin() as connection:
        schema_version.create(connection, checkfirst=True)
        found = connection.execute(sa.select(sa.func.max(schema_version.c.version))).scalar() or 0
    if found > len(MIGRATIONS):
        raise SessionError(
            f"{place}: expected a database of version {len(MIGRATIONS)} or older, found version {found}; "
            "open it with the newer Segue that wrote it."
        )
    for version, migration in enumerate(MIGRATIONS[found:], start=found + 1):
        with engine.begin() as connection:
            row = {"version": version, "migration": migration.__name__, "applied_at": datetime.now(UTC)}
            connection.execute(sa.insert(schema_version).values(row))
            migration(connection)
