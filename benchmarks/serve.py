"""How long an answer takes when many browsers answer at once: `python benchmarks/serve.py [--clients 200]`.

A server runs in a process of its own, on a study without films; the clients are connections of this process. Two
loads are measured: `spread`, where every client answers once within each second, and `burst`, where all of them
answer at the same instant, again and again. An answer's round trip ends when the server says that it is on disk. At
the end every acknowledged answer is looked for in the database.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import random
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "apps")]

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


class Client:
    """One browser's connection."""

    def __init__(self, port: int, number: int) -> None:
        self.port, self.page, self.cookie = port, f"page-of-client-{number}", ""
        self.view: dict[str, Any] = {}
        self.times: list[float] = []
        self.acknowledged = 0

    async def open(self) -> None:
        """Connect, begin, and read on to the first trial."""
        self.reader, self.writer = await asyncio.open_connection("127.0.0.1", self.port)
        self.view = await self.post("/api/begin", {"page": self.page})
        while self.view["kind"] != "trial":
            self.view = await self.post("/api/done", {"step": self.view["step"]})

    async def post(self, path: str, body: object) -> dict[str, Any]:
        """One message and its answer."""
        content = json.dumps(body).encode()
        head = (
            f"POST {path} HTTP/1.1\r\nhost: 127.0.0.1:{self.port}\r\ncontent-type: application/json\r\n"
            f"x-segue-page: {self.page}\r\ncookie: {self.cookie}\r\ncontent-length: {len(content)}\r\n\r\n"
        )
        self.writer.write(head.encode() + content)
        answer = (await self.reader.readuntil(b"\r\n\r\n")).decode()
        headers = dict(line.split(": ", 1) for line in answer.split("\r\n")[1:] if ": " in line)
        if "set-cookie" in headers:
            self.cookie = headers["set-cookie"].split(";")[0]
        result: dict[str, Any] = json.loads(await self.reader.readexactly(int(headers["content-length"])))
        assert answer.startswith("HTTP/1.1 200"), result
        return result

    async def answer(self) -> None:
        """Answer the trial that is due, and keep the time until it was acknowledged."""
        view = self.view
        times = [33.3 * i for i in range(40)]
        shown = [
            {"place": film["place"], "method": "requestVideoFrameCallback", "frames_presented": film["frames"],
             "longest_gap_frames": 1.0, "shown_well": True, "times_ms": times, "frames": list(range(40))}
            for film in view["films"]
        ]  # fmt: skip
        value = random.choice(view["question"]["options"])["value"]
        message = {"trial": view["trial"], "attempt": 1, "value": value, "response_s": 0.5, "shown": shown}
        start = time.perf_counter()
        self.view = await self.post("/api/answer", message)
        self.times.append(1000 * (time.perf_counter() - start))
        assert self.view["counted"] is True
        self.acknowledged += 1


def percentiles(label: str, clients: list[Client]) -> dict[str, float]:
    times = sorted(one for client in clients for one in client.times)
    for client in clients:
        client.times = []
    found = {f"p{share}": times[min(len(times) - 1, len(times) * share // 100)] for share in (50, 95, 99)}
    found["worst"] = times[-1]
    print(f"{label:7s} {len(times)} answers: " + ", ".join(f"{k} {v:.1f} ms" for k, v in found.items()))
    return found


async def load(port: int, count: int, rounds: int) -> int:
    clients = [Client(port, number) for number in range(count)]
    for client in clients:
        await client.open()

    async def within_a_second(client: Client) -> None:
        await asyncio.sleep(random.random())
        await client.answer()

    for _ in range(rounds):
        await asyncio.gather(*(within_a_second(client) for client in clients))
    percentiles("spread", clients)
    for _ in range(rounds):
        await asyncio.gather(*(client.answer() for client in clients))
        await asyncio.sleep(0.2)
    percentiles("burst", clients)
    return sum(client.acknowledged for client in clients)


def main() -> None:
    from serving import free_port, unfilmed

    from study.experiment.responses import answers_frame, open_responses

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clients", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=15)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder, port = Path(name), free_port()
        unfilmed(folder, PROTOCOL)
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path[:2])}
        command = [sys.executable, str(ROOT / "tests" / "apps" / "server_child.py"), str(folder), str(port)]
        child = subprocess.Popen(command, env=environment)
        try:
            while True:
                try:
                    urllib.request.urlopen(f"http://127.0.0.1:{port}/api/study", timeout=1).close()
                    break
                except OSError:
                    time.sleep(0.05)
            acknowledged = asyncio.run(load(port, options.clients, options.rounds))
        finally:
            child.terminate()
            child.wait()
        with open_responses(folder) as responses:
            stored = len(answers_frame(responses, all_attempts=True))
        print(f"{acknowledged} acknowledged, {stored} stored, {acknowledged - stored} lost")


if __name__ == "__main__":
    main()
