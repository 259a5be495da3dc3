"""`library.toml`: what it says reaches the clips, keys and values that can't be meant are refused by name."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from study.errors import FileError, MotionError, MotionFileError
from study.motion.clip import Clip
from study.motion.entries import entry_of_file
from study.motion.library import open_library
from study.motion.library_file import read_library_file, write_library_file
from study.motion.mirror import mirror
from study.motion.readers.bvh_writing import write_bvh
from study.motion.synthetic import synthesize


@pytest.fixture(scope="module")
def walk() -> Clip:
    return synthesize("walk", seconds=2.0, fps=60.0)


@pytest.fixture
def folder(tmp_path: Path, walk: Clip) -> Path:
    (tmp_path / "outdoors").mkdir()
    write_bvh(walk, tmp_path / "walk.bvh")
    write_bvh(walk, tmp_path / "outdoors" / "läuft.bvh")
    return tmp_path


def says(folder: Path, text: str) -> None:
    (folder / "library.toml").write_text(text, encoding="utf-8")


def test_a_table_names_a_part_of_a_file(folder: Path, walk: Clip) -> None:
    says(
        folder,
        """
[clips."two steps"]
file = "outdoors/läuft.bvh"
first_frame = 10
last_frame = 69
cyclic = "end"
category = "strolling"
genre = "none"
beats = [1.5, 0.5]
""",
    )
    library = open_library(folder)
    assert set(library.names()) == {"two steps", "walk", "läuft"}
    entry = library.entry("two steps")
    assert (entry.kind, entry.genre, entry.beats) == ("strolling", "none", (0.5, 1.5))
    assert (entry.cyclic, entry.start, entry.end) == (True, "", "gait")
    clip = library.clip("two steps")
    assert clip.frames == 60
    assert clip.start_s == pytest.approx(10 / 60)
    np.testing.assert_allclose(clip.rotations[:, 1:], walk.rotations[10:70, 1:], atol=1e-9)
    assert library.clip("läuft").frames == walk.frames, "the file itself stays whole"
    assert library.distinct() == ("two steps", "walk")


def test_a_table_of_the_files_own_name_is_the_file_by_any_name(folder: Path) -> None:
    says(folder, '[clips.walk]\nfile = "walk.bvh"\nfirst_frame = 30\nmirror = true\n')
    library = open_library(folder)
    named, by_path = library.clip("walk"), library.clip(entry_of_file(folder / "walk.bvh"))
    plain = library.clip("läuft")
    assert named.frames == plain.frames - 30
    np.testing.assert_array_equal(named.rotations, by_path.rotations)
    assert mirror(named).history != named.history
    assert any("mirrored" in line for line in named.history)


def test_unit_rate_and_joints_are_facts_about_the_file_under_every_name(folder: Path) -> None:
    says(
        folder,
        """
