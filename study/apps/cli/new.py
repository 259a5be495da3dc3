"""`segue new`: a first protocol, from the researcher's own clips or as a copy of one that comes with Segue."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from study.apps.cli.console import FOLDER, columns, emit, json_option, library_option, say

if TYPE_CHECKING:
    from study.motion.library import Library


@click.command()
@click.argument("clips", nargs=-1, metavar="[CLIP]...")
@click.option(
    "--study",
    metavar="TASK",
    help="What participants decide: preference, same-different, oddity, 2afc, yes-no, rating or "
    "parallel-rating "
    "(default: asks).",
)
@click.option(
    "--from",
    "published",
    metavar="PROTOCOL",
    help="Copy a protocol that comes with Segue, such as wang2004_session, to edit it (default: none).",
)
@library_option
@click.option("--name", help="Name of the protocol, its file and its results (default: my_study, or that of --from).")
@click.option("--out", type=FOLDER, default=Path(), help="Folder to write into (default: here).")
@click.option("--overwrite", is_flag=True, help="Replace a protocol of that name that is there.")
@json_option
def new(
    clips: tuple[str, ...],
    study: str | None,
    published: str | None,
    library: str | None,
    name: str | None,
    out: Path,
    overwrite: bool,
) -> None:
    """Write a first protocol that can be shown at once, for you to edit; in a terminal, asks for what is not given.

    Two or more clips are needed, as files of one folder or motions of --library.
    """
    from study.experiment.protocol.whole import find_protocol, load_protocol
    from study.experiment.starting import start_protocol
    from study.files import write_whole

    if published is not None and (clips or study):
        raise click.UsageError("expected --from PROTOCOL, or clips and --study, found both; leave one out.")
    if name is not None and not re.fullmatch(r"[a-z0-9][a-z0-9_-]{0,99}", name):
        raise click.UsageError(f"expected --name of small letters, digits, - and _, found {name!r}.")
    original = None if published is None else load_protocol(find_protocol(published))
    name = name or (original.name if original else "my_study")
    path = out / f"{name}.toml"
    if path.exists() and not overwrite and not (sys.stdin.isatty() and click.confirm(f"Replace {path}?", err=True)):
        found = f"expected no file at {path}, found one; it is kept"
        raise click.UsageError(f"{found}. Give another --name or --out, or --overwrite.")
    notes, described = list[str](), list[str]()
    if original:
        named = re.sub(r'^name\s*=\s*"[^"]*"', f'name = "{name}"', original.text, count=1, flags=re.MULTILINE)
        write_whole(path, named)
    else:
        task, (opened, motions) = _task(study), _chosen(clips, library)
        text, notes = start_protocol(name, task, motions, opened)
        write_whole(path, text)
        described, library = _described(opened, motions), None if opened.synthetic else opened.name
    follow = [f"segue {verb} {shlex.quote(str(path))}" for verb in ("check", "serve")]
    follow = [f"{line} --library {shlex.quote(library)}" if library else line for line in follow]
    follow.append(f"segue report {shlex.quote(str(Path('results') / name))}")
    lines = [*(f"{file}: written, for you to edit" for file in (path, *described)), *notes, "Next:", *follow]
    emit({"files": [str(path), *described], "notes": notes, "next": follow}, "\n".join(lines))


def _task(study: str | None) -> str:
    """The task that is named, or asked for."""
    from study.tasks.registry import DECIDES

    if study is None and sys.stdin.isatty():
        for line in columns(list(DECIDES.items()), left=(0, 1)):
            say(line)
        return str(click.prompt("What do participants decide?", type=click.Choice(list(DECIDES)), err=True))
    if study is None or study not in DECIDES:
        choices = "; ".join(f"{name}, {decides}" for name, decides in DECIDES.items())
        raise click.UsageError(f"expected --study, found {study or 'none'}; name one: {choices}.")
    return study


def _chosen(clips: Sequence[str], library: str | None) -> tuple[Library, list[str]]:
    """The library of some clips, and their names in it."""
    from study.motion.entries import motion_file
    from study.motion.library import open_library
    from study.motion.readers.gltf_file import file_of

    if not clips and sys.stdin.isatty():
        library = library or click.prompt("Folder of your motion files, or synthetic", default=".", err=True)
        say("Its motions: " + ", ".join(open_library(library).names()))
        clips = shlex.split(click.prompt("Clips, two or more, with spaces between", err=True))
    files = [file for spec in clips if library is None and (file := motion_file(spec)) is not None]
    if len(clips) < 2:
        found = f"expected two clips or more, found {len(clips)}"
        raise click.UsageError(f"{found}; name files, as in segue new walk.bvh run.bvh, or motions of --library.")
    folders = sorted({file_of(file).parent for file in files})
    if len(folders) > 1 or 0 < len(files) < len(clips):
        raise click.UsageError(
            f"expected clips of one folder, found some elsewhere than in {folders[0]}; put them into one folder, or "
            "name the --library above them and the motions by name."
        )
    opened = open_library(library or (folders[0] if folders else "synthetic"))
    places = [file.relative_to(folders[0]).as_posix() for file in files] or clips
    names = [opened.entry(place).name for place in places]
    if len(set(names)) < len(names):
        raise click.UsageError(f"expected each clip once, found {', '.join(names)}; remove what is there twice.")
    return opened, names


def _described(library: Library, motions: Sequence[str]) -> list[str]:
    """Writes a first `library.toml` about files of the researcher's own, where none is in or above their folder."""
    from study.apps.cli.motions import first_tables
    from study.errors import FileError
    from study.motion.library import FolderLibrary
    from study.motion.library_file import NAME, find_library_file, write_library_file

    own = [motion for motion in motions if not library.entry(motion).trial]
    if own and isinstance(library, FolderLibrary) and find_library_file(library.folder) is None:
        try:
            write_library_file(library.folder, first_tables(library, own))
        except FileError as refused:  # the study needs none
            say(f"no {NAME} was written: {refused}")
        else:
            return [str(Path(library.name, NAME))]
    return []
