"""Windows and macOS, by stand-ins: what they lack is not asked for, and what they have instead is used.

Segue is developed and tested on Linux; these tests hold the paths that only the others take.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from renderer import context, files, workers
from renderer.errors import RendererError
from study.apps.server import running

ROOT = Path(__file__).resolve().parents[1]

# Refuses modules that only POSIX has, and uvloop, which Windows has not; then imports all of ours.
WITHOUT_POSIX = """
import importlib, os, pkgutil, signal, sys
class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("fcntl", "termios", "resource", "pwd", "grp", "uvloop", "pty"):
            raise ModuleNotFoundError(name)
sys.meta_path.insert(0, Refuse())
for module in ("resource", "fcntl"):
    sys.modules.pop(module, None)
for name in ("fork", "sched_getaffinity", "getuid", "geteuid", "fchmod"):
    if hasattr(os, name):
        delattr(os, name)
for name in ("SIGKILL", "SIGHUP", "SIGUSR1"):
    delattr(signal, name)
import segue, study, renderer
for package in (segue, study, renderer):
    for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if not found.name.endswith("__main__") and "engines.importers" not in found.name:
            importlib.import_module(found.name)
from study.apps.server import running
running._allow_files(4000)
config = running.configuration(None)
config.load = lambda: None
print(config.get_loop_factory().__module__)
"""


def test_all_of_it_is_imported_without_what_only_posix_has() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_POSIX], capture_output=True, text=True, check=False, cwd=ROOT, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert "uvloop" not in done.stdout
    assert "asyncio" in done.stdout or "uvicorn" in done.stdout


@pytest.mark.parametrize("platform", ["win32", "darwin"])
def test_films_are_drawn_by_the_systems_own_gl(platform: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert context.kinds_on(platform) == ("native",)
    assert "native" not in context.kinds_on("linux")
    asked: list[dict[str, Any]] = []

    def create(**given: Any) -> Any:
        asked.append(given)
        return SimpleNamespace(info={"GL_VERSION": "4.1", "GL_RENDERER": "a card"}, release=lambda: None)

    import moderngl

    monkeypatch.setattr(moderngl, "create_context", create)
    monkeypatch.setattr(context, "KINDS", context.kinds_on(platform))
    monkeypatch.delenv("SEGUE_GL", raising=False)
    assert context.open_context().kind == "native"
    assert asked == [{"standalone": True, "require": context.REQUIRED_GL}]
    with pytest.raises(RendererError, match="Expected a context of kind native, got 'egl'"):
        context.open_context("egl")


def test_a_file_of_another_process_is_left_where_it_can_not_be_asked_about(monkeypatch: pytest.MonkeyPatch) -> None:
    """`os.kill(process, 0)` would end the process on Windows."""

    def never(*_: object) -> None:
        raise AssertionError("a process was sent a signal")

    monkeypatch.setattr(files, "os", SimpleNamespace(name="nt", kill=never))
    assert files._alive(4)


def test_a_worker_asks_only_linux_to_end_it_with_its_parent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "signal", SimpleNamespace(signal=lambda *_: None, SIGINT=2, SIG_IGN=1))
    monkeypatch.setattr(workers, "_die_with_parent", lambda: pytest.fail("prctl is of Linux"))
    for platform in ("win32", "darwin"):
        monkeypatch.setattr(workers, "sys", SimpleNamespace(platform=platform))
        workers._start_worker()


def test_cores_are_counted_where_no_affinity_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "os", SimpleNamespace(cpu_count=lambda: 6, environ={}))
    assert workers.cores() == 6


def test_the_server_asks_for_open_files_only_where_there_is_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "resource", None)
    running._allow_files(10**9)
