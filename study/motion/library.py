"""The library: motions by name, synthetic or from a folder of motion capture.

In: `"synthetic"`, or a folder that holds CMU trials (the official layout, a flat folder of BVH conversions, or both,
nested) or any other `.bvh` and `.amc` files. Out: `Clip`s that are fit for use: defects mended, cut to the usable
frames, floor at zero, starting over the origin towards +Z, at the frame rate asked for. Protocols name motions, not
files, so that each runs on any library.
"""

from __future__ import annotations

import difflib
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from study.counting import counted
from study.errors import MotionError
from study.motion.clip import Clip, resample, trim
from study.motion.cmu import CMU_ACKNOWLEDGEMENT, CMU_SITE, Boundary, IndexedMotion, Take, cmu_index, is_trial
from study.motion.download import download_trial

__all__ = ["CMU_ACKNOWLEDGEMENT", "Entry", "Library", "download_trial", "open_library"]

SYNTHETIC = "synthetic"

# Clips kept in memory; a clip of ten seconds at 30 fps takes 0.3 MB, the longest captured ones 6 MB.
_KEPT_CLIPS = 48


@dataclass(frozen=True)
class Entry:
    """What a library knows of a motion without reading it.

    Parameters
    ----------
    name
        What protocols call it.
    kind
        walking, running, standing, turning, boxing, dancing, tai-chi, or `""` where nobody said.
    words
        A few words for lists.
    start, end
        How it begins and ends: `"gait"`, `"still"`, or `""` where it can't be continued (or nobody looked).
    file
        The file it comes from; None for synthetic motions.
    first_frame, last_frame
        Usable frames of the file, both included, counted from 0 at the file's rate; `last_frame` None for the last.
    mirrored
        Whether the file is mirrored left to right to give the motion.
    trial
        The CMU trial, or `""`.
    """

    name: str
    kind: str = ""
    words: str = ""
    start: Boundary = ""
    end: Boundary = ""
    file: Path | None = None
    first_frame: int = 0
    last_frame: int | None = None
    mirrored: bool = False
    trial: str = ""

    @property
    def cyclic_start(self) -> bool:
        """Whether the motion can be continued backwards from its start."""
        return bool(self.start)

    @property
    def cyclic_end(self) -> bool:
        """Whether the motion can be continued beyond its end."""
        return bool(self.end)


class Library(ABC):
    """Motions by name; see `open_library`."""

    name: str
    synthetic: bool
    acknowledgement: str

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[str, float | None, float | None], Clip] = OrderedDict()

    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """The motions that are there, in order."""

    @abstractmethod
    def entry(self, name: str) -> Entry:
        """What is known of a motion; `MotionError` with the nearest valid name where there is none."""

    def files(self) -> tuple[Path, ...]:
        """The files that the motions come from; none where they are synthetic."""
        return ()

    def where(self, entry: Entry) -> str:
        """The file of a motion as seen from the library's own folder, with `/`; empty where no file is behind it.

        What is written into records: it holds on every machine, and tells of nobody's disk.
        """
        return "" if entry.file is None else entry.file.name

    @abstractmethod
    def _make(self, entry: Entry, fps: float | None, min_seconds: float | None) -> Clip:
        """Read or synthesize a motion."""

    def clip(self, name: str, fps: float | None = None, min_seconds: float | None = None) -> Clip:
        """A motion, fit for use.

        Parameters
        ----------
        name
            One of `names()`.
        fps
            Frames per second; by default those of the file (30 for synthetic motions).
        min_seconds
            At least so long: synthetic motions are made so long; captured ones are continued at their end, so that
            their frames keep their numbers, where they end in cycles or standing still, and stay as long as they are
            where they don't. Use `cycles.extend` to continue a clip at its start, too.

        Raises
        ------
        MotionError
            For a name that is not there, or a file that can't be read.
        """
        key = (name, None if fps is None else float(fps), min_seconds)
        if key not in self._kept:
            self._kept[key] = self._make(self.entry(name), fps, min_seconds)
            while len(self._kept) > _KEPT_CLIPS:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key]


def open_library(spec: str | Path) -> Library:
    """The library that a protocol, or a person, names.

    Parameters
    ----------
    spec
        `"synthetic"`, or a folder of motion files, nested or not.

    Raises
    ------
    MotionError
        Where there is no such folder, it holds no motion files, or two of its files can't be told apart.
    """
    if str(spec) == SYNTHETIC:
        return SyntheticLibrary()
    folder = Path(spec).expanduser()
    if folder.is_file():
        raise MotionError(f"Expected 'synthetic' or a folder as library, found the file {folder}. Name its folder.")
    if not folder.is_dir():
        raise MotionError(
            f"Expected 'synthetic' or a folder of motion files as library, found nothing at {folder}. "
            "Check the path; `segue motions download` fills a folder with CMU trials."
        )
    return FolderLibrary(folder)


