"""SQLite files that are held, damaged, empty, no database or out of reach: each told apart, and nothing is lost."""

from __future__ import annotations

import shutil
import sqlite3
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from toys import FakeStimuli

from study.errors import SegueError, SessionError
from study.experiment.protocol.whole import Protocol
from study.experiment.simulation import simulate
from study.experiment.store import databases
from study.experiment.store.databases import may_pass, patiently, try_to_write
from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import open_answers, open_responses, rows_of
from study.experiment.store.sessions import all_sessions, session_table
from study.experiment.store.tables import metadata


@pytest.fixture
def folder(tmp_path: Path, toy_protocol: Protocol, toy_stimuli: FakeStimuli) -> Path:
    """A results folder with two simulated participants' answers."""
    with open_responses(tmp_path) as responses:
        simulate(toy_protocol, toy_stimuli, responses, 2)
    return tmp_path


def read_all(folder: Path) -> Any:
    with open_answers(folder) as responses:
        session_table(responses)
        all_sessions(responses)
        for table in metadata.tables.values():
            rows_of(responses, sa.select(table))
        return answers_frame(responses, all_attempts=True)


def failed(code: str, said: str = "it failed") -> Any:
    """What SQLAlchemy raises for a result code of SQLite."""
    told = sqlite3.OperationalError(said)
    told.sqlite_errorcode = code
    return sa.exc.OperationalError("INSERT", {}, told)


def test_a_database_that_another_program_holds_is_waited_for_and_then_said(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(databases, "BUSY_SECONDS", 0.2)
    whole = read_all(folder)
    held = sqlite3.connect(folder / "responses.sqlite", isolation_level=None)
    held.execute("PRAGMA locking_mode = EXCLUSIVE")
    held.execute("BEGIN EXCLUSIVE")
    said = r"responses\.sqlite: expected a database of responses, found that another program holds it; wait until"
    for use in (open_responses, read_all):
        with pytest.raises(SessionError, match=said):
            use(folder)
    held.close()
    assert read_all(folder).equals(whole)


def test_a_simulation_that_can_not_write_says_so(
    folder: Path, toy_protocol: Protocol, toy_stimuli: FakeStimuli, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(databases, "BUSY_SECONDS", 0.2)
    whole = read_all(folder)
    held = sqlite3.connect(folder / "responses.sqlite", isolation_level=None)
    held.execute("BEGIN IMMEDIATE")
    with pytest.raises(SessionError, match="another program holds it"), open_responses(folder) as responses:
        simulate(toy_protocol, toy_stimuli, responses, 3)
    with pytest.raises(SessionError, match="another program holds it"), open_responses(folder) as responses:
        try_to_write(responses.engine, responses.place)
    assert read_all(folder).equals(whole), "to read needs no lock"
    held.close()


def test_every_page_may_be_damaged(folder: Path) -> None:
    """Each page zeroed, and the file cut at each page: the answers as they were, or a refusal that says so."""
    file = folder / "responses.sqlite"
    content, whole = file.read_bytes(), read_all(folder)
    page = int.from_bytes(content[16:18], "big")
    refused = 0
    for at in range(0, len(content), page):
        for damaged in (content[:at] + bytes(page) + content[at + page :], content[:at]):
            for left in folder.glob("responses.sqlite*"):
                left.unlink()
            file.write_bytes(damaged)
            try:
                found = read_all(folder)
            except SegueError as refusal:
                refused += str(file) in str(refusal)
            else:
                assert found.equals(whole)
    assert refused >= len(content) // page, "cut files at least"


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "expected answers, found an empty file; collect or simulate"),
        (b"answers of everybody\n" * 200, "the file is something else, or its beginning is damaged; check the path"),
    ],
)
def test_what_is_no_database_is_refused_and_left_alone(tmp_path: Path, content: bytes, said: str) -> None:
    (tmp_path / "responses.sqlite").write_bytes(content)
    with pytest.raises(SessionError, match=said):
        open_answers(tmp_path)
    assert (tmp_path / "responses.sqlite").read_bytes() == content


