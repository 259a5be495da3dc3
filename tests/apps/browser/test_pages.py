"""What pages look and sound like: room on a laptop, contrast, colours, the keyboard alone, names for screen readers."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from devtools import Tab
from serving import Site
from walking import END, KEPT, LOOK, PATIENT, QUESTION, SHORT, answers, go_on, press, read_on, to_films, to_question

pytestmark = pytest.mark.gl

LAPTOP = (1366, 620)  # 1366 x 768 without the bars of a browser and a desktop

LONG = "\n\n".join(
    "We store your answers, how long they took, how the films were shown on your screen, and what you tell us about "
    "yourself, but not your name. The answers are used for research, in a form in which nobody can be recognised."
    for _ in range(6)
)

# WCAG 2.2, 1.4.3 and 1.4.11: 4.5 to 1 for text, 3 to 1 for what shows where a control is, written anew for the test.
CONTRASTS = """(() => {
  const rgb = (text) => text.match(/[0-9.]+/g).map(Number);
  const linear = (v) => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
  const light = ([r, g, b]) => 0.2126 * linear(r / 255) + 0.7152 * linear(g / 255) + 0.0722 * linear(b / 255);
  const ratio = (a, b) => {
    const [low, high] = [light(rgb(a)), light(rgb(b))].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
  };
  const behind = (one) => {
    for (let at = one; at; at = at.parentElement) {
      const colour = getComputedStyle(at).backgroundColor;
      if ((rgb(colour)[3] ?? 1) > 0) return colour;
    }
    return 'rgb(255, 255, 255)';
  };
  const own = (one) => [...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
  const found = [];
  for (const one of document.querySelectorAll('body *')) {
    const style = getComputedStyle(one);
    const seen = style.visibility !== 'hidden' && one.getClientRects().length;
    if (!seen || !own(one) || one.closest(':disabled, noscript, option')) continue;
    found.push([one.tagName + ' ' + one.textContent.trim().slice(0, 30), ratio(style.color, behind(one)), 4.5]);
  }
  for (const one of document.querySelectorAll('input, select, button.answer, button.quiet')) {
    found.push(['border of ' + one.tagName, ratio(getComputedStyle(one).borderTopColor, behind(one.parentElement)), 3]);
  }
  return found;
})()"""


def coloured(background: str) -> str:
    return PATIENT.replace("[timing]", f'[stimuli.colours]\nbackground = "{background}"\n\n[timing]')


@pytest.mark.parametrize(
    "background",
    ["#dedfe1", pytest.param("#18191c", marks=pytest.mark.slow), pytest.param("#808080", marks=pytest.mark.slow)],
    ids=["light", "dark", "grey"],
)
def test_every_page_is_legible_and_fits_a_laptop(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab], background: str
) -> None:
    site = make_site(
        coloured(background).replace("Do you take part?", LONG.replace("\n", "\\n")), completion_code="C0DE"
    )
    tab = make_tab()
    tab.size(*LAPTOP)
    tab.open(site.address)
    pale, scrolled, seen = [], [], set()
    while END not in tab.text():
        look = tab.run(LOOK)
        if look and look != "films":
            seen.add(look)
            pale += [(look, *one) for one in tab.run(CONTRASTS) if one[1] < one[2]]
            scrolled += tab.run(
                "document.documentElement.scrollHeight > window.innerHeight ? [document.body.innerText] : []"
            )
        if look == "question":
            press(tab)
        else:
            read_on(tab)
    pale += [("end", *one) for one in tab.run(CONTRASTS) if one[1] < one[2]]
    assert pale == []
    assert scrolled == []
    assert {"question", "form", "Continue"} < seen


def test_nothing_flashes_between_films_and_pages(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab], tmp_path: Path
) -> None:
    """The page has the films' own background, as the browser decodes it: no edge around a film, none in the gap."""
    from PIL import Image

    site, tab = make_site(SHORT.replace("gap_s = 0.1", "gap_s = 1.0")), make_tab()
    tab.open(site.address)
    corners = []
    for name in ("film", "gap", "question"):
        if name == "film":
            to_films(tab)
        elif name == "gap":
            tab.wait("document.querySelector('.stage video') && !document.querySelector('video.now')", every=0.005)
        else:
            to_question(tab)
        box = tab.run("(() => { const r = document.querySelector('.stage')?.getBoundingClientRect();"
                      " return r ? [r.x, r.y] : null; })()")  # fmt: skip
        tab.picture(tmp_path / f"{name}.png")
        picture = Image.open(tmp_path / f"{name}.png").convert("RGB")
        corners.append(picture.getpixel((2, 2)))
        if box:
            corners.append(picture.getpixel((int(box[0]) + 2, int(box[1]) + 2)))
    assert len(corners) == 5
    assert len(set(corners)) == 1


def test_a_frame_that_can_not_be_drawn_yet_leaves_the_pages_colour(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab]
) -> None:
    """As in a busy browser, where a film is ready before its first frame can be drawn."""
    site, tab = make_site(SHORT), make_tab()
    nothing = "CanvasRenderingContext2D.prototype.drawImage = () => { window.asked = true; };"
    tab.call("Page.addScriptToEvaluateOnNewDocument", source=nothing)
    tab.open(site.address)
    to_question(tab)
    assert tab.run("window.asked")
    stated = tab.run("fetch('api/study').then((found) => found.json()).then((study) => study.background)")
    red, green, blue = (int(stated[at : at + 2], 16) for at in (1, 3, 5))
    colour = tab.run("getComputedStyle(document.documentElement).getPropertyValue('--stage').trim()")
    assert colour == f"rgb({red}, {green}, {blue})"


