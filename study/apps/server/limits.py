"""Limits: what every response carries, and how often somebody may guess. Pure ASGI, so that it costs next to nothing.

Every response carries a strict content security policy, and nothing is kept by caches. All scripts, styles and films
come from this server; nothing is loaded from elsewhere.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from starlette.types import ASGIApp, Message, Receive, Scope, Send

GUESSES_AT_ONCE = 10
SECONDS_A_GUESS = 6.0
"""Wrong codes that an address may send at once, and seconds until each further one."""

MOST_GUESSERS = 5000
"""Addresses that are remembered; if more of them guess within a minute, further ones must wait."""

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


class Limits:
    """Wraps an application: every response gets the security headers."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": _joined(message["headers"])}
            await send(message)

        await self.app(scope, receive, send_with_headers)


def _joined(headers: Iterable[tuple[bytes, bytes]]) -> list[tuple[bytes, bytes]]:
    own = list(headers)
    there = {name.lower() for name, _ in own}
    return own + [(name, value) for name, value in HEADERS if name not in there]


class Guesses:
    """Counts the guesses of each address: some at once, and then slowly."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._spent: dict[str, float] = {}  # when an address will have as many guesses as at first

    def take(self, address: str) -> bool:
        """Whether an address may guess now; it has then, until it is `given_back`."""
        now = self._clock()
        if len(self._spent) >= MOST_GUESSERS:
            self._spent = {other: end for other, end in self._spent.items() if end > now}
        end = max(now, self._spent.get(address, now)) + SECONDS_A_GUESS
        known = address in self._spent or len(self._spent) < MOST_GUESSERS
        if not known or end > now + GUESSES_AT_ONCE * SECONDS_A_GUESS:
            return False
        self._spent[address] = end
        return True

    def give_back(self, address: str) -> None:
        """It was no guess: the code was right."""
        self._spent[address] = self._spent.get(address, 0.0) - SECONDS_A_GUESS
