"""Entries: what a library knows of a motion without reading it, and how its file becomes a clip that is fit for use.

In: motion files, the CMU index, a `library.toml`. Out: an `Entry` for each file, under a name of its own, and one for
each further name that the index or the `library.toml` gives. A clip is the same, whichever of its names it is asked by.
"""

from __future__ import annotations

import difflib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any

from study.errors import MotionError, MotionFileError
from study.motion.clip import Clip, trim
from study.motion.cmu import Boundary, IndexedMotion, Take, cmu_index, is_trial
from study.motion.defects import Defect, find_defects, told
from study.motion.feet import faced, grounded
from study.motion.library_file import FACTS, ClipTable, LibraryFile, absolute, composed, find_library_file, placed
from study.motion.mending import mend
from study.motion.mirror import mirror
from study.motion.readers.gltf_file import bare_name, is_animation
from study.motion.readers.registry import read_clip


@dataclass(frozen=True)
class Entry:
    """What a library knows of a motion without reading it."""

    name: str
    """What protocols call it."""
    kind: str = ""
    """walking, running, standing, turning, boxing, dancing, tai-chi, a category of the user's own, or `""` where nobody
    said."""
    words: str = ""
    """A few words for lists."""
    start: Boundary = ""
    end: Boundary = ""
    """How it begins and ends: `"gait"`, `"still"`, or `""` where it can't be continued (or nobody looked)."""
    file: Path | None = None
    """The file it comes from, or its animation in a glTF file, `hero.glb/walk`; None for synthetic motions."""
    first_frame: int = 0
    last_frame: int | None = None
    """Usable frames of the file, both included, counted from 0 at the file's rate; `last_frame` None for the last."""
    mirrored: bool = False
    """Whether the file is mirrored left to right to give the motion."""
    trial: str = ""
    """The CMU trial, where the frames are those of the index, which count from behind the T-pose that conversions have
    in front; else `""`."""
    own: bool = False
    """Whether the name is the file's own, and not a further one."""
    metres_per_unit: float | None = None
    fps: float | None = None
    joints: tuple[tuple[str, str], ...] = ()
    """What `library.toml` says of the file: its unit and frame rate, where known, and joint names by role."""
    cyclic: bool | None = None
    """Whether the motion goes in cycles, where `library.toml` says so or not."""
    beats: tuple[float, ...] = ()
    genre: str = ""
    """Times of its beats in seconds from the file's first frame, and what kind of dance it is."""


# -- From files to entries ------------------------------------------------------------------------------------------


def motion_file(spec: str) -> Path | None:
    """The file at a path, accents composed or not; None where there is none.

    Raises
    ------
    MotionFileError
        Where the disk does not let us look.
    """
    path = Path(spec)
    try:
        if path.is_file() or is_animation(path):
            return path
        beside = path.parent.iterdir() if path.parent.is_dir() else ()
        return next((file for file in beside if composed(file.name) == composed(path.name) and file.is_file()), None)
    except PermissionError as problem:
        raise MotionFileError(f"Expected a motion file, but it can't be read ({problem.strerror}).", path) from problem
    except OSError:
        return None  # no name that a file can have


def entry_of_file(spec: str | Path) -> Entry:
    """The entry of a file by itself, as the library of its folder has it; `library.toml` is looked for there and above.

    Raises
    ------
    MotionFileError
        Where there is no such file, or its `library.toml` can't be used.
    """
    found = motion_file(str(spec))
    if found is None:
        wanted = Path(spec)
        beside = [path.name for path in wanted.parent.iterdir()] if wanted.parent.is_dir() else []
        near = difflib.get_close_matches(wanted.name, beside, n=1, cutoff=0.75)
        hint = f"Did you mean {near[0]!r}?" if near else "Check the path."
        if wanted.is_dir():
            raise MotionFileError("Expected a motion file, found a folder. Name one of its files.", wanted)
        raise MotionFileError(f"Expected a motion file, found nothing there. {hint}", wanted)
    file = absolute(found)
    return own_entry(file, composed(bare_name(file)), file.name, find_library_file(file.parent))


