"""Dry run: one simulated participant goes through the real server, over HTTP, films and all; nothing is kept.

A protocol and its results folder come in; what happened goes out, or a `SessionError` that says where it went wrong.
"""

from __future__ import annotations

import json
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from http.cookiejar import CookieJar
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import HTTPCookieProcessor, Request, build_opener

import uvicorn

from study.apps.server.hosting import Host
from study.apps.server.running import configuration, listen
from study.apps.server.settings import Settings
from study.apps.server.web import make_app
from study.counting import counted
from study.errors import SessionError
from study.experiment.observers import knowing, person, respond
from study.experiment.protocol.texts import FormField
from study.experiment.protocol.whole import Protocol
from study.experiment.session import near
from study.experiment.stimuli.manifest import read_manifest
from study.experiment.stimuli.rendering import RenderAhead
from study.experiment.store.frames import ROLES, answers_frame
from study.experiment.store.responses import open_responses
from study.tasks.observer import default_observer

START_SECONDS = 20.0
PAGE = "dry-run-page"


@dataclass(frozen=True)
class Walked:
    """What a dry run did."""

    pages: int
    answers: int
    films: int
    megabytes: float
    seconds: float

    def __str__(self) -> str:
        films = f"{counted(self.films, 'film')} ({self.megabytes:.1f} MB)"
        return (
            f"dry run: {counted(self.pages, 'page')} read, {counted(self.answers, 'answer')} given and stored, {films} "
            f"loaded in {self.seconds:.0f} s; all of it was deleted again"
        )


class _Browser:
    """Sends what a page sends, with its cookie."""

    def __init__(self, address: str) -> None:
        self.address, self._opener = address, build_opener(HTTPCookieProcessor(CookieJar()))

    def get(self, path: str) -> bytes:
        return self._answer(Request(f"{self.address}/{path}"))

    def post(self, path: str, body: dict[str, Any]) -> dict[str, Any]:
        headers = {"content-type": "application/json", "x-segue-page": PAGE}
        request = Request(f"{self.address}/api/{path}", json.dumps(body).encode(), headers)
        return dict(json.loads(self._answer(request)))

    def _answer(self, request: Request) -> bytes:
        try:
            with self._opener.open(request, timeout=60) as reply:
                return bytes(reply.read())
        except HTTPError as error:
            said = error.read().decode(errors="replace")[:300]
            raise SessionError(f"Expected the server to take {request.full_url}, found {error.code}: {said}") from error


def walk_through(
    protocol: Protocol, folder: Path, settings: Settings, ahead: Callable[[], RenderAhead] | None = None
) -> Walked:
    """Serve a results folder on a free port of this machine, with a database of its own, and go through a session.

    Raises
    ------
    SessionError
        Where the server refuses something, or stored other answers than were given.
    """
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as place, open_responses(Path(place)) as responses:
        host = Host(protocol, read_manifest(folder), responses, settings, ahead and ahead())
        listening = listen("127.0.0.1", 0)
        server = uvicorn.Server(configuration(make_app(host)))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        try:
            while not server.started:
                if time.monotonic() - began > START_SECONDS or not thread.is_alive():
                    raise SessionError("Expected the server to start, found that it did not.")
                time.sleep(0.02)
            browser = _Browser(f"http://127.0.0.1:{listening.getsockname()[1]}")
            pages, given, films, size = _session(browser, host, protocol)
            stored = len(answers_frame(responses, all_attempts=True, roles=ROLES).groupby(["trial", "item", "attempt"]))
        finally:
            server.should_exit = True
            thread.join()
    if stored != given["choices"]:
        raise SessionError(f"Expected {counted(given['choices'], 'answer')} in the database, found {stored}.")
    return Walked(pages, given["all"], films, size / 1e6, time.monotonic() - began)


def _session(browser: _Browser, host: Host, protocol: Protocol) -> tuple[int, dict[str, int], int, int]:
    """Page after page to the end: pages read, answers given, films loaded and their bytes."""
    who = person(knowing(default_observer(), protocol), "dry-run", protocol.seed)
    browser.get("api/study")
    view = browser.post("begin", {"page": PAGE})
    pages, films, size, given = 0, 0, 0, {"all": 0, "choices": 0}
    while view["kind"] != "done":
        if view["kind"] != "trial":
            pages += 1
            values = {field["name"]: _filled(FormField(**field)) for field in view.get("fields", ())}
            view = browser.post("done", {"step": view["step"], "values": values})
            continue
        for film in view["films"]:
            films, size = films + 1, size + len(browser.get(film["url"]))
        # What a participant sees of a trial is not in the view: the observer looks it up where the server has it.
        state = next(iter(host.live_sessions.values())).state
        step = next(one for one in near(state)[0] if one.kind == "answer" and one.item == view["question"]["item"])
        value, response_s = respond(who, state.trial(step.trial), step)
        about = {"trial": step.trial, "attempt": step.attempt, "item": step.item}
        shown = [{"slot": film["slot"], "method": "dry run", "shown_well": True} for film in view["films"]]
        view = browser.post("answer", {**about, "value": value, "response_s": response_s, "shown": shown})
        given = {"all": given["all"] + 1, "choices": given["choices"] + (step.item != "confidence")}
    return pages, given, films, size


def _filled(field: FormField) -> str:
    """Something that a field takes."""
    if field.kind == "choice":
        return field.choices[0]
    if field.kind == "number":
        return f"{next((value for value in (field.least, field.most) if value is not None), 1):g}"
    return "dry run"
