"""Makes the helpers of these tests importable (tests are imported by path, without packages); serves a study."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parent / "browser")]


@pytest.fixture(scope="session")
def stimuli(tmp_path_factory):
    """The manifest of a small study whose films are noise."""
    from serving import unfilmed

    return unfilmed(tmp_path_factory.mktemp("served"))


@pytest.fixture
def responses(tmp_path):
    """An empty database."""
    from study.experiment.responses import open_responses

    with open_responses(tmp_path) as opened:
        yield opened


@pytest.fixture
def serve(stimuli, responses):
    """`serve(**settings)`: a new server on the same database (`serving.Serving`)."""
    from serving import Serving

    opened = []

    def start(root_path="", **settings):
        opened.append(Serving(stimuli, responses, root_path, **settings))
        return opened[-1]

    yield start
    for serving in opened:
        serving.client.__exit__(None, None, None)
