"""What a protocol shows is settled once; whatever it follows from is changed here in turn, and it is settled anew."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from toys import TOY_PROTOCOL, toy_clip

from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.stimuli import kept, manifest, outlook
from study.experiment.stimuli.prepare import prepare
from study.motion.library import FolderLibrary, open_library
from study.motion.readers.bvh_writing import write_bvh


class Place:
    """A folder of motions, a protocol and a cache; `settled` counts how often what is shown was settled."""

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch | None = None) -> None:
        folder.mkdir(exist_ok=True)
        self.protocol, self.folder, self.cache = parse_protocol(TOY_PROTOCOL), folder / "motions", folder / "cache"
        self.program = folder / "program.py"
        self.program.write_text("1", encoding="utf-8")
        self.settled, self.patch = 0, patch or pytest.MonkeyPatch()
        self.write("slow", 0.8)
        self.write("quick", 1.6)
        self.write("still", 0.0)

    def write(self, name: str, speed: float) -> Path:
        self.folder.mkdir(exist_ok=True)
        write_bvh(toy_clip(name, 240, 30.0, speed, 1.4), self.folder / f"{name}.bvh")
        return self.folder / f"{name}.bvh"

    def look(self, protocol: Protocol | None = None) -> outlook.Outlook:
        return outlook.look_ahead(protocol or self.protocol, open_library(self.folder))

    @property
    def files(self) -> list[Path]:
        return sorted(self.cache.glob("*"))


SETTLE = outlook._looked_ahead


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> outlook.Outlook:
    place = Place(tmp_path_factory.mktemp("made"))
    return SETTLE(place.protocol, open_library(place.folder), None)


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, made: outlook.Outlook) -> Place:
    place, program_files = Place(tmp_path, monkeypatch), manifest.program_files()

    def settle(*_given: object) -> outlook.Outlook:
        place.settled += 1
        return made

    monkeypatch.setenv("SEGUE_CACHE", str(place.cache))
    monkeypatch.setattr(outlook, "_looked_ahead", settle)
    monkeypatch.setattr(manifest, "program_files", lambda: [*program_files, place.program])
    return place


def test_every_later_verb_takes_what_the_first_settled(place: Place, made: outlook.Outlook) -> None:
    place.look()
    again, stimuli = place.look(), prepare(place.protocol, open_library(place.folder))
    assert place.settled == 1
    assert (again.rows, again.shortcuts, again.film_times) == (made.rows, made.shortcuts, made.film_times)
    assert made.stimuli is not None
    assert made.stimuli.stimuli
    assert (stimuli.records, stimuli.pairs, again.audits) == (made.stimuli.records, made.stimuli.pairs, made.audits)
    assert stimuli.protocol is place.protocol
    for one, other in zip(made.stimuli.stimuli, stimuli.stimuli, strict=True):
        np.testing.assert_array_equal(one.positions, other.positions)
        np.testing.assert_array_equal(one.camera.eye, other.camera.eye)


def _motion(place: Place) -> None:
    """Another motion in a file that is as large and as old."""
    path = place.folder / "slow.bvh"
    before, content = path.stat(), path.read_text(encoding="utf-8")
    digit = next(at for at in range(len(content) - 9, 0, -1) if content[at] in "12345678")
    path.write_text(f"{content[:digit]}{int(content[digit]) + 1}{content[digit + 1 :]}", encoding="utf-8")
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert (path.stat().st_size, path.stat().st_mtime_ns) == (before.st_size, before.st_mtime_ns)


def _another_motion(place: Place) -> None:
    place.write("other", 1.0)


def _described(place: Place) -> None:
    place.folder.joinpath("library.toml").write_text(
        '[clips.slow]\nfile = "slow.bvh"\ncategory = "walking"\n', encoding="utf-8"
    )


def _text(place: Place) -> None:
    place.protocol = parse_protocol(TOY_PROTOCOL.replace("exit_s = 0.3", "exit_s = 0.4"))


def _value(place: Place) -> None:
    """A protocol that was changed in Python still has the text of its file."""
    place.protocol = place.protocol.model_copy(update={"seed": 6})


def _program(place: Place) -> None:
    place.program.write_text("2", encoding="utf-8")


def _numpy(place: Place) -> None:
    place.patch.setattr(kept, "versions", lambda: {"numpy": "9.9"})


def _damaged(place: Place) -> None:
    (path,) = place.files
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def _cut_short(place: Place) -> None:
    (path,) = place.files
    path.write_bytes(path.read_bytes()[:20])


def _somebody_else_s(place: Place) -> None:
    place.patch.setattr(os, "getuid", lambda: 12345)


@pytest.mark.parametrize(
    "change",
    [_motion, _another_motion, _described, _text, _value, _program, _numpy, _damaged, _cut_short]
    + [_somebody_else_s] * hasattr(os, "getuid"),
)
def test_what_anything_was_changed_for_is_settled_anew(place: Place, change: Callable[[Place], None]) -> None:
    place.look()
    change(place)
    place.look()
    assert place.settled == 2


def test_what_was_damaged_is_kept_again(place: Place) -> None:
    place.look()
    _damaged(place)
    place.look()
    place.look()
    assert place.settled == 2


def test_a_file_that_changes_meanwhile_is_not_taken_for_what_was_read(
    place: Place, monkeypatch: pytest.MonkeyPatch, made: outlook.Outlook
) -> None:
    def slowly(*_given: object) -> outlook.Outlook:
        place.write("slow", 0.7)
        return made

    monkeypatch.setattr(outlook, "_looked_ahead", slowly)
    place.look()
    assert place.files == []


def test_a_place_that_can_t_be_written_to_or_found_changes_nothing(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    place.cache.write_text("a file", encoding="utf-8")
    rows = place.look().rows
    monkeypatch.delenv("SEGUE_CACHE")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)

    def nowhere() -> Path:
        raise RuntimeError

    monkeypatch.setattr(Path, "home", nowhere)
    assert place.look().rows == rows
    assert place.settled == 2


def test_what_cannot_be_shown_and_what_another_kind_of_library_shows_is_not_kept(
    place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = type("Own", (FolderLibrary,), {})
    outlook.look_ahead(place.protocol, own(place.folder))
    monkeypatch.setattr(outlook, "_looked_ahead", SETTLE)
    place.look(parse_protocol(TOY_PROTOCOL.replace("exit_s = 0.3", "exit_s = 30")))
    assert place.files == []


def test_the_longest_unused_give_way(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept, "MOST_KEPT", 2)
    first, second, third = (place.protocol.model_copy(update={"seed": seed}) for seed in (1, 2, 3))
    files = []
    for protocol, age in ((first, 300), (second, 200)):
        before = set(place.files)
        place.look(protocol)
        (fresh,) = set(place.files) - before
        os.utime(fresh, (fresh.stat().st_mtime - age,) * 2)
        files.append(fresh)
    place.look(first)
    place.look(third)
    assert place.settled == 3
    assert len(place.files) == 2
    assert files[0] in place.files
    assert files[1] not in place.files
