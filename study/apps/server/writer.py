"""Writer: one thread that commits what many participants send in groups, each write acknowledged after its commit.

A function of a connection comes in; its result goes out once it is on disk. When many answers arrive at one time, one
transaction holds them all, so the disk is waited for once. A write that fails takes no other with it.
"""

from __future__ import annotations

import asyncio
import contextlib
import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import sqlalchemy as sa

Result = TypeVar("Result")

LARGEST_GROUP = 256


@dataclass(frozen=True)
class _Job:
    write: Callable[[sa.Connection], Any]
    loop: asyncio.AbstractEventLoop
    future: asyncio.Future[Any]


class Writer:
    """Commits writes in the order in which they come; `close` waits for the last one."""

    def __init__(self, engine: sa.Engine) -> None:
        self._engine = engine
        self._jobs: queue.SimpleQueue[_Job | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="writer", daemon=True)
        self._thread.start()

    async def put(self, write: Callable[[sa.Connection], Result]) -> Result:
        """Run a write in a transaction; returns when it is committed, raises what it raised."""
        loop = asyncio.get_running_loop()
        future: asyncio.Future[Result] = loop.create_future()
        self._jobs.put(_Job(write, loop, future))
        return await future

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
                results = [job.write(connection) for job in group]
        except Exception as error:  # whatever it was, the page has to be told, and the thread has to go on
            if len(group) > 1:
                # One of them failed, and the whole group was rolled back: each on its own now.
                for job in group:
                    self._commit([job])
            else:
                _settle(group[0], error=error)
            return
        for job, result in zip(group, results, strict=True):
            _settle(job, result)


def _settle(job: _Job, result: Any = None, error: Exception | None = None) -> None:
    """Tell the coroutine that waits; it may be gone, or its loop may be closed, and the write stands all the same."""

    def tell() -> None:
        if job.future.done():
            return
        if error is None:
            job.future.set_result(result)
        else:
            job.future.set_exception(error)

    with contextlib.suppress(RuntimeError):
        job.loop.call_soon_threadsafe(tell)