class SyntheticLibrary(Library):
    """Motions that a program makes up; see `study.motion.synthetic`."""

    name = SYNTHETIC
    synthetic = True
    acknowledgement = "The motions are synthetic: Segue's own program made them, nobody moved."

    def names(self) -> tuple[str, ...]:
        from study.motion import synthetic

        return tuple(synthetic.NAMES)

    def entry(self, name: str) -> Entry:
        if name not in self.names():
            raise MotionError(_unknown(name, self.names(), "the synthetic library"))
        from study.motion import synthetic

        about = synthetic.describe(name)
        start: Boundary = "gait" if about.cyclic_start else ""
        end: Boundary = "gait" if about.cyclic_end else ""
        return Entry(name, about.kind, f"synthetic: {about.line}", start, end)

    def _make(self, entry: Entry, fps: float | None, min_seconds: float | None) -> Clip:
        from study.motion import synthetic

        return synthetic.synthesize(entry.name, seconds=min_seconds, fps=30.0 if fps is None else fps)


class FolderLibrary(Library):
    """Motion files below a folder: CMU trials under the names of the index, others under their own."""

    synthetic = False

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.name = str(folder)
        self.folder = folder
        self._files = files = _motion_files(folder)
        if not files:
            raise MotionError(
                f"Expected .bvh or .amc files in {folder} or its subfolders, {_only_others(folder)} Put motion files "
                "there, or fill it with `segue motions download`."
            )
        trials, others = _sorted_out(files)
        indexed = {take.trial for motion in cmu_index().values() for take in motion.takes}
        self._is_cmu = bool(indexed & set(trials)) or (folder / "subjects").is_dir()
        self.acknowledgement = CMU_ACKNOWLEDGEMENT if self._is_cmu else ""
        self._trials: Mapping[str, Path] = trials
        self._entries = _own_entries(folder, others, {} if self._is_cmu else trials)
        if self._is_cmu:
            self._entries = {**_indexed_entries(trials), **self._entries}

    def where(self, entry: Entry) -> str:
        if entry.file is None or not entry.file.is_relative_to(self.folder):
            return super().where(entry)
        return entry.file.relative_to(self.folder).as_posix()

    def names(self) -> tuple[str, ...]:
        return tuple(self._entries)

    def files(self) -> tuple[Path, ...]:
        return tuple(self._files)

    def trials(self) -> tuple[str, ...]:
        """The CMU trials that are there; each can be asked for by its number as well."""
        return tuple(self._trials)

    def entry(self, name: str) -> Entry:
        if name in self._entries:
            return self._entries[name]
        if name in self._trials:
            return Entry(name, words="CMU trial", file=self._trials[name], trial=name)
        if self._is_cmu and name in cmu_index():
            raise MotionError(_missing(cmu_index()[name], self.folder))
        same_stem = [known for known in self._entries if known.rsplit("/", 1)[-1] == name]
        if same_stem:
            raise MotionError(
                f"Expected one file named {name!r} in {self.folder}, found {len(same_stem)}. "
                f"Say which: {', '.join(same_stem)}."
            )
        raise MotionError(_unknown(name, (*self._entries, *self._trials), str(self.folder)))

    def _make(self, entry: Entry, fps: float | None, min_seconds: float | None) -> Clip:
        clip = prepared(entry)
        if min_seconds is not None and clip.seconds < min_seconds and entry.cyclic_end:
            from math import ceil

            from study.motion.cycles import extend

            clip = extend(clip, frames_after=ceil(min_seconds * clip.fps) - clip.frames).clip
        return clip if fps is None else resample(clip, fps)


def prepared(entry: Entry) -> Clip:
    """Read an entry's file and make it fit for use, at the file's own frame rate; the clip's history says how."""
    from study.motion.defects import find_defects, mend
    from study.motion.feet import faced, grounded
    from study.motion.files import read_clip
    from study.motion.mirror import mirror

    if entry.file is None:
        raise MotionError(f"Expected a file behind {entry.name!r}, found none.")
    clip = read_clip(entry.file)
    if entry.trial:
        clip = clip.noting(f"CMU trial {entry.trial}, as {entry.name!r}")
    clip = _without_added_pose(clip, entry)
    clip = _usable(clip, entry)
    clip = mend(clip, find_defects(clip))
    if entry.mirrored:
        clip = mirror(clip)
    has_legs = {"hip.L", "hip.R", "ankle.L", "ankle.R"} <= set(clip.skeleton.roles)
    if has_legs:
        clip = grounded(faced(clip))
    return replace(clip, name=entry.name)


