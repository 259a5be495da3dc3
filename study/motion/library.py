"""The library: motions by name, synthetic or from a folder of motion capture.

In: `"synthetic"`, or a folder of motion files, nested or not, which may have a `library.toml`. Out: `Clip`s that
are fit for use: defects dropped or mended, floor at zero, starting over the origin towards +Z, at the frame rate asked
for. Every file has a name of its own; CMU trials have the names of the index as well. Protocols name motions,
not files, so that each runs on any library.
"""

from __future__ import annotations

import difflib
import os
from abc import ABC, abstractmethod
from collections import Counter, OrderedDict, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cache
from math import ceil
from pathlib import Path

from study.errors import MotionError, MotionFileError
from study.motion import synthetic
from study.motion.clip import Clip, resample
from study.motion.cmu import CMU_ACKNOWLEDGEMENT, CMU_SITE, Boundary, IndexedMotion, cmu_index
from study.motion.cycles import extend
from study.motion.download import download_trial
from study.motion.entries import (
    Entry,
    entry_of_file,
    indexed_entries,
    is_indexed,
    motion_file,
    named_entries,
    own_entry,
    own_names,
    own_tables,
    prepared,
    trial_of,
    ways_to,
)
from study.motion.library_file import LibraryFile, absolute, composed, find_library_file, placed
from study.motion.readers.gltf_file import file_of, motions_in
from study.motion.readers.other_formats import KNOWN, by_suffix
from study.motion.readers.registry import SUFFIXES

__all__ = ["CMU_ACKNOWLEDGEMENT", "Entry", "Library", "download_trial", "open_library"]

SYNTHETIC = "synthetic"

# Clips kept in memory; a clip of ten seconds at 30 fps takes 0.3 MB, the longest captured ones 6 MB.
_KEPT_CLIPS = 48


