"""How true the times of the window are: injected keys against stored reaction times, and flips against their plan.

Runs real sessions (`study.apps.player.loop.play` in `renderer.window`) on the display that there is. Another process
injects a key through XTest at a random moment after each question came up, and notes the moment by the machine's
steady clock, which is glfw's clock too; the error is the stored reaction time less the injected one. What it leaves out
are the keyboard and the panel themselves, which only a photodiode and a button box can measure.

    xvfb-run -s "-screen 0 1280x800x24" python benchmarks/play.py --trials 100
"""

from __future__ import annotations

import argparse
import ctypes
import json
import subprocess
import sys
import time
from contextlib import suppress
from typing import Any

import numpy as np

PROTOCOL = """\
name = "timing"
title = "Timing"
fps = 30
seed = 1
[stimuli]
entry_s = 0.1
exit_s = 0.1
[timing]
gap_s = 0.05
pause_s = 0.05
[points]
shortest_frames = 4
longest_frames = 8
[[transitions]]
name = "steps"
category = "walking"
source = "walk"
destination = "walk_fast"
[[studies]]
name = "timing"
task = "same-different"
differences_frames = [0]
repeats = {trials}
question = "Same or different?"
example = false
"""


def inject() -> None:
    """The injecting process: for each line (a delay in seconds) presses and releases `s`, and says when."""
    x, test = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
    x.XOpenDisplay.restype = ctypes.c_void_p
    display = ctypes.c_void_p(x.XOpenDisplay(None))
    code = x.XKeysymToKeycode(display, ctypes.c_ulong(ord("s")))
    for line in sys.stdin:
        time.sleep(float(line))
        at = time.monotonic()
        test.XTestFakeKeyEvent(display, code, 1, ctypes.c_ulong(0))
        x.XFlush(display)
        test.XTestFakeKeyEvent(display, code, 0, ctypes.c_ulong(0))
        x.XFlush(display)
        print(repr(at), flush=True)


class Injector:
    """The injecting process as the session sees it."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, __file__, "--inject"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def press_after(self, delay_s: float) -> None:
        """Press a key that much later."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{delay_s!r}\n")
        self.process.stdin.flush()

    def pressed_at(self) -> float:
        """When the latest one was pressed."""
        assert self.process.stdout is not None
        return float(self.process.stdout.readline())

    def close(self) -> None:
        """End it."""
        self.process.communicate()


class Done(Exception):  # noqa: N818
    """The session is over; nobody presses a key on its last page."""


class Timed:
    """A store that compares each answer with what was injected, on the window's clock."""

    def __init__(self, window: Any, injector: Injector) -> None:
        self.window, self.injector = window, injector
        self.errors_ms: list[float] = []
        self.shown: list[Any] = []

    def begin(self) -> None:
        """Nothing to begin."""

    def form(self, values: Any) -> None:
        """No form."""

    def event(self, kind: str, detail: Any = None) -> None:
        """Ends the session where it ends."""
        del detail
        if kind == "finished":
            raise Done

    def answer(self, answer: Any, shown: Any) -> None:
        """The error of one answer."""
        zero = self.window.now() - time.monotonic()
        last = shown[-1].detail
        last_frame_s = last["onset_s"] + last["at_ms"][-1] / 1000
        truth_s = self.injector.pressed_at() + zero - last_frame_s
        self.errors_ms.append((answer.response_s - truth_s) * 1000)
        self.shown += shown


def measure(trials: int, full_screen: bool) -> dict[str, Any]:
    """A session of so many trials."""
    from renderer.window import open_window
    from study.apps.play_commands import page_look
    from study.apps.player.loop import play
    from study.experiment.plan import draw_plan
    from study.experiment.protocol import parse_protocol
    from study.experiment.session import open_session
    from study.experiment.stimuli import prepare
    from study.motion.library import open_library

    protocol = parse_protocol(PROTOCOL.replace("{trials}", str(trials)))
    stimuli = prepare(protocol, open_library("synthetic"))
    plan = draw_plan(protocol, stimuli.pairs, "bench")
    rng = np.random.default_rng(1)
    injector = Injector()
    with open_window("timing", full_screen=full_screen) as window:
        store = Timed(window, injector)
        paint = window.paint

        def paint_and_inject(picture: Any, background: Any) -> None:
            paint(picture, background)
            injector.press_after(float(rng.uniform(0.15, 0.45)))

        window.paint = paint_and_inject  # type: ignore[method-assign]
        session = open_session(protocol, plan)
        with suppress(Done):
            play(window, session, stimuli.stimulus, store, page_look(stimuli, None))
        display = window.describe()
    injector.close()
    return {**summary(store), "display": display}


def summary(store: Timed) -> dict[str, Any]:
    """Errors of reaction times and of flips, in milliseconds."""
    errors = np.array(store.errors_ms)
    onsets = [np.diff([*one.detail["at_ms"], one.detail["ended_ms"]]) for one in store.shown]
    holds = np.concatenate(onsets)
    return {
        "trials": len(errors),
        "reaction_time_error_ms": {
            "mean": round(float(errors.mean()), 3),
            "sd": round(float(errors.std()), 3),
            "median": round(float(np.median(errors)), 3),
            "p95": round(float(np.quantile(np.abs(errors), 0.95)), 3),
            "p99": round(float(np.quantile(np.abs(errors), 0.99)), 3),
            "largest": round(float(np.abs(errors).max()), 3),
        },
        "frame_hold_ms": {
            "wanted": round(1000 / 30, 3),
            "mean": round(float(holds.mean()), 3),
            "sd": round(float(holds.std()), 3),
            "largest": round(float(holds.max()), 3),
        },
        "flips": sum(one.detail["flips"] for one in store.shown),
        "dropped_flips": sum(one.detail["dropped_flips"] for one in store.shown),
        "shown_badly": sum(not one.shown_well for one in store.shown),
        "stimuli": len(store.shown),
    }


def main() -> None:
    """Run it and print JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--windowed", action="store_true")
    parser.add_argument("--inject", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.inject:
        inject()
    else:
        print(json.dumps(measure(arguments.trials, not arguments.windowed), indent=2))


if __name__ == "__main__":
    main()
