"""Stimuli: what they hold, what they are called, what is refused; on a toy library with motions of known length."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from toys import TOY_PROTOCOL, Toy, ToyLibrary

from renderer.camera import project_film
from study.errors import StimulusError
from study.experiment.plan import draw_plan
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.stimuli.prepare import check, prepare
from study.experiment.stimuli.stimulus import StimulusSet
from study.motion.clip import Clip
from study.transitions.blend_length import geodesic_length


def changed(*pairs: tuple[str, str], base: str = TOY_PROTOCOL) -> Any:
    text = base
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new, 1)
    return parse_protocol(text)


@pytest.fixture(scope="module")
def toys() -> ToyLibrary:
    return ToyLibrary(
        {"slow": Toy(0.8, 1.4), "quick": Toy(1.6, 0.9), "still": Toy(0.0, 3.0), "short": Toy(1.0, 1.0, seconds=2.0)}
    )


@pytest.fixture(scope="module")
def prepared(toys: ToyLibrary) -> StimulusSet:
    return prepare(parse_protocol(TOY_PROTOCOL), toys)


def test_every_pair_has_its_stimuli(prepared: StimulusSet) -> None:
    assert [pair.name for pair in prepared.pairs] == [
        "jnd/slow_quick/-3",
        "jnd/slow_quick/+0",
        "jnd/slow_quick/+5",
        "liking/slow_quick",
        "liking/still_slow",
    ]
    for pair in prepared.pairs:
        assert prepared.stimulus(pair.stimuli[0]).record.transition == pair.motion
        assert prepared.stimulus(pair.stimuli[1]).record.transition == pair.motion
    draw_plan(prepared.protocol, prepared.pairs, "p01")


def test_practice_has_the_plainest_levels_of_a_transition_of_its_own(toys: ToyLibrary) -> None:
    old = "differences_frames = [-3, 0, 5]\n"
    new = 'differences_frames = [-3, 0, 2, 5]\npractice = 2\npractice_transitions = ["still_slow"]\n'
    prepared = prepare(parse_protocol(TOY_PROTOCOL.replace(old, new)), toys)
    levels = {
        motion: [pair.difference_frames for pair in prepared.pairs if (pair.study, pair.motion) == ("jnd", motion)]
        for motion in ("slow_quick", "still_slow")
    }
    assert levels == {"slow_quick": [-3, 0, 2, 5], "still_slow": [-3, 0, 5]}


def test_levels_are_the_optimal_length_and_what_was_added(prepared: StimulusSet) -> None:
    for pair in prepared.pairs[:3]:
        reference, comparison = prepared.stimulus(pair.stimuli[0]).record, prepared.stimulus(pair.stimuli[1]).record
        assert reference.blend_frames == reference.optimal_frames
        assert comparison.blend_frames == reference.optimal_frames + pair.difference_frames
        assert comparison.frames == 9 + comparison.blend_frames + 9
        assert (comparison.blend_start, comparison.blend_stop) == (9, 9 + comparison.blend_frames)
    for pair in prepared.pairs[3:]:
        assert prepared.stimulus(pair.stimuli[1]).record.blend_frames == 10
        assert pair.methods[1] == "fixed"


def test_no_difference_is_the_very_same_stimulus(prepared: StimulusSet) -> None:
    same = prepared.pairs[1]
    assert same.difference_frames == 0
    assert same.stimuli[0] == same.stimuli[1]


def test_identical_stimuli_are_there_once_and_studies_share_them(prepared: StimulusSet) -> None:
    ids = [stimulus.id for stimulus in prepared.stimuli]
    assert len(set(ids)) == len(ids)
    # The preference study's geodesic stimulus is the reference of the other study: same transition and conditions.
    assert prepared.pairs[3].stimuli[0] == prepared.pairs[0].stimuli[0]
    assert len(ids) == 3 + 1 + 2


def test_entries_are_the_same_for_all_lengths_but_for_the_feet(toys: ToyLibrary) -> None:
    """Up to the blend all lengths show the same frames in the same place."""
    made = prepare(changed(("exit_s = 0.3", "exit_s = 0.3\nclean_feet = false")), toys)
    entries = [made.stimulus(pair.stimuli[1]).positions[:9] for pair in made.pairs[:3]]
    for entry in entries[1:]:
        np.testing.assert_array_equal(entry, entries[0])


def test_transitions_start_over_the_origin_along_z(prepared: StimulusSet) -> None:
    for stimulus in prepared.stimuli:
        hips = stimulus.positions[:, 0]
        # Where the blend begins, the first blended frame is one step on from the origin at most.
        assert np.hypot(hips[9, 0], hips[9, 2]) < 0.1
        way = hips[-1] - hips[0]
        assert abs(np.arctan2(way[0], way[2])) < np.radians(15)


def test_nothing_leaves_the_frame_and_a_group_shares_its_camera(prepared: StimulusSet) -> None:
    cameras = {}
    for stimulus in prepared.stimuli:
        pixels, _ = project_film(stimulus.camera, stimulus.positions, prepared.protocol.fps)
        assert pixels.min() >= 0
        assert pixels[..., 0].max() <= 96
        assert pixels[..., 1].max() <= 64
        cameras.setdefault(stimulus.record.group, set()).add(id(stimulus.camera))
    assert {group: len(seen) for group, seen in cameras.items()} == {"slow_quick": 1, "still_slow": 1}


@pytest.mark.parametrize(("group", "cameras"), [("study", 1), ("category", 2), ("transition", 2)])
def test_the_protocol_says_what_shares_a_camera(toys: ToyLibrary, group: str, cameras: int) -> None:
    made = prepare(changed(("exit_s", f'camera_group = "{group}"\nexit_s')), toys)
    assert len({id(stimulus.camera) for stimulus in made.stimuli}) == cameras


def test_a_transition_at_other_points_has_a_camera_of_its_own(toys: ToyLibrary) -> None:
    """Films that a trial compares share one; those of another study do too where it shows one of the same films."""
    old = 'name = "liking"'
    assert old in TOY_PROTOCOL
    apart = TOY_PROTOCOL.replace(old, f"{old}\npoints = {{ source_within = [0.6, 1.0] }}")
    made = prepare(parse_protocol(apart), toys)
    groups = {pair.name: {made.stimulus(shown).record.group for shown in pair.stimuli} for pair in made.pairs}
    assert groups["jnd/slow_quick/+5"] == groups["jnd/slow_quick/-3"] == {"slow_quick"}
    assert groups["liking/slow_quick"] == {"slow_quick-2"}
    assert all(len(group) == 1 for group in groups.values())


@pytest.mark.parametrize("camera", ["fixed", "pan", "track"])
def test_the_camera_is_part_of_the_name_and_of_the_record(toys: ToyLibrary, prepared: StimulusSet, camera: str) -> None:
    made = prepare(changed(("exit_s", f'camera = "{camera}"\nexit_s')), toys)
    same = {one.id for one in made.stimuli} == {one.id for one in prepared.stimuli}
    assert same == (camera == "pan")
    for stimulus in made.stimuli:
        assert (stimulus.camera.turns is not None) == (camera == "pan")
        assert stimulus.camera.track_seconds == (1.0 if camera == "track" else None)


def test_the_same_protocol_gives_the_same_stimuli(prepared: StimulusSet, toys: ToyLibrary) -> None:
    again = prepare(parse_protocol(TOY_PROTOCOL), toys)
    assert [stimulus.id for stimulus in again.stimuli] == [stimulus.id for stimulus in prepared.stimuli]
    assert again.pairs == prepared.pairs
    assert again.records == prepared.records


def test_points_do_not_hang_on_the_order_of_transitions(prepared: StimulusSet, toys: ToyLibrary) -> None:
    first, rest = TOY_PROTOCOL.split("[[transitions]]", 1)
    one, two = rest.split("[[transitions]]", 1)
    two, studies = two.split("[[studies]]", 1)
    swapped = parse_protocol(f"{first}[[transitions]]{two}[[transitions]]{one}[[studies]]{studies}")
    assert {stimulus.id for stimulus in prepare(swapped, toys).stimuli} == {s.id for s in prepared.stimuli}


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ('title = "A toy"', 'title = "Another"', True),
        ("seed = 5", "seed = 6", False),
        ("width = 96", "width = 98", False),
        ("exit_s = 0.3", 'exit_s = 0.3\nstyle = "points"', False),
        ("exit_s = 0.3", 'exit_s = 0.3\nview = "front"', False),
        ("exit_s = 0.3", 'exit_s = 0.3\nweight = "sigmoid"', False),
        ("exit_s = 0.3", "exit_s = 0.4", False),
        ("[points]", '[stimuli.colours]\nleft = "#102030"\n\n[points]', False),
        ("fps = 30", "fps = 60", False),
    ],
)
def test_names_follow_what_is_seen_and_nothing_else(
    prepared: StimulusSet, toys: ToyLibrary, old: str, new: str, same: bool
) -> None:
    ids = {stimulus.id for stimulus in prepared.stimuli}
    others = {stimulus.id for stimulus in prepare(changed((old, new)), toys).stimuli}
    assert (others == ids) if same else not (others & ids)


def test_lengths_are_those_of_the_methods(prepared: StimulusSet, toys: ToyLibrary) -> None:
    """What the record says is what its length gives at the recorded points."""
    for pair in prepared.pairs:
        record = prepared.stimulus(pair.stimuli[0]).record
        clips = [
            toys.clip(use.motion, fps=30.0, min_seconds=use.frames / 30.0)
            for use in (record.source, record.destination)
        ]
        assert [clip.frames for clip in clips] == [record.source.frames, record.destination.frames]
        found = geodesic_length(*clips, record.source.frame, record.destination.frame)
        assert found.blend_frames == record.optimal_frames
        assert 4 <= found.blend_frames <= 30


def test_conditions_are_kept(toys: ToyLibrary) -> None:
    text = TOY_PROTOCOL.replace(
        "longest_frames = 30", "longest_frames = 30\navoid_frames = 10\navoid_within_frames = 5"
    )
    for seed in range(4):
        made = prepare(parse_protocol(text.replace("seed = 5", f"seed = {seed}")), toys)
        lengths = [made.stimulus(pair.stimuli[0]).record.optimal_frames for pair in made.pairs]
        assert all(4 <= length <= 30 and abs(length - 10) > 5 for length in lengths)


def test_given_points_are_taken(toys: ToyLibrary) -> None:
    given = 'points = { choose = "given", source_s = 1.0, destination_frame = 77 }'
    made = prepare(changed(('destination = "quick"', f'destination = "quick"\n{given}')), toys)
    record = made.stimulus(made.pairs[0].stimuli[0]).record
    assert (record.source.frame, record.destination.frame) == (30, 77)


def test_a_cut_has_no_blend(toys: ToyLibrary) -> None:
    made = prepare(changed(('comparison = "fixed"', 'comparison = "cut"')), toys)
    record = made.stimulus(made.pairs[3].stimuli[1]).record
    assert (record.blend_frames, record.frames, record.method) == (0, 18, "cut")


def test_rating_pairs_hold_one_stimulus_each(rating_protocol: Protocol, toys: ToyLibrary) -> None:
    made = prepare(rating_protocol, toys)
    rated = [pair for pair in made.pairs if pair.study == "rating"]
    assert [(pair.name, pair.methods, len(pair.stimuli)) for pair in rated] == [
        ("rating/slow_quick/geodesic", ("geodesic",), 1),
        ("rating/slow_quick/cut", ("cut",), 1),
        ("rating/still_slow/geodesic", ("geodesic",), 1),
        ("rating/still_slow/cut", ("cut",), 1),
    ]


def test_rated_pairs_hold_both_methods(pair_rating_protocol: Protocol, toys: ToyLibrary) -> None:
    made = prepare(pair_rating_protocol, toys)
    rated = [pair for pair in made.pairs if pair.study == "compared"]
    assert [(pair.name, *pair.methods) for pair in rated] == [
        ("compared/slow_quick", "geodesic", "cut"),
        ("compared/still_slow", "geodesic", "cut"),
    ]
    for pair in rated:
        assert [made.stimulus(name).record.method for name in pair.stimuli] == ["geodesic", "cut"]


# --- refusals ------------------------------------------------------------------------------------------------------


def test_a_clip_that_is_too_short_says_how_many_frames_are_missing(toys: ToyLibrary) -> None:
    """Two seconds are 60 frames; 60 of entry and blends of up to 35 need 95."""
    protocol = changed(('source = "slow"', 'source = "short"'), ("entry_s = 0.3", "entry_s = 2.0"))
    message = check(protocol, toys)[0]
    assert "motion 'short': expected 95 frames at 30 fps" in message
    assert "60 frames of entry and blends of up to 35 frames" in message
    assert "found 60 in toy: 35 frames are missing" in message
    assert "can't be continued before its start or after its end" in message
    with pytest.raises(StimulusError, match="35 frames are missing"):
        prepare(protocol, toys)


def test_a_clip_that_is_just_long_enough_is_taken() -> None:
    for frames, enough in ((94, False), (95, True)):
        library = ToyLibrary({"slow": Toy(0.8, 1.4, seconds=frames / 30), "quick": Toy(1.6, 0.9), "still": Toy(0, 3.0)})
        protocol = changed(("entry_s = 0.3", "entry_s = 2.0"), ('["slow_quick"]', '["slow_quick"]\npoints = {}'))
        problems = [problem for problem in check(protocol, library) if "'slow'" in problem and "missing" in problem]
        assert (not problems) == enough, problems


def test_a_level_below_one_frame_is_refused(toys: ToyLibrary) -> None:
    """The given points make a blend of some length k; a difference of -k leaves nothing."""
    given = 'points = { choose = "given", source_s = 1.0, destination_frame = 77 }'
    at = ('destination = "quick"', f'destination = "quick"\n{given}')
    made = prepare(changed(at), toys)
    length = made.stimulus(made.pairs[0].stimuli[0]).record.optimal_frames
    assert check(changed(at, ("[-3, 0, 5]", f"[{1 - length}, 5]")), toys) == []
    (problem,) = check(changed(at, ("[-3, 0, 5]", f"[{-length}, 5]")), toys)
    assert f"a level below one frame: the geodesic blend here takes {length} frames" in problem
    assert f"the difference {-length} leaves 0" in problem


def test_given_points_without_room_are_refused(toys: ToyLibrary) -> None:
    def problems(source_s: str) -> str:
        given = f'points = {{ choose = "given", source_s = {source_s}, destination_s = 2 }}'
        return "\n".join(check(changed(('destination = "quick"', f'destination = "quick"\n{given}')), toys))

    assert "expected 9 frames for entry, found 3 in 'slow': 6 are missing" in problems("0.1")
    assert "expected source_frame from 0 to" in problems("99")
    assert "found 2970; choose another point" in problems("99")


def test_conditions_that_nothing_meets_are_refused_with_what_was_found(toys: ToyLibrary) -> None:
    protocol = changed(("shortest_frames = 4\nlongest_frames = 30", "shortest_frames = 58\nlongest_frames = 58"))
    problems = check(protocol, toys)
    assert len(problems) == 3
    assert (
        "expected points whose geodesic blend meets the conditions of the study 'jnd', found none among" in problems[0]
    )
    assert "shorter than 58 frames" in problems[0]


def test_a_motion_that_is_missing_is_named_once(toys: ToyLibrary) -> None:
    problems = check(changed(('source = "slow"', 'source = "slwo"')), toys)
    assert problems == ["motion 'slwo': Expected a motion of toy, found 'slwo'. It has slow, quick, still, short."]


def test_all_problems_are_named_at_once(toys: ToyLibrary) -> None:
    protocol = changed(('source = "slow"', 'source = "slwo"'), ('source = "still"', 'source = "stil"'))
    assert len(check(protocol, toys)) == 2
    with pytest.raises(StimulusError) as caught:
        prepare(protocol, toys)
    assert str(caught.value).splitlines() == check(protocol, toys)


def test_what_can_be_shown_has_no_problems(toys: ToyLibrary) -> None:
    assert check(parse_protocol(TOY_PROTOCOL), toys) == []


def test_an_unknown_stimulus_is_refused(prepared: StimulusSet) -> None:
    with pytest.raises(StimulusError, match="Expected the id of a stimulus of 'toy', found 'nothing'"):
        prepared.stimulus("nothing")


def test_captured_motions_are_extended_and_the_record_says_by_how_much(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clip that walks but is too short is continued by cycles; points stay within what was captured."""

    class Captured(ToyLibrary):
        def entry(self, name: str) -> Any:
            return replace(super().entry(name), start="gait", end="gait")

    library = Captured(
        {"slow": Toy(0.8, 1.4, seconds=3.0), "quick": Toy(1.6, 0.9, seconds=2.0), "still": Toy(0.0, 3.0, seconds=9.0)},
        synthetic=False,
    )
    calls = []
    from study.motion import cycles

    def extend(clip: Clip, *, frames_before: int = 0, frames_after: int = 0) -> Any:
        calls.append((clip.name, frames_before, frames_after))
        path = np.arange(-frames_before, clip.frames + frames_after) % clip.frames
        speed = clip.root_positions[1, 2] - clip.root_positions[0, 2]
        root = clip.root_positions[path].copy()
        root[:, 2] = speed * np.arange(-frames_before, clip.frames + frames_after)
        longer = replace(clip, root_positions=root, rotations=clip.rotations[path])
        return cycles.Extension(longer, frames_before, frames_after, "extended by the test")

    monkeypatch.setattr(cycles, "extend", extend)
    made = prepare(changed(("entry_s = 0.3", "entry_s = 2.0"), ("exit_s = 0.3", "exit_s = 2.0")), library)
    assert {name for name, _, _ in calls} == {"slow", "quick"}
    record = made.stimulus(made.pairs[0].stimuli[0]).record
    for use, frames in ((record.source, 90), (record.destination, 60)):
        assert use.frames == frames
        assert 0 <= use.frame < frames
        assert use.added_before + use.added_after > 0
        assert "extended by the test" in use.notes
    assert not record.synthetic
    assert record.frames == 120 + record.blend_frames
