"""Fixtures of the experiment's tests; the toys themselves are in `toys.py`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from study.experiment.protocol.whole import Protocol, parse_protocol

# Tests are imported by path, without packages: this makes `toys` importable, here and in the processes they start.
sys.path.insert(0, str(Path(__file__).parent))

from toys import TOY_PAIR_RATING, TOY_PROTOCOL, TOY_RATING, FakeStimuli, Toy, ToyLibrary, pairs_of


@pytest.fixture
def toy_library() -> ToyLibrary:
    return ToyLibrary(
        {"slow": Toy(0.8, 1.4), "quick": Toy(1.6, 0.9), "still": Toy(0.0, 3.0), "short": Toy(1.0, 1.0, 2.0)}
    )


@pytest.fixture
def toy_protocol() -> Protocol:
    return parse_protocol(TOY_PROTOCOL)


@pytest.fixture
def rating_protocol() -> Protocol:
    return parse_protocol(TOY_PROTOCOL + TOY_RATING)


@pytest.fixture
def pair_rating_protocol() -> Protocol:
    return parse_protocol(TOY_PROTOCOL + TOY_PAIR_RATING)


@pytest.fixture
def toy_stimuli(toy_protocol: Protocol) -> FakeStimuli:
    return FakeStimuli(pairs_of(toy_protocol))


@pytest.fixture
def jnd_protocol() -> Protocol:
    from study.experiment.protocol.whole import find_protocol, load_protocol

    return load_protocol(find_protocol("blend_length_jnd"))


@pytest.fixture
def make_stimuli() -> Callable[[Protocol], FakeStimuli]:
    """`make_stimuli(protocol)`: pairs of any protocol, with made-up ids."""
    return lambda protocol: FakeStimuli(pairs_of(protocol))


@pytest.fixture
def repository() -> Path:
    return Path(__file__).parents[2]
