"""One seed, one participant: window, browser and simulation show the same trials and store the same table.

The window is scripted and the browser is a client without a screen; both front ends run as they are, each into its own
database. The protocol has every task, practice, attention checks, breaks and orders by group; two participants, so that
both groups come.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import sqlalchemy as sa
from every import every_page
from scripted import Act, ScriptedWindow, press
from serving import PROTOCOL, Person, make_host, prepared, protocol_of, unfilmed
from starlette.testclient import TestClient

from renderer.events import Key, Typed
from study.apps.cli.play import the_plan
from study.apps.player import loop
from study.apps.player.lettering import default_font
from study.apps.player.loop import play
from study.apps.player.pages import Look
from study.apps.player.store import ResponsesStore
from study.apps.server.web import make_app
from study.experiment.plan import Plan, draw_plan
from study.experiment.protocol.whole import Protocol
from study.experiment.session import advanced, answered, current, filled, open_session
from study.experiment.simulation import simulate
from study.experiment.steps import answer_keys
from study.experiment.stimuli.manifest import Manifest
from study.experiment.store.frames import ANSWER_COLUMNS, answers_frame
from study.experiment.store.responses import Responses, open_responses
from study.experiment.store.sessions import find_session
from study.experiment.store.tables import presentations, sessions
from study.tasks.registry import TASKS, task_of_trial

PEOPLE = ("sim-001", "sim-002")
READ = ("instructions", "feedback", "break", "debrief")
# What depends on who answers; all else belongs to the trials.
OF_THE_ANSWER = ("answer", "missed", "correct", "chose_a", "confidence", "response_s")
MARKS = ("simulated", "answered_at")
AGE = "33"

TEXT = every_page()
"""Every task, kind of answer and layout; practice, attention checks, breaks, orders by group."""

Read = list[tuple[str, str]]


def script(protocol: Protocol, plan: Plan) -> Iterator[Act]:
    """A participant in the window who always gives the first of the legal answers, an act for each page."""
    state = open_session(protocol, plan)
    while (step := current(state)).kind != "done":
        if step.kind == "consent":
            yield press("1")
        elif step.kind == "form":
            if not step.study:
                yield Act((*(Typed(digit, 0.1) for digit in AGE), Key("enter", 0.2)))
                yield from [Act()] * len(AGE)  # the page is drawn anew with each digit
            yield press("enter")
            state, _ = filled(state, {} if step.study else {"age": AGE})
            continue
        elif step.kind == "answer":
            key = answer_keys(protocol, step.legal)[step.legal[0]]
            if step.sliders:
                keys = [pressed for _ in range(step.sliders) for pressed in (key, "tab")]
                moves = [Key(pressed, 0.3) for pressed in (keys if step.sliders > 1 else [key])]
                yield Act((*moves, Key("space", 0.5)))
                yield from [Act()] * len(moves)  # the page is drawn anew as sliders move
            else:
                yield press(key, 0.5)
            state, _ = answered(state, " ".join([step.legal[0]] * max(step.sliders, 1)), 0.5)
            continue
        elif step.kind in READ:
            yield press("space")
        state = advanced(state)
    yield press("space")


def in_the_window(
    protocol: Protocol, text: str, responses: Responses, monkeypatch: pytest.MonkeyPatch
) -> dict[str, Read]:
    """Both participants in a scripted window; what each of them read."""
    stimuli = prepared(text)
    read: dict[str, Read] = {}
    page_of = loop.screens.reading_page
    for name in PEOPLE:
        plan = the_plan(responses, protocol, stimuli, name, None, None)  # the second joins the other group
        own = read.setdefault(name, [])

        def noted(protocol: Protocol, step: Any, progress: Any, own: Read = own) -> Any:
            if progress != (0, 1):  # so that it is not the check of all pages beforehand
                own.append((step.kind, step.text))
            return page_of(protocol, step, progress)

        monkeypatch.setattr(loop.screens, "reading_page", noted)
        store = ResponsesStore(responses, protocol, plan, stimuli.library, stimuli.synthetic)
        window = ScriptedWindow(script(protocol, plan))
        look = Look((222, 223, 225), (default_font(),))
        assert play(window, open_session(protocol, plan), stimuli.stimulus, store, look).end == "finished"
    return read


def in_the_browser(manifest: Manifest, text: str, responses: Responses) -> dict[str, Read]:
    """The same participants through the server, by links that name them."""
    read: dict[str, Read] = {}
    app = make_app(make_host(manifest, responses, text, parameters=("participant",)))
    with TestClient(app) as client:
        for name in PEOPLE:
            fresh = TestClient(app)
            fresh.portal = client.portal
            person = Person(fresh, f"page-{name}")
            view = person.begin(parameters={"participant": name})
            own = read.setdefault(name, [])
            while view["kind"] != "done":
                if view["kind"] in READ:
                    own.append((view["kind"], view["text"]))
                view = person.step(view)
    return read


def shown(responses: Responses) -> list[tuple[Any, ...]]:
    """Every stimulus that was presented, in order."""
    columns = (sessions.c.participant, presentations.c.trial, presentations.c.attempt, presentations.c.place)
    query = sa.select(*columns, presentations.c.stimulus).join(sessions, presentations.c.session_id == sessions.c.id)
    with responses.engine.connect() as connection:
        rows = connection.execute(query.order_by(presentations.c.session_id, presentations.c.id)).all()
    return [tuple(row) for row in rows]


def table(responses: Responses) -> pd.DataFrame:
    return answers_frame(responses, all_attempts=True, roles=("trial", "practice", "check"))


@pytest.mark.parametrize("seed", [5, 2004])
def test_window_browser_and_simulation_have_the_same_trials(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    text = TEXT.replace("seed = 5", f"seed = {seed}")
    protocol = protocol_of(text)
    manifest = unfilmed(tmp_path / "served", text)
    with (
        open_responses(tmp_path / "window.sqlite") as window,
        open_responses(tmp_path / "browser.sqlite") as browser,
        open_responses(tmp_path / "simulated.sqlite") as simulated,
    ):
        read_in_window = in_the_window(protocol, text, window, monkeypatch)
        read_in_browser = in_the_browser(manifest, text, browser)
        simulate(protocol, manifest, simulated, len(PEOPLE))
        places = {"window": window, "browser": browser, "simulation": simulated}
        records = {where: [find_session(place, name) for name in PEOPLE] for where, place in places.items()}
        tables = {where: table(place) for where, place in places.items()}
        stimuli = {where: shown(place) for where, place in places.items()}

    # The stored plans, trial by trial: order, stimuli, which comes first, block, group.
    plans = {where: [(one.plan.group, one.plan.trials) for one in found if one] for where, found in records.items()}
    assert plans["window"] == plans["browser"] == plans["simulation"]
    assert [group for group, _ in plans["window"]] == [0, 1]
    assert {task_of_trial(trial).name for _, trials in plans["window"] for trial in trials} == set(TASKS)
    # A pair is rated after both its films, in the order of the group.
    compared = [trial for _, trials in plans["window"] for trial in trials if trial.study == "each_pair-rating"]
    assert [trial.a_first for trial in compared] == [True, False]
    assert all(len(trial.stimuli) == 2 for trial in compared)

    # The tables of answers: the same columns of the same types, the same rows, but for answers and marks.
    assert {tuple(one.columns) for one in tables.values()} == {ANSWER_COLUMNS}
    trials = {where: one.drop(columns=[*OF_THE_ANSWER, *MARKS]) for where, one in tables.items()}
    pd.testing.assert_frame_equal(trials["window"], trials["browser"])
    pd.testing.assert_frame_equal(trials["window"], trials["simulation"])
    assert set(tables["window"].role) == {"trial", "practice", "check"}
    # Both always gave the first legal answer.
    answers = {where: tables[where][[*OF_THE_ANSWER[:5]]] for where in ("window", "browser")}
    pd.testing.assert_frame_equal(answers["window"], answers["browser"])

    asked = tables["simulation"].dropna(subset=["confidence"])
    assert set(asked.study) == {"each_same-different", "each_preference"}
    assert not asked.missed.any()
    assert (asked.confidence <= asked.study.map({"each_same-different": 3, "each_preference": 4})).all()

    # What was really put on the screen, and what was read between the trials.
    assert stimuli["window"] == stimuli["browser"]
    assert len(stimuli["window"]) > 20
    assert read_in_window == read_in_browser
    assert {kind for kind, _ in read_in_window[PEOPLE[0]]} == set(READ)

    # Marks.
    assert not tables["window"].simulated.any()
    assert not tables["browser"].simulated.any()
    assert tables["simulation"].simulated.all()
    assert stimuli["simulation"] == []


def test_another_participant_or_another_seed_has_other_trials() -> None:
    """So that the test above could fail."""
    protocol, other = protocol_of(), protocol_of(PROTOCOL.replace("seed = 5", "seed = 6"))
    pairs = prepared().pairs
    own = draw_plan(protocol, pairs, "sim-001").trials
    assert own != draw_plan(protocol, pairs, "sim-002").trials
    assert own != draw_plan(other, pairs, "sim-001").trials
