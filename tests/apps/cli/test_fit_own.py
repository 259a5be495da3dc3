"""`segue fit` on what `segue export` writes: the same results as `segue analyse`, without a word on columns."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from study.apps.cli import run


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A results folder of simulated observers with practice and checks, and its export."""
    folder = tmp_path_factory.mktemp("own") / "session"
    assert run(["simulate", "wang2004_session", "--participants", "5", "--out", str(folder)]) == 0
    table = folder / "answers.csv"
    assert run(["export", str(folder), "--out", str(table)]) == 0
    return folder, table


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, object]:
    capsys.readouterr()
    assert run([*arguments, "--json"]) == 0
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


def test_an_export_is_known_by_its_columns(exported: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    folder, table = exported
    rows = pd.read_csv(table)
    assert (rows["role"] != "trial").any(), "practice or checks are there to be left out"
    decided = ("--alpha", "0.01", "--confidence", "0.99")  # as the protocol's alpha has it
    found, known = printed(capsys, "fit", str(table), *decided), printed(capsys, "analyse", str(folder))
    for key in ("jnd", "preference", "ratings"):
        assert found[key].keys() == known[key].keys()
    assert [one["estimate"] for one in found["headline"]] == [one["estimate"] for one in known["headline"]]
    assert [one["interval"] for one in found["headline"]] == [one["interval"] for one in known["headline"]]
    last = rows[rows["role"] == "trial"].drop_duplicates(["participant", "study", "trial", "item"], keep="last")
    assert found["used"] == int((~last["missed"]).sum())


def test_practice_and_checks_never_count(exported: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    _, table = exported
    rows = pd.read_csv(table)
    name = rows.loc[rows["task"] == "same-different", "study"].iloc[0]
    columns = ["--level", "difference_frames", "--answer", "answer", "--participant", "participant"]
    found = printed(capsys, "fit", str(table), "--task", "same-different", *columns, "--where", f"study={name}")
    there = rows[(rows["study"] == name) & (rows["role"] == "trial") & ~rows["missed"]]
    assert found["used"] == len(there.drop_duplicates(["participant", "trial"], keep="last"))


def test_other_tables_need_a_task(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.csv").write_text("who,x,a\n1,2,3\n", encoding="utf-8")
    assert run(["fit", str(tmp_path / "a.csv")]) == 2
    assert "expected --task, since this is no export of segue's" in capsys.readouterr().err
