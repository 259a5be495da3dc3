"""Rendering: a stimulus set to videos in a results folder, and the manifest that says what each one is.

A `StimulusSet` and a folder come in; `protocol.toml`, `manifest.json` and `stimuli/<id>.mp4` go out. Every file is
written under another name and renamed when it is whole, and the manifest is written again after every video, so work
that was interrupted at any moment is taken up by calling `render` again: what is finished is checked and reused.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from study.errors import StimulusError
from study.experiment.folder import ANSWERS, MANIFEST, PROTOCOL, STIMULI
from study.experiment.stimuli.stimulus import Stimulus, StimulusRecord, StimulusSet
from study.files import make_folder, read_text, refused, write_whole
from study.tasks.trial import Pair, pair_since_version_1

if TYPE_CHECKING:
    from renderer.jobs import Progress
    from renderer.video import VideoInfo
    from study.experiment.protocol.whole import Protocol
    from study.motion.library import Library

MANIFEST_VERSION = 2


@dataclass(frozen=True)
class RenderSummary:
    """What was rendered: videos, frames and seconds in all; how many videos were made now and how many reused."""

    videos: int
    frames: int
    seconds: float
    rendered: int
    reused: int


@dataclass(frozen=True)
class Manifest:
    """The record of a results folder: what its stimuli are, and the pairs that are shown.

    `videos` maps a stimulus id to what is known of its file (`file`, `frames_sha256`, `file_sha256`, `bytes`);
    stimuli that are not rendered yet are missing from it.
    """

    folder: Path
    protocol: str
    protocol_sha256: str
    library: str
    synthetic: bool
    acknowledgement: str
    fps: float
    size: tuple[int, int]
    records: tuple[StimulusRecord, ...]
    pairs: tuple[Pair, ...]
    videos: Mapping[str, Mapping[str, Any]]
    versions: Mapping[str, str]
    made_from: str

    @property
    def complete(self) -> bool:
        """Whether every stimulus has its video."""
        return all(record.id in self.videos for record in self.records)

    def record(self, identifier: str) -> StimulusRecord:
        """A stimulus by its id."""
        for record in self.records:
            if record.id == identifier:
                return record
        raise StimulusError(f"Expected the id of a stimulus in {self.folder / MANIFEST}, found {identifier!r}.")

    def video(self, identifier: str) -> Path:
        """The video of a stimulus."""
        self.record(identifier)
        if identifier not in self.videos:
            raise StimulusError(f"Expected a video of {identifier} in {self.folder}, found none yet; render first.")
        return self.folder / str(self.videos[identifier]["file"])


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
            _write_manifest(folder, stimulus_set, videos)
        if progress:
            progress(state)

    jobs = [
        RenderJob(
            _path(folder, stimulus), stimulus.positions, stimulus.figure, stimulus.camera, stimulus_set.protocol.fps
        )
        for stimulus in todo
    ]
    try:
        render_many(jobs, workers, finished)
    except RendererError as error:
        raise StimulusError(str(error)) from error
    frames = sum(record.frames for record in stimulus_set.records)
    return RenderSummary(len(videos), frames, frames / stimulus_set.protocol.fps, len(todo), reused)


def made_from(protocol: Protocol, library: Library) -> str:
    """Hash of all that stimuli are made from: the protocol's text and given files, the library's, this program's own.

    Files count by path, size and time of change, so that asking costs milliseconds.
    """
    digest = hashlib.sha256(f"{protocol.sha256} {library.name}\n".encode())
    for path in (*program_files(), *library.files(), *protocol.files_read()):
        # Python writes what it compiled under passing names, at any time.
        if path.parent.name != "__pycache__" and path.is_file():
            state = path.stat()
            digest.update(f"{path} {state.st_size} {state.st_mtime_ns}\n".encode())
    return digest.hexdigest()


def program_files() -> list[Path]:
    """Every file of this program, wherever it is installed."""
    import renderer
    import study

    folders = [Path(str(package.__file__)).resolve().parent for package in (study, renderer)]
    return [path for folder in folders for path in sorted(folder.rglob("*.*"))]


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
    whole = all(_is_whole(manifest.video(known.id), manifest.videos[known.id]) for known in manifest.records)
    return manifest if whole else None


def rendered_already(protocol: Protocol, library: Library, out: str | Path) -> RenderSummary | None:
    """What `render` would say where nothing is left to do; None where there is, or something changed since."""
    manifest = rendered_before(protocol, out)
    if manifest is None or manifest.made_from != made_from(protocol, library):
        return None
    frames = sum(known.frames for known in manifest.records)
    count = len(manifest.records)
    return RenderSummary(count, frames, frames / manifest.fps, 0, count)


def record(stimulus_set: StimulusSet, out: str | Path) -> dict[str, dict[str, Any]]:
    """Make a results folder's record of its stimuli (protocol and manifest) without rendering any.

    Returns
    -------
    dict
        The videos that are there already, by stimulus id, as the manifest describes them.

    Raises
    ------
    StimulusError
        Where the folder belongs to another protocol or library, or can't be written.
    """
    folder = Path(out)
    make_folder(folder / STIMULI)
    _claim(folder, stimulus_set)
    videos = _finished(folder, stimulus_set)
    _write_manifest(folder, stimulus_set, videos)
    return videos


def _path(folder: Path, stimulus: Stimulus) -> Path:
    return folder / STIMULI / f"{stimulus.id}.mp4"


def _video_entry(video: VideoInfo) -> dict[str, Any]:
    return {
        "file": f"{STIMULI}/{video.path.name}",
        "frames": video.frames,
        "frames_sha256": video.frames_sha256,
        "file_sha256": video.file_sha256,
        "bytes": video.bytes,
    }


def _claim(folder: Path, stimulus_set: StimulusSet) -> None:
    """Store the protocol's exact text, or refuse a folder that belongs to another protocol or library."""
    protocol = stimulus_set.protocol
    stored = folder / PROTOCOL
    if stored.exists():
        found = hashlib.sha256(read_text(stored, "a protocol file").encode()).hexdigest()
        if found != protocol.sha256:
            raise StimulusError(
                f"{folder}: expected the results of {protocol.name!r} with sha256 {protocol.sha256[:12]}, found a "
                f"protocol.toml with {found[:12]}; name another folder, or move this one away."
            )
    if (folder / MANIFEST).exists():
        known = read_manifest(folder)
        # A library is known by its folder, which may have moved, or be elsewhere on another machine: what counts is
        # whether the stimuli are the same.
        changed = {entry.id for entry in known.records} ^ {entry.id for entry in stimulus_set.records}
        if changed and known.library != stimulus_set.library:
            raise StimulusError(
                f"{folder}: expected stimuli from the library {stimulus_set.library!r}, found some from "
                f"{known.library!r}; name that library, or another folder."
            )
        if changed and (folder / ANSWERS).exists():
            # Plans name stimuli by id: with another manifest the answers would be about nothing.
            raise StimulusError(
                f"{folder}: expected the stimuli that answers were given to, found {len(changed)} that differ (made by "
                f"Segue {known.versions.get('segue', '?')} then, {stimulus_set.versions.get('segue', '?')} now, or "
                "from other motion files); name another folder, or move this one away."
            )
    if not stored.exists():
        write_whole(stored, protocol.text)


