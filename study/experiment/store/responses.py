"""Responses: every answer in a database, on disk before the next trial shows.

A database path or URL comes in; sessions, answers and a table for the analysis go out. Tables are typed and
versioned; all records are only ever appended. A commit waits for the disk (`databases`), so that an answer that was
acknowledged survives a killed program and a power cut alike.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import sqlalchemy as sa
from pydantic_core import to_json

from study.errors import SessionError
from study.experiment.plan import Plan, Trial, plan_from_json
from study.experiment.protocol.whole import Protocol
from study.experiment.session import Answer, right_answer
from study.experiment.stimuli.rendering import ANSWERS
from study.experiment.store.databases import (
    alone,
    damaged,
    is_unusable,
    is_unwritable,
    open_engine,
    readable_copy,
    refuse_damaged,
    shown,
    sqlite_file,
    unusable,
)
from study.experiment.store.migrations import migrate
from study.experiment.store.tables import (
    answers,
    events,
    form_values,
    presentations,
    sessions,
    withdrawals,
)
from study.files import write_whole
from study.spreadsheets import safe_table

if TYPE_CHECKING:
    import pandas as pd

LARGEST_SEED = 2**63 - 1
"""What the databases' integers hold."""

Clock = Callable[[], datetime]

# The seam with the analysis: one row an answer.
ANSWER_COLUMNS = (
    "participant", "simulated", "study", "task", "trial", "attempt", "item", "repeat", "pair", "motion", "category",
    "first", "second", "difference_frames", "reference_first", "method_a", "method_b", "a_first", "answer", "missed",
    "correct", "chose_a", "response_s", "shown_well", "answered_at",
    "role", "expected",
)  # fmt: skip


def _utc_now() -> datetime:
    return datetime.now(UTC)


@dataclass(frozen=True)
class SessionRecord:
    """A stored session: who, under which protocol, with which plan."""

    id: int
    participant: str
    simulated: bool
    plan: Plan
    protocol_sha256: str
    truth: Mapping[str, Any] | None


@dataclass(frozen=True)
class Presentation:
    """How one stimulus of a trial was really shown.

    Parameters
    ----------
    place
        `first` or `second`.
    method
        What timed it: `requestVideoFrameCallback`, `swap`, or the name of a fallback, which measured nothing.
    frames_expected, frames_presented, longest_gap_frames
        Frames of the stimulus, frames that were seen to be presented, and the longest time between two of them in
        frames (1 is perfect); None where it was not measured.
    shown_well
        Whether no gap was above one and a half frames, and no frame was missing.
    detail
        Anything else, such as the times of all frames in milliseconds.
    """

    trial: int
    attempt: int
    place: str
    stimulus: str
    method: str
    frames_expected: int | None
    frames_presented: int | None
    longest_gap_frames: float | None
    shown_well: bool
    detail: Mapping[str, Any] | None = None


class Responses:
    """An open database of sessions and answers; made by `open_responses`, closed by `close` or `with`."""

    def __init__(self, engine: sa.Engine, place: str, kept: ExitStack | None = None) -> None:
        self.engine, self.place = engine, place
        self._kept = kept or ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _: object, error: BaseException | None, trace: object) -> None:
        """Close; where the database failed within the block, say how (`SessionError`)."""
        self.close()
        if is_unusable(error):
            assert error is not None, "it is an exception"
            raise unusable(self.place, error) from error

    def close(self) -> None:
        """Close all connections; SQLite then folds its write-ahead log into the file."""
        self.engine.dispose()
        self._kept.close()


def open_responses(url_or_path: str | Path) -> Responses:
    """Open a database, make its tables where there are none, and bring older tables up to date.

    Parameters
    ----------
    url_or_path
        A file for SQLite, a results folder (its `responses.sqlite`), or a URL (`databases.open_engine`).

    Raises
    ------
    SessionError
        For a database that can't be opened or does not write to disk, was written by a newer Segue, or by another
        program.
    """
    file = sqlite_file(url_or_path)
    new = file is not None and not file.exists()
    engine = open_engine(url_or_path)
    place = shown(engine.url)
    try:
        refuse_damaged(engine, place)
        migrate(engine, place)
    except sa.exc.DBAPIError as error:
        engine.dispose()
        if new and file is not None and file.exists() and not file.stat().st_size:
            file.unlink()  # nothing came to stand in it
        raise unusable(place, error) from error
    except UnicodeDecodeError as error:  # of what SQLite says about a damaged table
        engine.dispose()
        raise damaged(place, str(error)) from error
    except BaseException:
        engine.dispose()
        raise
    return Responses(engine, place)


