"""Walking through a session as a participant does, in any driven browser, and looking up what was recorded."""

from __future__ import annotations

import json
import time
from typing import Any

import pytest
import sqlalchemy as sa
from every import HEAD, track
from serving import PROTOCOL, Site

from study.experiment.store.frames import answers_frame
from study.experiment.store.tables import events, presentations

SHORT = """\
name = "short"
title = "Two of a kind"
fps = 30
seed = 3

[stimuli]
width = 160
height = 120
entry_s = 0.3
exit_s = 0.3

[timing]
gap_s = 0.1
pause_s = 0.1
answer_s = 20.0

[points]
shortest_frames = 4
longest_frames = 20

[[transitions]]
name = "walk_run"
category = "walking"
source = "walk"
destination = "jog"

[[studies]]
name = "jnd"
task = "same-different"
instructions = ""
reference = "geodesic"
differences_frames = [-2, 0]
order = "both"
question = "Were they the same?"
"""
"""Four trials and nothing else, for what is about one trial; a busy machine has time to answer."""

RATED = (
    SHORT[: SHORT.index("[[studies]]")]
    + """
[[studies]]
name = "rating"
task = "rating"
instructions = ""
reference = "geodesic"
comparison = "cut"
order = "random"

[[studies.items]]
name = "natural"
question = "How natural was it?"
low = "not at all"
high = "very"

[[studies.items]]
name = "noticeable"
question = "How noticeable was the passage?"
"""
)

TRACKS = HEAD + track("same-different", "staircase") + track("yes-no", "quest-plus")
"""Two studies whose trials follow from the answers."""

# For what happens when the time to answer is over.
HURRIED = SHORT.replace("answer_s = 20.0", "answer_s = 3.0")
PATIENT = PROTOCOL.replace("answer_s = 3.0", "answer_s = 20.0")

ROLES = ("trial", "practice", "check")
END = "That was all"
QUESTION = "document.querySelectorAll('button.answer:not(:disabled)').length > 0"

# Whether a message waits in the page's storage.
KEPT = "Object.keys(localStorage).some((name) => name.startsWith('segue-kept-'))"

# What is on the screen, as one word that changes with every step.
LOOK = """(() => {
  const main = document.getElementById('main');
  if (!main) return '';
  if (document.querySelector('button.answer:not(:disabled), .track input:not(:disabled)')) return 'question';
  if (document.querySelector('main form')) return 'form';
  const texts = [...document.querySelectorAll('main button, main a.button')].map((b) => b.innerText);
  if (main.innerText.includes('That was all')) return 'end';
  return texts.length ? texts.join('|') : 'films';
})()"""


def slide(tab: Any, *values: int) -> None:
    """Click the sliders of a page where they have these values, and go on."""
    for number, value in enumerate(values):
        where = tab.run(
            f"(() => {{ const r = document.querySelectorAll('.track input')[{number}].getBoundingClientRect();"
            f" return [r.x + 12 + (r.width - 24) * {value} / 100, r.y + r.height / 2]; }})()"
        )
        tab.click_at(*where)
    tab.click("Continue")
    tab.wait("!document.querySelector('.track input:not(:disabled)')", every=0.02)


def press(tab: Any, keys: bool = True, which: int = 0) -> bool:
    """Answer the question that is asked, by key or by button, and wait until it is gone; False where it was gone."""
    if sliders := tab.run("document.querySelectorAll('.track input:not(:disabled)').length"):
        slide(tab, *range(20, 100, 15)[:sliders])
        return True
    asked = tab.run(
        f"(() => {{ const b = document.querySelectorAll('button.answer:not(:disabled)')[{which}]; if (!b) return null;"
        " b.dataset.mark = 'x'; return [b.innerText.split('\\n')[0], b.getAttribute('aria-keyshortcuts')]; })()"
    )
    if asked is None:
        return False
    if keys:
        tab.key(asked[1])
    elif not tab.try_click(asked[0]):
        return False
    tab.wait("!document.querySelector('button.answer[data-mark]:not(:disabled)')", every=0.02)
    return True


