"""How long an answer takes when many browsers answer at once: `python benchmarks/serve.py [--browsers 200]`.

With `--servers 2` there are two of them behind nginx, on a PostgreSQL of their own (or `--database`). A server runs in
a process of its own, on a study without films; this process is the browsers, each a connection that stays open. Two
loads: in a `burst` all of them answer at the same instant; in a `spread` each answers once at some time within a
second, as people do. Every answer carries the times of all frames of two films, as a browser's does. A round trip runs
from the send of an answer to the word that it is on disk.

Round by round the same requests go to a peer that does nothing (the same HTTP server, a fixed reply), which shows how
much is HTTP, this process and the machine (it is one process, without nginx). The browsers only send bytes made
beforehand and keep those that come; what they cost is printed too. At the end the servers are killed with SIGKILL, and
every acknowledged answer is looked for in the database, where it has to be once; the exit status is 1 if one is not.
Processor times come from /proc (Linux).
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import re
import secrets
import select
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "apps"), str(ROOT / "tests")]

PROTOCOL = """
name = "load"
title = "Load"
seed = 1
fps = 30
[stimuli]
entry_s = 0.3
exit_s = 0.3
[points]
shortest_frames = 4
longest_frames = 20
[[transitions]]
name = "walk_run"
category = "walking"
source = "walk"
destination = "jog"
[[studies]]
name = "jnd"
task = "same-different"
differences_frames = [-2, 0]
repeats = 20
order = "both"
question = "Same?"
"""

FRAMES = 130
"""Of a film: those of the 2004 protocols last about 4.3 s at 30 frames a second."""

RUN = f"load-{secrets.token_hex(4)}"
"""Names the participants of this run, in a database that may hold others."""

LENGTH = re.compile(rb"content-length: (\d+)", re.IGNORECASE)
Key = tuple[str, int, str, int, str | None]


class Browser:
    """One browser: a connection that stays open, the page that it shows, the request that it sends next."""

    def __init__(self, port: int, number: int) -> None:
        self.name, self.cookie = f"{RUN}-{number:03d}", ""
        self.socket = socket.create_connection(("127.0.0.1", port))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.request, self.reply = b"", bytearray()
        self.key: Key | None = None
        self.acknowledged: list[Key] = []

    def make(self, path: str, body: object) -> bytes:
        """The bytes of a message, with the headers that a browser sends."""
        content = json.dumps(body, separators=(",", ":")).encode()
        head = (
            f"POST {path} HTTP/1.1\r\nhost: 127.0.0.1\r\ncontent-type: application/json\r\naccept: */*\r\n"
            "user-agent: Mozilla/5.0 (X11; Linux x86_64) AppleWebKit/537.36 (KHTML, like Gecko) Chrome/140\r\n"
            "accept-encoding: gzip, deflate, br, zstd\r\naccept-language: en\r\nsec-fetch-site: same-origin\r\n"
            f"x-segue-page: page-of-{self.name}\r\ncookie: {self.cookie}\r\ncontent-length: {len(content)}\r\n\r\n"
        )
        return head.encode() + content

    def send(self) -> None:
        """The request is gone when this returns: it is far smaller than a socket's buffer."""
        self.reply.clear()
        assert self.socket.send(self.request) == len(self.request), "the socket's buffer was full"

    def receive(self) -> bool:
        """Take what came; whether the reply is whole."""
        part = self.socket.recv(65536)
        assert part, "the server closed the connection"
        self.reply += part
        end = self.reply.find(b"\r\n\r\n")
        if end < 0:
            return False
        length = LENGTH.search(self.reply, 0, end)
        assert length, bytes(self.reply)
        return len(self.reply) >= end + 4 + int(length[1])

    def read(self) -> Any:
        """The message in the reply."""
        head, _, content = bytes(self.reply).partition(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 200"), bytes(self.reply)
        for line in head.decode().split("\r\n"):
            if line.lower().startswith("set-cookie: "):
                self.cookie = line.split(": ", 1)[1].split(";")[0]
        return json.loads(content)

    def ask(self, path: str, body: object) -> Any:
        """A message whose reply is waited for."""
        self.request = self.make(path, body)
        self.send()
        while not self.receive():
            pass
        return self.read()

    def begin(self) -> None:
        """Open the page, and make the answer to the first trial ready."""
        link = {"participant": self.name}
        self.prepare(self.ask("/api/begin", {"page": f"page-of-{self.name}", "parameters": link}))

    def prepare(self, view: dict[str, Any]) -> None:
        """Read on to the next trial, and make the request that will answer it."""
        while view["kind"] != "trial":
            assert view["kind"] != "done", "the study has too few trials for so many rounds"
            view = self.ask("/api/done", {"step": view["step"]})
        value = random.choice(view["question"]["options"])["value"]
        self.key = (self.name, view["trial"], view["question"]["item"], view["attempt"], value)
        self.request = self.make("/api/answer", answer_to(view, value))

    def check(self) -> None:
        """After an answer: it was counted; get the next one ready."""
        view = self.read()
        assert view["counted"] is True, view
        assert self.key is not None
        self.acknowledged.append(self.key)
        self.prepare(view)


def answer_to(view: dict[str, Any], value: str) -> dict[str, Any]:
    """What the page's trial.js sends."""
    start = random.uniform(1e4, 1e6)
    times = [round(start + 1000 * i / 30 + random.random(), 3) for i in range(FRAMES)]
    shown = [
        {"slot": film["slot"], "method": "requestVideoFrameCallback", "frames_presented": FRAMES,
         "longest_gap_frames": 1.003, "shown_well": True, "times_ms": times, "frames": list(range(FRAMES))}
        for film in view["films"]
    ]  # fmt: skip
    return {
        "trial": view["trial"],
        "attempt": view["attempt"],
        "item": view["question"]["item"],
        "value": value,
        "response_s": 0.512,
        "shown_well": True,
        "shown": shown,
        "timing": {"last_frame_ms": times[-1], "answer_ms": times[-1] + 512, "time_origin_ms": 1.7e12},
    }


def exchange(browsers: Sequence[Browser], delays_s: Sequence[float]) -> list[float]:
    """Every browser sends its request at its time; the round trips in milliseconds."""
    waiting = sorted(zip(delays_s, range(len(browsers)), strict=True), reverse=True)
    by_file = {browser.socket.fileno(): index for index, browser in enumerate(browsers)}
    sent = [0.0] * len(browsers)
    trips: list[float] = []
    poll = select.epoll()
    for file in by_file:
        poll.register(file, select.EPOLLIN)
    begin = time.perf_counter()
    while len(trips) < len(browsers):
        while waiting and waiting[-1][0] <= time.perf_counter() - begin:
            index = waiting.pop()[1]
            sent[index] = time.perf_counter()
            browsers[index].send()
        rest = waiting[-1][0] - (time.perf_counter() - begin) if waiting else 10.0
        ready = poll.poll(max(rest, 0.0))
        assert ready or waiting, f"{len(browsers) - len(trips)} answers got no reply for ten seconds"
        for file, _ in ready:
            index = by_file[file]
            if browsers[index].receive():
                trips.append(1000 * (time.perf_counter() - sent[index]))
    poll.close()
    return trips


@dataclass
class Measured:
    """One load on one server: the round trips of each round, and processor seconds."""

    rounds: list[list[float]] = field(default_factory=list)
    server_s: float = 0.0
    browsers_s: float = 0.0

    def line(self) -> str:
        """The row of the table."""
        trips = sorted(trip for one in self.rounds for trip in one)
        p50, p95, p99 = (trips[min(len(trips) - 1, len(trips) * share // 100)] for share in (50, 95, 99))
        usual = statistics.median(sorted(one)[len(one) * 99 // 100] for one in self.rounds)
        costs = (1000 * self.server_s / len(trips), 1000 * self.browsers_s / len(trips))
        cells = (p50, p95, p99, trips[-1], usual)
        return (
            f"{len(trips):7d}" + "".join(f"{cell:9.1f}" for cell in cells) + "".join(f"{cost:9.2f}" for cost in costs)
        )


HEAD = f"{'':19s}answers" + "".join(
    f"{name:>9s}" for name in ("p50", "p95", "p99", "worst", "usual99", "server", "browsers")
)


Processes = Sequence[subprocess.Popen[bytes]]


def measure(into: Measured, browsers: Sequence[Browser], processes: Processes, within_s: float) -> None:
    """One round."""
    delays = [random.uniform(0, within_s) for _ in browsers]
    server_s, browsers_s = processor_s(processes), time.process_time()
    into.rounds.append(exchange(browsers, delays))
    into.browsers_s += time.process_time() - browsers_s
    into.server_s += processor_s(processes) - server_s


def processor_s(processes: Processes) -> float:
    """Processor seconds that processes took, in all their threads."""
    stats = [Path(f"/proc/{one.pid}/stat").read_text().rpartition(")")[2].split() for one in processes]
    return sum(int(fields[11]) + int(fields[12]) for fields in stats) / os.sysconf("SC_CLK_TCK")


@contextlib.contextmanager
def started(command: Sequence[str], port: int) -> Iterator[subprocess.Popen[bytes]]:
    """A server in a process of its own; killed at the end, not asked to stop."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path[:3])}
    process = subprocess.Popen([sys.executable, *command], env=environment)
    try:
        while True:
            assert process.poll() is None, "the server ended at once"
            with contextlib.suppress(OSError):
                socket.create_connection(("127.0.0.1", port), timeout=1).close()
                break
            time.sleep(0.05)
        yield process
    finally:
        process.kill()
        process.wait()


def do_nothing(port: int, reply: bytes) -> None:
    """The peer: the same HTTP server as ours, configured alike; reads a request and sends a fixed reply."""
    from study.apps.server.running import listen, serve

    headers = [(b"content-length", str(len(reply)).encode()), (b"content-type", b"application/json")]

    async def app(scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] == "lifespan":
            return
        while (await receive()).get("more_body"):
            pass
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": reply})

    serve(app, listen("127.0.0.1", port))


def load(folder: Path, database: str, count: int, rounds: int, servers: int) -> list[Key]:
    """All rounds, printed; what was acknowledged. The servers are killed at the end."""
    import nginx
    from serving import free_port

    aside, *ports = [free_port() for _ in range(1 + servers)]
    child = str(ROOT / "tests" / "apps" / "server_child.py")
    found = {(pattern, name): Measured() for pattern in ("burst", "spread") for name in ("segue", "does nothing")}
    with contextlib.ExitStack() as stack:
        segue = [stack.enter_context(started([child, str(folder), str(port), database], port)) for port in ports]
        peer = [stack.enter_context(started([__file__, "--do-nothing", str(aside)], aside))]
        address = ports[0] if servers == 1 else stack.enter_context(nginx.proxy(folder, ports, limited=False))
        browsers = []
        for number in range(count):  # one after another: a server does not wait long for a first request
            browsers.append(Browser(address, number))
            browsers[-1].begin()
        others = [Browser(aside, number) for number in range(count)]
        for _ in range(rounds):
            for pattern, within_s in (("burst", 0.0), ("spread", 1.0)):
                for browser, other in zip(browsers, others, strict=True):
                    other.request = browser.request
                measure(found[pattern, "segue"], browsers, segue, within_s)
                measure(found[pattern, "does nothing"], others, peer, within_s)
                for browser in browsers:
                    browser.check()
    print(f"round trips in ms; the last two columns are processor ms an answer\n{HEAD}")
    for (pattern, name), measured in found.items():
        print(f"{pattern:7s}{name:12s}{measured.line()}")
    return [key for browser in browsers for key in browser.acknowledged]


def lost(database: str, acknowledged: Sequence[Key]) -> int:
    """How many of the acknowledged answers are not in the database, or are there twice."""
    from study.experiment.store.frames import answers_frame
    from study.experiment.store.responses import open_responses

    columns = ["participant", "trial", "item", "attempt", "answer"]
    with open_responses(database) as responses:
        table = answers_frame(responses, all_attempts=True)[columns]
    stored = [tuple(row) for row in table.itertuples(index=False) if row.participant.startswith(RUN)]
    missing = len(set(acknowledged) - set(stored))
    double = len(stored) - len(set(stored))
    print(f"{len(acknowledged)} acknowledged, {len(stored)} stored after SIGKILL, {missing} lost, {double} twice")
    return missing + double


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--browsers", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--servers", type=int, default=1)
    parser.add_argument("--database", metavar="URL", help="an empty PostgreSQL database, instead of a SQLite file")
    parser.add_argument("--do-nothing", type=int, metavar="PORT", help="be the peer at this port")
    options = parser.parse_args()
    if options.do_nothing:
        do_nothing(options.do_nothing, b'{"kind":"nothing","text":"%s"}' % (b"x" * 1000))
        return 0
    from postgres_server import PostgresServer, find_binaries
    from serving import unfilmed

    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        database = options.database or str(folder / "responses.sqlite")
        if options.servers > 1 and not options.database:
            binaries = find_binaries()
            assert binaries is not None, "PostgreSQL is installed"
            server = PostgresServer(binaries)
            stack.callback(server.remove)
            database = server.url("study")
        unfilmed(folder, PROTOCOL)
        return int(lost(database, load(folder, database, options.browsers, options.rounds, options.servers)) > 0)


if __name__ == "__main__":
    sys.exit(main())
