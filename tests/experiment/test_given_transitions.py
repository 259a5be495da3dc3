"""Transitions that a researcher made: read from motion files, shown beside those that are made here."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from toys import Toy, ToyLibrary

from study.errors import ProtocolError, StimulusError
from study.experiment.protocol.whole import Protocol, load_protocol
from study.experiment.stimuli.films import plan_all
from study.experiment.stimuli.manifest import made_from
from study.experiment.stimuli.outlook import look_ahead
from study.experiment.stimuli.prepare import check, prepare
from study.experiment.stimuli.ways import Ways
from study.motion.clip import Clip, moved, resample, trim
from study.motion.readers.bvh_writing import write_bvh
from study.transitions.blending import Transition, blend

TEXT = """
name = "given"
title = "Given transitions"
seed = 3

[stimuli]
entry_s = 0.5
exit_s = 0.5
clean_feet = false

[points]
choose = "given"
source_frame = 60
destination_frame = 90

[[transitions]]
name = "slow_quick"
category = "walking"
source = "slow"
destination = "quick"

[[studies]]
name = "natural"
task = "preference"
reference = "ours"
comparison = "fixed"
fixed_frames = 12
question = "Which?"

[[methods]]
name = "ours"
make = "given"

[methods.files.slow_quick]
file = "made/slow_quick.bvh"
start_frame = {start}
end_frame = {end}
"""


@pytest.fixture
def library() -> ToyLibrary:
    """Motions of one length, so that a file can be made of the very frames that the protocol shows."""
    motions = {"slow": Toy(0.8, 1.4), "quick": Toy(1.6, 0.9), "still": Toy(0.0, 3.0)}
    return ToyLibrary({name: replace(toy, seconds=8.0) for name, toy in motions.items()})


def blended(library: ToyLibrary, frames: int = 12) -> Transition:
    """What the protocol's own blend of so many frames is."""
    source, destination = (library.clip(name, fps=30.0) for name in ("slow", "quick"))
    return blend(source, destination, 60, 90, frames)


def protocol_of(
    folder: Path, clip: Clip, start: int, end: int, *changes: tuple[str, str], text: str = TEXT
) -> Protocol:
    """A protocol in a folder, beside a file with a clip."""
    (folder / "made").mkdir(exist_ok=True)
    write_bvh(clip, folder / "made" / "slow_quick.bvh")
    text = text.format(start=start, end=end)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "given.toml"
    path.write_text(text)
    return load_protocol(path)


def test_a_given_file_looks_as_the_blend_that_it_holds(tmp_path: Path, library: ToyLibrary) -> None:
    """Our own blend, turned and moved on the floor and started earlier, is the very stimulus of the method."""
    made = blended(library)
    clip = moved(trim(made.clip, 20, made.blend_stop + 40), 1.1, np.array([3.0, 0.0, -2.0]))
    rated = ('task = "preference"', 'task = "rating"\nitems = [{ name = "good", question = "How good?" }]')
    shown = prepare(protocol_of(tmp_path, clip, made.blend_start - 20, made.blend_stop - 21, rated), library)
    assert [pair.methods for pair in shown.pairs] == [("ours",), ("fixed",)]
    assert shown.pairs[0].stimuli == shown.pairs[1].stimuli
    with pytest.raises(StimulusError, match="found that they look the same"):
        prepare(protocol_of(tmp_path, clip, made.blend_start - 20, made.blend_stop - 21), library)


