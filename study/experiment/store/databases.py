"""Databases: where responses are kept. A path or a URL comes in, a SQLAlchemy engine that commits to disk goes out.

SQLite is the default, PostgreSQL goes by URL. Every connection is set up so that a commit waits for the disk, whatever
the server's or the file's own settings say, and a server that would lose commits in a power cut is refused.
"""

from __future__ import annotations

import os
import shutil
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, TypeVar

import sqlalchemy as sa

from renderer.files import scratch_folder
from study.errors import SessionError
from study.experiment.folder import ANSWERS
from study.files import make_folder, refused

BUSY_SECONDS = 10
"""How long a connection waits for another one's lock before it gives up."""

CACHE_KIB = 256
"""Of pages that a SQLite connection keeps. Its own default is eight times that for each of a server's connections, and
hardly a page is read twice; what is needed again the system keeps."""

ALONE_KEY = 0x5E60E
"""The number of the PostgreSQL advisory lock behind `alone`; any that other programs do not use would do."""

PATIENCE_SECONDS = 60.0
"""How long `patiently` waits for a database that went away: a server that is started again is back by then."""

AWAY = (sa.exc.OperationalError, sa.exc.InterfaceError, sa.exc.TimeoutError)
"""What SQLAlchemy raises while a database can't be reached or is locked: the same may succeed later (`may_pass`)."""

Made = TypeVar("Made")

_POSTGRESQL = ("postgres", "postgresql", "postgresql+psycopg")
_SQLITE = ("sqlite", "sqlite+pysqlite")


def open_engine(url_or_path: str | Path) -> sa.Engine:
    """An engine for a database; nothing is connected yet.

    Parameters
    ----------
    url_or_path
        A file for SQLite, a results folder (its `responses.sqlite`), `sqlite:///FILE`, or
        `postgresql+psycopg://USER:PASSWORD@HOST/DATABASE`.

    Raises
    ------
    SessionError
        For other kinds of databases, and where psycopg is not installed.
    FileError
        Where the folder of a SQLite file can't be made.
    """
    url = _address(url_or_path)
    if url.get_backend_name() == "sqlite":
        if file := sqlite_file(url_or_path):
            make_folder(file.parent)
        engine = sa.create_engine(url)
        sa.event.listen(engine, "connect", _set_up_sqlite)
        return engine
    # Without a limit a connection to a machine that went away waits for a quarter of an hour.
    patience = {"connect_timeout": BUSY_SECONDS, "tcp_user_timeout": 2000 * BUSY_SECONDS, "application_name": "segue"}
    arguments = {name: value for name, value in patience.items() if name not in url.query}
    try:
        # A connection is tested before each use, and replaced if a restart of the server cut it.
        engine = sa.create_engine(url, connect_args=arguments, pool_pre_ping=True)
    except ImportError as error:
        raise SessionError(
            f"{shown(url)}: expected the Python package psycopg, which connects to PostgreSQL, found none that works "
            f"({error}); install it: pip install 'psycopg[binary]'."
        ) from error
    sa.event.listen(engine, "connect", _set_up_postgresql)
    return engine


def _address(url_or_path: str | Path) -> sa.URL:
    text = str(url_or_path)
    if "://" not in text:
        path = Path(text)
        path = path / ANSWERS if path.is_dir() or not path.suffix else path
        return sa.URL.create("sqlite", database=str(path))
    try:
        url = sa.make_url(text)
    except (sa.exc.ArgumentError, ValueError):
        url = None  # its own message may hold the password
    if url is None or "@" in f"{url.host}{url.database}":
        # With a bare @ in the password, the rest of it would pass for a host and be printed.
        raise SessionError(
            "Expected a database URL such as postgresql+psycopg://USER:PASSWORD@HOST/DATABASE, found one that can't be "
            "taken apart; in a password write @ as %40, : as %3A, / as %2F and % as %25."
        )
    if url.drivername in _POSTGRESQL:
        return url.set(drivername="postgresql+psycopg")
    if url.drivername in _SQLITE:
        return url
    raise SessionError(
        f"{shown(url)}: expected a file, sqlite:///FILE or postgresql+psycopg://USER:PASSWORD@HOST/DATABASE, found "
        f"{url.drivername}, which Segue does not know; use one of these."
    )


