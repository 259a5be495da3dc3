"""The tables of the responses database, with the same types in SQLite and PostgreSQL; `migrations` makes them."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa
from sqlalchemy.types import TypeDecorator


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


class StoredText(TypeDecorator[str]):
    """Text that every database takes."""

    impl = sa.Text
    cache_ok = True

    def process_bind_param(self, value: str | None, dialect: sa.Dialect) -> str | None:  # noqa: ARG002
        """Without what can't be stored."""
        return None if value is None else str(storable(value))


def storable(value: Any) -> Any:
    """A value of any column here as both databases' drivers take it.

    PostgreSQL refuses NUL in texts, and none can write half a surrogate pair. A participant may send either; U+FFFD
    takes their place, so that the rest of what was said is kept.
    """
    if isinstance(value, str):
        if value.isascii() and "\0" not in value:
            return value
        return "".join("\ufffd" if c == "\0" or "\ud800" <= c <= "\udfff" else c for c in value)
    if isinstance(value, datetime):
        return value.astimezone(UTC).replace(tzinfo=None).isoformat(" ", "microseconds")
    return value


metadata = sa.MetaData()

schema_version = sa.Table(
    "schema_version",
    metadata,
    sa.Column("version", sa.Integer, primary_key=True, autoincrement=False),
    sa.Column("migration", StoredText, nullable=False),
    sa.Column("applied_at", UtcTime, nullable=False),
)

sessions = sa.Table(
    "sessions",
    metadata,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("participant", StoredText, nullable=False, unique=True),
    sa.Column("simulated", sa.Boolean, nullable=False),
    sa.Column("protocol_name", StoredText, nullable=False),
    sa.Column("protocol_text", StoredText, nullable=False),
    sa.Column("protocol_sha256", StoredText, nullable=False),
    sa.Column("plan_json", StoredText, nullable=False),
    sa.Column("seed", sa.BigInteger, nullable=False),
    sa.Column("segue_version", StoredText, nullable=False),
    sa.Column("python_version", StoredText, nullable=False),
    sa.Column("numpy_version", StoredText, nullable=False),
    sa.Column("library", StoredText, nullable=False),
    sa.Column("library_synthetic", sa.Boolean, nullable=False),
    sa.Column("truth_json", StoredText),
    sa.Column("started_at", UtcTime, nullable=False),
)

answers = sa.Table(
    "answers",
    metadata,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("session_id", sa.ForeignKey("sessions.id"), nullable=False),
    sa.Column("trial", sa.Integer, nullable=False),
    sa.Column("item", StoredText, nullable=False),
    sa.Column("attempt", sa.Integer, nullable=False),
    sa.Column("study", StoredText, nullable=False),
    sa.Column("task", StoredText, nullable=False),
    sa.Column("repeat", sa.Integer, nullable=False),
    sa.Column("pair", StoredText, nullable=False),
    sa.Column("motion", StoredText, nullable=False),
    sa.Column("category", StoredText, nullable=False),
    sa.Column("first", StoredText, nullable=False),
    sa.Column("second", StoredText, nullable=False),
    sa.Column("difference_frames", sa.Integer),
    sa.Column("reference_first", sa.Boolean),
    sa.Column("method_a", StoredText, nullable=False),
    sa.Column("method_b", StoredText, nullable=False),
    sa.Column("a_first", sa.Boolean),
    sa.Column("answer", StoredText),
    sa.Column("missed", sa.Boolean, nullable=False),
    sa.Column("correct", sa.Boolean),
    sa.Column("chose_a", sa.Boolean),
    sa.Column("response_s", sa.Float),
    sa.Column("shown_well", sa.Boolean, nullable=False),
    sa.Column("answered_at", UtcTime, nullable=False),
    sa.Column("role", StoredText, nullable=False, server_default="trial"),
    sa.Column("expected", StoredText, nullable=False, server_default=""),
    sa.UniqueConstraint("session_id", "trial", "item", "attempt", name="one_answer_a_showing"),
    sa.CheckConstraint("(answer IS NULL) = missed", name="missed_has_no_answer"),
)

# What the trial of an answer showed, slot by slot; `member` is which of its pair's stimuli it was, from 0.
answer_stimuli = sa.Table(
    "answer_stimuli",
    metadata,
    sa.Column("session_id", sa.ForeignKey("sessions.id"), primary_key=True),
    sa.Column("trial", sa.Integer, primary_key=True, autoincrement=False),
    sa.Column("item", StoredText, primary_key=True),
    sa.Column("attempt", sa.Integer, primary_key=True, autoincrement=False),
    sa.Column("slot", sa.Integer, primary_key=True, autoincrement=False),
    sa.Column("stimulus", StoredText, nullable=False),
    sa.Column("member", sa.Integer, nullable=False),
    sa.Column("method", StoredText, nullable=False),
)

events = sa.Table(
    "events",
    metadata,
    sa.Column("id", sa.Integer, primary_key=True),
    sa.Column("session_id", sa.ForeignKey("sessions.id"), nullable=False),
    sa.Column("kind", StoredText, nullable=False),
    sa.Column("detail_json", StoredText),
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
    sa.Column("place", StoredText, nullable=False),
    sa.Column("stimulus", StoredText, nullable=False),
    sa.Column("method", StoredText, nullable=False),
    sa.Column("frames_expected", sa.Integer),
    sa.Column("frames_presented", sa.Integer),
    sa.Column("longest_gap_frames", sa.Float),
    sa.Column("shown_well", sa.Boolean, nullable=False),
    sa.Column("detail_json", StoredText),
    sa.Column("at", UtcTime, nullable=False),
)

form_values = sa.Table(
    "form_values",
    metadata,
    sa.Column("session_id", sa.ForeignKey("sessions.id"), primary_key=True),
    sa.Column("name", StoredText, primary_key=True),
    sa.Column("value", StoredText, nullable=False),
    sa.Column("at", UtcTime, nullable=False),
)

# Participants in the browser: how they are known again, and what the recruiting service said. Tokens only as hashes.
participants = sa.Table(
    "participants",
    metadata,
    sa.Column("session_id", sa.ForeignKey("sessions.id"), primary_key=True),
    sa.Column("token_sha256", StoredText, nullable=False, unique=True),
    sa.Column("withdrawal_sha256", StoredText, nullable=False, unique=True),
    sa.Column("secret", StoredText, nullable=False),
    sa.Column("group_number", sa.Integer, nullable=False),
    sa.Column("parameters_json", StoredText, nullable=False),
    sa.Column("parameters_sha256", StoredText, unique=True),
    sa.Column("began_at", UtcTime, nullable=False),
    sa.Column("seen_at", UtcTime, nullable=False),
    # The tab that shows the session, as it named itself; empty while none does.
    sa.Column("page", StoredText, nullable=False, server_default=""),
)

# What is left of a session whose participant withdrew.
withdrawals = sa.Table(
    "withdrawals",
    metadata,
    sa.Column("session_id", sa.Integer, primary_key=True, autoincrement=False),
    sa.Column("answers", sa.Integer, nullable=False),
    sa.Column("at", UtcTime, nullable=False),
)
