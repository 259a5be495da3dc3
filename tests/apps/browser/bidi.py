"""A small client of WebDriver BiDi, which Firefox speaks: tabs, keys, clicks, scripts, pictures."""

from __future__ import annotations

import base64
import json
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from driving import Driven, ended, until
from websockets.sync.client import ClientConnection, connect

# Keys without a character have code points of the WebDriver standard (section "Keyboard actions").
KEYS = {"Enter": "\ue007", "Tab": "\ue004"}

PREFERENCES = {
    "app.update.enabled": False,
    "browser.shell.checkDefaultBrowser": False,
    "browser.tabs.warnOnClose": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
    "toolkit.telemetry.enabled": False,
    # Nothing of what a test does leaves the machine.
    "browser.safebrowsing.update.enabled": False,
    "services.settings.server": "data:,none",
    # Firefox decodes films in a process of its own and gives up on it for good if it has not started after 5 s, which
    # happens on a busy machine: "Couldn't start RDD process", for every film from then on.
    "media.rdd-process.startup_timeout_ms": 120_000,
    "media.utility-process.startup_timeout_ms": 120_000,
    # As long as nobody has pressed a key, a page that asks before leaving is left unasked; tests want neither.
    "dom.disable_beforeunload": True,
}


class Firefox:
    """A running Firefox."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.number = 0
        self.complaints: list[str] = []
        self.call("session.new", capabilities={})
        self.call("session.subscribe", events=["log.entryAdded"])

    def call(self, method: str, timeout: float = 60, **params: Any) -> dict[str, Any]:
        """Send a command and wait for its answer; errors of pages are kept on the way."""
        self.number += 1
        self.socket.send(json.dumps({"id": self.number, "method": method, "params": params}))
        while True:
            message = json.loads(self.socket.recv(timeout=timeout))
            if message.get("method") == "log.entryAdded" and message["params"]["level"] == "error":
                self.complaints.append(str(message["params"]["text"]))
            if message.get("id") == self.number:
                assert message["type"] == "success", f"{method}: {message}"
                return message["result"]

    def tab(self, person: str | None = None) -> FirefoxTab:
        """A tab of a person: a set of cookies and storage of its own (a new one unless given)."""
        person = person or self.call("browser.createUserContext")["userContext"]
        context = self.call("browsingContext.create", type="tab", userContext=person)["context"]
        viewport = {"width": 1280, "height": 720}
        self.call("browsingContext.setViewport", context=context, viewport=viewport)
        return FirefoxTab(self, context, person)


class FirefoxTab(Driven):
    """One tab of Firefox."""

    def __init__(self, browser: Firefox, context: str, person: str) -> None:
        self.browser, self.context, self.person = browser, context, person

    def open(self, address: str) -> None:
        self.browser.call("browsingContext.navigate", context=self.context, url=address, wait="interactive")

    def reload(self) -> None:
        self.browser.call("browsingContext.reload", context=self.context, wait="interactive")

    def before_each_page(self, script: str) -> None:
        """Run something in every page of this tab, before its own scripts."""
        self.browser.call(
            "script.addPreloadScript", functionDeclaration=f"() => {{ {script} }}", contexts=[self.context]
        )

    def run(self, script: str) -> Any:
        answer = self.browser.call(
            "script.evaluate", expression=f"(async () => JSON.stringify((await ({script})) ?? null))()",
            target={"context": self.context}, awaitPromise=True,
        )  # fmt: skip
        assert answer["type"] == "success", answer
        return json.loads(answer["result"]["value"])

    def _perform(self, kind: str, actions: list[dict[str, Any]], **more: Any) -> None:
        source = {"type": kind, "id": kind, "actions": actions, **more}
        self.browser.call("input.performActions", context=self.context, actions=[source])

    def click_at(self, x: float, y: float, times: int = 1) -> None:
        press = [{"type": "pointerDown", "button": 0}, {"type": "pointerUp", "button": 0}]
        self._perform("pointer", [{"type": "pointerMove", "x": int(x), "y": int(y)}, *press * times])

    def key(self, key: str) -> None:
        value = KEYS.get(key, key)
        self._perform("key", [{"type": "keyDown", "value": value}, {"type": "keyUp", "value": value}])

    def picture(self, path: Path) -> None:
        data = self.browser.call("browsingContext.captureScreenshot", context=self.context)["data"]
        path.write_bytes(base64.b64decode(data))

    def close(self) -> None:
        self.browser.call("browsingContext.close", context=self.context)


@contextmanager
def firefox(executable: str, profile: Path) -> Iterator[Firefox]:
    """Start Firefox without a window, on a fresh profile; end it afterwards."""
    lines = [f"user_pref({json.dumps(name)}, {json.dumps(value)});\n" for name, value in PREFERENCES.items()]
    (profile / "user.js").write_text("".join(lines))
    flags = ("--headless", "--no-remote", "--remote-debugging-port=0", "--profile", str(profile))
    process = subprocess.Popen(
        [executable, *flags, "about:blank"],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env={**os.environ, "HOME": str(profile)},
    )  # fmt: skip
    try:
        told = profile / "WebDriverBiDiServer.json"
        where = until(lambda: _read(told), process, "Firefox")
        with connect(
            f"ws://{where['ws_host']}:{where['ws_port']}/session", max_size=None, ping_interval=None
        ) as socket:
            yield Firefox(socket)
    finally:
        ended(process)


def _read(file: Path) -> Any:
    try:
        return json.loads(file.read_text())
    except (OSError, ValueError):
        return None  # not there, or half written
