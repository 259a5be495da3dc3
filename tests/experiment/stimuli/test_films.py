"""Which films a study shows: never one film for two methods, within the lengths that the protocol allows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from toys import ToyLibrary

from study.errors import StimulusError
from study.experiment.protocol.whole import Protocol, find_protocol, load_protocol, parse_protocol
from study.experiment.stimuli.drafts import Draft, add_drafts
from study.experiment.stimuli.films import Film, alike, plan_all
from study.experiment.stimuli.points import settle
from study.experiment.stimuli.prepare import check, prepare
from study.experiment.stimuli.ways import Ways
from study.motion.library import open_library
from study.transitions.blend_length import geodesic_length
from study.transitions.blending import blend
from study.transitions.methods.makes.blends import Blended
from study.transitions.methods.makes.one_hop import Hop

TEXT = """
name = "pairs"
title = "Pairs"
seed = 52

[stimuli]
entry_s = 1.0
exit_s = 1.0

[[transitions]]
name = "walk_run"
category = "walking"
source = "walk"
destination = "run"

[[studies]]
name = "natural"
task = "preference"
reference = "geodesic"
comparison = "fixed"
"""


def chosen(protocol: Protocol, library: object, again: bool) -> object:
    """The points of the first transition, with or without a look at whether the films differ."""
    ways = Ways(protocol, library)  # type: ignore[arg-type]
    look = (lambda study, settled: alike(study, settled, ways)) if again else None
    return settle(protocol, protocol.studies[0], protocol.transitions[0], library, look)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["preference", "rating"])
def test_points_at_which_both_methods_make_one_film_are_drawn_again(kind: str) -> None:
    """Seed 52 draws points of walk and run whose geodesic blend takes ten frames, as the fixed one does."""
    text = TEXT
    if kind == "rating":
        text = TEXT.replace('"preference"', '"rating"') + '[[studies.items]]\nname = "good"\nquestion = "How good?"\n'
    protocol, library = parse_protocol(text), open_library("synthetic")
    first = chosen(protocol, library, again=False)
    assert {length.blend_frames for length in first.lengths.values()} == {10}  # type: ignore[attr-defined]
    second = chosen(protocol, library, again=True)
    assert second.tried > first.tried  # type: ignore[attr-defined]
    assert len({length.blend_frames for length in second.lengths.values()}) == 2  # type: ignore[attr-defined]
    pairs = prepare(protocol, library).pairs
    assert len({name for pair in pairs for name in pair.stimuli}) == 2


def test_given_points_at_which_both_methods_make_one_film_are_refused() -> None:
    library = open_library("synthetic")
    first = chosen(parse_protocol(TEXT), library, again=False)
    given = (
        f'points = {{ choose = "given", source_frame = {first.start_frame}, '  # type: ignore[attr-defined]
        f"destination_frame = {first.end_frame} }}"  # type: ignore[attr-defined]
    )
    protocol = parse_protocol(TEXT.replace('destination = "run"', f'destination = "run"\n{given}'))
    (problem,) = check(protocol, library)
    assert "expected two films by the methods 'geodesic' and 'fixed' of the study 'natural', found one" in problem
    with pytest.raises(StimulusError, match="both make the same blend; give other points"):
        prepare(protocol, library)


def test_a_time_warped_blend_without_a_warp_is_the_geodesic_one(toy_library: ToyLibrary) -> None:
    """Without `least_warp_frames`, too, the two films of a pair differ."""
    text = TEXT.replace('"walk"', '"slow"').replace('"run"', '"quick"').replace('"fixed"', '"timewarp"')
    for seed in range(6):
        made = prepare(parse_protocol(text.replace("seed = 52", f"seed = {seed}")), toy_library)
        assert all(len(set(pair.stimuli)) == 2 for pair in made.pairs)


def test_methods_that_always_make_one_film_are_refused(toy_library: ToyLibrary) -> None:
    text = (
        TEXT.replace('"walk"', '"still"')
        .replace('"run"', '"still"')
        .replace("[[studies]]", "[points]\nlongest_frames = 1\n\n[[studies]]")
    )
    text = text.replace('comparison = "fixed"', 'comparison = "fixed"\nfixed_frames = 1')
    (problem,) = check(parse_protocol(text), toy_library)
    assert "with one film for both methods" in problem


@pytest.mark.parametrize(("reference", "comparison"), [("cut", "geodesic"), ("fixed", "geodesic"), ("cut", "velocity")])
def test_the_limits_hold_for_the_method_whose_length_follows_from_the_points(
    toy_library: ToyLibrary, reference: str, comparison: str
) -> None:
    text = TEXT.replace('"walk"', '"slow"').replace('"run"', '"quick"')
    text = text.replace('"geodesic"', f'"{reference}"').replace('comparison = "fixed"', f'comparison = "{comparison}"')
    limits = "[points]\nshortest_frames = 14\nlongest_frames = 22\navoid_frames = 17\navoid_within_frames = 1\n"
    for seed in range(5):
        seeded = text.replace("seed = 52", f"seed = {seed}").replace("[[transitions]]", f"{limits}\n[[transitions]]")
        made = prepare(parse_protocol(seeded), toy_library)
        (length,) = [record.blend_frames for record in made.records if record.method == comparison]
        assert 14 <= length <= 22
        assert not 16 <= length <= 18
    nothing = text.replace(
        "[[transitions]]", "[points]\nshortest_frames = 59\nlongest_frames = 59\navoid_frames = 59\n\n[[transitions]]"
    )
    (problem,) = check(parse_protocol(nothing), toy_library)
    assert f"whose {comparison} blend meets the conditions" in problem


@pytest.mark.parametrize(("fps", "frames"), [(24, 8), (30, 10), (60, 20), (120, 40)])
def test_the_fixed_blend_takes_a_third_of_a_second_at_any_rate(toy_library: ToyLibrary, fps: int, frames: int) -> None:
    text = TEXT.replace('"walk"', '"slow"').replace('"run"', '"quick"').replace("seed", f"fps = {fps}\nseed", 1)
    made = prepare(parse_protocol(text), toy_library)
    (fixed,) = [record for record in made.records if record.method == "fixed"]
    assert fixed.blend_frames == frames
    own = parse_protocol(text + "fixed_frames = 7\n")
    assert own.methods_of(own.studies[0])["fixed"].in_words(fps) == "blends of 7 frames"


@pytest.mark.mocap
@pytest.mark.slow
def test_no_captured_one_hop_transition_stands_beside_itself(mocap: Path) -> None:
    """The first points of tai chi and dance have no better hop than none."""
    protocol = load_protocol(find_protocol("one_hop_vs_direct"))
    library = open_library(mocap / "cmu")
    transition = protocol.transition("tai_chi_dance")
    study, ways = protocol.study("optimal"), Ways(protocol, library)
    first = settle(protocol, study, transition, library)
    assert isinstance(ways.of(study, first, "one-hop"), Blended)
    second = settle(protocol, study, transition, library, lambda one, points: alike(one, points, ways))
    assert second.tried > first.tried
    assert isinstance(ways.of(study, second, "one-hop"), Hop)


CENTRED = TEXT.replace('"preference"\nreference = "geodesic"\ncomparison = "fixed"',
    '"same-different"\nreference = "centred"\ndifferences_frames = [-4, 0, 7]') + """
