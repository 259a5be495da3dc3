"""How true the times of the window are: injected keys against stored reaction times, and flips against their plan.

Runs real sessions (`study.apps.player.loop.play` in `renderer.window`) on the display that there is. Another process
injects a key through XTest at a random moment after each question came up, and notes the moment by the machine's
steady clock, which is glfw's clock too; the error is the stored reaction time less the injected one. What it leaves out
are the keyboard and the panel themselves, which only a photodiode and a button box can measure.

The peer is a process that does nothing but wait for the same keys on a connection of its own and note when each came:
it shows what the injection and the X server take by themselves, and what any program could do by arrival alone. The
player takes precedence over other processes where it may, as in `segue play`; the peer goes after it.
`--load 4` has four other processes compute meanwhile.

    xvfb-run -s "-screen 0 1280x800x24" python benchmarks/play.py --trials 200
"""

from __future__ import annotations

import argparse
import ctypes
import json
import multiprocessing
import os
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
    """The injecting process: for each line (a delay in seconds) presses and releases `s`; says when, and when at last.

    A keyboard does not wait for a processor, so this process goes before all others where the system allows it.
    """
    with suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
    x, test = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
    x.XOpenDisplay.restype = ctypes.c_void_p
    display = ctypes.c_void_p(x.XOpenDisplay(None))
    code = x.XKeysymToKeycode(display, ctypes.c_ulong(ord("s")))
    for line in sys.stdin:
        time.sleep(float(line))
        at = time.monotonic()
        test.XTestFakeKeyEvent(display, code, 1, ctypes.c_ulong(0))
        x.XSync(display, 0)
        taken = time.monotonic()
        test.XTestFakeKeyEvent(display, code, 0, ctypes.c_ulong(0))
        x.XFlush(display)
        print(at, taken, flush=True)


def listen(window: int) -> None:
    """The peer: prints when each key press on a window came."""
    x = ctypes.CDLL("libX11.so.6")
    x.XOpenDisplay.restype = ctypes.c_void_p
    display = ctypes.c_void_p(x.XOpenDisplay(None))
    x.XSelectInput(display, ctypes.c_ulong(window), ctypes.c_long(1))  # KeyPressMask
    event = (ctypes.c_long * 24)()
    kind = ctypes.cast(event, ctypes.POINTER(ctypes.c_int))
    x.XFlush(display)
    while True:
        x.XNextEvent(display, event)
        at = time.monotonic()
        if kind[0] == 2:  # KeyPress
            print(at, flush=True)


def compute() -> None:
    """A load on the machine."""
    while True:
        sum(range(100_000))


class Helper:
    """One of the two other processes: `--inject` or `--listen`."""

    def __init__(self, *arguments: str) -> None:
        command = [sys.executable, __file__, *arguments]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def press_after(self, delay_s: float) -> None:
        """Have the injector press a key that much later."""
        assert self.process.stdin is not None
        self.process.stdin.write(f"{delay_s!r}\n")
        self.process.stdin.flush()

    def times(self) -> np.ndarray:
        """End it; all times that it noted, a row each."""
        if "--listen" in self.process.args:  # type: ignore[operator]
            self.process.terminate()
        return np.array([line.split() for line in self.process.communicate()[0].splitlines()], dtype=float)


class Done(Exception):  # noqa: N818
    """The session is over; nobody presses a key on its last page."""


class Timed:
    """A store that keeps when each answer was given, by the machine's clock, and how its stimuli were shown."""

    def __init__(self, window: Any) -> None:
        self.window = window
        self.answered_s: list[float] = []
        self.missed = 0
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

    def answer(self, _: Any, answer: Any, shown: Any) -> None:
        """One answer; none where the key came before its question, on a machine that was too busy to show it."""
        self.shown += shown
        if answer.missed:
            self.missed += 1
            return
        last = shown[-1].detail
        last_frame_s = last["onset_s"] + last["at_ms"][-1] / 1000
        self.answered_s.append(last_frame_s + answer.response_s + time.monotonic() - self.window.now())


