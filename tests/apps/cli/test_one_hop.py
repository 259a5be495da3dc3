"""`segue one-hop` from the command line: build, show, play, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from study.apps.cli import run
from study.motion.readers.bvh import read_bvh


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("one-hop") / "dances.bin"
    arguments = ["dance", "box", "walk", "--pair", "dance", "box", "--fps", "15", "--weight", "0.0005"]
    assert run(["one-hop", "build", *arguments, "--out", str(path)]) == 0
    return path


def answer(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, object]:
    status = run([*map(str, arguments), "--json"])
    printed = capsys.readouterr()
    assert status == 0, printed.err
    found = json.loads(printed.out)
    assert isinstance(found, dict)
    return found


def refusal(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert run(list(map(str, arguments))) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    return printed.err


def test_build_finds_a_weight_and_beats(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "new" / "t.npz"
    built = answer(capsys, "one-hop", "build", "dance", "dance_turns", "--fps", 15, "--out", out, "--on-beat")
    assert built["files"] == [str(out)]
    assert out.exists()
    assert built["transitions"] == 2
    assert built["bytes"] == 16 * int(str(built["entries"]))
    assert float(str(built["mean_cost"])) <= float(str(built["mean_direct_cost"]))
    assert float(str(built["weight"])) > 0
    assert list(out.parent.iterdir()) == [out]


def test_adaptive_blends(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "t.npz"
    arguments = ("one-hop", "build", "dance", "box", "--pair", "dance", "box", "--fps", 10, "--out", out, "--adaptive")
    assert "no --longest with --adaptive" in refusal(capsys, *arguments, "--longest", 30)
    built = answer(capsys, *arguments, "--stay", 4)
    assert built["bytes"] == 24 * int(str(built["entries"]))
    shown = answer(capsys, "one-hop", "show", out, "--at", "dance", "box", 20)
    assert shown["columns"][4:] == ["blend_first", "blend_second"]


def test_show_gives_entries(capsys: pytest.CaptureFixture[str], table: Path) -> None:
    shown = answer(capsys, "one-hop", "show", table, "--at", "dance", "box", 20)
    assert shown["fps"] == 15.0
    entries = shown["shown"]
    assert isinstance(entries, list)
    assert entries[0]["hop"] in ("dance", "box", "walk")
    assert {"offset", "stay_source", "stay_hop"} <= entries[0].keys()


def test_play_writes_the_motion(capsys: pytest.CaptureFixture[str], table: Path, tmp_path: Path) -> None:
    lengths = {}
    for method in ("one-hop", "direct"):
        out = tmp_path / f"{method}.bvh"
        arguments = ("one-hop", "play", table, "--first", "dance", "--trigger", 20, "box", "--method", method)
        played = answer(capsys, *arguments, "--out", out)
        lengths[method] = read_bvh(out).frames
        assert played["frames"] == lengths[method]
        segments = played["segments"]
        assert isinstance(segments, list)
        assert segments[-1]["clip"] == "box"
    assert lengths["one-hop"] == lengths["direct"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("build", "dance", "dance", "--out", "x.npz"), "names of their own, found dance more than once"),
        (("build", "dance", "box", "--out", "x.txt"), "ends in .npz, .bin or .json, found 'x.txt'"),
        (("build", "dance", "box", "--out", "x.npz", "--pair", "dance", "waltz"), "found 'waltz'"),
        (("build", "dance", "box", "--out", "x.npz", "--offset", "1", "--start", "2"), "either --offset or --start"),
        (("build", "dance", "box", "--out", "x.npz", "--longest", "20", "--weight", "0"), "two blends, 60 frames"),
        (("show", "nosuch.npz"), "nosuch.npz"),
    ],
)
def test_refusals(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert words in refusal(capsys, "one-hop", *arguments)
    assert not list(tmp_path.iterdir())
