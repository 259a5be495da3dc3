"""Fixtures for all tests: the real motion capture where there is some, and a refusal to skip where CI requires all."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

MOCAP = Path(os.environ.get("SEGUE_MOCAP", Path(__file__).parents[1].parent / "shared" / "motions"))


def unavailable(part: str, how: str) -> None:
    """Skip a test whose optional part is missing; fail it where every part is required (SEGUE_REQUIRE_ALL=1)."""
    message = f"{part} is missing: {how}"
    if os.environ.get("SEGUE_REQUIRE_ALL") == "1":
        pytest.fail(message)
    pytest.skip(message)


@pytest.fixture(scope="session")
def mocap() -> Path:
    """The folder of real motion capture (`cmu/`, `cmu_bvh/`, `bandai/`, `perfume/`)."""
    if not (MOCAP / "cmu_bvh").is_dir():
        unavailable("real motion capture", f"expected it in {MOCAP}, or in the folder that SEGUE_MOCAP names")
    return MOCAP


@pytest.fixture(scope="session")
def virtual_display() -> Iterator[str]:
    """A virtual X display of 800 x 600 pixels, started for these tests; its name, for DISPLAY."""
    for program, package in (("Xvfb", "xvfb"), ("xdotool", "xdotool")):
        if shutil.which(program) is None:
            unavailable(program, f"install it (Debian, Ubuntu: apt install {package})")
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "800x600x24", "-nolisten", "tcp"],
        pass_fds=(write,),
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    with os.fdopen(read) as told:
        number = told.readline().strip()  # written once it takes connections
    if not number:
        server.wait()
        pytest.fail(f"Xvfb ended at once, with status {server.returncode}")
    try:
        yield f":{number}"
    finally:
        server.terminate()
        server.wait()
