"""What `check` says will be shown is what is then prepared."""

from __future__ import annotations

import pytest
from toys import TOY_PROTOCOL, ToyLibrary

from study.experiment.plan import draw_plan
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.session import open_session
from study.experiment.stimuli.outlook import look_ahead, place_of
from study.experiment.stimuli.prepare import prepare
from study.experiment.stimuli.supply import Supply


@pytest.fixture
def protocol() -> Protocol:
    practice = 'differences_frames = [-3, 0, 5]\npractice = 2\npractice_transitions = ["still_slow"]'
    return parse_protocol(TOY_PROTOCOL.replace("differences_frames = [-3, 0, 5]", practice))


def test_the_rows_are_what_is_prepared(protocol: Protocol, toy_library: ToyLibrary) -> None:
    ahead, made = look_ahead(protocol, toy_library), prepare(protocol, toy_library)
    assert ahead.problems == ()
    assert ahead.films == len(made.records)
    assert [(row.study, row.transition, row.role, row.trials) for row in ahead.rows] == [
        ("jnd", "slow_quick", "trial", 6),
        ("jnd", "still_slow", "practice", None),
        ("liking", "slow_quick", "trial", 1),
    ]
    for row in ahead.rows:
        pairs = [pair for pair in made.pairs if (pair.study, pair.motion) == (row.study, row.transition)]
        records = {name: made.stimulus(name).record for pair in pairs for name in pair.stimuli}
        assert row.films == len(records)
        assert row.film_s == pytest.approx(
            (min(r.frames for r in records.values()) / 30, max(r.frames for r in records.values()) / 30)
        )
        lengths = {frames for own in row.lengths.values() for frames in own}
        assert lengths == {record.blend_frames for record in records.values()}
        for place, use in ((row.source, "source"), (row.destination, "destination")):
            assert {getattr(record, use).frame for record in records.values()} == {place.frame}
            assert place.s == pytest.approx(place.frame / 30)
        assert row.k_frames == made.stimulus(pairs[0].stimuli[0]).record.optimal_frames
        assert row.k_s == pytest.approx(row.k_frames / 30)


def test_the_minutes_are_those_of_the_films(protocol: Protocol, toy_library: ToyLibrary) -> None:
    """Counted by hand over a plan: films, gaps, answers of two seconds and pauses; then reading."""
    text = protocol.text.replace("entry_s = 0.3", "entry_s = 2.5").replace('"Welcome."', '"{minutes} minutes"')
    text = text.replace('order = "both"', 'order = "both"\nrepeats = 30')
    longer = parse_protocol(text)
    ahead, made = look_ahead(longer, toy_library), prepare(longer, toy_library)
    plan = draw_plan(longer, made.pairs, "p01")
    frames = {record.id: record.frames for record in made.records}
    seconds = sum(frames[name] for trial in plan.trials for name in trial.stimuli) / 30 + 4 * len(plan.trials)
    assert ahead.minutes == pytest.approx(seconds / 60, abs=5)
    assert ahead.minutes < ahead.minutes_at_most
    welcome = next(step.text for step in open_session(longer, plan, frames=frames).steps if "minutes" in step.text)
    assert welcome == f"{ahead.minutes} minutes"


def test_methods_that_nobody_can_tell_apart_are_named(toy_library: ToyLibrary) -> None:
    """2004 section 5.1: 10 frames are 7 fewer than 17, under the 8 that are noticed; at 60 fps, twice as many."""
    base = TOY_PROTOCOL.replace(
        "shortest_frames = 4\nlongest_frames = 30", "shortest_frames = {0}\nlongest_frames = {0}"
    )
    for frames, said in ((12, True), (17, True), (18, False)):
        found = look_ahead(parse_protocol(base.format(frames)), toy_library)
        notes = [note for note in found.notes if note.startswith("liking:")]
        assert bool(notes) == said, (frames, notes)
    at_60 = look_ahead(parse_protocol(base.format(33).replace("fps = 30", "fps = 60")), toy_library)
    assert "14 frames longer or 16 shorter" in at_60.notes[0]  # 33 less 20 are 13


def test_what_cannot_be_shown_is_said_and_the_rest_is_listed(toy_library: ToyLibrary) -> None:
    found = look_ahead(parse_protocol(TOY_PROTOCOL.replace('source = "still"', 'source = "stil"')), toy_library)
    assert len(found.problems) == 1
    assert {row.transition for row in found.rows} == {"slow_quick"}
    assert found.minutes >= 1


def test_frames_are_counted_from_where_the_motion_begins_not_from_what_was_added_before_it(
    toy_library: ToyLibrary,
) -> None:
    clip = toy_library.clip("slow", fps=30)
    found = place_of(Supply("slow", clip, 12, clip.frames, (20, 30), "slow.bvh"), 27)
    assert (found.frame, found.s) == (15, 0.5)
