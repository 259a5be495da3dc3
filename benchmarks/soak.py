"""Whether a server that runs for long takes ever more memory: `python benchmarks/soak.py [--minutes 30]`.

`segue serve` runs in a process of its own. Participants arrive one after another at a steady rate; each goes through a
whole session over real connections as a browser does: it loads every film, tells every ten seconds that it is there,
loses the focus now and then, and sends answers with the times of all frames. Some reload their page on the way, and
some leave in the middle for good, with a word or without. The researcher's page looks on every five seconds.

The resident memory of the server is read from /proc (Linux) every five seconds. After the warm-up (a fifth of the time)
it has to stay flat: the exit status is 1 where its median in the last third is more than the limit above that of the
first third, or where a session went wrong.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import random
import re
import secrets
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "benchmarks")]

from serve import PROTOCOL, answer_to  # noqa: E402

TOKEN = secrets.token_urlsafe(32)
EVERY_S = 5.0
LENGTH = re.compile(rb"content-length: (\d+)", re.IGNORECASE)


class Left(Exception):  # noqa: N818 - no mistake: people leave
    """A participant who leaves in the middle."""


class Participant:
    """One participant: a connection that stays open, a page, a cookie."""

    def __init__(self, port: int, seconds: float, leaves_after: int) -> None:
        self.port, self.leaves_after = port, leaves_after
        self.pause_s = seconds / 90  # between two steps, of which a session has about so many
        self.page, self.cookie = secrets.token_hex(16), ""
        self.alive_at = time.monotonic()

    @contextlib.asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        """While the page is open."""
        self.reader, self.writer = await asyncio.open_connection("127.0.0.1", self.port, limit=2**22)
        try:
            yield
        finally:
            self.writer.close()

    async def request(self, line: str, body: bytes = b"") -> bytes:
        """The content of one reply."""
        head = (
            f"{line} HTTP/1.1\r\nhost: 127.0.0.1\r\ncontent-type: application/json\r\nx-segue-page: {self.page}\r\n"
            f"cookie: {self.cookie}\r\nuser-agent: Mozilla/5.0 (X11; Linux)\r\ncontent-length: {len(body)}\r\n\r\n"
        )
        self.writer.write(head.encode() + body)
        top = await self.reader.readuntil(b"\r\n\r\n")
        assert b" 200 " in top.split(b"\r\n", 1)[0], top
        if found := re.search(rb"set-cookie: ([^;]+)", top, re.IGNORECASE):
            self.cookie = found[1].decode()
        length = LENGTH.search(top)
        assert length, top
        return await self.reader.readexactly(int(length[1]))

    async def say(self, path: str, body: object) -> Any:
        """A message, and what comes back."""
        return json.loads(await self.request(f"POST /api/{path}", json.dumps(body).encode()))

    async def session(self) -> None:
        """A whole session, or as much of it as this participant takes part in."""
        async with self.connected():
            await self.request("GET /")
            view = await self.say("begin", {"page": self.page})
            steps = 0
            while view["kind"] != "done":
                await asyncio.sleep(random.uniform(0.5, 1.5) * self.pause_s)
                view = await self.step(view)
                steps += 1
                if steps == self.leaves_after:
                    if random.random() < 0.5:
                        await self.request("POST /api/leave", self.page.encode())
                    raise Left
                if random.random() < 0.01:
                    previous, self.page = self.page, secrets.token_hex(16)
                    view = await self.say("begin", {"page": self.page, "previous": previous})

    async def step(self, view: dict[str, Any]) -> dict[str, Any]:
        """One page or trial."""
        if time.monotonic() - self.alive_at > 10:
            self.alive_at = time.monotonic()
            await self.say("alive", {})
        if random.random() < 0.05:
            await self.say("happened", {"kind": "focus-lost", "detail": {"how": "blur", "at_ms": 1.0}})
        if view["kind"] != "trial":
            return dict(await self.say("done", {"step": view["step"]}))
        for film in view["films"]:
            content = await self.request(f"GET /{film['url']}")
            assert len(content) == film["bytes"]
        value = random.choice(view["question"]["options"])["value"]
        after = await self.say("answer", answer_to(view, value))
        assert after["counted"] is True, after
        return dict(after)


class Load:
    """All participants, and how they fared."""

    def __init__(self, port: int, options: argparse.Namespace) -> None:
        self.port, self.options = port, options
        self.finished = self.left = self.broken = 0

    async def one(self) -> None:
        """One participant."""
        leaves = random.randrange(2, 60) if random.random() < self.options.drop_outs else -1
        try:
            await Participant(self.port, self.options.session_seconds, leaves).session()
            self.finished += 1
        except Left:
            self.left += 1
        except (AssertionError, OSError, asyncio.IncompleteReadError) as error:
            self.broken += 1
            print(f"a session went wrong: {error!r}", flush=True)

    async def arrivals(self, end: float) -> None:
        """Participants at a steady rate, and the last ones to their end."""
        async with asyncio.TaskGroup() as group:
            while time.monotonic() < end:
                group.create_task(self.one())
                await asyncio.sleep(random.uniform(0.5, 1.5) * 60 / self.options.sessions_a_minute)


def megabytes(pid: int) -> float:
    """Resident memory."""
    status = Path(f"/proc/{pid}/status").read_text()
    return int(re.search(r"VmRSS:\s+(\d+) kB", status)[1]) / 1000  # type: ignore[index]


def looked_on(port: int) -> None:
    """What the researcher's page asks for."""
    request = urllib.request.Request(f"http://127.0.0.1:{port}/api/researcher/overview")
    request.add_header("authorization", f"Bearer {TOKEN}")
    with urllib.request.urlopen(request, timeout=30) as reply:
        reply.read()


