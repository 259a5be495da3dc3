"""Clips as the command line names them: a file, or a motion of a library; and the options that say how to load them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from study.apps.cli.console import Command, library_option, say

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.motion.entries import Entry
    from study.motion.library import Library

_AS_IS = "study.apps.cli.clips.as_is"


def as_is_option(command: Command) -> Command:
    """Adds `--as-is` to a verb; it concerns every clip that the verb loads, so `load_clip` looks it up."""

    def keep(context: click.Context, _: click.Parameter, as_is: bool) -> None:
        context.meta[_AS_IS] = as_is

    return click.option(
        "--as-is",
        is_flag=True,
        expose_value=False,
        callback=keep,
        help="Use motion files as they are, with their defects (such as an added T-pose), floor and position.",
    )(command)


def clips_options(command: Command) -> Command:
    """Adds `--library` and `--as-is` to a verb that loads clips."""
    return library_option(as_is_option(command))


def find_entry(spec: str, library: str | Library | None) -> tuple[Library, Entry]:
    """The library and the motion that a person names: a file by its path, else a motion by its name."""
    from study.motion.entries import entry_of_file, motion_file
    from study.motion.library import open_library

    opened = open_library(library or "synthetic") if library is None or isinstance(library, str) else library
    if library is None and motion_file(spec) is not None:
        return opened, entry_of_file(spec)
    return opened, opened.find(spec)


def load_clip(spec: str, library: str | Library | None, fps: float | None, *, tell: bool = True) -> Clip:
    """A clip from a file, or by name from a library (the synthetic one unless another is named).

    What became of its defects is told on standard error, in one line.
    """
    from study.motion.defects import TOLD

    context = click.get_current_context(silent=True)
    as_is = bool(context and context.meta.get(_AS_IS))
    opened, entry = find_entry(spec, library)
    clip = opened.clip(entry, fps=fps, as_is=as_is)
    for line in clip.history:
        if tell and line.startswith(TOLD):
            say(f"{spec}: {line}" + (" (--as-is keeps them)" if line.startswith(f"{TOLD}dropped") else ""))
    return clip


def clip_pair(
    source: str, destination: str, library: str | None, fps: float, *, tell: bool = True
) -> tuple[Clip, Clip]:
    """Both clips at one frame rate, the destination on the source's skeleton."""
    first, second = (load_clip(spec, library, fps, tell=tell) for spec in (source, destination))
    return first, on_body_of(first, second, tell=tell)


def on_body_of(first: Clip, clip: Clip, *, tell: bool = True) -> Clip:
    """A clip on the skeleton of the first; what that changes is told on standard error."""
    from study.motion.clip import retarget

    moved = retarget(clip, first.skeleton)
    for note in moved.history[len(clip.history) :] if tell else ():
        say(f"{clip.name}: {note}")
    return moved