def measure(trials: int, full_screen: bool) -> dict[str, Any]:
    """A session of so many trials."""
    import glfw

    from renderer.window import open_window
    from study.apps.cli.play import page_look
    from study.apps.player.calm import take_precedence
    from study.apps.player.loop import play
    from study.experiment.plan import draw_plan
    from study.experiment.protocol.whole import parse_protocol
    from study.experiment.session import open_session
    from study.experiment.stimuli.prepare import prepare
    from study.motion.library import open_library

    protocol = parse_protocol(PROTOCOL.replace("{trials}", str(trials)))
    stimuli = prepare(protocol, open_library("synthetic"))
    plan = draw_plan(protocol, stimuli.pairs, "bench")
    rng = np.random.default_rng(1)
    injector = Helper("--inject")
    take_precedence()
    with open_window("timing", full_screen=full_screen) as window:
        peer = Helper("--listen", str(glfw.get_x11_window(glfw.get_current_context())))
        store = Timed(window)
        paint = window.paint

        def paint_and_inject(picture: Any, background: Any) -> None:
            paint(picture, background)
            injector.press_after(float(rng.uniform(0.15, 0.45)))

        window.paint = paint_and_inject  # type: ignore[method-assign]
        session = open_session(protocol, plan)
        with suppress(Done):
            play(window, session, stimuli.stimulus, store, page_look(stimuli, session, None))
        display = window.describe()
    injected_s, came_s = injector.times(), peer.times()
    keys = key_summary(np.array(store.answered_s), came_s[:, 0], injected_s)
    return {**keys, "keys_before_their_question": store.missed, **flip_summary(store.shown), "display": display}


def error_table(errors: np.ndarray) -> dict[str, float]:
    """Mean and spread with their signs; the rest of the size of errors."""
    size = np.abs(errors)
    values = {"mean": errors.mean(), "sd": errors.std(), "median": np.median(size)}
    values |= {"p95": np.quantile(size, 0.95), "p99": np.quantile(size, 0.99), "largest": size.max()}
    return {name: round(float(value), 3) for name, value in values.items()}


def key_summary(answered_s: np.ndarray, came_s: np.ndarray, injected_s: np.ndarray) -> dict[str, Any]:
    """Errors of reaction times in milliseconds, and the peer's for the same keys.

    Keys are injected so far apart that the nearest one is meant. `injection_ms` is how long it took until the X server
    had the key: errors can't be known better than that, and on a busy machine most of an error is this.
    """
    meant = np.abs(answered_s[:, None] - injected_s[:, 0]).argmin(axis=1)
    pressed, took = injected_s[meant, 0], np.diff(injected_s[meant], axis=1)[:, 0] * 1000
    heard = np.abs(pressed[:, None] - came_s).argmin(axis=1)
    ours, peers = (answered_s - pressed) * 1000, (came_s[heard] - pressed) * 1000
    session, peer = error_table(ours), error_table(peers)
    prompt = took <= 1.0
    return {
        "keys": len(ours),
        "reaction_time_error_ms": session,
        "peer_error_ms": peer,
        "ratio_to_peer": {name: round(session[name] / peer[name], 2) for name in session if name != "mean"},
        "injection_ms": error_table(took),
        "error_beyond_injection_ms": error_table(beyond(ours, took)),
        "peer_error_beyond_injection_ms": error_table(beyond(peers, took)),
        "within_1_ms": share(ours),
        "peer_within_1_ms": share(peers),
        "injected_within_1_ms": share(took),
        "within_1_ms_of_keys_injected_within_1_ms": share(ours[prompt]),
        "largest_error_of_keys_injected_within_1_ms": round(float(np.abs(ours[prompt]).max()), 3),
    }


def beyond(errors: np.ndarray, took: np.ndarray) -> np.ndarray:
    """How far a time lies outside the stretch in which the X server took the key: what the program itself adds."""
    return np.maximum(0.0, np.maximum(errors - took, -errors))


def share(errors: np.ndarray) -> float:
    """The share of errors that are 1 ms or less."""
    return round(float((np.abs(errors) <= 1.0).mean()), 4)


def flip_summary(shown: list[Any]) -> dict[str, Any]:
    """How long frames stood, in milliseconds, and what was dropped."""
    holds = np.concatenate([np.diff([*one.detail["at_ms"], one.detail["ended_ms"]]) for one in shown])
    return {
        "frame_hold_ms": {
            "wanted": round(1000 / 30, 3),
            "mean": round(float(holds.mean()), 3),
            "sd": round(float(holds.std()), 3),
            "largest": round(float(holds.max()), 3),
        },
        "flips": sum(one.detail["flips"] for one in shown),
        "dropped_flips": sum(one.detail["dropped_flips"] for one in shown),
        "shown_badly": sum(not one.shown_well for one in shown),
        "stimuli": len(shown),
    }


def main() -> None:
    """Run it and print JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--load", type=int, default=0, help="so many other processes compute meanwhile")
    parser.add_argument("--windowed", action="store_true")
    parser.add_argument("--inject", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--listen", type=int, default=0, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.inject:
        inject()
    elif arguments.listen:
        listen(arguments.listen)
    else:
        others = [multiprocessing.Process(target=compute, daemon=True) for _ in range(arguments.load)]
        for other in others:
            other.start()
        print(json.dumps(measure(arguments.trials, not arguments.windowed), indent=2))


if __name__ == "__main__":
    main()
