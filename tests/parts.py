"""A missing optional part of the machine skips a test, or fails it where every part is required."""

from __future__ import annotations

import os
import shutil
import subprocess
from typing import NoReturn

import pytest


def is_in_distribution(package: str) -> bool:
    """Whether this system's distribution has a package; where none can be asked, it counts as having it."""
    if shutil.which("apt-cache") is None:
        return True
    environment = {**os.environ, "LC_ALL": "C"}
    asked = subprocess.run(
        ["apt-cache", "policy", package], capture_output=True, text=True, check=True, env=environment
    )
    return "Candidate: " in asked.stdout and "Candidate: (none)" not in asked.stdout


def unavailable(part: str, how: str, package: str | None = None) -> NoReturn:
    """Skip a test whose optional part is missing; fail it where every part is required (SEGUE_REQUIRE_ALL=1).

    `package` names a system package that some distributions lack; where this one lacks it, the test is always skipped.
    """
    message = f"{part} is missing: {how}"
    if os.environ.get("SEGUE_REQUIRE_ALL") == "1" and (package is None or is_in_distribution(package)):
        pytest.fail(message)
    pytest.skip(message)
