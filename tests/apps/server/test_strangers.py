"""Strangers: bodies that nobody asked for, other sites' names, guesses; what can be told of films before they load."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import socket
import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from serving import TOKEN, Serving, listening, make_host, protocol_of
from starlette.testclient import TestClient

from study.apps.server import connections
from study.apps.server.connections import LARGEST_HEAD
from study.apps.server.films import whole_bytes
from study.apps.server.limits import GUESSES_AT_ONCE, MOST_GUESSERS, SECONDS_A_GUESS, Guesses
from study.apps.server.names import Named, own_names
from study.apps.server.web import make_app
from study.errors import SessionError
from study.experiment.plan import draw_plan
from study.experiment.stimuli.manifest import Manifest
from study.experiment.store.responses import Responses

# Bodies


@pytest.fixture
def port(stimuli: Manifest, responses: Responses) -> Iterator[int]:
    """The whole server, on a port."""
    with listening(make_app(make_host(stimuli, responses))) as port:
        yield port


def head(path: Path, length: Any, *more) -> bytes:
    lines = [f"POST {path} HTTP/1.1", "host: 127.0.0.1", f"content-length: {length}", "content-type: application/json"]
    return "\r\n".join([*lines, "x-segue-page: page-one", *more, "", ""]).encode()


def reply(client: socket.socket) -> Any:
    """Status, headers and body of one reply."""
    got = b""
    while b"\r\n\r\n" not in got:
        part = client.recv(65536)
        assert part, "the connection ended"
        got += part
    top, _, rest = got.partition(b"\r\n\r\n")
    lines = top.decode().split("\r\n")
    headers = {line.split(": ", 1)[0].lower(): line.split(": ", 1)[1] for line in lines[1:]}
    while len(rest) < int(headers["content-length"]):
        rest += client.recv(65536)
    return int(lines[0].split()[1]), headers, rest


def arrive(client: socket.socket) -> Any:
    body = b'{"page": "page-one"}'
    client.sendall(head("/api/begin", len(body)) + body)
    status, headers, _ = reply(client)
    assert status == 200
    return "cookie: " + headers["set-cookie"].split(";")[0]


@pytest.mark.parametrize("path", ["/api/answer", "/api/happened", "/api/done", "/api/alive", "/api/leave"])
def test_nothing_is_read_from_somebody_unknown(connect: Callable[[], socket.socket], path: str) -> None:
    client = connect()
    client.sendall(head(path, 900_000, "cookie: segue-x=y"))
    status, _, said = reply(client)
    assert (status, said) == (200, b"{}") if path == "/api/leave" else status == 401
    # What follows all the same is passed over, and the connection serves on.
    client.sendall(b"x" * 900_000 + head("/api/alive", 2) + b"{}")
    assert reply(client)[0] == 401


@pytest.mark.parametrize(
    ("path", "least", "most"),
    [("/api/begin", 10_000, 100_000), ("/api/withdraw", 300, 4_000), ("/api/alive", 10, 4_000),
     ("/api/happened", 10_000, 100_000), ("/api/done", 10_000, 100_000), ("/api/answer", 300_000, 2_000_000)],
)  # fmt: skip
def test_a_message_may_be_as_long_as_it_needs(
    connect: Callable[[], socket.socket], path: str, least: int, most: int
) -> None:
    client = connect()
    known = arrive(client)
    client.sendall(head(path, most, known))
    status, _, said = reply(client)
    assert (status, b"Expected at most" in said) == (413, True)
    # Without a length beforehand it is measured as it comes.
    chunked = connect()
    chunked.sendall(head(path, 0, known).replace(b"content-length: 0", b"transfer-encoding: chunked"))
    with contextlib.suppress(ConnectionError):
        for _ in range(most // 1000):
            chunked.sendall(b"3e8\r\n" + b" " * 1000 + b"\r\n")
    assert reply(chunked)[0] == 413
    taken = connect()
    taken.sendall(head(path, least, known) + b" " * least)
    assert reply(taken)[0] in (200, 422)


def test_a_form_in_any_script_is_short_enough(serve: Callable[..., Serving]) -> None:
    person = serve().person()
    form = person.done(person.begin())
    assert person.done(form, values={"age": "20", "remark": "😀" * 1000})["kind"] == "instructions"


def test_half_sent_bodies_are_let_go_the_oldest_first(
    connect: Callable[[], socket.socket], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "MOST_BODIES", 1_000_000)
    first = connect()
    known = arrive(first)
    halves = []
    for _ in range(30):
        halves.append(connect())
        halves[-1].sendall(head("/api/answer", 200_000, known) + b"x" * 100_000)
        time.sleep(0.02)
    ended = []
    for client in halves:
        client.settimeout(0.3)
        try:
            ended.append(client.recv(10) == b"")
        except ConnectionResetError:
            ended.append(True)
        except TimeoutError:
            ended.append(False)
    assert ended == sorted(ended, reverse=True)
    assert 18 <= sum(ended) <= 22
    assert connections._bodies.total == sum(connections._bodies.held.values()) <= 1_000_000
    # Those in progress are not affected.
    first.sendall(head("/api/alive", 2, known) + b"{}")
    assert reply(first)[0] == 200
    for client in halves:
        client.close()
    end = time.monotonic() + 5
    while connections._bodies.held and time.monotonic() < end:
        time.sleep(0.01)
    assert (connections._bodies.held, connections._bodies.total) == ({}, 0)


@pytest.mark.parametrize("size", [LARGEST_HEAD + 1_000, 60_000, 100_000, 300_000])
@pytest.mark.parametrize("where", ["one header", "many headers", "address", "cookie", "trailer"])
def test_a_head_is_as_long_as_documented_at_most(connect: Callable[[], socket.socket], size: int, where: str) -> None:
    client = connect()
    many = "".join(f"x-{i}: {'y' * 90}\r\n" for i in range(size // 95))
    post = (
        "POST /api/withdraw HTTP/1.1\r\nhost: 127.0.0.1\r\ncontent-type: application/json\r\nx-segue-page: page-one\r\n"
    )
    request = {
        "one header": f"GET / HTTP/1.1\r\nhost: 127.0.0.1\r\nx: {'y' * size}\r\n\r\n",
        "many headers": f"GET / HTTP/1.1\r\nhost: 127.0.0.1\r\n{many}\r\n",
        "address": f"GET /?{'y' * size} HTTP/1.1\r\nhost: 127.0.0.1\r\n\r\n",
        "cookie": f"GET / HTTP/1.1\r\nhost: 127.0.0.1\r\ncookie: {'y' * size}\r\n\r\n",
        "trailer": f"{post}transfer-encoding: chunked\r\n\r\n1\r\nx\r\n0\r\nx: {'y' * size}\r\n\r\n",
    }[where]  # fmt: skip
    with contextlib.suppress(ConnectionError):
        client.sendall(request.encode())
    try:
        said = client.recv(1000)
    except ConnectionResetError:
        return  # what was still on its way when it was refused
    assert said.startswith(b"HTTP/1.1 400"), said
    assert b"Expected at most 32768 bytes of headers." in said


def test_two_requests_in_one_packet_are_both_answered(connect: Callable[[], socket.socket]) -> None:
    client = connect()
    body = b'{"page": "page-one"}' + b" " * 20_000
    client.sendall((head("/api/begin", len(body), "x: " + "y" * 20_000) + body) * 3)
    assert [reply_of[0] for reply_of in (reply(client), reply(client), reply(client))] == [200] * 3


# Names


@pytest.mark.parametrize(
    ("name", "status"),
    [
        ("127.0.0.1", 200),
        ("127.0.0.1:8000", 200),
        ("192.168.1.7:8000", 200),
        ("[::1]:8000", 200),
        ("[fe80::1]", 200),
        ("localhost", 200),
        ("LOCALHOST.:8000", 200),
        ("study.localhost:8000", 200),
        ("lab.example.org", 200),
        ("Lab.Example.org:443", 200),
        (socket.gethostname(), 200),
        ("lab.example.org.evil.example", 421),
        ("evil.example", 421),
        ("evil.example:8000", 421),
        ("localhost.evil.example", 421),
        ("127.0.0.1.evil.example", 421),
        ("evil.example#127.0.0.1", 421),
        ("127.0.0.1@evil.example", 421),
        ("xlocalhost", 421),
        ("[evil.example]", 421),
        ("", 421),
    ],
)
def test_only_own_names_are_answered(
    stimuli: Manifest, responses: Responses, caplog: pytest.LogCaptureFixture, name: str, status: int
) -> None:
    app = make_app(make_host(stimuli, responses))
    named = Named(app, own_names("127.0.0.1", ["https://lab.example.org/study"]), protocol_of())
    with TestClient(named) as client:
        for path in ("/", "/api/study", "/researcher", "/pages/main.js"):
            answer = client.get(path, headers={"host": name})
            assert answer.status_code == status, path
        headers = {"host": name, "origin": f"http://{name}", "x-segue-page": "page-one"}
        begun = client.post("/api/begin", json={"page": "page-one"}, headers=headers)
        assert begun.status_code == status
    if status == 421:
        assert "There is no study at this address" in answer.text
        assert "evil" not in answer.text
        assert "frame-ancestors 'none'" in answer.headers["content-security-policy"]
        assert "set-cookie" not in begun.headers
        assert caplog.text.count("--public-url") == 1


def test_a_second_host_header_does_not_help(stimuli: Manifest, responses: Responses) -> None:
    named = Named(make_app(make_host(stimuli, responses)), own_names("127.0.0.1"), protocol_of())
    with TestClient(named) as client:
        for pair in (["127.0.0.1", "evil.example"], ["evil.example", "127.0.0.1"]):
            assert client.get("/", headers=[("host", name) for name in pair]).status_code == 421


def test_the_name_that_is_listened_at_and_international_ones_are_own() -> None:
    assert "lab-pc" in own_names("Lab-PC")
    assert "xn--bcher-kva.example" in own_names("0.0.0.0", ["https://bücher.example:8443/a/b"])


@pytest.mark.parametrize(
    "url", ["", "lab.example.org", "ftp://lab.example.org", "https://", "https:///x", "http://[", "x"]
)
def test_a_public_address_that_is_none_is_refused(url: str) -> None:
    with pytest.raises(SessionError, match=r"Expected a public address such as https://lab\.example\.org/study, found"):
        own_names("127.0.0.1", [url])


# Guesses


def test_guesses_are_slow_and_those_of_others_are_not() -> None:
    now = [100.0]
    guesses = Guesses(lambda: now[0])
    assert [guesses.take("a") for _ in range(GUESSES_AT_ONCE + 5)] == [True] * GUESSES_AT_ONCE + [False] * 5
    assert guesses.take("b")
    now[0] += SECONDS_A_GUESS
    assert [guesses.take("a") for _ in range(2)] == [True, False]
    now[0] += 3600
    for _ in range(50):  # a right code is no guess
        assert guesses.take("a")
        guesses.give_back("a")
    # However many addresses guess, they are remembered within limits.
    taken = sum(guesses.take(f"address {i}") for i in range(3 * MOST_GUESSERS))
    assert taken <= MOST_GUESSERS
    assert not guesses.take("one more")
    now[0] += SECONDS_A_GUESS
    assert guesses.take("one more")


def test_withdrawal_codes_can_not_be_guessed_at_speed(serve: Callable[..., Serving]) -> None:
    serving = serve()
    code = (person := serving.person()).until(person.begin(), "done")["withdrawal_code"]
    thief = serving.person()
    tried = [thief.post("/api/withdraw", {"code": f"aaaa-bbbb-cccc-{i:04d}"}) for i in range(20)]
    assert [one.status_code for one in tried] == [200] * GUESSES_AT_ONCE + [429] * (20 - GUESSES_AT_ONCE)
    assert thief.post("/api/withdraw", {"code": code}).status_code == 429
    serving.host.guesses = Guesses()
    assert thief.post("/api/withdraw", {"code": code}).json() == {"withdrawn": True}


def test_guesses_that_are_sent_together_are_counted_each(serve: Callable[..., Serving]) -> None:
    serving = serve()

    async def together() -> Any:
        from study.apps.server.inbox import RefusedError, Request, withdraw

        async def one(number: int) -> Any:
            async def receive() -> dict[Any, Any]:
                return {"type": "http.request", "body": json.dumps({"code": str(number)}).encode()}

            headers = [(b"x-segue-page", b"page-one"), (b"content-type", b"application/json")]
            client = f"2001:db8::{number:x}", 1  # one machine, with all addresses of its network
            scope = {"type": "http", "headers": headers, "client": client}
            try:
                await withdraw(serving.host, Request(scope, receive))
            except RefusedError as refusal:
                return refusal.status
            return 200

        return await asyncio.gather(*(one(number) for number in range(100)))

    found = serving.client.portal.call(together)
    assert (found.count(200), found.count(429)) == (GUESSES_AT_ONCE, 100 - GUESSES_AT_ONCE)


@pytest.mark.parametrize(
    ("given", "status"),
    [(f"Bearer {TOKEN}", 200), (f"bearer {TOKEN}", 200), (TOKEN, 401), (f"Basic {TOKEN}", 401), (f"Bearer{TOKEN}", 401),
     (f"Bearer  {TOKEN}", 401), (f" {TOKEN}", 401), ("Bearer ", 401), ("Bearer", 401), (f"Token {TOKEN}", 401)],
)  # fmt: skip
def test_the_researchers_token_is_a_bearer_token(serve: Callable[..., Serving], given: str, status: int) -> None:
    answer = serve().client.get("/api/researcher/overview", headers={"authorization": given})
    assert answer.status_code == status
    assert (answer.headers.get("www-authenticate") == "Bearer") is (status == 401)


# Films before they are loaded


def test_no_view_and_no_header_tells_identical_films_from_different_ones(
    serve: Callable[..., Serving], stimuli: Manifest
) -> None:
    person = serve().person()
    view = person.until(person.begin(parameters={"participant": "p01"}), "trial")
    plan = draw_plan(protocol_of(), stimuli.pairs, "p01")
    seen = {True: set(), False: set()}
    names = set()
    while view["kind"] != "done":
        films = view.get("films", []) if view["kind"] == "trial" else []
        if len(films) == 2:
            trial = plan.trials[view["trial"] - 1]
            for film in films:
                told = {name: value for name, value in film.items() if name not in ("slot", "url")}
                headers = dict(person.client.head(film["url"]).headers)
                part = dict(person.client.get(film["url"], headers={"range": "bytes=0-0"}).headers)
                names |= {film["url"], headers.pop("etag"), part.pop("etag")}
                seen[trial.stimuli[0] == trial.stimuli[1]].add(json.dumps([told, headers, part], sort_keys=True))
            assert films[0]["url"] != films[1]["url"]
        view = person.step(view)
    assert len(seen[True]) == 1
    assert seen[True] == seen[False]
    assert len(names) % 2 == 0


def test_a_film_is_the_file_and_an_empty_box_that_says_how_many_frames(
    serve: Callable[..., Serving], stimuli: Manifest
) -> None:
    person = serve().person()
    view = person.until(person.begin(parameters={"participant": "p01"}), "trial")
    plan = draw_plan(protocol_of(), stimuli.pairs, "p01")
    frames = {record.id: record.frames for record in stimuli.records}
    whole = whole_bytes(video["bytes"] for video in stimuli.videos.values())
    for film, stimulus in zip(view["films"], plan.trials[0].stimuli, strict=True):
        content = person.client.get(film["url"]).content
        file = stimuli.video(stimulus).read_bytes()
        assert len(content) == film["bytes"] == whole
        assert content.startswith(file)
        box = content[len(file) :]
        assert struct.unpack(">I4s", box[:8]) == (len(box), b"free")
        assert struct.unpack(">I", box[-4:]) == (frames[stimulus],)
        assert not box[8:-4].strip(b"\0")
        for start, stop in ((0, 10), (len(file) - 5, len(file) + 5), (len(file) + 9, whole), (whole - 4, whole)):
            part = person.client.get(film["url"], headers={"range": f"bytes={start}-{stop - 1}"})
            assert part.content == content[start:stop]


# The log


def test_what_strangers_send_does_not_fill_the_log(
    stimuli: Manifest, responses: Responses, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)
    named = Named(make_app(make_host(stimuli, responses)), own_names("127.0.0.1"), protocol_of())
    with TestClient(named) as client:
        for number in range(100):
            client.get("/", headers={"host": f"evil-{number}.example"})
    assert caplog.text.count("was refused") == 20
