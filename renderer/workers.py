"""Where independent jobs are done: in this process, in other processes of this machine, or on many machines by Dask.

In: a function and jobs. Out: results as they finish, by whatever way, the same. Jobs and results are plain data that go
from process to process and over the wire, so machines need share no disk. A job whose worker is lost is tried again.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from contextlib import ExitStack, suppress
from itertools import chain, count, islice
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Self, TypeVar

from renderer.context import os_environ_defaults
from renderer.errors import RendererError
from renderer.files import cannot_write, scratch_folder

Job = TypeVar("Job")
Result = TypeVar("Result")

Where = int | str | None
"""How many workers on this machine (one a core where None), or the address of a Dask scheduler."""

_CONNECT_S = 15.0


def run_jobs(
    function: Callable[[Job], Result],
    jobs: Iterable[Job],
    where: Where = None,
    *,
    threads: bool = False,
    in_order: bool = False,
) -> Iterator[tuple[int, Result]]:
    """Do jobs that don't depend on each other.

    Parameters
    ----------
    function
        Of a module, so that other processes find it; it may be a `functools.partial` of one.
    jobs
        Each is taken when it is about to be begun, so they need not all be in memory.
    where
        A single job, or one worker, is done in this process.
    threads
        Workers of this machine are threads, which share memory: for work that NumPy does, outside the interpreter.
    in_order
        Results come in the order of the jobs, not in that in which they finish.

    Yields
    ------
    number, result
        The job's number, from 0.

    Raises
    ------
    RendererError
        Where the workers can't be had, or a job was lost twice with its worker. What a job raises is raised here.
    """
    coming = iter(jobs)
    first = list(islice(coming, 2))
    numbered = enumerate(chain(first, coming))
    if where == 1 or (len(first) < 2 and not isinstance(where, str)):
        yield from ((number, function(job)) for number, job in numbered)
        return
    with Workers(where, threads=threads) as workers:
        running: dict[Future[Result], tuple[int, Job, bool]] = {}
        while True:
            for number, job in islice(numbered, max(workers.count + 1 - len(running), 0)):
                running[workers.submit(function, job)] = number, job, True
            if not running:
                return
            following = [min(running, key=lambda one: running[one][0])] if in_order else running
            for future in wait(following, return_when=FIRST_COMPLETED).done:
                number, job, again = running.pop(future)
                try:
                    yield number, future.result()
                except BrokenExecutor as error:
                    if not again:
                        raise RendererError(_ENDED) from error
                    running[workers.submit(function, job)] = number, job, False
                except CancelledError as error:
                    raise RendererError(f"{where}: expected the Dask scheduler to stay, found it gone.") from error


class Workers:
    """Workers that do one job after another, as they are asked to, until they are closed.

    Parameters
    ----------
    where, threads
        As for `run_jobs`.
    """

    def __init__(self, where: Where = None, *, threads: bool = False) -> None:
        self._client: Any = None
        self._local = cores() if where is None else 0 if isinstance(where, str) else where
        self._open, self._folder, self._numbers = ExitStack(), Path(), count()
        self._pool: Executor
        if isinstance(where, str):
            self._client = _connected(where)
            # Not pure: a job is done as often as it is asked for. Dask itself tries the jobs of a lost worker again.
            self._pool = self._client.get_executor(pure=False)
        elif self._local < 1:
            raise RendererError(f"Expected at least one worker, got {where}.")
        elif threads:
            self._pool = ThreadPoolExecutor(self._local)
        else:
            self._folder = self._open.enter_context(scratch_folder("segue-jobs"))
            self._pool = self._processes()

    @property
    def count(self) -> int:
        """How many jobs keep the workers at work; on a cluster two a thread, since they and their results travel."""
        return self._local or max(2 * sum(self._client.nthreads().values()), 1)

    def submit(self, function: Callable[[Job], Result], job: Job) -> Future[Result]:
        """One job; the future raises what the job raises, and `BrokenExecutor` where its process was killed."""
        if not isinstance(self._pool, ProcessPoolExecutor):
            return self._pool.submit(function, job)
        # Workers read jobs from files. Sent through the pool's queue a job is larger than its pipe: when workers end
        # early, the thread that feeds the pipe would wait for a reader indefinitely, as would the interpreter's exit.
        path = self._folder / f"{next(self._numbers)}.job"
        try:
            path.write_bytes(pickle.dumps((function, job)))
        except OSError as error:
            raise cannot_write(path, error) from error
        try:
            return self._pool.submit(_run_stored, path)
        except BrokenExecutor:  # others take the place of those that ended with the one that was killed
            self._pool = self._processes()
            return self._pool.submit(_run_stored, path)

    def _processes(self) -> Executor:
        try:
            # Spawned, not forked: a GL library that has run in this process does not survive a fork.
            return ProcessPoolExecutor(self._local, mp_context=get_context("spawn"), initializer=_start_worker)
        except OSError:
            # No semaphores here (/dev/shm is missing or not ours to write, as in some containers): one thread does all.
            self._local = 1
            return ThreadPoolExecutor(1)

    def close(self, finished: bool = False) -> None:
        """End the workers; unless the work is finished, without waiting for what runs."""
        processes = list((getattr(self._pool, "_processes", None) or {}).values())
        if self._client is not None:
            self._client.close()
        else:
            self._pool.shutdown(wait=finished or not processes, cancel_futures=True)
        if not finished:
            for process in processes:
                process.terminate()
            for process in processes:
                process.join(timeout=5.0)
        self._open.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.close(finished=kind is None)


_ENDED = (
    "A worker process ended before its time, and again with the same job: killed for memory, or started from a script "
    "without `if __name__ == '__main__':` around its work. Try fewer workers, or workers=1."
)


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _connected(address: str) -> Any:
    """A client of the Dask scheduler at an address."""
    try:
        import dask
        import distributed
        from distributed.comm.addressing import resolve_address
    except ImportError as error:
        raise RendererError(f"{address}: expected Dask, found none here; pip install dask distributed.") from error
    dask.config.set({"distributed.admin.large-graph-warning-threshold": "1GB"})  # jobs carry all that they need
    connect: Any = distributed.Client  # untyped
    try:
        resolve_address(address)  # a client that is given no address at all never closes
        return connect(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise RendererError(
            f"{address}: expected the address of a Dask scheduler, such as tcp://host:8786, found none that answers "
            f"({str(error).splitlines()[0]}); start one with `dask scheduler`."
        ) from error


def _run_stored(path: Path) -> Any:
    """Do a job that this program's other process has stored."""
    function, job = pickle.loads(path.read_bytes())
    return function(job)


def _start_worker() -> None:
    """The parent decides when to stop: Ctrl-C reaches all processes of a terminal at once."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name, value in os_environ_defaults.items():
        os.environ.setdefault(name, value)
    if sys.platform.startswith("linux"):
        _die_with_parent()


def _die_with_parent() -> None:
    """Ask Linux to end this process when its parent is gone, even by a kill."""
    import ctypes

    set_death_signal = 1
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(set_death_signal, signal.SIGTERM)