def test_to_read_makes_no_database(tmp_path: Path) -> None:
    with pytest.raises(SessionError, match=r"typo\.sqlite: expected answers, found no database"):
        open_answers(tmp_path, tmp_path / "deep" / "typo.sqlite")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_in_its_place_is_said(tmp_path: Path) -> None:
    (tmp_path / "responses.sqlite").mkdir()
    with pytest.raises(SessionError, match="found one that can't be opened: it is a folder"):
        open_responses(tmp_path)


@pytest.mark.parametrize("index", [True, False], ids=["in use", "left by a kill"])
def test_a_place_that_can_not_be_written_to_is_read_from_a_copy(
    folder: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch, index: bool
) -> None:
    """With what stands in the log alone: a program that was killed, or one that writes now, has not folded it in."""
    before = read_all(folder)
    writer = sqlite3.connect(folder / "responses.sqlite")
    writer.execute("INSERT INTO events (session_id, kind, at) VALUES (1, 'late', '2026-01-01 00:00:00.000000')")
    writer.commit()
    place = tmp_path_factory.mktemp("copied")
    for part in folder.glob("responses.sqlite*"):
        if index or not part.name.endswith("-shm"):
            shutil.copy(part, place)
    writer.close()

    def refuses(_: Any, where: Any) -> None:
        if where == str(place / "responses.sqlite"):
            raise failed(sqlite3.SQLITE_READONLY)

    monkeypatch.setattr("study.experiment.store.responses.refuse_damaged", refuses)
    parts = {part.name: part.read_bytes() for part in place.iterdir() if not part.name.endswith("-shm")}
    with open_answers(place) as responses:
        assert responses.place == str(place / "responses.sqlite")
        assert answers_frame(responses, all_attempts=True).equals(before)
        with responses.engine.connect() as connection:
            assert connection.execute(sa.text("SELECT count(*) FROM events WHERE kind = 'late'")).scalar_one() == 1
        copy = responses.engine.url.database
    assert {part.name: part.read_bytes() for part in place.iterdir() if not part.name.endswith("-shm")} == parts
    with pytest.raises(FileNotFoundError):
        open(copy)  # noqa: SIM115, PTH123


@pytest.mark.parametrize(
    ("code", "said", "passes"),
    [
        (sqlite3.SQLITE_BUSY, "another program holds it; wait", True),
        (sqlite3.SQLITE_BUSY_SNAPSHOT, "another program holds it; wait", True),
        (sqlite3.SQLITE_FULL, "no room left on its disk; make room", True),
        (sqlite3.SQLITE_IOERR_WRITE, "its disk fails; check the disk", True),
        (sqlite3.SQLITE_READONLY_DBMOVED, "one that may not be written to", False),
        (sqlite3.SQLITE_CANTOPEN, "one that can't be opened", False),
        (sqlite3.SQLITE_CORRUPT, "that it is damaged", False),
        (sqlite3.SQLITE_ERROR, "its tables are not as Segue made them", False),
    ],
)
def test_what_sqlite_refuses_is_told_apart_and_only_what_may_pass_is_waited_for(
    tmp_path: Path, code: int, said: str, passes: bool
) -> None:
    place = str(tmp_path / "responses.sqlite")
    assert said in str(databases.unusable(place, failed(code)))
    assert may_pass(failed(code)) is passes
    waits = []

    def work() -> None:
        raise failed(code)

    with pytest.raises(SessionError, match="for 5 s it could" if passes else said):
        patiently(work, place, patience_s=5, wait=waits.append, clock=lambda: sum(waits))
    assert bool(waits) is passes


def test_a_damaged_cell_is_refused(folder: Path) -> None:
    with sqlite3.connect(folder / "responses.sqlite") as connection:
        for (trigger,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            connection.execute(f"DROP TRIGGER {trigger}")
        connection.execute("UPDATE sessions SET started_at = 'long ago' WHERE id = 1")
        connection.execute("UPDATE sessions SET truth_json = '{' WHERE id = 2")
    with open_answers(folder) as responses, pytest.raises(SessionError, match=r"found that it is damaged .*long ago"):
        session_table(responses)
    with sqlite3.connect(folder / "responses.sqlite") as connection:
        connection.execute("UPDATE sessions SET started_at = '2026-01-01 00:00:00.000000'")
    with open_answers(folder) as responses, pytest.raises(SessionError, match=r"that it is damaged .session 2"):
        all_sessions(responses)
