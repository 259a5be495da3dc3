"""Many videos: a list of jobs in, finished videos out, one process a core or a cluster of machines.

Jobs are plain data and films come back as bytes, so that they may be made in another process or on another machine.
Each process has its own GL context and encoder with a single thread each, which is the fastest way to use few cores and
keeps the bytes the same wherever they are made.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from renderer.camera import Camera
from renderer.capsules import Figure
from renderer.errors import RendererError
from renderer.files import scratch_folder, whole_file
from renderer.video import VideoInfo, render_video
from renderer.workers import Where, run_jobs


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


def make_film(job: RenderJob) -> tuple[VideoInfo, bytes]:
    """A video as the bytes of its file; nothing is written under the job's path."""
    with scratch_folder("segue-film") as folder:
        video = render_video(folder / Path(job.path).name, job.positions, job.figure, job.camera, fps=job.fps)
        return video, video.path.read_bytes()


def write_film(job: RenderJob, made: tuple[VideoInfo, bytes]) -> VideoInfo:
    """Write what `make_film` made under the job's path; `DiskError` where the disk refuses."""
    video, content = made
    with whole_file(Path(job.path)) as unfinished:
        unfinished.write_bytes(content)
    return replace(video, path=Path(job.path))


def render_many(
    jobs: Iterable[RenderJob],
    workers: Where = None,
    progress: Callable[[Progress], object] | None = None,
) -> list[VideoInfo]:
    """Make all videos; the results are in the order of the jobs.

    Parameters
    ----------
    jobs
        No two with the same path.
    workers
        Processes, one a core where None, or the address of a Dask scheduler. With 1 (or one job) the work is done in
        this process.
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
    start, frames = time.perf_counter(), sum(len(job.positions) for job in todo)
    made: dict[int, VideoInfo] = {}
    # The longest first, so that no worker is left with a long one at the end.
    order = sorted(range(len(todo)), key=lambda i: -len(todo[i].positions))
    for number, film in run_jobs(make_film, [todo[i] for i in order], workers):
        video = made[order[number]] = write_film(todo[order[number]], film)
        if progress is not None:
            done, seconds = sum(one.frames for one in made.values()), time.perf_counter() - start
            progress(Progress(len(made), len(todo), done, frames, seconds, video))
    return [made[i] for i in range(len(todo))]
