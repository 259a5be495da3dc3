"""How exact reaction times are in a browser: `python benchmarks/browser_keys.py [--keys 120] [--browser firefox]`.

A real browser without a window walks through a session of pairs. At a random moment after each question a key is
injected at a known time, and compared with the key's time in the stored record (`presentations.detail_json`). What is
measured includes the way of the injected key into the browser; the keyboard's own delay is not in it. A reaction time
is a difference of two such times, so a constant delay matters little, and the standard deviation is the error.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import statistics
import sys
import tempfile
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "apps"), str(ROOT / "tests" / "apps" / "browser")]

PROTOCOL = """
name = "keys"
title = "Keys"
seed = 1
fps = 30
[stimuli]
width = 160
height = 120
entry_s = 0.1
exit_s = 0.1
[timing]
gap_s = 0.05
pause_s = 0.05
answer_s = 5.0
[points]
shortest_frames = 4
longest_frames = 8
[[transitions]]
name = "walk_run"
category = "walking"
source = "walk"
destination = "jog"
[[studies]]
name = "jnd"
task = "same-different"
differences_frames = [0, 1]
repeats = {repeats}
order = "both"
question = "Same?"
"""


@contextmanager
def started(name: str, folder: Path) -> Any:
    """A tab of a browser."""
    executable = shutil.which({"chromium": "chromium", "firefox": "firefox-esr"}[name])
    if executable is None:
        raise SystemExit(f"Expected {name} on this machine, found none; on Debian, install chromium or firefox-esr.")
    if name == "chromium":
        from devtools import chromium as start
    else:
        from bidi import firefox as start
    with start(executable, folder) as browser:
        yield browser.tab()


def inject(site: Any, tab: Any, keys: int) -> list[float]:
    """The times at which keys were injected, one for each question, in seconds since 1970."""
    from walking import KEPT, QUESTION

    chance = random.Random(1)
    injected = []
    tab.open(site.address)
    while len(injected) < keys:
        tab.wait(QUESTION, every=0.01)
        time.sleep(chance.uniform(0.1, 0.4))
        injected.append(time.time())
        tab.key(chance.choice("sd"))
        tab.wait(f"!({QUESTION}) && !({KEPT})", every=0.01)
    return injected


def recorded(site: Any) -> list[float]:
    """The times of the keys as they were stored, in the order of the answers."""
    from walking import details

    rows = [row["detail"] for row in details(site) if row["place"] == "first"]
    return [(row["time_origin_ms"] + row["answer_ms"]) / 1000 for row in rows]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keys", type=int, default=120)
    parser.add_argument("--browser", choices=("chromium", "firefox"), default="chromium")
    parser.add_argument("--json", action="store_true")
    wanted = parser.parse_args()
    from serving import Site, prepared

    from study.experiment.stimuli.rendering import render

    text = PROTOCOL.format(repeats=(wanted.keys + 3) // 4)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        render(prepared(text), folder / "study", workers=1)
        site = Site(folder / "study", text)
        (folder / "profile").mkdir()
        try:
            with started(wanted.browser, folder / "profile") as tab:
                injected = inject(site, tab, wanted.keys)
                stored = recorded(site)
        finally:
            site.stop()
    errors = [1000 * (at - key) for at, key in zip(stored, injected, strict=True)]
    numbers = {
        "browser": wanted.browser,
        "keys": len(errors),
        "mean_ms": round(statistics.mean(errors), 3),
        "deviation_ms": round(statistics.stdev(errors), 3),
        "least_ms": round(min(errors), 3),
        "most_ms": round(max(errors), 3),
    }
    if wanted.json:
        print(json.dumps(numbers))
    else:
        print(
            "{keys} keys in {browser}: recorded minus injected {mean_ms} ms on average, standard deviation "
            "{deviation_ms} ms, from {least_ms} to {most_ms} ms".format(**numbers)
        )


if __name__ == "__main__":
    main()
