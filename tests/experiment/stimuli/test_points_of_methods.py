"""Methods with points of their own (cuts where a metric is least), and time-warped blends, on toy motions."""

from __future__ import annotations

import pytest
from toys import ToyLibrary

from study.errors import ProtocolError, StimulusError
from study.experiment.protocol.whole import parse_protocol
from study.experiment.stimuli.prepare import check, prepare
from study.transitions.timewarp import warp_length

HEAD = """
name = "methods"
title = "Methods"
seed = 3
[stimuli]
entry_s = 0.5
exit_s = 0.5
clean_feet = false
[[transitions]]
name = "slow_quick"
category = "walking"
source = "slow"
destination = "quick"
"""

WARPED = """
[[studies]]
name = "four"
task = "preference"
reference = "geodesic"
comparison = "timewarp"
question = "Which?"
points = { longest_frames = 35, least_warp_frames = 4 }
"""

CUTS = """
[[studies]]
name = "cuts"
task = "rating"
reference = "cut-lee2002"
comparison = "cut-pointcloud"
question = "How?"
[[studies.items]]
name = "good"
question = "How good?"
"""


def test_a_time_warped_blend_stands_beside_the_geodesic_one(toy_library: ToyLibrary) -> None:
    prepared = prepare(parse_protocol(HEAD + WARPED), toy_library)
    (pair,) = prepared.pairs
    plain, warped = (prepared.stimulus(name).record for name in pair.stimuli)
    assert (plain.source.frame, plain.destination.frame) == (warped.source.frame, warped.destination.frame)
    own = warp_length(
        toy_library.clip("slow", fps=30.0),
        toy_library.clip("quick", fps=30.0),
        warped.source.frame,
        warped.destination.frame,
    )
    assert abs(own.source_frames - own.destination_frames) >= 4
    assert warped.blend_frames == max(own.source_frames, own.destination_frames)
    note = f"time-warped blend of {own.source_frames} source and {own.destination_frames} destination frames"
    assert any(note in line for line in warped.notes)
    assert warped.frames == 30 + warped.blend_frames


def test_a_warp_that_no_point_has_is_explained(toy_library: ToyLibrary) -> None:
    protocol = parse_protocol(HEAD.replace('"quick"', '"slow"') + WARPED.replace("= 4", "= 60"))
    (problem,) = check(protocol, toy_library)
    assert "warped by less than 60 frames" in problem


def test_each_cut_stands_at_its_own_metrics_least(toy_library: ToyLibrary) -> None:
    prepared = prepare(parse_protocol(HEAD + CUTS), toy_library)
    points = {pair.methods[0]: prepared.stimulus(pair.stimuli[0]).record for pair in prepared.pairs}
    assert set(points) == {"cut-lee2002", "cut-pointcloud"}
    for record in points.values():
        assert (record.blend_frames, record.frames, record.blend_start) == (0, 30, 15)
    assert points["cut-lee2002"].source.frame != points["cut-pointcloud"].source.frame or (
        points["cut-lee2002"].destination.frame != points["cut-pointcloud"].destination.frame
    )


def test_cuts_at_one_place_are_refused(toy_library: ToyLibrary) -> None:
    still = HEAD.replace('"slow"', '"still"').replace('"quick"', '"still"')
    same = still + CUTS.replace("cut-pointcloud", "cut-wang2003")
    with pytest.raises(StimulusError, match="to cut at different points, found both from frame"):
        prepare(parse_protocol(same), toy_library)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('comparison = "cut-pointcloud"', 'comparison = "geodesic"'), "either cuts where a metric is least or"),
        (('question = "How?"', 'question = "How?"\npoints = { choose = "given", source_frame = 3 }'), "finds its own"),
        (
            (
                'task = "rating"\nreference = "cut-lee2002"\ncomparison = "cut-pointcloud"',
                'task = "same-different"\nreference = "timewarp"\ndifferences_frames = [0, 5]',
            ),
            "one blend length",
        ),
    ],
)
def test_what_does_not_go_together_is_refused(change: tuple[str, ...], words: str) -> None:
    text = HEAD + CUTS.replace(*change)
    if "same-different" in text:
        text = text[: text.index("[[studies.items]]")]
    with pytest.raises(ProtocolError, match=words):
        parse_protocol(text)
