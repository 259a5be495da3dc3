"""Running: the application on a port, with uvicorn, until it is stopped."""

from __future__ import annotations

import socket
from collections.abc import Callable, Sequence
from pathlib import Path

import uvicorn
from starlette.types import ASGIApp

from study.apps.server import memory
from study.apps.server.connections import Connection
from study.apps.server.hosting import Host
from study.apps.server.names import Named, own_names, reachable
from study.apps.server.settings import Settings
from study.apps.server.web import make_app
from study.errors import SessionError
from study.experiment.protocol.whole import Protocol
from study.experiment.stimuli.manifest import read_manifest
from study.experiment.stimuli.rendering import RenderAhead
from study.experiment.store.databases import try_to_write
from study.experiment.store.responses import open_responses

MOST_CONNECTIONS = 4000
"""Beyond it requests get status 503, and pages ask again. A browser opens up to six while films load."""


def run(
    protocol: Protocol,
    folder: Path,
    settings: Settings,
    *,
    host: str = "127.0.0.1",
    port: int = 8000,
    behind_proxy: bool = False,
    root_path: str = "",
    database: str | None = None,
    public_urls: Sequence[str] = (),
    ahead: Callable[[], RenderAhead] | None = None,
    started: Callable[[str, str], object] | None = None,
) -> None:
    """Serve a results folder until the process is told to end; answers under way are committed first.

    Parameters
    ----------
    root_path
        Where a proxy shows the study, such as `/study`; it hands requests on without it.
    database
        Where answers go, instead of the folder's own `responses.sqlite`.
    public_urls
        The addresses that participants open where they are not this machine's own, as behind a proxy.
    ahead
        Begins to render what is not rendered beforehand; None where all is.
    started
        Told the address and the place of the answers, without a password, once participants can come.

    Raises
    ------
    SessionError
        Where the address can't be listened at, a public address is none, or the database can't be opened or written to.
    """
    names = own_names(host, public_urls)
    manifest = read_manifest(folder)
    listening = listen(host, port)
    name = f"[{at}]" if ":" in (at := reachable(host)) else at
    with open_responses(database or folder) as responses:
        try_to_write(responses.engine, responses.place)
        study = Host(protocol, manifest, responses, settings, ahead and ahead())
        app = Named(make_app(study), names, protocol)
        if started:
            address = public_urls[0].rstrip("/") if public_urls else f"http://{name}:{listening.getsockname()[1]}"
            started(address, responses.place)
        serve(app, listening, behind_proxy=behind_proxy, root_path=root_path)


def serve(app: ASGIApp, listening: socket.socket, *, behind_proxy: bool = False, root_path: str = "") -> None:
    """Serve an application in this process until it is told to end."""
    _allow_files(MOST_CONNECTIONS + 100)
    memory.set_up()
    uvicorn.Server(configuration(app, behind_proxy=behind_proxy, root_path=root_path)).run(sockets=[listening])


def configuration(app: ASGIApp, *, behind_proxy: bool = False, root_path: str = "") -> uvicorn.Config:
    """How uvicorn runs: quiet, with connections that outlive a trial, ending within seconds."""
    return uvicorn.Config(
        app,
        http=Connection,
        ws="none",
        limit_concurrency=MOST_CONNECTIONS,
        log_level="warning",
        access_log=False,
        server_header=False,
        proxy_headers=behind_proxy,
        root_path=root_path,
        timeout_keep_alive=75,
        timeout_graceful_shutdown=5,
    )


def _allow_files(wanted: int) -> None:
    """Each connection is an open file, of which a process may often have no more than 1,024 unless it asks."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return
    now, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    if most != resource.RLIM_INFINITY:
        wanted = min(wanted, most)
    if now != resource.RLIM_INFINITY and now < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens; 0 is any free port."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
    except OSError as error:
        listening.close()
        raise SessionError(
            f"Expected to listen at {host}, port {port}, found that it can't be done ({error.strerror}); "
            "choose another port."
        ) from error
    listening.listen(2048)
    return listening
