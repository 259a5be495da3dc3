"""Responses: a database of sessions and answers, opened.

A path or URL comes in; an open database goes out, its tables made or brought up to date. A commit waits for the disk
(`databases`), so that an answer that was acknowledged survives a killed program and a power cut alike. All records are
only ever appended: `sessions` and `answers` write them, `frames` makes tables of them for the analysis.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

import sqlalchemy as sa

from study.errors import SessionError
from study.experiment.folder import ANSWERS
from study.experiment.store.databases import (
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

Clock = Callable[[], datetime]


def utc_now() -> datetime:
    """The time that the machine's clock shows."""
    return datetime.now(UTC)


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
    except BaseException as error:
        engine.dispose()
        if isinstance(error, UnicodeDecodeError):  # of what SQLite says about a damaged table
            raise damaged(place, str(error)) from error
        if not isinstance(error, sa.exc.DBAPIError):
            raise
        if new and file is not None and file.exists() and not file.stat().st_size:
            file.unlink()  # nothing came to stand in it
        raise unusable(place, error) from error
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


def rows_of(responses: Responses, query: sa.Select[Any]) -> Sequence[sa.RowMapping]:
    """What a query finds; refused where a cell of the database is damaged."""
    try:
        with responses.engine.connect() as connection:
            return connection.execute(query).mappings().all()
    except (ValueError, TypeError) as error:  # SQLite keeps times as text
        raise damaged(responses.place, str(error)) from error