def test_reduced_motion_is_told_of_and_hides_no_film(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab]
) -> None:
    site, tab = make_site(), make_tab()
    tab.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-reduced-motion", "value": "reduce"}])
    tab.open(site.address)
    tab.wait_text("asks for little motion")
    to_films_through(tab)
    assert tab.run("getComputedStyle(document.querySelector('video.now')).visibility") == "visible"


def to_films_through(tab: Any) -> None:
    while not tab.run("document.querySelector('video.now') !== null"):
        read_on(tab)


def as_tablet(tab: Any, width: int, height: int) -> None:
    tab.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=2, mobile=True)
    tab.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=5)


@pytest.mark.parametrize(
    ("width", "height"), [(820, 1180), (1180, 820), (390, 844)], ids=["portrait", "landscape", "phone"]
)
def test_touch_where_the_protocol_allows_it(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab], width: int, height: int
) -> None:
    site, tab = make_site(SHORT.replace("seed = 3", "seed = 3\ntouch = true")), make_tab()
    as_tablet(tab, width, height)
    tab.open(site.address)
    to_films(tab)
    x, y, right, bottom = tab.run(
        "(() => { const r = document.querySelector('video.now').getBoundingClientRect();"
        " return [r.x, r.y, r.right, r.bottom]; })()"
    )
    assert x >= 0
    assert y >= 0
    assert right <= width
    assert bottom <= height
    tab.wait(QUESTION)
    # Fingers need room (WCAG 2.5.8 asks for 24 pixels, both makers of tablets for 44 or more).
    sizes = tab.run("[...document.querySelectorAll('button.answer')].map((b) => [b.offsetWidth, b.offsetHeight])")
    assert min(min(size) for size in sizes) >= 44
    assert tab.run("document.documentElement.scrollWidth") == width
    place = tab.run("(() => { const r = document.querySelector('button.answer').getBoundingClientRect();"
                    " return { x: r.x + 9, y: r.y + 9 }; })()")  # fmt: skip
    tab.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[place])
    tab.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    tab.wait(f"!({QUESTION}) && !({KEPT})")
    assert answers(site)["answer"].iloc[0] == "same"


def test_touch_is_refused_politely_where_the_protocol_does_not_allow_it(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab]
) -> None:
    site, tab = make_site(SHORT.replace("seed = 3", "seed = 3\ntouch = false")), make_tab()
    as_tablet(tab, 820, 1180)
    tab.open(site.address)
    tab.wait_text("on a computer with a keyboard")
    assert tab.run("document.querySelectorAll('button').length") == 0
    assert site.host.live_sessions == {}


def spoken(tab: Any) -> set[Any]:
    """What a screen reader finds: role and name of all that has a name, and whether it is announced by itself."""
    nodes = tab.call("Accessibility.getFullAXTree")["nodes"]
    return {(node["role"]["value"], node.get("name", {}).get("value", "")) for node in nodes if not node.get("ignored")}


def test_the_keyboard_alone_leads_through_a_session(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab]
) -> None:
    """Tab reaches every control in the order in which it is read, and shows where it is; Enter and Space press."""
    site, tab = make_site(), make_tab()
    tab.open(site.address)
    tab.wait_text("Do you take part?")
    tab.key("Tab")
    assert tab.run("document.activeElement.innerText").startswith("I agree")
    assert tab.run("getComputedStyle(document.activeElement).outlineStyle") == "solid"
    tab.key("Tab")
    assert tab.run("document.activeElement.innerText").startswith("I do not")
    tab.call("Input.dispatchKeyEvent", type="keyDown", key="Tab", windowsVirtualKeyCode=9, modifiers=8)
    tab.key(" ")
    tab.wait("document.getElementById('field-age') !== null")
    assert {("spinbutton", "Your age"), ("textbox", "Anything else")} <= spoken(tab)
    tab.key("Tab")
    assert tab.run("document.activeElement.id") == "field-age"
    tab.key("7")
    tab.key("Enter")
    tab.wait("document.activeElement.getAttribute('aria-invalid') === 'true'")
    wrong = tab.run("document.getElementById(document.activeElement.getAttribute('aria-describedby')).innerText")
    assert wrong.startswith("Please check this.")
    tab.key("7")
    tab.key("Enter")
    for text in ("Thank you for taking part", "Say whether"):
        tab.wait_text(text)
        tab.key(" ")
    to_question(tab)
    assert tab.run("document.activeElement.innerText") == "Were they the same?"
    assert {("button", "Same key S"), ("button", "Different key D"), ("heading", "Were they the same?")} <= spoken(tab)
    tab.key("Tab")
    tab.key("Tab")
    assert tab.run("document.activeElement.innerText").startswith("Different")
    tab.key("Enter")
    tab.wait(f"!({QUESTION}) && !({KEPT})")
    # Progress and messages are announced without taking the focus.
    tab.wait("document.querySelector('main button') !== null")
    live = tab.run("[...document.querySelectorAll('[role=status]')].map((one) => one.id)")
    assert sorted(live) == ["progress", "status"]
    assert "0 of 10 done" in json.dumps(sorted(spoken(tab)))
    assert list(answers(site)["answer"]) == ["different"]


def test_an_address_at_which_nothing_can_be_shown_says_why(
    make_site: Callable[..., Any], make_tab: Callable[..., Any]
) -> None:
    site, tab = make_site(SHORT, preview=True, parameters=("trial",)), make_tab()
    tab.open(f"{site.address}/?trial=99")
    tab.wait_text("Expected a trial from 1 to 4, found 99.")
    tab.open(f"{site.address}/?trial=4")
    go_on(tab, True)
    assert list(answers(site).trial) == [4]
