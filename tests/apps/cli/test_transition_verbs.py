"""The verbs about one transition: cost matrices, cost curves."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest

from study.apps.cli import run


def ask(capsys: pytest.CaptureFixture[str], *arguments: object) -> dict[str, object]:
    status = run([*map(str, arguments), "--json"])
    printed = capsys.readouterr()
    assert status == 0, printed.err
    answer = json.loads(printed.out)
    assert isinstance(answer, dict)
    return answer


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("metric", ["joint", "pointcloud"])
def test_cost_matrix_is_written_with_its_extremes(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, metric: str
) -> None:
    out = tmp_path / "costs.npy"
    answer = ask(capsys, "cost-matrix", "walk", "run", "--metric", metric, "--out", out)
    costs = np.load(out)
    assert list(costs.shape) == answer["shape"]
    assert costs.min() == pytest.approx(answer["min"])
    assert costs.max() == pytest.approx(answer["max"])
    assert tuple(answer["argmin"]) == np.unravel_index(int(np.argmin(costs)), costs.shape)  # type: ignore[arg-type]
    assert sorted(tmp_path.iterdir()) == [out]


def test_cost_matrix_is_drawn_dark_where_it_is_cheap(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    from PIL import Image

    out = tmp_path / "costs.png"
    answer = ask(capsys, "cost-matrix", "walk", "stand", "--weights", "lee2002", "--out", out)
    assert answer["weights"] == "lee2002"
    grey = np.asarray(Image.open(out).convert("L"), dtype=float)
    assert grey.min() < 30 < 225 < grey.max()


def test_a_large_matrix_keeps_its_least_cost_in_the_picture() -> None:
    from study.report.costs import Reducer

    costs = np.random.default_rng(0).uniform(1.0, 2.0, (700, 430)).astype(np.float32)
    costs[611, 17] = 0.5
    reducer = Reducer((700, 430), most=100)
    for start in range(0, 700, 256):
        reducer.add(range(start, min(start + 256, 700)), costs[start : start + 256])
    assert reducer.small.shape == (100, 62)
    assert reducer.small[611 // 7, 17 // 7] == 0.5
    assert np.isfinite(reducer.small).all()
    assert reducer.small[3, 4] == costs[21:28, 28:35].min()


def test_blend_length_writes_the_curve_of_the_cost_and_of_each_joint(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "curve.csv"
    points = ("--start", 60, "--end", 80)
    answer = ask(capsys, "blend-length", "walk", "run", *points, "--out", out)
    rows = rows_of(out)
    assert [float(row["cost"]) for row in rows] == pytest.approx(answer["costs"])
    weights = {"hip": 1.0, "knee": 0.0901, "shoulder": 0.7884, "elbow": 0.0247}
    for row in rows:
        parts = sum(weights[role[:-2]] * float(row[role]) for role in row if role[-2:] in (".L", ".R"))
        assert parts == pytest.approx(float(row["cost"]), rel=1e-9)
    picture = tmp_path / "curve.png"
    velocity = ask(capsys, "blend-length", "walk", "run", *points, "--method", "velocity", "--out", picture)
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert velocity["joint"] == max(velocity["differences"], key=velocity["differences"].get)  # type: ignore


def test_warped_costs_come_as_numbers_averaged_or_as_printed(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    tables = []
    for option in ([], ["--printed-sum"]):
        out = tmp_path / "warped.csv"
        arguments = ["blend-length", "walk", "run", "--start", "60", "--end", "80", "--method", "timewarp"]
        ask(capsys, *arguments, *option, "--out", out)
        tables.append(rows_of(out))
    pairs = [(int(row["source_frames"]), int(row["destination_frames"])) for row in tables[0]]
    every = range(1, 61)
    assert pairs == [(a, b) for a in every for b in every if max(a, b) <= 2 * min(a, b)]
    for mean, total in zip(tables[0][::97], tables[1][::97], strict=True):
        longer = max(int(mean["source_frames"]), int(mean["destination_frames"]))
        assert float(total["cost"]) == pytest.approx(float(mean["cost"]) * longer, rel=1e-9)


@pytest.mark.parametrize("specification", ["centre", "left"])
def test_transitions_are_specified_as_section_2_compares(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, specification: str
) -> None:
    out = tmp_path / "joined.bvh"
    made = ask(
        capsys, "transition", "walk", "run", "--start", 70, "--end", 80, "--frames", 10,
        "--specification", specification, "--out", out,
    )  # fmt: skip
    assert made["blend_start"] == (65 if specification == "centre" else 70)


@pytest.mark.gl
def test_labelling_goes_on_where_it_stopped_and_gives_weights(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = tmp_path / "labels.csv"
    verb = ("label", "walk", "dance", "--strips", "--best", 1, "--random", 1, "--out", table)

    def answers(text: str) -> None:
        monkeypatch.setattr("sys.stdin", io.StringIO(text))

    answers("g\nb\ns\nq\n")
    first = ask(capsys, *verb)
    assert (first["good"], first["bad"], first["skip"], first["known"]) == (1, 1, 1, 0)
    answers("g\nb\n")  # and then the terminal closes
    second = ask(capsys, *verb)
    assert (second["good"], second["bad"], second["known"]) == (1, 1, 3)
    assert second["left"] == first["left"] - 2  # type: ignore[operator]
    rows = rows_of(table)
    assert [row["label"] for row in rows] == ["good", "bad", "skip", "good", "bad"]
    assert len({(row["source_frame"], row["destination_frame"]) for row in rows}) == 5
    assert len(list((tmp_path / "labels").glob("*.png"))) >= 5
    fitted = ask(capsys, "fit-weights", table, "--transfer", "walk", "jog")
    weights = fitted["weights"]
    assert isinstance(weights, dict)
    assert max(weights.values()) == 1.0
    assert weights["hip.L"] == weights["hip.R"]
    assert (fitted["good"], fitted["bad"]) == (2, 2)
    assert {"mean_frames", "median_frames", "deviations"} == set(fitted["cross_validation"])  # type: ignore[call-overload]
    assert fitted["transfer"]["of"] == 4  # type: ignore[index]


@pytest.mark.gl
def test_advice_comes_as_table_csv_json_and_strips(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    answer = ask(capsys, "advise", "walk", "run", "box", "--out", tmp_path)
    advice = answer["advice"]
    assert isinstance(advice, list)
    assert len(advice) == 6
    assert answer["cyclic"] == {"walk": True, "run": True, "box": False}
    methods = {(row["source"], row["destination"]): row["method"] for row in advice}
    assert methods["walk", "box"] == methods["walk", "run"] == "geodesic"
    rows = rows_of(tmp_path / "advice.csv")
    assert [int(row["blend_frames"]) for row in rows] == [row["blend_frames"] for row in advice]
    assert json.loads((tmp_path / "advice.json").read_text(encoding="utf-8")) == answer
    for row in advice:
        assert Path(row["strip"]).read_bytes().startswith(b"\x89PNG")
    assert run(["advise", "dance", "box", "--no-strips"]) == 0
    assert "velocity" in capsys.readouterr().out
    assert run(["advise", "walk"]) == 2


def test_a_joint_can_blend_for_a_time_of_its_own(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    from study.motion.readers.registry import read_clip

    clips = []
    for name, option in (("together.bvh", ()), ("apart.bvh", ("--joint", "shoulder.L=4"))):
        out = tmp_path / name
        points = ("--start", 60, "--end", 80, "--frames", 12, "--keep-slide")
        ask(capsys, "transition", "walk", "run", *points, *option, "--out", out)
        clips.append(read_clip(out))
    differ = np.abs(clips[0].rotations - clips[1].rotations).max(axis=(0, 2)) > 1e-4
    assert np.flatnonzero(differ).tolist() == [clips[0].skeleton.role("shoulder.L")]
    for wrong in ("shoulder=4", "shoulder.L=0", "shoulder.L"):
        arguments = ["--start", "60", "--end", "80", "--frames", "12", "--out", "x.bvh", "--joint", wrong]
        assert run(["transition", "walk", "run", *arguments]) == 2
        assert "ROLE=FRAMES" in capsys.readouterr().err


@pytest.mark.parametrize(("make", "blended"), [("inertialize", 20), ("inertialize-quintic", 11), ("dead-blend", 11)])
def test_a_switch_takes_the_place_of_a_blend(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, make: str, blended: int
) -> None:
    points = ("transition", "walk", "jog", "--start", 60, "--end", 120, "--method", "geodesic")
    answer = ask(capsys, *points, "--make", make, "--out", tmp_path / "made.bvh")
    assert (answer["make"], answer["blend_start"], answer["blend_frames"]) == (make, 60, blended)
    assert "switched after source frame 59 to destination frame 110" in str(answer["note"])
    assert ask(capsys, "motions", "inspect", tmp_path / "made.bvh")["frames"] == answer["frames"]


@pytest.mark.parametrize("method", ["geodesic", "timewarp"])
def test_motions_are_brought_into_step(capsys: pytest.CaptureFixture[str], tmp_path: Path, method: str) -> None:
    points = ("transition", "walk", "jog", "--start", 60, "--end", 120, "--method", method)
    in_step = ask(capsys, *points, "--make", "registration-curve", "--out", tmp_path / "in_step.bvh")
    plain = ask(capsys, *points, "--out", tmp_path / "plain.bvh")
    assert "registration curve" in str(in_step["note"])
    for key in ("frames", "blend_start", "blend_stop", "cost"):
        assert in_step[key] == plain[key]
    assert (tmp_path / "in_step.bvh").read_bytes() != (tmp_path / "plain.bvh").read_bytes()


def test_a_registration_curve_is_made_anew_at_the_rate_of_a_file(
    capsys: pytest.CaptureFixture[str], mocap: Path, tmp_path: Path
) -> None:
    verb = ("transition", "walk", "walk_fast", "--library", mocap / "cmu", "--start", 60, "--end", 40, "--frames", 24)
    in_step = (*verb, "--make", "registration-curve")
    fine = ask(capsys, *in_step, "--out", tmp_path / "fine.bvh")
    coarse = ask(capsys, *in_step, "--fps", 30, "--out", tmp_path / "coarse.bvh")
    assert (fine["fps"], coarse["fps"]) == (120, 30)
    assert fine["blend_s"] == pytest.approx(coarse["blend_s"], abs=0.03)
    assert fine["seconds"] == pytest.approx(coarse["seconds"], abs=0.06)
    assert "registration curve" in str(fine["note"])


def test_a_switch_is_written_at_the_rate_of_its_file_with_the_same_moments(
    capsys: pytest.CaptureFixture[str], mocap: Path, tmp_path: Path
) -> None:
    verb = ("transition", "walk", "walk_fast", "--library", mocap / "cmu", "--start", 60, "--end", 40, "--frames", 12)
    switch = (*verb, "--make", "inertialize", "--halflife", 0.08)
    coarse = ask(capsys, *switch, "--fps", 30, "--out", tmp_path / "coarse.bvh")
    fine = ask(capsys, *switch, "--out", tmp_path / "fine.bvh")
    assert fine["fps"] == 120
    for answer in (coarse, fine):
        answer["switch_s"] = (answer["blend_start"] - 1) / answer["fps"]  # type: ignore[operator]
        answer["rest_s"] = (answer["frames"] - answer["blend_start"]) / answer["fps"]  # type: ignore[operator]
    assert fine["switch_s"] == pytest.approx(coarse["switch_s"], abs=0.004)
    assert fine["rest_s"] == pytest.approx(coarse["rest_s"], abs=0.04)
    assert fine["blend_s"] == pytest.approx(0.0798 * 4.789, abs=0.005)


@pytest.mark.parametrize(("options", "said"), [
    (("--make", "dead-blend", "--halflife", "0.1"), "expected no --halflife with --make dead-blend"),
    (("--halflife", "0.1"), "expected no --halflife with --make slerp"),
    (("--make", "inertialize", "--joint", "hip.L=3"), "expected neither --joint nor --specification"),
    (("--make", "inertialize", "--specification", "centre"), "expected neither --joint nor --specification"),
])  # fmt: skip
def test_options_that_a_switch_does_not_know_are_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, options: tuple[str, ...], said: str
) -> None:
    verb = ["transition", "walk", "jog", "--start", "60", "--end", "120", "--frames", "9", *options]
    assert run([*verb, "--out", str(tmp_path / "x.bvh")]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
