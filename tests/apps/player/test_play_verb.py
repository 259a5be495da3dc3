"""`segue play` in a real window on a virtual display, with keys and clicks from xdotool; killed and taken up again."""

from __future__ import annotations

import json
import subprocess
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from every import HEAD, check_walked, every_study, track
from playing import Playing

from study.experiment.protocol.whole import load_protocol
from study.experiment.store.answers import has_event, stored_answers
from study.experiment.store.responses import open_responses
from study.experiment.store.sessions import find_session

Start = Callable[..., Playing]


KEYS = "space", "s", "1", "y", "7", "Left", "Tab", "Return"
"""What answers any question, and goes on past any page."""


def test_a_session_of_every_task_that_is_killed_loses_nothing(
    start: Start, protocol_file: Path, tmp_path: Path
) -> None:
    out = tmp_path / "results"
    protocol_file.write_text(HEAD + every_study())
    stored: set[tuple[int, str, int]] = set()
    for answers in (3, 6, 1_000_000):
        playing = start(protocol_file, "--participant", "p1", "--out", out, "--json")
        playing.opened()
        playing.press_all(KEYS, 120, answers=answers)
        if killed := playing.running:
            playing.kill()
        assert not stored & set(playing.stored), "asked again"
        stored |= set(playing.stored)
        check_against(stored, out, "p1")
    assert not killed
    result = json.loads(playing.ended())
    assert playing.process.returncode == 0, playing.said
    assert result["end"] == "finished"
    assert result["window"]["full_screen"]
    assert result["window"]["viewport"] == [800, 600]
    assert not result["window"]["timing_measured"]
    assert any("TIMING WAS NOT MEASURED" in line for line in playing.said)
    with open_responses(out) as responses:
        table = check_walked(responses, load_protocol(protocol_file))
    assert not table["simulated"].any()
    assert (table["response_s"].dropna() > 0).all()


def test_clicks_answer_and_closing_asks_first(start: Start, protocol_file: Path, tmp_path: Path) -> None:
    out = tmp_path / "results"
    arguments = (protocol_file, "--participant", "p1", "--out", out, "--windowed", "--size", "640x480")
    playing = start(*arguments, "--json")
    playing.opened()
    window = subprocess.run(
        ["xdotool", "search", "--onlyvisible", "--name", "A small study"],
        env=playing.env, check=True, capture_output=True, text=True,
    ).stdout.split()[0]  # fmt: skip
    end = time.monotonic() + 60
    while not playing.stored and time.monotonic() < end:
        # The middle of the page: the only button of a page to read; then the left one of two.
        for x, y in ((320, 250), (240, 255), (320, 262)):
            playing.do("mousemove", "--window", window, x, y, "click", 1)
            time.sleep(0.04)
    assert playing.stored, playing.said
    playing.do("key", "Escape")
    time.sleep(0.5)
    assert playing.running
    playing.do("key", "space")
    time.sleep(0.3)
    assert playing.running
    for _ in range(40):
        if playing.running:
            playing.do("key", "--delay", 300, "Escape", "x")
    assert json.loads(playing.ended())["end"] == "stopped"
    assert playing.process.returncode == 0


def look(display: str) -> np.ndarray:
    """What is on the display, `(height, width, 3)`."""
    from PIL import ImageGrab

    return np.asarray(ImageGrab.grab(xdisplay=display).convert("RGB"))


def test_something_is_on_the_screen(start: Start, virtual_display: str, protocol_file: Path, tmp_path: Path) -> None:
    playing = start(protocol_file, "--participant", "p1", "--out", tmp_path / "results")
    playing.opened()
    ground, end = np.array([222, 223, 225]), time.monotonic() + 20.0
    while (picture := look(virtual_display))[5, 5].tolist() != ground.tolist():
        assert time.monotonic() < end, f"the window shows {picture[5, 5]} in its corner"
        time.sleep(0.1)
    ink = (np.abs(picture.astype(int) - ground).sum(axis=2) > 300).mean()
    assert 0.001 < ink < 0.05  # a line of text and a button
    playing.kill()


