"""Writing files, complete or not at all; errors of the disk are reported with the path.

A file is written under a temporary name beside its own, flushed to the disk and renamed; where anything fails the
temporary file goes, and what stood under the name before stays.
"""

from __future__ import annotations

import codecs
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from renderer.errors import DiskError
from renderer.files import REASONS, begin, cannot_write, discard_unfinished, flush, unfinished_name
from renderer.files import whole_file as whole_file_or_disk_error
from study.errors import FileError


@contextmanager
def whole_file(target: str | Path) -> Iterator[Path]:
    """A temporary name beside the target, to write to by any means, which becomes the target at the end of the block.

    Parameters
    ----------
    target
        The file; its folder is made where there is none, and a file that is there is replaced.

    Raises
    ------
    FileError
        Where the disk refuses; the target is then as it was.
    """
    try:
        with whole_file_or_disk_error(Path(target)) as unfinished:
            yield unfinished
    except DiskError as error:
        raise FileError(str(error)) from error


def write_whole(target: str | Path, content: bytes | str) -> None:
    """Write a file whole or not at all; text is written as UTF-8, its line ends as they are.

    Raises
    ------
    FileError
        Where the disk refuses; the target is then as it was.
    """
    with whole_file(target) as unfinished:
        unfinished.write_bytes(content.encode() if isinstance(content, str) else content)


def check_place(target: str | Path) -> None:
    """Before long work, refuse a file that could not be written at its end.

    Raises
    ------
    FileError
        Where the disk refuses.
    """
    try:
        begin(Path(target)).unlink()
    except DiskError as error:
        raise FileError(str(error)) from error


@contextmanager
def whole_folder(target: str | Path) -> Iterator[Path]:
    """A temporary folder beside the target, to be filled, which takes the target's place at the end of the block.

    Raises
    ------
    FileError
        Where the disk refuses; the target is then as it was.
    """
    target = Path(target).absolute()  # of "." the name is needed
    unfinished = unfinished_name(target)
    before = unfinished_name(target.with_name(f"{target.name}.before"))
    try:
        discard_unfinished(target)
        unfinished.mkdir(parents=True)
        yield unfinished
        for path in unfinished.rglob("*"):
            if path.is_file():
                flush(path)
        if target.exists():
            target.rename(before)
        unfinished.rename(target)
    except OSError as error:
        if before.exists():
            before.rename(target)
        raise FileError(str(cannot_write(target, error))) from error
    finally:
        for folder in (unfinished, before):
            shutil.rmtree(folder, ignore_errors=True)


def read_text(path: str | Path, kind: str, most_bytes: int = -1) -> str:
    """A file's text in UTF-8, without the mark that some editors put before it.

    Parameters
    ----------
    kind
        What it should be, for messages: `"a CSV file of labels"`.
    most_bytes
        No more is read; everything unless given.

    Raises
    ------
    FileError
        Where it can't be read, or is not in UTF-8.
    """
    try:
        with Path(path).open("rb") as file:
            content = file.read(most_bytes)
    except OSError as error:
        why = error.strerror or str(error)
        raise FileError(f"{path}: expected {kind}, found none ({why}); check the path and its rights.") from error
    # Without a mark, UTF-16 shows itself by the zero bytes beside its ASCII letters.
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) or b"\0" in content[:100]:
        raise FileError(
            f"{path}: expected {kind} in UTF-8, found UTF-16 (some editors call it Unicode) or binary data; open it in "
            "the editor and save it as UTF-8."
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line, byte = content.count(b"\n", 0, error.start) + 1, content[error.start]
        raise FileError(
            f"{path}:{line}: expected {kind} in UTF-8, found a letter in another encoding (byte 0x{byte:02x}); save "
            "the file as UTF-8."
        ) from error


def make_folder(folder: str | Path) -> None:
    """Make a folder, with those above it, where there is none.

    Raises
    ------
    FileError
        Where the disk refuses.
    """
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise FileError(f"{folder}: expected a folder to write to, found a file in its place; name another.") from error
    except OSError as error:
        raise refused(error, folder) from error


def refused(error: OSError, path: str | Path | None = None) -> FileError:
    """What the system refused, as something that the user can mend.

    Parameters
    ----------
    path
        The file or folder; the one that the error names unless given.
    """
    place = error.filename if path is None else path
    reason = REASONS.get(error.errno or 0, error.strerror or str(error))
    return FileError(f"{place or 'the disk'}: can't be read or written: {reason}.")
