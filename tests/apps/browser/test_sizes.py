"""How large films are shown in a real browser: as the protocol states, in whole pixels of the screen, and on record."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from devtools import Tab
from serving import Site
from walking import SHORT, press, to_films, to_question

from study.experiment.store.tables import events, presentations

pytestmark = pytest.mark.gl

WIDE = SHORT.replace("width = 160\nheight = 120", "width = 640\nheight = 360")
PLACE = """(() => { const r = document.querySelector('.stage').getBoundingClientRect(), d = window.devicePixelRatio;
  return [r.x * d, r.y * d, r.width * d, r.height * d, window.innerWidth * d, window.innerHeight * d]; })()"""


def on_screen(tab: Tab, screen: tuple[int, int], ratio: float, bars: int = 130) -> None:
    """A screen of that many pixels of the page, whose browser and desktop take some of the height."""
    width, height = screen
    tab.call(
        "Emulation.setDeviceMetricsOverride",
        width=width, height=height - bars, deviceScaleFactor=ratio, mobile=False,
        screenWidth=width, screenHeight=height,
    )  # fmt: skip


def recorded(site: Site) -> dict[str, Any]:
    """What is stored of the first presentation, once it is."""
    end = time.monotonic() + 20
    while time.monotonic() < end:
        with site.responses.engine.connect() as connection:
            found = connection.execute(sa.select(presentations.c.detail_json)).scalars().first()
        if found is not None:
            return dict(json.loads(found))
        time.sleep(0.05)
    raise AssertionError("no presentation was stored")


@pytest.mark.parametrize(
    ("screen", "ratio", "share"),
    [((1920, 1080), 1.0, 0.7), ((1366, 768), 1.0, 0.7), ((1536, 864), 1.25, 0.7), ((1440, 900), 2.0, 0.5)],
    ids=["full HD", "laptop", "full HD at 125%", "dense"],
)
def test_films_are_shown_as_high_as_stated_from_pixel_to_pixel(
    make_site: Callable[..., Site],
    make_tab: Callable[..., Tab],
    screen: tuple[int, int],
    ratio: float,
    share: float,
    tmp_path: Path,
) -> None:
    site = make_site(WIDE.replace("[timing]", f"[screen]\nheight_share = {share}\n\n[timing]"))
    tab = make_tab()
    on_screen(tab, screen, ratio)
    tab.open(site.address)
    to_films(tab)
    left, top, width, height, room_wide, room_high = tab.run(PLACE)
    tab.picture(tmp_path / "film.png")
    wanted = share * screen[1] * ratio
    assert height == pytest.approx(wanted, abs=2)
    assert width == pytest.approx(wanted * 640 / 360, abs=3)
    for pixels in (left, top, width, height):
        assert pixels == pytest.approx(round(pixels), abs=0.03)  # browsers lay out in 1/64
    assert left + width / 2 == pytest.approx(room_wide / 2, abs=1)
    assert top + height / 2 == pytest.approx(room_high / 2, abs=1)
    to_question(tab)
    press(tab)
    shown = recorded(site)
    assert (shown["width_px"], shown["height_px"]) == (round(width), round(height))
    assert shown["height_css"] == pytest.approx(height / ratio, abs=0.01)
    assert shown["screen_height_px"] == round(screen[1] * ratio)
    assert shown["height_degrees"] is None
    assert shown["px_per_cm"] is None


def test_a_film_that_does_not_fit_is_as_large_as_fits(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab]
) -> None:
    site = make_site(WIDE.replace("[timing]", "[screen]\nheight_share = 1.0\n\n[timing]"))
    tab = make_tab()
    on_screen(tab, (1366, 768), 1.0)
    tab.open(site.address)
    to_films(tab)
    _, top, width, height, room_wide, room_high = tab.run(PLACE)
    assert top >= 0
    assert height <= room_high
    assert width <= room_wide
    assert height == pytest.approx(min(room_high, room_wide * 360 / 640), abs=2)


def to_card(tab: Tab, site: Site, slider: int) -> None:
    on_screen(tab, (1920, 1080), 1.0)
    tab.open(site.address)
    tab.wait("document.querySelector('.card') !== null")
    tab.run(
        f"(() => {{ const s = document.querySelector('input[type=range]'); s.value = {slider};"
        " s.dispatchEvent(new Event('input')); })()"
    )


def test_degrees_follow_from_a_bank_card_and_the_stated_distance(
    make_site: Callable[..., Site], make_tab: Callable[..., Tab], tmp_path: Path
) -> None:
    """A card 85.60 mm wide that takes 323 pixels: 37.73 pixels a centimetre (a screen of 96 dots an inch)."""
    site = make_site(WIDE.replace("[timing]", "[screen]\nheight_degrees = 15.0\ndistance_cm = 60\n\n[timing]"))
    tab = make_tab()
    to_card(tab, site, 323)
    card = tab.run("(() => { const r = document.querySelector('.card').getBoundingClientRect();"
                   " return [r.width, r.height]; })()")  # fmt: skip
    assert card[0] / card[1] == pytest.approx(85.60 / 53.98, abs=0.01)
    assert "60 cm" in tab.text()
    tab.picture(tmp_path / "card.png")
    tab.click("Continue")
    to_films(tab)
    height = tab.run(PLACE)[3]
    assert height == pytest.approx(2 * 60 * math.tan(math.radians(7.5)) * 323 / 8.56, abs=2)
    to_question(tab)
    press(tab)
    shown = recorded(site)
    assert shown["px_per_cm"] == pytest.approx(323 / 8.56, abs=0.001)
    assert shown["height_degrees"] == pytest.approx(15.0, abs=0.05)
    assert shown["distance_cm"] == 60
    with site.responses.engine.connect() as connection:
        (told,) = connection.execute(
            sa.select(events.c.detail_json).where(events.c.kind == "screen-measured")
        ).scalars()
    assert json.loads(told)["px_per_cm"] == pytest.approx(323 / 8.56, abs=0.001)
    # A page that is loaded again does not ask again.
    tab.reload()
    to_films(tab)
    assert tab.run(PLACE)[3] == height


def test_a_distance_can_be_typed(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> None:
    site = make_site(WIDE.replace("[timing]", '[screen]\nheight_degrees = 10.0\nask_distance = "typed"\n\n[timing]'))
    tab = make_tab()
    to_card(tab, site, 323)
    tab.click("Continue")
    tab.wait("document.querySelector('main input[type=number]') !== null")
    tab.click("Continue")  # nothing was typed: asked again
    tab.wait("document.querySelector('main input[aria-invalid=true]') !== null")
    tab.run("document.querySelector('main input[type=number]').value = '55'")
    tab.click("Continue")
    to_films(tab)
    assert tab.run(PLACE)[3] == pytest.approx(2 * 55 * math.tan(math.radians(5)) * 323 / 8.56, abs=2)


def test_a_distance_is_found_by_the_blind_spot(make_site: Callable[..., Site], make_tab: Callable[..., Tab]) -> None:
    """The dot disappears 13.5 degrees from the square: pressed at a known place, the distance follows."""
    site = make_site(
        WIDE.replace("[timing]", '[screen]\nheight_degrees = 10.0\nask_distance = "blind-spot"\n\n[timing]')
    )
    tab = make_tab()
    to_card(tab, site, 323)
    tab.click("Continue")
    tab.wait_text("right eye")
    tab.click("Continue")
    aside = []
    for _ in range(5):
        tab.wait("document.querySelector('.dot')?.offsetLeft < document.querySelector('.fixation')?.offsetLeft - 100")
        aside.append(
            tab.run(
                "(() => { const [a, b] = ['.fixation', '.dot'].map((one) => document.querySelector(one).offsetLeft);"
                " document.dispatchEvent(new KeyboardEvent('keydown', { key: ' ', cancelable: true }));"
                " return a - b; })()"
            )
        )
    to_films(tab)
    distance = sum(aside) / 5 / (323 / 8.56) / math.tan(math.radians(13.5))
    to_question(tab)
    press(tab)
    assert recorded(site)["distance_cm"] == pytest.approx(distance, abs=0.5)
