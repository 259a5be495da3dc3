"""What verbs print goes through any encoding, to readers who leave, and onto disks that are full."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from study.apps.cli import run
from study.apps.cli.group import VERBS
from study.motion.readers.other_formats import by_beginning

ROOT = Path(__file__).parents[3]
SEGUE = [sys.executable, "-m", "study.apps.cli"]

PRINTS = """
import click
from study.apps.cli.console import emit, say
from study.apps.cli.streams import print_in_any_encoding
print_in_any_encoding()
emit({}, "k \N{MINUS SIGN} 7.7 \N{PLUS-MINUS SIGN} 1, \N{LEFT DOUBLE QUOTATION MARK}l\xe4uft\N{RIGHT DOUBLE QUOTATION MARK} \u6b69 \\udcff")
say("\N{RIGHTWARDS ARROW} \u6b69")
with click.Context(click.Command("verb")) as context:
    context.meta["--json"] = True
    emit({"word": "l\xe4uft \u6b69"}, "")
"""  # noqa: E501


@pytest.mark.parametrize("encoding", ["cp1252", "cp437", "latin-1", "ascii", "cp932", "utf-8"])
def test_any_text_is_printed_in_any_encoding(encoding: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PRINTS], cwd=ROOT, capture_output=True, check=False,
        env={**os.environ, "PYTHONIOENCODING": f"{encoding}:strict"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr.decode(errors="replace")
    line = done.stdout.decode(encoding).splitlines()[0]
    assert "\\udcff" in line
    done.stderr.decode(encoding)
    if encoding in ("ascii", "latin-1", "cp437"):
        assert line.startswith("k - 7.7 ")
        assert "\\u6b69" in line
    if encoding == "ascii":
        assert line == r'k - 7.7 +/- 1, "l\xe4uft" \u6b69 \udcff'
    if encoding == "utf-8":
        assert line.startswith("k \N{MINUS SIGN} 7.7")


def test_help_is_plain_letters(capsys: pytest.CaptureFixture[str]) -> None:
    """Click prints it, which knows nothing of our streams."""
    for verb in VERBS:
        assert run([verb, "--help"]) == 0
        assert capsys.readouterr().out.isascii(), verb


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
@pytest.mark.parametrize("arguments", [["--help"], ["motions", "list"], ["check", "demo", "--texts"]])
def test_a_reader_who_leaves_ends_it_quietly(arguments: list[str]) -> None:
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run([*SEGUE, *arguments], cwd=ROOT, stdout=write, stderr=subprocess.PIPE, text=True, check=False)
    os.close(write)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
def test_output_onto_a_full_disk_is_refused_and_messages_are_not_missed() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([*SEGUE, "motions", "list"], cwd=ROOT, stdout=full, stderr=subprocess.PIPE, check=False)
        assert done.returncode == 2
        assert done.stderr.decode().startswith("segue: standard output: can't be read or written: no space is left")
        done = subprocess.run([*SEGUE, "check", "demo"], cwd=ROOT, stdout=subprocess.PIPE, stderr=full, check=False)
        assert done.returncode == 0


def test_what_the_system_refuses_is_no_fault_of_ours(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from study.apps.cli import study as study_commands

    def fails(_: str) -> None:
        raise PermissionError(13, "Permission denied", "/there/walk.bvh")

    monkeypatch.setattr(study_commands, "load", fails)
    assert run(["check", "demo"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("segue: /there/walk.bvh: can't be read or written: it may not be read")
    assert len(said.splitlines()) == 1
    monkeypatch.setattr(study_commands, "load", lambda _: 1 / 0)
    assert run(["check", "demo"]) == 1
    assert "a fault of Segue's own (ZeroDivisionError)" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.fbx", b"Kaydara FBX Binary  \0", "found an FBX file. Make a BVH file of it in Blender: File > Import"),
        ("a.bvh", b"Kaydara FBX Binary  \0", "found an FBX file"),
        ("a.bvh", b"; FBX 7.4.0 project file", "found an FBX file"),
        ("a.glb", b"glTF", "a damaged one"),
        ("a.bvh", b"glTF\2\0\0\0", "found a glTF file. Let its name end in .glb"),
        ("a.C3D", b"\2\x50", "found a C3D file. It holds markers and no skeleton"),
        ("a.bvh", b"\2\x50\1\0", "found a C3D file"),
        ("a.uasset", b"", "Unreal: Asset Actions > Export"),
        ("a.npz", b"PK\3\4", "found a NumPy file, as AMASS has them"),
        ("a.bvh", b"PK\3\4\0", "found a ZIP archive"),
        ("a.bvh", b'{"a": 1}', "found a JSON file"),
        ("a.bvh", b"<html>Sign in", "found a web page or XML"),
        ("a.mp4", b"", "found a video"),
        ("a.xyz", b"", "found .xyz"),
    ],
)
def test_motion_in_other_formats_is_called_by_its_name(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, name: str, content: bytes, words: str
) -> None:
    (tmp_path / name).write_bytes(content)
    assert run(["motions", "inspect", str(tmp_path / name)]) == 2
    said = capsys.readouterr().err
    assert name in said
    assert words in said


def test_a_folder_of_other_formats_is_called_by_their_name(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "a.fbx").write_bytes(b"Kaydara FBX Binary")
    assert run(["motions", "list", "--library", str(tmp_path)]) == 2
    assert "found an FBX file" in capsys.readouterr().err
    assert by_beginning(b"HIERARCHY\nROOT") is None