def _finished(folder: Path, stimulus_set: StimulusSet) -> dict[str, dict[str, Any]]:
    """The videos that the manifest knows and that are still what they were."""
    if not (folder / MANIFEST).exists():
        return {}
    known = read_manifest(folder).videos
    return {
        stimulus.id: dict(known[stimulus.id])
        for stimulus in stimulus_set.stimuli
        if stimulus.id in known and _is_whole(_path(folder, stimulus), known[stimulus.id])
    }


def _is_whole(path: Path, video: Mapping[str, Any]) -> bool:
    try:
        if path.stat().st_size != video["bytes"]:
            return False
        return hashlib.sha256(path.read_bytes()).hexdigest() == str(video["file_sha256"])
    except OSError:
        return False


def _write_manifest(folder: Path, stimulus_set: StimulusSet, videos: Mapping[str, Mapping[str, Any]]) -> None:
    protocol = stimulus_set.protocol
    cameras = {
        stimulus.record.group: {
            "eye_m": stimulus.camera.eye.round(6).tolist(),
            "axes": stimulus.camera.axes.round(9).tolist(),
            "focal_pixels": round(stimulus.camera.focal_pixels, 6),
        }
        for stimulus in stimulus_set.stimuli
    }
    data = {
        "version": MANIFEST_VERSION,
        "protocol": protocol.name,
        "title": protocol.title,
        "protocol_sha256": protocol.sha256,
        "library": stimulus_set.library,
        "synthetic": stimulus_set.synthetic,
        "acknowledgement": stimulus_set.acknowledgement,
        "fps": protocol.fps,
        "size": [protocol.stimuli.width, protocol.stimuli.height],
        "style": protocol.stimuli.style,
        "versions": dict(stimulus_set.versions),
        "made_from": stimulus_set.made_from,
        "cameras": cameras,
        "pairs": [asdict(pair) for pair in stimulus_set.pairs],
        "stimuli": [{**asdict(record), "video": videos.get(record.id)} for record in stimulus_set.records],
    }
    write_whole(folder / MANIFEST, json.dumps(data, indent=1) + "\n")


