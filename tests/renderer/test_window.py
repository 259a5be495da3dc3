"""The window: pacing and keys as plain arithmetic; drawing, flips and events on a virtual display, in own processes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer.camera import Camera
from renderer.events import key_name
from renderer.figure import make_figure
from renderer.framing import frame_group
from renderer.pacing import find_pacing, next_flip
from renderer.screen import Drawing, fitted_camera

ROOT = Path(__file__).parents[2]


def test_a_display_that_reports_no_rate_gets_an_own_clock() -> None:
    """Xvfb reports 0, and swaps there take as long as the drawing does, be it by chance a sixtieth of a second."""
    for swap_s in (0.002, 1 / 60):
        pacing = find_pacing(np.full(40, swap_s), 0.0)
        assert pacing.own_clock
        assert not pacing.measured
        assert pacing.refresh_hz == 60.0


def test_the_measured_rate_refines_the_reported_one() -> None:
    pacing = find_pacing(np.full(40, 1 / 59.94), 59.0)
    assert pacing.measured
    assert pacing.refresh_hz == pytest.approx(59.94)


def test_swaps_that_do_not_wait_get_an_own_clock_at_the_reported_rate() -> None:
    pacing = find_pacing(np.full(40, 0.0004), 144.0)
    assert pacing.own_clock
    assert pacing.refresh_hz == 144.0


def test_a_machine_too_slow_for_its_display_is_still_paced_by_it() -> None:
    pacing = find_pacing(np.full(40, 2 / 60), 60.0)
    assert pacing.measured
    assert pacing.refresh_hz == 60.0


def test_a_few_slow_swaps_change_nothing() -> None:
    swaps = np.full(40, 1 / 60)
    swaps[::7] = 0.1
    assert find_pacing(swaps, 60.0).refresh_hz == pytest.approx(60.0)


@pytest.mark.parametrize(
    ("last", "now", "expected"), [(1.0, 1.001, 1.01), (1.0, 1.0096, 1.02), (1.0, 1.0204, 1.03), (1.0, 1.0, 1.01)]
)
def test_the_next_flip_is_a_whole_number_of_periods_on(last: float, now: float, expected: float) -> None:
    assert next_flip(last, 0.01, now) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("token", "printed", "name"),
    [
        (32, None, "space"),
        (257, None, "enter"),
        (335, None, "enter"),
        (256, None, "escape"),
        (49, "1", "1"),
        (49, "&", "1"),  # the digit row of a French keyboard
        (321, "1", "1"),  # the keypad
        (83, "s", "s"),
        (89, "z", "z"),  # where a German keyboard has its Z
        (68, None, "d"),
        (290, None, "key-290"),
    ],
)
def test_keys_have_the_names_that_are_printed_on_them(token: int, printed: str | None, name: str) -> None:
    assert key_name(token, printed) == name


def camera(width: int = 160, height: int = 120) -> Camera:
    return Camera(np.array([0.0, 1.0, 4.0]), np.eye(3), 100.0, (width, height))


@pytest.mark.parametrize(
    ("window", "height", "size"),
    [((1280, 800), np.inf, (1066, 800)), ((400, 800), np.inf, (400, 300)), ((1280, 800), 120, (160, 120)),
     ((80, 80), 120, (80, 60)), ((1920, 1080), 756, (1008, 756)), ((1366, 768), 537.6, (716, 536))],
)  # fmt: skip
def test_a_picture_is_as_high_as_asked_in_its_own_shape_where_it_fits(
    window: tuple[int, int], height: float, size: tuple[int, int]
) -> None:
    fitted = fitted_camera(camera(), window, height)
    assert fitted.size == size
    assert fitted.focal_pixels == pytest.approx(100.0 * size[1] / 120, rel=0.01)


def test_a_drawing_is_laid_out_again_only_for_another_size(puppet: Any) -> None:
    figure = make_figure(puppet.bones, puppet.sides, puppet.parts, style="stick")
    drawing = Drawing(puppet.walk(3), figure, frame_group([puppet.walk(3)], size=(160, 120)), 30.0, np.inf)
    assert drawing.fit((320, 240))
    assert not drawing.fit((320, 240))
    before = drawing.shapes.data.copy()
    assert drawing.fit((640, 480))
    np.testing.assert_allclose(drawing.shapes.data[..., :4], 2 * before[..., :4], atol=0.01)


def in_a_window(code: str, display: str) -> str:
    """Run code with a window `w` of 200 x 150 pixels in a process of its own; its standard output."""
    head = (
        "import numpy as np, subprocess, time\n"
        "from renderer.window import *\n"
        "from renderer.figure import make_figure\n"
        "from renderer.framing import frame_group\n"
        "points = np.array([[0, 0, 0], [0, 1, 0], [0.4, 0.7, 0.1], [-0.4, 0.6, 0.0]], dtype=float)\n"
        "walk = points[None] + np.linspace(0, 0.3, 5)[:, None, None] * np.array([1.0, 0, 0])\n"
        "figure = make_figure(np.array([[0, 1], [1, 2], [1, 3]]), ['centre', 'centre', 'left', 'right'], {})\n"
        "camera = frame_group([walk], size=(160, 120), view='front')\n"
        "def seen(w):\n"
        "    w.gl.finish()\n"
        "    rows = np.frombuffer(w.gl.screen.read(components=3, alignment=1), np.uint8)\n"
        "    return rows.reshape(w.size[1], w.size[0], 3)[::-1]\n"
        "w = open_window('test', full_screen=FULL, size=(200, 150))\n".replace("FULL", str("FULL SCREEN" in code))
    )
    environment = {**os.environ, "DISPLAY": display, "PYTHONWARNINGS": "error"}
    environment.pop("WAYLAND_DISPLAY", None)
    done = subprocess.run(
        [sys.executable, "-c", head + code + "\nw.close()"],
        cwd=ROOT, env=environment, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("kind", ["fixed", "track", "pan"])
@pytest.mark.parametrize("floor", [False, True], ids=["no floor", "floor"])
def test_a_frame_in_the_window_is_the_one_of_the_offscreen_renderer(
    virtual_display: str, floor: bool, kind: str
) -> None:
    """Byte for byte without a floor, the right way up, in the middle of the window on the figure's background.

    The floor's shader reckons in single precision: a level of 255 aside here and there, and nowhere more.
    """
    out = in_a_window(
        f"floor, kind = {floor}, {kind!r}\n"
        "from dataclasses import replace\n"
        "if floor: figure = replace(figure, floor_m=0.0)\n"
        "walk = walk + np.linspace(0, 1.3, 5)[:, None, None] * np.array([1.0, 0, 0.4])\n"
        "camera = frame_group([walk], size=(160, 120), view='front', camera=kind, track_seconds=0.4, elevation=0.4)\n"
        "d = w.drawing(walk, figure, camera, 30.0, height=120)\n"
        "from renderer.offscreen import render_rgb\n"
        "from renderer.context import Context\n"
        "want = list(render_rgb(walk, figure, camera, context=Context('window', w.gl, '', '')))\n"
        "got = []\n"
        "for frame in range(5):\n    w.paint_frame(d, frame); got.append(seen(w))\n"
        "inside = [one[15:135, 20:180].astype(int) for one in got]\n"
        "apart = [np.abs(a - b).max(axis=2) for a, b in zip(inside, want)]\n"
        "ground = np.array(figure.background)\n"
        "print(max(one.max() for one in apart), max((one > 0).mean() for one in apart),"
        " (want[4] != ground).any(axis=2).mean(),"
        " np.abs(want[4][80:110, 20:50].astype(int) - want[0][80:110, 20:50]).max())\n"
        "print(all((one[:15] == ground).all() and (one[:, :20] == ground).all() for one in got))\n",
        virtual_display,
    )
    largest, share, foreground, travels, plain = out.split()
    assert plain == "True"
    assert int(largest) <= (1 if floor else 0)
    assert float(share) < 0.01
    assert float(foreground) > (0.5 if floor else 0.02)
    assert (int(travels) > 3) == (floor and kind != "fixed")


def test_a_picture_is_shown_pixel_for_pixel(virtual_display: str) -> None:
    out = in_a_window(
        "picture = np.random.default_rng(1).integers(0, 256, (150, 200, 3), dtype=np.uint8)\n"
        "p = w.picture(picture); w.paint(p, (0, 0, 0)); print(np.array_equal(seen(w), picture))\n"
        "small = w.picture(picture[:31, :41].copy()); w.paint(small, (9, 8, 7)); got = seen(w)\n"
        "print((got[0, 0] == (9, 8, 7)).all(), sum(np.array_equal(got[y:y + 31, x:x + 41], picture[:31, :41])"
        " for y in (59, 60) for x in (79, 80)))",
        virtual_display,
    )
    assert out.split() == ["True", "True", "1"]


def test_flips_follow_the_own_clock_and_its_beat(virtual_display: str) -> None:
    out = in_a_window(
        "at = []\nfor _ in range(90):\n    w.clear((200, 200, 200)); at.append(w.flip())\n"
        "print(w.pacing.own_clock, w.describe()['timing_measured'], np.median(np.diff(at)), at[-1] - at[0])",
        virtual_display,
    )
    own, measured, median, span = out.split()
    assert (own, measured) == ("True", "False")
    assert float(median) == pytest.approx(1 / 60, abs=0.002)
    assert 89 / 60 - 0.02 < float(span) < 89 / 60 + 0.5  # never faster; a busy machine may miss some


def test_a_key_has_the_time_at_which_the_server_took_it_however_late_it_is_looked_at(virtual_display: str) -> None:
    out = in_a_window(
        "subprocess.run(['xdotool', 'mousemove', '50', '50'], check=True); w.poll(); found = []\n"
        "for _ in range(8):\n"
        "    before = w.now()\n"
        "    subprocess.run(['xdotool', 'key', 's', 'click', '1'], check=True)\n"
        "    after = w.now(); time.sleep(0.1); late = w.poll()\n"
        "    found += [before < e.time_s < after + 0.001 for e in late if isinstance(e, Key | Click)]\n"
        "print(w.describe()['key_times'], len(found), all(found))",
        virtual_display,
    )
    assert out.strip() == "X server 16 True"


def test_full_screen_takes_the_display_and_keys_arrive_with_their_times(virtual_display: str) -> None:
    out = in_a_window(
        "# FULL SCREEN\n"
        "w.poll(); before = w.now()\n"
        "subprocess.run(['xdotool', 'key', 's', 'space'], check=True)\n"
        "events, end = [], w.now() + 5\n"
        "while len([e for e in events if isinstance(e, Key)]) < 2 and w.now() < end:\n    events += w.wait(0.2)\n"
        "keys = [e for e in events if isinstance(e, Key)]\n"
        "print(w.size, [k.name for k in keys], before < keys[0].time_s <= keys[1].time_s < w.now())\n"
        "print([e.character for e in events if isinstance(e, Typed)])\n"
        "subprocess.run(['xdotool', 'mousemove', '300', '200', 'click', '1'], check=True)\n"
        "events, end = [], w.now() + 5\n"
        "while not events and w.now() < end:\n    events += [e for e in w.wait(0.2) if isinstance(e, Click)]\n"
        "print(events[0].x, events[0].y)",
        virtual_display,
    )
    assert out.splitlines() == ["(800, 600) ['s', 'space'] True", "['s', ' ']", "300.0 200.0"]


ASK_TO_CLOSE = """
import ctypes
class Message(ctypes.Structure):
    _fields_ = [("type", ctypes.c_int), ("serial", ctypes.c_ulong), ("sent", ctypes.c_int),
                ("display", ctypes.c_void_p),
                ("window", ctypes.c_ulong), ("kind", ctypes.c_ulong), ("format", ctypes.c_int),
                ("data", ctypes.c_long * 5), ("rest", ctypes.c_long * 24)]
