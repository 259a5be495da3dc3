"""Levels that answers lead to are rendered while a session runs: before they are due, each once, and killed or not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from every import BESIDE, HEAD, track
from serving import TOKEN, Person, prepared, protocol_of
from starlette.testclient import TestClient

from study.apps.server.hosting import Host
from study.apps.server.settings import Settings
from study.apps.server.web import make_app
from study.errors import StimulusError
from study.experiment.stimuli.manifest import read_manifest
from study.experiment.stimuli.rendering import RenderAhead, known_beforehand, render
from study.experiment.store.responses import open_responses

TEXT = HEAD + track("same-different", "quest-plus", most_trials=20) + BESIDE


@pytest.fixture(scope="module")
def stimuli() -> Any:
    return prepared(TEXT)


@pytest.fixture
def serving(stimuli: Any, tmp_path: Path) -> Iterator[Callable[[], Person]]:
    """`serving()`: a participant of a server that is started, again where it was before."""
    render(stimuli, tmp_path, workers=1, all_levels=False)
    open_ones: list[TestClient] = []

    def stop() -> None:
        while open_ones:
            open_ones.pop().__exit__(None, None, None)

    def start() -> Person:
        stop()
        manifest, ahead = read_manifest(tmp_path), RenderAhead(stimuli, tmp_path, 1)
        settings = Settings(researcher_token=TOKEN)
        host = Host(protocol_of(TEXT), manifest, open_responses(tmp_path), settings, ahead)
        open_ones.append(TestClient(make_app(host)))
        open_ones[-1].__enter__()
        return Person(open_ones[-1])

    yield start
    stop()


def after(person: Person, view: dict[str, Any], value: str | None = "") -> dict[str, Any]:
    """The next view with films, past questions that have none."""
    view = person.answer(view, value)
    while view["kind"] != "trial" or not view["films"]:
        view = person.step(view)
    return view


def frames_of(person: Person, film: dict[str, Any]) -> int:
    """Load a film as the page does, and read its frames."""
    reply = person.client.get(f"/{film['url']}")
    assert reply.status_code == 200, reply.text
    assert len(reply.content) % film["bytes"] == 0
    return int.from_bytes(reply.content[-4:])


def test_levels_are_rendered_as_they_come_and_a_restart_goes_on(
    serving: Callable[[], Person], stimuli: Any, tmp_path: Path
) -> None:
    beforehand = {path.stem for path in (tmp_path / "stimuli").glob("*.mp4")}
    assert beforehand == known_beforehand(protocol_of(TEXT), stimuli.pairs)
    person, seen = serving(), list[tuple[int, list[int]]]()
    view = person.until(person.begin(parameters={"participant": "p01"}), "trial")
    for number in range(9):
        seen.append((view["trial"], [frames_of(person, film) for film in view["films"]]))
        if number == 4:
            cookies = dict(person.client.cookies)
            person = serving()
            person.client.cookies.update(cookies)
            again = person.until(person.begin(), "trial")
            assert (again["trial"], again["films"]) == (view["trial"], view["films"])
            assert [frames_of(person, film) for film in again["films"]] == seen[-1][1]
        view = after(person, view, "different" if number % 3 else "same")
    manifest = read_manifest(tmp_path)
    rendered = {path.stem for path in (tmp_path / "stimuli").glob("*.mp4")}
    assert beforehand < rendered < {record.id for record in manifest.records}
    assert set(manifest.videos) == rendered
    whole = tmp_path / "whole"
    render(stimuli, whole, workers=1)
    known = read_manifest(whole).videos
    assert all(manifest.videos[one]["frames_sha256"] == known[one]["frames_sha256"] for one in rendered)
    lengths = {record.frames for record in manifest.records}
    assert {frames for _, films in seen for frames in films} <= lengths


def test_a_film_that_cannot_be_rendered_is_a_fault_and_comes_when_it_can(
    serving: Callable[[], Person], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    person = serving()
    view = person.until(person.begin(parameters={"participant": "p01"}), "trial")
    folder, away = tmp_path / "stimuli", tmp_path / "away"
    with monkeypatch.context() as broken:

        async def refuse(*_: object) -> None:
            raise StimulusError(f"{folder}: no space is left on the disk")

        broken.setattr(RenderAhead, "ready", refuse)
        for path in folder.glob("*.mp4"):
            away.mkdir(exist_ok=True)
            path.rename(away / path.name)
        reply = person.client.get(f"/{view['films'][0]['url']}")
        assert reply.status_code == 422
        assert "expected the film whole" in reply.text.lower()
        assert str(folder) not in reply.text
    for path in away.glob("*.mp4"):
        path.rename(folder / path.name)
    assert all(frames_of(person, film) > 0 for film in view["films"])
