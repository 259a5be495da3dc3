"""A small study whose stimuli last a third of a second, its stimuli, and a store that keeps things in lists."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from playing import Playing

from study.experiment.plan import Plan, draw_plan
from study.experiment.protocol.whole import Protocol, parse_protocol
from study.experiment.stimuli.prepare import prepare
from study.experiment.stimuli.stimulus import StimulusSet
from study.experiment.store.answers import Presentation
from study.motion.library import open_library
from study.tasks.answer import Answer
from study.tasks.trial import Trial

SMALL = """\
name = "small"
title = "A small study"
fps = 30
seed = 3

[stimuli]
width = 160
height = 120
entry_s = 0.1
exit_s = 0.1

[timing]
gap_s = 0.1
answer_s = 2.0
pause_s = 0.1

[points]
shortest_frames = 4
longest_frames = 12

[texts]
title = "A small study"
welcome = "Welcome."
debrief = "It was about blends."

[[transitions]]
name = "steps"
category = "walking"
source = "walk"
destination = "walk_fast"

[[studies]]
name = "jnd"
task = "same-different"
differences_frames = [-3, 0, 4]
order = "both"
question = "Same or different?"
instructions = "Some pairs are the same."
example = false
"""

RATING = """
[[studies]]
name = "rating"
task = "rating"
instructions = ""
reference = "geodesic"
question = "How was it?"
scale_points = 11

[[studies.items]]
name = "natural"
question = "How natural was it?"
low = "not at all"
high = "very"

[[studies.items]]
name = "smooth"
question = "How smooth was it?"
"""

COMPARED = """
[[studies]]
name = "compared"
task = "rating"
instructions = ""
show = "pair"
reference = "geodesic"
comparison = "cut"

[[studies.items]]
name = "better"
question = "Compared with the first film, the second one was:"
low = "much worse"
middle = "the same"
high = "much better"
"""

ABOUT_YOU = """
[consent]
text = "We store your answers."

[[form]]
name = "age"
label = "How old are you?"
kind = "number"
least = 18
most = 99
required = true

[[form]]
name = "vision"
label = "Is your vision normal?"
kind = "choice"
choices = ["yes", "with glasses", "no"]

[[form]]
name = "remarks"
label = "Anything else?"
"""


@dataclass
class ListStore:
    """What a player stored, in order; every entry is a kind and a value."""

    log: list[tuple[str, Any]] = field(default_factory=list)

    def begin(self) -> None:
        self.log.append(("begin", None))

    def answer(self, trial: Trial, answer: Answer, shown: Sequence[Presentation]) -> None:
        assert trial.trial == answer.trial
        self.log.append(("answer", answer))
        self.log.extend(("shown", one) for one in shown)

    def form(self, values: Mapping[str, str], study: str) -> None:
        self.log.append((f"form/{study}" if study else "form", dict(values)))

    def event(self, kind: str, detail: Mapping[str, Any] | None = None) -> None:
        self.log.append((kind, detail))

    def all(self, kind: str) -> list[Any]:
        return [value for name, value in self.log if name == kind]


@dataclass(frozen=True)
class Small:
    """A protocol with its stimuli and one participant's plan."""

    protocol: Protocol
    stimuli: StimulusSet
    plan: Plan


@pytest.fixture(scope="session")
def make_small() -> Callable[..., Small]:
    """`make_small(more)`: the small study with more TOML at its end, or with (old, new) pieces replaced."""
    known: dict[str, Small] = {}

    def make(more: str = "", *changes: tuple[str, str]) -> Small:
        text = SMALL + more
        for old, new in changes:
            assert old in text, old
            text = text.replace(old, new)
        if text not in known:
            protocol = parse_protocol(text)
            stimuli = prepare(protocol, open_library("synthetic"))
            known[text] = Small(protocol, stimuli, draw_plan(protocol, stimuli.pairs, "p1"))
        return known[text]

    return make


@pytest.fixture
def store() -> ListStore:
    return ListStore()


@pytest.fixture(scope="session")
def texts() -> dict[str, str]:
    """The pieces of TOML that tests put together, by name."""
    return {"small": SMALL, "rating": RATING, "compared": COMPARED, "about_you": ABOUT_YOU}


@pytest.fixture
def start(virtual_display: str) -> Iterator[Callable[..., Playing]]:
    """`start(arguments ...)`: a `segue play` on the virtual display, which never outlives its test."""
    started: list[Playing] = []

    def begin(*arguments: object, display: str = virtual_display) -> Playing:
        started.append(Playing(display, *arguments))
        return started[-1]

    yield begin
    for playing in started:
        playing.kill()


@pytest.fixture
def protocol_file(tmp_path: Path, texts: Any) -> Path:
    file = tmp_path / "small.toml"
    file.write_text(texts["small"] + texts["rating"])
    return file