def open_answers(folder: Path, database: str | Path | None = None) -> Responses:
    """Open the answers that were given to the stimuli of a results folder: its own, or those in another database.

    They are only read: a SQLite file in a place that can't be written to is read from a copy.

    Raises
    ------
    SessionError
        Where there are none, and for what `open_responses` refuses.
    """
    place = folder / ANSWERS if database is None else database
    file = sqlite_file(place)
    if file is None:
        return open_responses(place)
    if not file.is_file() or file.stat().st_size == 0:
        found = "an empty file" if file.is_file() else "no database"
        raise SessionError(
            f"{file}: expected answers, found {found}; collect or simulate sessions for this folder first, or name "
            "the database that they went to (--database)."
        )
    try:
        return open_responses(file)
    except SessionError as error:
        if not is_unwritable(error.__cause__):
            raise
    with ExitStack() as kept:
        copy = kept.enter_context(readable_copy(file))
        return Responses(open_responses(copy).engine, str(file), kept.pop_all())


def refuse_other_stimuli(responses: Responses, identifiers: Collection[str]) -> None:
    """Refuse a database whose sessions show stimuli that are not among these: their answers would be about nothing."""
    known = {*identifiers, ""}  # where one stimulus is rated there is no second
    for record in all_sessions(responses):
        shown_there = {name for trial in record.plan.trials for name in (trial.first, trial.second)}
        if missing := shown_there - known:
            raise SessionError(
                f"{responses.place}: expected sessions with the stimuli of this results folder, found that of "
                f"{record.participant!r}, which shows others ({len(missing)}, made from other motions, or by another "
                "version of Segue); use another database, or the results folder that it belongs to."
            )


def begin_session(
    responses: Responses,
    protocol: Protocol,
    plan: Plan,
    *,
    simulated: bool = False,
    library: str = "",
    library_synthetic: bool = False,
    truth: Mapping[str, Any] | None = None,
    clock: Clock = _utc_now,
    within: sa.Connection | None = None,
) -> SessionRecord:
    """Start a participant's session, or take up the one that there is.

    Parameters
    ----------
    within
        The caller's own transaction (`databases.alone`) where this is a part of it.

    Raises
    ------
    SessionError
        Where the database holds another protocol's sessions (another hash), where the participant's plan, or whether
        the participant is simulated, differs from what is stored.
    """
    if plan.seed > LARGEST_SEED:
        raise SessionError(f"Expected a seed below 2 to the power of 63, found {plan.seed}; choose another one.")
    with alone(responses.engine) if within is None else nullcontext(within) as connection:
        _refuse_other_protocol(connection, responses.place, protocol)
        found = connection.execute(sa.select(sessions).where(sessions.c.participant == plan.participant)).one_or_none()
        if found is not None:
            record = _session_record(found._mapping, responses.place)
            _refuse_other_plan(record, plan, simulated)
            connection.execute(sa.insert(events).values(session_id=record.id, kind="resumed", at=clock()))
            return record
        key = _fresh_id(connection)
        connection.execute(
            sa.insert(sessions).values(
                id=key,
                participant=plan.participant,
                simulated=simulated,
                protocol_name=protocol.name,
                protocol_text=protocol.text,
                protocol_sha256=protocol.sha256,
                plan_json=plan.to_json(),
                seed=plan.seed,
                library=library,
                library_synthetic=library_synthetic,
                truth_json=None if truth is None else json.dumps(truth, sort_keys=True),
                started_at=clock(),
                **_versions(),
            )
        )
        connection.execute(sa.insert(events).values(session_id=key, kind="started", at=clock()))
    return SessionRecord(key, plan.participant, simulated, plan, protocol.sha256, truth)


def _fresh_id(connection: sa.Connection) -> int:
    """The next number: the same in every database, and never that of a session which was withdrawn."""
    latest = [sa.func.coalesce(sa.func.max(column), 0) for column in (sessions.c.id, withdrawals.c.session_id)]
    return 1 + int(max(connection.execute(sa.select(one)).scalar_one() for one in latest))


def _versions() -> dict[str, str]:
    import numpy as np

    import study

    return {
        "segue_version": study.__version__,
        "python_version": platform.python_version(),
        "numpy_version": np.__version__,
    }


