"""Many videos: a list of jobs in, finished videos out, one process a core.

Jobs are plain data, so they may be sent to another process or machine (`run_job`). Each process has its own GL
context and encoder with a single thread each, which is the fastest way to use few cores and keeps the bytes the same
however many workers there are.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import time
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from fractions import Fraction
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.camera import Camera
from renderer.capsules import Figure
from renderer.context import os_environ_defaults
from renderer.errors import RendererError
from renderer.files import cannot_write, discard_unfinished, scratch_folder
from renderer.video import VideoInfo, render_video


@dataclass(frozen=True, eq=False)
class RenderJob:
    """One video to be made.

    Parameters
    ----------
    path
        The mp4 to write.
    positions : (frames, points, 3)
        Metres; float32 or float64.
    figure, camera, fps
        As for `render_video`.
    """

    path: Path
    positions: NDArray[np.floating[Any]]
    figure: Figure
    camera: Camera
    fps: float | Fraction = 30


@dataclass(frozen=True)
class Progress:
    """How far the work is.

    Parameters
    ----------
    videos, videos_total, frames, frames_total
        Done, and to do in all.
    seconds
        Since the start.
    last
        The video just finished.
    """

    videos: int
    videos_total: int
    frames: int
    frames_total: int
    seconds: float
    last: VideoInfo | None = None

    @property
    def frames_per_second(self) -> float:
        """Mean speed so far; 0.0 before the first video is done."""
        return self.frames / self.seconds if self.seconds > 0 else 0.0

    @property
    def seconds_left(self) -> float | None:
        """By the speed so far; None before there is one."""
        speed = self.frames_per_second
        return (self.frames_total - self.frames) / speed if speed > 0 else None

    def __str__(self) -> str:
        left = self.seconds_left
        eta = "" if left is None else f", {left:.0f} s left"
        return f"{self.videos}/{self.videos_total} videos, {self.frames_per_second:.0f} frames/s{eta}"


def run_job(job: RenderJob) -> VideoInfo:
    """Make one video in this process."""
    return render_video(job.path, job.positions, job.figure, job.camera, fps=job.fps)


def default_workers() -> int:
    """One for each core that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def render_many(
    jobs: Iterable[RenderJob],
    workers: int | None = None,
    progress: Callable[[Progress], object] | None = None,
) -> list[VideoInfo]:
    """Make all videos; the results are in the order of the jobs.

    Parameters
    ----------
    jobs
        No two with the same path.
    workers
        Processes; one a core where None. With 1 (or one job) the work is done in this process.
    progress
        Called after every video, in this process.

    Raises
    ------
    RendererError
        The first failure; videos that are finished stay, unfinished ones leave nothing under their names. The same
        holds for an interruption (`KeyboardInterrupt`).
    """
    todo = list(jobs)
    paths = [Path(job.path) for job in todo]
    if len({path.absolute() for path in paths}) != len(paths):
        twice = next(path for path in paths if paths.count(path) > 1)
        raise RendererError(f"Expected every job to write a file of its own; {twice} is there twice.")
    count = default_workers() if workers is None else workers
    if count < 1:
        raise RendererError(f"Expected at least one worker, got {workers}.")
    start, frames = time.perf_counter(), sum(len(job.positions) for job in todo)
    told: list[VideoInfo] = []

    def tell(video: VideoInfo) -> VideoInfo:
        told.append(video)
        if progress is not None:
            made, seconds = sum(one.frames for one in told), time.perf_counter() - start
            progress(Progress(len(told), len(todo), made, frames, seconds, video))
        return video

    if min(count, len(todo)) <= 1:
        return [tell(run_job(job)) for job in todo]
    return _in_processes(todo, min(count, len(todo)), tell)


class Workers:
    """Processes that make one video after another, as they are asked to, until they are closed.

    Parameters
    ----------
    count
        Processes; one a core where None.
    """

    def __init__(self, count: int | None = None) -> None:
        self.count = default_workers() if count is None else count
        """How many videos are made at a time."""
        self._pool = self._begun()
        self._open = ExitStack()
        self._folder = self._open.enter_context(scratch_folder("segue-jobs"))

    def make(self, job: RenderJob) -> Future[VideoInfo]:
        """One video; the future raises `RendererError` where it can't be made."""
        path = _store(job, self._folder / f"{Path(job.path).stem}.job")
        try:
            return self._pool.submit(_run_stored, path)
        except BrokenProcessPool:  # a process was killed: others take its place
            self._pool = self._begun()
            return self._pool.submit(_run_stored, path)

    def _begun(self) -> Executor:
        try:
            return _processes(self.count)
        except OSError:  # as in `_in_processes`
            self.count = 1
            return ThreadPoolExecutor(1)

    def close(self) -> None:
        """End the processes, without waiting for what runs."""
        _stop(self._pool, finished=False)
        self._open.close()


def _processes(workers: int) -> ProcessPoolExecutor:
    # Spawned, not forked: a GL library that has run in this process does not survive a fork.
    return ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_start_worker)


def _in_processes(jobs: list[RenderJob], workers: int, tell: Callable[[VideoInfo], VideoInfo]) -> list[VideoInfo]:
    try:
        pool = _processes(workers)
    except OSError:
        # No semaphores here (/dev/shm is missing or not ours to write, as in some containers): one process does it all.
        return [tell(run_job(job)) for job in jobs]
    done: dict[int, VideoInfo] = {}
    # The longest first, so that no worker is left with a long one at the end.
    order = sorted(range(len(jobs)), key=lambda i: -len(jobs[i].positions))
    finished = False
    # Workers read jobs from files. Sent through the pool's queue a job is larger than its pipe: when workers end early
    # the thread that feeds the pipe would wait for a reader indefinitely, and so would the interpreter at its exit.
    with scratch_folder("segue-jobs") as folder:
        try:
            waiting: dict[Future[VideoInfo], int] = {
                pool.submit(_run_stored, _store(jobs[i], folder / f"{i}.job")): i for i in order
            }
            while waiting:
                for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                    done[waiting.pop(future)] = tell(future.result())
            finished = True
        except BrokenProcessPool as error:
            raise RendererError(
                "A rendering process ended before its time: killed for memory, or started from a script without "
                "`if __name__ == '__main__':` around its work. Try fewer workers, or workers=1."
            ) from error
        finally:
            _stop(pool, finished)
            if not finished:
                for job in jobs:
                    with suppress(OSError):
                        discard_unfinished(Path(job.path))
    return [done[i] for i in range(len(jobs))]


def _store(job: RenderJob, path: Path) -> str:
    try:
        path.write_bytes(pickle.dumps(job))
    except OSError as error:
        raise cannot_write(path, error) from error
    return str(path)


def _run_stored(path: str) -> VideoInfo:
    """Make the video of a job that this program's other process has just stored."""
    job: RenderJob = pickle.loads(Path(path).read_bytes())
    return run_job(job)


def _stop(pool: Executor, finished: bool) -> None:
    """End the pool; when the work was cut short, without waiting for what runs."""
    processes = list((getattr(pool, "_processes", None) or {}).values())
    pool.shutdown(wait=finished, cancel_futures=True)
    if not finished:
        for process in processes:
            process.terminate()
        for process in processes:
            process.join(timeout=5.0)


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
