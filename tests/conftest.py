"""Fixtures for all tests: the real motion capture where there is some, virtual displays, PostgreSQL."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as `segue` has it; read when numpy is loaded
os.environ["SEGUE_CACHE"] = os.devnull  # how stimuli are settled is tested anew each time; see `settled_once`

# Tests are imported by path, without packages: this makes the modules beside this file importable.
sys.path.append(str(Path(__file__).parent))

from parts import unavailable
from postgres_server import PostgresServer, find_binaries

MOCAP = Path(os.environ.get("SEGUE_MOCAP", Path(__file__).parents[1].parent / "shared" / "motions"))


@pytest.fixture(scope="session")
def mocap() -> Path:
    """The folder of real motion capture (`cmu/`, `cmu_bvh/`, `bandai/`, `perfume/`)."""
    if not (MOCAP / "cmu_bvh").is_dir():
        unavailable("real motion capture", f"expected it in {MOCAP}, or in the folder that SEGUE_MOCAP names")
    return MOCAP


# What these test is how stimuli, or parts of them, come to be: they make all anew.
MAKING = ("experiment/stimuli", "experiment/test_given", "motion", "papers", "renderer", "test_cluster", "transitions")


@pytest.fixture(scope="module", autouse=True)
def settled_once(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tests of what is done with settled stimuli settle each protocol once in a run, whichever comes first."""
    if request.path.relative_to(Path(__file__).parent).as_posix().startswith(MAKING):
        yield
        return
    own = tmp_path_factory.getbasetemp()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SEGUE_CACHE", str((own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "settled"))
        yield


@pytest.fixture(scope="session")
def start_display() -> Iterator[Callable[..., VirtualDisplay]]:
    """`start_display(size, options ...)`: another virtual X display; what runs at the end of the tests is ended."""
    for program, package in (("Xvfb", "xvfb"), ("xdotool", "xdotool")):
        if shutil.which(program) is None:
            unavailable(program, f"install it (Debian, Ubuntu: apt install {package})")
    started: list[VirtualDisplay] = []

    def begin(size: str = "800x600", *options: str) -> VirtualDisplay:
        started.append(VirtualDisplay(size, *options))
        return started[-1]

    yield begin
    for display in started:
        display.end()


class VirtualDisplay:
    """An Xvfb of its own; `name` is for DISPLAY."""

    def __init__(self, size: str, *options: str) -> None:
        read, write = os.pipe()
        self.server = subprocess.Popen(
            ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{size}x24", "-noreset", "-nolisten", "tcp", *options],
            pass_fds=(write,),
            stderr=subprocess.DEVNULL,
        )
        os.close(write)
        with os.fdopen(read) as told:
            number = told.readline().strip()  # written once it takes connections
        if not number:
            self.server.wait()
            pytest.fail(f"Xvfb ended at once, with status {self.server.returncode}")
        self.name = f":{number}"

    def end(self) -> None:
        self.server.terminate()
        self.server.wait()


@pytest.fixture(scope="session")
def virtual_display(start_display: Callable[..., VirtualDisplay]) -> str:
    """A virtual X display of 800 x 600 pixels for all tests that need one; its name, for DISPLAY."""
    return start_display().name


@pytest.fixture(scope="session")
def postgres_server() -> Iterator[PostgresServer]:
    """A PostgreSQL server of our own, started where a first test asks for it (one for each process of the tests)."""
    binaries = find_binaries()
    if binaries is None:
        unavailable("PostgreSQL", "install its server (Debian, Ubuntu: apt install postgresql)")
    try:
        import psycopg  # noqa: F401
    except ImportError:
        unavailable("psycopg", "install it: pip install 'psycopg[binary]'")
    server = PostgresServer(binaries)
    yield server
    server.remove()


@pytest.fixture
def postgres_url(postgres_server: PostgresServer) -> str:
    """The URL of an empty PostgreSQL database."""
    return postgres_server.empty_database()


@pytest.fixture(params=["sqlite", "postgresql"])
def database(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """An empty database of each kind: what `open_responses` and `--database` take."""
    if request.param == "sqlite":
        return str(tmp_path / "responses.sqlite")
    return str(request.getfixturevalue("postgres_url"))
