"""A small study to serve, participants who speak to the server without a browser, and a server in a thread."""

from __future__ import annotations

import contextlib
import hashlib
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import uvicorn
from starlette.testclient import TestClient

from study.apps.server.hosting import Host
from study.apps.server.running import configuration
from study.apps.server.settings import Settings
from study.apps.server.web import make_app
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.stimuli.manifest import Manifest, read_manifest, record
from study.experiment.stimuli.prepare import prepare
from study.experiment.stimuli.rendering import RenderAhead, known_beforehand
from study.experiment.store.responses import Responses, open_responses
from study.motion.library import open_library

TOKEN = "token-of-the-researcher-4711"

PROTOCOL = """\
name = "served"
title = "How movements join"
fps = 30
seed = 5

[consent]
text = "Do you take part?"

[[form]]
name = "age"
label = "Your age"
kind = "number"
least = 18
required = true

[[form]]
name = "remark"
label = "Anything else"

[stimuli]
width = 160
height = 120
entry_s = 0.3
exit_s = 0.3

[timing]
gap_s = 0.1
pause_s = 0.1
answer_s = 3.0
break_after = 3

[points]
shortest_frames = 4
longest_frames = 20

[texts]
welcome = "Thank you for taking part."
debrief = "That was about passages."

[[transitions]]
name = "walk_run"
category = "walking"
source = "walk"
destination = "jog"

[[studies]]
name = "jnd"
task = "same-different"
reference = "geodesic"
differences_frames = [-2, 0]
order = "both"
question = "Were they the same?"
instructions = "Say whether they were the same."
practice = 1
attention_checks = 1

[[studies]]
name = "liking"
task = "preference"
instructions = ""
reference = "geodesic"
comparison = "fixed"
order = "by-group"
question = "Which was more natural?"

[[studies]]
name = "rating"
task = "rating"
instructions = ""
reference = "geodesic"
comparison = "cut"
order = "by-group"

[[studies.items]]
name = "natural"
question = "How natural was it?"
low = "not at all"
high = "very"

[[studies.items]]
name = "noticeable"
question = "How noticeable was the passage?"

[[studies]]
name = "compared"
task = "rating"
instructions = ""
show = "pair"
reference = "geodesic"
comparison = "cut"
order = "by-group"

[[studies.items]]
name = "better"
question = "Compared with the first, the second was:"
low = "much worse"
middle = "the same"
high = "much better"
"""

QUESTIONS = 1 + 4 + 1 + 1 + 2 * 2 + 1


def protocol_of(text: str = PROTOCOL) -> Protocol:
    return parse_protocol(text)


@cache
def prepared(text: str = PROTOCOL) -> Any:
    return prepare(protocol_of(text), open_library("synthetic"))


def unfilmed(folder: Path, text: str = PROTOCOL) -> Manifest:
    """A results folder whose films are noise: all that a client without a screen needs."""
    record(prepared(text), folder)
    return served_manifest(folder)


def served_manifest(folder: Path) -> Manifest:
    """The manifest of such a folder; its films are made where they are missing."""
    manifest = read_manifest(folder)
    videos = {}
    for number, stimulus in enumerate(manifest.records):
        content = bytes([number]) * (1000 + number)
        (folder / "stimuli" / f"{stimulus.id}.mp4").write_bytes(content)
        videos[stimulus.id] = {
            "file": f"stimuli/{stimulus.id}.mp4", "bytes": len(content), "frames": stimulus.frames,
            "file_sha256": hashlib.sha256(content).hexdigest(), "frames_sha256": "",
        }  # fmt: skip
    return replace(manifest, videos=videos)


def make_host(
    manifest: Manifest,
    responses: Responses,
    text: str = PROTOCOL,
    *,
    ahead: RenderAhead | None = None,
    **settings: Any,
) -> Host:
    return Host(protocol_of(text), manifest, responses, Settings(researcher_token=TOKEN, **settings), ahead)


@dataclass
class Person:
    """A participant without a browser."""

    client: TestClient
    page: str = "page-one"
    sent: list[dict[str, Any]] = field(default_factory=list)

    def post(self, path: str, body: Any, page: str | None = None, **headers: str) -> Any:
        return self.client.post(
            path, json=body, headers={"x-segue-page": page or self.page, "content-type": "application/json", **headers}
        )

    def begin(self, page: str | None = None, **more: Any) -> dict[str, Any]:
        self.page = page or self.page
        answer = self.post("/api/begin", {"page": self.page, **more})
        assert answer.status_code == 200, answer.text
        return answer.json()

    def done(self, view: dict[str, Any], **more: Any) -> dict[str, Any]:
        if view["kind"] == "form":
            asked = {field["name"] for field in view["fields"]}
            more.setdefault("values", {"age": "33"} if "age" in asked else {})
        answer = self.post("/api/done", {"step": view["step"], **more})
        assert answer.status_code == 200, answer.text
        return answer.json()

    def answer(self, view: dict[str, Any], value: str | None = "", **more: Any) -> dict[str, Any]:
        message = answer_to(view, value, **more)
        self.sent.append(message)
        answer = self.post("/api/answer", message)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def step(self, view: dict[str, Any]) -> dict[str, Any]:
        return self.answer(view) if view["kind"] == "trial" else self.done(view)

    def until(self, view: dict[str, Any], *kinds: str) -> dict[str, Any]:
        while view["kind"] not in kinds:
            view = self.step(view)
        return view


