"""Clips as the command line takes them: one clip by path, name and number; its defects, its unit, its frame rate."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.apps.cli import run
from study.motion import quaternions as quat
from study.motion.clip import Clip
from study.motion.readers.bvh import read_bvh
from study.motion.readers.bvh_writing import write_bvh
from study.motion.synthetic import synthesize
from study.motion.units import CMU_UNIT


def ask(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, object]:
    status = run([*map(str, arguments), "--json"])
    printed = capsys.readouterr()
    assert status == 0, printed.err
    answer = json.loads(printed.out)
    assert isinstance(answer, dict)
    return answer


def with_t_pose(clip: Clip) -> Clip:
    """The clip with a T-pose put in front, as converters do it."""
    rotations, path = (np.concatenate([array[:1], array]) for array in (clip.rotations, clip.root_positions))
    path[0] = 2.0 * path[1] - path[2]
    rotations[0, 1:] = quat.IDENTITY
    for name, angle in (("LeftArm", np.pi / 2), ("RightArm", -np.pi / 2)):
        rotations[0, clip.skeleton.names.index(name)] = quat.from_axis_angle([0.0, 0.0, 1.0], angle)
    return replace(clip, rotations=rotations, root_positions=path)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two clips with a T-pose in front, one under a number of the CMU index, in the unit of that database."""
    for name, file in (("walk", "07_01.bvh"), ("run", "gallop.bvh")):
        clip = with_t_pose(synthesize(name, seconds=3.0, fps=60.0))
        write_bvh(clip, tmp_path / file, metres_per_unit=CMU_UNIT)
    return tmp_path


def spellings(folder: Path) -> list[tuple[str, ...]]:
    library = ("--library", str(folder))
    return [
        ("walk", "gallop", *library),
        ("07_01", "gallop", *library),
        (str(folder / "07_01.bvh"), str(folder / "gallop.bvh")),
        ("07_01.bvh", str(folder / "gallop.bvh"), *library),
    ]


@pytest.mark.gl
def test_path_name_and_number_give_the_same_bytes(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    written: dict[str, set[bytes]] = {"bvh": set(), "npy": set(), "png": set()}
    for number, clips in enumerate(spellings(folder)):
        outs = {ending: folder / "out" / f"{number}.{ending}" for ending in written}
        outs["bvh"].parent.mkdir(exist_ok=True)
        points = ("--start", 30, "--end", 40, "--frames", 10)
        ask(capsys, "transition", *clips, *points, "--out", outs["bvh"])
        ask(capsys, "cost-matrix", *clips, "--out", outs["npy"])
        ask(capsys, "preview", clips[0], *clips[2:], "--out", outs["png"])
        for ending, out in outs.items():
            written[ending].add(out.read_bytes())
    assert {ending: len(contents) for ending, contents in written.items()} == {"bvh": 1, "npy": 1, "png": 1}


def test_defects_are_told_in_one_line_and_kept_where_asked(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    clip = str(folder / "gallop.bvh")
    verb = ["cost-matrix", clip, clip, "--fps", "60", "--json"]
    assert run(verb) == 0
    printed = capsys.readouterr()
    said = [line for line in printed.err.splitlines() if "defects" in line]
    assert said[0] == (
        f"{clip}: defects dropped or mended: an added T-pose; frame 0 is frame 1 of the file (--as-is keeps them)"
    )
    assert json.loads(printed.out)["shape"] == [180, 180]
    assert run([*verb, "--as-is"]) == 0
    printed = capsys.readouterr()
    assert f"{clip}: defects kept: an added T-pose" in printed.err
    assert json.loads(printed.out)["shape"] == [181, 181]


def test_a_transition_is_written_in_the_unit_and_at_the_rate_of_its_source(
    capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    out = folder / "joined.bvh"
    points = ("walk", "gallop", "--library", folder, "--start", 30, "--end", 40, "--frames", 10, "--out", out)
    made = ask(capsys, "transition", *points)
    read = read_bvh(out)
    assert (read.fps, made["fps"], read.frames) == (60.0, 60.0, made["frames"])
    assert read.metres_per_unit == CMU_UNIT
    assert made["blend_start"] == 59
    assert made["blend_frames"] == 21
    told = ask(capsys, "transition", *points, "--fps", 30, "--unit", "m")
    read = read_bvh(out)
    assert (read.fps, told["fps"], told["blend_frames"], told["blend_start"]) == (30.0, 30.0, 10, 30)
    assert read.metres_per_unit == 1.0


def test_advice_on_a_folder_is_about_every_file_once(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    (folder / "empty.bvh").write_bytes(b"")
    (folder / "library.toml").write_text('[clips.gallop]\nfile = "gallop.bvh"\ncyclic = false\n')
    answer = ask(capsys, "advise", "--library", folder)
    assert answer["cyclic"] == {"walk": True, "gallop": False}
    assert [problem.split(":")[0] for problem in answer["problems"]] == ["empty"]  # type: ignore[attr-defined]
    assert len(answer["advice"]) == 2  # type: ignore[arg-type]
    assert run(["advise", "walk", "empty", "--library", str(folder)]) == 2
    assert "the file is empty" in capsys.readouterr().err


def test_a_first_library_toml_changes_nothing_and_is_not_written_twice(
    capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    (folder / "broken.bvh").write_text("hello")
    before = ask(capsys, "motions", "list", "--library", folder)
    answer = ask(capsys, "motions", "list", "--library", folder, "--write")
    assert answer["written"] == str(folder / "library.toml")
    assert ask(capsys, "motions", "list", "--library", folder)["motions"] == before["motions"]
    text = (folder / "library.toml").read_text(encoding="utf-8")
    assert '[clips."gallop"]  # 181 frames at 60 fps, 3.02 s; a unit is 0.0564444 m' in text
    assert '[clips."broken"]  # can\'t be read:' in text
    assert run(["motions", "list", "--library", str(folder), "--write"]) == 2
    assert "It is never overwritten" in capsys.readouterr().err
    assert run(["motions", "list", "--write"]) == 2
    assert "expected --library FOLDER with --write" in capsys.readouterr().err


def test_inspect_reads_a_file_as_its_library_toml_says(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    (folder / "library.toml").write_text('[defaults]\nfps = 50\nunit = "cm"\njoints = {"toe.L" = "LeftFoot"}\n')
    answer = ask(capsys, "motions", "inspect", folder / "gallop.bvh")
    assert (answer["fps"], answer["metres_per_unit"], answer["frames"]) == (50.0, 0.01, 181)
    assert answer["roles"]["toe.L"] == "LeftFoot"  # type: ignore[index]
    assert ask(capsys, "motions", "inspect", folder / "gallop.bvh", "--fps", 25)["fps"] == 25.0


def test_beats_of_a_library_toml_are_kept_to(folder: Path) -> None:
    from study.apps.cli.one_hop import known_beats, load_clips

    (folder / "library.toml").write_text('[clips.gallop]\nfile = "gallop.bvh"\nbeats = [0.0, 1.0, 2.0, 9.0]\n')
    names = ("walk", "gallop")
    clips = load_clips(names, str(folder), 60.0)
    beats = known_beats(names, str(folder), clips)
    assert [found.tolist() for found in beats] == [[], [59, 119]], "the T-pose took a frame from the clip's start"
