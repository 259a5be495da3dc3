"""Rendering: a stimulus set to videos in a results folder.

A `StimulusSet` and a folder come in; `stimuli/<id>.mp4` go out. Every file is written under another name and renamed
when it is whole, and the manifest is written again after every video, so work that was interrupted at any moment is
taken up by calling `render` again: what is finished is checked and reused.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from study.errors import StimulusError
from study.experiment.folder import MANIFEST, STIMULI
from study.experiment.stimuli.manifest import (
    Manifest,
    is_whole,
    made_from,
    read_manifest,
    record,
    video_path,
    write_manifest,
)
from study.experiment.stimuli.stimulus import StimulusSet

if TYPE_CHECKING:
    from renderer.jobs import Progress
    from renderer.video import VideoInfo
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
    workers: int | None = None,
    progress: Callable[[Progress], object] | None = None,
) -> RenderSummary:
    """Render what is not rendered yet.

    Parameters
    ----------
    stimulus_set
        From `stimuli.prepare`.
    out
        The results folder; made where there is none.
    workers
        Processes; one a core by default.
    progress
        Called after every video with `renderer.jobs.Progress` (videos, frames, frames a second, seconds left).

    Raises
    ------
    StimulusError
        Where the folder belongs to another protocol or library, can't be written, or a video can't be made.
    """
    from renderer.errors import RendererError
    from renderer.jobs import RenderJob, render_many

    folder = Path(out)
    videos = record(stimulus_set, folder)
    reused = len(videos)
    todo = [stimulus for stimulus in stimulus_set.stimuli if stimulus.id not in videos]

    def finished(state: Progress) -> None:
        if state.last is not None:
            videos[state.last.path.stem] = _video_entry(state.last)
            write_manifest(folder, stimulus_set, videos)
        if progress:
            progress(state)

    fps = stimulus_set.protocol.fps
    jobs = [
        RenderJob(video_path(folder, stimulus), stimulus.positions, stimulus.figure, stimulus.camera, fps)
        for stimulus in todo
    ]
    try:
        render_many(jobs, workers, finished)
    except RendererError as error:
        raise StimulusError(str(error)) from error
    frames = sum(record.frames for record in stimulus_set.records)
    return RenderSummary(len(videos), frames, frames / fps, len(todo), reused)


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
