"""Films: one film as a reply. A file and a name come in; the whole film, or the part that was asked for, goes out.

All films of a study are sent at one size, so that nobody can tell which of them are the same before they are loaded: a
box `free` of zeros follows, which players pass over (ISO 14496-12), and whose last four bytes are the film's number of
frames. A page learns it there, with the film.

Safari asks for films in parts. One range of bytes gives status 206, one beyond the end 416; anything else that a Range
header may say (several ranges, other units, nonsense) is passed over, and the whole film is sent, as RFC 9110 (section
14.2) allows.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Iterable
from pathlib import Path

from starlette.responses import Response
from starlette.types import Receive, Scope, Send

_ONE_RANGE = re.compile(rb"\s*bytes\s*=\s*(?:(\d{1,15})\s*-\s*(\d{0,15})|-\s*(\d{1,15}))\s*", re.IGNORECASE)
_BOX = 12
"""Bytes of the smallest box: its own size, its name, the number of frames."""

PIECE = 512 * 1024
"""Films up to this size are sent in one piece, which saves changes of thread."""


def whole_bytes(sizes: Iterable[int]) -> int:
    """The size at which films of these sizes are sent; a larger one is sent at a multiple of it."""
    return max(sizes, default=0) + _BOX


class Film(Response):
    """A film under a secret name; the file's own marks would tell that two films are the same one.

    The file has `size` bytes, of which a multiple of `unit` is made.
    """

    def __init__(self, path: Path, name: str, size: int, frames: int, unit: int) -> None:
        self.path, self.name, self.size, self.frames = path, name, size, frames
        self.whole = -(-(size + _BOX) // unit) * unit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:  # noqa: ARG002
        """One request."""
        headers = {b"content-type": b"video/mp4", b"accept-ranges": b"bytes", b"etag": b'"%b"' % self.name.encode()}
        headers[b"last-modified"] = b"Thu, 01 Jan 1970 00:00:00 GMT"
        status, part = 200, range(self.whole)
        if (asked := _asked(dict(scope["headers"]), headers[b"etag"], self.whole)) is not None:
            status, part = (206, asked) if asked else (416, range(0))
            place = b"%d-%d" % (part[0], part[-1]) if part else b"*"
            headers[b"content-range"] = b"bytes %b/%d" % (place, self.whole)
        headers[b"content-length"] = b"%d" % len(part)
        await send({"type": "http.response.start", "status": status, "headers": list(headers.items())})
        for start in range(part.start, part.stop, PIECE) if scope["method"] != "HEAD" else ():
            piece = await asyncio.to_thread(self._read, start, min(start + PIECE, part.stop))
            await send({"type": "http.response.body", "body": piece, "more_body": True})
        await send({"type": "http.response.body", "body": b""})

    def _read(self, start: int, stop: int) -> bytes:
        with self.path.open("rb") as file:
            file.seek(min(start, self.size))
            piece = file.read(max(0, min(stop, self.size) - start))
        box = self.whole - self.size
        filling = box.to_bytes(4) + b"free" + bytes(box - _BOX) + self.frames.to_bytes(4)
        return piece + filling[max(0, start - self.size) : max(0, stop - self.size)]


def _asked(headers: dict[bytes, bytes], tag: bytes, whole: int) -> range | None:
    """The bytes that a request asks for: none where they lie beyond the end, None for all."""
    found = _ONE_RANGE.fullmatch(headers.get(b"range", b""))
    if found is None or headers.get(b"if-range", tag) != tag:
        return None
    first, last, final = found.groups()
    if final is not None:
        return range(max(0, whole - int(final)), whole)
    if last and int(last) < int(first):
        return None
    return range(int(first), min(int(last) + 1, whole) if last else whole)
