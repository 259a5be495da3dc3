"""Connections: uvicorn's HTTP protocol with patience that ends. Bytes of one client come in, whole requests go on.

A client that opens connections and sends nothing, or a request byte by byte, would hold them indefinitely; one that
sends endless headers, or many bodies by half, would fill the memory. uvicorn with httptools sets no bounds to any of
this; they are set here.
"""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

REQUEST_SECONDS = 30.0
"""Seconds within which a request must arrive completely; the largest one needs 270 kbit per second for that."""

REPLY_SECONDS = 300.0
"""Seconds within which a reply must be taken; a film of five megabytes needs 140 kbit per second for that.
It is longer than uvicorn keeps idle connections, and ends those that uvicorn closes but whose reply is never taken."""

LARGEST_HEAD = 32_768
"""Bytes of a request line and its headers."""

MOST_BODIES = 32_000_000
"""Bytes of all bodies whose requests have no reply yet; beyond it the oldest is closed, and its page sends again."""


class _Bodies:
    """Bytes of the bodies of this process that have no reply yet, connection by connection, the oldest first."""

    def __init__(self) -> None:
        self.held: dict[Connection, int] = {}
        self.total = 0

    def add(self, connection: Connection, count: int) -> None:
        """A part of a body came; if all bodies together are too large, the oldest connection is closed."""
        self.held[connection] = self.held.get(connection, 0) + count
        self.total += count
        if self.total > MOST_BODIES:
            oldest = next(iter(self.held))
            self.drop(oldest)
            oldest.transport.abort()

    def drop(self, connection: Connection) -> None:
        """The body of a connection is kept no longer."""
        self.total -= self.held.pop(connection, 0)


_bodies = _Bodies()


class Connection(HttpToolsProtocol):
    """One connection; ended where a request or the taking of its reply lasts too long, or a request is too large.

    `_head` counts the bytes of the request line and of whole headers; `_beside` all bytes of a request that are not of
    its body, as those of a header that never ends.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._deadline: asyncio.TimerHandle | None = None
        self._head = self._beside = self._body = self._requests = 0
        self._whole = True

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Somebody is there; a request has to follow."""
        super().connection_made(transport)
        self._within(REQUEST_SECONDS)

    def connection_lost(self, exc: Exception | None) -> None:
        """Nobody is there any more."""
        self._within(None)
        _bodies.drop(self)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Bytes arrived."""
        self._requests, before = (0, 0) if self._whole else (1, self._body)
        super().data_received(data)
        # Bytes that belong to several requests are mostly of those that are whole, and taken.
        if self._requests == 1:
            self._beside += len(data) - (self._body - before)
        # What frames the pieces of a chunked body counts as well, of which there may be as much as of the body.
        if not self._whole and self._beside > LARGEST_HEAD + 8 * self._body and not self.transport.is_closing():
            self.send_400_response("")

    def on_message_begin(self) -> None:
        """The first byte of a request."""
        super().on_message_begin()
        self._head = self._beside = self._body = 0
        self._requests += 1
        self._whole = False
        self._within(REQUEST_SECONDS)

    def on_url(self, url: bytes) -> None:
        """A part of the address."""
        self._count(len(url))
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """A header; those after a body come here, too."""
        self._count(len(name) + len(value) + len(": \r\n"))
        super().on_header(name, value)

    def _count(self, length: int) -> None:
        self._head += length
        if self._head > LARGEST_HEAD:
            raise ValueError("too large")  # ends the parsing; uvicorn then calls `send_400_response`

    def send_400_response(self, msg: str) -> None:
        """Refuse what is no request, or too large a one."""
        large = max(self._head, self._beside) > LARGEST_HEAD
        super().send_400_response(f"Expected at most {LARGEST_HEAD} bytes of headers." if large else msg)

    def on_body(self, body: bytes) -> None:
        """A part of a body; of one that has its reply already, as one that was refused, nothing is kept."""
        self._body += len(body)
        super().on_body(body)
        if self.cycle.response_complete:
            return
        _bodies.add(self, len(body))

    def on_message_complete(self) -> None:
        """The request is whole; now the reply has to be made and taken. Idle connections uvicorn ends before that."""
        self._whole = True
        super().on_message_complete()
        self._within(REPLY_SECONDS)

    def on_response_complete(self) -> None:
        """The reply is made; what was sent of a body is of no use any more."""
        _bodies.drop(self)
        if self.cycle.response_complete:
            self.cycle.body.clear()
        super().on_response_complete()

    def _within(self, seconds: float | None) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
        self._deadline = None if seconds is None else self.loop.call_later(seconds, self._too_late)

    def _too_late(self) -> None:
        self._deadline = None
        self.transport.abort()
