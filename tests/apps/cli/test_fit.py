"""`segue fit`: tables as other programs write them, and refusals that say which cell is at fault."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from study.apps.cli import run


def psychopy(path: Path) -> None:
    """PsychoPy: wide rows, blanks on instruction screens, one column a component; 2AFC on contrast."""
    rng = np.random.default_rng(1)
    rows = ["participant,trials.thisN,contrast,key_resp.keys,key_resp.corr,key_resp.rt,date", "7,,,space,,,2026-11-22"]
    for trial in range(400):
        contrast = 0.1 * (1 + trial % 7)
        right = rng.random() < 0.5 + 0.48 * norm.cdf((contrast - 0.4) / 0.1)
        rows.append(f"7,{trial},{contrast:.1f},left,{int(right)},{rng.random():.3f},2026-11-22")
    rows.append("7,400,0.4,,,,2026-11-22")
    path.write_text("\ufeff" + "\r\n".join(rows) + "\r\n", encoding="utf-8")


def jspsych(path: Path) -> None:
    """jsPsych: quoted cells, true and false, practice among the trials; yes-no by key."""
    rng = np.random.default_rng(2)
    rows = ['"trial_type","subject","phase","level","response","rt"', '"html-button","A","","","0","512"']
    for trial in range(600):
        level = trial % 6
        seen = rng.random() < 0.05 + 0.93 * norm.cdf(level - 2.5)
        phase = "practice" if trial < 60 else "test"
        rows.append(f'"image-keyboard","{"AB"[trial % 2]}","{phase}","{level}","{"j" if seen else "f"}","400"')
    path.write_text("\n".join(rows), encoding="utf-8")


def gorilla(path: Path) -> None:
    """Gorilla: many columns, semicolons as some spreadsheets save them; same-different by signed difference."""
    rng = np.random.default_rng(3)
    rows = ["Participant Private ID;Zone Type;Difference;Response"]
    for person in range(6):
        rows.append(f"{person};continue_button;;Next")
        for trial in range(84):
            difference = (-15, -10, -5, 0, 5, 10, 20)[trial % 7]
            delta = abs(difference) * 0.35
            chance = norm.sf((2 - delta) / 2**0.5) + norm.cdf((-2 - delta) / 2**0.5)
            answer = "Different" if rng.random() < chance else "Same"
            rows.append(f"{person};response_button_text;{difference};{answer}")
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def fitted(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, object]:
    assert run(["fit", *arguments, "--json"]) == 0
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


def test_psychopy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    psychopy(tmp_path / "data.csv")
    found = fitted(
        capsys,
        str(tmp_path / "data.csv"),
        *("--task", "2afc", "--level", "contrast", "--answer", "key_resp.corr", "--participant", "participant"),
    )
    assert (found["rows"], found["used"], found["blank"], found["missed"]) == (402, 400, 1, 1)
    threshold = found["pooled"]["threshold"]  # type: ignore[index]
    assert threshold["value"] == pytest.approx(0.4, abs=0.05)
    assert threshold["interval"]["low"] < 0.4 < threshold["interval"]["high"]
    assert found["likelihood"]["p_value"] > 0.01  # type: ignore[index]


def test_jspsych(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    jspsych(tmp_path / "data.csv")
    found = fitted(
        capsys,
        str(tmp_path / "data.csv"),
        *("--task", "yes-no", "--level", "level", "--answer", "response", "--yes", "j", "--participant", "subject"),
        *("--where", "phase=test"),
    )
    assert found["used"] == 540
    assert [row["participant"] for row in found["participants"]] == ["A", "B"]  # type: ignore[attr-defined]
    assert found["pooled"]["threshold"]["value"] == pytest.approx(2.5, abs=0.4)  # type: ignore[index]


def test_gorilla(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    gorilla(tmp_path / "data.csv")
    found = fitted(
        capsys,
        str(tmp_path / "data.csv"),
        *("--task", "same-different", "--level", "Difference", "--answer", "Response"),
        *("--participant", "Participant Private ID"),
    )
    assert found["participants"] == 6
    assert found["answers"] == 504
    for side in ("shorter", "longer"):
        assert found["model"]["jnd"][side]["frames"] == pytest.approx(8.4, abs=1.5)  # type: ignore[index]


def test_counts_by_level(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "data.csv").write_text("level\tright\tshown\n1\t10\t20\n2\t12\t20\n3\t16\t20\n4\t20\t20\n")
    found = fitted(
        capsys,
        str(tmp_path / "data.csv"),
        *("--task", "2afc", "--level", "level", "--answer", "right", "--shown", "shown", "--sigmoid", "weibull"),
    )
    assert found["levels"][2] == {"level": 3.0, "yes": 16.0, "shown": 20.0, "percent": 80.0}  # type: ignore[index]
    assert 1.5 < found["pooled"]["threshold"]["value"] < 3.5  # type: ignore[index]


@pytest.mark.parametrize(
    ("content", "more", "message"),
    [
        ("", (), "found an empty file"),
        ("level,answer\n", (), "expected rows under the heading"),
        ("Level,answer\n1,1\n", (), "expected a column 'level' for the stimulus level, found Level, answer; did you"),
        ("level,answer\n1,1\nhigh,0\n", (), "row 3, column 'level': expected a number as the stimulus level"),
        ("level,answer\n1,1\n2,left\n", (), "row 3, column 'answer': expected 1 or 0 (or such words), found 'left'"),
        ("level,answer\n1,k\n", ("--yes", "j"), "expected answers j, found only 'k'"),
        ("level,answer\n1,1\n", ("--where", "phase"), "expected --where COLUMN=VALUE, found 'phase'"),
        ("level,answer,p\n1,1,a\n", ("--where", "p=b"), "expected rows with p = b, found none; p holds a"),
        ("level,answer\n,1\n1,\n", (), "expected rows with a level and an answer, found none in 2 rows"),
        ("level,answer,n\n1,9,5\n", ("--shown", "n"), "row 2: expected at most n answers, found 9 of 5"),
        ("level,answer\n0,1\n1,1\n", ("--sigmoid", "weibull"), "expected levels above 0 for a Weibull"),
    ],
)
def test_refusals(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], content: str, more: tuple[str, ...], message: str
) -> None:
    path = tmp_path / "data.csv"
    path.write_text(content)
    assert run(["fit", str(path), "--task", "2afc", "--level", "level", "--answer", "answer", *more]) == 2
    refusal = capsys.readouterr().err
    assert message in refusal
    assert len(refusal.strip().splitlines()) == 1


@pytest.mark.parametrize("task", ["2afc", "yes-no", "same-different"])
@pytest.mark.parametrize("rows", [["1,1"], ["1,1", "2,1", "3,1"], ["0,0", "1,0", "2,0"], ["0,1", "0,0", "1,1"]])
def test_degenerate_data_give_a_statement(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], task: str, rows: list[str]
) -> None:
    path = tmp_path / "data.csv"
    path.write_text("\n".join(["level,answer", *rows]))
    found = fitted(capsys, str(path), "--task", task, "--level", "level", "--answer", "answer")
    assert found["answer"]


@pytest.mark.parametrize(("task", "level"), [("same-different", "diff"), ("2afc", "size")])
def test_motions_make_a_threshold_that_holds_for_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], task: str, level: str
) -> None:
    rng = np.random.default_rng(6)
    rows = ["who,clip,diff,size,answer"]
    for person, motion, difference in ((p, m, d) for p in range(8) for m in range(3) for d in (-12, -6, 0, 6, 9, 12)):
        for _ in range(4):
            delta = (0.25 + 0.1 * motion) * abs(difference)
            chance = norm.sf((2 - delta) / 2**0.5) if task == "same-different" else 0.5 + 0.5 * norm.cdf(delta - 2)
            rows.append(f"p{person},m{motion},{difference},{abs(difference)},{int(rng.random() < chance)}")
    (tmp_path / "data.csv").write_text("\n".join(rows), encoding="utf-8")
    columns = ["--task", task, "--level", level, "--answer", "answer", "--participant", "who"]
    found = fitted(capsys, str(tmp_path / "data.csv"), *columns, "--motion", "clip")
    assert {one["generalises_to"] for one in found["headline"]} == {"participants and motions"}
    assert "participants and motions" in found["headline"][0]["statement"]
    found = fitted(capsys, str(tmp_path / "data.csv"), *columns)
    assert {one["generalises_to"] for one in found["headline"]} == {"participants, for these motions"}