def _refuse_other_protocol(connection: sa.Connection, place: str, protocol: Protocol) -> None:
    query = sa.select(sessions.c.protocol_name, sessions.c.protocol_sha256).distinct()
    for name, sha256 in connection.execute(query):
        if sha256 != protocol.sha256:
            raise SessionError(
                f"{place}: expected sessions of {protocol.name!r} with sha256 {protocol.sha256[:12]}, found "
                f"some of {name!r} with {sha256[:12]}. Answers under different protocols are not mixed: use another "
                "results folder, or the protocol.toml that stands in this one."
            )


def _refuse_other_plan(record: SessionRecord, plan: Plan, simulated: bool) -> None:
    if record.simulated != simulated:
        kinds = {True: "a simulated", False: "a real"}
        raise SessionError(
            f"Expected {kinds[simulated]} participant {plan.participant!r}, found {kinds[record.simulated]} one "
            "of that name; choose another name."
        )
    if record.plan != plan:
        raise SessionError(
            f"Expected the stored plan of participant {plan.participant!r} (seed {record.plan.seed}), found another "
            f"(seed {plan.seed}); continue with the stored plan, or choose another name."
        )


def find_session(responses: Responses, participant: str) -> SessionRecord | None:
    """A participant's session, or None; resuming starts from its stored plan."""
    with responses.engine.connect() as connection:
        found = connection.execute(sa.select(sessions).where(sessions.c.participant == participant)).one_or_none()
    return None if found is None else _session_record(found._mapping, responses.place)


def session_by_id(responses: Responses, session_id: int) -> SessionRecord:
    """A session by its number."""
    with responses.engine.connect() as connection:
        found = connection.execute(sa.select(sessions).where(sessions.c.id == session_id)).one_or_none()
    if found is None:
        raise SessionError(f"{responses.place}: expected the number of a session, found {session_id}.")
    return _session_record(found._mapping, responses.place)


def all_sessions(responses: Responses) -> tuple[SessionRecord, ...]:
    """Every session, in the order in which they were started."""
    rows = rows_of(responses, sa.select(sessions).order_by(sessions.c.id))
    return tuple(_session_record(row, responses.place) for row in rows)


def rows_of(responses: Responses, query: sa.Select[Any]) -> Sequence[sa.RowMapping]:
    """What a query finds; refused where a cell of the database is damaged."""
    try:
        with responses.engine.connect() as connection:
            return connection.execute(query).mappings().all()
    except (ValueError, TypeError) as error:  # SQLite keeps times as text
        raise damaged(responses.place, str(error)) from error


def _session_record(row: sa.RowMapping, place: str) -> SessionRecord:
    try:
        plan = plan_from_json(row["plan_json"])
        truth = None if row["truth_json"] is None else json.loads(row["truth_json"])
    except SessionError as error:
        raise SessionError(f"{place}: session {row['id']}: {error}") from error
    except ValueError as error:
        raise damaged(place, f"session {row['id']}: {error}") from error
    return SessionRecord(row["id"], row["participant"], row["simulated"], plan, row["protocol_sha256"], truth)


def session_table(responses: Responses) -> pd.DataFrame:
    """One row a session: participant, simulated, protocol, seed, versions, library, truth, start, answers."""
    import pandas as pd

    count = sa.func.count(answers.c.id).label("answers")
    columns = [column for column in sessions.c if column.name not in ("protocol_text", "plan_json")]
    query = sa.select(*columns, count).outerjoin(answers, answers.c.session_id == sessions.c.id)
    rows = rows_of(responses, query.group_by(sessions.c.id).order_by(sessions.c.id))
    return pd.DataFrame([dict(row) for row in rows], columns=[*(c.name for c in columns), "answers"])


def stored_answers(responses: Responses, session_id: int) -> tuple[Answer, ...]:
    """A session's answers so far, for `session.open_session`."""
    query = sa.select(answers).where(answers.c.session_id == session_id).order_by(answers.c.id)
    rows = rows_of(responses, query)
    return tuple(
        Answer(row["trial"], row["item"], row["attempt"], row["answer"], row["response_s"], row["shown_well"])
        for row in rows
    )


