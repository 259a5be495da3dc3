"""`--database`: every verb that has to do with answers finds them in PostgreSQL, and no verb prints a password."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from postgres_server import PASSWORD, without_password
from serving import PROTOCOL

from study.apps.cli import run
from study.experiment.store.responses import open_responses
from study.experiment.store.sessions import find_session

ROOT = Path(__file__).parents[3]


@pytest.fixture
def protocol(tmp_path: Path) -> Path:
    file = tmp_path / "served.toml"
    file.write_text(PROTOCOL, encoding="utf-8")
    return file


@pytest.fixture
def ask(capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """`ask(arguments ...)`: a verb's JSON; a password is nowhere in what it printed."""

    def ask(*arguments) -> Callable[..., Any]:
        status = run([*map(str, arguments), "--json"])
        printed = capsys.readouterr()
        assert status == 0, printed.err
        assert "wombat" not in printed.out + printed.err
        return json.loads(printed.out)

    return ask


def test_verbs_say_the_same_of_answers_in_either_database(
    ask: Callable[..., Any], protocol: Path, tmp_path: Path, postgres_url: str
) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    elsewhere = ("--database", postgres_url)
    ask("simulate", protocol, "--participants", 3, "--out", here)
    told = ask("simulate", protocol, "--participants", 3, "--out", there, *elsewhere)
    assert "segue:***@127.0.0.1" in told["database"]
    assert not (there / "responses.sqlite").exists()
    assert ask("simulate", protocol, "--participants", 3, "--out", there, *elsewhere)["answers"] == 0
    assert ask("analyse", there, *elsewhere) == ask("analyse", here)
    tables = [pd.read_csv(ask("export", folder, *more)["file"]) for folder, more in ((here, ()), (there, elsewhere))]
    pd.testing.assert_frame_equal(*(table.drop(columns="answered_at") for table in tables))
    pages = [ask("report", here)["report"], ask("report", there, *elsewhere)["report"]]
    assert all("3 simulated observers" in Path(page).read_text(encoding="utf-8") for page in pages)
    for file in there.rglob("*"):
        assert file.is_dir() or b"wombat" not in file.read_bytes(), file


def test_the_database_may_be_named_by_the_environment(
    ask: Callable[..., Any], protocol: Path, tmp_path: Path, postgres_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A URL on the command line is seen by all users of a machine."""
    monkeypatch.setenv("SEGUE_DATABASE", without_password(postgres_url))
    monkeypatch.setenv("PGPASSWORD", PASSWORD)
    ask("simulate", protocol, "--participants", 1, "--out", tmp_path / "results")
    assert not (tmp_path / "results" / "responses.sqlite").exists()
    assert ask("analyse", tmp_path / "results")["quality"]["participants"] == 1
    monkeypatch.setenv("PGPASSWORD", "another")
    with pytest.raises(AssertionError, match="password authentication failed"):
        ask("analyse", tmp_path / "results")


def test_answers_that_are_not_there_are_not_made_up(
    capsys: pytest.CaptureFixture[str], protocol: Path, tmp_path: Path, ask: Callable[..., Any]
) -> None:
    ask("simulate", protocol, "--participants", 1, "--out", tmp_path / "results")
    (tmp_path / "results" / "responses.sqlite").unlink()
    for verb in ("analyse", "export"):
        assert run([verb, str(tmp_path / "results")]) == 2
        assert "found no database" in capsys.readouterr().err
        assert not (tmp_path / "results" / "responses.sqlite").exists()


def test_a_database_about_other_stimuli_is_refused(
    capsys: pytest.CaptureFixture[str], protocol: Path, tmp_path: Path, postgres_url: str, ask: Callable[..., Any]
) -> None:
    ask("simulate", protocol, "--participants", 1, "--out", tmp_path / "one", "--database", postgres_url)
    manifest = tmp_path / "one" / "manifest.json"
    known = json.loads(manifest.read_text())["stimuli"][0]["id"]
    manifest.write_text(manifest.read_text().replace(known, "of-another-version"))
    again = ("simulate", protocol, "--participants", 2, "--out", tmp_path / "one", "--database", postgres_url)
    assert run([*map(str, again)]) == 2
    said = capsys.readouterr().err
    assert "expected sessions with the stimuli of this results folder, found that of 'sim-001'" in said


@pytest.mark.gl
def test_sessions_are_served_from_postgresql(protocol: Path, tmp_path: Path, postgres_url: str) -> None:
    arguments = ["serve", str(protocol), "--out", str(tmp_path / "results"), "--port", "0"]
    child = subprocess.Popen(
        [sys.executable, "-m", "study.apps.cli", *arguments], cwd=ROOT, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "SEGUE_DATABASE": postgres_url},
    )  # fmt: skip
    said = []
    try:
        for line in child.stderr:
            said.append(line)
            if line.startswith("answers"):
                break
        address = next(line.split()[1] for line in said if line.startswith("participants"))
        message = {"page": "the-page-of-p1", "parameters": {"participant": "p1"}}
        headers = {"content-type": "application/json", "x-segue-page": message["page"]}
        request = urllib.request.Request(f"{address}api/begin", json.dumps(message).encode(), headers)
        with urllib.request.urlopen(request, timeout=30) as answer:
            assert json.loads(answer.read())["kind"] == "consent"
    finally:
        child.terminate()
        said += list(child.stderr)
        child.stderr.close()
        child.wait()
    assert "segue:***@127.0.0.1" in "".join(said)
    assert "wombat" not in "".join(said)
    with open_responses(postgres_url) as responses:
        assert find_session(responses, "p1") is not None