def read_manifest(folder: str | Path) -> Manifest:
    """The manifest of a results folder.

    Raises
    ------
    StimulusError
        Where there is none, it was written by a newer Segue, or a key is missing or damaged; says which.
    """
    folder = Path(folder)
    path = folder / MANIFEST
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise StimulusError(f"{path}: expected the manifest of a results folder, found none; render first.") from error
    except OSError as error:
        raise refused(error, path) from error
    try:
        data = json.loads(content)
        version = data["version"]
        if version == 1:
            content = json.dumps({**data, "pairs": [pair_since_version_1(pair) for pair in data["pairs"]]}).encode()
    except (ValueError, KeyError, TypeError) as error:
        found = f"no {error}" if isinstance(error, KeyError) else f"something else ({error})"
        raise StimulusError(f"{path}: expected JSON of a manifest, found {found}; {_ANEW}.") from error
    if version not in (1, MANIFEST_VERSION):
        raise StimulusError(
            f"{path}: expected a manifest of version {MANIFEST_VERSION} or older, found {version!r}; "
            "use the Segue that wrote it, or render into a new folder."
        )
    try:
        stored = TypeAdapter(_Stored).validate_json(content, strict=True)
        listed = TypeAdapter(_Listed).validate_json(content, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise StimulusError(
            f"{path}: expected what Segue wrote, found {where} damaged ({first['msg']}); {_ANEW}."
        ) from error
    videos = {entry.id: asdict(entry.video) for entry in listed.stimuli if entry.video is not None}
    keys = {"records" if name == "stimuli" else name: value for name, value in vars(stored).items()}
    return Manifest(folder=folder, videos=videos, **keys)


_ANEW = "restore a copy of it, or render into a new folder"


@dataclass(frozen=True)
class _Stored:
    """The keys of a manifest that are read, but for the videos."""

    protocol: str
    protocol_sha256: str
    library: str
    synthetic: bool
    acknowledgement: str
    fps: Annotated[float, Field(gt=0)]
    size: tuple[int, int]
    stimuli: tuple[StimulusRecord, ...]
    pairs: tuple[Pair, ...]
    versions: dict[str, str]
    made_from: str = ""


@dataclass(frozen=True)
class _Video:
    file: str
    frames: int
    frames_sha256: str
    file_sha256: str
    bytes: int


@dataclass(frozen=True)
class _Entry:
    id: str
    video: _Video | None


@dataclass(frozen=True)
class _Listed:
    """Which stimulus has which video."""

    stimuli: tuple[_Entry, ...]
