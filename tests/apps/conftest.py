"""Makes the helpers of these tests importable (tests are imported by path); serves a study, fits a file."""

from __future__ import annotations

import contextlib
import json
import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from study.experiment.stimuli.manifest import Manifest
from study.experiment.store.responses import Responses

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent / "browser")]

if TYPE_CHECKING:
    from serving import Serving


@pytest.fixture(scope="session")
def stimuli(tmp_path_factory: pytest.TempPathFactory) -> Manifest:
    """The manifest of a small study whose films are noise."""
    from serving import unfilmed

    return unfilmed(tmp_path_factory.mktemp("served"))


@pytest.fixture
def responses(tmp_path: Path) -> Iterator[Responses]:
    """An empty database."""
    from study.experiment.store.responses import open_responses

    with open_responses(tmp_path) as opened:
        yield opened


@pytest.fixture
def serve(stimuli: Manifest, responses: Responses) -> Iterator[Callable[..., Serving]]:
    """`serve(**settings)`: a new server on the same database (`serving.Serving`)."""
    from serving import Serving

    opened = []

    def start(root_path: str = "", **settings) -> Any:
        opened.append(Serving(stimuli, responses, root_path, **settings))
        return opened[-1]

    yield start
    for serving in opened:
        serving.client.__exit__(None, None, None)


@pytest.fixture
def connect(port: int) -> Iterator[Callable[[], socket.socket]]:
    """`connect()`: a socket to the server that a test file's fixture `port` runs."""
    with contextlib.ExitStack() as stack:

        def opened() -> Any:
            client = stack.enter_context(socket.create_connection(("127.0.0.1", port)))
            client.settimeout(10)
            return client

        yield opened


@pytest.fixture
def fitted(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Callable[..., dict[str, Any]]:
    """A function that writes a file, fits it, and gives the JSON."""

    def fit(text: str | bytes, *arguments: str) -> dict[str, Any]:
        from study.apps.cli import run

        path = tmp_path / "data.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        code = run(["fit", str(path), *arguments, "--json"])
        output = capsys.readouterr()
        assert code == 0, output.err
        found: dict[str, Any] = json.loads(output.out)
        return found

    return fit


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Callable[..., str]:
    """A function that writes a file, expects a refusal in one line, and gives it."""

    def refuse(text: str | bytes, *arguments: str) -> str:
        from study.apps.cli import run

        path = tmp_path / "data.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        assert run(["fit", str(path), *arguments]) == 2
        message = capsys.readouterr().err.strip()
        assert len(message.splitlines()) == 1
        return message

    return refuse
