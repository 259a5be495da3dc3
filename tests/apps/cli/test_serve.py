"""`segue serve` as whoever starts it meets it: refusals in one line, what is printed, how it ends."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from serving import PROTOCOL, TOKEN, unfilmed

from study.apps.cli import run
from study.apps.server.names import reachable
from study.apps.server.running import listen
from study.errors import SessionError
from study.experiment.store.responses import open_responses
from study.experiment.store.sessions import find_session

ROOT = Path(__file__).parents[3]

# What `segue serve` does once the films are there; the command line takes Ctrl-C for an end, too.
SERVE = """
import sys
from pathlib import Path
from study.apps.server.running import run
from study.apps.server.settings import Settings
from study.experiment.protocol.whole import load_protocol
folder = Path(sys.argv[1])
protocol = load_protocol(folder / "protocol.toml")
try:
    run(protocol, folder, Settings(sys.argv[2]), port=0, started=lambda address, place: print(address, flush=True))
except KeyboardInterrupt:
    pass
"""


@pytest.mark.parametrize(
    ("option", "value", "why"),
    [
        ("--researcher-token", "short", "Expected a researcher's token of 16 characters or more, found one of 5"),
        ("--researcher-token", "", "Expected a researcher's token of 16 characters or more, found one of 0"),
        ("--root-path", "study", "expected a path such as /study, without a slash at its end, found 'study'"),
        ("--root-path", "/study/", "found '/study/'"),
        ("--root-path", "/a\r\nset-cookie: b", "expected a path such as /study"),
        ("--completion-url", "javascript:alert(1)", "expected a completion URL that starts with https://"),
        ("--port", "70000", "70000 is not in the range"),
    ],
)
def test_what_can_not_be_is_refused_before_anything_is_rendered(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, option: str, value: str, why: str
) -> None:
    protocol = tmp_path / "study.toml"
    protocol.write_text(PROTOCOL.replace('instructions = ""', 'instructions = "Watch both."'), encoding="utf-8")
    assert run(["serve", str(protocol), "--out", str(tmp_path / "out"), option, value]) == 2
    printed = capsys.readouterr()
    assert why in printed.err
    assert len(printed.err.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_port_that_is_taken_is_refused() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(SessionError, match=rf"port {port}, found that it can't be done \(Address already in use\)"):
            listen("127.0.0.1", port)


def test_it_listens_at_ipv6_too() -> None:
    try:
        listening = listen("::1", 0)
    except SessionError:
        pytest.skip("this machine has no IPv6")
    with listening:
        assert listening.getsockname()[0] == "::1"


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGINT])
def test_it_ends_when_told_to_and_has_stored_who_came(tmp_path: Path, end: Any) -> None:
    unfilmed(tmp_path)
    child = subprocess.Popen(
        [sys.executable, "-c", SERVE, str(tmp_path), TOKEN], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, env={**os.environ, "PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    try:
        address = child.stdout.readline().strip()
        message = {"page": "the-page-of-p1", "parameters": {"participant": "p1"}}
        headers = {"content-type": "application/json", "x-segue-page": message["page"]}
        request = urllib.request.Request(f"{address}/api/begin", json.dumps(message).encode(), headers)
        with urllib.request.urlopen(request, timeout=30) as answer:
            assert json.loads(answer.read())["kind"] == "consent"
        # A connection that stays open, as browsers', must not keep it.
        with socket.create_connection(("127.0.0.1", int(address.rpartition(":")[2]))):
            child.send_signal(end)
            _, said = child.communicate(timeout=30)
    finally:
        child.kill()
        child.wait()
    assert "Traceback" not in said
    assert TOKEN not in said
    with open_responses(tmp_path) as responses:
        assert find_session(responses, "p1") is not None


def test_all_addresses_are_told_as_one_that_can_be_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    told = reachable("0.0.0.0")
    assert told not in ("0.0.0.0", "")
    with socket.create_server(("0.0.0.0", 0)) as server, socket.create_connection((told, server.getsockname()[1]), 5):
        assert (reachable("127.0.0.1"), reachable("lab.example.org")) == ("127.0.0.1", "lab.example.org")

    def no_network(*_: object) -> None:
        raise OSError("Network is unreachable")

    monkeypatch.setattr(socket.socket, "connect", no_network)
    assert reachable("0.0.0.0") == socket.gethostname()
