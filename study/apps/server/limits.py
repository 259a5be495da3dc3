"""Limits: what every request and every response goes through. Pure ASGI, so that it costs next to nothing.

Requests above a size are refused before they are read; every response carries a strict content security policy, and
nothing is kept by caches. All scripts, styles and films come from this server; nothing is loaded from elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterable

from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LARGEST_REQUEST = 1_000_000
"""Bytes; the frame times of a pair of ten seconds at 240 frames a second are 60,000."""

_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self'",
        "media-src 'self' blob:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)

HEADERS: tuple[tuple[bytes, bytes], ...] = (
    (b"content-security-policy", _POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-embedder-policy", b"require-corp"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"permissions-policy", b"camera=(), microphone=(), geolocation=(), payment=()"),
    (b"cache-control", b"no-store"),
)


class RequestTooLargeError(HTTPException):
    """A request that is longer than it says, or than is taken; inside the application it becomes status 413."""

    def __init__(self, largest: int) -> None:
        super().__init__(413, f"Expected at most {largest} bytes.")


class Limits:
    """Wraps an application: request size, security headers."""

    def __init__(self, app: ASGIApp, largest_request: int = LARGEST_REQUEST) -> None:
        self.app, self.largest = app, largest_request

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        begun = False

        async def send_with_headers(message: Message) -> None:
            nonlocal begun
            if message["type"] == "http.response.start":
                begun = True
                message = {**message, "headers": _joined(message["headers"])}
            await send(message)

        taken = 0

        async def receive_limited() -> Message:
            nonlocal taken
            message = await receive()
            taken += len(message.get("body", b""))
            if taken > self.largest:
                raise RequestTooLargeError(self.largest)
            return message

        try:
            if _length(scope["headers"]) > self.largest:
                raise RequestTooLargeError(self.largest)
            await self.app(scope, receive_limited, send_with_headers)
        except RequestTooLargeError as refusal:
            if not begun:
                response = JSONResponse({"error": refusal.detail}, status_code=413)
                await response(scope, receive, send_with_headers)


def _joined(headers: Iterable[tuple[bytes, bytes]]) -> list[tuple[bytes, bytes]]:
    own = list(headers)
    there = {name.lower() for name, _ in own}
    return own + [(name, value) for name, value in HEADERS if name not in there]


def _length(headers: Iterable[tuple[bytes, bytes]]) -> int:
    for name, value in headers:
        if name == b"content-length":
            return int(value) if value.isdigit() else LARGEST_REQUEST + 1
    return 0
