"""A small client of WebDriver, spoken over HTTP by WebKitWebDriver: WebKitGTK, the engine of Safari, on Linux."""

from __future__ import annotations

import base64
import json
import os
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from bidi import KEYS
from driving import Driven, ended
from serving import free_port


class WebKitTab(Driven):
    """The only tab of a browser that this driver started; every session of the driver has its own storage."""

    def __init__(self, port: int, browser: Path) -> None:
        self.address = f"http://127.0.0.1:{port}"
        options = {"binary": str(browser), "args": ["--automation"]}
        wanted = {"capabilities": {"alwaysMatch": {"webkitgtk:browserOptions": options}}}
        self.session = self._call("POST", "/session", wanted)["sessionId"]
        self.call("POST", "/window/rect", {"width": 1280, "height": 720})

    def _call(self, method: str, path: str, body: Any = None) -> Any:
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.address + path, data, {"content-type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise AssertionError(f"{method} {path}: {error.read().decode()}") from None

    def call(self, method: str, path: str, body: Any = None) -> Any:
        """A command of this session."""
        return self._call(method, f"/session/{self.session}{path}", body)

    def open(self, address: str) -> None:
        self.call("POST", "/url", {"url": address})

    def reload(self) -> None:
        self.call("POST", "/refresh", {})

    def run(self, script: str) -> Any:
        waiting = (
            f"const done = arguments[0]; (async () => ({script}))().then((v) => done(v ?? null), (e) => done(null));"
        )
        return self.call("POST", "/execute/async", {"script": waiting, "args": []})

    def _perform(self, kind: str, actions: list[dict[str, Any]]) -> None:
        self.call("POST", "/actions", {"actions": [{"type": kind, "id": kind, "actions": actions}]})

    def click_at(self, x: float, y: float, times: int = 1) -> None:
        press = [{"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}]
        move = {"type": "pointerMove", "x": int(x), "y": int(y), "duration": 0}
        self._perform("pointer", [move, *press * times])

    def key(self, key: str) -> None:
        value = KEYS.get(key, key)
        self._perform("key", [{"type": "keyDown", "value": value}, {"type": "keyUp", "value": value}])

    def picture(self, path: Path) -> None:
        path.write_bytes(base64.b64decode(self.call("GET", "/screenshot")))

    def close(self) -> None:
        self._call("DELETE", f"/session/{self.session}")


@contextmanager
def webkit(driver: str, browser: Path, display: str) -> Iterator[WebKitTab]:
    """Start the driver and one browser on a display; end both afterwards."""
    port = free_port()
    process = subprocess.Popen(
        [driver, f"--port={port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        env={**os.environ, "DISPLAY": display},
    )  # fmt: skip
    try:
        _answers(port, process)
        tab = WebKitTab(port, browser)
        try:
            yield tab
        finally:
            tab.close()
    finally:
        ended(process)


def _answers(port: int, process: subprocess.Popen[bytes]) -> None:
    end = time.monotonic() + 30
    while time.monotonic() < end:
        assert process.poll() is None, "WebKitWebDriver ended at once"
        with suppress(OSError), urllib.request.urlopen(f"http://127.0.0.1:{port}/status", timeout=5):
            return
        time.sleep(0.05)
    raise AssertionError("WebKitWebDriver did not start within half a minute")
