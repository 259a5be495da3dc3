"""Server or database are killed at random moments: acknowledged answers are there, none twice, and sessions go on."""

from __future__ import annotations

import http.client
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import nginx
import pytest
import sqlalchemy as sa
from parts import unavailable
from postgres_server import PostgresServer
from serving import answer_to, free_port, unfilmed

from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import open_responses
from study.experiment.store.tables import events, participants

ROLES = ("trial", "practice", "check")
CLIENTS = 3


@dataclass
class Client:
    """A participant who answers as fast as can be and sends again what was not acknowledged."""

    address: str
    number: int
    stop: threading.Event
    cookie: str = ""
    finished: int = 0
    acknowledged: list[tuple[str, int, str, int, str | None]] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)

    @property
    def page(self) -> str:
        return f"page-of-client-{self.number}"

    def post(self, path: str, body: object) -> dict[str, object]:
        """Until the server has it."""
        headers = {
            "content-type": "application/json",
            "x-segue-page": f"page-of-client-{self.number}",
            "cookie": self.cookie,
        }
        request = urllib.request.Request(f"{self.address}{path}", json.dumps(body).encode(), headers)
        while not self.stop.is_set():
            try:
                with urllib.request.urlopen(request, timeout=5) as response:
                    if cookie := response.headers.get("set-cookie"):
                        self.cookie = cookie.split(";")[0]
                    return json.loads(response.read())
            except urllib.error.HTTPError as refusal:
                if refusal.code in (502, 503):  # the database or a server is away: pages send again
                    time.sleep(0.05)
                    continue
                self.wrong.append(f"{path}: {refusal.code} {refusal.read()!r}")
                self.stop.set()
            except (OSError, ValueError, http.client.HTTPException):
                time.sleep(0.01)
        return {}

    def run(self) -> None:
        while not self.stop.is_set():
            self.cookie = ""
            name = f"c{self.number}-{self.finished}"
            view = self.post("/api/begin", {"page": self.page, "parameters": {"participant": name}})
            if view.get("kind") == "taken":
                # The session was begun, and the server was killed before its cookie arrived.
                self.finished += 1
                continue
            while view and view["kind"] != "done":
                if view["kind"] == "trial":
                    message = answer_to(view, random.choice(view["question"]["options"])["value"])
                    view = self.post("/api/answer", message)
                    if view:
                        if view["counted"] is not True:
                            self.wrong.append(f"{name}: {message['trial']} was not counted")
                        key = (name, message["trial"], message["item"], message["attempt"], message["value"])
                        self.acknowledged.append(key)
                else:
                    values = {"age": "33"} if view["kind"] == "form" else {}
                    view = self.post("/api/done", {"step": view["step"], "values": values})
            self.finished += bool(view)


@dataclass
class Running:
    """A server in a process of its own."""

    folder: Path
    port: int
    database: str

    def __post_init__(self) -> None:
        self.start()

    def start(self) -> None:
        here = Path(__file__).parents[1]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join((str(here), str(here.parents[1])))}
        command = [sys.executable, str(here / "server_child.py"), str(self.folder), str(self.port), self.database]
        self.child = subprocess.Popen(command, env=environment)
        wait_for(self.answers)

    def answers(self) -> bool:
        assert self.child.poll() is None, "the server ended at once"
        try:
            urllib.request.urlopen(f"http://127.0.0.1:{self.port}/api/study", timeout=1).close()
        except OSError:
            return False
        return True

    def kill(self) -> None:
        os.kill(self.child.pid, signal.SIGKILL)
        self.child.wait()

    def kill_and_start(self) -> None:
        self.kill()
        self.start()


def wait_for(what: Callable[[], bool]) -> None:
    end = time.monotonic() + 60
    while not what():
        assert time.monotonic() < end, "waited for a minute"
        time.sleep(0.02)


