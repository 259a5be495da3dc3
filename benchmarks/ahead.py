"""How long participants wait for films that are rendered on demand: `python benchmarks/ahead.py [--minutes 5]`.

`segue serve` runs on `blend_length_quest` in a new folder: the levels of QUEST+ are rendered while sessions run. Two
participants (`--people`) go through it over HTTP at a person's pace: films are watched for their own time, with the gap
between two; what follows is loaded during the question, which is answered at random after one to three seconds. A wait
runs from an answer to the last byte of the next trial's films, beside the pause after which the next trial is due.
Printed are the median and the 99th percentile, how many were longer than the pause, and how many films were rendered.
"""

from __future__ import annotations

import argparse
import http.client
import json
import random
import re
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

FORM = {"age": "30", "vision": "well, without glasses or lenses"}


class Participant(threading.Thread):
    """One person in front of a page."""

    def __init__(self, port: int, name: str, until: float) -> None:
        super().__init__()
        self.port, self.name, self.until = port, name, until
        self.cookie, self.waits = "", list[float]()
        self.rng = random.Random(name)
        self.films: dict[str, Future[bytes]] = {}
        self.loading = ThreadPoolExecutor(6)

    def send(self, method: str, path: str, body: object = None) -> bytes:
        """One request; the whole reply."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        headers = {"content-type": "application/json", "cookie": self.cookie, "x-segue-page": f"page-of-{self.name}"}
        connection.request(method, path, None if body is None else json.dumps(body), headers)
        reply = connection.getresponse()
        content = reply.read()
        assert reply.status == 200, (path, reply.status, content)
        if cookie := reply.getheader("set-cookie"):
            self.cookie = cookie.split(";")[0]
        connection.close()
        return content

    def ask(self, path: str, body: object) -> dict[str, Any]:
        """A message of the page; the view that comes back."""
        return json.loads(self.send("POST", path, body))

    def load(self, films: list[dict[str, Any]]) -> list[Future[bytes]]:
        """Films under way, each asked for once."""
        return [
            self.films.setdefault(film["url"], self.loading.submit(self.send, "GET", f"/{film['url']}"))
            if film["url"] not in self.films
            else self.films[film["url"]]
            for film in films
        ]

    def run(self) -> None:
        """Go through the session until its end or that of the time."""
        begin = {"page": f"page-of-{self.name}", "parameters": {"participant": self.name}}
        view = self.ask("/api/begin", begin)
        answered = None
        while time.monotonic() < self.until and view["kind"] != "done":
            if view["kind"] != "trial":
                time.sleep(2)  # of reading
                view = self.ask("/api/done", {"step": view["step"], "values": FORM if view["kind"] == "form" else {}})
                answered = None
                continue
            sizes = [future.result() for future in self.load(view["films"])]
            if answered is not None:
                self.waits.append(time.monotonic() - answered)
                time.sleep(max(0.0, view["pause_s"] - self.waits[-1]))
            # The last four bytes of what is sent are the film's frames.
            seconds = [int.from_bytes(film[-4:]) / view["fps"] for film in sizes]
            time.sleep(sum(seconds) + view["gap_s"] * (len(seconds) - 1))
            self.films = {url: made for url, made in self.films.items() if url in {one["url"] for one in view["ahead"]}}
            self.load(view["ahead"])
            time.sleep(self.rng.uniform(1, 3))
            shown = [
                {"slot": film["slot"], "method": "ended", "frames_presented": 1, "longest_gap_frames": 1.0,
                 "shown_well": True, "times_ms": [], "frames": []} for film in view["films"]
            ]  # fmt: skip
            answer = {
                "trial": view["trial"], "attempt": view["attempt"], "item": view["question"]["item"],
                "value": self.rng.choice(view["question"]["options"])["value"], "response_s": 1.0,
                "shown_well": True, "shown": shown, "timing": {},
            }  # fmt: skip
            answered = time.monotonic()
            view = self.ask("/api/answer", answer)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--minutes", type=float, default=5)
    parser.add_argument("--people", type=int, default=2)
    parser.add_argument("--protocol", default="blend_length_quest")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "study.apps.cli", "serve", asked.protocol, "--out", folder, "--port", "0"]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        try:
            lines = iter(server.stdout or ())
            port = next(
                int(found[1]) for line in lines if (found := re.search(r"participants +http://.*?:(\d+)", line))
            )
            threading.Thread(target=lambda: [None for _ in lines], daemon=True).start()
            before, until = len(list(Path(folder, "stimuli").glob("*.mp4"))), time.monotonic() + 60 * asked.minutes
            people = [Participant(port, f"p{number:02}", until) for number in range(asked.people)]
            for person in people:
                person.start()
            for person in people:
                person.join()
            videos = sorted(Path(folder, "stimuli").glob("*.mp4"))
            manifest = json.loads(Path(folder, "manifest.json").read_text(encoding="utf-8"))
        finally:
            server.terminate()
            server.wait()
    waits = sorted(wait for person in people for wait in person.waits)
    late = sum(wait > 1.0 for wait in waits)
    print(f"{len(waits)} waits: median {waits[len(waits) // 2]:.2f} s, 99th percentile "
          f"{waits[min(len(waits) - 1, int(0.99 * len(waits)))]:.2f} s, longest {waits[-1]:.2f} s; {late} over the "
          f"pause of 1 s")  # fmt: skip
    print(f"{before} of {len(manifest['stimuli'])} films were rendered beforehand, {len(videos) - before} meanwhile")


if __name__ == "__main__":
    main()
