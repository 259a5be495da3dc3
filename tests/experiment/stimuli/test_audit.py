"""The audit of pairs, held against pixels and decoded films; shortcut observers against percepts drawn one by one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from renderer.offscreen import plain_frame, render_frames, render_rgb
from renderer.video import render_video
from study.errors import ProtocolError
from study.experiment.protocol.whole import Protocol, find_protocol, load_protocol, parse_protocol
from study.experiment.stimuli.audit import PairAudit
from study.experiment.stimuli.manifest import read_manifest, record
from study.experiment.stimuli.outlook import look_ahead
from study.experiment.stimuli.prepare import check, prepare
from study.experiment.stimuli.shortcuts import shortcuts_of
from study.experiment.stimuli.stimulus import Stimulus, StimulusSet
from study.motion.library import open_library

CUES = {
    "duration": 0.05,
    "place in the first frame": 0.1,
    "size in the first frame": 0.03,
    "place in the last frame": 0.1,
    "size in the last frame": 0.03,
}


@pytest.fixture(scope="module")
def paper() -> StimulusSet:
    """Study one of 2004 on the synthetic library, seen by a camera that neither turns nor is chosen for small cues."""
    text = find_protocol("blend_length_jnd").read_text(encoding="utf-8")
    still = text.replace('camera = "pan"', 'camera = "fixed"').replace('view = "least-cue"', 'view = "clearest"')
    return prepare(parse_protocol(still), open_library("synthetic"))


@pytest.fixture(scope="module")
def panned() -> StimulusSet:
    """The study as it is published here: a camera that turns."""
    return prepare(load_protocol(find_protocol("blend_length_jnd")), open_library("synthetic"))


def pixels(stimulus: Stimulus, frame: int) -> tuple[float, float, float]:
    """Middle across and down, and height, of what is not background in the first (0) or the last drawn frame (-1)."""
    *_, picture = render_rgb(stimulus.positions if frame else stimulus.positions[:1], stimulus.figure, stimulus.camera)
    seen = (np.abs(picture.astype(int) - np.array(stimulus.figure.background)) > 40).any(axis=2)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    return (columns[0] + columns[-1] + 1) / 2, (rows[0] + rows[-1] + 1) / 2, rows[-1] - rows[0] + 1


def decoded_frames(path: Path) -> int:
    with av.open(str(path)) as film:
        return sum(1 for _ in film.decode(video=0))


def members(stimuli: StimulusSet, name: str) -> tuple[Stimulus, Stimulus]:
    pair = next(one for one in stimuli.pairs if one.name == name)
    reference, comparison = (stimuli.stimulus(one) for one in pair.stimuli)
    return reference, comparison


@pytest.mark.parametrize(
    ("name", "camera"),
    [("jnd/walking/+20", "paper"), ("jnd/standing_to_walking/-15", "panned"), ("jnd/running_to_turning/+20", "panned")],
)
def test_places_and_sizes_are_those_of_drawn_pixels(name: str, camera: str, request: pytest.FixtureRequest) -> None:
    stimuli: StimulusSet = request.getfixturevalue(camera)
    audit = next(one for one in stimuli.audits if one.pair == name)
    reference, comparison = members(stimuli, name)
    for frame, found in ((0, audit.first), (-1, audit.last)):
        (x1, y1, high1), (x2, y2, high2) = pixels(reference, frame), pixels(comparison, frame)
        mean = (high1 + high2) / 2
        assert found.right == pytest.approx((x2 - x1) / mean, abs=0.015)
        assert found.down == pytest.approx((y2 - y1) / mean, abs=0.015)
        assert found.size == pytest.approx(high2 / high1, abs=0.015)


def test_durations_are_those_of_decoded_films(paper: StimulusSet, tmp_path: Path) -> None:
    audit = next(one for one in paper.audits if one.pair == "jnd/walking/-15")
    for number, stimulus in enumerate(members(paper, "jnd/walking/-15")):
        path = tmp_path / f"{number}.mp4"
        render_video(path, stimulus.positions, stimulus.figure, stimulus.camera, fps=30)
        assert decoded_frames(path) / 30 == pytest.approx(audit.seconds[number])


def test_path_and_speed_are_those_of_the_pelvis(paper: StimulusSet) -> None:
    audit = next(one for one in paper.audits if one.pair == "jnd/walking/+20")
    _, comparison = members(paper, "jnd/walking/+20")
    length = 0.0
    for before, after in zip(comparison.positions[:-1, 0], comparison.positions[1:, 0], strict=True):
        length += float(np.hypot(after[0] - before[0], after[2] - before[2]))
    assert audit.paths_m[1] == pytest.approx(length, abs=1e-4)
    assert audit.speeds_m_s[1] == pytest.approx(length / (len(comparison.positions) / 30), abs=1e-4)


def test_the_same_pose_elsewhere_differs_in_place_alone(paper: StimulusSet) -> None:
    """The last frame of a pair shows one frame of the destination, nearer or farther: its pose is nearly the same."""
    assert max(one.last.pose for one in paper.audits) < 0.03
    assert all((one.first.right, one.first.size, one.first.pose) == (0.0, 1.0, 0.0) for one in paper.audits)


def brute_force_right(apart_sd: float, rng: np.random.Generator) -> float:
    """Right answers of somebody who draws percepts of two stimuli and calls them different beyond the best distance."""
    trials = 200_000
    noise = rng.standard_normal((2, 2, trials))
    distance_same = np.sort(np.abs(noise[0, 0] - noise[0, 1]))
    distance_different = np.sort(np.abs(noise[1, 0] + apart_sd - noise[1, 1]))
    best = 0.5
    for beyond in np.linspace(0, apart_sd + 5, 300):
        hits = 1 - np.searchsorted(distance_different, beyond) / trials
        alarms = 1 - np.searchsorted(distance_same, beyond) / trials
        best = max(best, (hits + 1 - alarms) / 2)
    return best


def test_shortcut_observers_answer_as_percepts_drawn_one_by_one(paper: StimulusSet, tmp_path: Path) -> None:
    """From decoded lengths and drawn pixels alone; nothing of the audit's own numbers is used."""
    rng = np.random.default_rng(14)
    shares = shortcuts_of(paper.protocol, paper.pairs, paper.audits)
    level, motion = 20, "running_to_turning"
    reference, comparison = members(paper, f"jnd/{motion}/+{level}")
    one, other = (pixels(stimulus, -1) for stimulus in (reference, comparison))
    frames = []
    for number, stimulus in enumerate((reference, comparison)):
        path = tmp_path / f"{number}.mp4"
        render_video(path, stimulus.positions, stimulus.figure, stimulus.camera, fps=30)
        frames.append(decoded_frames(path))
    mean = (one[2] + other[2]) / 2
    apart = {
        "duration": np.log(frames[1] / frames[0]) / 0.05,
        "place in the last frame": np.hypot(other[0] - one[0], other[1] - one[1]) / mean / 0.1,
        "size in the last frame": np.log(other[2] / one[2]) / 0.03,
        "place in the first frame": 0.0,
        "size in the first frame": 0.0,
    }
    at_level = {share.cue: share for share in shares if share.level == level}
    assert set(at_level) == set(CUES)
    own = shortcuts_of(paper.protocol, [pair for pair in paper.pairs if pair.motion == motion], paper.audits)
    found = {share.cue: share.share for share in own if share.level == level}
    for cue, distance in apart.items():
        assert found[cue] == pytest.approx(brute_force_right(abs(float(distance)), rng), abs=0.015), cue
        assert at_level[cue].furthest >= found[cue] - 1e-6


