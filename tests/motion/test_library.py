"""The library: names, folders of every layout, clips fit for use, refusals; and downloads from a site on loopback."""

from __future__ import annotations

import http.server
import shutil
import threading
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
import pytest

from study.errors import FileError, MotionError, MotionFileError
from study.motion.clip import Clip, joint_positions, moved, trim
from study.motion.cmu import CMU_ACKNOWLEDGEMENT, cmu_index, is_trial, trial_files
from study.motion.cycles import find_cycle
from study.motion.download import download_trial
from study.motion.entries import entry_of_file, motion_file
from study.motion.feet import faced, floor_height, foot_points, grounded, heading, stance
from study.motion.library import FolderLibrary, open_library
from study.motion.readers.bvh_writing import write_bvh
from study.motion.synthetic import synthesize

SHARED_NAMES = (
    *("walk_slow", "walk", "walk_fast", "jog", "run", "run_fast", "stand", "idle", "stand_to_walk", "stand_to_run"),
    *("walk_to_stop", "run_to_stop", "walk_turn_left", "walk_turn_right", "run_turn_left", "run_turn_right"),
    *("box", "box_combination", "dance", "dance_modern", "dance_turns", "tai_chi", "tai_chi_slow"),
)
KINDS = {"walking", "running", "standing", "turning", "boxing", "dancing", "tai-chi"}


@pytest.fixture(scope="module")
def walk() -> Clip:
    return synthesize("walk", seconds=2.0, fps=60.0)


@pytest.fixture
def plain_folder(tmp_path: Path, walk: Clip) -> Path:
    """A folder of a user's own files: two at the top, one nested."""
    (tmp_path / "outside").mkdir()
    write_bvh(walk, tmp_path / "stroll.bvh")
    write_bvh(moved(walk, 1.0, np.array([2.0, 0.3, 5.0])), tmp_path / "away.BVH")
    write_bvh(trim(walk, 0, 30), tmp_path / "outside" / "short.bvh")
    return tmp_path


# -- The index -----------------------------------------------------------------------------------------------------


def test_the_index_has_every_shared_name_with_a_kind_and_takes() -> None:
    index = cmu_index()
    assert set(SHARED_NAMES) <= set(index)
    for motion in index.values():
        assert motion.kind in KINDS
        assert motion.words
        for take in motion.takes:
            assert is_trial(take.trial)
            assert take.start in ("gait", "still", "")
            assert take.end in ("gait", "still", "")
            assert take.last is None or 0 <= take.first < take.last


def test_trials_in_the_official_layout() -> None:
    assert trial_files("16_35") == ("subjects/16/16_35.amc", "subjects/16/16.asf")
    assert is_trial("127_08")
    assert not is_trial("walk_01")


# -- Synthetic -----------------------------------------------------------------------------------------------------


def test_the_synthetic_library_has_every_shared_name() -> None:
    library = open_library("synthetic")
    assert library.synthetic
    assert library.name == "synthetic"
    assert set(SHARED_NAMES) <= set(library.names())
    assert library.entry("run").kind == "running"
    assert "synthetic" in library.acknowledgement


def test_synthetic_clips_are_as_long_as_asked_and_remembered() -> None:
    library = open_library("synthetic")
    clip = library.clip("walk", fps=30.0, min_seconds=4.0)
    assert clip.synthetic
    assert clip.fps == 30.0
    assert clip.seconds >= 4.0
    assert library.clip("walk", fps=30, min_seconds=4.0) is clip


def test_the_nearest_name_is_offered() -> None:
    with pytest.raises(MotionError, match=r"found 'run_left'. Did you mean 'run_turn_left'\? It has .*walk_slow"):
        open_library("synthetic").clip("run_left")


# -- Plain folders -------------------------------------------------------------------------------------------------


def test_file_stems_are_names(plain_folder: Path) -> None:
    library = open_library(plain_folder)
    assert set(library.names()) == {"stroll", "away", "short"}
    assert not library.synthetic
    assert library.acknowledgement == ""
    assert library.entry("short").file == plain_folder / "outside" / "short.bvh"
    assert library.where(library.entry("short")) == "outside/short.bvh"
    assert library.clip("short").name == "short"


