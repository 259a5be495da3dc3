"""A small client of Chromium's DevTools protocol: enough to open tabs, press keys, click, read pages, take pictures."""

from __future__ import annotations

import base64
import json
import os
import signal
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from driving import Driven, ended, until
from websockets.sync.client import ClientConnection, connect

FLAGS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0", "--no-first-run", "--mute-audio",
    "--disable-dev-shm-usage", "--disable-extensions", "--disable-background-networking", "--disable-sync",
    "--disable-component-update", "--no-default-browser-check", "--hide-scrollbars",
    # Several tabs share a test machine's cores: none of them may be slowed down for being in the back.
    "--disable-background-timer-throttling", "--disable-renderer-backgrounding",
    "--disable-backgrounding-occluded-windows",
)  # fmt: skip

KEYS = {"Enter": 13, " ": 32, "Tab": 9}


def _code(key: str) -> int:
    return KEYS.get(key, ord(key.upper()[0]))


class Tab(Driven):
    """One tab; calls wait for their answers."""

    def __init__(self, browser: Browser, target: str, context: str) -> None:
        self.browser, self.target, self.context = browser, target, context
        self.open_things = ExitStack()
        self.socket: ClientConnection = self.open_things.enter_context(
            connect(f"ws://127.0.0.1:{browser.port}/devtools/page/{target}", max_size=None, ping_interval=None)
        )
        self.number = 0
        self.closed = False
        self.events: list[dict[str, Any]] = []
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, timeout: float = 30, **params: Any) -> dict[str, Any]:
        self.number += 1
        number = self.number
        self.socket.send(json.dumps({"id": number, "method": method, "params": params}))
        end = time.monotonic() + timeout
        while True:
            message = json.loads(self.socket.recv(timeout=max(0.1, end - time.monotonic())))
            if message.get("id") == number:
                assert "error" not in message, f"{method}: {message['error']}"
                return message["result"]
            if "method" in message:
                self.events.append(message)
            if message.get("method") == "Page.javascriptDialogOpening":
                # A page that asks whether one really wants to leave: one does.
                self.number += 1
                accept = {"id": self.number, "method": "Page.handleJavaScriptDialog", "params": {"accept": True}}
                self.socket.send(json.dumps(accept))

    def open(self, address: str) -> None:
        self.call("Page.navigate", url=address)

    def reload(self) -> None:
        self.run("window.beforeReload = true")
        self.call("Page.reload")
        # The command returns before the page is gone; what is asked of it meanwhile may get no answer.
        self.wait("!window.beforeReload")

    def run(self, script: str) -> Any:
        answer = self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def click_at(self, x: float, y: float, times: int = 1) -> None:
        for count in range(1, times + 1):
            for kind in ("mousePressed", "mouseReleased"):
                self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=count)

    def key(self, key: str) -> None:
        self.key_down(key)
        self.key_up(key)

    def key_down(self, key: str, *, repeated: bool = False) -> None:
        """Press a key; `repeated` is what a keyboard sends of a key that is held down."""
        text = "\r" if key == "Enter" else key if len(key) == 1 else ""
        self.call(
            "Input.dispatchKeyEvent", type="keyDown", key=key, text=text, windowsVirtualKeyCode=_code(key),
            autoRepeat=repeated,
        )  # fmt: skip

    def key_up(self, key: str) -> None:
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key, windowsVirtualKeyCode=_code(key))

    def picture(self, path: Path) -> None:
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def size(self, width: int, height: int) -> None:
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def complaints(self) -> list[str]:
        """What the page threw or the browser refused."""
        found = []
        for event in self.events:
            if event["method"] == "Runtime.exceptionThrown":
                details = event["params"]["exceptionDetails"]
                found.append(details.get("exception", {}).get("description") or details["text"])
            if event["method"] == "Log.entryAdded" and event["params"]["entry"]["level"] == "error":
                entry = event["params"]["entry"]
                if entry["source"] != "network":
                    found.append(entry["text"])
        return found

    def window(self, state: str) -> None:
        """Make the tab's window `minimized`, or `normal` again: a page in it is hidden, or is seen."""
        window = self.call("Browser.getWindowForTarget")["windowId"]
        self.call("Browser.setWindowBounds", windowId=window, bounds={"windowState": state})

    def offline(self, away: bool) -> None:
        """Take the network away from this tab, or give it back."""
        self.call(
            "Network.emulateNetworkConditions", offline=away, latency=0, downloadThroughput=-1, uploadThroughput=-1
        )

    def close(self) -> None:
        if self.closed:
            return
        self.closed = True
        self.open_things.close()
        self.browser.http(f"/json/close/{self.target}")


class Browser:
    """A running Chromium."""

    def __init__(self, process: subprocess.Popen[bytes], port: int, path: str) -> None:
        self.process, self.port = process, port
        self.open_things = ExitStack()
        self.socket: ClientConnection = self.open_things.enter_context(
            connect(f"ws://127.0.0.1:{port}{path}", max_size=None, ping_interval=None)
        )
        self.number = 0

    def call(self, method: str, **params: Any) -> dict[str, Any]:
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": method, "params": params}))
        while True:
            message = json.loads(self.socket.recv(timeout=30))
            if message.get("id") == self.number:
                assert "error" not in message, message
                return message["result"]

    def http(self, path: str) -> bytes:
        with urllib.request.urlopen(f"http://127.0.0.1:{self.port}{path}", timeout=30) as response:
            return response.read()

    @contextmanager
    def stopped(self) -> Iterator[None]:
        """All of the browser's processes stand still, as those of a machine whose lid was closed."""
        os.killpg(self.process.pid, signal.SIGSTOP)
        try:
            yield
        finally:
            os.killpg(self.process.pid, signal.SIGCONT)

    def person(self) -> str:
        """A fresh set of cookies and storage, as another participant has."""
        return self.call("Target.createBrowserContext")["browserContextId"]

    def tab(self, person: str | None = None) -> Tab:
        """A tab of a person (a new one unless given)."""
        person = person or self.person()
        target = self.call("Target.createTarget", url="about:blank", browserContextId=person, newWindow=True)
        tab = Tab(self, target["targetId"], person)
        tab.size(1280, 720)
        return tab


@contextmanager
def chromium(executable: str, profile: Path) -> Iterator[Browser]:
    process = subprocess.Popen(
        [executable, *FLAGS, f"--user-data-dir={profile}", "about:blank"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    try:
        file = profile / "DevToolsActivePort"
        until(lambda: file.is_file() and file.read_text().count("\n"), process, "Chromium")
        port, path = file.read_text().split("\n")[:2]
        browser = Browser(process, int(port), path)
        yield browser
        browser.open_things.close()
    finally:
        ended(process)