class Library(ABC):
    """Motions by name; see `open_library`."""

    name: str
    synthetic: bool
    acknowledgement: str

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[Entry, float | None, float | None, bool], Clip] = OrderedDict()

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

        What is written into records: it is valid on every machine, and reveals no local paths.
        """
        return "" if entry.file is None else entry.file.name

    def _make(self, entry: Entry, fps: float | None, min_seconds: float | None) -> Clip:
        """Make a motion up that has no file; for libraries that have such motions."""
        del fps, min_seconds
        raise MotionError(f"Expected a file behind {entry.name!r} in {self.name}, found none.")

    def distinct(self) -> tuple[str, ...]:
        """The motions, no file twice: by its further names where it has any, else by its own."""
        return self.names()

    def find(self, spec: str) -> Entry:
        """A motion by its name, or a motion file by its path.

        Raises
        ------
        MotionError
            For what is neither.
        """
        try:
            return self.entry(spec)
        except MotionError:
            if motion_file(spec) is None and Path(spec).suffix.lower() not in SUFFIXES:
                raise
            return entry_of_file(spec)

    def clip(
        self, motion: str | Entry, fps: float | None = None, min_seconds: float | None = None, *, as_is: bool = False
    ) -> Clip:
        """A motion, fit for use.

        Parameters
        ----------
        motion
            One of `names()`, or an entry.
        fps
            Frames per second; by default those of the file (30 for synthetic motions).
        min_seconds
            Least duration: synthetic motions are made this long; captured ones are continued at their end, so that
            their frames keep their numbers, where they end in cycles or standing still, and stay as long as they are
            where they don't. Use `cycles.extend` to continue a clip at its start, too.
        as_is
            Leave a file's defects in, and its floor and place as they are.

        Raises
        ------
        MotionError
            For a name that is not there, or a file that can't be read.
        """
        entry = self.entry(motion) if isinstance(motion, str) else motion
        key = (entry, None if fps is None else float(fps), min_seconds, as_is)
        if key not in self._kept:
            made = _from_file(entry, fps, min_seconds, as_is) if entry.file else self._make(entry, fps, min_seconds)
            self._kept[key] = made
            while len(self._kept) > _KEPT_CLIPS:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return self._kept[key]


def _from_file(entry: Entry, fps: float | None, min_seconds: float | None, as_is: bool) -> Clip:
    """A captured motion from its file."""
    clip = prepared(entry, as_is=as_is)
    if min_seconds is not None and clip.seconds < min_seconds and entry.end:
        clip = extend(clip, frames_after=ceil(min_seconds * clip.fps) - clip.frames).clip
    return clip if fps is None else resample(clip, fps)


def open_library(spec: str | Path) -> Library:
    """The library that a protocol, or a person, names.

    Parameters
    ----------
    spec
        `"synthetic"`, or a folder of motion files, nested or not.

    Raises
    ------
    MotionError
        Where there is no such folder, it holds no motion files, or two of its files can't be distinguished.
    """
    if str(spec) == SYNTHETIC:
        return _synthetic()
    folder = Path(spec).expanduser()
    try:
        is_file, is_folder = folder.is_file(), folder.is_dir()
    except OSError as problem:
        raise MotionError(
            f"Expected a folder as library, but {folder} can't be read ({problem.strerror})."
        ) from problem
    if is_file:
        raise MotionError(f"Expected 'synthetic' or a folder as library, found the file {folder}. Name its folder.")
    if not is_folder:
        raise MotionError(
            f"Expected 'synthetic' or a folder of motion files as library, found nothing at {folder}. "
            "Check the path; `segue motions download` fills a folder with CMU trials."
        )
    return FolderLibrary(folder)


class SyntheticLibrary(Library):
    """Motions that a program makes up; see `study.motion.synthetic`."""

    name = SYNTHETIC
    synthetic = True
    acknowledgement = "The motions are synthetic: a program generated them, nobody was captured."

    def names(self) -> tuple[str, ...]:
        return synthetic.NAMES

    def entry(self, name: str) -> Entry:
        if name not in self.names():
            known = _unknown(name, self.names(), "the synthetic library")
            raise MotionError(f"{known} Motions of your own are found with --library FOLDER.")
        about = synthetic.describe(name)
        ends: tuple[Boundary, Boundary] = ("gait" if about.cyclic[0] else "", "gait" if about.cyclic[1] else "")
        return Entry(name, about.kind, f"synthetic: {about.line}", *ends)

    def _make(self, entry: Entry, fps: float | None, min_seconds: float | None) -> Clip:
        return synthetic.synthesize(entry.name, seconds=min_seconds, fps=30.0 if fps is None else fps)


@cache
def _synthetic() -> SyntheticLibrary:
    """One for the whole program: to make a motion up takes a third of a second, and nothing of it can change."""
    return SyntheticLibrary()


class FolderLibrary(Library):
    """Motion files below a folder: each under its own name, and under those of the CMU index and of `library.toml`."""

    synthetic = False

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.name = str(folder)
        self.folder = absolute(folder)
        self.skipped: list[str] = []
        self._files = [one for file in sorted(_motion_files(self.folder, self.skipped)) for one in motions_in(file)]
        if not self._files:
            raise MotionError(
                f"Expected {', '.join(SUFFIXES)} files in {folder} or its subfolders, {_only_others(folder)} Put "
                f"motion files there, or fill it with `segue motions download`.{_also(self.skipped)}"
            )
        self._described = {at: find_library_file(at) for at in {file.parent for file in self._files}}
        self._check_tables()
        self._trials = _trials(self._files)
        self._is_cmu = any(map(is_indexed, self._trials)) or (self.folder / "subjects").is_dir()
        self.acknowledgement = CMU_ACKNOWLEDGEMENT if self._is_cmu else ""
        self._entries = self._all_entries()
        self._by_place: defaultdict[str, list[str]] = defaultdict(list)
        for name, entry in self._entries.items():
            if entry.own and entry.file is not None:
                for way in set(ways_to(entry.file, self.folder)):
                    self._by_place[way].append(name)

    def _description(self, file: Path) -> LibraryFile | None:
        return self._described[file.parent]

    def _all_entries(self) -> dict[str, Entry]:
        """First the names of `library.toml`, then those of the index, then the files' own, then numbers of trials."""
        folders = {file: one.path.parent for file in self._files if (one := self._description(file)) is not None}
        named = [
            entry
            for file in self._files
            for entry in named_entries(file, placed(file, self.folder), self._description(file))
        ]
        entries = _by_name(named, self.folder, folders)
        given = {file: tables[0].name for file in self._files if (tables := own_tables(file, self._description(file)))}
        times = Counter((*given.values(), *entries))
        given = {file: name for file, name in given.items() if times[name] == 1}
        names = own_names(self._files, self.folder, given, entries)
        own = {name: self._own(file, name) for file, name in names.items()}
        indexed = {entry.name: entry for entry in indexed_entries(self._trials, self._description)}
        numbers = {trial: self._own(file, trial) for trial, file in self._trials.items()}
        for more in (indexed, dict(sorted(own.items())), numbers):
            entries |= {
                name: entry for name, entry in more.items() if name not in entries and own.get(name, entry) is entry
            }
        return entries

    def _own(self, file: Path, name: str) -> Entry:
        return own_entry(file, name, placed(file, self.folder), self._description(file))

    def _check_tables(self) -> None:
        """Refuse a `library.toml` with tables about files that are not there."""
        for described in {id(one): one for one in self._described.values() if one is not None}.values():
            places = [placed(f, described.path.parent) for f in self._files if f.is_relative_to(described.path.parent)]
            inside = self.folder == described.path.parent or self.folder in described.path.parents
            for table in described.tables:
                if inside and table.file not in places:
                    near = difflib.get_close_matches(table.file, places, n=1)
                    hint = f" Did you mean {near[0]!r}?" if near else ""
                    raise MotionFileError(
                        f"[clips.{table.name!r}] file: expected a motion file in {described.path.parent}, found none "
                        f"at {table.file!r}.{hint}",
                        described.path,
                    )

    def where(self, entry: Entry) -> str:
        if entry.file is None or not entry.file.is_relative_to(self.folder):
            return super().where(entry)
        return entry.file.relative_to(self.folder).as_posix()

    def names(self) -> tuple[str, ...]:
        return tuple(self._entries)

    def distinct(self) -> tuple[str, ...]:
        named = {entry.file for entry in self._entries.values() if not entry.own}
        once: dict[object, str] = {}
        for name, entry in self._entries.items():
            if not entry.own or entry.file not in named:
                once.setdefault(entry.file if entry.own else name, name)
        return tuple(once.values())

    def files(self) -> tuple[Path, ...]:
        described = {one.path for one in self._described.values() if one is not None}
        files = dict.fromkeys(map(file_of, self._files))
        return (*files, *sorted(described))

    def trials(self) -> tuple[str, ...]:
        """The CMU trials that are there; each can be asked for by its number as well."""
        return tuple(self._trials)

    def entry(self, name: str) -> Entry:
        for wanted in (name, composed(name)):
            if wanted in self._entries:
                return self._entries[wanted]
        if self._is_cmu and name in cmu_index():
            raise MotionError(_missing(cmu_index()[name], self.folder))
        placed_so = self._by_place.get(composed(name), [])
        if len(placed_so) == 1:
            return self._entries[placed_so[0]]
        if placed_so:
            raise MotionError(
                f"Expected one file named {name!r} in {self.name}, found {len(placed_so)}. "
                f"Say which: {', '.join(placed_so)}."
            )
        raise MotionError(_unknown(name, self._entries, self.name))