def own_entry(file: Path, name: str, words: str, described: LibraryFile | None) -> Entry:
    """The entry of a file under its own name.

    It is the table that `library.toml` has under the file's own name, over what the index knows of the CMU trial where
    that is one motion and not mirrored, over the defaults of `library.toml`.
    """
    takes = _takes().get(trial_of(file), ())
    plain = Entry(name, words=words, file=file, own=True)
    if len(takes) == 1 and not takes[0][1].mirrored:
        motion, take = takes[0]
        plain = _with_take(replace(plain, words=f"{motion.words}; {words}"), motion, take)
    elif takes:
        plain = replace(plain, words=f"CMU trial; {words}")
    own = [table.fields for table in own_tables(file, described)]
    return _said(plain, described, [*_facts(tables_about(file, described)), *own])


def named_entries(file: Path, words: str, described: LibraryFile | None) -> list[Entry]:
    """The entries of a file under the further names that its `library.toml` gives it."""
    tables, own = tables_about(file, described), own_tables(file, described)
    named = [table for table in tables if table not in own]
    return [
        _said(Entry(table.name, words=words, file=file), described, [*_facts(tables), table.fields]) for table in named
    ]


def tables_about(file: Path, described: LibraryFile | None) -> tuple[ClipTable, ...]:
    """The tables of a `library.toml` about a file."""
    return () if described is None else described.about(file)


def own_tables(file: Path, described: LibraryFile | None) -> tuple[ClipTable, ...]:
    """Those of them that bear a name of the file's own: `walk`, `outdoors/walk` or `outdoors/walk.bvh`."""
    if described is None:
        return ()
    own_names = ways_to(file, described.path.parent)
    return tuple(table for table in described.about(file) if table.name in own_names)


def indexed_entries(trials: Mapping[str, Path], describe: Callable[[Path], LibraryFile | None]) -> list[Entry]:
    """The motions of the CMU index whose files are there, each by its best take."""
    entries = []
    for motion in cmu_index().values():
        take = next((take for take in motion.takes if take.trial in trials), None)
        if take is not None:
            file = trials[take.trial]
            described = describe(file)
            words = f"{motion.words} (CMU {take.trial}{', mirrored' if take.mirrored else ''})"
            entry = _with_take(Entry(motion.name, words=words, file=file), motion, take)
            entries.append(_said(entry, described, _facts(tables_about(file, described))))
    return entries


@cache
def _takes() -> Mapping[str, tuple[tuple[IndexedMotion, Take], ...]]:
    """All takes of the CMU index by trial."""
    takes: dict[str, tuple[tuple[IndexedMotion, Take], ...]] = {}
    for motion in cmu_index().values():
        for take in motion.takes:
            takes[take.trial] = (*takes.get(take.trial, ()), (motion, take))
    return takes


def trial_of(file: Path) -> str:
    """The CMU trial that a file is by its name, else `""`; glTF files have been through another program."""
    return file.stem if file.suffix.lower() in (".amc", ".bvh") and is_trial(file.stem) else ""


def is_indexed(trial: str) -> bool:
    """Whether a trial is in the CMU index."""
    return trial in _takes()


def _with_take(entry: Entry, motion: IndexedMotion, take: Take) -> Entry:
    return replace(
        entry,
        kind=motion.kind,
        start=take.start,
        end=take.end,
        first_frame=take.first,
        last_frame=take.last,
        mirrored=take.mirrored,
        trial=take.trial,
    )


def _facts(tables: Iterable[ClipTable]) -> list[Mapping[str, Any]]:
    """What the tables about a file say of the file itself, whichever clip they name."""
    return [{field: value for field, value in table.fields.items() if field in FACTS} for table in tables]


def _said(entry: Entry, described: LibraryFile | None, said: Sequence[Mapping[str, Any]]) -> Entry:
    """The entry with what `library.toml` says of it; of an indexed trial, the defaults leave the motion as it is."""
    if described is None:
        return entry
    defaults = {k: v for k, v in described.defaults.items() if not entry.trial or k in (*FACTS, "beats", "genre")}
    fields = dict(defaults)
    for one in said:
        if {"first_frame", "last_frame"} & set(one):
            # Frames of a table count as the file has them.
            fields |= {"first_frame": 0, "last_frame": None, "trial": ""}
        fields |= one
    return replace(entry, **fields)


