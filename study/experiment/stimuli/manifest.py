"""The manifest of a results folder: the record that says what each stimulus is, what it was made from, and its video.

A `StimulusSet` and a folder come in; `protocol.toml` and `manifest.json` go out, and are read again as a `Manifest`.
Every file is written under another name and renamed when it is whole.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from study.errors import StimulusError
from study.experiment.folder import ANSWERS, MANIFEST, PROTOCOL, STIMULI
from study.experiment.stimuli.audit import PairAudit
from study.experiment.stimuli.stimulus import Stimulus, StimulusRecord, StimulusSet
from study.files import make_folder, read_text, refused, write_whole
from study.tasks.trial import Pair, pair_since_version_1

if TYPE_CHECKING:
    from study.experiment.protocol.whole import Protocol
    from study.motion.library import Library

MANIFEST_VERSION = 2


@dataclass(frozen=True)
class Manifest:
    """The record of a results folder: what its stimuli are, and the pairs that are shown.

    `videos` maps a stimulus id to what is known of its file (`file`, `frames_sha256`, `file_sha256`, `bytes`);
    stimuli that are not rendered yet are missing from it. `audits` say how the stimuli of each pair differ in what is
    not judged; a manifest of an older Segue has none.
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
    audits: tuple[PairAudit, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether every stimulus has its video."""
        return all(record.id in self.videos for record in self.records)

    @property
    def blends(self) -> dict[str, tuple[int, float]]:
        """The blend length of each stimulus, in frames and in seconds."""
        return {one.id: (one.blend_frames, one.blend_frames / self.fps) for one in self.records}

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


def made_from(protocol: Protocol, library: Library) -> str:
    """Hash of all that stimuli are made from: the protocol's text and given files, the library's, this program's own.

    Files count by path, size and times of writing and of change, so that asking costs milliseconds. (The latter can't
    be set: it shows where a file was replaced by one as large and as old.)
    """
    from study.motion.readers.registry import with_their_parts

    digest = hashlib.sha256(f"{protocol.sha256} {library.name}\n".encode())
    for path in (*program_files(), *with_their_parts((*library.files(), *protocol.files_read()))):
        # Python writes what it compiled under passing names, at any time; a file may name one that can't be.
        if path.parent.name != "__pycache__":
            with suppress(OSError, ValueError):
                state = path.stat()
                digest.update(f"{path} {state.st_size} {state.st_mtime_ns} {state.st_ctime_ns}\n".encode())
    return digest.hexdigest()


def program_files() -> list[Path]:
    """Every file of this program, wherever it is installed."""
    import renderer
    import study

    folders = [Path(str(package.__file__)).resolve().parent for package in (study, renderer)]
    return [path for folder in folders for path in sorted(folder.rglob("*.*"))]


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
    write_manifest(folder, stimulus_set, videos)
    return videos


def video_path(folder: Path, stimulus: Stimulus) -> Path:
    """Where the video of a stimulus is, or will be."""
    return folder / STIMULI / f"{stimulus.id}.mp4"


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
        if stimulus.id in known and is_whole(video_path(folder, stimulus), known[stimulus.id])
    }


def is_whole(path: Path, video: Mapping[str, Any]) -> bool:
    """Whether a video is still what the manifest says."""
    try:
        if path.stat().st_size != video["bytes"]:
            return False
        return hashlib.sha256(path.read_bytes()).hexdigest() == str(video["file_sha256"])
    except OSError:
        return False


def write_manifest(folder: Path, stimulus_set: StimulusSet, videos: Mapping[str, Mapping[str, Any]]) -> None:
    """Write what is known of the stimuli, and of the videos there are."""
    protocol = stimulus_set.protocol
    cameras = {
        stimulus.record.group: {
            "eye_m": stimulus.camera.eye.round(6).tolist(),
            "axes": stimulus.camera.axes.round(9).tolist(),
            "focal_pixels": round(stimulus.camera.focal_pixels, 6),
            "turns": None if stimulus.camera.turns is None else stimulus.camera.turns.tolist(),
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
        "audit": [asdict(one) for one in stimulus_set.audits],
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
    keys = {_NAMES.get(name, name): value for name, value in vars(stored).items()}
    return Manifest(folder=folder, videos=videos, **keys)


_NAMES = {"stimuli": "records", "audit": "audits"}
_ANEW = "restore a copy of it, or render into a new folder"


@dataclass(frozen=True)
class _Stored:
    """The keys of a manifest that are read, except for the videos."""

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
    audit: tuple[PairAudit, ...] = ()


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