class Serving:
    """A server in this process, without sockets; `person()` is a participant with own cookies."""

    def __init__(self, manifest: Manifest, responses: Responses, root_path: str = "", **settings: Any) -> None:
        self.host = make_host(manifest, responses, **settings)
        self.root_path = root_path
        self.client = TestClient(make_app(self.host), root_path=root_path)
        self.client.__enter__()

    def person(self, page: str = "page-one") -> Person:
        fresh = TestClient(self.client.app, root_path=self.root_path)
        fresh.portal = self.client.portal
        return Person(fresh, page)

    def ask(self, path: str, token: str = TOKEN) -> Any:
        """As the researcher."""
        return self.client.get(f"/api/researcher/{path}", headers={"authorization": f"Bearer {token}"})


def answer_to(view: dict[str, Any], value: str | None = "", **more: Any) -> dict[str, Any]:
    """A message that answers a trial's view; the first legal answer unless given."""
    sliders = len(view["films"]) if view.get("layout") == "side by side" else 1
    first, *_ = [option["value"] for option in view["question"]["options"]] or [" ".join(["0"] * sliders)]
    return {
        "trial": view["trial"],
        "attempt": view["attempt"],
        "item": view["question"]["item"],
        "value": first if value == "" else value,
        "response_s": 0.5,
        "shown_well": True,
        "shown": [
            {"slot": film["slot"], "method": "none", "frames_presented": 20, "longest_gap_frames": 1.0,
             "shown_well": True, "times_ms": [1.5, 2.5], "frames": [0, 1]}
            for film in view["films"]
        ],
        **more,
    }  # fmt: skip


class Site:
    """A server on a port of this machine, in a thread; it can be stopped and started, and can be made to go wrong."""

    def __init__(self, folder: Path, text: str = PROTOCOL, *, on_demand: bool = False, **settings: Any) -> None:
        """`on_demand` takes away the films of levels that depend on answers; they are rendered as they are due."""
        self.folder, self.text, self.settings, self.on_demand = folder, text, settings, on_demand
        if on_demand:
            for film in (folder / "stimuli").glob("*.mp4"):
                if film.stem not in known_beforehand(protocol_of(text), read_manifest(folder).pairs):
                    film.unlink()
        self.port = free_port()
        self.address = f"http://127.0.0.1:{self.port}"
        self.film_fault: str | None = None
        self.films_served = 0
        self.start()

    def start(self) -> None:
        self.responses = open_responses(self.folder)
        ahead = RenderAhead(prepared(self.text), self.folder, 1) if self.on_demand else None
        self.host = make_host(read_manifest(self.folder), self.responses, self.text, ahead=ahead, **self.settings)
        app = make_app(self.host)

        async def faulty(scope: Any, receive: Any, send: Any) -> None:
            if scope["type"] == "http" and scope["path"].startswith("/films/"):
                self.films_served += 1
                send = _spoilt(send, self)
            await app(scope, receive, send)

        config = uvicorn.Config(
            faulty, host="127.0.0.1", port=self.port, log_level="error", access_log=False, timeout_graceful_shutdown=1
        )
        self.server = uvicorn.Server(config)
        self.thread = threading.Thread(target=self.server.run, daemon=True)
        self.thread.start()
        end = time.monotonic() + 30
        while not self.server.started:
            assert time.monotonic() < end, "the server did not start"
            time.sleep(0.01)

    def stop(self) -> None:
        self.server.should_exit = True
        self.thread.join(30)
        self.responses.close()


def _spoilt(send: Any, site: Site) -> Any:
    """`truncated` films end early, as whole answers; `stalled` ones stop half-way and never end."""
    import asyncio

    held: list[dict[str, Any]] = []

    async def spoil(message: dict[str, Any]) -> None:
        if site.film_fault is None:
            await send(message)
            return
        if message["type"] == "http.response.start":
            held.append(message)
            return
        body = message.get("body", b"")
        half = body[: len(body) // 2]
        if site.film_fault == "truncated":
            if held:
                start = held.pop()
                kept = [(name, value) for name, value in start["headers"] if name.lower() != b"content-length"]
                await send({**start, "headers": [*kept, (b"content-length", str(len(half)).encode())]})
                await send({"type": "http.response.body", "body": half})
            return
        if held:
            await send(held.pop())
            await send({"type": "http.response.body", "body": half, "more_body": True})
            while site.film_fault is not None:
                await asyncio.sleep(0.05)

    return spoil


@contextlib.contextmanager
def listening(app: Any, **settings: Any) -> Iterator[int]:
    """The port of a server as `segue serve` starts it, in a thread; `settings` are uvicorn's."""
    config = configuration(app)
    config.host, config.port = "127.0.0.1", free_port()
    for name, value in settings.items():
        setattr(config, name, value)
    server = uvicorn.Server(config)
    thread = threading.Thread(target=server.run)
    thread.start()
    end = time.monotonic() + 20
    while not server.started:
        assert time.monotonic() < end, "the server did not start"
        time.sleep(0.01)
    yield config.port
    server.should_exit = True
    thread.join(20)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