def test_clips_stand_on_the_floor_and_set_out_from_the_origin(plain_folder: Path, walk: Clip) -> None:
    clip = open_library(plain_folder).clip("away", fps=30.0)
    assert floor_height(clip) == pytest.approx(0.0, abs=0.01)
    np.testing.assert_allclose(clip.root_positions[0, [0, 2]], 0.0, atol=1e-9)
    assert clip.root_positions[-1, 2] > 1.5
    assert abs(clip.root_positions[-1, 0]) < 0.1
    assert clip.fps == 30.0
    said = " / ".join(clip.history)
    for words in ("to set out towards +Z", "floor put at 0", "resampled from 60 to 30 fps"):
        assert words in said
    assert clip.seconds == pytest.approx(walk.seconds, abs=0.05)


def test_equal_stems_are_told_apart_by_folder(plain_folder: Path) -> None:
    (plain_folder / "indoors").mkdir()
    shutil.copy(plain_folder / "outside" / "short.bvh", plain_folder / "indoors" / "short.bvh")
    library = open_library(plain_folder)
    assert {"indoors/short", "outside/short"} <= set(library.names())
    with pytest.raises(MotionError, match=r"named 'short' .* found 2. Say which: indoors/short, outside/short"):
        library.clip("short")


def test_files_that_would_have_one_name_are_all_reachable(plain_folder: Path) -> None:
    (plain_folder / "stroll.amc").write_text(":FULLY-SPECIFIED\n")
    for other in ("Stroll.bvh", "stroll.BVH", "indoors/away.bvh"):
        (plain_folder / other).parent.mkdir(exist_ok=True)
        shutil.copy(plain_folder / "stroll.bvh", plain_folder / other)
    library = open_library(plain_folder)
    assert set(library.names()) == {
        *("stroll.amc", "stroll.bvh", "stroll.BVH", "Stroll"),
        *("away", "indoors/away", "short"),
    }
    for name in library.names():
        place = library.where(library.entry(name))
        assert name in place
        assert library.entry(place) == library.entry(name)
    assert {library.entry(name).file for name in library.names()} == set(library.files())
    with pytest.raises(MotionError, match=r"named 'stroll' .* found 3. Say which: stroll.BVH, stroll.amc, stroll.bvh"):
        library.clip("stroll")


@pytest.mark.parametrize("name", ["läuft", "walk [1]", " two  blanks", "(a) b{c}", "50%", "歩く", "-dash", "a;b&c"])
@pytest.mark.parametrize("form", ["NFC", "NFD"])
def test_names_work_as_they_are_listed_and_as_people_type_them(
    tmp_path: Path, walk: Clip, name: str, form: Literal["NFC", "NFD"]
) -> None:
    file = tmp_path / f"{unicodedata.normalize(form, name)}.bvh"
    write_bvh(walk, file)
    library = open_library(tmp_path)
    assert library.names() == (unicodedata.normalize("NFC", name),)
    for typed in ("NFC", "NFD"):
        assert library.entry(unicodedata.normalize(typed, name)).file == file  # type: ignore[arg-type]
    assert motion_file(str(tmp_path / f"{unicodedata.normalize('NFC', name)}.bvh")) == file


def test_one_name_in_both_forms_of_accents_is_two_files(tmp_path: Path, walk: Clip) -> None:
    for form in ("NFC", "NFD"):
        write_bvh(walk, tmp_path / f"{unicodedata.normalize(form, 'läuft')}.bvh")  # type: ignore[arg-type]
    library = open_library(tmp_path)
    assert len({library.entry(name).file for name in library.names()}) == len(library.names()) == 2


