"""Web: the whole application. A `Host` comes in; pages, films, messages and the researcher's routes go out.

Films are served to the participant whose trial shows them, no other. Files of the pages are read once, at the start.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import html
import logging
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from study.apps.server.hosting import Host
from study.apps.server.inbox import message_routes
from study.apps.server.limits import Limits
from study.apps.server.memory import hand_back
from study.apps.server.messages import RefusedError
from study.apps.server.researcher import researcher_routes
from study.errors import SegueError
from study.experiment.protocol.stimuli import StimulusSettings
from study.experiment.store.databases import AWAY

PAGES = Path(__file__).resolve().parents[1] / "pages"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
HERE_EVERY_SECONDS = 20.0

log = logging.getLogger("segue.serve")

Handler = Callable[[Request], Awaitable[Response]]


def make_app(host: Host) -> Limits:
    """The application, within the limits of every response."""

    async def study(_: Request) -> Response:
        return JSONResponse(_about(host))

    async def film(request: Request) -> Response:
        live = await host.live_session(request.cookies.get(host.cookie, ""))
        found = None if live is None else await host.film(live, request.path_params["name"])
        if found is None:
            raise RefusedError(404, "Expected a film of the trial that is shown now.")
        return found

    routes = [
        *message_routes(host),
        Route("/api/study", study, methods=["GET"]),
        Route("/films/{name:str}.mp4", film, methods=["GET"]),
        *researcher_routes(host),
        *_pages(host),
    ]
    app = Starlette(routes=routes, lifespan=_lifespan(host), exception_handlers=_refusals(host))
    # It would send people to an address made from the request's Host header.
    app.router.redirect_slashes = False
    return Limits(app)


def _refusals(host: Host) -> dict[Any, Any]:
    """Refusals become JSON with one sentence; what went wrong on our side is logged, not shown."""

    async def refused(_: Request, refusal: RefusedError) -> Response:
        return JSONResponse({"error": refusal.why}, status_code=refusal.status)

    async def unfit(request: Request, refusal: SegueError) -> Response:
        log.warning("%s %r: %r", request.method, request.url.path, str(refusal))
        return JSONResponse({"error": str(refusal)}, status_code=422)

    async def away(_: Request, error: Exception) -> Response:
        host.database_away(error)
        return JSONResponse({"error": "The database can't be reached now; send this again."}, status_code=503)

    async def gone(_: Request, __: ClientDisconnect) -> Response:
        return Response(status_code=400)

    return {RefusedError: refused, SegueError: unfit, ClientDisconnect: gone, **dict.fromkeys(AWAY, away)}


def _lifespan(host: Host) -> Callable[[Starlette], contextlib.AbstractAsyncContextManager[None]]:
    async def note_for_ever() -> None:
        while True:
            await asyncio.sleep(HERE_EVERY_SECONDS)
            try:
                await host.note_who_is_here()
            except Exception:
                log.exception("Recording who is active failed; next attempt in %g s.", HERE_EVERY_SECONDS)
            await asyncio.to_thread(hand_back)

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        task = asyncio.create_task(note_for_ever())
        try:
            yield
        finally:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task
            await host.note_who_is_here()
            host.close()

    return lifespan


def _about(host: Host) -> dict[str, Any]:
    """What every page may know: title, language, words."""
    protocol = host.protocol
    return {
        "title": protocol.texts.title,
        "language": protocol.language,
        "texts": protocol.texts.model_dump(),
        "declined": protocol.consent.declined,
        "touch": protocol.touch,
        "size": [protocol.stimuli.width, protocol.stimuli.height],
        "screen": protocol.screen.model_dump(),
        "background": _background(protocol.stimuli),
        "parameters": host.settings.parameters,
    }


def _background(stimuli: StimulusSettings) -> str:
    """The colour behind the figure, which the pages have too."""
    from renderer.figure import BACKGROUND, POINT_BACKGROUND

    red, green, blue = POINT_BACKGROUND if stimuli.style == "points" else BACKGROUND
    return stimuli.colours.background or f"#{red:02x}{green:02x}{blue:02x}"


def _pages(host: Host) -> list[Route]:
    """The files of the pages folder, read once: no path of a request ever reaches the file system."""
    routes = []
    # A page has its language and its name before any script runs.
    texts = host.protocol.texts
    words = {b"{language}": host.protocol.language, b"{title}": texts.title, b"{no_script}": texts.no_script}
    for file in sorted(PAGES.iterdir()):
        if file.suffix not in TYPES:
            continue
        content = file.read_bytes()
        for slot, word in words.items() if file.suffix == ".html" else ():
            content = content.replace(slot, html.escape(word).encode())
        response = _page(content, TYPES[file.suffix])
        path = {"index": "/", "researcher": "/researcher", "withdraw": "/withdraw"}.get(file.stem)
        routes.append(Route(path if path and file.suffix == ".html" else f"/pages/{file.name}", response))
    return routes


def _page(content: bytes, media_type: str) -> Handler:
    marks = {"cache-control": "no-cache", "etag": f'"{hashlib.sha256(content).hexdigest()[:32]}"'}

    async def page(request: Request) -> Response:
        if request.headers.get("if-none-match") == marks["etag"]:
            return Response(status_code=304, headers=marks)
        return Response(content, media_type=media_type, headers=marks)

    return page
