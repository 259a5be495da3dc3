"""Rendering: a stimulus set to videos in a results folder.

A `StimulusSet` and a folder come in; `stimuli/<id>.mp4` go out. Every file is written under another name and renamed
when it is whole, and the manifest is written again after every video, so work that was interrupted at any moment is
taken up by calling `render` again: what is finished is checked and reused.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from study.errors import StimulusError
from study.experiment.folder import MANIFEST, STIMULI
from study.experiment.procedures.procedure import Adaptive
from study.experiment.stimuli.manifest import (
    Manifest,
    is_whole,
    made_from,
    read_manifest,
    record,
    video_path,
    write_manifest,
)
from study.experiment.stimuli.stimulus import Stimulus, StimulusSet
from study.tasks.trial import Pair

if TYPE_CHECKING:
    from renderer.jobs import Progress, RenderJob
    from renderer.video import VideoInfo
    from renderer.workers import Where
    from study.experiment.protocol.whole import Protocol
    from study.motion.library import Library


@dataclass(frozen=True)
class RenderSummary:
    """What was rendered: videos, frames and seconds in all; how many videos were made now and how many reused."""

    videos: int
    frames: int
    seconds: float
    rendered: int
    reused: int


def render(
    stimulus_set: StimulusSet,
    out: str | Path,
    workers: Where = None,
    progress: Callable[[Progress], object] | None = None,
    *,
    all_levels: bool = True,
) -> RenderSummary:
    """Render what is not rendered yet.

    Parameters
    ----------
    stimulus_set
        From `stimuli.prepare`.
    out
        The results folder; made where there is none.
    workers
        Processes, one a core by default, or the address of a Dask scheduler.
    progress
        Called after every video with `renderer.jobs.Progress` (videos, frames, frames a second, seconds left).
    all_levels
        Also those that only some answers lead to; else `RenderAhead` makes these while sessions run.

    Raises
    ------
    StimulusError
        Where the folder belongs to another protocol or library, can't be written, or a video can't be made.
    """
    from renderer.errors import RendererError
    from renderer.jobs import render_many

    folder, fps = Path(out), stimulus_set.protocol.fps
    videos = record(stimulus_set, folder)
    reused = len(videos)
    chosen = None if all_levels else known_beforehand(stimulus_set.protocol, stimulus_set.pairs)
    todo = [one for one in stimulus_set.stimuli if one.id not in videos and (chosen is None or one.id in chosen)]

    def finished(state: Progress) -> None:
        if state.last is not None:
            videos[state.last.path.stem] = _video_entry(state.last)
            write_manifest(folder, stimulus_set, videos)
        if progress:
            progress(state)

    try:
        render_many([_job(folder, stimulus, fps) for stimulus in todo], workers, finished)
    except RendererError as error:
        raise StimulusError(str(error)) from error
    frames = sum(record.frames for record in stimulus_set.records)
    return RenderSummary(len(videos), frames, frames / fps, len(todo), reused)


def known_beforehand(protocol: Protocol, pairs: Sequence[Pair]) -> set[str]:
    """The stimuli that sessions show whatever is answered, and what the levels of adaptive procedures are compared
    with.
    """
    found: set[str] = set()
    for pair in pairs:
        study = protocol.study(pair.study)
        waits = isinstance(study.procedure, Adaptive) and pair.motion not in study.practice_transitions
        found |= set(pair.stimuli[:-1] if waits else pair.stimuli)
    return found


class RenderAhead:
    """The other stimuli, rendered while sessions run: what is wanted soonest first, each once.

    Belongs to one event loop. A process that is killed leaves whole videos and their record; those that it was at are
    made when they are wanted again. `videos` are those that are finished, as the manifest describes them.
    """

    def __init__(self, stimulus_set: StimulusSet, out: str | Path, workers: Where = None) -> None:
        from renderer.workers import Workers

        self._set, self._folder, self._workers = stimulus_set, Path(out), Workers(workers)
        self._stimuli = {stimulus.id: stimulus for stimulus in stimulus_set.stimuli}
        self.videos = record(stimulus_set, out)
        self._wanted: list[str] = []
        self._made: dict[str, asyncio.Task[None]] = {}
        self._writing = asyncio.Lock()

    def want(self, identifiers: Iterable[str]) -> None:
        """Render these before all that was wanted earlier, in this order."""
        fresh = [one for one in dict.fromkeys(identifiers) if one not in self.videos and one not in self._made]
        self._wanted = [*fresh, *(one for one in self._wanted if one not in fresh)]
        while self._wanted and len(self._made) < self._workers.count:
            following = self._wanted.pop(0)
            self._made[following] = asyncio.create_task(self._make(following))

    async def ready(self, identifier: str) -> None:
        """Return once a stimulus is rendered.

        Raises
        ------
        StimulusError
            Where it can't be; wanted again, it is tried again.
        """
        while identifier not in self.videos:
            self.want([identifier])
            under_way = self._made.get(identifier) or asyncio.wait(self._made.values(), return_when="FIRST_COMPLETED")
            await asyncio.shield(under_way)

    async def _make(self, identifier: str) -> None:
        from renderer.errors import RendererError
        from renderer.jobs import make_film, write_film

        job = _job(self._folder, self._stimuli[identifier], self._set.protocol.fps)
        try:
            try:
                film = await asyncio.wrap_future(self._workers.submit(make_film, job))
            except BrokenExecutor:  # its process was killed
                film = await asyncio.wrap_future(self._workers.submit(make_film, job))
            made = await asyncio.to_thread(write_film, job, film)
            async with self._writing:
                self.videos[identifier] = _video_entry(made)
                await asyncio.to_thread(write_manifest, self._folder, self._set, dict(self.videos))
        except (RendererError, BrokenExecutor) as error:
            raise StimulusError(f"{job.path}: expected to render it, found that it can't be done ({error}).") from error
        finally:
            del self._made[identifier]
            self.want(())

    def close(self) -> None:
        """End; what is not finished is left out."""
        self._workers.close()


def _job(folder: Path, stimulus: Stimulus, fps: float) -> RenderJob:
    from renderer.jobs import RenderJob

    return RenderJob(video_path(folder, stimulus), stimulus.positions, stimulus.figure, stimulus.camera, fps)


def rendered_before(protocol: Protocol, out: str | Path) -> Manifest | None:
    """The manifest of a folder where all stimuli of a protocol are rendered, whatever they were made from; else None.

    Such a folder can be shown where its motions are not, as on another machine.
    """
    folder = Path(out)
    if not (folder / MANIFEST).exists():
        return None
    manifest = read_manifest(folder)
    if manifest.protocol_sha256 != protocol.sha256 or not manifest.complete:
        return None
    whole = all(is_whole(manifest.video(known.id), manifest.videos[known.id]) for known in manifest.records)
    return manifest if whole else None


def rendered_already(protocol: Protocol, library: Library, out: str | Path) -> RenderSummary | None:
    """What `render` would say where nothing is left to do; None where there is, or something changed since."""
    manifest = rendered_before(protocol, out)
    if manifest is None or manifest.made_from != made_from(protocol, library):
        return None
    frames = sum(known.frames for known in manifest.records)
    count = len(manifest.records)
    return RenderSummary(count, frames, frames / manifest.fps, 0, count)


def _video_entry(video: VideoInfo) -> dict[str, Any]:
    return {
        "file": f"{STIMULI}/{video.path.name}",
        "frames": video.frames,
        "frames_sha256": video.frames_sha256,
        "file_sha256": video.file_sha256,
        "bytes": video.bytes,
    }