def test_links_are_followed_and_what_is_left_out_is_told(plain_folder: Path) -> None:
    (plain_folder / "elsewhere").symlink_to(plain_folder / "outside")
    (plain_folder / "outside" / "up").symlink_to(plain_folder)
    (plain_folder / "same.bvh").symlink_to("stroll.bvh")
    (plain_folder / "gone.bvh").symlink_to("nothing.bvh")
    (plain_folder / "._stroll.bvh").write_bytes(b"")
    library = open_library(plain_folder)
    assert isinstance(library, FolderLibrary)
    assert set(library.names()) == {"stroll", "away", "short", "same"}
    assert library.skipped == ["gone.bvh: is a link to nothing"]


def test_a_clip_is_one_clip_by_path_and_by_name(plain_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library = open_library(plain_folder)
    monkeypatch.chdir(plain_folder / "outside")
    named = library.clip("short")
    for spec in ("short.bvh", "../outside/short.bvh", str(plain_folder / "outside" / "short.bvh")):
        other = library.clip(open_library("synthetic").find(spec))
        assert other.name == named.name
        np.testing.assert_array_equal(other.rotations, named.rotations)
        np.testing.assert_array_equal(other.root_positions, named.root_positions)
    with pytest.raises(MotionFileError, match=r"outside: Expected a motion file, found a folder. Name one of its"):
        entry_of_file("../outside")
    with pytest.raises(
        MotionFileError, match=r"shrt.bvh: Expected a motion file, found nothing there. Did you mean 's"
    ):
        library.find("shrt.bvh")


def test_missing_empty_and_mistaken_folders(tmp_path: Path, plain_folder: Path) -> None:
    with pytest.raises(MotionError, match=r"found nothing at .*nowhere"):
        open_library(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(
        MotionError, match=r"Expected .bvh, .amc, .glb, .gltf files in .*empty or its subfolders, found none"
    ):
        open_library(tmp_path / "empty")
    with pytest.raises(MotionError, match=r"found the file .*stroll.bvh. Name its folder"):
        open_library(plain_folder / "stroll.bvh")


def test_memory_is_bounded(plain_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("study.motion.library._KEPT_CLIPS", 2)
    library = open_library(plain_folder)
    first = library.clip("short", fps=10.0)
    assert library.clip("short", fps=10.0) is first
    for fps in (11.0, 12.0):
        library.clip("short", fps=fps)
    assert library.clip("short", fps=10.0) is not first


# -- Folders with CMU trials ---------------------------------------------------------------------------------------


@pytest.fixture
def cmu_folder(tmp_path: Path, walk: Clip) -> Path:
    """A flat folder that has one trial of the index, and one that the index does not know."""
    folder = tmp_path / "bvh"
    folder.mkdir()
    write_bvh(walk, folder / "07_01.bvh")
    write_bvh(walk, folder / "99_01.bvh")
    return folder


def test_a_flat_folder_supplies_what_it_can(cmu_folder: Path) -> None:
    library = open_library(cmu_folder)
    assert isinstance(library, FolderLibrary)
    assert library.names() == ("walk", "07_01", "99_01")
    assert library.distinct() == ("walk", "99_01")
    assert library.trials() == ("07_01", "99_01")
    assert library.acknowledgement == CMU_ACKNOWLEDGEMENT
    for name in ("walk", "07_01"):
        entry = library.entry(name)
        assert (entry.kind, entry.trial, entry.start, entry.end) == ("walking", "07_01", "gait", "gait")
    assert library.clip("99_01").frames == library.clip("walk").frames


def test_one_trial_hides_no_other_file(cmu_folder: Path, walk: Clip) -> None:
    for number in range(20):
        write_bvh(trim(walk, 0, 10 + number), cmu_folder / f"own{number}.bvh")
    write_bvh(trim(walk, 0, 60), cmu_folder / "walk.bvh")
    library = open_library(cmu_folder)
    assert len(library.files()) == 23
    assert {library.entry(name).file for name in library.names()} == set(library.files())
    assert library.entry("walk").file == cmu_folder / "walk.bvh", "a file's own name goes before the index"
    assert len(library.distinct()) == 23


def test_a_trial_in_two_formats_is_reachable_in_both(cmu_folder: Path) -> None:
    (cmu_folder / "07_01.amc").write_text(":FULLY-SPECIFIED\n")
    library = open_library(cmu_folder)
    assert set(library.names()) == {"walk", "07_01", "07_01.amc", "07_01.bvh", "99_01"}
    assert library.entry("07_01").file == library.entry("walk").file == cmu_folder / "07_01.amc"
    assert library.entry("07_01.bvh").file == cmu_folder / "07_01.bvh"


@pytest.mark.parametrize("spec", ["walk", "07_12", "outside/07_12.bvh"])
def test_path_name_and_number_are_the_usable_frames(
    tmp_path: Path, walk: Clip, spec: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "outside").mkdir()
    write_bvh(walk, tmp_path / "outside" / "07_12.bvh")
    library = open_library(tmp_path)
    clip = library.clip(library.find("walk_fast" if spec == "walk" else spec))
    assert clip.frames == walk.frames - 3
    assert clip.start_s == 3 / walk.fps
    whole = library.clip(library.find("07_12"), as_is=True)
    assert whole.frames == walk.frames
    np.testing.assert_allclose(whole.root_positions, walk.root_positions, atol=1e-9)


def test_a_missing_trial_is_named_with_where_to_get_it(cmu_folder: Path) -> None:
    with pytest.raises(MotionError) as refusal:
        open_library(cmu_folder).clip("run")
    for words in (
        "subjects/09/09_02.amc",
        "segue motions download 09_02",
        "http://mocap.cs.cmu.edu/subjects/09/09_02.amc",
        "Also fit: 09_01",
    ):
        assert words in str(refusal.value)


def test_a_cut_file_is_refused(cmu_folder: Path, walk: Clip) -> None:
    write_bvh(trim(walk, 0, 20), cmu_folder / "135_06.bvh")
    with pytest.raises(MotionError, match=r"frames 0 to 235 for 'stand' in .*135_06.bvh, found 20 frames"):
        open_library(cmu_folder).clip("stand")


# -- Feet and floor ------------------------------------------------------------------------------------------------


def test_the_floor_is_where_the_feet_stand(walk: Clip) -> None:
    raised = moved(walk, 0.7, np.array([1.0, 0.4, 0.0]))
    assert floor_height(raised) == pytest.approx(floor_height(walk) + 0.4)
    assert floor_height(grounded(raised)) == pytest.approx(0.0, abs=1e-12)
    planted = stance(walk)
    # A walker has always one foot on the floor, and most of the time only one.
    assert planted.any(axis=1).mean() > 0.9
    assert 0.5 < planted.mean() < 0.8


def test_a_clip_that_stands_faces_the_way_the_hips_face() -> None:
    standing = moved(synthesize("stand", seconds=2.0, fps=30.0), 2.0, np.array([3.0, 0.0, 1.0]))
    assert np.abs(heading(faced(standing))).max() < 0.1


# -- Real capture --------------------------------------------------------------------------------------------------


@pytest.mark.mocap
def test_the_official_layout_supplies_every_shared_name(mocap: Path) -> None:
    library = open_library(mocap / "cmu")
    assert set(SHARED_NAMES) <= set(library.names())
    assert library.acknowledgement == CMU_ACKNOWLEDGEMENT
    for name in SHARED_NAMES:
        clip = library.clip(name, fps=30.0)
        assert clip.fps == 30.0
        assert floor_height(clip) == pytest.approx(0.0, abs=0.02)
        lowest = min(points[..., 1].min() for points in foot_points(clip))
        assert lowest > -0.08, name
        np.testing.assert_allclose(clip.root_positions[0, [0, 2]], 0.0, atol=1e-6)


@pytest.mark.mocap
def test_every_file_is_listed_under_a_name_of_its_own(mocap: Path) -> None:
    for folder in (mocap, mocap / "cmu", mocap / "cmu_bvh", mocap / "bandai", mocap / "perfume"):
        library = open_library(folder)
        files = [path for path in folder.rglob("*") if path.suffix in (".bvh", ".amc")]
        assert {library.entry(name).file for name in library.names() if library.entry(name).own} == set(files)


@pytest.mark.mocap
def test_both_layouts_nested_prefer_the_originals(mocap: Path) -> None:
    library = open_library(mocap)
    assert set(SHARED_NAMES) <= set(library.names())
    assert library.entry("02_01").file == mocap / "cmu" / "subjects" / "02" / "02_01.amc"
    assert "perfume_A_test" in library.names()


@pytest.mark.mocap
def test_a_conversion_gives_the_frames_of_the_original(mocap: Path) -> None:
    """The added T-pose is dropped, so frame numbers of the index mean the same in both."""
    original, converted = open_library(mocap / "cmu").clip("09_02"), open_library(mocap / "cmu_bvh").clip("09_02")
    assert original.frames == converted.frames
    ankles = [joint_positions(clip)[:, clip.skeleton.role("ankle.L")] for clip in (original, converted)]
    assert np.linalg.norm(ankles[0] - ankles[1], axis=1).max() < 0.05


@pytest.mark.mocap
@pytest.mark.parametrize(
    ("name", "speed", "turn"),
    [
        ("walk_slow", (0.8, 1.1), 0.0),
        ("walk", (1.2, 1.5), 0.0),
        ("walk_fast", (1.5, 1.9), 0.0),
        ("jog", (2.4, 3.1), 0.0),
        ("run", (3.2, 3.8), 0.0),
        ("run_fast", (3.7, 5.0), 0.0),
        ("stand", (0.0, 0.1), 0.0),
        ("idle", (0.0, 0.15), 0.0),
        ("walk_turn_left", (0.7, 1.2), 90.0),
        ("walk_turn_right", (0.7, 1.2), -90.0),
        ("run_turn_left", (1.8, 3.0), 90.0),
        ("run_turn_right", (1.8, 3.0), -90.0),
    ],
)
def test_motions_are_what_their_names_say(mocap: Path, name: str, speed: tuple[float, float], turn: float) -> None:
    clip = open_library(mocap / "cmu").clip(name)
    path = joint_positions(clip)[:, clip.skeleton.role("pelvis")][:: int(clip.fps / 10)][:, [0, 2]]
    measured = float(np.linalg.norm(np.diff(path, axis=0), axis=1).mean() * 10.0)
    assert speed[0] <= measured <= speed[1]
    facing = np.degrees(heading(clip))
    tenth = max(1, clip.frames // 10)
    assert facing[-tenth:].mean() - facing[:tenth].mean() == pytest.approx(turn, abs=20.0)


@pytest.mark.mocap
def test_ends_said_to_be_cyclic_are(mocap: Path) -> None:
    for folder in ("cmu", "cmu_bvh"):
        library = open_library(mocap / folder)
        for name in library.names():
            entry = library.entry(name)
            for at, said in (("start", entry.start), ("end", entry.end)):
                if said:
                    cycle = find_cycle(library.clip(name), at)  # type: ignore[arg-type]
                    assert cycle is not None, f"{name}, {at}"
                    assert (cycle.kind == "still") == (said == "still"), f"{name}, {at}"


@pytest.mark.mocap
def test_captured_motions_can_be_lengthened_at_their_end(mocap: Path) -> None:
    library = open_library(mocap / "cmu")
    short, long = library.clip("jog", fps=30.0), library.clip("jog", fps=30.0, min_seconds=4.0)
    assert long.seconds >= 3.95
    np.testing.assert_allclose(long.root_positions[: short.frames], short.root_positions, atol=1e-9)
    assert any("extended after its end" in line for line in long.history)


# -- Downloads -----------------------------------------------------------------------------------------------------

_ASF = b"# AST/ASF file\n:version 1.10\n" + b"# filling\n" * 20_000
_AMC = b"#!OML:ASF\n:FULLY-SPECIFIED\n:DEGREES\n1\nroot 0 0 0 0 0 0\n"


class _Site(http.server.BaseHTTPRequestHandler):
    """Serves one trial; breaks off in the middle when told to; understands ranges."""

    protocol_version = "HTTP/1.1"
    files: ClassVar = {
        "/subjects/16/16.asf": _ASF,
        "/subjects/16/16_35.amc": _AMC,
        "/subjects/17/17.asf": b"<html>Sign in",
    }
    break_off = False
    asked: ClassVar[list[tuple[str, str | None]]] = []

    def do_GET(self) -> None:
        self.asked.append((self.path, self.headers["Range"]))
        body = self.files.get(self.path)
        if body is None:
            self.send_error(404)
            return
        start = int(self.headers["Range"].removeprefix("bytes=").rstrip("-")) if self.headers["Range"] else 0
        if start > len(body):
            self.send_error(416)
            return
        self.send_response(206 if start else 200)
        self.send_header("Content-Length", str(len(body) - start))
        self.end_headers()
        if type(self).break_off:
            self.wfile.write(body[start : start + 70_000])
            self.close_connection = True
            return
        self.wfile.write(body[start:])

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Keep the tests quiet."""


@pytest.fixture
def site() -> Iterator[str]:
    _Site.asked, _Site.break_off = [], False
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Site)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
    thread.join()


def test_a_trial_comes_with_its_skeleton(site: str, tmp_path: Path) -> None:
    amc = download_trial("16_35", tmp_path, site=site)
    assert amc == tmp_path / "subjects" / "16" / "16_35.amc"
    assert amc.read_bytes() == _AMC
    assert (tmp_path / "subjects" / "16" / "16.asf").read_bytes() == _ASF
    assert not list(tmp_path.rglob("*.part"))
    download_trial("16_35", tmp_path, site=site)
    assert len(_Site.asked) == 2, "files that are there are not fetched again"


def test_a_name_of_the_index_will_do(site: str, tmp_path: Path) -> None:
    assert download_trial("jog", tmp_path, site=site).name == "16_35.amc"


def test_a_broken_download_goes_on_where_it_stopped(site: str, tmp_path: Path) -> None:
    _Site.break_off = True
    with pytest.raises(MotionError, match=r"Could not download .*16\.asf: .* run it again"):
        download_trial("16_35", tmp_path, site=site)
    asf = tmp_path / "subjects" / "16" / "16.asf"
    assert not asf.exists(), "half a file never has the name of a whole one"
    assert asf.with_name("16.asf.part").stat().st_size == 70_000
    _Site.break_off = False
    download_trial("16_35", tmp_path, site=site)
    assert asf.read_bytes() == _ASF
    assert ("/subjects/16/16.asf", "bytes=70000-") in _Site.asked


def test_a_leftover_that_is_too_long_is_fetched_anew(site: str, tmp_path: Path) -> None:
    part = tmp_path / "subjects" / "16" / "16.asf.part"
    part.parent.mkdir(parents=True)
    part.write_bytes(b"x" * (len(_ASF) + 1))
    download_trial("16_35", tmp_path, site=site)
    assert part.with_suffix("").read_bytes() == _ASF


def test_refused_downloads(site: str, tmp_path: Path) -> None:
    with pytest.raises(MotionError, match=r"Expected a trial such as 16_35 or a motion of the CMU index, found 'hop'"):
        download_trial("hop", tmp_path, site=site)
    with pytest.raises(MotionError, match=r"16_99.amc .* the site has no such trial \(404"):
        download_trial("16_99", tmp_path, site=site)
    with pytest.raises(MotionError, match=r"Expected Acclaim motion capture at .*17.asf, found b'<html>Sign in'"):
        download_trial("17_10", tmp_path, site=site)
    assert not list((tmp_path / "subjects" / "17").iterdir())
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match=r"16\.asf: can't be written: part of the path is a file"):
        download_trial("16_35", tmp_path / "file", site=site)


def test_no_network_is_said_plainly(tmp_path: Path) -> None:
    with pytest.raises(MotionError, match=r"Could not download http://127.0.0.1:9/.*Check the network"):
        download_trial("16_35", tmp_path, site="http://127.0.0.1:9", timeout_s=2.0)
