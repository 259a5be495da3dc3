"""One-hop stimuli: beside a direct transition they show the same span, the same start and the same destination."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from study.errors import ProtocolError, StimulusError
from study.experiment.protocol.whole import Protocol, find_protocol, load_protocol, parse_protocol
from study.experiment.stimuli.films import alike
from study.experiment.stimuli.points import settle
from study.experiment.stimuli.prepare import check, prepare
from study.experiment.stimuli.ways import Ways
from study.motion.library import Library, open_library
from study.transitions.methods.makes.one_hop import Hop

TEXT = """
name = "hops"
title = "Hops"
fps = 20
seed = 4

[stimuli]
entry_s = 0.5
exit_s = 0.5

[[transitions]]
name = "dance_box"
category = "dance"
source = "dance"
destination = "box"

[[transitions]]
name = "box_turns"
category = "dance"
source = "box"
destination = "dance_turns"

[[studies]]
name = "hop"
task = "preference"
reference = "one-hop"
comparison = "fixed"
fixed_frames = 10
question = "Which?"

[studies.one_hop]
stay_s = 0.6
conditions = 5
"""


@pytest.fixture(scope="module")
def library() -> Library:
    return open_library("synthetic")


@pytest.fixture(scope="module")
def protocol() -> Protocol:
    return parse_protocol(TEXT)


def test_both_films_of_a_pair_show_the_same_span(protocol: Protocol, library: Library) -> None:
    made = prepare(protocol, library)
    assert len(made.pairs) == 2
    for pair in made.pairs:
        hop, direct = made.stimulus(pair.stimuli[0]), made.stimulus(pair.stimuli[1])
        assert (hop.record.method, direct.record.method) == ("one-hop", "fixed")
        assert hop.record.frames == direct.record.frames
        assert np.allclose(hop.positions[:10], direct.positions[:10], atol=2e-4)  # entry
        # The destination is as far on at the end of both, wherever it stands.
        ends = [np.linalg.norm(part.positions[-1] - part.positions[-1, :1], axis=-1) for part in (hop, direct)]
        assert np.allclose(*ends, atol=0.02)
        assert "hop " in hop.record.notes[0]
        assert hop.record.blend_stop - hop.record.blend_start in range(10, 20 + 2 * 12 + 1)


def test_the_hop_costs_no_more_than_direct_and_keeps_to_its_stays(protocol: Protocol, library: Library) -> None:
    (study,) = protocol.studies
    ways = Ways(protocol, library)
    for transition in protocol.transitions:
        settled = settle(protocol, study, transition, library)
        hop = ways.of(study, settled, "one-hop")
        assert isinstance(hop, Hop)
        assert hop.cost <= hop.direct_cost
        assert 0 <= hop.stay_source <= 12
        assert 0 <= hop.stay_hop <= 12
        assert hop.weight > 0
        made = hop.made(ways.place(study, settled))
        assert made.blend_stop == settled.start_frame + hop.frames
        before, after = made.clip.rotations[:-1], made.clip.rotations[1:]
        steps = 2 * np.arccos(np.clip(np.abs(np.sum(before * after, axis=-1)), 0, 1))
        assert steps.max() < 1.2  # radians a frame at 20 fps: nothing jumps


def test_without_stays_there_are_none(library: Library) -> None:
    protocol = parse_protocol(TEXT.replace("stay_s = 0.6", "stay_s = 0.0"))
    (study,) = protocol.studies
    ways = Ways(protocol, library)
    # At points where the hop is worth it: where it isn't, the way is the direct blend.
    settled = settle(protocol, study, protocol.transitions[0], library, lambda one, at: alike(one, at, ways))
    hop = ways.of(study, settled, "one-hop")
    assert isinstance(hop, Hop)
    assert (hop.stay_source, hop.stay_hop) == (0, 0)


def test_refusals(library: Library) -> None:
    wrong = TEXT.replace('comparison = "fixed"', "differences_frames = [0, 5]").replace(
        '"preference"', '"same-different"'
    )
    with pytest.raises(ProtocolError, match=r"reference with one blend length .* found 'one-hop'"):
        parse_protocol(wrong)
    with pytest.raises(ProtocolError, match="hopps"):
        parse_protocol(TEXT.replace("conditions = 5", 'hopps = ["dance"]'))
    missing = parse_protocol(TEXT.replace("conditions = 5", 'hops = ["waltz"]'))
    with pytest.raises(StimulusError, match=r"study 'hop', hop 'waltz': .*waltz"):
        prepare(missing, library)
    assert "waltz" in check(missing, library)[0]


def test_the_published_protocol_has_fifteen_transitions_at_60_fps() -> None:
    protocol = load_protocol(find_protocol("one_hop_vs_direct"))
    assert protocol.fps == 60
    assert [len(protocol.transitions_of(study)) for study in protocol.studies] == [15, 15]
    assert [study.one_hop.stay_s for study in protocol.studies] == [1.0, 0.0]
    assert {study.fixed_frames for study in protocol.studies} == {30}


@pytest.mark.mocap
def test_the_published_protocol_can_be_shown_on_captured_dance(mocap: Path) -> None:
    assert check(load_protocol(find_protocol("one_hop_vs_direct")), open_library(mocap / "cmu")) == []
