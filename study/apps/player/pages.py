"""Pages: what a participant reads and can choose, and which button a key or a click means. `sheet` draws them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from renderer.events import Click, Event, Key
from renderer.screen import Shares
from study.apps.player.lettering import Fonts

FILM = 0.74
"""Share of a cell's height that is the film's; its slider has the rest."""

AGAIN = "again"
"""The button that plays films again."""

RGB = tuple[int, int, int]
Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Button:
    """Something to choose: what it is called here, what stands on it, the key that does the same, and the key's name.

    A button without a key is chosen with the arrow keys and Enter, or with the mouse.
    """

    name: str
    words: str
    key: str = ""
    key_words: str = ""


@dataclass(frozen=True)
class ButtonStyle:
    """How the buttons of a page look; lengths in heights of the text."""

    least: float
    """The least width of a button."""
    margin: float
    """What is left of a button beside its words, on both sides together."""
    gap: float
    gap_of_many: float
    """What is left between buttons, and where there are ten or more."""
    one_row: bool
    """Whether they stand in one row however narrow that makes them, not one below another where the row is too long."""


WORDS = ButtonStyle(least=7.0, margin=2.0, gap=1.6, gap_of_many=1.6, one_row=False)
POINTS = ButtonStyle(least=2.6, margin=1.2, gap=0.7, gap_of_many=0.4, one_row=True)


@dataclass(frozen=True)
class Page:
    """One thing to read or to decide."""

    text: str = ""
    """Paragraphs; empty lines part them."""
    question: str = ""
    """What is asked, set larger, under the text."""
    buttons: tuple[Button, ...] = ()
    """From left to right."""
    style: ButtonStyle = WORDS
    """How the buttons look: words to choose from, or the points of a scale."""
    low: str = ""
    middle: str = ""
    high: str = ""
    """Words at the ends and in the middle of a row of buttons that is a scale."""
    note: str = ""
    """A few words at the top, such as that this is practice."""
    progress: tuple[int, int] | None = None
    """What is done and how much there is; None for no bar."""
    progress_words: str = ""
    """That in words, over the bar."""
    entry: str | None = None
    """What was typed so far into a field; None where there is none."""
    hint: str = ""
    """Small print under the field or the question."""
    cells: tuple[Shares, ...] = ()
    """Where films stand that are shown at once, which stay while the question is asked; with sliders each has its own
    under it."""
    sliders: tuple[int | None, ...] = ()
    """Where sliders of 0 to 100 stand, None for one that was not moved; with them the buttons count once all were."""
    slider: int = 0
    """Which of them the keys move."""
    ticks: bool = False
    """Whether they have ticks."""
    chosen: int = -1
    """Which button the arrow keys stand on; -1 for none."""
    back: Button | None = None
    """A small button in the corner that leads to the page before; None where there is no way back."""

    @property
    def choices(self) -> tuple[Button, ...]:
        """All buttons, the one that leads back last."""
        return self.buttons if self.back is None else (*self.buttons, self.back)


@dataclass(frozen=True)
class Look:
    """Colours and fonts of all pages. The ground is the stimuli's own background, so that nothing flashes."""

    ground: RGB
    fonts: Fonts

    @property
    def dark(self) -> bool:
        """Whether the ground is dark, so that text is light."""
        red, green, blue = self.ground
        return 0.2126 * red + 0.7152 * green + 0.0722 * blue < 128

    def mix(self, share: float) -> RGB:
        """From the ground (0) to the ink (1)."""
        ink = 245 if self.dark else 24
        red, green, blue = (round(ground + share * (ink - ground)) for ground in self.ground)
        return red, green, blue

    @property
    def raised(self) -> RGB:
        """Of buttons and fields: lighter than the ground, whichever that is."""
        if self.dark:
            return self.mix(0.14)
        red, green, blue = (round(value + 0.6 * (255 - value)) for value in self.ground)
        return red, green, blue