def test_entry_and_exit_are_those_of_the_other_film(tmp_path: Path, library: ToyLibrary) -> None:
    made = blended(library)
    shown = prepare(
        protocol_of(tmp_path, trim(made.clip, 20, made.clip.frames), 40, 51, ("_frames = 12", "_frames = 13")), library
    )
    ours, fixed = (shown.stimulus(name) for name in shown.pairs[0].stimuli)
    assert (ours.record.frames, ours.record.blend_start, ours.record.blend_stop) == (42, 15, 27)
    assert (ours.record.optimal_frames, ours.record.blend_frames) == (12, 12)
    assert (ours.record.source, ours.record.group) == (fixed.record.source, fixed.record.group)
    assert ours.camera is fixed.camera
    np.testing.assert_allclose(ours.positions[:15], fixed.positions[:15], atol=2e-4)
    # The destination's last frame shows one pose, a little further on where the blend was longer.
    ends = [one.positions[-1] - one.positions[-1, :1] for one in (ours, fixed)]
    np.testing.assert_allclose(*ends, atol=0.02)
    assert "made/slow_quick.bvh, blend from its frame 40 to 51 at 30 fps" in ours.record.notes[0]
    assert "joints 0.0 degrees from the source's before the blend and 0.0 degrees from" in ours.record.notes[0]


def test_it_stands_beside_another_method_in_a_preference_study(tmp_path: Path, library: ToyLibrary) -> None:
    made = blended(library, frames=20)
    protocol = protocol_of(tmp_path, made.clip, made.blend_start, made.blend_stop - 1)
    (pair,) = prepare(protocol, library).pairs
    assert pair.methods == ("ours", "fixed")
    outlook = look_ahead(protocol, library)
    (row,) = outlook.rows
    assert row.lengths == {"ours": (20,), "fixed": (12,)}
    assert row.k_frames == 20
    assert row.notes[0].startswith("ours: made/slow_quick.bvh, blend from its frame 60 to 79 at 30 fps")
    # They differ in more than length, so no note says that nobody will see the difference.
    assert not outlook.notes


def test_another_frame_rate_is_resampled_and_said(tmp_path: Path, library: ToyLibrary) -> None:
    """At 120 fps the blend has four frames for each, and three more at either end before the poses next to it."""
    fine = resample(blended(library).clip, 120.0)
    with pytest.raises(StimulusError, match="found that they look the same"):
        prepare(protocol_of(tmp_path, fine, 4 * 59 + 1, 4 * 72 - 1), library)
    shown = prepare(protocol_of(tmp_path, fine, 4 * 59 + 1, 4 * 72 - 1, ("_frames = 12", "_frames = 13")), library)
    ours = shown.stimulus(shown.pairs[0].stimuli[0]).record
    assert ours.blend_frames == 12
    assert "frame 237 to 287 at 120 fps" in ours.notes[0]
    assert "resampled from 120 to 30 fps" in ours.notes[0]


def test_a_file_made_at_other_points_says_so_and_stands_on_the_floor(tmp_path: Path, library: ToyLibrary) -> None:
    source, destination = (library.clip(name, fps=30.0) for name in ("slow", "quick"))
    made = blend(source, destination, 70, 80, 12)
    protocol = protocol_of(tmp_path, moved(made.clip, 0.0, np.array([0.0, 0.3, 0.0])), 70, 81)
    shown = prepare(protocol, library)
    ours, fixed = (shown.stimulus(name) for name in shown.pairs[0].stimuli)
    before = float(ours.record.notes[0].split("joints ")[1].split(" degrees")[0])
    assert before > 3
    # Raised by 30 cm in the file; the floor of the film is where the feet are.
    assert abs(ours.positions[..., 1].min() - fixed.positions[..., 1].min()) < 0.03


def test_stimuli_are_made_anew_when_a_given_file_changes(tmp_path: Path, library: ToyLibrary) -> None:
    made = blended(library, frames=20)
    protocol = protocol_of(tmp_path, made.clip, 60, 79)
    before = made_from(protocol, library)
    assert made_from(protocol, library) == before
    write_bvh(trim(made.clip, 0, made.clip.frames - 1), tmp_path / "made" / "slow_quick.bvh")
    assert made_from(protocol, library) != before


