"""Answers: what happened in a session, on disk before the next trial shows.

A stored session and an answer, a form or an event come in; rows go out, which are only ever appended.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import lru_cache
from operator import itemgetter
from typing import Any

import sqlalchemy as sa
from pydantic_core import to_json

from study.errors import SessionError
from study.experiment.steps import form_event
from study.experiment.store.databases import alone
from study.experiment.store.responses import Clock, Responses, rows_of, utc_now
from study.experiment.store.sessions import SessionRecord, find_session
from study.experiment.store.tables import answer_stimuli, answers, events, form_values, presentations, storable
from study.tasks.answer import Answer
from study.tasks.registry import answer_columns
from study.tasks.trial import Trial


@dataclass(frozen=True)
class Presentation:
    """How one stimulus of a trial was really shown."""

    trial: int
    attempt: int
    place: str
    """The slot that it filled (`trial.PLACES`): `first`, `second`, ..."""
    stimulus: str
    method: str
    """What timed it: `requestVideoFrameCallback`, `swap`, or the name of a fallback, which measured nothing."""
    frames_expected: int | None
    frames_presented: int | None
    longest_gap_frames: float | None
    """Frames of the stimulus, frames that were seen to be presented, and the longest time between two of them in frames
    (1 is perfect); None where it was not measured."""
    shown_well: bool
    """Whether no gap was above one and a half frames, and no frame was missing."""
    detail: Mapping[str, Any] | None = None
    """Anything else, such as the times of all frames in milliseconds."""


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
    trial: Trial,
    answer: Answer,
    shown: Sequence[Presentation] = (),
    *,
    clock: Clock = utc_now,
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
            insert_rows(connection, answer_rows(record, trial, answer, shown, clock()))
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


def answer_rows(
    record: SessionRecord, trial: Trial, answer: Answer, shown: Sequence[Presentation], at: datetime
) -> list[Row]:
    """The rows of one answer, for a transaction of the caller's (`insert_rows`)."""
    values = answer_columns(trial, answer)
    presented = [(_INSERT_PRESENTATION, {"session_id": record.id, "at": at, **_presentation_values(o)}) for o in shown]
    which = {"session_id": record.id, "trial": answer.trial, "item": answer.item, "attempt": answer.attempt}
    listed: list[Row] = [
        (
            _INSERT_STIMULUS,
            {**which, "slot": slot, "stimulus": stimulus, "member": member, "method": trial.methods[member]},
        )
        for slot, (stimulus, member) in enumerate(zip(trial.stimuli, trial.members, strict=True), start=1)
    ]
    return [(_INSERT_ANSWER, {"session_id": record.id, "answered_at": at, **values}), *listed, *presented]


def insert_rows(connection: sa.Connection, rows: Sequence[Row]) -> None:
    """Insert rows of any tables within a transaction; those of one table together, in their order."""
    tables: dict[sa.Insert, list[dict[str, Any]]] = {}
    for statement, row in rows:
        tables.setdefault(statement, []).append(row)
    for statement, together in tables.items():
        names = tuple(together[0])
        text, order = _compiled(statement, names, connection.dialect)
        stored = [[storable(value) for value in row.values()] for row in together]
        named = [dict(zip(names, values, strict=True)) for values in stored] if order is None else None
        connection.exec_driver_sql(text, named or [order(values) for values in stored])


@lru_cache(maxsize=64)
def _compiled(statement: sa.Insert, names: tuple[str, ...], dialect: sa.Dialect) -> tuple[str, Any]:
    """An insertion as the driver takes it, and how it orders the values; None where it takes them by name.

    SQLAlchemy itself needs several times as long for each row.
    """
    compiled = statement.compile(dialect=dialect, column_keys=names)
    position = compiled.positiontup
    return str(compiled), None if position is None else itemgetter(*(names.index(name) for name in position))


_INSERT_ANSWER, _INSERT_STIMULUS = sa.insert(answers), sa.insert(answer_stimuli)
_INSERT_PRESENTATION, _INSERT_EVENT = sa.insert(presentations), sa.insert(events)


def _presentation_values(shown: Presentation) -> dict[str, Any]:
    # Not `asdict`: it copies the times of all frames one by one, which costs ten times all else of an answer.
    values = dict(vars(shown))
    detail = values.pop("detail")
    return {**values, "detail_json": None if detail is None else to_json(detail).decode()}


def record_form(
    responses: Responses, record: SessionRecord, values: Mapping[str, str], study: str = "", *, clock: Clock = utc_now
) -> None:
    """Store what was filled into a form (`session.filled`), once; sent twice it is stored once."""
    rows = [{"session_id": record.id, "name": name, "value": value, "at": clock()} for name, value in values.items()]
    with alone(responses.engine) as connection:
        if rows and not values.keys() & stored_form(responses, record.id, connection).keys():
            connection.execute(sa.insert(form_values), rows)
        connection.execute(sa.insert(events).values(session_id=record.id, kind=form_event(study), at=clock()))


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
    clock: Clock = utc_now,
) -> None:  # fmt: skip
    """Append what happened in a session besides answers (finished, faults, focus lost)."""
    with responses.engine.begin() as connection:
        insert_rows(connection, [event_row(record, kind, detail, clock())])


def event_row(record: SessionRecord, kind: str, detail: Mapping[str, Any] | None, at: datetime) -> Row:
    """The row of one event, for a transaction of the caller's."""
    text = None if detail is None else json.dumps(detail, sort_keys=True)
    return _INSERT_EVENT, {"session_id": record.id, "kind": kind, "at": at, "detail_json": text}
