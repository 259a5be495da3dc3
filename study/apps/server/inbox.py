"""Inbox: what the participants' pages send. Messages come in by POST, the next view goes out as JSON.

Answers of many participants arrive at one instant, so this is ASGI without a framework around it: an address is looked
up, a body read, a message checked, a reply sent. All else goes on to the application behind.

A participant is known by a cookie that scripts can't read. A message needs a header that no form of another site can
send, and comes from this site's pages. Who sends it is looked up before its body is read, and each kind of message may
be as long as it needs.
"""

from __future__ import annotations

import ipaddress
import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

from pydantic_core import to_json
from starlette.types import ASGIApp, Receive, Scope, Send

from study.apps.server.hosting import Host
from study.apps.server.live import LiveSession
from study.apps.server.messages import (
    LONGEST_PAGE,
    SHORTEST_PAGE,
    Answered,
    Begin,
    Done,
    Happened,
    RefusedError,
    Withdrawal,
    read,
)
from study.errors import SegueError
from study.experiment.store.databases import AWAY

COOKIE_SECONDS = 14 * 24 * 3600

LARGEST_ANSWER = 1_000_000
"""Bytes; the frame times of a pair of ten seconds at 240 frames a second are 60,000."""

LARGEST_MESSAGE = 32_000
"""Bytes of messages without frame times; what a form may hold is added to it."""

LARGEST_FIELD = 6_200
"""Bytes of one field of the form: a thousand characters, as JSON may write them."""

SMALLEST_MESSAGE = 1_000
"""Bytes of messages without content."""

DATABASE_AWAY = "The database can't be reached now; send this again."

log = logging.getLogger("segue.serve")


@dataclass(frozen=True)
class Letter:
    """A message as it arrives: the address that it was sent to, its headers; its body is still to be read."""

    scope: Scope
    headers: dict[bytes, bytes]
    receive: Receive

    @property
    def page(self) -> str:
        """Which tab sent it: a name that the page made up when it was opened."""
        return self.headers.get(b"x-segue-page", b"").decode("latin-1")

    def cookie(self, name: str) -> str:
        """The cookie of a name, or nothing."""
        return cookie(self.headers.get(b"cookie", b""), name)

    @property
    def client(self) -> str:
        """The address that it came from; of IPv6 the network, in which one machine has as many as it likes."""
        host = (self.scope.get("client") or ("",))[0]
        return str(ipaddress.ip_network((host, 64), strict=False)) if ":" in host else str(host)

    async def body(self, largest: int) -> bytes:
        """What it says; refused as soon as it is longer than that, at best before anything is read."""
        length = self.headers.get(b"content-length", b"0")
        if len(length) > 12 or not length.isdigit() or int(length) > largest:
            raise RefusedError(413, f"Expected at most {largest} bytes.")
        body, more = bytearray(), True
        while more:
            part = await self.receive()
            if part["type"] == "http.disconnect":
                raise RefusedError(400, "Expected the whole message; the connection ended before.")
            body += part.get("body", b"")
            more = part.get("more_body", False)
            if len(body) > largest:
                raise RefusedError(413, f"Expected at most {largest} bytes.")
        return bytes(body)


@dataclass(frozen=True)
class Reply:
    """What goes back; `token` is None to leave the cookie as it is, and empty to delete it."""

    content: Any
    token: str | None = None


Handler = Callable[[Host, Letter], Awaitable[Reply]]


async def begin(host: Host, letter: Letter) -> Reply:
    """A page was opened."""
    _of_our_pages(letter)
    message: Begin = read(Begin, await letter.body(LARGEST_MESSAGE))
    view, token = await host.begin(letter.cookie(host.cookie), message)
    return Reply(view, token or None)


async def done(host: Host, letter: Letter) -> Reply:
    """A page was read."""
    forms = [host.protocol.form, *(study.form for study in host.protocol.studies)]
    largest = LARGEST_MESSAGE + LARGEST_FIELD * max(map(len, forms))
    live, body = await _from_participant(host, letter, largest)
    message: Done = read(Done, body)
    view = await host.done(live, message)
    return Reply(view, "" if view["kind"] == "declined" else None)


async def answer(host: Host, letter: Letter) -> Reply:
    """A question was answered."""
    live, body = await _from_participant(host, letter, LARGEST_ANSWER)
    message: Answered = read(Answered, body)
    return Reply(await host.answer(live, message))


async def happened(host: Host, letter: Letter) -> Reply:
    """Another event than a response."""
    live, body = await _from_participant(host, letter, LARGEST_MESSAGE)
    message: Happened = read(Happened, body)
    await host.happened(live, message)
    return Reply({})


