"""Power that was simulated for a folder's protocol stands on its page; figures and data are files of their own."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from study.apps.cli import run
from study.errors import AnalysisError
from study.report.document import write_report
from study.report.power import read_power

MakeFolder = Callable[..., Path]


def power(**changed: Any) -> dict[str, Any]:
    points = [
        {"participants": people, "found": found, "studies": 200, "power": found / 200,
         "interval": {"low": found / 200 - 0.06, "high": min(found / 200 + 0.06, 1.0), "confidence": 0.95}}
        for people, found in ((8, 80), (16, 140), (24, 190))
    ]  # fmt: skip
    aim = "find a preference of 65% at the level 0.01"
    result = {"protocol": "small", "study": "geodesic_vs_fixed", "aim": aim, "points": points, "target": 0.8}
    return {**result, "needed": 19, "note": "", "answers_per_participant": 8, **changed}


def test_power_in_the_folder_is_shown_as_figure_table_and_words(results_folder: MakeFolder) -> None:
    folder = results_folder(2, videos=0)
    (folder / "power.json").write_text(json.dumps(power()), encoding="utf-8")
    page = write_report(folder, resamples=20).read_text(encoding="utf-8")
    assert "to find a preference of 65% at the level 0.01 in 80% of studies" in page
    assert "19 participants are needed" in page
    table = json.loads((folder / "tables" / "power.json").read_text(encoding="utf-8"))
    assert [(row["participants"], row["power"]) for row in table["rows"]] == [(8, 0.4), (16, 0.7), (24, 0.95)]
    figure = (folder / "figures" / "power_1.svg").read_text(encoding="utf-8")
    assert "simulated studies" in figure
    assert "16 participants: 0.70" in figure


@pytest.mark.parametrize("content", ["no JSON", "[]", json.dumps({"study": "jnd"})])
def test_another_file_of_that_name_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "power_old.json").write_text(content, encoding="utf-8")
    with pytest.raises(AnalysisError, match=r"power_old\.json: expected what `segue power --json` prints"):
        read_power(tmp_path)


def test_every_figure_is_a_drawing_that_other_programs_can_read(written: Path) -> None:
    figures = sorted((written.parent / "figures").glob("*.svg"))
    assert {"jnd_curve", "jnd_thresholds", "geodesic_vs_fixed_forest", "naturalness_ratings"} <= {
        f.stem for f in figures
    }
    for figure in figures:
        root = ET.fromstring(figure.read_text(encoding="utf-8"))
        assert root.get("width", "").endswith("pt")
        assert "var(" not in figure.read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", ["csv", "psych-ds", "bids"])
def test_the_verb_exports(results_folder: MakeFolder, capsys: pytest.CaptureFixture[str], kind: str) -> None:
    folder = results_folder(1, videos=0)
    assert run(["export", str(folder), "--to", kind, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    place = Path(told.get("file") or told["folder"])
    assert place == folder / ("answers.csv" if kind == "csv" else kind)
    assert place.exists()