def _without_added_pose(clip: Clip, entry: Entry) -> Clip:
    """Drop the T-pose that BVH conversions of CMU trials have in front, so that frames count as in the original."""
    from study.motion.defects import find_defects

    if not entry.trial or entry.file is None or entry.file.suffix.lower() != ".bvh":
        return clip
    added = [defect for defect in find_defects(clip) if defect.kind == "t-pose" and defect.frame_start == 0]
    return trim(clip, added[0].frame_stop, clip.frames) if added else clip


def _usable(clip: Clip, entry: Entry) -> Clip:
    """The usable frames of an entry's file."""
    stop = clip.frames if entry.last_frame is None else entry.last_frame + 1
    if not 0 <= entry.first_frame < stop <= clip.frames:
        raise MotionError(
            f"Expected frames {entry.first_frame} to {stop - 1} for {entry.name!r} in {entry.file}, found "
            f"{counted(clip.frames, 'frame')}. The file is not the whole trial; download it again."
        )
    return trim(clip, entry.first_frame, stop)


def _motion_files(folder: Path) -> list[Path]:
    from study.motion.files import SUFFIXES

    found = (path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file())
    return sorted(path for path in found if not any(part.startswith(".") for part in path.relative_to(folder).parts))


def _only_others(folder: Path) -> str:
    """What a folder without motion files holds instead, if it is motion in another format."""
    from study.motion.other_formats import KNOWN, by_suffix

    others = sorted(path for path in folder.rglob("*") if path.suffix.lower() in KNOWN)
    return str(by_suffix(others[0])) if others else "found none."


def _sorted_out(files: Iterable[Path]) -> tuple[dict[str, Path], list[Path]]:
    """CMU trials by number (the original where a conversion is there, too), and all other files."""
    trials: dict[str, Path] = {}
    others = []
    for file in files:
        if not is_trial(file.stem):
            others.append(file)
        elif file.stem not in trials or file.suffix.lower() == ".amc":
            trials[file.stem] = file
    return dict(sorted(trials.items())), others


def _own_entries(folder: Path, others: Iterable[Path], trials: Mapping[str, Path]) -> dict[str, Entry]:
    """Files under their stems; where two have the same stem, under their path without the suffix."""
    files = [*others, *trials.values()]
    stems = [file.stem for file in files]
    entries: dict[str, Entry] = {}
    for file in files:
        path = file.relative_to(folder)
        name = file.stem if stems.count(file.stem) == 1 else path.with_suffix("").as_posix()
        if name in entries:
            raise MotionError(
                f"Expected motion files with different names in {folder}, found {path} beside "
                f"{name}{(entries[name].file or path).suffix}. Rename or remove one."
            )
        entries[name] = Entry(name, words=path.as_posix(), file=file)
    return entries


def _indexed_entries(trials: Mapping[str, Path]) -> dict[str, Entry]:
    """The motions of the CMU index whose files are there, each by its best take."""
    entries = {}
    for motion in cmu_index().values():
        take = next((take for take in motion.takes if take.trial in trials), None)
        if take is not None:
            entries[motion.name] = _entry_of(motion, take, trials[take.trial])
    return entries


def _entry_of(motion: IndexedMotion, take: Take, file: Path) -> Entry:
    return Entry(
        name=motion.name,
        kind=motion.kind,
        words=f"{motion.words} (CMU {take.trial}{', mirrored' if take.mirrored else ''})",
        start=take.start,
        end=take.end,
        file=file,
        first_frame=take.first,
        last_frame=take.last,
        mirrored=take.mirrored,
        trial=take.trial,
    )


def _missing(motion: IndexedMotion, folder: Path) -> str:
    best, *others = motion.takes
    amc, asf = best.files
    more = f" Also fit: {', '.join(take.trial for take in others)}." if others else ""
    return (
        f"Expected {amc} and {asf} in {folder} for the motion {motion.name!r}, found neither that trial nor another "
        f"that shows it. Get them with `segue motions download {best.trial} --out {folder}`, or from "
        f"{CMU_SITE}/{amc}.{more}"
    )


def _unknown(name: str, known: Iterable[str], where: str) -> str:
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.4)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    listed = ", ".join(names[:40]) + (", ..." if len(names) > 40 else "")
    return f"Expected a motion of {where}, found {name!r}.{hint} It has {listed}."
