"""What every driven browser can do: wait, read, click, press keys. One class per browser adds how it is spoken to."""

from __future__ import annotations

import json
import subprocess
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any


class Driven(ABC):
    """One tab of a real browser."""

    @abstractmethod
    def open(self, address: str) -> None:
        """Go to an address."""

    @abstractmethod
    def reload(self) -> None:
        """Load the page again."""

    @abstractmethod
    def run(self, script: str) -> Any:
        """The value of an expression in the page; promises are waited for, and what it throws is an AssertionError."""

    @abstractmethod
    def click_at(self, x: float, y: float, times: int = 1) -> None:
        """A real click at a place of the viewport; with `times=2` a double click."""

    @abstractmethod
    def key(self, key: str) -> None:
        """Press a key and let it go: a character, `Enter` or `Tab`."""

    @abstractmethod
    def picture(self, path: Path) -> None:
        """A screenshot, as PNG."""

    def text(self) -> str:
        return self.run("document.body ? document.body.innerText : ''") or ""

    def wait(self, script: str, timeout: float = 60, every: float = 0.05) -> Any:
        """Wait until an expression is true."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            try:
                if value := self.run(script):
                    return value
            except AssertionError:
                pass  # between two documents
            time.sleep(every)
        raise AssertionError(f"waited {timeout} s in vain for {script}; the page says: {self.text()!r}")

    def wait_text(self, text: str, timeout: float = 60) -> None:
        self.wait(f"document.body && document.body.innerText.includes({json.dumps(text)})", timeout)

    def click(self, text: str) -> None:
        """A real click, at the middle of the button or link with a text, as soon as it is there."""
        end = time.monotonic() + 60
        while not self.try_click(text):
            assert time.monotonic() < end, f"no {text!r} to click; the page says: {self.text()!r}"
            time.sleep(0.05)

    def try_click(self, text: str, times: int = 1) -> bool:
        """The same, where it is there now."""
        where = self.run(
            "(() => { const b = [...document.querySelectorAll('button, a')].find("
            f"(b) => !b.disabled && b.innerText.includes({json.dumps(text)}));"
            "if (!b) return null; const r = b.getBoundingClientRect();"
            "return [r.x + r.width / 2, r.y + r.height / 2]; })()"
        )
        if where:
            self.click_at(*where, times=times)
        return bool(where)


def ended(process: subprocess.Popen[bytes]) -> None:
    """End a browser that was started here."""
    process.terminate()
    try:
        process.wait(3)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def until(found: Callable[[], Any], process: subprocess.Popen[bytes], name: str) -> Any:
    """What a browser tells once it has started."""
    end = time.monotonic() + 60
    while not (value := found()):
        assert process.poll() is None, f"{name} ended at once"
        assert time.monotonic() < end, f"{name} did not start within a minute"
        time.sleep(0.05)
    return value