def sqlite_file(url_or_path: str | Path) -> Path | None:
    """The file of a SQLite database; None for one in memory or on a server."""
    url = _address(url_or_path)
    name = url.database if url.get_backend_name() == "sqlite" else None
    return Path(name) if name and name != ":memory:" and not name.startswith("file:") else None


def shown(url: sa.URL) -> str:
    """A URL as it may be printed: without the password, anywhere in it; for SQLite the file."""
    if url.get_backend_name() == "sqlite":
        return url.database or "a database in memory"
    hidden = {name: "***" for name in url.query if "password" in name}
    return url.update_query_dict(hidden).render_as_string(hide_password=True)


def _set_up_sqlite(connection: Any, _: object) -> None:
    cursor = connection.cursor()
    for pragma in (
        f"busy_timeout={1000 * BUSY_SECONDS}", "journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON",
        f"cache_size={-CACHE_KIB}",
    ):  # fmt: skip
        cursor.execute(f"PRAGMA {pragma}")
    cursor.close()


_SETTINGS = "SELECT current_setting('synchronous_commit'), current_setting('fsync'), current_setting('server_encoding')"


def _set_up_postgresql(connection: Any, _: object) -> None:
    cursor = connection.cursor()
    synchronous, fsync, encoding = cursor.execute(_SETTINGS).fetchone()
    problem = ""
    if fsync == "off":
        problem = "a server that writes to disk, found fsync = off, which may lose answers; set fsync = on there"
    elif encoding != "UTF8":
        problem = f"a database in UTF8, found {encoding}; make one with CREATE DATABASE ... ENCODING 'UTF8'"
    if problem:
        place = f"{connection.info.dbname} at {connection.info.host}, port {connection.info.port}"
        connection.close()
        raise SessionError(f"{place}: expected {problem}.")
    if synchronous == "off":  # all other values wait for this server's disk at least
        cursor.execute("SET synchronous_commit = on")
    cursor.execute(f"SET lock_timeout = '{BUSY_SECONDS}s'")
    # What rests on a lock reads what others committed before it was given.
    cursor.execute("SET default_transaction_isolation = 'read committed'")
    cursor.close()
    connection.commit()


@contextmanager
def alone(engine: sa.Engine) -> Iterator[sa.Connection]:
    """A transaction that no other one of this kind runs beside, in any process: what it read stays true to its end.

    For what reads before it writes: the first tables, a new session, a place in a group. Answers need no lock, since a
    unique constraint keeps them apart.
    """
    with engine.begin() as connection:
        if engine.dialect.name == "sqlite":
            connection.exec_driver_sql("BEGIN IMMEDIATE")
        else:
            connection.execute(sa.select(sa.func.pg_advisory_xact_lock(ALONE_KEY)))
        yield connection


def patiently(
    work: Callable[[], Made],
    place: str,
    *,
    patience_s: float = PATIENCE_SECONDS,
    wait: Callable[[float], object] = time.sleep,
    clock: Callable[[], float] = time.monotonic,
) -> Made:
    """Do what writes to a database, again and again while the database is away.

    Parameters
    ----------
    work
        What may be done twice and counts once: a commit may have succeeded although its confirmation was lost.

    Raises
    ------
    SessionError
        Where the database does not come back in time.
    """
    end, pause_s = clock() + patience_s, 0.1
    while True:
        try:
            return work()
        except AWAY as error:
            if not may_pass(error):
                raise unusable(place, error) from error
            if clock() > end:
                raise SessionError(
                    f"{place}: expected a database that can be written to, found that for {patience_s:g} s it could "
                    f"not be ({in_words(error)}). Nothing that was stored is lost: when it is back, the same command "
                    "resumes."
                ) from error
        wait(pause_s)
        pause_s = min(2 * pause_s, 2.0)