def read_on(tab: Any, keys: bool = True, again: bool = True) -> None:
    """Pass a page that is read or filled in, whichever is there; one that offers to try again only with `again`."""
    seen = tab.run(LOOK)
    if seen == "form":
        tab.run("(() => { const age = document.getElementById('field-age'); if (age) age.value = '33'; })()")
    if seen.startswith("I agree"):
        tab.try_click("I agree")
    elif seen.startswith("Continue") and keys:
        tab.key("Enter")
    elif seen.startswith("Continue") or seen == "form":
        tab.try_click("Continue")
    elif again and seen.startswith(("Try again", "Go on here instead")):
        tab.try_click(seen)
    time.sleep(0.03)


def go_on(tab: Any, keys: bool = True, on_step: Any = lambda: None, at_most: int = 300) -> Any:
    """Walk to the end, whatever comes; the longest time from a look without a question to its answer, in seconds."""
    end = time.monotonic() + at_most
    slowest, unasked = 0.0, time.monotonic()
    while END not in tab.text():
        assert time.monotonic() < end, f"not at the end after {at_most} s: {tab.text()!r}"
        on_step()
        looked = time.monotonic()
        if tab.run(LOOK) == "question":
            press(tab, keys)
            slowest = max(slowest, time.monotonic() - unasked)
        else:
            unasked = looked
            read_on(tab, keys)
    return slowest


def reloading(tab: Any) -> Any:
    """For `go_on`: at each new question the page is loaded again, in turn just after it is answered and before."""
    seen = set()

    def reload() -> None:
        asked = tab.run("document.querySelector('h1.question')?.innerText")
        if tab.run(LOOK) == "question" and asked not in seen:
            seen.add(asked)
            if len(seen) % 2:
                press(tab)  # what is still on its way goes out again from the page's storage
            tab.reload()

    return reload


def eventually(happens: Any, at_most: int = 60) -> None:
    """Wait until something is so: what a page has sent may still be on its way to the server."""
    end = time.monotonic() + at_most
    while not happens():
        assert time.monotonic() < end, f"waited {at_most} s in vain"
        time.sleep(0.05)


def check_frames(shown: Any, fps: int = 30) -> None:
    """Every frame is accounted for, and in what counts as shown well they stand as far apart in time as in the film."""
    assert {row["method"] for row in shown} == {"requestVideoFrameCallback"}
    for row in shown:
        detail = json.loads(row["detail_json"])
        assert detail["frames"] == sorted(set(detail["frames"]))
        assert detail["times_ms"] == sorted(detail["times_ms"])
        if row["shown_well"]:
            assert row["frames_presented"] == row["frames_expected"]
            span = (detail["times_ms"][-1] - detail["times_ms"][1]) / 1000
            assert span == pytest.approx((detail["frames"][-1] - detail["frames"][1]) / fps, abs=0.1)
    # Whatever else the machine does, some films run as they should.
    assert any(row["shown_well"] for row in shown)


def to_question(tab: Any, number: int = 1) -> None:
    """Walk until a question is asked; or until the second, third, ... one is."""
    end = time.monotonic() + 60
    while number:
        assert time.monotonic() < end, tab.text()
        if tab.run(LOOK) != "question":
            read_on(tab)
        elif number > 1:
            number -= press(tab)
        else:
            return


def answers(site: Site, **more) -> Any:
    return answers_frame(site.responses, roles=ROLES, **more)


def to_films(tab: Any, place: int = 0) -> None:
    """Walk until a pair's first film plays, or its second."""
    tab.wait(f"[...document.querySelectorAll('.stage video')][{place}]?.classList.contains('now')", every=0.01)


def details(site: Site) -> list[Any]:
    """How each film was shown, in the order of showing."""
    with site.responses.engine.connect() as connection:
        rows = connection.execute(sa.select(presentations).order_by(presentations.c.id)).mappings().all()
    return [{**row, "detail": json.loads(row["detail_json"])} for row in rows]


def happened(site: Site, kind: str) -> list[Any]:
    with site.responses.engine.connect() as connection:
        rows = connection.execute(sa.select(events.c.detail_json).where(events.c.kind == kind)).scalars().all()
    return [json.loads(row) if row else {} for row in rows]
