"""What a researcher decides about sessions: codes by outcome, a dry run, a preview."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from serving import PROTOCOL, QUESTIONS, TOKEN, protocol_of, served_manifest, unfilmed

from study.apps.server import dry_run
from study.apps.server.settings import Settings
from study.errors import SessionError
from study.experiment.store.frames import ROLES, answers_frame

RULE = PROTOCOL.replace("[timing]", "[failed_checks]\nmost = 0\n\n[timing]")


def to_the_end(person: Any, passes: bool) -> dict[str, Any]:
    view = person.begin()
    while view["kind"] != "done":
        options = view.get("question", {}).get("options", [])
        if "checks the controls" not in view.get("question", {}).get("text", ""):
            view = person.step(view)
            continue
        named = [option["value"] for option in options if view["question"]["text"].endswith(option["label"])]
        other = [option["value"] for option in options if option["value"] not in named]
        view = person.answer(view, (named if passes else other)[0])
    return dict(view)


def test_code_and_link_go_by_the_outcome_and_a_reload_gives_them_again(serve: Callable[..., Any]) -> None:
    settings = {"completion_code": "C1", "failed_code": "F1", "failed_url": "https://recruiting.example/failed"}
    serving = serve(text=RULE, **settings)
    passed = to_the_end(serving.person("page-one"), passes=True)
    assert (passed["completion_code"], passed["completion_url"]) == ("C1", "")
    person = serving.person("page-two")
    failed = to_the_end(person, passes=False)
    assert (failed["completion_code"], failed["completion_url"]) == ("F1", settings["failed_url"])
    assert person.begin("page-three", previous="page-two")["completion_code"] == "F1"
    seen = serving.ask("overview").json()
    assert (seen["counts"]["finished"], seen["counts"]["failed checks"]) == (1, 1)
    answers = answers_frame(serving.host.responses, roles=ROLES).groupby("participant").size()
    assert sorted(answers)[-1] == QUESTIONS
    assert sorted(answers)[0] < QUESTIONS


def test_a_dry_run_answers_everything_and_keeps_nothing(tmp_path: Path) -> None:
    manifest = unfilmed(tmp_path)
    settings = Settings(researcher_token=TOKEN)
    before = sorted(path.name for path in tmp_path.rglob("*"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dry_run, "read_manifest", lambda _: manifest)
        walked = dry_run.walk_through(protocol_of(), tmp_path, settings)
    assert walked.answers == QUESTIONS
    assert walked.films == 18
    assert sorted(path.name for path in tmp_path.rglob("*")) == before


def test_a_dry_run_tells_of_a_film_that_is_damaged(tmp_path: Path) -> None:
    unfilmed(tmp_path)
    manifest = served_manifest(tmp_path)
    for file in (tmp_path / "stimuli").glob("*.mp4"):
        file.write_bytes(file.read_bytes()[:-10])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dry_run, "read_manifest", lambda _: manifest)
        with pytest.raises(SessionError, match=r"Expected the server to take .*found it damaged"):
            dry_run.walk_through(protocol_of(), tmp_path, Settings(researcher_token=TOKEN))


def test_a_preview_begins_at_any_trial_and_anew_each_time(serve: Callable[..., Any]) -> None:
    serving = serve(preview=True, parameters=("trial",))
    for wanted in (3, 7, 7, 1):
        person = serving.person(f"page-at-{wanted}")
        view = person.until(person.begin(parameters={"trial": str(wanted)}), "trial")
        assert view["trial"] == wanted
        assert view["films"]
        assert person.answer(view)["kind"] in ("trial", "feedback", "instructions", "break")
        # The same browser again: not where it was, but where the link says.
        assert person.until(person.begin("page-again", parameters={"trial": "2"}), "trial")["trial"] == 2
    refused = serving.person().post("/api/begin", {"page": "page-one", "parameters": {"trial": "99"}})
    assert (refused.status_code, "Expected a trial from 1 to" in refused.text) == (422, True)


def test_practice_that_was_not_right_comes_again_with_films_of_its_own(serve: Callable[..., Any]) -> None:
    text = PROTOCOL.replace("practice = 1\n", "practice = 1\npractice_until = 1.0\npractice_most = 3\n")
    person = serve(text=text).person()
    view = person.until(person.begin(), "trial")
    seen = []
    while view["label"] == "Practice":
        seen.append((view["trial"], view["attempt"], tuple(film["url"] for film in view["films"])))
        told = person.answer(view, "same" if len(seen) < 2 else "different")
        assert told["kind"] == "feedback"
        right = "That was right" in told["text"]
        view = person.until(person.done(told), "trial")
        assert (view["label"] == "Practice") == (not right and len(seen) < 3)
        if len(seen) == 1:  # a reload asks for the same round
            again = person.until(person.begin("page-two", previous="page-one"), "trial")
            assert (again["trial"], again["attempt"]) == (view["trial"], view["attempt"])
    assert [attempt for _, attempt, _ in seen] == list(range(1, len(seen) + 1))
    assert len({url for _, _, urls in seen for url in urls}) == 2 * len(seen)
