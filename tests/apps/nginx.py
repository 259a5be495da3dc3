"""nginx in front of several servers on this machine, with the site file of `deploy/`."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from serving import free_port

SITE = Path(__file__).parents[2] / "deploy" / "nginx.conf"
PLACES = ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")


def program() -> str | None:
    """Where nginx is; system programs are not in everybody's PATH."""
    return shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin:/usr/local/sbin")


def written(folder: Path, ports: Sequence[int], *, sticky: bool, limited: bool) -> int:
    """Write the configuration of an nginx that needs no rights into a folder; the port at which it listens."""
    port, text = free_port(), SITE.read_text(encoding="utf-8")
    servers = re.findall(r"^    server 127.0.0.1:\d+ .*$", text, re.MULTILINE)
    lines = [re.sub(r":\d+", f":{own}", servers[0], count=1) for own in ports]
    changes = {
        "\n".join(servers): "\n".join(lines),
        "listen 80;": f"listen 127.0.0.1:{port} backlog=4096;",
    }
    if not limited:
        changes["        limit_req zone=segue_begin burst=200 nodelay;\n"] = ""
    if not sticky:
        changes["    hash $segue_participant consistent;\n"] = ""
    for old, new in changes.items():
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    (folder / "site.conf").write_text(text)
    places = "".join(f"{place}_temp_path {folder}/{place};\n" for place in PLACES)
    user = "user root;\n" if os.geteuid() == 0 else ""
    (folder / "nginx.conf").write_text(
        f"{user}daemon off;\nworker_processes 1;\nworker_rlimit_nofile 8192;\npid {folder}/pid;\n"
        f"error_log {folder}/error.log warn;\nevents {{ worker_connections 4096; }}\n"
        f"http {{\naccess_log off;\nkeepalive_timeout 600s;\n{places}include {folder}/site.conf;\n}}\n"
    )
    return port


@contextlib.contextmanager
def proxy(folder: Path, ports: Sequence[int], *, sticky: bool = True, limited: bool = True) -> Iterator[int]:
    """nginx while the block runs: the port at which it listens.

    Without `sticky` each request goes to the next server; without `limited` any number of sessions may begin at once.
    """
    port, found = written(folder, ports, sticky=sticky, limited=limited), program()
    assert found, "nginx is installed"
    process = subprocess.Popen([found, "-c", str(folder / "nginx.conf"), "-e", str(folder / "error.log")])
    try:
        for _ in range(200):
            with contextlib.suppress(OSError):
                socket.create_connection(("127.0.0.1", port), timeout=1).close()
                break
            assert process.poll() is None, (folder / "error.log").read_text()
            time.sleep(0.05)
        yield port
    finally:
        process.terminate()
        process.wait()
