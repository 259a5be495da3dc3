"""jsPsych, the real one, plays what `segue export-stimuli` wrote, and its data come back to the same results folder."""

from __future__ import annotations

import functools
import json
import shutil
import threading
from collections.abc import Callable, Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from devtools import Browser
from serving import protocol_of
from walking import RATED, SHORT

from study.apps.cli import run
from study.experiment.elsewhere.sending import send
from study.experiment.stimuli.manifest import read_manifest
from study.experiment.store.answers import event_counts, stored_form
from study.experiment.store.frames import answers_frame
from study.experiment.store.responses import open_answers
from study.experiment.store.sessions import find_session

pytestmark = pytest.mark.gl


@pytest.fixture(scope="session")
def browser(whole_browser: Browser) -> Browser:
    """Chromium with its windows, as people have it."""
    return whole_browser


MODULES = Path(__file__).parents[3] / "build" / "node_modules"
BUTTON = "#jspsych-html-button-response-btngroup button"

CHOSEN = SHORT.replace(
    "[[transitions]]",
    """
[[form]]
name = "age"
label = "Your <age>"
kind = "number"
least = 18
most = 99

[[transitions]]""",
    1,
).replace('order = "both"', 'order = "both"\npractice = 1\nconfidence_points = 3')


@pytest.fixture
def sent(films: Callable[[str], Path], tmp_path: Path) -> Iterator[Callable[[str], tuple[Path, str]]]:
    """`sent(protocol)`: the folder as jsPsych gets it, and the address where a plain web server has it."""
    if not (MODULES / "jspsych").exists():
        pytest.skip("jsPsych is missing: npm install --prefix build jspsych and the plugins of its package.json")
    servers: list[ThreadingHTTPServer] = []

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: Any) -> None:
            pass

    def send_it(text: str) -> tuple[Path, str]:
        folder = tmp_path / "web"
        shutil.copytree(films(text), folder)
        send(folder, protocol_of(text), read_manifest(folder), "jspsych", 2)
        (folder / "node_modules").symlink_to(MODULES)
        servers.append(ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(folder))))
        threading.Thread(target=servers[-1].serve_forever, daemon=True).start()
        return folder, f"http://127.0.0.1:{servers[-1].server_port}"

    yield send_it
    for server in servers:
        server.shutdown()
        server.server_close()


def click(tab: Any, element: str) -> None:
    """With the mouse: browsers play films on pages that somebody touched."""
    tab.click_at(*tab.run(f"(() => {{ const r = {element}.getBoundingClientRect(); return [r.x + 5, r.y + 5]; }})()"))


def walk(tab: Any) -> None:
    """Through all pages: questions by their first key or their last button in turn, forms with 30."""
    for number in range(200):
        tab.wait(
            f"document.querySelector('{BUTTON}, form, .jspsych-html-slider-response-container') !== null", every=0.02
        )
        where = "jsPsych.getProgress().current_trial_global"
        at = tab.run(where)
        if tab.run("document.body.innerText.includes('That was all')"):
            break
        if tab.run("document.querySelector('form') !== null"):
            tab.run("document.querySelector('input').value = '30'")
            tab.run("document.querySelector('form').requestSubmit()")
        elif tab.run("document.querySelector('input[type=range]') !== null"):
            click(tab, "document.querySelector('input[type=range]')")
            click(tab, "document.querySelector('.jspsych-btn')")
        elif tab.run("document.querySelector('[data-choice=\"1\"]') !== null") and number % 2:
            click(tab, f"[...document.querySelectorAll('{BUTTON}')].at(-1)")
        elif (key := tab.run("jsPsych.getCurrentTrial().choices[0].match(/key (.)/)?.[1] ?? null")) is not None:
            tab.key(key.lower())
        else:
            click(tab, f"document.querySelector('{BUTTON}')")
        tab.wait(f"{where} !== {at}", every=0.02)


def brought(folder: Path, tab: Any, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    data = folder / "segue_p001.json"
    data.write_text(tab.run("jsPsych.data.get().json()"), encoding="utf-8")
    assert run(["import-answers", str(folder), str(data), "--json"]) == 0
    (result,) = json.loads(capsys.readouterr().out)["files"].values()
    assert isinstance(result, dict)
    return result


def test_a_session_of_choices(
    sent: Callable[[str], tuple[Path, str]], make_tab: Callable[..., Any], capsys: pytest.CaptureFixture[str]
) -> None:
    (folder, address), tab = sent(CHOSEN), make_tab()
    tab.open(f"{address}/?participant=p001")
    walk(tab)
    said = {
        (row["segue_trial"], row["segue_item"]): (row["answer"], row["response_s"])
        for row in json.loads(tab.run("jsPsych.data.get().json()"))
        if "answer" in row
    }
    assert brought(folder, tab, capsys) == {"participants": 1, "finished": 1, "answers": 10, "late": 0}
    with open_answers(folder) as responses:
        table = answers_frame(responses, roles=("trial", "practice"))
        record = find_session(responses, "p001")
        assert record is not None
        assert not record.simulated
        assert stored_form(responses, record.id) == {"age": "30"}
        assert event_counts(responses, record)["imported"] == 1
    assert len(said) == 10
    assert {(row.trial, ""): (row.answer, row.response_s) for row in table.itertuples()} == {
        key: value for key, value in said.items() if not key[1]
    }
    assert set(table["answer"]) == {"same", "different"}
    plan = {trial.trial: trial for trial in record.plan.trials}
    assert all(plan[row.trial].difference_frames == row.difference_frames for row in table.itertuples())
    assert run(["import-answers", str(folder), str(folder / "segue_p001.json"), "--json"]) == 0
    assert '"answers": 0' in capsys.readouterr().out
    assert run(["report", str(folder)]) == 0


@pytest.mark.parametrize("slider", ["", 'slider = "ticks"'])
def test_ratings_and_sliders(
    sent: Callable[[str], tuple[Path, str]],
    make_tab: Callable[..., Any],
    capsys: pytest.CaptureFixture[str],
    slider: str,
) -> None:
    (folder, address), tab = sent(RATED.replace('order = "random"', f'order = "random"\n{slider}')), make_tab()
    tab.open(f"{address}/?participant=p002")
    walk(tab)
    result = brought(folder, tab, capsys)
    assert (result["finished"], result["late"]) == (1, 0)
    with open_answers(folder) as responses:
        table = answers_frame(responses)
    assert set(table["item"]) == {"natural", "noticeable"}
    assert len(table) == result["answers"]
    given = [int(value) for value in table["answer"]]
    assert max(given) < 5 if slider else set(given) == {0, 4}  # the mouse comes down at the slider's left end


def test_who_takes_part_stands_in_the_address(
    sent: Callable[[str], tuple[Path, str]], make_tab: Callable[..., Any]
) -> None:
    (_, address), tab = sent(SHORT), make_tab()
    tab.open(address)
    tab.wait_text("Expected a participant in the address")
    assert "such as index.html?participant=p001, found none." in tab.text()
