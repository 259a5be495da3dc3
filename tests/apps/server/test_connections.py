"""Clients that are slow, silent or endless, on real sockets: they are let go, and nobody else waits for them."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from serving import listening

from study.apps.server import connections, running

LARGE = b"x" * 20_000_000


async def app(scope: Any, receive: Any, send: Any) -> None:
    """Reads a request; says how long its body was, or sends far more than a socket holds."""
    if scope["type"] != "http":
        return
    length, more = 0, True
    while more:
        message = await receive()
        length += len(message.get("body", b""))
        more = message.get("more_body", False)
    body = LARGE if scope["path"] == "/large" else b"%d" % length
    headers = [(b"content-length", b"%d" % len(body))]
    await send({"type": "http.response.start", "status": 200, "headers": headers})
    await send({"type": "http.response.body", "body": body})


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A server that waits a third of a second for a request, and a second and a half for a reply to be taken."""
    monkeypatch.setattr(connections, "REQUEST_SECONDS", 0.3)
    monkeypatch.setattr(connections, "REPLY_SECONDS", 1.5)
    monkeypatch.setattr(running, "MOST_CONNECTIONS", 150)
    with listening(app, lifespan="off") as port:
        yield port


def ended(client: socket.socket) -> bool:
    """Whether the server ended the connection, without a reply."""
    try:
        return client.recv(1000) == b""
    except ConnectionResetError:
        return True


def ask(client: socket.socket, body: bytes = b"four") -> Any:
    client.sendall(b"POST / HTTP/1.1\r\nhost: x\r\ncontent-length: %d\r\n\r\n%b" % (len(body), body))
    return client.recv(1000)


def trickle(client: socket.socket, pieces: Any, seconds: float = 3.0) -> bool:
    """Send piece after piece until the connection breaks; whether it did."""
    begin = time.monotonic()
    for piece in pieces:
        try:
            client.sendall(piece)
        except OSError:
            return True
        if time.monotonic() - begin > seconds:
            return False
        time.sleep(0.05)
    return False


def test_who_says_nothing_is_let_go(connect: Callable[[], socket.socket]) -> None:
    assert ended(connect())


def test_a_request_that_comes_byte_by_byte_is_let_go(connect: Callable[[], socket.socket]) -> None:
    head = b"GET / HTTP/1.1\r\nhost: x\r\n" + b"x-slow: y\r\n" * 20
    assert trickle(connect(), (head[i : i + 1] for i in range(len(head))))


def test_a_body_that_comes_byte_by_byte_is_let_go(connect: Callable[[], socket.socket]) -> None:
    client = connect()
    client.sendall(b"POST / HTTP/1.1\r\nhost: x\r\ncontent-length: 1000\r\n\r\n")
    assert trickle(client, [b"x"] * 1000)


@pytest.mark.parametrize("piece", [b"x-more: " + b"y" * 900 + b"\r\n", b"y" * 900], ids=["many", "one"])
def test_endless_headers_are_refused(connect: Callable[[], socket.socket], piece: bytes) -> None:
    client = connect()
    client.sendall(b"GET / HTTP/1.1\r\nhost: x\r\nx-first: ")
    sent = 0
    with contextlib.suppress(ConnectionError):
        while sent < 3_000_000:
            client.sendall(piece)
            sent += len(piece)
    # What the kernel holds between the two ends is sent before the refusal is seen.
    assert sent < 3_000_000
    with contextlib.suppress(ConnectionResetError):
        assert client.recv(100).startswith(b"HTTP/1.1 400")


def test_headers_of_a_usual_length_are_taken(connect: Callable[[], socket.socket]) -> None:
    client = connect()
    cookies = b"cookie: " + b"a" * 20_000
    client.sendall(b"GET / HTTP/1.1\r\nhost: x\r\n" + cookies + b"\r\n\r\n")
    assert client.recv(1000).startswith(b"HTTP/1.1 200")


def test_who_does_not_take_the_reply_is_let_go(connect: Callable[[], socket.socket]) -> None:
    client = connect()
    client.sendall(b"GET /large HTTP/1.1\r\nhost: x\r\n\r\n")
    time.sleep(2.0)
    taken = 0
    with contextlib.suppress(ConnectionResetError):
        while part := client.recv(1_000_000):
            taken += len(part)
    assert taken < len(LARGE)


def test_an_idle_connection_serves_again(connect: Callable[[], socket.socket]) -> None:
    client = connect()
    assert ask(client).endswith(b"\r\n\r\n4")
    time.sleep(0.6)
    assert ask(client, b"seven !").endswith(b"\r\n\r\n7")


def test_nobody_waits_for_the_slow_ones(connect: Callable[[], socket.socket]) -> None:
    slow = [connect() for _ in range(100)]
    for client in slow:
        client.sendall(b"GET / HTTP/1.1\r\nho")
    assert ask(connect()).startswith(b"HTTP/1.1 200")
    assert all(ended(client) for client in slow)


def test_nonsense_is_refused(connect: Callable[[], socket.socket]) -> None:
    for nonsense in (b"\x16\x03\x01\x02\x00\x01\x00", b"GET\r\n\r\n", b"POST / HTTP/1.1\r\ncontent-length: x\r\n\r\n"):
        client = connect()
        client.sendall(nonsense)
        reply = client.recv(1000)
        assert reply == b"" or reply.startswith(b"HTTP/1.1 400"), nonsense


def test_more_connections_than_are_taken_are_told_to_come_again(
    connect: Callable[[], socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "REQUEST_SECONDS", 30.0)
    kept = [connect() for _ in range(149)]
    late = connect()
    assert ask(late).startswith(b"HTTP/1.1 503")
    for client in kept:
        client.close()
    end = time.monotonic() + 10
    while not ask(connect()).startswith(b"HTTP/1.1 200"):
        assert time.monotonic() < end, "places were not given back"
        time.sleep(0.05)