x = ctypes.CDLL("libX11.so.6")
x.XOpenDisplay.restype = ctypes.c_void_p
x.XInternAtom.restype = ctypes.c_ulong
x.XInternAtom.argtypes = [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int]
x.XSendEvent.argtypes = [ctypes.c_void_p, ctypes.c_ulong, ctypes.c_int, ctypes.c_long, ctypes.c_void_p]
x.XSync.argtypes = [ctypes.c_void_p, ctypes.c_int]
display = x.XOpenDisplay(None)
message = Message(33, 0, 1, display, int(name), x.XInternAtom(display, b"WM_PROTOCOLS", 0), 32)
message.data[0] = x.XInternAtom(display, b"WM_DELETE_WINDOW", 0)
x.XSendEvent(display, int(name), 0, 0, ctypes.byref(message))
x.XSync(display, 0)
"""
"""What a window manager sends when somebody clicks on the cross; xdotool has no verb for it."""


def test_a_window_that_is_asked_to_close_stays_and_says_so(virtual_display: str) -> None:
    out = in_a_window(
        "w.poll()\n"
        "name = subprocess.run(['xdotool', 'search', '--onlyvisible', '--name', '^test$'], check=True,"
        " capture_output=True, text=True).stdout.split()[0]\n"
        + ASK_TO_CLOSE
        + "subprocess.run(['xdotool', 'windowsize', name, '240', '170'], check=True)\n"
        "events, end = [], w.now() + 2\n"
        "while w.now() < end:\n    events += w.wait(0.2)\n"
        "print(sum(isinstance(e, CloseAsked) for e in events), w.size,"
        " any(isinstance(e, Resized) and e.size == (240, 170) for e in events))\n"
        "w.clear((1, 2, 3)); w.flip()",
        virtual_display,
    )
    assert out.strip() == "1 (240, 170) True"


def test_without_a_display_it_is_refused() -> None:
    code = "from renderer.window import open_window, check_display\nfrom renderer.errors import RendererError\n"
    code += "for open_it in (check_display, open_window):\n    try:\n        open_it()\n"
    code += "    except RendererError as error:\n        print(error)\n"
    environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.stderr == ""
    lines = done.stdout.splitlines()
    assert len(lines) == 2
    assert all(line.startswith("Expected a display to open a window on, found none that works") for line in lines)
    assert all("DISPLAY" in line and "segue serve" in line for line in lines)
