"""The command line as a user meets it: exit statuses, one line for a refusal, JSON on standard output."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from study import __version__
from study.apps.cli import run
from study.apps.cli.group import VERBS

ROOT = Path(__file__).parents[3]


def ask(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, object]:
    """A verb's JSON; nothing else may stand on standard output."""
    status = run([*map(str, arguments), "--json"])
    printed = capsys.readouterr()
    assert status == 0, printed.err
    answer = json.loads(printed.out)
    assert isinstance(answer, dict)
    return answer


def refusal(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The one line with which bad input is refused, with exit status 2 and nothing on standard output."""
    status = run([str(argument) for argument in arguments])
    printed = capsys.readouterr()
    assert status == 2, printed.err
    assert printed.out == ""
    lines = printed.err.splitlines()
    assert len(lines) == 1, printed.err
    assert lines[0].startswith("segue: ")
    return lines[0]


def test_help_names_every_verb(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--help"]) == 0
    shown = capsys.readouterr().out
    for verb in VERBS:
        assert f"\n  {verb} " in shown


def test_the_command_line_runs_as_a_module_too() -> None:
    asked = [sys.executable, "-m", "study.apps.cli", "--version"]
    told = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=True)
    assert __version__ in told.stdout


def test_matrix_products_take_one_thread_each() -> None:
    told = "from threadpoolctl import threadpool_info as all; print([one['num_threads'] for one in all()])"
    asked = f"from study.apps.cli import main\ntry:\n    main()\nfinally:\n    import numpy; {told}"
    environment = {name: value for name, value in os.environ.items() if not name.endswith("NUM_THREADS")}
    command = [sys.executable, "-c", asked, "-h"]
    shown = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    assert shown.stdout.splitlines()[-1] == "[1]"


def test_every_verb_is_in_the_readme_or_the_docs() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    for verb in VERBS:
        assert f"segue {verb}" in text, f"`segue {verb}` is documented nowhere"


def test_a_verb_that_is_not_there_names_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert "Did you mean 'render'?" in refusal(capsys, "rendr", "x.toml")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("check", "nosuch"), "Expected a protocol file or the name of one"),
        (("motions", "inspect", "nosuch.bvh"), "nosuch.bvh"),
        (("blend-length", "walk", "run", "--start", "1"), "--end"),
        (("blend-length", "walk", "rum", "--start", "1", "--end", "70"), "run"),
        (("blend-length", "walk", "run", "--start", "99999", "--end", "70"), "99999"),
        (("transition", "walk", "run", "--start", "60", "--end", "80", "--out", "x.mp4"), "--method or --frames"),
        (("preview", "walk", "--out", "x.gif"), "expected a name that ends in .mp4 or .png"),
        (("preview", "walk", "--out", "x.mp4", "--size", "12"), "expected --size as WIDTHxHEIGHT"),
        (("motions", "list", "--library", "nosuchfolder"), "nosuchfolder"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_bad_input_is_refused_in_one_line(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], words: str
) -> None:
    assert words in refusal(capsys, *arguments)


def test_blend_length_gives_the_cost_of_every_length(capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "blend-length", "walk", "run", "--start", 60, "--end", 80, "--method", "geodesic")
    costs = answer["costs"]
    assert isinstance(costs, list)
    assert len(costs) == 60
    assert answer["blend_frames"] == costs.index(min(costs)) + 1
    assert answer["cost"] == min(costs)
    assert answer["blend_s"] == pytest.approx(answer["blend_frames"] / 30)  # type: ignore[operator]


def test_a_transition_is_written_and_read_again(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "joined.bvh"
    made = ask(capsys, "transition", "walk", "run", "--start", 60, "--end", 80, "--frames", 10, "--out", out)
    read = ask(capsys, "motions", "inspect", out)
    assert read["frames"] == made["frames"]
    assert read["fps"] == 30.0
    assert {"seconds", "joints", "roles", "defects"} <= read.keys()


def test_motions_are_listed_with_their_library(capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "motions", "list")
    assert answer["synthetic"] is True
    names = [motion["name"] for motion in answer["motions"]]  # type: ignore[attr-defined]
    assert {"walk", "run", "stand_to_walk", "box", "tai_chi"} <= set(names)


@pytest.mark.gl
def test_a_film_of_a_transition_is_cut_around_the_blend_and_its_parts_have_colours_of_their_own(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """By its pixels: blue before the blend, purple in it, orange after, and the figure is large and in the middle."""
    import av

    out = tmp_path / "x.mp4"
    points = ("--start", 100, "--end", 80, "--frames", 10)
    made = ask(capsys, "transition", "walk", "run", *points, "--out", out, "--size", "320x180", "--view", "side")
    assert made["frames"] > 130
    with av.open(str(out)) as film:
        pictures = [frame.to_ndarray(format="rgb24").astype(int) for frame in film.decode(video=0)]
    assert len(pictures) == 60 + 10 + 60
    hues = []
    for picture in pictures:
        seen = np.abs(picture - picture[0, 0]).max(axis=2) > 24
        rows, columns = np.nonzero(seen)
        assert np.ptp(rows) > 0.55 * 180
        assert abs(columns.mean() - 160) < 40
        red, _, blue = picture[seen].mean(axis=0)
        hues.append(red - blue)
    before, within, after = (np.mean(hues[part]) for part in (slice(0, 60), slice(61, 69), slice(70, None)))
    assert before < -30 < within - 10
    assert within < after - 30


@pytest.mark.parametrize("ending", ["png", "mp4"])
def test_preview_draws_a_strip_or_a_video(capsys: pytest.CaptureFixture[str], tmp_path: Path, ending: str) -> None:
    out = tmp_path / f"walk.{ending}"
    answer = ask(capsys, "preview", "stand_to_walk", "--out", out, "--size", "160x120")
    assert answer["file"] == str(out)
    magic = out.read_bytes()[:12]
    assert magic.startswith(b"\x89PNG") if ending == "png" else magic[4:8] == b"ftyp"


@pytest.mark.gl
def test_doctor_says_what_draws(capsys: pytest.CaptureFixture[str]) -> None:
    answer = ask(capsys, "doctor")
    assert answer["able"] is True
    assert answer["kind"]
    assert "libx264" in str(answer["h264"])


@pytest.mark.mocap
def test_inspect_finds_what_is_wrong_with_a_real_file(capsys: pytest.CaptureFixture[str], mocap: Path) -> None:
    answer = ask(capsys, "motions", "inspect", mocap / "cmu_bvh" / "05_05.bvh")
    kinds = {defect["kind"] for defect in answer["defects"]}  # type: ignore[attr-defined]
    assert len(kinds) >= 2, "the added T-pose frame and the flipping hips are both there"
    assert answer["fps"] == 120.0


def test_check_lists_what_can_not_be_shown_and_says_so_by_its_status(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    protocol = tmp_path / "far.toml"
    published = (ROOT / "protocols" / "demo.toml").read_text(encoding="utf-8")
    protocol.write_text(published.replace('"walk"', '"walkk"'), encoding="utf-8")
    assert run(["check", str(protocol)]) == 2
    printed = capsys.readouterr()
    assert "'walkk'" in printed.out
    assert "Did you mean" in printed.out


def test_check_tells_the_time_and_what_is_to_be_written(capsys: pytest.CaptureFixture[str]) -> None:
    found = ask(capsys, "check", "geodesic_vs_fixed", "--texts")
    assert found["problems"] == []
    assert 3 <= found["minutes"] <= found["minutes_at_most"] <= 15  # type: ignore[operator]
    alike, flawed, note = found["notes"]  # type: ignore[misc]
    assert "geodesic and fixed differ by less than the just noticeable difference" in alike
    assert "stimuli move as their motions don't" in flawed
    assert "consent.contact" in note
    read = {one["where"]: one["text"] for one in found["texts"]}  # type: ignore[attr-defined]
    assert f"about {found['minutes']} minutes" in read["consent.text"].replace("\n", " ")
    assert "texts" not in ask(capsys, "check", "geodesic_vs_fixed")


def test_simulate_takes_the_number_of_participants_from_the_protocol(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    text = (ROOT / "protocols" / "demo.toml").read_text(encoding="utf-8")
    protocol = tmp_path / "small.toml"
    protocol.write_text(text, encoding="utf-8")
    assert run(["simulate", str(protocol), "--out", str(tmp_path / "out")]) == 2
    assert "participants in the protocol, found neither" in capsys.readouterr().err
    protocol.write_text(text.replace("seed = 7", "seed = 7\nparticipants = 2"), encoding="utf-8")
    found = ask(capsys, "simulate", protocol, "--out", tmp_path / "out", "--badly-shown", 1.0)
    assert found["participants"] == 2
    assert found["answers"] == 2 * 2 * 17  # every trial is shown twice where each showing stalls


@pytest.mark.gl
def test_doctor_s_status_says_that_nothing_can_draw(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SEGUE_GL", "nosuch")
    assert run(["doctor", "--quiet"]) == 2
    assert capsys.readouterr().out == ""
