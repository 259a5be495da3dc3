"""A `segue play` in a process of its own, with keys and clicks from xdotool."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
STORED = re.compile(r"trial (\d+)(?: (\S+))?, showing (\d+): answer stored")


class Playing:
    """A `segue play` process, and what it has said so far."""

    def __init__(self, display: str, *arguments: object) -> None:
        self.env = {**os.environ, "DISPLAY": display}
        self.env.pop("WAYLAND_DISPLAY", None)
        code = "from study.apps.cli import main; main()"
        command = [sys.executable, "-c", code, "play", *map(str, arguments)]
        self.process = subprocess.Popen(
            command, cwd=ROOT, env=self.env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.said: list[str] = []
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.said.append(line.rstrip())

    @property
    def stored(self) -> list[tuple[int, str, int]]:
        """Answers that it said were stored: trial, item, showing."""
        found = [STORED.match(line) for line in self.said]
        return [(int(m[1]), m[2] or "", int(m[3])) for m in found if m]

    @property
    def running(self) -> bool:
        return self.process.poll() is None

    def until(self, done: Any, seconds: float = 60.0) -> None:
        """Wait for something; fails with what was said where it does not come."""
        end = time.monotonic() + seconds
        while not done():
            assert time.monotonic() < end, "\n".join(["it never came; said:", *self.said])
            assert self.running, "\n".join(["it ended; said:", *self.said])
            time.sleep(0.02)

    def opened(self) -> None:
        self.until(lambda: any(line.startswith("display:") for line in self.said), 240.0)

    def do(self, *words: object) -> None:
        """Let xdotool do something; it fails where the window closes under its hands, which is none of our concern."""
        done = subprocess.run(["xdotool", *map(str, words)], env=self.env, check=False, capture_output=True)
        assert done.returncode == 0 or not self.lasts(), done.stderr

    def lasts(self) -> bool:
        """Whether it still runs a moment later."""
        time.sleep(1.0)
        return self.running

    def press_all(self, keys: tuple[str, ...], seconds: float, answers: int = 1_000_000) -> None:
        """Press keys until it ends, so many answers are stored, or the time is over; other pages take no harm."""
        end = time.monotonic() + seconds
        while self.running and time.monotonic() < end and len(self.stored) < answers:
            self.do("key", "--delay", 15, *keys)
            time.sleep(0.03)

    def ended(self) -> str:
        """Its standard output, once it has ended."""
        assert self.process.stdout is not None
        assert self.process.stderr is not None
        out = "" if self.process.stdout.closed else self.process.stdout.read()
        self.process.wait(30)
        self._reader.join(30)
        self.process.stdout.close()
        self.process.stderr.close()
        return out

    def kill(self) -> None:
        self.process.send_signal(signal.SIGKILL)
        self.ended()
