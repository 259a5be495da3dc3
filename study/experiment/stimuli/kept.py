"""What a protocol shows, kept: it is settled once, and every later verb takes it from the user's cache folder.

A protocol, a library and what makes an `Outlook` come in; the outlook goes out. It is kept under a hash of all that
it follows from, so that a change of anything has it made anew. Where nothing can be kept, all works as without.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from study.errors import FileError
from study.experiment.protocol.whole import Protocol
from study.experiment.stimuli.making import versions
from study.experiment.stimuli.manifest import made_from
from study.files import write_whole
from study.motion.library import FolderLibrary, SyntheticLibrary

if TYPE_CHECKING:
    from study.motion.library import Library

Made = TypeVar("Made")

MOST_KEPT = 20
"""Protocols and libraries of which the outlook is kept; one takes 1 to 10 MB."""


def kept(protocol: Protocol, library: Library, make: Callable[[], Made], worth: Callable[[Made], bool]) -> Made:
    """What was kept of a protocol on a library; else made now, and kept where it is worth it.

    A library of the caller's own kind is made of who knows what: nothing of it is kept.
    """
    folder = cache_folder()
    if folder is None or type(library) not in (FolderLibrary, SyntheticLibrary):
        return make()
    path = folder / f"{_key(protocol, library)}.outlook"
    if (content := _read(path)) is not None:
        with suppress(OSError):
            path.touch()  # the longest unused are dropped first
        found: Made = pickle.loads(content)
        return found
    made = make()
    if worth(made) and path.stem == _key(protocol, library):  # else something was changed meanwhile
        with suppress(OSError, FileError):
            content = pickle.dumps(made)
            write_whole(path, hashlib.sha256(content).digest() + content)
            for old in sorted(folder.glob("*.outlook"), key=lambda one: one.stat().st_mtime)[:-MOST_KEPT]:
                old.unlink()
    return made


def cache_folder() -> Path | None:
    """The folder that SEGUE_CACHE names, else `segue` in the user's cache folder; None where the user has none."""
    if own := os.environ.get("SEGUE_CACHE"):
        return Path(own)
    with suppress(RuntimeError):
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "segue"
    return None


def _key(protocol: Protocol, library: Library) -> str:
    # A protocol built in Python has no text, or another one: what counts are its values, too.
    return hashlib.sha256(f"{made_from(protocol, library)} {versions()} {protocol!r}".encode()).hexdigest()


def _read(path: Path) -> bytes | None:
    """What this user kept in a file; None where there is none, or it is damaged."""
    try:
        content, owner = path.read_bytes(), path.stat().st_uid
    except OSError:
        return None
    # To unpickle is to run what somebody wrote.
    ours = not hasattr(os, "getuid") or owner == os.getuid()
    return content[32:] if ours and hashlib.sha256(content[32:]).digest() == content[:32] else None
