"""Files that are whole or not there: written under a temporary name in the same folder, then renamed. Scratch folders.

What a killed process left behind, under either kind of name, the next one clears away.
"""

from __future__ import annotations

import errno
import glob
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from renderer.errors import DiskError

_UNFINISHED = ".part"


@contextmanager
def whole_file(target: Path) -> Iterator[Path]:
    """A temporary name beside the target that becomes it at the end, or goes away.

    Raises
    ------
    DiskError
        Where the system refuses; nothing has then changed under the target's name.
    """
    unfinished = begin(target)
    try:
        yield unfinished
        flush(unfinished)
        unfinished.replace(target)
    except OSError as error:
        raise cannot_write(target, error) from error
    finally:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)


def begin(target: Path) -> Path:
    """Make an empty file under a temporary name beside the target, or say why nothing can be written there."""
    unfinished = unfinished_name(target)
    try:
        if target.exists() and not target.is_file():
            # A rename would put a file in a device's place, and fails for a folder only when the work is done.
            number = errno.EISDIR if target.is_dir() else errno.EEXIST
            raise OSError(number, os.strerror(number), str(target))
        target.parent.mkdir(parents=True, exist_ok=True)
        discard_unfinished(target)
        unfinished.touch()
    except OSError as error:
        raise cannot_write(target, error) from error
    return unfinished


def unfinished_name(target: Path) -> Path:
    """Where this process writes what becomes the target."""
    return target.with_name(f".{_stem(target)}.{os.getpid()}{_UNFINISHED}")


def flush(path: Path) -> None:
    """Wait until a file is on the disk."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def discard_unfinished(target: Path) -> None:
    """Remove what earlier attempts at this file left behind, of processes that are gone."""
    for left in target.parent.glob(f".{glob.escape(_stem(target))}.*{_UNFINISHED}"):
        owner = left.name.removesuffix(_UNFINISHED).rpartition(".")[2]
        if owner.isdigit() and int(owner) != os.getpid() and _alive(int(owner)):
            continue
        with suppress(OSError):
            shutil.rmtree(left) if left.is_dir() else left.unlink()


def _stem(target: Path) -> str:
    """The target's name, cut where a temporary name would be too long for the disk."""
    return os.fsdecode(os.fsencode(target.name)[:220])


@contextmanager
def scratch_folder(kind: str) -> Iterator[Path]:
    """A folder in the system's temporary one for this process alone; gone at the end."""
    try:
        folder = tempfile.TemporaryDirectory(prefix=f"{kind}-{os.getpid()}-", ignore_cleanup_errors=True)
    except OSError as error:
        why = error.strerror or str(error)
        raise DiskError(f"The folder for temporary files can't be used ({why}); name another as TMPDIR.") from error
    with folder as name:
        for left in Path(name).parent.glob(f"{kind}-*-*"):
            owner = left.name.removeprefix(f"{kind}-").partition("-")[0]
            with suppress(OSError):
                if owner.isdigit() and not _alive(int(owner)):
                    shutil.rmtree(left)
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


REASONS = {
    errno.ENOSPC: "no space is left on the disk; make room, or write somewhere else",
    errno.EDQUOT: "the disk quota is used up; make room, or write somewhere else",
    errno.EFBIG: "files may not grow so large there; raise the limit, or write somewhere else",
    errno.EACCES: "it may not be read, or may not be written to; change its rights, or choose another place",
    errno.EPERM: "it may not be read, or may not be written to; change its rights, or choose another place",
    errno.EROFS: "the disk is read-only; write somewhere else",
    errno.ENOENT: "there is no such file or folder; check the path",
    errno.ENOTDIR: "part of the path is a file, not a folder; choose another path",
    errno.EEXIST: "something that is no plain file has that name; choose another name",
    errno.EISDIR: "there is a folder of that name; choose another name, or move the folder away",
    errno.ENAMETOOLONG: "the name is too long; choose a shorter one",
    errno.EIO: "the disk fails (Input/output error); check it, or choose another",
    errno.EMFILE: "too many files are open; close other programs, or raise the limit (ulimit -n)",
    errno.ENFILE: "too many files are open; close other programs",
    errno.ETXTBSY: "another program uses it; close that program",
    errno.EBUSY: "it is in use, or a disk is mounted there; choose a place below it",
    errno.ESTALE: "the network disk is gone; connect it again",
}
"""What the system refuses, in words, with what the user can do about it."""


def cannot_write(target: Path, error: OSError) -> DiskError:
    """What went wrong, and what to do about it."""
    number = error.errno or 0
    if number == errno.EEXIST and error.filename != str(target):
        number = errno.ENOTDIR  # a file stands where a folder of the path should be
    return DiskError(f"{target}: can't be written: {REASONS.get(number, str(error))}.")
