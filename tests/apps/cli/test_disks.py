"""Every verb on disks that refuse: a refusal in one line with exit status 2, and nothing half written.

A limit on the size of files stands for a full disk: the system refuses each write in the same place. The verbs run in
one process of their own, which alone has the limit.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from serving import PROTOCOL, unfilmed

from study.apps.cli import run
from study.apps.cli.group import VERBS
from study.experiment.store.databases import try_to_write
from study.experiment.store.responses import open_responses
from study.files import write_whole

ROOT = Path(__file__).parents[3]

# What each verb writes, below the folder OUT; STUDY is a finished study elsewhere.
WRITES = {
    "new": ["new", "--from", "demo", "--out", "OUT/x"],
    "preview": ["preview", "walk", "--out", "OUT/x.mp4", "--size", "160x120"],
    "strip": ["preview", "walk", "--out", "OUT/x.png"],
    "blend-length": ["blend-length", "walk", "run", "--start", "60", "--end", "80", "--out", "OUT/x.csv"],
    "curve": ["blend-length", "walk", "run", "--start", "60", "--end", "80", "--out", "OUT/x.png"],
    "transition": ["transition", "walk", "run", "--start", "60", "--end", "80", "--frames", "9", "--out", "OUT/x.bvh"],
    "cost-matrix": ["cost-matrix", "walk", "run", "--out", "OUT/x.npy"],
    "matrix": ["cost-matrix", "walk", "run", "--out", "OUT/x.png"],
    "label": ["label", "walk", "run", "--strips", "--best", "1", "--worst", "0", "--random", "0", "--out", "OUT/x.csv"],
    "one-hop": ["one-hop", "build", "walk", "run", "--fps", "10", "--weight", "0.01", "--out", "OUT/x.npz"],
    "flat": ["one-hop", "build", "walk", "run", "--fps", "10", "--weight", "0.01", "--out", "OUT/x.bin"],
    "export-engine": ["export-engine", "STUDY/advice/advice.json", "--out", "OUT/x"],
    "advise": ["advise", "walk", "run", "--no-strips", "--out", "OUT/x"],
    "power": ["power", "demo", "--study", "velocity_vs_fixed", "--participants", "4", "--studies=10", "--out", "OUT/x"],
    "render": ["render", "STUDY/protocol.toml", "--out", "OUT/x"],
    "simulate": ["simulate", "STUDY/protocol.toml", "--participants", "2", "--out", "OUT/x"],
    "export-stimuli": ["export-stimuli", "STUDY/protocol.toml", "--participants", "2", "--out", "OUT/x"],
    "import-answers": ["import-answers", "STUDY", "STUDY/rows.csv", "--database", "OUT/x.db"],
    "serve": ["serve", "STUDY/protocol.toml", "--port", "0", "--out", "OUT/x"],
    "demo": ["demo", "--out", "OUT/x"],
    "database": ["simulate", "STUDY/protocol.toml", "--participants", "2", "--out", "STUDY", "--database", "OUT/x.db"],
    "report": ["report", "STUDY", "--out", "OUT/x"],
    "export": ["export", "STUDY", "--out", "OUT/x.csv"],
    "parquet": ["export", "STUDY", "--to", "parquet", "--out", "OUT/x.parquet"],
    "psych-ds": ["export", "STUDY", "--to", "psych-ds", "--out", "OUT/x"],
    "bids": ["export", "STUDY", "--to", "bids", "--out", "OUT/x"],
}  # fmt: skip

EACH = """
import contextlib, io, json, resource, sys
from study.apps.cli import run
verbs = json.loads(sys.argv[1])
if sys.argv[2] == "full":
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, resource.RLIM_INFINITY))
found = {}
for name, arguments in verbs.items():
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        status = run(arguments)
    found[name] = [status, said.getvalue()]
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study with two simulated participants, without films; advice, for engines; an answer, from elsewhere."""
    folder = tmp_path_factory.mktemp("finished")
    unfilmed(folder)
    assert run(["simulate", str(folder / "protocol.toml"), "--participants", "2", "--out", str(folder)]) == 0
    assert run(["advise", "walk", "run", "--no-strips", "--out", str(folder / "advice")]) == 0
    (folder / "rows.csv").write_text("segue_participant,segue_trial,segue_item,answer,response_s\np001,1,,,\n")
    return folder


def each(verbs: dict[str, list[str]], disk: str, *before: str) -> dict[str, tuple[int, str]]:
    """Exit status and errors of verbs, one after the other in one program, which `before` starts."""
    child = subprocess.run(
        [*before, sys.executable, "-c", EACH, json.dumps(verbs), disk],
        cwd=ROOT, capture_output=True, text=True, timeout=600, check=True,
    )  # fmt: skip
    found: dict[str, tuple[int, str]] = json.loads(child.stdout)
    return found


def told(verbs: dict[str, list[str]], out: Path, study: Path) -> dict[str, list[str]]:
    places = {"OUT": str(out), "STUDY": str(study)}
    return {
        name: [argument.replace("OUT", places["OUT"]).replace("STUDY", places["STUDY"]) for argument in arguments]
        for name, arguments in verbs.items()
    }


def files_in(folder: Path) -> list[str]:
    return [path.name for path in folder.rglob("*") if path.is_file()]


@pytest.mark.gl
@pytest.mark.skipif(os.name != "posix", reason="limits on file sizes are POSIX")
def test_a_full_disk_is_said_by_every_verb_and_nothing_is_half_written(tmp_path: Path, finished: Path) -> None:
    study = tmp_path / "study"
    shutil.copytree(finished, study)
    out = tmp_path / "out"
    out.mkdir()
    for name, (status, said) in each(told(WRITES, out, study), "full").items():
        assert status == 2, f"{name}: {said}"
        last = said.splitlines()[-1]
        assert last.startswith("segue: "), f"{name}: {said}"
        if WRITES[name][0] in ("report", "export"):  # under the limit the study itself can't be opened
            assert "temporary files can't be used" in last or "grow so large" in last, last
            continue
        assert str(out) in said, f"{name}: {said}"
        assert "files may not grow so large there" in last or "no room left" in last or "its disk fails" in last, last
    assert files_in(out) == []


@pytest.mark.parametrize("name", [name for name in WRITES if name not in ("demo", "serve")])
def test_a_file_where_a_folder_should_be_is_said_by_every_verb(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, finished: Path, name: str
) -> None:
    out = tmp_path / "out"
    out.write_text("mine")
    (arguments,) = told({name: WRITES[name]}, out, finished).values()
    assert run(arguments) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert str(out) in said
    assert "found a file" in said or "part of the path is a file" in said or "is a file" in said, said
    assert out.read_text() == "mine"


def test_every_verb_that_writes_is_tried() -> None:
    reads = {"motions", "fit-weights", "check", "play", "analyse", "fit", "doctor"}
    assert {arguments[0] for arguments in WRITES.values()} == set(VERBS) - reads


needs_mounts = pytest.mark.skipif(
    subprocess.run(
        ["unshare", "-m", "mount", "-t", "tmpfs", "none", "/mnt"], capture_output=True, check=False
    ).returncode
    != 0
    if shutil.which("unshare")
    else True,
    reason="only root may mount a folder read-only",
)

READ_ONLY = 'mount --bind "$1" "$1" && mount -o remount,ro,bind "$1" && shift && exec "$@"'


@needs_mounts
def test_a_finished_study_on_a_read_only_disk_is_analysed_reported_and_exported_elsewhere(
    tmp_path: Path, finished: Path
) -> None:
    folder, out = tmp_path / "disk", tmp_path / "out"
    shutil.copytree(finished, folder)

    study, new = str(folder), ["--port", "0", "--database", f"{folder}/new.sqlite"]
    elsewhere = {
        "analyse": ["analyse", study],
        "report": ["report", study, "--out", str(out)],
        "csv": ["export", study, "--out", str(out / "a.csv")],
        "psych-ds": ["export", study, "--to", "psych-ds", "--out", str(out / "set")],
        "bids": ["export", study, "--to", "bids", "--out", str(out / "bids")],
    }
    here = {
        "report here": ["report", study],
        "export here": ["export", study],
        "bids here": ["export", study, "--to", "bids"],
        "simulate here": ["simulate", f"{study}/protocol.toml", "--out", study, "--participants", "3"],
        "serve here": ["serve", f"{study}/protocol.toml", "--out", study, *new],
    }
    found = each(elsewhere | here, "read-only", "unshare", "-m", "sh", "-c", READ_ONLY, "sh", study)
    assert [(name, found[name]) for name in elsewhere if found[name][0] != 0] == []
    assert [found[name][1] for name in ("csv", "psych-ds", "bids")] == ["", "", ""]
    assert (out / "report.html").stat().st_size > 10_000
    for name in here:
        status, said = found[name]
        assert (status, "read-only" in said or "may not be written to" in said) == (2, True), said
        if here[name][0] in ("report", "export"):
            assert "the disk is read-only; write somewhere else" in said
        assert "http" not in said, "an address is printed once answers can be stored"
    with_log = folder / "responses.sqlite-wal"
    assert not with_log.exists()


def test_a_server_tries_to_write_and_changes_nothing(tmp_path: Path, finished: Path) -> None:
    shutil.copy(finished / "responses.sqlite", tmp_path)
    before = (tmp_path / "responses.sqlite").read_bytes()
    with open_responses(tmp_path) as responses:
        try_to_write(responses.engine, responses.place)
    after = (tmp_path / "responses.sqlite").read_bytes()
    assert len(after) == len(before)
    assert sum(a != b for a, b in zip(after, before, strict=True)) < 20, "counters of the header alone"


def test_a_protocol_with_a_mark_is_run_from_end_to_end(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    protocol, out = tmp_path / "mark.toml", tmp_path / "out"
    protocol.write_bytes(b"\xef\xbb\xbf" + PROTOCOL.replace("\n", "\r\n").encode())
    for _ in range(2):
        assert run(["simulate", str(protocol), "--participants", "1", "--out", str(out)]) == 0
    write_whole(out / "protocol.toml", b"\xef\xbb\xbf" + (out / "protocol.toml").read_bytes())
    assert run(["simulate", str(protocol), "--participants", "2", "--out", str(out), "--library", "synthetic"]) == 0
    assert run(["analyse", str(out)]) == 0
    protocol.write_bytes(PROTOCOL.encode("utf-16"))
    capsys.readouterr()
    assert run(["check", str(protocol)]) == 2
    assert "found UTF-16" in capsys.readouterr().err