def check_against(stored: set[tuple[int, str, int]], out: Path, participant: str) -> int:
    """Every answer that was acknowledged is in the database, none twice; returns how many there are."""
    with open_responses(out) as responses:
        record = find_session(responses, participant)
        answers = stored_answers(responses, record.id) if record is not None else ()
    there = Counter((answer.trial, answer.item, answer.attempt) for answer in answers)
    assert not {key: count for key, count in there.items() if count > 1}
    assert stored <= set(there), f"lost: {sorted(stored - set(there))}"
    return len(there)


def is_finished(out: Path, participant: str) -> bool:
    with open_responses(out) as responses:
        record = find_session(responses, participant)
        return record is not None and has_event(responses, record, "finished")


def kill_again_and_again(times: int, start: Start, protocol: Path, out: Path, seed: int = 4) -> tuple[int, int]:
    """Kill sessions at random moments; returns how many kills there were and how many sessions were finished."""
    rng = np.random.default_rng(seed)
    kills = finished = 0
    stored: set[tuple[int, str, int]] = set()
    before = 0
    while kills < times:
        participant = f"p{finished}"
        playing = start(protocol, "--participant", participant, "--out", out)
        # From the start of Python to the middle of the session; or just when an answer was acknowledged.
        moment = rng.random()
        if moment < 0.2:
            time.sleep(float(rng.uniform(0.0, 2.0)))
        else:
            playing.opened()
            if moment < 0.7:
                playing.press_all(("space", "s", "7"), float(rng.uniform(0.0, 3.0)))
            else:
                playing.press_all(("space", "s", "7"), 20.0, answers=1)
        kills += playing.running
        playing.kill()
        stored |= set(playing.stored)
        there = check_against(stored, out, participant)
        assert there >= before, "answers were lost"
        before = there
        if is_finished(out, participant):
            finished, stored, before = finished + 1, set(), 0
    # What is left is finished: the session resumes where it stopped.
    playing = start(protocol, "--participant", f"p{finished}", "--out", out)
    playing.opened()
    playing.press_all(("space", "s", "7"), 120)
    playing.ended()
    assert playing.process.returncode == 0, playing.said
    again = set(playing.stored) & stored
    assert not again, f"asked again: {again}"
    check_against(stored | set(playing.stored), out, f"p{finished}")
    assert is_finished(out, f"p{finished}")
    return kills, finished + 1


def test_killed_tracks_go_on_with_the_trial_that_was_due(start: Start, protocol_file: Path, tmp_path: Path) -> None:
    protocol_file.write_text(HEAD + track("same-different", "staircase") + track("yes-no", "quest-plus"))
    out = tmp_path / "results"
    for answers in (3, 18, 100):
        playing = start(protocol_file, "--participant", "p1", "--out", out)
        playing.opened()
        playing.press_all(KEYS, 120, answers=answers)
        playing.kill() if playing.running else playing.ended()
    assert is_finished(out, "p1")
    with open_responses(out) as responses:
        table = check_walked(responses, load_protocol(protocol_file))
    assert set(table["task"]) == {"same-different", "yes-no"}


@pytest.mark.slow
def test_two_hundred_kills(start: Start, protocol_file: Path, tmp_path: Path) -> None:
    kills, finished = kill_again_and_again(200, start, protocol_file, tmp_path / "results", seed=5)
    assert kills == 200
    assert finished > 1


def test_without_a_display_it_says_what_to_do(start: Start, protocol_file: Path, tmp_path: Path) -> None:
    playing = start(protocol_file, "--participant", "p1", "--out", tmp_path / "results", display="")
    playing.ended()
    assert playing.process.returncode == 2
    assert len(playing.said) == 1
    assert playing.said[0].startswith("segue: Expected a display to open a window on, found none that works")
    assert "segue serve" in playing.said[0]
    assert not (tmp_path / "results").exists()
