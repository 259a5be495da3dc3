"""Clips as the command line names them: a file, or a motion of a library; and the options that say how to load them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from study.apps.cli.console import is_given, kept_flag, library_option, say, together

if TYPE_CHECKING:
    from study.motion.clip import Clip
    from study.motion.entries import Entry
    from study.motion.library import Library

as_is_option = kept_flag(
    "--as-is", "Use motion files as they are, with their defects (such as an added T-pose), floor and position."
)


clips_options = together(library_option, as_is_option)
"""Of a verb that loads clips."""


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

    opened, entry = find_entry(spec, library)
    clip = opened.clip(entry, fps=fps, as_is=is_given("--as-is"))
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