[points]
shortest_frames = 6

[[methods]]
name = "centred"
length = "geodesic"
make = "slerp"
specification = "centre"
"""  # fmt: skip


def test_centre_aligned_blends_meet_at_the_points_whatever_their_length() -> None:
    """Each film has the frames that blending about the two points gives, and the length is that of such blends."""
    protocol, library = parse_protocol(CENTRED), open_library("synthetic")
    ways = Ways(protocol, library)
    (planned,), problems = plan_all(protocol, library, ways)
    assert problems == []
    settled = planned.settled
    clips, points = (settled.source.clip, settled.destination.clip), (settled.start_frame, settled.end_frame)
    length = settled.lengths["centred"].blend_frames
    assert length == geodesic_length(*clips, *points, specification="centre").blend_frames
    drafts: dict[Film, Draft] = {}
    add_drafts(protocol, planned, drafts, ways)
    assert {film.way.frames - length for film in drafts} == {-4, 0, 7}
    for film, draft in drafts.items():
        frames = film.way.frames
        assert (film.start_frame, film.end_frame) == (points[0] - frames // 2, points[1] + frames - 1 - frames // 2)
        assert draft.blend == (30, 30 + frames)
        assert draft.clip.frames == 60 + frames
        wanted = blend(*clips, *points, frames, specification="centre").clip
        first = film.start_frame - 30
        np.testing.assert_allclose(draft.clip.rotations[:30], wanted.rotations[first : first + 30], atol=1e-12)
        arms = [settled.source.clip.skeleton.role(f"shoulder.{side}") for side in "LR"]  # feet are planted, arms not
        shown, made = (clip.rotations[:, arms] for clip in (draft.clip, wanted))
        np.testing.assert_allclose(shown, made[first : first + draft.clip.frames], atol=1e-12)


def test_with_equal_durations_both_specifications_show_the_same_moments() -> None:
    text = CENTRED.replace("exit_s = 1.0", 'exit_s = 1.0\nmatch = "duration"')
    library = open_library("synthetic")
    for text_of_one in (text, text.replace('reference = "centred"', 'reference = "geodesic"')):
        protocol = parse_protocol(text_of_one)
        (planned,), problems = plan_all(protocol, library, Ways(protocol, library))
        assert problems == []
        for showing in planned.showings:
            reference, other = showing.films
            longer = other.way.frames - reference.way.frames
            assert other.start_frame == reference.start_frame - longer // 2
            assert other.end_frame == reference.end_frame + longer - longer // 2
            assert other.frames(protocol) == reference.frames(protocol)
