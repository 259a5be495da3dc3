"""Scratch folders: gone at the end, and after a kill cleared away by the next one; never those of a living process."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from renderer.files import scratch_folder

ROOT = Path(__file__).parents[2]

HOLD = """
import sys
from renderer.files import scratch_folder
with scratch_folder("segue-test") as folder:
    (folder / "0.job").write_bytes(b"large")
    print(folder, flush=True)
    sys.stdin.readline()
"""


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A system's temporary folder of our own."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path


def test_a_scratch_folder_is_gone_at_the_end(temporary: Path) -> None:
    with scratch_folder("segue-test") as folder:
        assert folder.parent == temporary
        assert str(os.getpid()) in folder.name
    with pytest.raises(ZeroDivisionError), scratch_folder("segue-test"):
        _ = 1 / 0
    assert not list(temporary.iterdir())


@pytest.mark.skipif(os.name != "posix", reason="elsewhere it can't be asked whether a process lives")
def test_what_a_killed_process_left_is_cleared_away_by_the_next(temporary: Path) -> None:
    child = subprocess.Popen(
        [sys.executable, "-c", HOLD], cwd=ROOT, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    with child:
        assert child.stdout is not None
        held = Path(child.stdout.readline().strip())
        foreign = temporary / "segue-test-notes"
        foreign.mkdir()
        with scratch_folder("segue-test"):
            assert (held / "0.job").exists(), "it belongs to a process that lives"
        child.kill()
    with scratch_folder("segue-test"):
        assert not held.exists()
    assert list(temporary.iterdir()) == [foreign]