PREFERENCE = """
name = "longer"
title = "t"
fps = 30
seed = 3
[stimuli]
width = 320
height = 240
view = "side"
[points]
choose = "random"
shortest_frames = 20
longest_frames = 40
[[transitions]]
name = "walking"
category = "walking"
source = "walk"
destination = "walk_fast"
[[studies]]
name = "natural"
task = "preference"
reference = "fixed"
comparison = "geodesic"
fixed_frames = 10
"""


def test_a_preference_for_longer_stimuli_is_counted_as_answers_for_the_longer_method() -> None:
    made = prepare(parse_protocol(PREFERENCE), open_library("synthetic"))
    (audit,) = made.audits
    shares = {share.cue: share.share for share in shortcuts_of(made.protocol, made.pairs, made.audits)}
    rng = np.random.default_rng(5)
    seconds = [len(stimulus.positions) / 30 for stimulus in members(made, audit.pair)]
    percepts = [np.log(s) + 0.05 * rng.standard_normal(400_000) for s in seconds]
    assert shares["duration"] == pytest.approx((percepts[1] > percepts[0]).mean(), abs=0.005)
    assert shares["duration"] > 0.8
    (x1, _, high1), (x2, _, high2) = (pixels(stimulus, -1) for stimulus in members(made, audit.pair))
    places = [x / (high1 + high2) * 2 + 0.1 * rng.standard_normal(400_000) for x in (x1, x2)]
    assert shares["place in the last frame"] == pytest.approx((places[1] < places[0]).mean(), abs=0.02)