def test_only_the_transitions_of_its_studies_need_a_file(tmp_path: Path, library: ToyLibrary) -> None:
    made = blended(library, frames=20)
    another = '[[transitions]]\nname = "still_slow"\ncategory = "standing"\nsource = "still"\ndestination = "slow"\n'
    changes = [("[[studies]]", f"{another}\n[[studies]]")]
    with pytest.raises(
        ProtocolError,
        match=r"studies\[0\]: the method 'ours' of the preference study 'natural': expected a file for the transition "
        "'still_slow' in its files, found slow_quick; give one",
    ):
        protocol_of(tmp_path, made.clip, 60, 79, *changes)
    changes.append(('question = "Which?"', 'question = "Which?"\ntransitions = ["slow_quick"]'))
    assert check(protocol_of(tmp_path, made.clip, 60, 79, *changes), library) == []


@pytest.mark.parametrize(
    ("start", "end", "change", "words"),
    [
        (80, 79, ("", ""), "expected start_frame <= end_frame for the transition 'slow_quick', found 80 and 79; exch"),
        (-1, 79, ("", ""), r"methods\[0\].files.slow_quick.start_frame: expected at least 0 in frames, found -1"),
        (
            60,
            79,
            ("files.slow_quick", "files.slow_quik"),
            r"methods\[0\]: .*found 'slow_quik'; did you mean 'slow_quick'",
        ),
        (60, 79, ("[methods.files.slow_quick]", "files = 3\n[other]"), r"files: expected a table of tables, found 3"),
        (60, 79, ("start_frame", "strat_frame"), r"strat_frame: unknown key; did you mean 'start_frame'\?"),
        (
            60,
            79,
            ('file = "made/slow_quick.bvh"\n', ""),
            r"files.slow_quick.file: expected this key, found none; add it",
        ),
        (
            60,
            79,
            ('"given"\n\n', '"given"\nclean_feet = true\n\n'),
            r"methods\[0\].clean_feet: .* which are files, found",
        ),
    ],
)
def test_a_protocol_whose_files_cannot_be_meant_is_refused(
    tmp_path: Path, library: ToyLibrary, start: int, end: int, change: tuple[str, str], words: str
) -> None:
    with pytest.raises(ProtocolError, match=words):
        protocol_of(tmp_path, blended(library).clip, start, end, change)


def test_files_that_cannot_be_shown_are_refused(tmp_path: Path, library: ToyLibrary) -> None:
    made = blended(library, frames=20)
    for start, end, words in (
        (
            10,
            29,
            r"transition 'slow_quick', ours: expected 15 frames before its blend in made/slow_quick.bvh, found 10",
        ),
        (
            60,
            made.clip.frames - 5,
            r"expected 15 frames after its blend in made/slow_quick.bvh, found 4: lower entry_s",
        ),
        (
            60,
            9999,
            f"Expected end_frame from 60 to {made.clip.frames - 1}, the frames of made/slow_quick.bvh, found 9999",
        ),
    ):
        (problem,) = check(protocol_of(tmp_path, made.clip, start, end), library)
        assert words in problem
    protocol = protocol_of(tmp_path, made.clip, 60, 79)
    (tmp_path / "made" / "slow_quick.bvh").rename(tmp_path / "made" / "slow_quik.bvh")
    with pytest.raises(StimulusError, match=r"'slow_quick', ours: .*slow_quick.bvh: .*Did you mean 'slow_quik.bvh'\?"):
        prepare(protocol, library)
    other = replace(made.clip.skeleton, names=tuple(f"bone{at}" for at in range(made.clip.skeleton.joints)))
    (problem,) = check(protocol_of(tmp_path, replace(made.clip, skeleton=other), 60, 79), library)
    assert problem.startswith("transition 'slow_quick', ours: Expected")
    assert "bone0" in problem


def test_a_file_is_read_once(tmp_path: Path, library: ToyLibrary, monkeypatch: pytest.MonkeyPatch) -> None:
    from study.motion import entries

    made, read = blended(library, frames=20), []
    protocol = protocol_of(tmp_path, made.clip, 60, 79)
    original = entries.prepared
    monkeypatch.setattr(entries, "prepared", lambda *args, **keys: read.append(args) or original(*args, **keys))
    plan_all(protocol, library, Ways(protocol, library))
    prepare(protocol, library)
    assert len(read) == 2