def run_clients(
    folder: Path,
    database: str,
    kills: int,
    kill: Callable[[Running], object],
    ports: Sequence[int] = (),
    address: int = 0,
) -> None:
    """Serve a study while clients answer, kill again and again, then look at what is stored.

    With several `ports` there are as many servers, behind a proxy at the port `address`.
    """
    unfilmed(folder)
    ports = ports or (free_port(),)
    port, stop = address or ports[0], threading.Event()
    clients = [Client(f"http://127.0.0.1:{port}", number, stop) for number in range(CLIENTS)]
    threads = [threading.Thread(target=client.run) for client in clients]
    dice = random.Random(5)
    running = [Running(folder, own, database) for own in ports]
    for thread in threads:
        thread.start()
    try:
        for _ in range(kills):
            time.sleep(dice.uniform(0.02, 0.6))
            before = sum(len(client.acknowledged) for client in clients)
            kill(dice.choice(running))
            wait_for(lambda: sum(len(client.acknowledged) for client in clients) > before + 3 or stop.is_set())  # noqa: B023
        time.sleep(0.3)
    finally:
        stop.set()
        for thread in threads:
            thread.join()
        for server in running:
            server.kill()
    assert [wrong for client in clients for wrong in client.wrong] == []
    compare([key for client in clients for key in client.acknowledged], database, kills)


def compare(acknowledged: list[tuple[str, int, str, int, str | None]], database: str, kills: int) -> None:
    """What was acknowledged is stored, once, with at most what each client had under way besides."""
    assert len(acknowledged) > 3 * kills
    with open_responses(database) as responses:
        table = answers_frame(responses, roles=ROLES, all_attempts=True)
    columns = ["participant", "trial", "item", "attempt", "answer"]
    stored = [tuple(row) for row in table[columns].itertuples(index=False)]
    print(f"{kills} kills, {len(acknowledged)} acknowledged answers, {len(stored)} stored")
    assert len({row[:4] for row in stored}) == len(stored)
    assert set(acknowledged) <= set(stored)
    assert len(acknowledged) == len(set(acknowledged))
    assert len(stored) - len(acknowledged) <= CLIENTS * 2
    number, finished = participants.c.group_number, events.c.kind == "finished"
    with open_responses(database) as responses, responses.engine.connect() as connection:
        groups = [connection.execute(sa.select(sa.func.count()).where(number == one)).scalar_one() for one in (0, 1)]
        ended = connection.execute(sa.select(events.c.session_id).where(finished)).scalars().all()
    assert max(groups) - min(groups) <= 1
    assert 0 < len(ended) == len(set(ended))


@pytest.mark.parametrize("kills", [4, pytest.param(200, marks=pytest.mark.slow)])
def test_acknowledged_answers_survive_kills_of_the_server(tmp_path: Path, database: str, kills: int) -> None:
    run_clients(tmp_path, database, kills, Running.kill_and_start)


@pytest.mark.parametrize("kills", [2, pytest.param(50, marks=pytest.mark.slow)])
def test_two_servers_behind_nginx_lose_nothing_when_one_is_killed(
    tmp_path: Path, postgres_url: str, kills: int
) -> None:
    """Each message goes to the server whose turn it is, so a session is at both of them all the time."""
    if nginx.program() is None:
        unavailable("nginx", "install it (Debian, Ubuntu: apt install nginx-light)")
    ports = free_port(), free_port()
    with nginx.proxy(tmp_path, ports, sticky=False) as address:
        run_clients(tmp_path, postgres_url, kills, Running.kill_and_start, ports, address)


@pytest.mark.parametrize("kills", [2, pytest.param(50, marks=pytest.mark.slow)])
def test_sessions_go_on_when_postgresql_is_killed_and_started_again(
    tmp_path: Path, postgres_server: PostgresServer, postgres_url: str, kills: int
) -> None:
    """The server of pages runs on: it tells them to send again, and connects anew."""

    def kill(_: Running) -> None:
        postgres_server.kill()
        time.sleep(0.2)
        postgres_server.start()

    run_clients(tmp_path, postgres_url, kills, kill)
