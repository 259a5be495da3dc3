"""A protocol's own methods: points, length and make with their settings, beside those of the papers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from toys import TOY_PROTOCOL, ToyLibrary

from study.errors import ProtocolError, StimulusError
from study.experiment.observers import knowing
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.stimuli.outlook import look_ahead
from study.experiment.stimuli.prepare import check, prepare
from study.experiment.stimuli.stimulus import Stimulus
from study.models.choice import preference_probability
from study.tasks.observer import default_observer
from study.transitions.methods.registry import METHODS

TEXT = """
name = "own"
title = "Own methods"
seed = 3

[stimuli]
entry_s = 0.5
exit_s = 0.5

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
fixed_frames = 10
question = "Which?"

[[methods]]
name = "ours"
"""


def own(method: str, study: str = "") -> str:
    """The protocol with a method, and with other keys of the study."""
    return TEXT.replace('question = "Which?"', f'question = "Which?"\n{study}') + method


def both(text: str, library: ToyLibrary) -> tuple[Stimulus, Stimulus]:
    """The two stimuli of the only pair."""
    made = prepare(parse_protocol(text), library)
    (pair,) = made.pairs
    a, b = pair.stimuli
    return made.stimulus(a), made.stimulus(b)


def method_of(text: str) -> tuple[Protocol, str]:
    """A protocol and what a report calls its first method."""
    protocol = parse_protocol(text)
    (study,) = protocol.studies
    return protocol, protocol.methods_of(study)["ours"].in_words(protocol.fps)


def test_two_makes_of_one_length_stand_beside_each_other(toy_library: ToyLibrary) -> None:
    """A sigmoid blend of ten frames against a linear one: same points, same length, different frames."""
    method = 'make = "slerp"\nlength = "fixed"\nweight = "sigmoid"\nclean_feet = false\n'
    text = own(method).replace("exit_s = 0.5", "exit_s = 0.5\nclean_feet = false")
    ours, theirs = both(text, toy_library)
    assert (ours.record.method, theirs.record.method) == ("ours", "fixed")
    assert ours.record.source == theirs.record.source
    assert (ours.record.blend_frames, theirs.record.blend_frames) == (10, 10)
    assert ours.id != theirs.id
    assert np.array_equal(ours.positions[:15], theirs.positions[:15])
    # By symmetry the two ramps cross in the middle of the blend, x x (3 - 2 x) at 5/11 and 6/11.
    apart = np.linalg.norm(ours.positions - theirs.positions, axis=-1).max(axis=1)
    assert apart[15:25].max() > 0.005
    assert apart[15:25].argmax() not in (4, 5)
    assert not look_ahead(parse_protocol(text), toy_library).notes


def test_settings_of_a_method_come_before_those_of_study_and_stimuli(toy_library: ToyLibrary) -> None:
    ours, theirs = both(own('make = "slerp"\nlength = "fixed"\nfixed_frames = 14\n'), toy_library)
    assert (ours.record.optimal_frames, theirs.record.optimal_frames) == (14, 10)
    ours, theirs = both(own('make = "slerp"\nlength = "geodesic"\n'), toy_library)
    protocol = parse_protocol(own('make = "slerp"\nlength = "fixed"\n').replace("[[tra", "[stimuli.colours]\n[[tra", 1))
    method = protocol.methods_of(protocol.studies[0])["ours"]
    assert method.make == METHODS["fixed"].make
    assert method.length == METHODS["fixed"].with_settings({"fixed_frames": 10}).length


def test_a_method_that_says_what_a_built_in_one_says_makes_its_film(toy_library: ToyLibrary) -> None:
    """The study is refused: both films are one."""
    (problem,) = check(parse_protocol(own('make = "slerp"\nlength = "fixed"\n')), toy_library)
    assert "with one film for both methods" in problem
    text = own('make = "slerp"\nlength = "geodesic"\n')
    named = text.replace('"ours"', '"geodesic"', 1).split("[[methods]]")[0]
    assert [one.id for one in both(text, toy_library)] == [one.id for one in both(named, toy_library)]


def test_a_blend_can_stand_where_a_metric_is_least(toy_library: ToyLibrary) -> None:
    study = 'reference = "ours"\ncomparison = "cut-wang2003"'
    blend = 'make = "slerp"\nlength = "fixed"\npoints = "least-cost"\nmetric = "wang2003"\n'
    text = own(blend).replace('reference = "ours"\ncomparison = "fixed"', study)
    ours, theirs = both(text, toy_library)
    assert (ours.record.blend_frames, theirs.record.blend_frames) == (10, 0)
    # The same pair of frames, at which the cut goes over at once.
    assert ours.record.source.frame >= 15
    assert ours.record.destination.frame + 15 < ours.record.destination.frames + 1
    with pytest.raises(ProtocolError, match="either cuts where a metric is least or methods at common points"):
        parse_protocol(own(blend))


def test_a_report_calls_methods_by_their_parts() -> None:
    _, words = method_of(own('make = "slerp"\nlength = "fixed"\nfixed_frames = 7\n'))
    assert words == "blends of 7 frames"
    _, words = method_of(own('make = "timewarp"\nlength = "timewarp"\n'))
    assert words == "time-warped blends (2004)"


def test_simulated_observers_find_it_as_natural_as_it_says() -> None:
    protocol = parse_protocol(own('make = "slerp"\nlength = "fixed"\nutility = 2.5\n'))
    observer = knowing(default_observer(), protocol)
    assert observer.preference.utility == {**default_observer().preference.utility, "ours": 2.5}
    # Log-odds of 2.5 over a fixed blend, at an even order bias: 1 / (1 + exp(-2.5)) is 0.924.
    unbiased = replace(observer.preference, order_bias=0.0, lapse=0.0)
    assert preference_probability(unbiased, *protocol.studies[0].methods) == pytest.approx(1 / (1 + np.exp(-2.5)))
    assert knowing(default_observer(), parse_protocol(TOY_PROTOCOL)) == default_observer()


@pytest.mark.parametrize(
    ("method", "words"),
    [
        ('make = "slurp"\nlength = "fixed"\n', r"methods\[0\].make: expected 'slerp' or .* did you mean 'slerp'\?"),
        (
            'make = "slerp"\n',
            r"methods\[0\].length: expected 'fixed' or .*'velocity' with the make 'slerp', found none",
        ),
        (
            'make = "cut"\nlength = "fixed"\n',
            r"methods\[0\].length: expected no length with the make 'cut', found 'fix",
        ),
        ('make = "slerp"\nlength = "timewarp"\n', r"expected 'fixed' or 'geodesic' or 'velocity' with the make"),
        ('make = "slerp"\nlength = "fixd"\n', r"methods\[0\].length: .*did you mean 'fixed'\?"),
        (
            'make = "cut"\npoints = "somewhere"\n',
            r"methods\[0\].points: expected 'shared' or 'least-cost', found 'some",
        ),
        (
            'make = "cut"\nweight = "sigmoid"\n',
            r"methods\[0\].weight: expected settings of its parts \(shared, cut\), which are none, found this",
        ),
        (
            'make = "slerp"\nlength = "geodesic"\nfixed_frames = 7\n',
            r"methods\[0\].fixed_frames: expected settings of its parts \(shared, geodesic, slerp\), which are",
        ),
        (
            'make = "slerp"\nlength = "fixed"\nfixed_frames = 0\n',
            r"methods\[0\].fixed_frames: expected at least 1 in fr",
        ),
        ('make = "slerp"\nlength = "fixed"\nweigth = "sigmoid"\n', r"weigth: unknown key; did you mean 'weight'\?"),
        ('make = "slerp"\nlength = "fixed"\nweight = "cubic"\n', r"weight: expected 'linear' or 'sigmoid', found 'cu"),
        ('make = "slerp"\nlength = "fixed"\n[[methods]]\nname = "ours"\nmake = "cut"\n', "'ours' twice; rename one"),
        ('make = "cut"\n[[methods]]\nname = "velocity"\nmake = "cut"\n', "found 'velocity', which is built in"),
    ],
)
def test_what_is_no_method_is_refused(method: str, words: str) -> None:
    with pytest.raises(ProtocolError, match=words):
        parse_protocol(own(method))


@pytest.mark.parametrize("key", ["reference", "comparison"])
def test_an_unknown_method_is_refused_with_the_nearest_one(key: str) -> None:
    text = own('make = "cut"\n').replace(f'{key} = "{"ours" if key == "reference" else "fixed"}"', f'{key} = "our"')
    with pytest.raises(
        ProtocolError, match=rf"studies\[0\].{key}: expected names of methods, found 'our'; did you mean"
    ):
        parse_protocol(text)


def test_a_same_different_study_needs_a_blend_that_can_be_lengthened(toy_library: ToyLibrary) -> None:
    study = 'task = "same-different"\nreference = "ours"\ndifferences_frames = [-2, 0, 4]'
    old = 'task = "preference"\nreference = "ours"\ncomparison = "fixed"'
    with pytest.raises(ProtocolError, match=r"expected a reference with one blend length .* found 'ours'"):
        parse_protocol(own('make = "cut"\n').replace(old, study))
    text = own('make = "slerp"\nlength = "fixed"\nweight = "sigmoid"\n').replace(old, study)
    made = prepare(parse_protocol(text), toy_library)
    assert [made.stimulus(pair.stimuli[1]).record.blend_frames for pair in made.pairs] == [8, 10, 14]
    assert {made.stimulus(pair.stimuli[1]).record.optimal_frames for pair in made.pairs} == {10}


def test_one_hop_with_stays_of_its_own() -> None:
    text = own('make = "one-hop"\nlength = "fixed"\nstay_s = 0.2\nhops = ["still"]\nhop_weight = 0.001\n')
    protocol = parse_protocol(text.replace("fixed_frames = 10", "fixed_frames = 10\none_hop = { stay_s = 2.0 }"))
    make = protocol.methods_of(protocol.studies[0])["ours"].make
    assert {key: getattr(make, key) for key in make.setting_names()} == {
        "weight": "linear",
        "clean_feet": True,
        "hops": ("still",),
        "stay_s": 0.2,
        "hop_weight": 0.001,
        "weight_times": 1.0,
        "conditions": 100,
    }


def test_a_method_of_the_study_that_cannot_be_made_is_refused_by_name(toy_library: ToyLibrary) -> None:
    text = own('make = "one-hop"\nlength = "fixed"\nhops = ["waltz"]\nhop_weight = 0.001\n')
    with pytest.raises(StimulusError, match=r"study 'natural', hop 'waltz': .*waltz"):
        prepare(parse_protocol(text), toy_library)
