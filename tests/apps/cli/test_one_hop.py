"""`segue one-hop` from the command line: build, show, play, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
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


def test_hops_of_a_genre_are_preferred(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """The library's categories are the genres: at a high cost every hop is a dance, at none some are not."""
    hops = []
    for cost in (0, 3):
        out = tmp_path / f"{cost}.bin"
        build = ("one-hop", "build", "box", "walk", "dance", "--pair", "box", "dance", "--fps", 10, "--weight", 0.0005)
        assert answer(capsys, *build, "--genre", "dancing", cost, "--out", out)["transitions"] == 1
        entries = np.frombuffer(out.read_bytes(), "<i4").reshape(-1, 4)
        hops.append(np.mean(entries[entries[:, 0] >= 0, 0] == 2))
    assert hops[0] < hops[1] == 1.0
    waltz = refusal(capsys, *build, "--genre", "waltz", 1, "--out", tmp_path / "x.bin")
    assert "one of the clips' genres (boxing, dancing, walking), got 'waltz'" in waltz


SEARCH = ("--fps", 10, "--weight", 0.0005, "--stay", 4)


def test_more_hops_never_cost_more(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "chain.bvh"
    clips = ("one-hop", "chain", "dance", "box", "walk", "--pair", "dance", "box", *SEARCH)
    found = answer(capsys, *clips, "--at", 40, "--hops", 3, "--out", out)
    costs = found["costs"]
    assert isinstance(costs, list)
    assert costs == sorted(costs, reverse=True)
    table = tmp_path / "t.npz"
    assert run(["one-hop", "build", "dance", "box", "walk", "--pair", "dance", "box", *map(str, SEARCH),
                "--out", str(table)]) == 0  # fmt: skip
    capsys.readouterr()
    shown = answer(capsys, "one-hop", "show", table, "--at", "dance", "box", 40)["shown"]
    assert isinstance(shown, list)
    assert costs[0] == pytest.approx(shown[0]["cost"], abs=1e-6)
    steps = found["steps"]
    assert isinstance(steps, list)
    assert steps[-1]["clip"] == "box"
    assert read_bvh(out).frames == found["frames"]
    assert "choose an earlier one" in refusal(capsys, *clips, "--at", 239)


def test_walks_at_speeds_between_two_are_written_and_may_be_states(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    found = answer(capsys, "one-hop", "between", "walk_slow", "walk_fast", "--fps", 30, "--count", 2, "--out", tmp_path)
    files = [row["file"] for row in found["clips"]]
    assert files == [str(tmp_path / f"walk_slow_walk_fast_{number}.bvh") for number in (1, 2)]
    speeds = [found["slow_m_per_s"], *(row["speed_m_per_s"] for row in found["clips"]), found["fast_m_per_s"]]
    assert speeds == pytest.approx([0.8, 1.133, 1.467, 1.8], abs=0.02)
    assert [row["told"] for row in found["clips"]] == [[], []]
    pair = ("--pair", "walk_slow", "walk_slow_walk_fast_1")
    built = answer(capsys, "one-hop", "build", "walk_slow", *files, *SEARCH, *pair, "--out", tmp_path / "t.npz")
    assert built["found"] > 0
    assert run(["one-hop", "between", "dance", "walk", "--out", str(tmp_path)]) == 2
    assert "dance to end in steps that repeat, found none" in capsys.readouterr().err


def test_clips_that_do_not_overlap_are_connected(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "joined.bvh"
    found = answer(capsys, "one-hop", "connect", "walk", "tai_chi", "stand", *SEARCH, "--out", out)
    segments = found["segments"]
    assert isinstance(segments, list)
    assert [segments[0]["clip"], segments[-1]["clip"]] == ["walk", "tai_chi"]
    assert (segments[0]["start"], segments[0]["clip_start"]) == (0, 0)
    assert read_bvh(out).frames == found["frames"]
    assert found["hop"] in ("walk", "tai_chi", "stand")


@pytest.mark.gl
def test_transitions_by_rule_and_their_costs(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "costs.png"
    found = answer(capsys, "one-hop", "robustness", "dance", "box", *SEARCH, "--count", 5, "--out", out)
    rows = found["transitions"]
    assert isinstance(rows, list)
    assert len(rows) == 5
    assert all(row["cost"] <= row["direct"] + 1e-6 for row in rows)
    assert found["lower"] == sum(row["cost"] < row["direct"] for row in rows)
    assert out.read_bytes().startswith(b"\x89PNG")


def test_the_body_is_played_in_two_parts(capsys: pytest.CaptureFixture[str], tmp_path: Path, table: Path) -> None:
    clips = ("dance", "box", "walk", "--pair", "dance", "box", *SEARCH)
    parts = {}
    for part in ("lower", "upper"):
        parts[part] = tmp_path / f"{part}.npz"
        answer(capsys, "one-hop", "build", *clips, "--part", part, "--out", parts[part])
    trigger = ("--first", "dance", "--trigger", 40, "box")
    alone, both = (tmp_path / f"{name}.bvh" for name in ("alone", "both"))
    answer(capsys, "one-hop", "play", parts["lower"], *trigger, "--out", alone)
    played = answer(capsys, "one-hop", "play", parts["lower"], "--upper", parts["upper"], *trigger, "--out", both)
    assert played["upper_segments"]
    legs, whole = read_bvh(alone), read_bvh(both)
    np.testing.assert_allclose(legs.root_positions, whole.root_positions, atol=1e-6)
    differ = np.abs(legs.rotations - whole.rotations).max(axis=(0, 2)) > 1e-4
    names = {legs.skeleton.names[joint] for joint in np.flatnonzero(differ)}
    assert names
    assert not names & {legs.skeleton.names[legs.skeleton.role(role)] for role in ("pelvis", "hip.L", "knee.R")}
    refused = refusal(capsys, "one-hop", "play", parts["lower"], "--upper", table, *trigger, "--out", both)
    assert "found others in" in refused
    joint = refusal(capsys, "one-hop", "build", *clips, "--part", "upper", "--distance", "joint", "--out", "x.npz")
    assert "expected --distance pointcloud with --part" in joint


def test_a_wanted_place_is_reached(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    clips = ("one-hop", "reach", "walk", "run", "walk_turn_left", "--pair", "walk", "run", *SEARCH, "--at", 20)
    out = tmp_path / "reached.bvh"
    found = answer(capsys, *clips, "--forward", 2.5, "--within", 0.3, "--out", out)
    assert float(str(found["forward_m"])) == pytest.approx(2.5, abs=0.3)
    assert float(str(found["cost"])) >= float(str(found["cost_anywhere"]))
    assert read_bvh(out).frames == found["frames"]
    turned = answer(capsys, *clips, "--turn", 0, "--within-turn", 20)
    assert abs(float(str(turned["turn_degrees"]))) <= 20
    assert "found none; the best of all goes" in refusal(capsys, *clips, "--forward", 90)
    assert "give --forward, --left or --turn" in refusal(capsys, *clips)


def test_a_table_of_runs_says_the_same(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    build = ("one-hop", "build", "dance", "box", "--pair", "dance", "box", *SEARCH)
    whole, runs = tmp_path / "whole.bin", tmp_path / "runs.bin"
    large, small = answer(capsys, *build, "--out", whole), answer(capsys, *build, "--runs", "--out", runs)
    assert int(str(small["bytes"])) == runs.stat().st_size < int(str(large["bytes"])) == whole.stat().st_size
    for frame in (0, 50, 150):
        place = ("--at", "dance", "box", frame)
        first, second = (answer(capsys, "one-hop", "show", path, *place)["shown"] for path in (whole, runs))
        assert first == second
    assert "expected --out X.bin with --runs" in refusal(capsys, *build, "--runs", "--out", tmp_path / "t.npz")