def record_answer(
    responses: Responses,
    record: SessionRecord,
    answer: Answer,
    shown: Sequence[Presentation] = (),
    *,
    clock: Clock = _utc_now,
) -> bool:
    """Commit one answer, with how its stimuli were shown; it is on disk when this returns.

    Returns
    -------
    bool
        True where it is new; False where the very same answer was there already (sent twice, counted once).

    Raises
    ------
    SessionError
        Where another answer to the same showing of the same trial is there: answers are never overwritten.
    """
    try:
        with responses.engine.begin() as connection:
            insert_rows(connection, answer_rows(record, answer, shown, clock()))
    except sa.exc.IntegrityError as error:
        if answer in stored_answers(responses, record.id):
            return False
        if find_session(responses, record.participant) is None:
            raise SessionError(
                f"Expected the session of {record.participant!r}, found that it was withdrawn; nothing more is stored."
            ) from error
        raise SessionError(
            f"Expected the first answer of {record.participant!r} to trial {answer.trial} (showing {answer.attempt}), "
            f"found that one is stored already; {answer.value!r} was not. Open the session again to see what is due."
        ) from error
    return True


Row = tuple[sa.Insert, dict[str, Any]]


def answer_rows(record: SessionRecord, answer: Answer, shown: Sequence[Presentation], at: datetime) -> list[Row]:
    """The rows of one answer, for a transaction of the caller's (`insert_rows`)."""
    values = {**_trial_values(record.plan.trial(answer.trial)), **_answer_values(record.plan, answer)}
    presented = [(_INSERT_PRESENTATION, {"session_id": record.id, "at": at, **_presentation_values(o)}) for o in shown]
    return [(_INSERT_ANSWER, {"session_id": record.id, "answered_at": at, **values}), *presented]


def insert_rows(connection: sa.Connection, rows: Sequence[Row]) -> None:
    """Insert rows of any tables within a transaction; those of one table together, in their order."""
    tables: dict[sa.Insert, list[dict[str, Any]]] = {}
    for statement, row in rows:
        tables.setdefault(statement, []).append(row)
    for statement, together in tables.items():
        text, bound = _compiled(statement, tuple(together[0]), connection.dialect)
        connection.exec_driver_sql(text, [bound(row) for row in together])


@lru_cache(maxsize=64)
def _compiled(statement: sa.Insert, names: tuple[str, ...], dialect: sa.Dialect) -> tuple[str, Callable[..., Any]]:
    """An insertion as the driver takes it, and how it takes a row: SQLAlchemy itself needs twice as long for each."""
    compiled = statement.compile(dialect=dialect, column_keys=names)
    columns = statement.table.c
    made = [(name, columns[name].type.dialect_impl(dialect).bind_processor(dialect)) for name in names]
    position = compiled.positiontup

    def bound(row: Mapping[str, Any]) -> Any:
        values = {name: row[name] if process is None else process(row[name]) for name, process in made}
        return values if position is None else tuple([values[name] for name in position])

    return str(compiled), bound


_INSERT_ANSWER, _INSERT_PRESENTATION, _INSERT_EVENT = sa.insert(answers), sa.insert(presentations), sa.insert(events)


def _presentation_values(shown: Presentation) -> dict[str, Any]:
    # Not `asdict`: it copies the times of all frames one by one, which costs ten times all else of an answer.
    values = dict(vars(shown))
    detail = values.pop("detail")
    return {**values, "detail_json": None if detail is None else to_json(detail).decode()}


def record_form(
    responses: Responses, record: SessionRecord, values: Mapping[str, str], *, clock: Clock = _utc_now
) -> None:
    """Store what was filled into the form (`session.filled`), once; sent twice it is stored once."""
    rows = [{"session_id": record.id, "name": name, "value": value, "at": clock()} for name, value in values.items()]
    with alone(responses.engine) as connection:
        if rows and not stored_form(responses, record.id, connection):
            connection.execute(sa.insert(form_values), rows)
        connection.execute(sa.insert(events).values(session_id=record.id, kind="form", at=clock()))


def stored_form(responses: Responses, session_id: int, connection: sa.Connection | None = None) -> dict[str, str]:
    """What a participant filled into the form, field by field."""
    query = sa.select(form_values.c.name, form_values.c.value).where(form_values.c.session_id == session_id)
    if connection is not None:
        return {row.name: row.value for row in connection.execute(query)}
    with responses.engine.connect() as own:
        return {row.name: row.value for row in own.execute(query)}


def event_counts(responses: Responses, record: SessionRecord) -> dict[str, int]:
    """How often each kind of event happened in a session, such as `consent` and `form`, which front ends record."""
    query = sa.select(events.c.kind, sa.func.count()).where(events.c.session_id == record.id).group_by(events.c.kind)
    with responses.engine.connect() as connection:
        return {row[0]: row[1] for row in connection.execute(query)}


