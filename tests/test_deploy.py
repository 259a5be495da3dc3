"""The files of `deploy/` against what reads them; tests/apps/server/test_kill.py runs nginx with its own."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import yaml
from parts import unavailable

from study.apps.cli.serve import serve

DEPLOY = Path(__file__).parents[1] / "deploy"
UNIT = DEPLOY / "segue@.service"


def ports() -> list[str]:
    """Those at which nginx expects servers."""
    return re.findall(r"^    server 127.0.0.1:(\d+)", (DEPLOY / "nginx.conf").read_text(), re.MULTILINE)


def served(words: list[str]) -> str:
    """The port of a command `serve`, which has to be one that Segue takes, and to trust the proxy."""
    assert words[0] == "serve"
    given = serve.make_context("serve", words[1:]).params
    assert given["behind_proxy"]
    assert given["public_urls"]
    return str(given["port"])


def test_systemd_takes_the_unit(tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        unavailable("systemd-analyze", "install it (Debian, Ubuntu: apt install systemd)")
    text = UNIT.read_text(encoding="utf-8")
    command = re.search(r"^ExecStart=(\S+)/segue ((?:.*\\\n)*.*)$", text, re.MULTILINE)
    assert command, text
    assert served(shlex.split(command[2].replace("\\\n", " ").replace("%i", "8002"))) == "8002"
    (tmp_path / "segue@8001.service").write_text(text.replace(f"{command[1]}/segue", "/bin/true"))
    asked = ["systemd-analyze", "verify", "--man=no", str(tmp_path / "segue@8001.service")]
    done = subprocess.run(asked, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_the_servers_of_docker_compose_are_those_of_nginx() -> None:
    services = yaml.safe_load((DEPLOY / "docker-compose.yml").read_text(encoding="utf-8"))["services"]
    servers = {name: one for name, one in services.items() if name.startswith("server-")}
    assert [served(one["command"]) for one in servers.values()] == ports() == ["8001", "8002"]
    for server in servers.values():
        # nginx and the servers take each other for the same machine, as `--behind-proxy` demands.
        assert server["network_mode"] == services["database"]["network_mode"] == "service:proxy"
        assert (DEPLOY / server["build"]["context"] / server["build"]["dockerfile"]).is_file()
        assert server["depends_on"].keys() <= services.keys()
    assert (DEPLOY / services["proxy"]["volumes"][0].split(":")[0]).is_file()
