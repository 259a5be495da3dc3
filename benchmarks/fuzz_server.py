"""What strangers send to the server, for `fuzz.py`: the bytes of one connection, through uvicorn's parser and ours.

A participant begins, goes some steps on, and then sends something malformed. There is no socket: a transport stands in
for it, and a loop of this process's own is run until the reply is there.
"""

from __future__ import annotations

import asyncio
import functools
import json
import logging
import re
import shutil
import tempfile
from pathlib import Path
from typing import Any

import fuzz_inputs as inputs
import numpy as np
from fuzz_inputs import damaged, pick

Generator = np.random.Generator

TOKEN = "token-of-the-fuzzer-4711"
REPLY_SECONDS = 20.0


class Transport(asyncio.Transport):
    """The other end of a connection: keeps what is sent."""

    def __init__(self) -> None:
        super().__init__({"peername": ("127.0.0.1", 1), "sockname": ("127.0.0.1", 80)})
        self.sent = b""
        self.closed = False

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Bytes for the browser."""
        self.sent += bytes(data)

    def is_closing(self) -> bool:
        """Whether it was closed."""
        return self.closed

    def close(self) -> None:
        """The server ends the connection."""
        self.closed = True

    abort = close

    def pause_reading(self) -> None:
        """Nothing waits to be read here."""

    def resume_reading(self) -> None:
        """Nothing waits to be read here."""


class _Logged(logging.Handler):
    """Keeps what uvicorn logs as an error of the application."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.found: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.found.append(self.format(record))


class _Server:
    """The application, its loop, and connections to it."""

    def __init__(self, results: Path) -> None:
        from uvicorn.server import ServerState

        from study.apps.server.hosting import Host
        from study.apps.server.running import configuration
        from study.apps.server.settings import Settings
        from study.apps.server.web import make_app
        from study.experiment.protocol.whole import load_protocol
        from study.experiment.stimuli.manifest import read_manifest
        from study.experiment.store.responses import open_responses

        folder = Path(tempfile.mkdtemp(prefix="segue-fuzz-")) / "results"
        shutil.copytree(results, folder)
        self.loop = asyncio.new_event_loop()
        self.broken: list[str] = []
        self.loop.set_exception_handler(lambda _, context: self.broken.append(str(context.get("exception", context))))
        host = Host(
            load_protocol(folder / "protocol.toml"),
            read_manifest(folder),
            open_responses(folder),
            Settings(researcher_token=TOKEN),
        )
        self.config = configuration(make_app(host))
        self.config.load()
        self.state = ServerState()
        self.logged = _Logged()
        uvicorn_log = logging.getLogger("uvicorn.error")
        uvicorn_log.addHandler(self.logged)
        uvicorn_log.propagate = False
        logging.getLogger("segue.serve").setLevel(logging.CRITICAL)

    def connect(self) -> tuple[Any, Transport]:
        transport = Transport()
        connection = self.config.http_protocol_class(  # type: ignore[operator]
            config=self.config, server_state=self.state, app_state={}, _loop=self.loop
        )
        connection.connection_made(transport)
        return connection, transport

    def send(self, *pieces: bytes, whole: bool = True) -> bytes:
        """Bytes on a connection of their own; what came back. `whole` waits for a reply."""

        async def talk() -> bytes:
            connection, transport = self.connect()
            for piece in pieces:
                connection.data_received(piece)
                await asyncio.sleep(0)
            end = self.loop.time() + (REPLY_SECONDS if whole else 0.05)
            while not (_is_whole(transport.sent) or transport.closed) and self.loop.time() < end:
                await asyncio.sleep(0.001)
            connection.connection_lost(None)
            for _ in range(3):
                await asyncio.sleep(0)
            return transport.sent

        return self.loop.run_until_complete(talk())


def _is_whole(reply: bytes) -> bool:
    head, parted, body = reply.partition(b"\r\n\r\n")
    length = re.search(rb"content-length: (\d+)", head, re.IGNORECASE)
    return bool(parted) and len(body) >= (int(length[1]) if length else 0)


@functools.cache
def _server(results: Path) -> _Server:
    return _Server(results)


def request(path: str, body: bytes, cookie: str = "", method: str = "POST", page: str = "page-one") -> bytes:
    """A request as a page of ours sends it."""
    lines = [f"{method} {path} HTTP/1.1", "Host: 127.0.0.1:8000", "Content-Type: application/json"]
    lines += [f"X-Segue-Page: {page}", f"Content-Length: {len(body)}", *([f"Cookie: {cookie}"] if cookie else [])]
    return "\r\n".join(lines).encode() + b"\r\n\r\n" + body


def converse(generator: Generator, results: Path) -> int:
    """One participant's conversation, malformed at its end: 0 where it was taken, 2 where it was refused."""
    from fuzz import FaultError

    server = _server(results)
    server.broken.clear()
    server.logged.found.clear()
    reply = server.send(request("/api/begin", json.dumps({"page": "page-one"}).encode()))
    if _status(reply) != 200:
        raise FaultError(f"A sound beginning got HTTP {reply[:300]!r}")
    found = re.search(rb"set-cookie: ([^;]+);", reply, re.IGNORECASE)
    cookie = found[1].decode() if found else ""
    view = _content(reply)
    for _ in range(int(generator.integers(0, 8))):
        path, message = _next(view)
        reply = server.send(request(path, json.dumps(message).encode(), cookie))
        if _status(reply) != 200:
            raise FaultError(f"A sound message to {path} got HTTP {reply[:300]!r}: {message}")
        view = _content(reply)
        if view["kind"] == "finished":
            break
    pieces, whole = _malformed(generator, view, cookie)
    reply = server.send(*pieces, whole=whole)
    status = _status(reply)
    if server.broken or server.logged.found:
        raise FaultError("\n".join([*server.broken, *server.logged.found]))
    if status >= 500 or (whole and not reply):
        raise FaultError(f"HTTP status {status} for {b''.join(pieces)[:600]!r}: {reply[:300]!r}")
    return 0 if status in (0, 200, 304) else 2