def test_of_many_methods_each_has_its_share_of_the_answers_in_its_pairs() -> None:
    """Whoever takes the longer of two films, all films drawn once: answers for each method, counted."""
    text = PREFERENCE.replace('comparison = "geodesic"', 'comparison = "geodesic"\nothers = ["cut", "inertialize"]')
    made = prepare(parse_protocol(text), open_library("synthetic"))
    shares = shortcuts_of(made.protocol, made.pairs, made.audits)
    duration = {share.method: share.share for share in shares if share.cue == "duration"}
    assert len(made.audits) == 6
    rng, chosen = np.random.default_rng(5), dict.fromkeys(("fixed", "geodesic", "cut", "inertialize"), 0.0)
    for pair in made.pairs:
        one, other = (
            np.log(len(stimulus.positions) / 30) + 0.05 * rng.standard_normal(200_000)
            for stimulus in members(made, pair.name)
        )
        for method, more in zip(pair.methods, (one > other, other > one), strict=True):
            chosen[method] += float(more.mean()) / 3
    assert duration == pytest.approx(chosen, abs=0.005)
    assert min(duration.values()) < 0.2 < 0.8 < max(duration.values())


def test_matched_stimuli_run_through_the_same_frames_at_the_same_times() -> None:
    made = prepare(load_protocol(find_protocol("blend_length_jnd_matched")), open_library("synthetic"))
    for pair in made.pairs:
        one, other = (made.stimulus(identifier) for identifier in pair.stimuli)
        assert len(one.positions) == len(other.positions)
        middles = [(each.record.blend_start + each.record.blend_stop) / 2 for each in (one, other)]
        assert abs(middles[1] - middles[0]) <= 0.5
        first = min(one.record.blend_start, other.record.blend_start)
        np.testing.assert_array_equal(one.positions[:first], other.positions[:first])
        # The same poses follow, wherever the figure has come to: heights above the floor tell. (Feet are planted for
        # some frames after a blend.)
        np.testing.assert_allclose(one.positions[-20:, :, 1], other.positions[-20:, :, 1], atol=2e-4)


@pytest.mark.parametrize("where", ["synthetic", pytest.param("cmu", marks=pytest.mark.mocap)])
def test_the_matched_study_gives_nothing_away(where: str, request: pytest.FixtureRequest) -> None:
    """Every shortcut observer is right in at most 55% of the trials, at every level and for every transition."""
    library = open_library(where if where == "synthetic" else request.getfixturevalue("mocap") / "cmu")
    made = prepare(load_protocol(find_protocol("blend_length_jnd_matched")), library)
    shares = shortcuts_of(made.protocol, made.pairs, made.audits)
    assert {(share.cue, share.level) for share in shares} == {
        (cue, level) for cue in CUES for level in (-15, -10, -5, 5, 10, 20)
    }
    assert max(share.furthest for share in shares) <= 0.55


