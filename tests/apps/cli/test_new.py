"""`segue new`: first protocols that can be shown at once, copies of published ones, and what is refused."""

from __future__ import annotations

import io
import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from study.apps.cli import run
from study.errors import FileError
from study.experiment.protocol.proofreading import to_do
from study.experiment.protocol.whole import load_protocol, parse_protocol, protocols_folder
from study.experiment.starting import OF_TASK, ROOMS
from study.experiment.stimuli.outlook import look_ahead
from study.experiment.stimuli.prepare import check
from study.motion.clip import trim
from study.motion.library import open_library
from study.motion.readers.bvh_writing import write_bvh
from study.motion.synthetic import synthesize
from study.tasks.registry import NAMES

PUBLISHED = sorted(path.stem for path in protocols_folder().glob("*.toml"))


def write_clip(file: Path, motion: str, seconds: float) -> None:
    """A synthetic motion as a file of somebody's own, which can't be continued."""
    clip = synthesize(motion, seconds=seconds + 1.0, fps=30.0)
    write_bvh(trim(clip, 0, round(30 * seconds)), file)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two clips of one's own, here, and nobody at a terminal."""
    write_clip(tmp_path / "walk.bvh", "walk", 3.0)
    write_clip(tmp_path / "run.bvh", "run", 2.4)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    return tmp_path


