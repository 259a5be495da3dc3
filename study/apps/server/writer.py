"""Writer: one thread that commits what many participants send in groups, each write acknowledged after its commit.

Rows come in; the caller goes on once they are on disk. When many answers arrive at one time, one transaction holds them
all, so the disk is waited for once. Rows that fail take no others with them.
"""

from __future__ import annotations

import asyncio
import contextlib
import queue
import threading
from collections.abc import Sequence
from dataclasses import dataclass

import sqlalchemy as sa

from study.experiment.responses import Row, insert_rows

LARGEST_GROUP = 256


@dataclass(frozen=True)
class _Job:
    rows: Sequence[Row]
    loop: asyncio.AbstractEventLoop
    future: asyncio.Future[None]


class Writer:
    """Commits writes in the order in which they come; `close` waits for the last one."""

    def __init__(self, engine: sa.Engine) -> None:
        self._engine = engine
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="writer", daemon=True)
        self._thread.start()

    async def put(self, rows: Sequence[Row]) -> None:
        """Insert rows; returns when they are committed, raises what went wrong."""
        loop = asyncio.get_running_loop()
        future: asyncio.Future[None] = loop.create_future()
        self._jobs.put(_Job(rows, loop, future))
        await future

    def close(self) -> None:
        """Finish what was put, then end."""
        self._jobs.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (job := self._jobs.get()) is not None:
            group = [job]
            last = False
            while len(group) < LARGEST_GROUP and not last:
                try:
                    following = self._jobs.get_nowait()
                except queue.Empty:
                    break
                last = following is None
                if following is not None:
                    group.append(following)
            self._commit(group)
            if last:
                return

    def _commit(self, group: list[_Job]) -> None:
        try:
            with self._engine.begin() as connection:
                insert_rows(connection, [row for job in group for row in job.rows])
        except Exception as error:  # whatever it was, the page has to be told, and the thread has to go on
            if len(group) > 1:
                # One of them failed, and the whole group was rolled back: each on its own now.
                for job in group:
                    self._commit([job])
            else:
                _settle(group[0], error=error)
            return
        for job in group:
            _settle(job)


def _settle(job: _Job, error: Exception | None = None) -> None:
    """Tell the coroutine that waits; it may be gone, or its loop may be closed, and the write stands all the same."""

    def tell() -> None:
        if job.future.done():
            return
        if error is None:
            job.future.set_result(None)
        else:
            job.future.set_exception(error)

    with contextlib.suppress(RuntimeError):
        job.loop.call_soon_threadsafe(tell)
