"""Inbox: what the participants' pages send. Messages come in by POST, the next view goes out as JSON.

A participant is known by a cookie that scripts can't read. A message needs a header that no form of another site can
send, and comes from this site's pages. Who sends it is looked up before its body is read, and each kind of message may
be as long as it needs.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

from pydantic_core import to_json
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

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

COOKIE_SECONDS = 14 * 24 * 3600

LARGEST_ANSWER = 1_000_000
"""Bytes; the frame times of a pair of ten seconds at 240 frames a second are 60,000."""

LARGEST_MESSAGE = 32_000
"""Bytes of messages without frame times; what a form may hold is added to it."""

LARGEST_FIELD = 6_200
"""Bytes of one field of the form: a thousand characters, as JSON may write them."""

SMALLEST_MESSAGE = 1_000
"""Bytes of messages without content."""


Handler = Callable[[Host, Request], Awaitable[Response]]


async def begin(host: Host, request: Request) -> Response:
    """A page was opened."""
    _of_our_pages(request)
    message: Begin = read(Begin, await _body(request, LARGEST_MESSAGE))
    view, token = await host.begin(request.cookies.get(host.cookie, ""), message)
    reply = _reply(view)
    return _give_cookie(host, request, reply, token) if token else reply


async def done(host: Host, request: Request) -> Response:
    """A page was read."""
    forms = [host.protocol.form, *(study.form for study in host.protocol.studies)]
    largest = LARGEST_MESSAGE + LARGEST_FIELD * max(map(len, forms))
    live, body = await _from_participant(host, request, largest)
    message: Done = read(Done, body)
    view = await host.done(live, message)
    reply = _reply(view)
    return _give_cookie(host, request, reply, "") if view["kind"] == "declined" else reply


async def answer(host: Host, request: Request) -> Response:
    """A question was answered."""
    live, body = await _from_participant(host, request, LARGEST_ANSWER)
    message: Answered = read(Answered, body)
    return _reply(await host.answer(live, message))


async def happened(host: Host, request: Request) -> Response:
    """Another event than a response."""
    live, body = await _from_participant(host, request, LARGEST_MESSAGE)
    message: Happened = read(Happened, body)
    await host.happened(live, message)
    return _reply({})


async def alive(host: Host, request: Request) -> Response:
    """The page is still there."""
    await _from_participant(host, request, SMALLEST_MESSAGE)
    return _reply({})


async def leave(host: Host, request: Request) -> Response:
    """The page was closed. A beacon can't carry our header: its body is the page's name, and it only ends the hold."""
    _same_origin(request)
    if token := request.cookies.get(host.cookie, ""):
        await host.leave(token, (await _body(request, SMALLEST_MESSAGE)).decode("latin-1"))
    return _reply({})


async def withdraw(host: Host, request: Request) -> Response:
    """A withdrawal code."""
    _of_our_pages(request)
    message: Withdrawal = read(Withdrawal, await _body(request, SMALLEST_MESSAGE))
    # Counted before it is looked up: guesses that are sent together are as slow as others.
    if not host.guesses.take(_client(request)):
        raise RefusedError(429, "Expected fewer tries; wait a minute.")
    withdrawn = await host.withdraw(message.code)
    if withdrawn:
        host.guesses.give_back(_client(request))
    return _reply({"withdrawn": withdrawn})


def message_routes(host: Host) -> list[Route]:
    """Where pages send their messages."""
    handlers: tuple[Handler, ...] = (begin, done, answer, happened, alive, leave, withdraw)
    return [Route(f"/api/{one.__name__}", partial(one, host), methods=["POST"]) for one in handlers]


async def _body(request: Request, largest: int) -> bytes:
    """What a request says; refused as soon as it is longer than that, at best before anything is read."""
    length = request.headers.get("content-length", "0")
    if len(length) > 12 or not length.isdecimal() or int(length) > largest:
        raise RefusedError(413, f"Expected at most {largest} bytes.")
    body = bytearray()
    async for part in request.stream():
        body += part
        if len(body) > largest:
            raise RefusedError(413, f"Expected at most {largest} bytes.")
    return bytes(body)


def _client(request: Request) -> str:
    """The address that it came from; of IPv6 the network, in which one machine has as many as it likes."""
    host = request.client.host if request.client else ""
    return str(ipaddress.ip_network((host, 64), strict=False)) if ":" in host else host


def _page(request: Request) -> str:
    """Which tab sent it: a name that the page made up when it was opened."""
    return request.headers.get("x-segue-page", "")


def _reply(content: Any) -> Response:
    return Response(to_json(content), media_type="application/json")


def _give_cookie(host: Host, request: Request, reply: Response, token: str) -> Response:
    """A cookie that only this server reads, for this study's addresses only; an empty token deletes it."""
    reply.set_cookie(
        host.cookie,
        token,
        max_age=COOKIE_SECONDS if token else 0,
        path=f"{request.scope['root_path']}/",
        secure=request.url.scheme == "https",
        httponly=True,
        samesite="strict",
    )
    return reply


def _same_origin(request: Request) -> None:
    origin = request.headers.get("origin")
    if origin is not None and origin.partition("://")[2] != request.headers.get("host"):
        raise RefusedError(403, "Expected a request of this site's own pages.")


def _of_our_pages(request: Request) -> None:
    _same_origin(request)
    named = SHORTEST_PAGE <= len(_page(request)) <= LONGEST_PAGE
    if not named or request.headers.get("content-type") != "application/json":
        raise RefusedError(403, "Expected a message of this site's own pages.")


async def _from_participant(host: Host, request: Request, largest: int) -> tuple[LiveSession, bytes]:
    """The session of the participant whose page this is, and what the page says."""
    _of_our_pages(request)
    live = await host.live_session(request.cookies.get(host.cookie, ""))
    if live is None:
        raise RefusedError(401, "Expected a participant of this study; open the link again.")
    body = await _body(request, largest)
    await host.refuse_other_tabs(live, _page(request))
    return live, body
