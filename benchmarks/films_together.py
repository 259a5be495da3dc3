"""Six films at once in a browser: frames that are lost on our page beside six plain <video> elements in the same tab.

A real browser without a window walks through pages of six films of 30 frames a second (`parallel-rating`). After each
page's films the same files are played by six elements that nothing looks after, laid over the page at the same size,
and then by our page again, so that neither is always the first to decode them. Of all the browser's own count of
presented frames is taken, and counted alike; for ours, also how far the films ran apart.

    python benchmarks/films_together.py --pages 12
    python benchmarks/films_together.py --pages 12 --browser firefox
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "apps"), str(ROOT / "tests" / "apps" / "browser")]

PROTOCOL = """
name = "together"
title = "Together"
seed = 1
fps = 30
[stimuli]
width = 640
height = 480
entry_s = 1.0
exit_s = 1.0
[timing]
pause_s = 0.1
show_again = 0
[points]
shortest_frames = 4
longest_frames = 20
[[transitions]]
name = "walk_run"
category = "walking"
source = "walk"
destination = "jog"
[[studies]]
name = "page"
task = "parallel-rating"
reference = "geodesic"
comparison = "fixed"
others = ["cut", "inertialize", "dead-blend", "velocity"]
repeats = {pages}
replays = 1
instructions = ""
example = false
[[studies.items]]
name = "natural"
question = "How natural are these motions?"
"""

# Looked for seldom: to look costs the page time in which it shows films.
ASKED = "!!document.querySelector('.track input:not(:disabled)')"

PLAIN = """(async () => {
  const films = [...document.querySelectorAll('.film video')];
  const box = document.createElement('div');
  const over = { position: 'fixed', inset: 0, background: 'rgb(222, 223, 225)' };
  Object.assign(box.style, { ...over, display: 'flex', flexWrap: 'wrap' });
  const made = films.map((film) => {
    const one = document.createElement('video');
    Object.assign(one, { muted: true, preload: 'auto', src: film.src, width: film.clientWidth });
    box.append(one);
    return one;
  });
  document.body.append(box);
  const ready = (one) => new Promise((there) => one.addEventListener('canplaythrough', there, { once: true }));
  await Promise.all(made.map(ready));
  const { Frames } = await import(document.querySelector('script[type=module]').src.replace('main', 'playing'));
  const counts = made.map(() => new Frames({}, 30));
  await Promise.all(made.map((one, at) => new Promise((ended) => {
    const count = (_, data) => {
      counts[at].add(data);
      one.requestVideoFrameCallback(count);
    };
    one.requestVideoFrameCallback(count);
    one.addEventListener('ended', () => setTimeout(ended, 200), { once: true });
    one.play();
  })));
  box.remove();
  return counts.map((one) => one.presented);
})()"""


def walk(tab: Any, site: Any, pages: int) -> list[list[int]]:
    """Pages that are answered, with the frames that plain elements presented of each film."""
    from walking import slide

    tab.open(site.address)
    plain = []
    for page in range(pages):
        tab.wait(ASKED, timeout=120, every=0.5)
        plain.append(tab.run(PLAIN))
        print(f"page {page + 1} of {pages}", file=sys.stderr)
        tab.click("Play again (1)")
        tab.wait(f"document.body.innerText.includes('Play again (0)') && {ASKED}", timeout=120, every=0.5)
        slide(tab, 10, 25, 40, 55, 70, 85)
    tab.wait_text("That was all")
    return plain


def presented(site: Any) -> list[Any]:
    """How our page showed each film."""
    import sqlalchemy as sa

    from study.experiment.store.tables import presentations

    with site.responses.engine.connect() as connection:
        return list(connection.execute(sa.select(presentations).order_by(presentations.c.id)).mappings())


def measure(pages: int, browser: str) -> dict[str, Any]:
    """Frames lost by ours and by plain elements, page after page in turn."""
    from bidi import firefox
    from devtools import chromium
    from serving import Site, prepared

    from study.experiment.stimuli.rendering import render

    start, command = {"chromium": (chromium, "chromium"), "firefox": (firefox, "firefox-esr")}[browser]
    executable = shutil.which(command)
    if executable is None:
        sys.exit(f"Expected {command}, found none; install it.")
    text = PROTOCOL.format(pages=pages)
    with tempfile.TemporaryDirectory() as place, start(executable, Path(place) / "profile") as started:
        render(prepared(text), Path(place) / "study", workers=1)
        site = Site(Path(place) / "study", text)
        tab = started.tab()
        if browser == "chromium":
            tab.size(1366, 768)
        plain = np.array(walk(tab, site, pages))
        rows = presented(site)
        site.stop()
    expected = np.array([row["frames_expected"] for row in rows]).reshape(pages, 2, -1)
    ours = np.array([row["frames_presented"] for row in rows]).reshape(pages, 2, -1)
    lost = np.maximum(expected - ours, 0).sum(axis=(0, 2))
    apart = np.array([json.loads(row["detail_json"])["apart_frames"] for row in rows], dtype=float)
    return {
        "browser": browser,
        "pages": pages,
        "frames": int(expected[:, 0].sum()),
        "lost_ours_first": int(lost[0]),
        "lost_plain": int(np.maximum(expected[:, 0] - plain, 0).sum()),
        "lost_ours_again": int(lost[1]),
        "apart_frames": {f"{share}%": float(np.percentile(apart, share)) for share in (50, 95, 100)},
    }


def main() -> None:
    """Print one JSON object."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pages", type=int, default=12)
    parser.add_argument("--browser", choices=("chromium", "firefox"), default="chromium")
    options = parser.parse_args()
    print(json.dumps(measure(options.pages, options.browser), indent=2))


if __name__ == "__main__":
    main()
