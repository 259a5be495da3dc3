"""`segue motions` (list, inspect, download) and `segue preview`."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from study.apps.cli.clips import clips_options, load_clip
from study.apps.cli.console import FILE, FOLDER, emit, json_option, library_option, say
from study.apps.cli.films import film_options
from study.counting import counted

if TYPE_CHECKING:
    from study.motion.library import FolderLibrary
    from study.motion.skeleton import Skeleton


@click.group()
def motions() -> None:
    """List motions, inspect a file for defects, download CMU trials."""


@motions.command("list")
@library_option
@click.option("--write", is_flag=True, help="Write a first library.toml into the folder, for you to complete.")
@json_option
def list_motions(library: str | None, write: bool) -> None:
    """The motions of a library, by name."""
    from study.motion.library import FolderLibrary, open_library
    from study.motion.library_file import NAME, write_library_file

    opened = open_library(library or "synthetic")
    result: dict[str, Any] = {
        "library": opened.name,
        "synthetic": opened.synthetic,
        "acknowledgement": opened.acknowledgement,
    }
    if write:
        if not isinstance(opened, FolderLibrary):
            raise click.UsageError("expected --library FOLDER with --write, found the synthetic library.")
        result["written"] = str(write_library_file(opened.folder, first_tables(opened, opened.names())))
    rows = [opened.entry(name) for name in opened.names()]
    skipped = opened.skipped if isinstance(opened, FolderLibrary) else []
    for line in skipped:
        say(f"not listed: {line}")
    widths = [max(map(len, column)) for column in ([row.name for row in rows], [row.kind for row in rows])]
    lines = [f"{row.name:{widths[0]}}  {row.kind:{widths[1]}}  {row.words}" for row in rows]
    lines += [f"{result['written']}: a first {NAME}; see docs/libraries.md for its keys"] if write else []
    motions = [
        {"name": row.name, "kind": row.kind, "words": row.words, "file": opened.where(row) or None, "genre": row.genre}
        for row in rows
    ]
    emit({**result, "motions": motions, "skipped": skipped}, "\n".join(lines))


def first_tables(library: FolderLibrary, names: Iterable[str]) -> list[tuple[str, str, str, str]]:
    """Name, file, category and a comment for each file behind some names, for a first `library.toml`."""
    import warnings

    from study.errors import MotionWarning, SegueError
    from study.motion.readers.registry import read_clip

    tables: list[tuple[str, str, str, str]] = []
    for name in names:
        entry = library.entry(name)
        place = library.where(entry)
        # Names that are no text, as some archives leave them, have no place in a text file.
        if entry.own and entry.file and place.isprintable() and place not in [table[1] for table in tables]:
            try:
                with warnings.catch_warnings(record=True) as said:
                    warnings.simplefilter("always", MotionWarning)
                    clip = read_clip(entry.file)
            except SegueError as error:
                comment = f"can't be read: {error}"
            else:
                seconds = f"{clip.frames} frames at {clip.fps:g} fps, {clip.seconds:.2f} s"
                comment = "; ".join(
                    [seconds, f"a unit is {clip.metres_per_unit:.6g} m", *(str(w.message) for w in said)]
                )
            tables.append((name, place, entry.kind, comment))
    return tables


@motions.command()
@click.argument("file")
@click.option(
    "--metres-per-unit",
    type=click.FloatRange(min=0, min_open=True),
    help="The file's length unit, metres (default: that of library.toml, else guessed from the figure's size).",
)
@click.option(
    "--fps",
    type=click.FloatRange(min=0, min_open=True),
    help="Frames per second (default: as the file or library.toml says).",
)
@json_option
def inspect(file: str, metres_per_unit: float | None, fps: float | None) -> None:
    """The content of a motion file, and its defects.

    The options, or the file's library.toml, supply what the file does not say.
    """
    from study.motion.defects import find_defects
    from study.motion.entries import entry_of_file, read_entry

    entry = entry_of_file(file)
    clip = read_entry(replace(entry, metres_per_unit=metres_per_unit or entry.metres_per_unit, fps=fps or entry.fps))
    defects = find_defects(clip)
    roles = {role: clip.skeleton.names[joint] for role, joint in clip.skeleton.roles.items()}
    result = {
        "file": file,
        "frames": clip.frames,
        "fps": clip.fps,
        "seconds": clip.seconds,
        "metres_per_unit": clip.metres_per_unit,
        "joints": list(clip.skeleton.names),
        "roles": roles,
        "human": clip.skeleton.body.human,
        "missing_roles": dict(clip.skeleton.body.missing),
        "role_notes": list(clip.skeleton.body.notes),
        "history": list(clip.history),
        "defects": [asdict(defect) for defect in defects],
    }
    lines = [
        f"{Path(file).name}: {counted(clip.frames, 'frame')} at {clip.fps:g} fps, {clip.seconds:.2f} s, "
        f"{counted(clip.skeleton.joints, 'joint')}",
        *clip.history,
        *_role_lines(clip.skeleton),
        *(f"defect: {defect.message}" for defect in defects),
        "" if defects else _nothing_found(clip.skeleton),
    ]
    emit(result, "\n".join(line for line in lines if line))


def _role_lines(skeleton: Skeleton) -> Iterator[str]:
    """Which joint plays which role, which roles no joint plays, and why."""
    body = skeleton.body
    if not body.human:
        yield f"no human body was found: {next(iter(body.missing.values()))}. It can be previewed; methods need a human"
        return
    yield "roles: " + ", ".join(f"{role} {skeleton.names[joint]}" for role, joint in body.joints.items())
    for why in dict.fromkeys(body.missing.values()):
        yield f"missing: {', '.join(role for role, reason in body.missing.items() if reason == why)} ({why})"
    yield from body.notes


def _nothing_found(skeleton: Skeleton) -> str:
    if skeleton.has("hip", "ankle"):
        return "no defects found"
    return "no jumps found; flipped legs and the floor were not looked for, as no legs were found"


@motions.command()
@click.argument("trials", nargs=-1, required=True, metavar="TRIAL...")
@click.option("--out", type=FOLDER, required=True, help="Folder to download into.")
@json_option
def download(trials: tuple[str, ...], out: Path) -> None:
    """Download trials such as 16_35, or motions such as run, from the CMU Graphics Lab's official site."""
    from study.motion.library import CMU_ACKNOWLEDGEMENT, download_trial

    files = [download_trial(trial, out) for trial in trials]
    say(CMU_ACKNOWLEDGEMENT)
    emit({"files": [str(file) for file in files], "acknowledgement": CMU_ACKNOWLEDGEMENT}, "\n".join(map(str, files)))


@click.command()
@click.argument("clip", metavar="FILE|NAME")
@clips_options
@click.option("--out", type=FILE, required=True, help="File to write: X.mp4, or X.png, a strip of poses.")
@click.option(
    "--fps", type=click.FloatRange(min=1), help="Frames per second of the video (default: those of the clip)."
)
@film_options
@click.option("--poses", type=click.IntRange(min=1), default=9, show_default=True, help="Number of poses of the strip.")
@click.option("--floor", is_flag=True, help="Draw the ground, with contact shadows.")
@json_option
def preview(clip: str, library: str | None, out: Path, fps: float | None, **look: Any) -> None:
    """One clip as a video, or as a strip of poses in one image."""
    from study.motion.drawing import draw_clip

    shown = load_clip(clip, library, fps)
    draw_clip(shown, out, **look)
    result = {"file": str(out), "frames": shown.frames, "fps": shown.fps, "history": list(shown.history)}
    emit(result, f"{out}: {shown.name or clip}, {counted(shown.frames, 'frame')} at {shown.fps:g} fps")
