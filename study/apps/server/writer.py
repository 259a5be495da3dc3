"""Writer: commits what many participants send in groups, each write acknowledged after its commit.

Rows come in; the caller goes on once they are on disk. One group is committed at a time, in a thread of its own, so the
event loop never waits for the disk; what comes meanwhile is the next group. When two hundred answers arrive together,
the disk is waited for once or twice. Rows that fail take no others with them. Answers are committed only while the tab
that sent them shows the session, whichever server another tab asked.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import sqlalchemy as sa

from study.errors import SegueError
from study.experiment.store.answers import Row, insert_rows
from study.experiment.store.databases import AWAY
from study.experiment.store.participants import shown_elsewhere

LARGEST_GROUP = 256


class ElsewhereError(SegueError):
    """Another tab shows the session, or it was withdrawn; nothing was stored."""


@dataclass(frozen=True)
class _Job:
    rows: Sequence[Row]
    pages: dict[int, str]
    done: asyncio.Future[None]


class Writer:
    """Commits writes in the order in which they come; `close` waits for the last one. Belongs to one event loop."""

    def __init__(self, engine: sa.Engine) -> None:
        self._engine = engine
        self._waiting: list[_Job] = []
        self._busy = False
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="writer")

    async def put(self, rows: Sequence[Row], pages: dict[int, str] | None = None) -> None:
        """Insert rows; returns when they are committed, raises what went wrong.

        Parameters
        ----------
        pages
            The tab that has to show a session, if any has.
        """
        loop = asyncio.get_running_loop()
        job = _Job(rows, pages or {}, loop.create_future())
        self._waiting.append(job)
        if not self._busy:
            # Not at once: requests that arrived at the same moment are read first, and join the group.
            self._busy = True
            loop.call_soon(self._start, loop)
        await job.done

    def close(self) -> None:
        """Finish what was put, then end."""
        self._thread.shutdown()
        for job in self._waiting:
            _commit(self._engine, [job])

    def _start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Hand the next group to the thread."""
        group, self._waiting = self._waiting[:LARGEST_GROUP], self._waiting[LARGEST_GROUP:]
        self._busy = bool(group)
        if not group:
            return

        def committed(outcome: Future[list[Exception | None]]) -> None:
            # The loop may be closed, the coroutines gone: the write stands all the same.
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(self._settle, loop, group, outcome.result())

        self._thread.submit(_commit, self._engine, group).add_done_callback(committed)

    def _settle(self, loop: asyncio.AbstractEventLoop, group: list[_Job], outcome: list[Exception | None]) -> None:
        """The next group goes to the disk while the pages of this one are told."""
        self._start(loop)
        for job, error in zip(group, outcome, strict=True):
            if job.done.done():
                continue
            if error is None:
                job.done.set_result(None)
            else:
                job.done.set_exception(error)


def _commit(engine: sa.Engine, group: list[_Job]) -> list[Exception | None]:
    """Commit a group in one transaction; what went wrong with each job."""
    try:
        with engine.begin() as connection:
            insert_rows(connection, [row for job in group for row in job.rows])
            pages = {session: page for job in group for session, page in job.pages.items()}
            if pages and shown_elsewhere(connection, pages):
                raise ElsewhereError("Expected the tab that shows this session.")
    except Exception as error:  # whatever it was, the page has to be told
        # One of them failed, and the whole group was rolled back: each on its own now. Not where the database is away:
        # each would wait for it in turn.
        alike = len(group) == 1 or isinstance(error, AWAY)
        return [error] * len(group) if alike else [_commit(engine, [job])[0] for job in group]
    return [None] * len(group)
