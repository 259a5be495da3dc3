"""The one exception tree, and the warnings.

Every refusal says what was expected, what was found, where, and what to do. `SegueError` is bad input
(exit status 2 on the command line); anything else that escapes is a fault of ours (exit status 1).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any


class SegueError(Exception):
    """Input that can't be used; the message says what to do about it."""


class FileError(SegueError):
    """A file or folder that the disk refuses to read or write: no room, no rights, something in the way."""


class MotionFileError(SegueError):
    """A motion file that can't be read.

    Parameters
    ----------
    message
        What was expected, what was found, what to do.
    path
        The file.
    line, column
        Where, counted from 1; 0 where the whole file is meant.
    """

    def __init__(self, message: str, path: Path | str, line: int = 0, column: int = 0) -> None:
        self.path, self.line, self.column = Path(path), line, column
        place = str(path) + (f":{line}" if line else "") + (f":{column}" if line and column else "")
        super().__init__(f"{place}: {message}")


class MotionError(SegueError):
    """A clip that is not fit for what is asked of it."""


class TransitionError(SegueError):
    """Two clips that can't be joined as asked."""


class ProtocolError(SegueError):
    """A protocol that can't be run as written.

    `rest` is the protocol with misspelled keys mended, if that holds; `motions` are those that its file names.
    """

    rest: Any = None
    motions: tuple[str, ...] = ()


class StimulusError(SegueError):
    """A stimulus that can't be made or shown."""


class SessionError(SegueError):
    """A session that can't be started, continued or read."""


class AnalysisError(SegueError):
    """Answers that can't be analysed as asked."""


class MotionWarning(UserWarning):
    """A motion file was read, though something in it was not as it should be."""
