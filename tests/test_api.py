"""The package `segue`: thin, lazy, the same as the command line, and documented as it is."""

from __future__ import annotations

import ast
import base64
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import segue
from study.apps.cli import run
from study.motion.clip import joint_positions
from study.motion.readers.bvh_writing import write_bvh

ROOT = Path(__file__).resolve().parents[1]
FILES = sorted((ROOT / "segue").glob("*.py"))


def test_it_is_thin_and_imports_nothing_of_the_apps() -> None:
    assert sum(len(path.read_text(encoding="utf-8").splitlines()) for path in FILES) < 600
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                assert not (node.module or "").startswith("study.apps"), path


def test_importing_it_imports_nothing_heavy() -> None:
    heavy = ("numpy", "pandas", "scipy", "moderngl", "av")
    code = f"import sys, segue; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert done.stdout.strip() == "[]"


def test_every_public_name_is_there_and_explained() -> None:
    assert set(dir(segue)) == set(segue.__all__)
    for name in segue.__all__:
        assert name == "__version__" or getattr(segue, name).__doc__
        assert getattr(segue, name) is getattr(segue, name), f"a module of this name takes its place: {name}"
    with pytest.raises(AttributeError, match="found 'blends'"):
        getattr(segue, "blends")  # noqa: B009


def test_the_reference_is_written_from_the_docstrings() -> None:
    done = subprocess.run([sys.executable, ROOT / "scripts" / "api.py", "--check"], check=False, cwd=ROOT)
    assert done.returncode == 0, "run scripts/api.py"


@pytest.mark.parametrize("method", ["geodesic", "velocity", "timewarp"])
def test_a_blend_is_that_of_the_command_line(method: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    walk, jog = (segue.read(name, fps=30) for name in ("walk", "jog"))
    for clip, name in ((walk, "walk"), (jog, "jog")):
        write_bvh(clip, tmp_path / f"{name}.bvh")
    files = [str(tmp_path / f"{name}.bvh") for name in ("walk", "jog")]
    where = ["--start", "60", "--end", "110", "--method", method]
    assert run(["transition", *files, *where, "--out", str(tmp_path / "joined.bvh"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    made = segue.blend(*map(segue.read, files), start=60, end=110, method=method)
    assert made.blend_stop - made.blend_start == told["blend_frames"]
    joined = segue.read(tmp_path / "joined.bvh", as_is=True)
    np.testing.assert_allclose(joint_positions(made.clip), joint_positions(joined), atol=2e-3)
    found = segue.blend_length(*map(segue.read, files), start=60, end=110, method=method)
    assert found.blend_frames == told["blend_frames"]


def test_what_does_not_fit_is_refused_with_what_does() -> None:
    walk = segue.read("walk")
    with pytest.raises(segue.SegueError, match="that joins two clips, fixed, velocity"):
        segue.blend(walk, walk, start=60, end=80, method="geodesc")
    with pytest.raises(segue.SegueError, match=r"Expected settings of geodesic .*, found halflife_s"):
        segue.blend(walk, walk, start=60, end=80, halflife_s=0.1)
    with pytest.raises(segue.SegueError, match="no answers"):
        segue.fit([1.0], [0], [0])


@pytest.mark.gl
def test_a_played_state_machine_is_drawn_in_as_many_poses(tmp_path: Path) -> None:
    clips = [segue.trim(segue.read(name), 0, 60) for name in ("dance", "box")]
    played = segue.play(clips, segue.one_hop(clips, weight=0.001), [(5, 1)])
    wide, narrow = (segue.strip(played, poses=poses).save(tmp_path / f"{poses}.png") for poses in (8, 3))
    widths = [int.from_bytes(file.read_bytes()[16:20], "big") for file in (wide, narrow)]
    assert widths[0] > 2 * widths[1], "eight poses beside three"


def test_a_view_holds_its_file(tmp_path: Path) -> None:
    shown = segue.strip(segue.trim(segue.read("walk"), 0, 30), poses=3)
    assert shown.save(tmp_path / "strip.png").read_bytes()[1:4] == b"PNG"
    assert base64.b64encode(shown.data).decode() in shown._repr_html_()
    film = segue.film(segue.trim(segue.read("walk"), 0, 10), size=(64, 48))
    assert b"ftyp" in film.data[:16]
    assert "<video" in film._repr_html_()


def test_a_study_is_simulated_and_analysed_as_by_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = segue.Study("geodesic_vs_fixed", out=tmp_path / "own").simulate(4, careless=0.0)
    assert run(["simulate", "geodesic_vs_fixed", "--participants", "4", "--out", str(tmp_path / "cli")]) == 0
    assert run(["analyse", str(tmp_path / "cli"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out.partition("{")[2].join(["{", ""]))
    headline = study.analyse().headline
    assert [one.estimate for one in headline] == pytest.approx([one["estimate"] for one in said["headline"]])
    assert set(study.answers["participant"]) == set(
        segue.Study("geodesic_vs_fixed", out=tmp_path / "cli").answers["participant"]
    )
    with pytest.raises(segue.SegueError, match=r"use Study\.analyse"):
        segue.analyse(study.answers).plot()
