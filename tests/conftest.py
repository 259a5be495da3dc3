"""Fixtures for all tests: the real motion capture where there is some, and a refusal to skip where CI requires all."""

from __future__ import annotations

import os
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