[defaults]
unit = "mm"
[clips.part]
file = "walk.bvh"
last_frame = 59
fps = 30
joints = {"ankle.L" = "LeftToeBase"}
""",
    )
    library = open_library(folder)
    for name in ("part", "walk"):
        clip = library.clip(name)
        assert clip.fps == 30.0
        assert clip.metres_per_unit == 0.001
        assert clip.skeleton.names[clip.skeleton.role("ankle.L")] == "LeftToeBase"
    assert library.clip("läuft").fps == 60.0
    assert library.clip("läuft").metres_per_unit == 0.001


def test_a_file_below_is_described_wherever_it_is_opened_from(folder: Path) -> None:
    says(folder, "[defaults]\nfps = 25\n")
    for library in (open_library(folder), open_library(folder / "outdoors")):
        assert library.clip("läuft").fps == 25.0
        assert folder / "library.toml" in library.files(), "stimuli are made anew where it changes"
    says(folder / "outdoors", '[clips."läuft"]\nfile = "läuft.bvh"\nfps = 24\n')
    for library in (open_library(folder), open_library(folder / "outdoors")):
        assert library.clip("läuft").fps == 24.0, "the nearest one counts"
    assert open_library(folder).clip("walk").fps == 25.0


def test_a_name_that_another_file_has_leaves_both_reachable(folder: Path) -> None:
    says(folder, '[clips.walk]\nfile = "outdoors/läuft.bvh"\n')
    library = open_library(folder)
    assert library.where(library.entry("walk")) == "outdoors/läuft.bvh"
    assert library.where(library.entry("walk.bvh")) == "walk.bvh"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[clips.a]\nfile = "walk.bvh"\nfirstframe = 3', "[clips.a]: unknown key 'firstframe'. Did you mean 'first_f"),
        ('[clip.a]\nfile = "walk.bvh"', "unknown key 'clip'. Did you mean 'clips'?"),
        ('[clips.a]\nfiel = "walk.bvh"', "[clips.a]: unknown key 'fiel'. Did you mean 'file'?"),
        ("[clips.a]\nfps = 30", '[clips.a]: expected file = "..."'),
        ('[clips."a b"]\nfile = 3', '[clips."a b"]: expected file = "..." with a file of this folder, found 3'),
        ('[clips.a]\nfile = "../walk.bvh"', "[clips.a] file: expected a file in the folder"),
        ('[clips.a]\nfile = "wlk.bvh"', "found none at 'wlk.bvh'. Did you mean 'walk.bvh'?"),
        ('[defaults]\nfile = "walk.bvh"', "[defaults]: unknown key 'file'"),
        ('[defaults]\nunit = "metres"', "[defaults] unit: expected metres in a unit of the file"),
        ("[defaults]\nunit = true", "[defaults] unit: expected"),
        ("[defaults]\nunit = -1", "[defaults] unit: expected"),
        ("[defaults]\nfps = 0", "[defaults] fps: expected frames per second from 0.0003 to 100000, found 0"),
        ("[defaults]\nfps = nan", "[defaults] fps: expected"),
        ("[defaults]\nfps = '30'", "[defaults] fps: expected"),
        ("[defaults]\nfirst_frame = -1", "[defaults] first_frame: expected a frame number from 0, found -1"),
        ("[defaults]\nfirst_frame = 2.0", "[defaults] first_frame: expected"),
        ("[defaults]\nfirst_frame = 9\nlast_frame = 3", "[defaults] last_frame: expected 9 or more, found 3"),
        ("[defaults]\nmirror = 1", "[defaults] mirror: expected true or false, found 1"),
        ('[defaults]\ncyclic = "yes"', '[defaults] cyclic: expected true, false, "start" or "end", found'),
        ("[defaults]\ncyclic = 1", "[defaults] cyclic: expected"),
        ("[defaults]\nbeats = [1, 'x']", "[defaults] beats: expected a list of times in seconds"),
        ("[defaults]\nbeats = [-1.0]", "[defaults] beats: expected"),
        ("[defaults]\ncategory = 3", "[defaults] category: expected text in quotes"),
        ('[defaults.joints]\n"ankl.L" = "x"', "'ankl.L' is no role. Did you mean 'ankle.L'?"),
        ('[defaults.joints]\n"ankle.L" = "x"\n"ankle.R" = "x"', "'x' is named for two roles"),
        ("clips = 3", "Expected [clips] to be a table of keys, found 3"),
        ("[clips]\na = 3", "Expected [clips.a] to be a table of keys, found 3"),
        ("[clips.a", "expected TOML, found a mistake: "),
        (
            '[clips.a]\nfile = "walk.bvh"\nfps = 30\n[clips.b]\nfile = "walk.bvh"\nfps = 60',
            "Expected the same unit, fps and joints in all tables about walk.bvh, found different ones in [clips.'a']",
        ),
    ],
)
def test_what_can_not_be_meant_is_refused_with_file_and_key(folder: Path, text: str, words: str) -> None:
    says(folder, text)
    with pytest.raises((MotionFileError, FileError), match=re.escape(words)) as refusal:
        open_library(folder)
    assert str(folder / "library.toml") in str(refusal.value)


def test_joints_that_a_file_lacks_are_refused_where_they_are_written(folder: Path) -> None:
    says(folder, '[clips.walk]\nfile = "walk.bvh"\njoints = {"ankle.L" = "LeftFot"}\n')
    with pytest.raises(
        MotionFileError, match=r"library.toml: joints of walk.bvh: .*'LeftFot'. Did you mean 'LeftFoot'"
    ):
        open_library(folder).clip("walk")


def test_frames_that_a_file_lacks_are_refused(folder: Path) -> None:
    says(folder, '[clips.walk]\nfile = "walk.bvh"\nlast_frame = 500\n')
    with pytest.raises(MotionError, match=r"frames 0 to 500 for 'walk'.*found 120 frames. Mend them in library"):
        open_library(folder).clip("walk")


def test_a_byte_order_mark_and_accents_of_two_letters_are_read(folder: Path) -> None:
    text = '[clips.a]\nfile = "outdoors/la\u0308uft.bvh"\n'
    (folder / "library.toml").write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert open_library(folder).entry("a").file == folder / "outdoors" / "läuft.bvh"
    (folder / "library.toml").write_bytes("# ä".encode("latin-1"))
    with pytest.raises(FileError, match="in UTF-8, found a letter in another encoding"):
        open_library(folder)


def test_a_first_one_is_written_and_never_over_another(folder: Path) -> None:
    rows = [('say "hi"', "walk.bvh", "walking", "120\nframes"), ("läuft", "outdoors/läuft.bvh", "", "")]
    path = write_library_file(folder, rows)
    read = read_library_file(path)
    assert [(table.name, table.file) for table in read.tables] == [(name, file) for name, file, _, _ in rows]
    assert read.tables[0].fields == {"kind": "walking"}
    before = path.read_bytes()
    with pytest.raises(MotionFileError, match=r"Expected a folder without library.toml, found one. It is never over"):
        write_library_file(folder, rows)
    assert path.read_bytes() == before