def _status(reply: bytes) -> int:
    return int(reply.split(b" ", 2)[1]) if reply.startswith(b"HTTP/") else 0


def _content(reply: bytes) -> Any:
    return json.loads(reply.partition(b"\r\n\r\n")[2])


def _next(view: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """The sound message that follows a view."""
    if view["kind"] == "trial":
        shown = [
            {"slot": film["slot"], "method": "none", "frames_presented": 30, "longest_gap_frames": 1.0,
             "shown_well": True, "times_ms": [1.5, 2.5], "frames": [0, 1]}
            for film in view["films"]
        ]  # fmt: skip
        question = view["question"]
        return "/api/answer", {
            "trial": view["trial"], "attempt": view["attempt"], "item": question["item"], "response_s": 0.5,
            "value": question["options"][0]["value"], "shown_well": True, "shown": shown, "timing": {"a": 1.0},
        }  # fmt: skip
    return "/api/done", {"step": view.get("step", ""), "values": {"age": "33"} if view["kind"] == "form" else {}}


_PATHS = ("begin", "done", "answer", "happened", "alive", "leave", "withdraw")
_STRANGE = (
    None, True, -1, 0, 1e308, 10**30, "", "x", "x" * 5000, [], {}, [[]], {"a": {}}, "\u0000", "\ud800", "=1+1", 0.5,
    "=cmd", [1e308] * 3, {"a" * 100: 1}, "first", "2", "focus-lost", 2**63,
)  # fmt: skip


def _malformed(generator: Generator, view: dict[str, Any], cookie: str) -> tuple[list[bytes], bool]:
    """The pieces in which something malformed is sent, and whether a reply has to come."""
    path, message = _next(view)
    if generator.random() < 0.4:
        path = f"/api/{pick(generator, _PATHS)}"
        message = pick(
            generator,
            (
                message,
                {"kind": "focus-lost", "detail": {"a": 1.0, "b": "x"}},
                {"code": "ABCD-EFGH"},
                {
                    "page": "page-one",
                    "previous": "",
                    "parameters": {"PROLIFIC_PID": "abc"},
                    "display": {"viewport": [1, 2]},
                },
            ),
        )
    how = int(generator.integers(5))
    if how <= 1:
        body = json.dumps(_with_another_value(generator, message)).encode("utf-8", "surrogatepass")
    elif how == 2:
        body = damaged(generator, json.dumps(message).encode())
    elif how == 3:
        size = int(pick(generator, (1000, 100_000)))
        body = pick(
            generator, (b"[" * size, b'{"a":' * size, b'{"step": "' + b"\xff" * size, b"1" * size, b'"' + b"\\" * size)
        )
    else:
        body = json.dumps(message).encode()
    whole_request = request(path, body, cookie)
    if how < 4:
        return [whole_request], True
    return _malformed_request(generator, whole_request, path, body, cookie), False


def _malformed_request(generator: Generator, sound: bytes, path: str, body: bytes, cookie: str) -> list[bytes]:
    """Bytes that are no request of a browser's."""
    how = int(generator.integers(8))
    if how == 0:
        cut = int(generator.integers(1, len(sound)))
        return [sound[:cut]]
    if how == 1:
        return [sound[k : k + 1] for k in range(len(sound))]
    if how == 2:
        head, _, rest = sound.partition(b"\r\n\r\n")
        return [damaged(generator, head) + b"\r\n\r\n" + rest]
    if how == 3:
        return [
            sound.replace(b"\r\n\r\n", b"\r\nX-Long: " + b"x" * int(pick(generator, (40_000, 200_000))) + b"\r\n\r\n")
        ]
    if how == 4:
        return [
            sound.replace(b"Content-Length: ", pick(generator, (b"Content-Length: 9", b"Content-Length: -", b"X: ")))
        ]
    if how == 5:
        chunks = b"Transfer-Encoding: chunked\r\n\r\n5\r\nhello\r\nffffffffffffffff\r\n"
        return [sound.partition(b"Content-Length")[0] + chunks + body]
    if how == 6:
        method = pick(generator, ("GET", "PUT", "HEAD", "OPTIONS", "TRACE", "CONNECT", "POST"))
        place = pick(generator, ("/", "/researcher", "/api/study", "/api/researcher/overview", "/films/..%2f..%2fx.mp4",
                                 "/films/" + "a" * 3000 + ".mp4", "/%00", "/pages/../../x", "//x", path + "/", "*",
                                 "/api/researcher/answers.csv?token=x", "http://elsewhere/"))  # fmt: skip
        return [request(place, b"", cookie, method, page="\x00" if generator.random() < 0.2 else "page-one")]
    return [sound * 3]


def _with_another_value(generator: Generator, message: dict[str, Any]) -> dict[str, Any]:
    """The message with a value of another kind, a key that lacks, or one too many, at any depth."""
    changed = json.loads(json.dumps(message))
    places: list[tuple[Any, Any]] = []

    def walk(part: Any) -> None:
        for key in list(part) if isinstance(part, dict) else range(len(part)) if isinstance(part, list) else ():
            places.append((part, key))
            walk(part[key])

    walk(changed)
    part, key = pick(generator, places)
    how = generator.random()
    if how < 0.7:
        part[key] = pick(generator, _STRANGE)
    elif how < 0.85:
        del part[key]
    elif isinstance(part, dict):
        part[pick(generator, inputs.WORDS)] = pick(generator, _STRANGE)
    return changed
