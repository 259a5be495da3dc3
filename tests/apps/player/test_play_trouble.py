"""What goes wrong with a real window: it is left, resized, its keys are held, its display disappears or draws nothing.

A window manager is missing on the virtual display, so another client takes the keyboard the way one would.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sqlalchemy as sa
from PIL import ImageGrab
from playing import Playing

from study.experiment.store.answers import has_event, stored_answers
from study.experiment.store.responses import open_responses
from study.experiment.store.sessions import find_session
from study.experiment.store.tables import events, presentations

Start = Callable[..., Playing]

# Films of some two seconds, so that something can happen to them, and two trials.
LONG = (
    ("entry_s = 0.1", "entry_s = 0.8"), ("exit_s = 0.1", "exit_s = 0.8"), ("[-3, 0, 4]", "[-3, 4]"),
    ('order = "both"', 'order = "random"'),
)  # fmt: skip

OTHER_WINDOW = """
import ctypes, sys
x = ctypes.CDLL("libX11.so.6")
x.XOpenDisplay.restype = x.XDefaultRootWindow.restype = x.XCreateSimpleWindow.restype = ctypes.c_void_p
x.XDefaultRootWindow.argtypes = x.XSync.argtypes = x.XMapWindow.argtypes = None
display = ctypes.c_void_p(x.XOpenDisplay(None))
root = ctypes.c_void_p(x.XDefaultRootWindow(display))
window = ctypes.c_void_p(x.XCreateSimpleWindow(display, root, 700, 500, 50, 50, 0, 0, 0))
x.XStoreName(display, window, b"another window")
x.XMapWindow(display, window)
x.XSync(display, 0)
print("there", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def other_window(virtual_display: str) -> Iterator[str]:
    """A window of another program; its name."""
    client = subprocess.Popen(
        [sys.executable, "-c", OTHER_WINDOW],
        env={"DISPLAY": virtual_display, "PATH": "/usr/bin:/bin"},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert client.stdout is not None
    assert client.stdout.readline() == "there\n"
    yield "another window"
    client.communicate()


@pytest.fixture
def long_protocol(tmp_path: Path, texts: Any) -> Path:
    text = texts["small"]
    for old, new in LONG:
        assert old in text
        text = text.replace(old, new)
    file = tmp_path / "long.toml"
    file.write_text(text)
    return file


def to_the_film(playing: Playing) -> None:
    """Past the pages, until the orange limbs of a figure are on the display."""
    playing.opened()

    def plays() -> bool:
        red, green, blue = np.asarray(ImageGrab.grab(xdisplay=playing.env["DISPLAY"]).convert("RGB")).T.astype(int)
        return bool(((red > 200) & (green > 120) & (green < 200) & (blue < 100)).sum() > 50)

    end = time.monotonic() + 60
    while not plays():
        assert time.monotonic() < end, "\n".join(["no film; said:", *playing.said])
        playing.do("key", "space")
        time.sleep(0.15)


def focus(playing: Playing, name: str) -> None:
    playing.do("search", "--onlyvisible", "--name", name, "windowfocus", "--sync")


def happened(out: Path, kind: str) -> list[Any]:
    with open_responses(out) as responses, responses.engine.connect() as connection:
        query = sa.select(events.c.detail_json).where(events.c.kind == kind).order_by(events.c.id)
        return [json.loads(row) if row else None for row in connection.execute(query).scalars()]


def shown(out: Path) -> list[Any]:
    with open_responses(out) as responses, responses.engine.connect() as connection:
        return list(connection.execute(sa.select(presentations).order_by(presentations.c.id)).mappings())


def answers(out: Path, participant: str = "p1") -> list[Any]:
    with open_responses(out) as responses:
        record = find_session(responses, participant)
        return [] if record is None else list(stored_answers(responses, record.id))


def test_a_window_that_is_left_in_mid_film_flags_the_trial_and_asks_before_the_next(
    start: Start, long_protocol: Path, tmp_path: Path, other_window: str
) -> None:
    out = tmp_path / "results"
    playing = start(long_protocol, "--participant", "p1", "--out", out, "--windowed", "--size", "640x480")
    to_the_film(playing)
    focus(playing, other_window)
    playing.until(lambda: playing.stored)  # the films play to their end, and nobody can answer
    assert [(one.value, one.shown_well) for one in answers(out)] == [(None, False)]
    time.sleep(1.0)
    playing.do("key", "s", "space")  # to the other window
    time.sleep(0.5)
    assert len(playing.stored) == 1
    focus(playing, "A small study")
    playing.press_all(("space", "s"), 60)
    playing.ended()
    assert playing.process.returncode == 0, playing.said
    assert [one["focused"] for one in happened(out, "focus")][-2:] == [False, True]
    assert 1 in [one["trial"] for one in happened(out, "focus") if not one["focused"]]
    # It was queued again, and seen.
    assert (1, 2) in [(one.trial, one.attempt) for one in answers(out)]
    assert "focus lost" in shown(out)[0]["detail_json"]


def test_a_resized_window_draws_on_and_flags_the_trial(start: Start, long_protocol: Path, tmp_path: Path) -> None:
    out = tmp_path / "results"
    playing = start(long_protocol, "--participant", "p1", "--out", out, "--windowed", "--size", "640x480")
    to_the_film(playing)
    for size in (("400", "300"), ("720", "520")):
        playing.do("search", "--onlyvisible", "--name", "A small study", "windowsize", "--sync", *size)
        time.sleep(0.2)
    playing.until(lambda: playing.stored)
    playing.kill()
    assert [one["viewport"] for one in happened(out, "resized")] == [[400, 300], [720, 520]]
    assert "resized" in shown(out)[0]["detail_json"]
    assert not answers(out)[0].shown_well


def test_a_held_key_answers_once_and_two_keys_at_once_count_as_the_first(
    start: Start, long_protocol: Path, tmp_path: Path
) -> None:
    out = tmp_path / "results"
    playing = start(long_protocol, "--participant", "p1", "--out", out)
    to_the_film(playing)
    playing.do("keydown", "d")  # while the film plays, and held: it repeats, and answers nothing
    playing.until(lambda: playing.stored)
    playing.do("keyup", "d")
    assert [one.value for one in answers(out)] == [None]
    end = time.monotonic() + 60
    while len(playing.stored) < 2 and time.monotonic() < end:
        playing.do("key", "--delay", 0, "d", "s")  # as two fingers at once: at most the first of them counts
        time.sleep(0.15)
    assert answers(out)[1].value == "different"
    playing.kill()


def test_escape_in_mid_film_asks_and_the_trial_starts_from_its_first_film(
    start: Start, long_protocol: Path, tmp_path: Path
) -> None:
    out = tmp_path / "results"
    playing = start(long_protocol, "--participant", "p1", "--out", out, "--json")
    to_the_film(playing)
    playing.do("key", "Escape")
    time.sleep(1.0)
    playing.do("key", "Return")  # go on
    to_the_film(playing)
    playing.do("key", "Escape")
    time.sleep(1.0)
    playing.do("key", "x")
    assert json.loads(playing.ended())["end"] == "stopped"
    assert [(one["trial"], one["attempt"]) for one in happened(out, "trial begun again")] == [(1, 1)]
    assert [one["trial"] for one in happened(out, "stopped")] == [1]
    assert not answers(out)


def test_a_display_that_disappears_loses_nothing(
    start: Start, start_display: Any, virtual_display: str, protocol_file: Path, tmp_path: Path
) -> None:
    out = tmp_path / "results"
    display = start_display("640x480")
    playing = start(protocol_file, "--participant", "p1", "--out", out, display=display.name)
    playing.opened()
    end = time.monotonic() + 60
    while len(playing.stored) < 2 and playing.running and time.monotonic() < end:
        playing.do("key", "space", "s")
        time.sleep(0.05)
    display.server.kill()
    playing.process.wait(20)
    playing.ended()
    assert playing.process.returncode == 2, "\n".join(playing.said)
    assert playing.said[-1].startswith("segue: The display is gone. Every response is stored")
    stored = {(one.trial, one.item, one.attempt) for one in answers(out)}
    assert set(playing.stored) <= stored
    assert len(happened(out, "display lost")) == 1
    again = start(protocol_file, "--participant", "p1", "--out", out, display=virtual_display)
    again.opened()
    again.press_all(("space", "s", "7"), 90)
    again.ended()
    assert again.process.returncode == 0, again.said
    with open_responses(out) as responses:
        record = find_session(responses, "p1")
        assert record is not None
        assert has_event(responses, record, "finished")
    assert not set(again.stored) & stored


def test_a_display_without_opengl_is_refused_before_anything_is_stored(
    start: Start, start_display: Any, protocol_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere.json")
    bare = start_display("640x480", "-extension", "GLX")
    playing = start(protocol_file, "--participant", "p1", "--out", tmp_path / "results", display=bare.name)
    playing.process.wait(30)
    playing.ended()
    assert playing.process.returncode == 2
    assert playing.said[-1].startswith("segue: Expected a display that draws OpenGL 3.3, found none")
    assert "Traceback" not in "".join(playing.said)
    assert not answers(tmp_path / "results")
