"""Files that are whole or not there: written under a temporary name in the same folder, then renamed. Scratch folders.

What a killed process left behind, under either kind of name, the next one clears away.
"""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from renderer.errors import RendererError

_UNFINISHED = ".part"


@contextmanager
def whole_file(target: Path) -> Iterator[Path]:
    """A temporary name beside the target that becomes it at the end, or goes away."""
    unfinished = target.with_name(f".{target.name}.{os.getpid()}{_UNFINISHED}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        discard_unfinished(target)
        unfinished.touch()
    except OSError as error:
        raise cannot_write(target, error) from error
    try:
        yield unfinished
        with unfinished.open("rb+") as file:
            os.fsync(file.fileno())
        unfinished.replace(target)
    except OSError as error:
        raise cannot_write(target, error) from error
    finally:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)


def discard_unfinished(target: Path) -> None:
    """Remove what earlier attempts at this file left behind, of processes that are gone."""
    for left in target.parent.glob(f".{target.name}.*{_UNFINISHED}"):
        owner = left.name.removesuffix(_UNFINISHED).rpartition(".")[2]
        if owner.isdigit() and int(owner) != os.getpid() and _alive(int(owner)):
            continue
        with suppress(OSError):
            left.unlink()


@contextmanager
def scratch_folder(kind: str) -> Iterator[Path]:
    """A folder in the system's temporary one for this process alone; gone at the end."""
    for left in Path(tempfile.gettempdir()).glob(f"{kind}-*-*"):
        owner = left.name.removeprefix(f"{kind}-").partition("-")[0]
        with suppress(OSError):
            if owner.isdigit() and not _alive(int(owner)):
                shutil.rmtree(left)
    with tempfile.TemporaryDirectory(prefix=f"{kind}-{os.getpid()}-", ignore_cleanup_errors=True) as name:
        yield Path(name)


def _alive(process: int) -> bool:
    if os.name != "posix":
        return True  # asking there would end it; better to leave a file behind than to take one that is being written
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass  # somebody else's, but alive
    return True


def cannot_write(target: Path, error: OSError) -> RendererError:
    """What went wrong, and what to do about it."""
    what = {
        errno.ENOSPC: "no space is left on the disk; make room, or write somewhere else",
        errno.EDQUOT: "the disk quota is used up; make room, or write somewhere else",
        errno.EACCES: "the folder may not be written to; choose another, or change its rights",
        errno.EPERM: "the folder may not be written to; choose another, or change its rights",
        errno.EROFS: "the disk is read-only; write somewhere else",
        errno.ENOTDIR: "part of the path is a file, not a folder",
        errno.EEXIST: "part of the path is a file, not a folder",
        errno.EISDIR: "there is a folder of that name",
        errno.ENAMETOOLONG: "the name is too long",
    }.get(error.errno or 0, str(error))
    return RendererError(f"{target}: can't be written: {what}.")
