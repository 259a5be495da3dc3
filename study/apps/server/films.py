"""Films: one film as a reply. A file and a name come in; the whole film, or the part that was asked for, goes out.

Safari asks for films in parts. One range of bytes gives status 206, one beyond the end 416; anything else that a Range
header may say (several ranges, other units, nonsense) is passed over, and the whole film is sent, as RFC 9110 (section
14.2) allows.
"""

from __future__ import annotations

import re
from pathlib import Path

from starlette.responses import FileResponse
from starlette.types import Receive, Scope, Send

_ONE_RANGE = re.compile(rb"\s*bytes\s*=\s*(?:(\d{1,15})\s*-\s*(\d{0,15})|-\s*\d{1,15})\s*", re.IGNORECASE)


class Film(FileResponse):
    """A film under a name that nobody else knows; the file's own marks would tell that two films are the same one."""

    chunk_size = 512 * 1024
    """Most films in one piece: each one more is a walk to a thread and back."""

    def __init__(self, path: Path, name: str) -> None:
        marks = {"etag": f'"{name}"', "last-modified": "Thu, 01 Jan 1970 00:00:00 GMT"}
        super().__init__(path, media_type="video/mp4", headers=marks)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""
        kept = [(name, value) for name, value in scope["headers"] if name != b"range" or _is_one_range(value)]
        await super().__call__({**scope, "headers": kept}, receive, send)


def _is_one_range(value: bytes) -> bool:
    found = _ONE_RANGE.fullmatch(value)
    if found is None:
        return False
    first, last = found.groups()
    return not (first and last and int(last) < int(first))
