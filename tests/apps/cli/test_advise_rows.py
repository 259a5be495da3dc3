"""What `advise` prints, `transition` and `blend-length` take, and they find the same."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import pytest

from study.apps.cli import run

SOME = ("walk", "run", "box", "stand_to_walk", "tai_chi")


def ask(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, Any]:
    status = run([*map(str, arguments), "--json"])
    printed = capsys.readouterr()
    assert status == 0, printed.err
    answer = json.loads(printed.out)
    assert isinstance(answer, dict)
    return answer


def type_back(
    capsys: pytest.CaptureFixture[str], out: Path, library: object, clips: tuple[object, ...] = (), fps: float = 30.0
) -> int:
    """Each row of the advice as a transition, and as a blend length; how many rows there were."""
    advice = ask(capsys, "advise", *clips, "--library", library, "--fps", fps, "--no-strips")
    assert advice["problems"] == []
    makes = {"slerp"}
    for row in advice["advice"]:
        clips = (row["source"], row["destination"], "--library", library, "--fps", row["fps"])
        points = ("--start", row["start_frame"], "--end", row["end_frame"], "--method", row["method"])
        made = ask(capsys, "transition", *clips, *points, "--out", out / "x.bvh")
        if row["make"] not in makes:  # each once: they take long
            makes.add(row["make"])
            advised = ask(capsys, "transition", *clips, *points, "--make", row["make"], "--out", out / "x.bvh")
            assert (advised["make"], advised["cost"]) == (row["make"], made["cost"])
        assert row["make"] == (row["makes"][0]["make"] if row["makes"] else "slerp")
        found = ask(capsys, "blend-length", *clips, *points)
        for answer in (made, found):
            assert answer["blend_frames"] == row["blend_frames"]
            assert answer["cost"] == pytest.approx(row["cost"], rel=1e-12)
            for key in ("start_frame", "start_s", "start_file_frame", "end_frame", "end_s", "end_file_frame"):
                assert answer[key] == row[key]
        assert found["note"] in made["note"]
        assert found["note"] in row["note"]
    return len(advice["advice"])


@pytest.mark.parametrize("fps", [30.0, 60.0])
def test_rows_of_the_synthetic_library_can_be_typed_back(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, fps: float
) -> None:
    some = SOME if fps == 30.0 else SOME[:3]
    assert type_back(capsys, tmp_path, "synthetic", some, fps) == len(some) * (len(some) - 1)


@pytest.mark.slow
def test_all_rows_of_the_synthetic_library_can_be_typed_back(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert type_back(capsys, tmp_path, "synthetic") > 400


@pytest.mark.mocap
def test_rows_of_captured_motion_can_be_typed_back(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, mocap: Path
) -> None:
    """Short clips among them, which supply fewer lengths than are asked for."""
    assert type_back(capsys, tmp_path, mocap / "cmu", ("run_fast", "stand_to_walk", "box")) == 6
    short = ("dataset-1_punch_normal_001", "dataset-1_run_active_001", "dataset-1_walk_tired_001")
    assert type_back(capsys, tmp_path, mocap / "bandai", short) == 6


def test_the_table_has_seconds_and_the_files_own_frames_and_says_how_to_type_a_row(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert run(["advise", "walk", "run", "--no-strips"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("Frames at 30 fps")
    assert lines[1].split()[:10] == ["from", "to", "method", "make", "start", "s", "in", "file", "end", "s"]
    typed = shlex.split(lines[-1].partition(": segue ")[2])
    assert run([*typed[:-1], str(tmp_path / "typed.bvh")]) == 0
    said, make = capsys.readouterr().out, lines[2].split()[3]
    assert make in typed
    # A spring goes on for longer than the blend that it matches.
    assert f"{lines[2].split()[10]} of them blended" in said or make == "inertialize"


def test_a_transition_says_what_its_method_found_and_gave_up(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    points = ("box", "dance", "--start", 40, "--end", 100, "--method", "velocity")
    found = ask(capsys, "blend-length", *points)
    made = ask(capsys, "transition", *points, "--out", tmp_path / "x.bvh")
    assert made["unclipped_s"] == found["unclipped_s"]
    assert (made["method"], made["fps"], made["blend_s"]) == ("velocity", 30.0, made["blend_frames"] / 30)
    assert made["seconds"] == pytest.approx(made["frames"] / 30)
    if found["note"]:
        assert found["note"] in made["note"]


def test_a_length_that_the_range_cuts_is_said_in_print_too(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    found = ask(capsys, "blend-length", "box", "dance", "--start", 20, "--end", 93, "--method", "velocity")
    assert found["unclipped_s"] > 2.0
    assert "clipped to 60" in found["note"]
    typed = ["transition", "box", "dance", "--start", "20", "--end", "93", "--method", "velocity"]
    assert run([*typed, "--out", str(tmp_path / "x.bvh")]) == 0
    assert found["note"] in capsys.readouterr().out


@pytest.mark.parametrize("fps", [30, 60])
def test_fixed_is_a_third_of_a_second_in_both_verbs(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, fps: int
) -> None:
    points = ("walk", "run", "--fps", fps, "--start", 100, "--end", 120, "--method", "fixed")
    assert ask(capsys, "blend-length", *points)["blend_frames"] == fps // 3
    assert ask(capsys, "transition", *points, "--out", tmp_path / "x.bvh")["blend_frames"] == fps // 3


def test_lengths_are_held_where_the_clips_end(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for method in ("fixed", "geodesic", "velocity", "timewarp"):
        points = ("walk", "run", "--start", 60, "--end", 4, "--method", method)
        found = ask(capsys, "blend-length", *points)
        made = ask(capsys, "transition", *points, "--out", tmp_path / "x.bvh")
        assert found["blend_frames"] == made["blend_frames"] <= 5
        if method != "velocity" or found["unclipped_s"] * 30 > 5:
            assert "the clips supply blends of up to" in found["note"]
            assert found["note"] in made["note"]
    assert run(["transition", "walk", "run", "--start", "60", "--end", "4", "--frames", "9", "--out", "x.bvh"]) == 2
    said = capsys.readouterr().err
    assert "lacks 4 frames before its first" in said
    assert "restrict" not in said