def _by_name(entries: Iterable[Entry], folder: Path, described: dict[Path, Path]) -> dict[str, Entry]:
    """Entries by name; names that several `library.toml`s give follow the names of their folders."""
    listed = list(entries)
    times = Counter(entry.name for entry in listed)
    named: dict[str, Entry] = {}
    for entry in listed:
        name = entry.name
        if times[name] > 1 and entry.file is not None and described[entry.file].is_relative_to(folder):
            name = (described[entry.file].relative_to(folder) / name).as_posix()
        named[name] = replace(entry, name=name)
    return named


def _motion_files(folder: Path, skipped: list[str]) -> Iterator[Path]:
    """The motion files below a folder, links followed; what can't be listed or followed is noted in `skipped`."""
    seen: set[str] = set()
    folders, links = [folder], list[Path]()
    while folders or links:
        at = folders.pop() if folders else links.pop(0)
        if (real := os.path.realpath(at)) in seen:
            continue  # a link to where we have been
        seen.add(real)
        try:
            found = sorted(path for path in at.iterdir() if not path.name.startswith("."))
            kinds = [(path, path.is_dir(), path.is_file()) for path in found]
        except OSError as problem:
            skipped.append(f"{at.relative_to(folder)}: can't be listed ({problem.strerror})")
            continue
        for path, is_folder, is_file in kinds:
            if is_folder:
                (links if path.is_symlink() else folders).append(path)
            elif path.suffix.lower() in SUFFIXES and is_file:
                yield path
            elif path.suffix.lower() in SUFFIXES:
                skipped.append(f"{path.relative_to(folder)}: is a link to nothing")


def _only_others(folder: Path) -> str:
    """What a folder without motion files holds instead, if it is motion in another format."""
    others = sorted(path for path in folder.rglob("*") if path.suffix.lower() in KNOWN)
    return str(by_suffix(others[0])) if others else "found none."


def _also(skipped: list[str]) -> str:
    return f" ({'; '.join(skipped)}.)" if skipped else ""


def _trials(files: Iterable[Path]) -> dict[str, Path]:
    """CMU trials by number: the original where a conversion is there, too."""
    trials: dict[str, Path] = {}
    for file in files:
        if (trial := trial_of(file)) and (trial not in trials or file.suffix.lower() == ".amc"):
            trials[trial] = file
    return dict(sorted(trials.items()))


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