async def alive(host: Host, letter: Letter) -> Reply:
    """The page is still there."""
    await _from_participant(host, letter, SMALLEST_MESSAGE)
    return Reply({})


async def leave(host: Host, letter: Letter) -> Reply:
    """The page was closed. A beacon can't carry our header: its body is the page's name, and it only ends the hold."""
    _same_origin(letter)
    if token := letter.cookie(host.cookie):
        await host.leave(token, (await letter.body(SMALLEST_MESSAGE)).decode("latin-1"))
    return Reply({})


async def withdraw(host: Host, letter: Letter) -> Reply:
    """A withdrawal code."""
    _of_our_pages(letter)
    message: Withdrawal = read(Withdrawal, await letter.body(SMALLEST_MESSAGE))
    # Counted before it is looked up: guesses that are sent together are as slow as others.
    if not host.guesses.take(letter.client):
        raise RefusedError(429, "Expected fewer tries; wait a minute.")
    withdrawn = await host.withdraw(message.code)
    if withdrawn:
        host.guesses.give_back(letter.client)
    return Reply({"withdrawn": withdrawn})


HANDLERS: dict[str, Handler] = {
    f"/api/{handler.__name__}": handler for handler in (begin, done, answer, happened, alive, leave, withdraw)
}


class Inbox:
    """Takes the messages; hands every other request on to `app`."""

    def __init__(self, app: ASGIApp, host: Host) -> None:
        self.app, self.host = app, host

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""
        handler = HANDLERS.get(scope["path"].removeprefix(scope["root_path"])) if scope["type"] == "http" else None
        if handler is None:
            await self.app(scope, receive, send)
            return
        status, reply = await self._handle(handler, scope, receive)
        content = to_json(reply.content)
        headers = [(b"content-type", b"application/json"), (b"content-length", b"%d" % len(content))]
        if reply.token is not None:
            headers.append((b"set-cookie", _set_cookie(self.host.cookie, reply.token, scope)))
        await send({"type": "http.response.start", "status": status, "headers": headers})
        await send({"type": "http.response.body", "body": content})

    async def _handle(self, handler: Handler, scope: Scope, receive: Receive) -> tuple[int, Reply]:
        try:
            if scope["method"] != "POST":
                raise RefusedError(405, "Expected a message sent by POST.")
            return 200, await handler(self.host, Letter(scope, dict(scope["headers"]), receive))
        except RefusedError as refusal:
            return refusal.status, Reply({"error": refusal.why})
        except SegueError as refusal:
            log.warning("%s: %r", handler.__name__, str(refusal))
            return 422, Reply({"error": str(refusal)})
        except AWAY as error:
            self.host.database_away(error)
            return 503, Reply({"error": DATABASE_AWAY})


def _same_origin(letter: Letter) -> None:
    origin = letter.headers.get(b"origin")
    if origin is not None and origin.partition(b"://")[2] != letter.headers.get(b"host"):
        raise RefusedError(403, "Expected a request of this site's own pages.")


def _of_our_pages(letter: Letter) -> None:
    _same_origin(letter)
    named = SHORTEST_PAGE <= len(letter.page) <= LONGEST_PAGE
    if not named or letter.headers.get(b"content-type") != b"application/json":
        raise RefusedError(403, "Expected a message of this site's own pages.")


async def _from_participant(host: Host, letter: Letter, largest: int) -> tuple[LiveSession, bytes]:
    """The session of the participant whose page this is, and what the page says."""
    _of_our_pages(letter)
    live = await host.live_session(letter.cookie(host.cookie))
    if live is None:
        raise RefusedError(401, "Expected a participant of this study; open the link again.")
    body = await letter.body(largest)
    await host.refuse_other_tabs(live, letter.page)
    return live, body


def cookie(header: bytes, name: str) -> str:
    """The value of a cookie in a Cookie header; empty where it is not there."""
    for part in header.decode("latin-1").split(";"):
        key, _, value = part.partition("=")
        if key.strip() == name:
            return value.strip()
    return ""


def _set_cookie(name: str, token: str, scope: Scope) -> bytes:
    """A cookie that only this server reads, for this study's addresses only; an empty token deletes it."""
    parts = [f"{name}={token}", f"Max-Age={COOKIE_SECONDS if token else 0}", f"Path={scope['root_path']}/"]
    parts += ["HttpOnly", "SameSite=Strict"]
    return "; ".join(parts + ["Secure"] * (scope["scheme"] == "https")).encode()