async def measure(process: subprocess.Popen[bytes], load: Load, minutes: float) -> list[tuple[float, float]]:
    """Seconds since the start, and megabytes."""
    begin = time.monotonic()
    arrivals = asyncio.create_task(load.arrivals(begin + 60 * minutes))
    found: list[tuple[float, float]] = []
    while not arrivals.done():
        await asyncio.sleep(EVERY_S)
        assert process.poll() is None, "the server ended"
        await asyncio.to_thread(looked_on, load.port)
        found.append((time.monotonic() - begin, megabytes(process.pid)))
        if len(found) % 12 == 0:
            at, now = found[-1]
            print(f"{at / 60:5.1f} min  {now:7.1f} MB  {load.finished} finished, {load.left} left", flush=True)
    await arrivals
    return [one for one in found if one[0] <= 60 * minutes]


def growth(found: list[tuple[float, float]], warm_up_s: float) -> float:
    """By how much the memory of the last third is above that of the first third, after the warm-up."""
    warm = [now for at, now in found if at >= warm_up_s]
    third = max(1, len(warm) // 3)
    first, last = statistics.median(warm[:third]), statistics.median(warm[-third:])
    low, high = min(warm), max(warm)
    print(
        f"after the warm-up {first:.1f} MB in the first third, {last:.1f} in the last, {low:.1f} to {high:.1f} in all"
    )
    return last - first


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--sessions-a-minute", type=float, default=20.0)
    parser.add_argument("--session-seconds", type=float, default=60.0, help="how long a session takes")
    parser.add_argument("--drop-outs", type=float, default=0.2, help="share of those who leave in the middle")
    parser.add_argument("--most-growth-mb", type=float, default=5.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        protocol = Path(name) / "load.toml"
        protocol.write_text(PROTOCOL)
        command = [
            sys.executable,
            "-m",
            "study.apps.cli",
            "serve",
            str(protocol),
            "--out",
            f"{name}/out",
            "--port",
            "0",
        ]
        environment = {**os.environ, "SEGUE_RESEARCHER_TOKEN": TOKEN, "PYTHONPATH": str(ROOT)}
        said = Path(name) / "said"
        with said.open("w") as log:
            process = subprocess.Popen(command, env=environment, stderr=log)
        try:
            while not (at := re.search(r"participants .*:(\d+)/", said.read_text())):
                assert process.poll() is None, said.read_text()
                time.sleep(0.1)
            load = Load(int(at[1]), options)
            found = asyncio.run(measure(process, load, options.minutes))
        finally:
            process.kill()
            process.wait()
    more = growth(found, 60 * options.minutes / 5)
    print(
        f"{load.finished} sessions finished, {load.left} left in the middle, {load.broken} went wrong; {more:+.1f} MB"
    )
    return int(more > options.most_growth_mb or load.broken > 0)


if __name__ == "__main__":
    sys.exit(main())
