"""A PostgreSQL server of our own for the tests: made in a temporary folder, started, killed, started again, removed."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote

ROLE, PASSWORD = "segue", "wombat @ 7/9%"
NAMES = ("postgres", "nobody")


def find_binaries() -> Path | None:
    """The folder of `initdb` and `postgres`: what `pg_config` names, else the newest of Debian's, else the PATH."""
    candidates = []
    if shutil.which("pg_config"):
        told = subprocess.run(["pg_config", "--bindir"], capture_output=True, text=True, check=False)
        candidates.append(Path(told.stdout.strip()))
    installed = Path("/usr/lib/postgresql").glob("*/bin")
    candidates += sorted(installed, key=lambda path: float(path.parent.name), reverse=True)
    if (found := shutil.which("initdb")) is not None:
        candidates.append(Path(found).parent)
    for folder in candidates:
        if (folder / "initdb").exists() and (folder / "postgres").exists():
            return folder
    return None


class PostgresServer:
    """A server on a free port of this machine and a socket in its folder; a role with a password owns the databases.

    PostgreSQL refuses to run as root, so root runs it as another user, who then owns the folder.
    """

    def __init__(self, binaries: Path) -> None:
        self._binaries = binaries
        self._folder = Path(tempfile.mkdtemp(prefix="segue-pg-"))  # short: the path of a socket is
        self._user: dict[str, Any] = _unprivileged(self._folder)
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = int(probe.getsockname()[1])
        data = self._folder / "data"
        self._run("initdb", "-D", data, "-U", "postgres", "-A", "trust", "-E", "UTF8", "--locale=C", "--no-sync")
        (data / "pg_hba.conf").write_text("local all all trust\nhost all all 127.0.0.1/32 scram-sha-256\n")
        with (data / "postgresql.conf").open("a") as settings:
            settings.write(
                f"\nport = {self.port}\nlisten_addresses = '127.0.0.1'\nunix_socket_directories = '{self._folder}'\n"
                "max_connections = 60\nshared_buffers = 16MB\n"
                "synchronous_commit = off\n"  # Segue must turn it on by itself
            )
        self.start()
        self.administer(f"CREATE ROLE {ROLE} LOGIN PASSWORD '{PASSWORD}'")
        self.administer(f"CREATE DATABASE study OWNER {ROLE}")

    def start(self) -> None:
        """Start, and wait until it takes connections; after a kill it first repairs what the kill left."""
        self._run("pg_ctl", "-D", self._folder / "data", "-l", self._folder / "log", "-w", "-t", "60", "start")

    def kill(self) -> None:
        """End all of its processes at once, as a power cut would; every connection is lost."""
        self._run("pg_ctl", "-D", self._folder / "data", "-m", "immediate", "-w", "stop")

    def remove(self) -> None:
        """End it and delete its folder."""
        self.kill()
        shutil.rmtree(self._folder)

    def administer(self, statement: str, database: str = "postgres") -> None:
        """Run a statement as the superuser, over the socket."""
        self._run(
            "psql", "-h", self._folder, "-p", str(self.port), "-U", "postgres", "-d", database, "-qAt", "-v",
            "ON_ERROR_STOP=1", "-c", statement,
        )  # fmt: skip

    @contextmanager
    def setting(self, name: str, value: str) -> Iterator[None]:
        """Another value of one of the server's settings, for all new connections."""
        self.administer(f"ALTER SYSTEM SET {name} = {value}")
        self._reload()
        try:
            yield
        finally:
            self.administer(f"ALTER SYSTEM RESET {name}")
            self._reload()

    def _reload(self) -> None:
        self._run("pg_ctl", "-D", self._folder / "data", "reload")
        time.sleep(0.3)  # it is told by a signal

    def empty_database(self) -> str:
        """The URL of the database that the role owns, emptied: making a new one each time costs ten times as much."""
        cut = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = 'study'"
        empty = "DROP SCHEMA public CASCADE; CREATE SCHEMA public AUTHORIZATION pg_database_owner"
        empty += "; GRANT USAGE ON SCHEMA public TO PUBLIC"  # as in a new one
        self.administer(cut)
        self.administer(f"SET client_min_messages = warning; {empty}", "study")
        return self.url("study")

    def url(self, database: str, *, password: str = PASSWORD, port: int | None = None) -> str:
        """The URL of a database, over TCP and with a password, as a laboratory uses it."""
        return f"postgresql+psycopg://{ROLE}:{quote(password, safe='')}@127.0.0.1:{port or self.port}/{database}"

    def _run(self, program: str, *arguments: object) -> None:
        command = [str(self._binaries / program), *map(str, arguments)]
        environment: Mapping[str, str] = {**os.environ, "LC_ALL": "C"}
        done = subprocess.run(
            command, cwd=self._folder, env=environment, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE,
            stdout=subprocess.DEVNULL, text=True, check=False, **self._user,
        )  # fmt: skip
        assert done.returncode == 0, f"{' '.join(command)}: {done.stderr}"


def _unprivileged(folder: Path) -> dict[str, Any]:
    """Whom to run as where we are root, for `subprocess`; that user then owns the folder."""
    import pwd

    if os.geteuid() != 0:
        return {}
    known = {entry.pw_name: entry for entry in pwd.getpwall()}
    who = next(known[name] for name in NAMES if name in known)
    os.chown(folder, who.pw_uid, who.pw_gid)
    return {"user": who.pw_uid, "group": who.pw_gid, "extra_groups": []}


def without_password(url: str) -> str:
    """A URL whose password is given elsewhere."""
    return url.replace(f":{quote(PASSWORD, safe='')}@", "@")