def in_words(error: BaseException) -> str:
    """What a database said, on one line, without the statement that it was about."""
    return " ".join(str(getattr(error, "orig", error)).split())


def may_pass(error: BaseException) -> bool:
    """Whether the same may succeed later: where another program holds the database, or its server is away."""
    return isinstance(error, AWAY) and _sqlite_code(error) in (None, *_PASSING)


def is_unusable(error: object) -> bool:
    """Whether an error is about a database that is away, held, full, read-only or damaged, not about what was asked."""
    return isinstance(error, AWAY) or (isinstance(error, sa.exc.DatabaseError) and _sqlite_code(error) in _REFUSED)


def is_unwritable(error: object) -> bool:
    """Whether SQLite could not write at a place, where a copy elsewhere might still be read."""
    return isinstance(error, sa.exc.DatabaseError) and _sqlite_code(error) in _UNWRITTEN


def try_to_write(engine: sa.Engine, place: str) -> None:
    """Write and commit, without changing anything that is stored, or say why it can't be done.

    For a program that is about to take answers: what fails here would fail at the first of them.

    Raises
    ------
    SessionError
        For a database that is read-only, held by another program, or on a full disk.
    """
    try:
        with alone(engine) as connection:
            if engine.dialect.name == "sqlite":
                kept = connection.exec_driver_sql("PRAGMA user_version").scalar_one()
                connection.exec_driver_sql(f"PRAGMA user_version = {kept}")
            elif connection.exec_driver_sql("SHOW transaction_read_only").scalar_one() == "on":
                raise SessionError(f"{place}: expected a database that can be written to, found it read-only.")
    except sa.exc.DBAPIError as error:
        raise unusable(place, error) from error


def refuse_damaged(engine: sa.Engine, place: str) -> None:
    """Refuse a SQLite file whose pages do not fit together, before anything is read from it or written to it."""
    if engine.dialect.name == "sqlite":
        with engine.connect() as connection:
            found = connection.exec_driver_sql("PRAGMA quick_check(1)").scalar()
        if found != "ok":
            raise damaged(place, str(found))


def damaged(place: str, found: str) -> SessionError:
    """A database that was read and does not hold what Segue wrote."""
    said = " ".join(found.split())[:120]
    return SessionError(f"{place}: expected a database of responses, found {_DAMAGED[0]} ({said}); {_DAMAGED[1]}.")


@contextmanager
def readable_copy(file: Path) -> Iterator[Path]:
    """A copy of a SQLite file for this process alone, with its write-ahead log; gone at the end.

    Even to read, SQLite writes beside the file, which it can't where the place is read-only or full.
    """
    with scratch_folder("segue-answers") as folder:
        copy = folder / file.name
        try:
            if not (file.with_name(f"{file.name}-shm").exists() and _backed_up(file, copy)):
                for part in (file, file.with_name(f"{file.name}-wal")):
                    if part.exists():
                        shutil.copyfile(part, folder / part.name)
        except OSError as error:
            raise refused(error, file) from error
        yield copy


def _backed_up(file: Path, copy: Path) -> bool:
    """Copy under SQLite's own locks, since a program that writes may be using the file; False where that fails."""
    try:
        only_read = f"{file.absolute().as_uri()}?mode=ro"
        with closing(sqlite3.connect(only_read, uri=True)) as own, closing(sqlite3.connect(copy)) as other:
            own.backup(other)
    except sqlite3.Error:
        copy.unlink(missing_ok=True)
        return False
    return True


