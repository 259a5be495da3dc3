"""Every procedure answers what the house asks of one: a new member without an example here fails."""

from __future__ import annotations

from dataclasses import asdict, fields
from functools import partial
from pathlib import Path

import pytest
from toys import QUEST, STAIRCASE, TOY_PROTOCOL, FakeStimuli, pairs_of, with_staircases

from study.experiment.observers import person, respond
from study.experiment.plan import draw_plan, plan_from_json
from study.experiment.procedures.procedure import Settings
from study.experiment.procedures.registry import PROCEDURES
from study.experiment.protocol.errors import KeyMismatchError
from study.experiment.protocol.studies import procedure_of
from study.experiment.protocol.whole import parse_protocol
from study.experiment.session import open_session, walk
from study.experiment.simulation import simulate
from study.experiment.store.responses import open_responses
from study.tasks.observer import default_observer

EXAMPLES = {"constant": TOY_PROTOCOL, "staircase": with_staircases(), "quest-plus": with_staircases(table=QUEST)}
"""A protocol whose study `jnd` is run by each procedure."""


def test_every_procedure_has_an_example() -> None:
    assert set(EXAMPLES) == set(PROCEDURES)
    assert "[studies.procedure]" in STAIRCASE


@pytest.mark.parametrize("name", PROCEDURES)
def test_a_procedure_explains_itself(name: str, repository: Path) -> None:
    member = PROCEDURES[name]
    assert issubclass(member, Settings)
    assert member.name == name
    assert member.title
    assert all(len(one.metadata["words"].split()) > 3 for one in fields(member))
    pages = {page: (repository / "docs" / f"{page}.md").read_text() for page in ("protocols", "protocol_keys")}
    explained = "".join(pages.values())
    assert f"`{name}`" in explained or f'`name = "{name}"`' in explained
    assert all(f"`{one.name}`" in pages["protocol_keys"] for one in fields(member))
    assert "## Add a procedure" in (repository / "docs" / "contributing.md").read_text()


@pytest.mark.parametrize("name", PROCEDURES)
def test_a_procedure_runs_a_session(name: str) -> None:
    protocol = parse_protocol(EXAMPLES[name])
    study = protocol.study("jnd")
    settings = study.procedure
    assert settings.name == name
    assert procedure_of({"name": name, **asdict(settings)}) == settings
    with pytest.raises(KeyMismatchError, match="unknown key"):
        procedure_of({"name": name, **asdict(settings), "nothing_of_the_kind": 1})
    pairs = pairs_of(protocol)
    plan = draw_plan(protocol, pairs, "p01")
    assert plan_from_json(plan.to_json()) == plan
    who = person(default_observer(4.0, 4.0), "p01", 1)
    given = list(walk(open_session(protocol, plan), partial(respond, who)))
    own = [trial for trial, _ in given if trial.study == "jnd"]
    assert protocol.fewest_trials_of(study) <= len(own) <= protocol.trials_of(study)
    assert {trial.difference_frames for trial in own} <= set(study.differences_frames)
    answers = [answer for _, answer in given]
    for place in range(0, len(given), 3):
        assert list(walk(open_session(protocol, plan, answers[:place]), partial(respond, who))) == given[place:]
    with open_responses("sqlite://") as responses:
        assert simulate(protocol, FakeStimuli(pairs), responses, 2).answers > 2 * protocol.fewest_trials_of(study)