def test_odd_differences_and_cuts_are_matched_too() -> None:
    text = PREFERENCE.replace('view = "side"', 'view = "side"\nmatch = "duration"').replace(
        "shortest_frames = 20\n", ""
    )
    for comparison in ("geodesic", "cut", "timewarp"):
        made = prepare(parse_protocol(text.replace('comparison = "geodesic"', f'comparison = "{comparison}"')), LIBRARY)
        (pair,) = made.pairs
        one, other = (made.stimulus(identifier) for identifier in pair.stimuli)
        assert len(one.positions) == len(other.positions)
        assert one.record.blend_frames != other.record.blend_frames
        np.testing.assert_array_equal(one.positions[0], other.positions[0])
        if comparison != "timewarp":
            np.testing.assert_allclose(one.positions[-1, :, 1], other.positions[-1, :, 1], atol=2e-4)


LIBRARY = open_library("synthetic")


def test_a_blend_that_the_entry_has_no_room_for_is_refused() -> None:
    text = PREFERENCE.replace('view = "side"', 'match = "duration"\nentry_s = 0.1')
    (problem,) = check(parse_protocol(text), LIBRARY)
    assert "expected an entry and an exit of" in problem
    assert "raise entry_s and exit_s" in problem


def test_methods_whose_blends_cannot_be_moved_are_refused_with_match() -> None:
    text = PREFERENCE.replace('view = "side"', 'match = "duration"').replace('"geodesic"', '"one-hop"')
    with pytest.raises(Exception, match="expected in the preference study 'natural' methods whose blends can be moved"):
        parse_protocol(text)


def test_the_view_with_the_least_cue_gives_less_away_than_any_named_one() -> None:
    def largest(view: str) -> float:
        made = prepare(parse_protocol(PREFERENCE.replace('view = "side"', f'view = "{view}"')), LIBRARY)
        ends = [frame for one in made.audits for frame in (one.first, one.last)]
        places = max(np.hypot(frame.right, frame.down) / 0.1 for frame in ends)
        return float(max(places, *(abs(np.log(frame.size)) / 0.03 for frame in ends)))

    assert largest("least-cue") <= min(largest(view) for view in ("front", "side", "three-quarter", "clearest"))


def test_the_manifest_keeps_the_audit_and_older_ones_open(paper: StimulusSet, tmp_path: Path) -> None:
    record(paper, tmp_path)
    assert read_manifest(tmp_path).audits == paper.audits
    path = tmp_path / "manifest.json"
    data: dict[str, Any] = json.loads(path.read_text())
    del data["audit"]
    path.write_text(json.dumps(data))
    assert read_manifest(tmp_path).audits == ()


def test_check_reports_the_audit_and_warns(paper: StimulusSet) -> None:
    outlook = look_ahead(paper.protocol, LIBRARY)
    assert outlook.audits == paper.audits
    (note,) = (one for one in outlook.notes if "threshold of 75%" in one)
    assert "size in the last frame" in note
    assert f"(up to {100 * max(one.furthest for one in outlook.shortcuts):.0f}%, " in note
    assert 'match = "duration"' in note
    matched = look_ahead(load_protocol(find_protocol("blend_length_jnd_matched")), LIBRARY)
    assert not [one for one in matched.notes if "threshold" in one]


def test_the_published_study_takes_the_view_that_gives_least_away(panned: StimulusSet) -> None:
    """Of the same films seen by the same kind of camera, no named view leaves the shortcut observers less."""

    def most(made: StimulusSet) -> float:
        shares = shortcuts_of(made.protocol, made.pairs, made.audits)
        return max(one.furthest for one in shares if one.cue != "duration")

    text = find_protocol("blend_length_jnd").read_text(encoding="utf-8")
    for view in ("front", "side", "three-quarter", "clearest"):
        named = parse_protocol(text.replace('view = "least-cue"', f'view = "{view}"'))
        assert most(panned) <= most(prepare(named, LIBRARY)) + 1e-9, view


def test_single_stimuli_have_no_audit(rating_protocol: Protocol, toy_library: Any) -> None:
    made = prepare(rating_protocol, toy_library)
    singles = {pair.name for pair in made.pairs if len(pair.stimuli) == 1}
    assert singles
    assert singles.isdisjoint(one.pair for one in made.audits)
    assert all(isinstance(one, PairAudit) for one in made.audits)


