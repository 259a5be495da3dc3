"""Inbox: what the participants' pages send. Messages come in by POST, the next view goes out as JSON.

Answers of many participants arrive at one instant, so this is ASGI without a framework around it: an address is looked
up, a body read, a message checked, a reply sent. All else goes on to the application behind.

A participant is known by a cookie that scripts can't read. A message needs a header that no form of another site can
send, and comes from this site's pages.
"""

from __future__ import annotations

import logging
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

from pydantic_core import to_json
from starlette.types import ASGIApp, Receive, Scope, Send

from study.apps.server.hosting import Host, Sitting
from study.apps.server.messages import LONGEST_PAGE, SHORTEST_PAGE, Answered, Begin, Done, Happened, Withdrawal, read
from study.errors import SegueError
from study.experiment.databases import AWAY

COOKIE_SECONDS = 14 * 24 * 3600
DATABASE_AWAY = "The database can't be reached now; send this again."

log = logging.getLogger("segue.serve")


class RefusedError(Exception):
    """A request that is answered with an error: a status and one sentence."""

    def __init__(self, status: int, why: str) -> None:
        self.status, self.why = status, why
        super().__init__(why)


@dataclass(frozen=True)
class Letter:
    """A message as it arrived: the address that it was sent to, its headers, its body."""

    scope: Scope
    headers: dict[bytes, bytes]
    body: bytes

    @property
    def page(self) -> str:
        """Which tab sent it: a name that the page made up when it was opened."""
        return self.headers.get(b"x-segue-page", b"").decode("latin-1")

    def cookie(self, name: str) -> str:
        """The cookie of a name, or nothing."""
        return cookie(self.headers.get(b"cookie", b""), name)


@dataclass(frozen=True)
class Reply:
    """What goes back; `token` is None to leave the cookie as it is, and empty to delete it."""

    content: Any
    token: str | None = None


Handler = Callable[[Host, Letter], Awaitable[Reply]]


async def begin(host: Host, letter: Letter) -> Reply:
    """A page was opened."""
    _of_our_pages(letter)
    message: Begin = read(Begin, letter.body)
    view, token = await host.begin(letter.cookie(host.cookie), message)
    return Reply(view, token or None)


async def done(host: Host, letter: Letter) -> Reply:
    """A page was read."""
    sitting = await _sitting(host, letter)
    message: Done = read(Done, letter.body)
    view = await host.done(sitting, message)
    return Reply(view, "" if view["kind"] == "declined" else None)


async def answer(host: Host, letter: Letter) -> Reply:
    """A question was answered."""
    sitting = await _sitting(host, letter)
    message: Answered = read(Answered, letter.body)
    return Reply(await host.answer(sitting, message))


async def happened(host: Host, letter: Letter) -> Reply:
    """Something besides answers."""
    sitting = await _sitting(host, letter)
    message: Happened = read(Happened, letter.body)
    await host.happened(sitting, message)
    return Reply({})


async def alive(host: Host, letter: Letter) -> Reply:
    """The page is still there."""
    await _sitting(host, letter)
    return Reply({})


async def leave(host: Host, letter: Letter) -> Reply:
    """The page was closed. A beacon can't carry our header: the page's name is the body, and it can only let go."""
    _same_origin(letter)
    sitting = await host.sitting(letter.cookie(host.cookie))
    if sitting is not None:
        host.leave(sitting, letter.body[:64].decode("latin-1"))
    return Reply({})


async def withdraw(host: Host, letter: Letter) -> Reply:
    """A withdrawal code."""
    _of_our_pages(letter)
    message: Withdrawal = read(Withdrawal, letter.body)
    return Reply({"withdrawn": await host.withdraw(message.code)})


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
            return 200, await handler(self.host, Letter(scope, dict(scope["headers"]), await _body(receive)))
        except RefusedError as refusal:
            return refusal.status, Reply({"error": refusal.why})
        except SegueError as refusal:
            log.warning("%s: %r", handler.__name__, str(refusal))
            return 422, Reply({"error": str(refusal)})
        except AWAY as error:
            self.host.database_away(error)
            return 503, Reply({"error": DATABASE_AWAY})


async def _body(receive: Receive) -> bytes:
    message = await receive()
    body: bytes = message.get("body", b"")
    while message.get("more_body"):
        message = await receive()
        body += message.get("body", b"")
    if message["type"] == "http.disconnect":
        raise RefusedError(400, "Expected the whole message; the connection ended before.")
    return body


def _same_origin(letter: Letter) -> None:
    origin = letter.headers.get(b"origin")
    if origin is not None and origin.partition(b"://")[2] != letter.headers.get(b"host"):
        raise RefusedError(403, "Expected a request of this site's own pages.")


def _of_our_pages(letter: Letter) -> None:
    _same_origin(letter)
    named = SHORTEST_PAGE <= len(letter.page) <= LONGEST_PAGE
    if not named or letter.headers.get(b"content-type") != b"application/json":
        raise RefusedError(403, "Expected a message of this site's own pages.")


async def _sitting(host: Host, letter: Letter) -> Sitting:
    """The sitting of the participant whose page this is."""
    _of_our_pages(letter)
    sitting = await host.sitting(letter.cookie(host.cookie))
    if sitting is None:
        raise RefusedError(401, "Expected a participant of this study; open the link again.")
    if not host.has_tab(sitting, letter.page):
        raise RefusedError(409, "This session is open in another tab.")
    return sitting


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