def ways_to(file: Path, folder: Path) -> tuple[str, ...]:
    """What a file may be called: without its suffix (`walk`), its place without it (`outdoors/walk`), its place."""
    bare, place = composed(bare_name(file)), placed(file, folder)
    return bare, str(PurePosixPath(place).with_name(bare)), place


def own_names(files: Sequence[Path], folder: Path, given: Mapping[Path, str], taken: Iterable[str]) -> dict[Path, str]:
    """A name for each file: the one given, or the shortest of these that no other file has.

    After those of `ways_to`, the place with accents as the disk has them. `taken` are names with another meaning.
    """
    ways = [{file: ways_to(file, folder)[k] for file in files} for k in range(3)]
    ways.append({file: file.relative_to(folder).as_posix() for file in files})
    names = dict(given)
    used = {*taken, *names.values()}
    for way in ways:
        left = [file for file in files if file not in names]
        times = Counter(way[file] for file in left)
        named = {file: way[file] for file in left if times[way[file]] == 1 and way[file] not in used}
        names |= named
        used |= set(named.values())
    return names


# -- From an entry to its clip --------------------------------------------------------------------------------------


def prepared(entry: Entry, *, as_is: bool = False) -> Clip:
    """Read an entry's file and make it fit for use, at the file's own frame rate; the clip's history says how.

    Frames that belong to no motion are dropped, other defects mended (`study.motion.mending.mend`), the floor put at
    height 0, the start over the origin, setting out towards +Z. With `as_is` nothing of that is done, and a file's own
    name stands for all of its frames.

    Raises
    ------
    MotionError
        Where the file can't be read, lacks the entry's frames, or is not usable for half of its length.
    """
    clip = read_entry(entry)
    if entry.trial:
        clip = clip.noting(f"CMU trial {entry.trial}, as {entry.name!r}")
    added: tuple[Defect, ...] = ()
    if not (as_is and entry.own):
        added = _added_pose(clip, entry)
        clip = _usable(trim(clip, added[0].frame_stop if added else 0, clip.frames), entry)
    defects = find_defects(clip)
    if not as_is:
        clip = mend(clip, defects)
    if added or defects:
        clip = clip.noting(told((*added, *defects), kept=as_is, first_frame=round(clip.start_s * clip.fps)))
    if entry.mirrored:
        clip = mirror(clip)
    if clip.skeleton.has("hip", "ankle") and not as_is:
        clip = grounded(faced(clip))
    return replace(clip, name=entry.name)


def read_entry(entry: Entry) -> Clip:
    """An entry's whole file as it is, in the unit, at the frame rate and with the joints that `library.toml` says."""
    if entry.file is None:
        raise MotionError(f"Expected a file behind {entry.name!r}, found none.")
    mapping = dict(entry.joints) or None
    try:
        return read_clip(entry.file, metres_per_unit=entry.metres_per_unit, fps=entry.fps, mapping=mapping)
    except MotionError as refusal:
        if mapping and (described := find_library_file(entry.file.parent)):
            raise MotionFileError(f"joints of {entry.file.name}: {refusal}", described.path) from refusal
        raise


def _added_pose(clip: Clip, entry: Entry) -> tuple[Defect, ...]:
    """The T-pose that BVH conversions of CMU trials have in front; frames of the index count as in the original."""
    if not entry.trial or entry.file is None or entry.file.suffix.lower() != ".bvh":
        return ()
    return tuple(defect for defect in find_defects(clip) if defect.kind == "t-pose" and defect.frame_start == 0)


def _usable(clip: Clip, entry: Entry) -> Clip:
    """The usable frames of an entry's file."""
    stop = clip.frames if entry.last_frame is None else entry.last_frame + 1
    if not 0 <= entry.first_frame < stop <= clip.frames:
        cause = "The file is not the whole trial; download it again." if entry.trial else "Mend them in library.toml."
        raise MotionError(
            f"Expected frames {entry.first_frame} to {stop - 1} for {entry.name!r} in {entry.file}, found "
            f"{clip.frames} frames. {cause}"
        )
    return trim(clip, entry.first_frame, stop)