SAME = PREFERENCE.replace('task = "preference"', 'task = "same-different"').replace(
    'reference = "fixed"\ncomparison = "geodesic"\nfixed_frames = 10',
    'reference = "geodesic"\ndifferences_frames = [0, 20]',
)


def test_jitter_of_the_end_makes_durations_tell_less() -> None:
    """Over twelve transitions; the pair without a difference has two ends as well, else equal durations would tell."""
    apart: dict[int, list[float]] = {0: [], 20: []}
    for seed in range(12):
        text = SAME.replace("seed = 3", f"seed = {seed}").replace("[stimuli]", "[stimuli]\njitter_s = 1.2")
        made = prepare(parse_protocol(text), LIBRARY)
        for one in made.stimuli:
            assert 0 <= 120 + one.record.blend_frames - len(one.positions) <= 36
        for pair, audit in zip(made.pairs, made.audits, strict=True):
            apart[pair.difference_frames or 0].append(float(np.log(audit.seconds[1] / audit.seconds[0])) / 0.05)
    assert len(set(apart[0])) > 6
    noise = np.random.default_rng(2).standard_normal((2, 12, 20_000)) * np.sqrt(2)
    heard = [np.abs(np.array(apart[level])[:, None] + noise[i]) for i, level in enumerate((0, 20))]
    best = max(((heard[1] > c).mean() + (heard[0] <= c).mean()) / 2 for c in np.linspace(0, 10, 200))
    plain = brute_force_right(20 / 141 / 0.05, np.random.default_rng(3))
    assert best < plain - 0.05


@pytest.mark.parametrize(("ending", "frames_before_end"), [("fade", 7), ("cover", 15)])
def test_an_ending_hides_the_figure_and_the_audit_looks_at_what_is_seen_last(
    ending: str, frames_before_end: int
) -> None:
    text = PREFERENCE.replace("[stimuli]", f'[stimuli]\nending = "{ending}"\nending_s = 0.5')
    made, plain = (prepare(parse_protocol(one), LIBRARY) for one in (text, PREFERENCE))
    assert {one.id for one in made.stimuli}.isdisjoint(one.id for one in plain.stimuli)
    stimulus = made.stimuli[0]
    ground = np.array(stimulus.figure.background)
    pictures = [one.astype(int) for one in render_rgb(stimulus.positions, stimulus.figure, stimulus.camera)]
    strength = [np.abs(one - ground).max() for one in pictures[-20:]]
    if ending == "cover":
        *_, last = render_frames(stimulus.positions, stimulus.figure, stimulus.camera)
        np.testing.assert_array_equal(last, plain_frame(stimulus.camera.size, stimulus.figure.background))
        assert strength[-15:] == [0] * 15
        assert min(strength[:5]) > 100
    else:
        full = np.abs(pictures[-16] - ground).max()
        assert strength[-8] == pytest.approx(full * 8 / 16, abs=12)  # half way
        assert strength[-1] == pytest.approx(full / 16, abs=6)
    reference, comparison = members(made, made.audits[0].pair)
    ends = []
    for one in (reference, comparison):
        seen = replace(one.figure, ending=(0, 0))
        at = len(one.positions) - 1 - frames_before_end
        picture = list(render_rgb(one.positions[: at + 1], seen, one.camera))[-1]
        shown = (np.abs(picture.astype(int) - ground) > 40).any(axis=2)
        columns, rows = np.flatnonzero(shown.any(axis=0)), np.flatnonzero(shown.any(axis=1))
        ends.append(((columns[0] + columns[-1] + 1) / 2, rows[-1] - rows[0] + 1))
    (x1, high1), (x2, high2) = ends
    assert made.audits[0].last.right == pytest.approx((x2 - x1) / (high1 + high2) * 2, abs=0.03)


def test_an_ending_that_the_exit_has_no_room_for_is_refused() -> None:
    text = PREFERENCE.replace("[stimuli]", '[stimuli]\nending = "fade"\nending_s = 1.5\njitter_s = 1.0')
    with pytest.raises(ProtocolError, match="an exit that is longer than jitter_s and the ending together"):
        parse_protocol(text)
