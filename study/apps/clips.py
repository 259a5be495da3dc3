"""Clips as the command line names them: a file, or a motion of a library."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from study.apps.console import say

if TYPE_CHECKING:
    from study.motion.clip import Clip


def load_clip(spec: str, library: str | None, fps: float | None) -> Clip:
    """A clip from a file, or by name from a library (the synthetic one unless another is named)."""
    from study.motion.clip import resample
    from study.motion.files import read_clip
    from study.motion.library import open_library

    if library is None and Path(spec).is_file():
        clip = read_clip(spec)
        return clip if fps is None else resample(clip, fps)
    return open_library(library or "synthetic").clip(spec, fps=fps)


def clip_pair(source: str, destination: str, library: str | None, fps: float) -> tuple[Clip, Clip]:
    """Both clips at one frame rate, the destination on the source's skeleton."""
    first, second = load_clip(source, library, fps), load_clip(destination, library, fps)
    return first, on_body_of(first, second)


def on_body_of(first: Clip, clip: Clip) -> Clip:
    """A clip on the skeleton of the first; what that changes is said."""
    from study.motion.clip import retarget

    moved = retarget(clip, first.skeleton)
    for note in moved.history[len(clip.history) :]:
        say(f"{clip.name}: {note}")
    return moved