@dataclass(frozen=True, eq=False)
class DrawnPage:
    """A page's picture `(height, width, 3)`, and where its choices are: left, top, right, bottom in pixels."""

    page: Page
    rgb: NDArray[np.uint8]
    boxes: tuple[Box, ...]
    tracks: tuple[Box, ...] = ()
    """Where sliders can be clicked; their ends are 0 and 100."""

    def clicked(self, x: float, y: float) -> Button | None:
        """The button at a place."""
        for button, (left, top, right, bottom) in zip(self.page.choices, self.boxes, strict=True):
            if left <= x < right and top <= y < bottom:
                return button
        return None

    def pressed(self, key: str) -> Button | None:
        """The button of a key. Enter and the space bar take the one that the arrow keys stand on.

        Where they stand on none, Enter does what the space bar does, and takes the only button of a page.
        """
        page = self.page
        if page.chosen >= 0 and (key == "enter" or (key == "space" and page.entry is None)):
            return page.choices[page.chosen]
        named = next((button for button in page.choices if button.key and button.key == key), None)
        if named is None and key == "enter":
            named = next((button for button in page.buttons if button.key == "space"), None)
            if named is None and len(page.buttons) == 1:
                named = page.buttons[0]
        return named


def chosen(drawn: DrawnPage, event: Event) -> Button | None:
    """The button that a key or a click means; of sliders that were all moved, one that is called as they stand."""
    if isinstance(event, Key):
        button = drawn.pressed(event.name)
    else:
        button = drawn.clicked(event.x, event.y) if isinstance(event, Click) else None
    if button is None or button.name == AGAIN or not drawn.page.sliders:
        return button
    values = [str(value) for value in drawn.page.sliders if value is not None]
    return replace(button, name=" ".join(values)) if len(values) == len(drawn.page.sliders) else None


def changed(drawn: DrawnPage, event: Event) -> Page | None:
    """The page after a key or a click that moves something on it; None where nothing moves."""
    if drawn.page.sliders:
        return _slid(drawn, event)
    count, page = len(drawn.page.choices), drawn.page
    if not isinstance(event, Key) or event.name not in ("left", "right") or not count:
        return None
    if page.chosen < 0:
        return replace(page, chosen=0 if event.name == "right" else count - 1)
    return replace(page, chosen=(page.chosen + (1 if event.name == "right" else -1)) % count)


def _slid(drawn: DrawnPage, event: Event) -> Page | None:
    """A click sets a slider; arrow keys move it by 1, digits set it to that many tens, the tabulator takes the next."""
    page, at = drawn.page, drawn.page.slider
    if isinstance(event, Click):
        for number, (left, top, right, bottom) in enumerate(drawn.tracks):
            if top <= event.y < bottom and left - (bottom - top) <= event.x <= right + (bottom - top):
                return _set(page, number, round(100 * (event.x - left) / (right - left)))
    if not isinstance(event, Key):
        return None
    if event.name in ("tab", "down", "up"):
        return replace(page, slider=(at + (-1 if event.name == "up" else 1)) % len(page.sliders))
    if event.name.isdigit():
        return _set(page, at, 10 * int(event.name))
    if event.name in ("left", "right"):
        value = page.sliders[at]
        return _set(page, at, 50 if value is None else value + (1 if event.name == "right" else -1))
    return None


def _set(page: Page, number: int, value: int) -> Page:
    sliders = [*page.sliders[:number], min(max(value, 0), 100), *page.sliders[number + 1 :]]
    return replace(page, sliders=tuple(sliders), slider=number)


def cells_of(count: int) -> tuple[Shares, ...]:
    """Where so many films stand that are shown at once: up to three in a row, with room for a slider under each."""
    columns = count if count <= 3 else -(-count // 2)
    wide, high = 0.94 / columns, 0.65 / -(-count // columns)
    places = [(0.03 + wide * (at % columns), 0.125 + high * (at // columns)) for at in range(count)]
    return tuple((left + 0.005, top, left + wide - 0.005, top + FILM * high) for left, top in places)