def unusable(place: str, error: BaseException) -> SessionError:
    """Why a database can't be used, and what to do about it."""
    code = _sqlite_code(error)
    if code == sqlite3.SQLITE_IOERR and _is_full(place):
        code = sqlite3.SQLITE_FULL
    if code == sqlite3.SQLITE_CANTOPEN and not os.access(Path(place).parent, os.W_OK):
        code = sqlite3.SQLITE_READONLY
    found, advice = _REFUSED.get(code or 0, ("", ""))
    if not found:
        found = f"one that can't be opened ({in_words(error)})"
        # libpq describes a refused connection only in words, in the server's language: an unknown one is passed on.
        known = (advice for words, advice in _ADVICE if words in found)
        advice = next(known, "check the path or URL, or keep that database and name another")
    return SessionError(f"{place}: expected a database of responses, found {found}; {advice}.")


def _sqlite_code(error: BaseException) -> int | None:
    """SQLite's primary result code; None where the error is not SQLite's."""
    told = getattr(error, "orig", error)
    if not isinstance(told, sqlite3.Error):
        return None
    # Without a code it is about what a cell holds, such as bytes that are no text.
    return int(getattr(told, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT)) & 0xFF


def _is_full(place: str) -> bool:
    """Whether a disk has less room than a transaction takes: SQLite calls it a disk error at some places."""
    try:
        return shutil.disk_usage(Path(place).parent).free < 1 << 20
    except OSError:
        return False


_HELD = (
    "that another program holds it",
    "wait until that program is done, or close it, and run the same command again",
)
_UNWRITABLE = (
    "one that may not be written to, or is in a folder that may not be",
    "change its rights, or name another place (--out, --database); analyse, report and export only read it",
)
_DAMAGED = (
    "that it is damaged",
    "keep the file as it is and restore a copy of it; `sqlite3 FILE .recover` saves what can be read",
)
_REFUSED = {
    sqlite3.SQLITE_BUSY: _HELD,
    sqlite3.SQLITE_LOCKED: _HELD,
    sqlite3.SQLITE_READONLY: _UNWRITABLE,
    sqlite3.SQLITE_PERM: _UNWRITABLE,
    sqlite3.SQLITE_CANTOPEN: (
        "one that can't be opened: it is a folder, or its rights do not allow it",
        "check the path, change the rights, or name another place (--out, --database)",
    ),
    sqlite3.SQLITE_FULL: (
        "no room left on its disk",
        "make room, and the same command resumes; what was stored before is intact",
    ),
    sqlite3.SQLITE_IOERR: ("that its disk fails", "check the disk, or copy the file to another one"),
    sqlite3.SQLITE_CORRUPT: _DAMAGED,
    sqlite3.SQLITE_ERROR: ("that its tables are not as Segue made them", _DAMAGED[1]),
    sqlite3.SQLITE_NOTADB: (
        "one that can't be opened: the file is something else, or its beginning is damaged",
        "check the path, or restore a copy of it",
    ),
}
"""What SQLite refuses, by its primary result code, and what to do about it."""

_UNWRITTEN = (
    sqlite3.SQLITE_READONLY,
    sqlite3.SQLITE_PERM,
    sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_FULL,
    sqlite3.SQLITE_IOERR,
)
_PASSING = (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR)

_ADVICE = (
    ("authentication failed", "check the user and the password in the URL, in PGPASSWORD or in ~/.pgpass"),
    ("no password supplied", "give the password in the URL, in PGPASSWORD or in ~/.pgpass"),
    ("no pg_hba.conf entry", "let this machine in: add it to the server's pg_hba.conf"),
    ("permission denied", "make the user of the URL the owner of the database: ALTER DATABASE ... OWNER TO ..."),
    ("does not exist", "make it first: CREATE DATABASE ... OWNER ..., or check the URL"),
    ("resolve host", "check the host's name in the URL"),
    ("connection failed", "check that the server runs, and the host and the port in the URL"),
    ("connection timeout", "check that the server runs, and the host and the port in the URL"),
)
