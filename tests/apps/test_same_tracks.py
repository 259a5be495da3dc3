"""Staircases and QUEST+ in window, browser and simulation: the same responses lead to the same trials, stopped or not.

The window is scripted and the browser is a client without a screen. Each is stopped after some responses (an error in
the window's store, a server that is started again, a walk that is left) and taken up from its database.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd
import pytest
from every import BESIDE, HEAD, all_tracks, track
from scripted import Act, ScriptedWindow, press
from serving import Person, make_host, prepared, protocol_of, unfilmed
from starlette.testclient import TestClient

from study.apps.cli.play import the_plan
from study.apps.player.lettering import default_font
from study.apps.player.loop import play
from study.apps.player.pages import Look
from study.apps.player.store import ResponsesStore
from study.apps.server.web import make_app
from study.experiment.plan import Plan, draw_plan
from study.experiment.protocol.whole import Protocol
from study.experiment.session import advanced, answered, current, open_session, walk
from study.experiment.steps import Step, answer_keys
from study.experiment.stimuli.manifest import Manifest
from study.experiment.store.answers import Presentation, record_answer, stored_answers
from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import Responses, open_responses
from study.experiment.store.sessions import begin_session, find_session
from study.tasks.answer import Answer
from study.tasks.trial import Trial

NAME = "p01"
STOPS = (3, 50)
"""After so many responses, in all, a session is stopped."""

TEXT = HEAD + "".join(track(*names, most_trials=12) for names in all_tracks()) + BESIDE
"""Each procedure that chooses trials, with each task that takes it, and one study more."""


def chosen(trial: int, legal: Sequence[str]) -> str:
    """A response that depends on the trial's number alone."""
    return legal[(trial // 4 + 1) % 2]


def script(protocol: Protocol, plan: Plan, answers: Sequence[Answer]) -> Iterator[Act]:
    """A participant in the window, from where the answers left the session."""
    state = open_session(protocol, plan, answers)
    while (step := current(state)).kind != "done":
        if step.kind == "answer":
            value = chosen(step.trial, step.legal)
            yield press(answer_keys(protocol, step.legal)[value], 0.5)
            state, _ = answered(state, value, 0.5)
            continue
        if step.kind in ("instructions", "feedback", "break", "debrief"):
            yield press("space")
        state = advanced(state)
    yield press("space")


class Stopping(ResponsesStore):
    """A store that is lost as soon as it has so many answers."""

    left: float = float("inf")

    def answer(self, trial: Trial, answer: Answer, shown: Sequence[Presentation]) -> None:
        """Commit an answer, and fail where it is the last one."""
        super().answer(trial, answer, shown)
        self.left -= 1
        if self.left <= 0:
            raise KeyboardInterrupt


def in_the_window(protocol: Protocol, responses: Responses) -> None:
    stimuli = prepared(TEXT)
    plan = the_plan(responses, protocol, stimuli, NAME, None, 0)
    for stop in (*STOPS, float("inf")):
        store = Stopping(responses, protocol, plan, stimuli.library, stimuli.synthetic)
        before, passed, finished = store.before()
        assert not finished
        store.left = stop - len(before)
        window = ScriptedWindow(script(protocol, plan, before))
        session = open_session(protocol, plan, before, passed=passed)
        try:
            outcome = play(window, session, stimuli.stimulus, store, Look((222, 223, 225), (default_font(),)))
        except KeyboardInterrupt:
            continue
        assert outcome.end == "finished"


def in_the_browser(manifest: Manifest, responses: Responses) -> None:
    cookies = None
    for stop in (*STOPS, float("inf")):
        with TestClient(make_app(make_host(manifest, responses, TEXT, parameters=("participant",)))) as client:
            client.cookies = cookies or client.cookies
            person = Person(client, f"page-until-{stop}")
            view = person.begin(parameters={"participant": NAME}, force=True)
            ahead: set[str] = set()
            while view["kind"] != "done" and len(answers_of(responses)) < stop:
                if view["kind"] == "trial":
                    films = {film["url"] for film in view["films"]}
                    assert not ahead or films <= ahead
                    ahead = {film["url"] for film in view["ahead"]}
                    for url in films | ahead:
                        assert client.get(f"/{url}").status_code == 200
                    values = [option["value"] for option in view["question"]["options"]]
                    view = person.answer(view, chosen(view["trial"], values))
                else:
                    view, ahead = person.done(view), set()
            cookies = client.cookies


def answers_of(responses: Responses) -> tuple[Answer, ...]:
    record = find_session(responses, NAME)
    return () if record is None else stored_answers(responses, record.id)


def in_a_simulation(protocol: Protocol, manifest: Manifest, responses: Responses) -> None:
    plan = draw_plan(protocol, manifest.pairs, NAME)

    def respond(_: Trial, step: Step) -> tuple[str, float]:
        return chosen(step.trial, step.legal), 0.5

    for stop in (*STOPS, float("inf")):
        record = begin_session(responses, protocol, plan)
        for trial, answer in walk(open_session(protocol, plan, stored_answers(responses, record.id)), respond):
            record_answer(responses, record, trial, answer)
            if len(answers_of(responses)) >= stop:
                break


def table(responses: Responses) -> pd.DataFrame:
    whole = answers_frame(responses, all_attempts=True, roles=("trial", "practice", "check"))
    return whole.drop(columns=["answered_at", "response_s"])


def test_the_same_responses_lead_to_the_same_trials_in_window_browser_and_simulation(tmp_path: Path) -> None:
    protocol = protocol_of(TEXT)
    manifest = unfilmed(tmp_path / "served", TEXT)
    with (
        open_responses(tmp_path / "window.sqlite") as window,
        open_responses(tmp_path / "browser.sqlite") as browser,
        open_responses(tmp_path / "simulated.sqlite") as simulated,
    ):
        in_the_window(protocol, window)
        in_the_browser(manifest, browser)
        in_a_simulation(protocol, manifest, simulated)
        tables = {"window": table(window), "browser": table(browser), "simulation": table(simulated)}
    pd.testing.assert_frame_equal(tables["window"], tables["simulation"])
    pd.testing.assert_frame_equal(tables["browser"], tables["simulation"])
    own = tables["simulation"]
    assert len(own) > max(STOPS)
    courses = draw_plan(protocol, manifest.pairs, NAME).courses
    assert [course.study for course in courses] == [f"{task}_{procedure}" for task, procedure in all_tracks()]
    for course in courses:
        tracked = own[own["study"] == course.study]
        assert list(tracked["trial"]) == list(range(course.first, course.first + len(tracked)))
        assert len(set(tracked["difference_frames"])) > 2, "a track that rises and falls shows three levels at least"
    # The study after it has the numbers that were kept for it.
    assert list(own[own["study"] == "beside"]["trial"]) == [courses[-1].first + courses[-1].most]


def test_other_responses_lead_to_other_trials(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So that the test above could fail."""
    protocol = protocol_of(TEXT)
    manifest = unfilmed(tmp_path / "served", TEXT)
    found = []
    for right in (1, 0):
        monkeypatch.setattr(f"{__name__}.chosen", lambda _, legal, right=right: legal[right])
        with open_responses(tmp_path / f"{right}.sqlite") as responses:
            in_a_simulation(protocol, manifest, responses)
            found.append(table(responses).groupby("study")["difference_frames"].agg(list))
    for task, procedure in all_tracks():
        assert found[0][f"{task}_{procedure}"] != found[1][f"{task}_{procedure}"]
