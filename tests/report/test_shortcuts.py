"""What gives pairs away, in the report: tables from a manifest's audit; what participants chose, counted by hand."""

from __future__ import annotations

import csv
import json
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from study.report.document import write_report

MakeFolder = Callable[..., Path]


def frame(**other: float) -> dict[str, float]:
    return {"right": 0.0, "down": 0.0, "size": 1.0, "pose": 0.0, **other}


def with_audit(folder: Path) -> Path:
    """Comparisons last 5% longer a level; that of walking ends larger, that of the other transition smaller."""
    path = folder / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["audit"] = [
        {
            "pair": pair["name"],
            "seconds": [4.0, 4.0 + 0.02 * (10 if pair["difference_frames"] is None else pair["difference_frames"])],
            "first": frame(),
            "last": frame()
            if pair["difference_frames"] == 0
            else frame(size=1.2 if pair["motion"] == "walking" else 0.8, right=-0.3),
            "speeds_m_s": [1.0, 1.0],
            "paths_m": [4.0, 4.2],
        }
        for pair in manifest["pairs"]
        if len(pair["stimuli"]) > 1
    ]
    path.write_text(json.dumps(manifest))
    return folder


def table(folder: Path, name: str) -> list[dict[str, str]]:
    with (folder / "tables" / f"{name}.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.fixture
def reported(results_folder: MakeFolder) -> Path:
    folder = with_audit(results_folder())
    write_report(folder, resamples=50)
    return folder


def test_every_study_of_pairs_has_its_table_and_sentence(reported: Path) -> None:
    rows = table(reported, "shortcuts_jnd")
    assert {row["difference_frames"] for row in rows} == {"-15", "-10", "-5", "5", "10", "20"}
    assert all(50 <= float(row["percent"]) <= 100 for row in rows)
    assert len(table(reported, "shortcuts_geodesic_vs_fixed")) == 5
    assert not (reported / "tables" / "shortcuts_naturalness.csv").exists()  # single stimuli
    page = (reported / "report.html").read_text()
    assert "an observer who sees nothing but the size in the last frame could be right in" in page
    assert "How often participants chose the stimulus with more of a property" in page
    assert len(table(reported, "pair_differences")) == 2 * 7 + 2


def test_what_participants_chose_is_counted_as_by_hand(reported: Path) -> None:
    with sqlite3.connect(reported / "responses.sqlite") as database:
        rows: list[tuple[Any, ...]] = database.execute(
            "SELECT motion, chose_a FROM answers WHERE study = 'geodesic_vs_fixed' AND chose_a IS NOT NULL"
        ).fetchall()
    chose_b = [not a for _, a in rows]
    share_b = sum(chose_b) / len(rows)
    larger = [b == (motion == "walking") for (motion, _), b in zip(rows, chose_b, strict=True)]
    expected = [share_b if motion == "walking" else 1 - share_b for motion, _ in rows]
    found = {row["cue"]: row for row in table(reported, "shortcut_choices")}
    assert set(found) == {
        "longer stimulus",
        "figure further left in the last frame",
        "larger figure in the last frame",
    }
    for cue, percent, by_method in (
        ("longer stimulus", 100 * share_b, 100 * share_b),
        ("figure further left in the last frame", 100 * share_b, 100 * share_b),
        ("larger figure in the last frame", 100 * sum(larger) / len(rows), 100 * sum(expected) / len(rows)),
    ):
        assert int(found[cue]["answers"]) == len(rows)
        assert float(found[cue]["percent"]) == pytest.approx(percent)
        assert float(found[cue]["expected_percent"]) == pytest.approx(by_method)


def test_a_folder_of_an_older_version_has_no_such_tables(results_folder: MakeFolder) -> None:
    folder = results_folder()
    write_report(folder, resamples=50)
    assert not [path for path in (folder / "tables").iterdir() if "shortcut" in path.name]
    assert "seen alone" not in (folder / "report.html").read_text()