@pytest.fixture
def at_terminal(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Somebody at a terminal, who answers so."""

    def answering(*answers: str) -> None:
        terminal = io.StringIO("".join(f"{answer}\n" for answer in answers))
        monkeypatch.setattr(terminal, "isatty", lambda: True)
        monkeypatch.setattr(sys, "stdin", terminal)

    return answering


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert run(["new", *arguments]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    return printed.err


def files_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_every_task_has_a_first_protocol_and_is_in_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert set(OF_TASK) == set(NAMES)
    assert run(["new", "--help"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert [name for name in NAMES if name not in said] == []


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("task", NAMES)
def test_the_protocol_can_be_shown_as_it_is(capsys: pytest.CaptureFixture[str], task: str) -> None:
    assert run(["new", "walk.bvh", "run.bvh", "--study", task, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["files"] == ["my_study.toml", "library.toml"]
    assert told["next"] == [
        "segue check my_study.toml --library .",
        "segue serve my_study.toml --library .",
        "segue report results/my_study",
    ]
    protocol, library = load_protocol("my_study.toml"), open_library(".")
    assert (protocol.name, protocol.studies[0].task) == ("my_study", task)
    ends = [(one.source, one.destination) for one in protocol.transitions]
    assert ends == [("walk", "run"), ("run", "walk"), ("walk", "walk")]
    assert look_ahead(protocol, library).problems == ()
    assert [note for note in to_do(protocol) if "consent.contact says 'FILL IN" not in note] == []
    # What was fitted is said, is in the file, and is no less than the clips supply.
    taken = next(room for room in ROOMS if room.longest_frames == protocol.points.longest_frames
                 and room.around_s == protocol.stimuli.entry_s == protocol.stimuli.exit_s)  # fmt: skip
    said = told["notes"][0]
    assert "run is the shortest (2.40 s)" in said
    assert f"{taken.around_s:g} s before and after blends of up to {taken.longest_frames} frames" in said
    wider = ROOMS[ROOMS.index(taken) - 1]
    text = protocol.text.replace(f"longest_frames = {taken.longest_frames}", f"longest_frames = {wider.longest_frames}")
    text = re.sub(r"(entry_s|exit_s) = [\d.]+", rf"\1 = {wider.around_s}", text)
    text = re.sub(
        r"differences_frames = \[(.*)\]",
        f"differences_frames = {[-3 * wider.step_frames, *([0] * (task == 'yes-no')), 4 * wider.step_frames]}",
        text,
    )
    assert check(parse_protocol(text), library) != []


def test_check_takes_it(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    (folder / "motions").mkdir()
    for file in ("walk.bvh", "run.bvh"):
        (folder / file).rename(folder / "motions" / file)
    arguments = ["--study", "preference", "--name", "mine", "--out", "studies"]
    assert run(["new", "motions/walk.bvh", "motions/run.bvh", *arguments]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[-3] == "segue check studies/mine.toml --library motions"
    assert lines[-1] == "segue report results/mine"
    assert run(lines[-3].split()[1:]) == 0
    checked = capsys.readouterr().out
    assert "mine: all that it shows can be shown with the library motions." in checked
    assert checked.count("To do:") == 1


def test_a_library_file_names_the_clips_and_is_never_replaced(folder: Path) -> None:
    assert run(["new", "walk", "run.bvh", "--library", ".", "--study", "rating"]) == 0
    described = (folder / "library.toml").read_text()
    assert '[clips."walk"]  # 90 frames at 30 fps, 3.00 s' in described
    (folder / "library.toml").write_text('[clips.walk]\nfile = "walk.bvh"\ncategory = "walking"\n')
    assert run(["new", "walk", "run", "--library", ".", "--study", "rating", "--name", "other"]) == 0
    assert 'category = "walking to run"' in (folder / "other.toml").read_text()
    assert (folder / "library.toml").read_text().startswith("[clips.walk]\n")


def test_a_folder_of_motions_where_nobody_may_write_will_do(
    capsys: pytest.CaptureFixture[str], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise FileError("library.toml: can't be written")

    monkeypatch.setattr("study.motion.library_file.write_whole", refuse)
    assert run(["new", "walk.bvh", "run.bvh", "--study", "rating"]) == 0
    assert "no library.toml was written: library.toml: can't be written" in capsys.readouterr().err
    assert files_in(folder) == ["my_study.toml", "run.bvh", "walk.bvh"]


def test_motions_that_are_long_enough_are_shown_as_in_2004(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    assert run(["new", "walk", "run", "jog", "--library", "synthetic", "--study", "preference"]) == 0
    told = capsys.readouterr().out
    assert "Fitted" not in told
    assert "segue check my_study.toml\n" in told
    protocol = load_protocol(folder / "my_study.toml")
    assert (protocol.stimuli.entry_s, protocol.stimuli.exit_s, protocol.points.longest_frames) == (2.0, 2.0, 35)
    assert [(one.source, one.destination, one.category) for one in protocol.transitions[:3]] == [
        ("walk", "run", "walking to running"),
        ("run", "jog", "running"),
        ("jog", "walk", "running to walking"),
    ]


def test_any_file_name_will_do(folder: Path) -> None:
    for file, motion in (("Läufe 1.bvh", "run"), ("Läufe-1.bvh", "walk"), ('"步".bvh', "walk")):
        write_clip(folder / file, motion, 3.0)
    assert run(["new", "Läufe 1.bvh", "Läufe-1.bvh", '"步".bvh', "--study", "rating"]) == 0
    protocol = load_protocol("my_study.toml")
    assert [one.name for one in protocol.transitions] == [
        "laufe_1_to_laufe_1_2", "laufe_1_2_to_clip", "clip_to_laufe_1", "practice",
    ]  # fmt: skip


def test_clips_that_are_too_short_are_refused(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    write_clip(folder / "hop.bvh", "walk", 0.5)
    said = refusal(capsys, "walk.bvh", "hop.bvh", "--study", "preference")
    assert "Expected motions that supply 0.2 s before and after blends of up to 12 frames" in said
    assert "'hop' takes 0.50 s" in said
    assert "frames are missing" in said or "frame is missing" in said
    assert "cyclic = true in library.toml" in said
    assert files_in(folder) == ["hop.bvh", "run.bvh", "walk.bvh"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("walk.bvh", "run.bvh"), "expected --study, found none; name one: same-different, whether two"),
        (("walk.bvh", "run.bvh", "--study", "triads"), "found triads; name one: same-different, whether two"),
        (("--study", "rating"), "expected two clips or more, found 0; name files, as in segue new walk.bvh run.bvh"),
        (("walk.bvh", "--study", "rating"), "expected two clips or more, found 1"),
        (("walk.bvh", "./walk.bvh", "--study", "rating"), "expected each clip once, found walk, walk"),
        (("walk.bvh", "other/walk.bvh", "--study", "rating"), "expected clips of one folder, found some elsewhere"),
        (("walk.bvh", "jog", "--study", "rating"), "expected clips of one folder, found some elsewhere"),
        (("walk", "ran", "--library", ".", "--study", "rating"), "found 'ran'. Did you mean 'run'?"),
        (("--from", "demo", "--study", "rating"), "expected --from PROTOCOL, or clips and --study, found both"),
        (("--from", "demmo"), "did you mean 'demo'?"),
        (("--from", "demo", "--name", "My Study"), "expected --name of small letters, digits, - and _, found"),
    ],
)
def test_refusals(capsys: pytest.CaptureFixture[str], folder: Path, arguments: tuple[str, ...], words: str) -> None:
    (folder / "other").mkdir()
    write_clip(folder / "other" / "walk.bvh", "walk", 3.0)
    assert words in refusal(capsys, *arguments)
    assert files_in(folder) == ["other", "run.bvh", "walk.bvh"]


@pytest.mark.usefixtures("folder")
def test_a_terminal_is_asked_for_what_is_not_given(
    capsys: pytest.CaptureFixture[str], at_terminal: Callable[..., None]
) -> None:
    at_terminal("triads", "preference", ".", "run walk")
    assert run(["new"]) == 0
    asked = capsys.readouterr().err
    assert re.search(r"^preference +which of two transitions is more natural$", asked, re.MULTILINE)
    assert "Its motions: run, walk" in asked
    protocol = load_protocol("my_study.toml")
    assert protocol.studies[0].task == "preference"
    assert protocol.transitions[0].source == "run"


def test_a_protocol_that_is_there_is_replaced_only_where_somebody_says_so(
    capsys: pytest.CaptureFixture[str], folder: Path, at_terminal: Callable[..., None]
) -> None:
    mine = folder / "demo.toml"
    mine.write_text("mine")
    assert "found one; it is kept. Give another --name or --out, or --overwrite" in refusal(capsys, "--from", "demo")
    at_terminal("n")
    assert "it is kept" in refusal(capsys, "--from", "demo")
    assert mine.read_text() == "mine"
    at_terminal("y")
    assert run(["new", "--from", "demo"]) == 0
    assert load_protocol(mine).name == "demo"
    mine.write_text("mine")
    at_terminal()
    assert run(["new", "--from", "demo", "--overwrite"]) == 0
    assert load_protocol(mine).name == "demo"


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_published_protocol_is_copied_with_its_comments(
    capsys: pytest.CaptureFixture[str], folder: Path, name: str
) -> None:
    original = (protocols_folder() / f"{name}.toml").read_text(encoding="utf-8")
    assert run(["new", "--from", name]) == 0
    assert (folder / f"{name}.toml").read_text(encoding="utf-8") == original
    assert f"segue check {name}.toml\n" in capsys.readouterr().out
    assert run(["new", "--from", name, "--name", "mine", "--library", "my motions"]) == 0
    assert "segue serve mine.toml --library 'my motions'\nsegue report results/mine" in capsys.readouterr().out
    copy = (folder / "mine.toml").read_text(encoding="utf-8")
    assert copy.replace('name = "mine"', f'name = "{name}"', 1) == original
    assert load_protocol("mine.toml").name == "mine"


@pytest.mark.mocap
@pytest.mark.usefixtures("folder")
def test_two_trials_of_cmu(mocap: Path) -> None:
    trials = mocap / "cmu" / "subjects" / "16"
    arguments = [str(trials / "16_47.amc"), str(trials / "16_35.amc"), "--study", "same-different"]
    before = files_in(trials)
    assert run(["new", *arguments]) == 0
    protocol = load_protocol("my_study.toml")
    assert protocol.transitions[0].category == "walking to running"
    assert look_ahead(protocol, open_library(trials)).problems == ()
    assert files_in(trials) == before  # Segue's index says what a library.toml would
