"""Names: under which names the server answers. A page of another site whose name was made to lead to this machine (DNS
rebinding) would otherwise pass for one of ours; its requests carry its own name as their Host.

IP addresses and `localhost` are no such names, and are always answered; others are the machine's own, the address that
is listened at, and those of the public addresses that the operator lists.
"""

from __future__ import annotations

import html
import ipaddress
import logging
import socket
from collections.abc import Collection
from contextlib import suppress
from functools import lru_cache
from urllib.parse import urlsplit

from starlette.types import ASGIApp, Receive, Scope, Send

from study.apps.server.limits import HEADERS
from study.errors import SessionError
from study.experiment.protocol.whole import Protocol

MOST_TOLD = 20
"""Number of foreign names that are logged."""

log = logging.getLogger("segue.serve")


def own_names(listened_at: str, public_urls: Collection[str] = ()) -> frozenset[str]:
    """The names of this server besides IP addresses and `localhost`, in small letters.

    Raises
    ------
    SessionError
        For an invalid public address.
    """
    machine = socket.gethostname()
    names = {listened_at, machine, machine.partition(".")[0], f"{machine.partition('.')[0]}.local"}
    return frozenset(name.lower() for name in (*names, *map(_public_name, public_urls)))


def reachable(host: str) -> str:
    """An address that others can open: of "all addresses" the one by which this machine reaches the network."""
    if host not in ("", "0.0.0.0", "::"):
        return host
    family, elsewhere = (socket.AF_INET6, "2001:db8::1") if ":" in host else (socket.AF_INET, "192.0.2.1")
    with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as asking:
        asking.connect((elsewhere, 9))  # sends nothing: it only chooses the way out
        return str(asking.getsockname()[0])
    return socket.gethostname()


def _public_name(url: str) -> str:
    try:
        parts = urlsplit(url)
        name = parts.hostname if parts.scheme in ("http", "https") and not parts.query + parts.fragment else None
    except ValueError:
        name = None
    if not name:
        raise SessionError(f"Expected a public address such as https://lab.example.org/study, found {url!r}.")
    return name.encode("idna").decode() if not name.isascii() else name


class Named:
    """Wraps an application: requests under a foreign name get a page that says so, and nothing else."""

    def __init__(self, app: ASGIApp, names: Collection[str], protocol: Protocol) -> None:
        self.app, self._names, self._told = app, names, set[str]()
        words = map(html.escape, (protocol.language, protocol.texts.title, protocol.texts.wrong_address))
        page = '<!doctype html>\n<html lang="{}">\n<meta charset="utf-8">\n<title>{}</title>\n<h1>{}</h1>\n</html>\n'
        self._page = page.format(*words).encode()
        own = (b"content-type", b"text/html; charset=utf-8"), (b"content-length", b"%d" % len(self._page))
        self._headers = [*own, *HEADERS]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""
        named = [value for name, value in scope.get("headers", ()) if name == b"host"]
        if all(map(self._is_own, named)):
            await self.app(scope, receive, send)
            return
        self._tell(named[0].decode("latin-1"))
        await send({"type": "http.response.start", "status": 421, "headers": self._headers})
        await send({"type": "http.response.body", "body": b"" if scope["method"] == "HEAD" else self._page})

    def _is_own(self, value: bytes) -> bool:
        """Whether a Host header names this server, at whatever port."""
        text = value.decode("latin-1").strip().lower()
        name = text[1 : text.find("]")] if text.startswith("[") else text.partition(":")[0]
        name = name.removesuffix(".")
        return name in self._names or name == "localhost" or name.endswith(".localhost") or _is_ip_address(name)

    def _tell(self, name: str) -> None:
        if name not in self._told and len(self._told) < MOST_TOLD:
            self._told.add(name)
            log.warning(
                "A request for %r was refused; if participants use this address, add --public-url http://...",
                name[:200],
            )


@lru_cache(maxsize=64)
def _is_ip_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