def has_event(responses: Responses, record: SessionRecord, kind: str) -> bool:
    """Whether something happened in a session, such as `finished`."""
    return kind in event_counts(responses, record)


def record_event(
    responses: Responses, record: SessionRecord, kind: str, detail: Mapping[str, Any] | None = None, *,
    clock: Clock = _utc_now,
) -> None:  # fmt: skip
    """Append what happened in a session besides answers (finished, faults, focus lost)."""
    with responses.engine.begin() as connection:
        insert_rows(connection, [event_row(record, kind, detail, clock())])


def event_row(record: SessionRecord, kind: str, detail: Mapping[str, Any] | None, at: datetime) -> Row:
    """The row of one event, for a transaction of the caller's."""
    text = None if detail is None else json.dumps(detail, sort_keys=True)
    return _INSERT_EVENT, {"session_id": record.id, "kind": kind, "at": at, "detail_json": text}


_TRIAL_COLUMNS = tuple(column.name for column in answers.c if column.name in Trial.__dataclass_fields__)


def _trial_values(trial: Trial) -> dict[str, Any]:
    return {name: getattr(trial, name) for name in _TRIAL_COLUMNS}


def _answer_values(plan: Plan, answer: Answer) -> dict[str, Any]:
    """The answer's own columns, with what it means: correct (same-different), method a chosen (preference)."""
    trial = plan.trial(answer.trial)
    correct = chose_a = None
    right = right_answer(trial)
    if answer.value is not None and right is not None:
        correct = answer.value == right
    if answer.value is not None and trial.task == "preference" and trial.role != "check":
        chose_a = (answer.value == "first") == trial.a_first
    return {
        "item": answer.item,
        "attempt": answer.attempt,
        "answer": answer.value,
        "missed": answer.missed,
        "correct": correct,
        "chose_a": chose_a,
        "response_s": answer.response_s,
        "shown_well": answer.shown_well,
    }


def answers_frame(
    responses: Responses,
    *,
    all_attempts: bool = False,
    roles: Sequence[str] = ("trial",),
    protocol_sha256: str | None = None,
) -> pd.DataFrame:
    """All answers as one table, one row an answer, in `ANSWER_COLUMNS`.

    Parameters
    ----------
    roles
        Which trials: `trial`, and where asked for `practice` and `check`, which no analysis counts.
    all_attempts
        With it every showing of a trial; without, the last one of each.
    protocol_sha256
        Which protocol's answers, where a database was merged from several.

    Raises
    ------
    SessionError
        Where answers under different protocols would be mixed.
    """
    import pandas as pd

    query = sa.select(answers, sessions.c.participant, sessions.c.simulated, sessions.c.protocol_sha256).join(
        sessions, answers.c.session_id == sessions.c.id
    )
    if protocol_sha256 is not None:
        query = query.where(sessions.c.protocol_sha256 == protocol_sha256)
    query = query.where(answers.c.role.in_(roles))
    rows = rows_of(responses, query.order_by(answers.c.session_id, answers.c.id))
    hashes = sorted({row["protocol_sha256"] for row in rows})
    if len(hashes) > 1:
        raise SessionError(
            f"{responses.place}: expected answers under one protocol, found {len(hashes)}: "
            f"{', '.join(sha256[:12] for sha256 in hashes)}. Say which one by its sha256."
        )
    table = pd.DataFrame([dict(row) for row in rows], columns=[*ANSWER_COLUMNS, "session_id"])
    if not all_attempts:
        table = table.drop_duplicates(["session_id", "trial", "item"], keep="last")
    table["answered_at"] = [at.isoformat() for at in table["answered_at"]]
    # Answers without a meaning (missed, another task) stay empty rather than false.
    for column in ("reference_first", "a_first", "correct", "chose_a"):
        table[column] = table[column].astype("boolean")
    for column in ("simulated", "missed", "shown_well"):
        table[column] = table[column].astype(bool)
    table["difference_frames"] = table["difference_frames"].astype("Int64")
    table["response_s"] = table["response_s"].astype(float)
    return table[list(ANSWER_COLUMNS)].reset_index(drop=True)


def export_csv(responses: Responses, path: str | Path) -> Path:
    """Write all answers, every showing and every role, as CSV (UTF-8, ISO times, empty where nothing is meant)."""
    table = answers_frame(responses, all_attempts=True, roles=("trial", "practice", "check"))
    write_whole(path, safe_table(table).to_csv(index=False))
    return Path(path)
