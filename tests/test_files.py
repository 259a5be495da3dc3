"""Files are written whole or not at all, by one piece of code; what the disk refuses is said with its path."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from study.errors import FileError
from study.files import check_place, make_folder, read_text, refused, whole_file, whole_folder, write_whole

ROOT = Path(__file__).parents[1]


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_is_replaced_whole_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    write_whole(tmp_path / "new" / "a.txt", "one\r\nä")
    assert (tmp_path / "new" / "a.txt").read_bytes() == b"one\r\n\xc3\xa4"
    write_whole(tmp_path / "new" / "a.txt", b"two")
    assert (tmp_path / "new" / "a.txt").read_bytes() == b"two"
    assert names(tmp_path / "new") == ["a.txt"]


def full(unfinished: Path) -> None:
    unfinished.write_text("half")
    raise OSError(errno.ENOSPC, "No space left on device")


def test_what_fails_half_way_leaves_what_was_there(tmp_path: Path) -> None:
    write_whole(tmp_path / "a.txt", "before")
    said = r"a\.txt: can't be written: no space is left on the disk; make room"
    with pytest.raises(FileError, match=said), whole_file(tmp_path / "a.txt") as unfinished:
        full(unfinished)
    assert str(os.getpid()) in unfinished.name, "two runs in one folder have names of their own"
    with pytest.raises(UnicodeEncodeError), whole_file(tmp_path / "a.txt") as unfinished:
        unfinished.write_text("ä", encoding="ascii")
    assert (tmp_path / "a.txt").read_text() == "before"
    assert names(tmp_path) == ["a.txt"]


def test_a_folder_is_replaced_whole(tmp_path: Path) -> None:
    for content in ("one", "two"):
        with whole_folder(tmp_path / "set") as unfinished:
            (unfinished / "deep").mkdir()
            (unfinished / "deep" / f"{content}.txt").write_text(content)
    said = "set: can't be written: no space"
    with pytest.raises(FileError, match=said), whole_folder(tmp_path / "set") as unfinished:
        full(unfinished / "three.txt")
    assert names(tmp_path) == ["set"]
    assert names(tmp_path / "set" / "deep") == ["two.txt"]


def test_names_that_look_like_patterns_and_long_ones(tmp_path: Path) -> None:
    kept = tmp_path / ".ab.txt.999999999.part"
    kept.write_text("another file's")
    long = "ä" * 120 + ".txt"
    for name in ("[ab]*.txt", long):
        write_whole(tmp_path / name, "x")
    assert names(tmp_path) == sorted([kept.name, "[ab]*.txt", long])


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("folder", "there is a folder of that name"),
        ("file/a.txt", "part of the path is a file, not a folder"),
        ("file/b/a.txt", "part of the path is a file, not a folder"),
        ("x" * 300, "the name is too long"),
    ],
)
def test_what_stands_in_the_way_is_named(tmp_path: Path, name: str, words: str) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("x")
    for write in (lambda path: write_whole(path, "y"), check_place):
        with pytest.raises(FileError, match=words) as told:
            write(tmp_path / name)
        assert str(tmp_path / name) in str(told.value)
    assert names(tmp_path) == ["file", "folder"]
    assert (tmp_path / "file").read_text() == "x"


@pytest.mark.skipif(not Path("/dev/null").exists(), reason="a device of POSIX")
def test_a_device_is_never_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(FileError, match="something that is no plain file has that name"):
        write_whole(pipe, "x")
    assert pipe.is_fifo()


def test_a_folder_that_can_not_be_made(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(FileError, match="file: expected a folder to write to, found a file in its place; name another"):
        make_folder(tmp_path / "file")
    with pytest.raises(FileError, match="deeper: expected a folder to write to, found a file in its place"):
        make_folder(tmp_path / "file" / "deeper")


def test_a_place_is_tried_without_a_trace(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("before")
    check_place(tmp_path / "a.txt")
    check_place(tmp_path / "b.txt")
    assert names(tmp_path) == ["a.txt"]


def test_refusals_of_the_system_name_their_path() -> None:
    error = OSError(errno.EROFS, os.strerror(errno.EROFS), "there.txt")
    assert str(refused(error)) == "there.txt: can't be read or written: the disk is read-only; write somewhere else."
    assert "here: " in str(refused(error, "here"))
    assert "Bad file descriptor" in str(refused(OSError(errno.EBADF, "Bad file descriptor")))


def test_text_is_read_with_or_without_a_mark(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_bytes(b"\xef\xbb\xbfa\r\nb")
    assert read_text(path, "a list") == "a\r\nb"
    for content in ("a = 1".encode("utf-16"), "a = 1".encode("utf-16-le"), "a = 1".encode("utf-16-be")):
        path.write_bytes(content)
        with pytest.raises(FileError, match=r"expected a list in UTF-8, found UTF-16 .* save it as UTF-8"):
            read_text(path, "a list")
    path.write_bytes(b"one\ntwo \xe4")
    with pytest.raises(FileError, match=r"a\.txt:2: .* found a letter in another encoding \(byte 0xe4\)"):
        read_text(path, "a list")
    with pytest.raises(FileError, match="expected a list, found none"):
        read_text(tmp_path, "a list")


def test_no_other_code_writes_files() -> None:
    """What writes goes through `study.files` (the renderer: `renderer.files`), or fills a folder of theirs."""
    writes = re.compile(
        r"\.write_text\(|\.write_bytes\(|\.savefig\(|to_csv\((?!index|\"data)[^)]|\.open\(\"[wax]|\.replace\(path\)|\.part\""
    )
    found = {}
    for path in [*(ROOT / "study").rglob("*.py"), *(ROOT / "renderer").rglob("*.py")]:
        count = len(writes.findall(path.read_text(encoding="utf-8")))
        if count:
            found[path.relative_to(ROOT).as_posix()] = count
    assert found == {
        "renderer/files.py": 1,  # the ending
        "renderer/jobs.py": 1,  # a film, within `whole_file`
        "renderer/workers.py": 1,  # jobs for its own processes, in a scratch folder
        "study/files.py": 1,
        "study/experiment/store/export.py": 7,  # within `whole_folder`
        "study/motion/download.py": 3,  # within `whole_file`, and what a broken connection left
        "study/report/costs.py": 1,  # within `whole_file`, as the others below
        "study/transitions/one_hop/build.py": 1,
        "study/transitions/one_hop/robustness.py": 1,
        "study/transitions/one_hop/table.py": 2,
        "study/apps/cli/cost_matrix.py": 1,
    }


TWO = """
import sys
from pathlib import Path
from study.files import write_whole
for _ in range(200):
    write_whole(Path(sys.argv[1]) / "shared.txt", sys.argv[2] * 10_000)
"""


def test_two_programs_that_write_one_file_do_not_meet(tmp_path: Path) -> None:
    writers = [subprocess.Popen([sys.executable, "-c", TWO, str(tmp_path), letter], cwd=ROOT) for letter in "ab"]
    assert [writer.wait(timeout=120) for writer in writers] == [0, 0]
    assert names(tmp_path) == ["shared.txt"]
    assert (tmp_path / "shared.txt").read_text() in ("a" * 10_000, "b" * 10_000)
