"""Web: the routes for participants. A `Host` comes in, a Starlette application goes out.

A participant is known by a cookie that scripts can't read; requests that change anything need a header that no form of
another site can send, and come from this site. Films are served to the participant whose trial shows them, no other.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Route

from study.apps.server.hosting import Host, Sitting
from study.apps.server.limits import Limits
from study.apps.server.messages import Answered, Begin, Done, Happened, Withdrawal, read
from study.apps.server.researcher import researcher_routes
from study.errors import SegueError

PAGES = Path(__file__).resolve().parents[1] / "pages"
TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}
COOKIE, PAGE_HEADER = "segue", "x-segue-page"
COOKIE_SECONDS = 14 * 24 * 3600
HERE_EVERY_SECONDS = 20.0

log = logging.getLogger("segue.serve")

Handler = Callable[[Request], Awaitable[Response]]


class RefusedError(Exception):
    """A request that is answered with an error."""

    def __init__(self, status: int, why: str) -> None:
        self.status, self.why = status, why
        super().__init__(why)


def make_app(host: Host) -> Limits:
    """The application: pages, messages of participants, films, the researcher's page."""

    async def study(_: Request) -> Response:
        return JSONResponse(_about(host))

    async def begin(request: Request) -> Response:
        message: Begin = read(Begin, await _body(request))
        view, token = await host.begin(request.cookies.get(COOKIE, ""), message)
        response = JSONResponse(view)
        if token:
            response.set_cookie(
                COOKIE, token, max_age=COOKIE_SECONDS, httponly=True, samesite="strict", path="/",
                secure=request.url.scheme == "https",
            )  # fmt: skip
        return response

    async def done(request: Request) -> Response:
        message: Done = read(Done, await _body(request))
        view = await host.done(await _sitting(host, request), message)
        response = JSONResponse(view)
        if view["kind"] == "declined":
            response.delete_cookie(COOKIE, path="/", httponly=True, samesite="strict")
        return response

    async def answer(request: Request) -> Response:
        message: Answered = read(Answered, await _body(request))
        return JSONResponse(await host.answer(await _sitting(host, request), message))

    async def happened(request: Request) -> Response:
        message: Happened = read(Happened, await _body(request))
        await host.happened(await _sitting(host, request), message)
        return JSONResponse({})

    async def alive(request: Request) -> Response:
        await _body(request)
        await _sitting(host, request)
        return JSONResponse({})

    async def leave(request: Request) -> Response:
        # A beacon can't carry our header: the page's name is the body, and all that it can do is to let go.
        _same_origin(request)
        sitting = await host.sitting(request.cookies.get(COOKIE, ""))
        if sitting is not None:
            host.leave(sitting, (await request.body())[:64].decode("utf-8", "replace"))
        return JSONResponse({})

    async def withdraw(request: Request) -> Response:
        message: Withdrawal = read(Withdrawal, await _body(request))
        return JSONResponse({"withdrawn": await host.withdraw(message.code)})

    async def film(request: Request) -> Response:
        sitting = await host.sitting(request.cookies.get(COOKIE, ""))
        path = None if sitting is None else await host.film(sitting, request.path_params["name"])
        if path is None:
            raise RefusedError(404, "Expected a film of the trial that is shown now.")
        # The file's own marks would tell that two films are the same one.
        headers = {"etag": f'"{request.path_params["name"]}"', "last-modified": "Thu, 01 Jan 1970 00:00:00 GMT"}
        return FileResponse(path, media_type="video/mp4", headers=headers)

    routes = [
        Route("/api/study", study, methods=["GET"]),
        *(
            Route(f"/api/{handler.__name__}", _guarded(handler), methods=["POST"])
            for handler in (begin, done, answer, happened, alive, leave, withdraw)
        ),
        Route("/films/{name:str}.mp4", _guarded(film), methods=["GET"]),
        *researcher_routes(host, _guarded),
        *_pages(),
    ]
    return Limits(Starlette(routes=routes, lifespan=_lifespan(host)))


def _guarded(handler: Handler) -> Handler:
    """Refusals become JSON with one sentence; what went wrong on our side is logged, not shown."""

    async def run(request: Request) -> Response:
        try:
            return await handler(request)
        except RefusedError as refusal:
            return JSONResponse({"error": refusal.why}, status_code=refusal.status)
        except SegueError as refusal:
            log.warning("%s %s: %s", request.method, request.url.path, refusal)
            return JSONResponse({"error": str(refusal)}, status_code=422)

    return run


def _lifespan(host: Host) -> Callable[[Starlette], contextlib.AbstractAsyncContextManager[None]]:
    async def note_for_ever() -> None:
        while True:
            await asyncio.sleep(HERE_EVERY_SECONDS)
            await host.note_who_is_here()

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
        "title": protocol.title,
        "language": protocol.language,
        "texts": protocol.texts.model_dump(),
        "declined": protocol.consent.declined,
        "touch": protocol.touch,
        "size": [protocol.stimuli.width, protocol.stimuli.height],
        "background": protocol.stimuli.colours.background,
        "parameters": host.settings.parameters,
    }


def _same_origin(request: Request) -> None:
    origin = request.headers.get("origin")
    if origin is not None and urlsplit(origin).netloc != request.headers.get("host"):
        raise RefusedError(403, "Expected a request of this site's own pages.")


async def _body(request: Request) -> bytes:
    """The body of a message from one of our own pages."""
    _same_origin(request)
    if PAGE_HEADER not in request.headers or request.headers.get("content-type") != "application/json":
        raise RefusedError(403, "Expected a message of this site's own pages.")
    return await request.body()


async def _sitting(host: Host, request: Request) -> Sitting:
    """The sitting of the participant whose page this is."""
    sitting = await host.sitting(request.cookies.get(COOKIE, ""))
    if sitting is None:
        raise RefusedError(401, "Expected a participant of this study; open the link again.")
    if not host.has_tab(sitting, request.headers[PAGE_HEADER]):
        raise RefusedError(409, "This session is open in another tab.")
    return sitting


def _pages() -> list[Route]:
    """The files of the pages folder, read once: no path of a request ever reaches the file system."""
    routes = []
    for file in sorted(PAGES.iterdir()):
        if file.suffix not in TYPES:
            continue
        response = _page(file.read_bytes(), TYPES[file.suffix])
        path = {"index": "/", "researcher": "/researcher", "withdraw": "/withdraw"}.get(file.stem)
        routes.append(Route(path if path and file.suffix == ".html" else f"/pages/{file.name}", response))
    return routes


def _page(content: bytes, media_type: str) -> Handler:
    async def page(_: Request) -> Response:
        return Response(content, media_type=media_type, headers={"cache-control": "no-cache"})

    return page
