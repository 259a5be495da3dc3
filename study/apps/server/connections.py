"""Connections: uvicorn's HTTP protocol with patience that ends. Bytes of one client come in, whole requests go on.

A client that opens connections and sends nothing, or a request byte by byte, would hold them for ever; one that sends
endless headers would fill the memory. uvicorn with httptools sets no bounds to either, so they are set here.
"""

from __future__ import annotations

import asyncio
from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

REQUEST_SECONDS = 30.0
"""In which a request has to arrive whole; the largest one takes that at 270 kbit a second."""

REPLY_SECONDS = 300.0
"""In which a reply has to be taken; a film of five megabytes takes that at 140 kbit a second. It is longer than uvicorn
keeps idle connections, and ends those that uvicorn closes but which never end, as their reply is not taken."""

LARGEST_HEAD = 32_768
"""Bytes of a request line and its headers."""


class _Joined:
    """A transport that sends the head and the body of a reply together: one system call, one packet."""

    def __init__(self, transport: asyncio.Transport, loop: asyncio.AbstractEventLoop) -> None:
        self._transport, self._loop = transport, loop
        self._parts: list[bytes] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)

    def write(self, part: bytes) -> None:
        """Bytes to be sent when what runs now has run."""
        if not self._parts:
            self._loop.call_soon(self._send)
        self._parts.append(part)

    def close(self) -> None:
        """No more bytes will come."""
        self._send()
        self._transport.close()

    def _send(self) -> None:
        if self._parts:
            self._transport.write(b"".join(self._parts))
            self._parts.clear()


class Connection(HttpToolsProtocol):
    """One connection; ended where a request or the taking of its reply lasts too long, or its headers are endless."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._deadline: asyncio.TimerHandle | None = None
        self._head_bytes = 0
        self._head_whole = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Somebody is there; a request has to follow."""
        super().connection_made(_Joined(transport, self.loop))  # type: ignore[arg-type]
        self._within(REQUEST_SECONDS)

    def connection_lost(self, exc: Exception | None) -> None:
        """Nobody is there any more."""
        self._within(None)
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Bytes arrived; those of a head are counted until it is whole."""
        super().data_received(data)
        self._head_bytes = 0 if self._head_whole else self._head_bytes + len(data)
        if self._head_bytes > LARGEST_HEAD and not self.transport.is_closing():
            self.send_400_response(f"Expected at most {LARGEST_HEAD} bytes of headers.")

    def on_message_begin(self) -> None:
        """The first byte of a request."""
        super().on_message_begin()
        self._head_whole = False
        self._within(REQUEST_SECONDS)

    def on_headers_complete(self) -> None:
        """The head is whole."""
        self._head_whole = True
        super().on_headers_complete()

    def on_message_complete(self) -> None:
        """The request is whole; now the reply has to be made and taken. Idle connections uvicorn ends before that."""
        super().on_message_complete()
        self._within(REPLY_SECONDS)

    def _within(self, seconds: float | None) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
        self._deadline = None if seconds is None else self.loop.call_later(seconds, self._too_late)

    def _too_late(self) -> None:
        self._deadline = None
        self.transport.abort()
