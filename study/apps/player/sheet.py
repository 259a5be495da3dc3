"""Sheet: a page as a picture.

A `Page` comes in, with the size of the window; an RGB picture and the places of its buttons go out. All sizes follow
from the window's, so a page looks the same on a laptop and on a large screen.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from study.apps.player.lettering import Face, balanced, leftwards, wrapped
from study.apps.player.pages import FILM, Box, Button, DrawnPage, Look, Page
from study.errors import SessionError

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw

SMALLEST = (320, 240)
"""The least size of window for which pages are drawn; in a smaller one they are cut off."""


def draw_page(page: Page, size: tuple[int, int], look: Look, *, must_fit: bool = False) -> DrawnPage:
    """Draw a page for a window of `size` pixels; text too long for it is set smaller, as far as it stays legible.

    Parameters
    ----------
    must_fit
        Refuse a text that does not fit even then, rather than cut it.

    Raises
    ------
    SessionError
        With `must_fit`, for a text that is too long; and for a font that can't be read.
    """
    from PIL import Image, ImageDraw

    width, height = size = max(size[0], SMALLEST[0]), max(size[1], SMALLEST[1])
    base = min(height / 27.0, width / 40.0)
    for shrink in np.arange(1.0, 0.45, -0.05):
        sheet = _Sheet(page, size, look, base, max(base * shrink, 6.0))
        if sheet.height <= height * 0.84:
            break
    if must_fit and sheet.height > height * 0.84:
        words = " ".join((page.text or page.question).split()[:8])
        raise SessionError(
            f"Expected a text that fits on one page of {width} x {height} pixels, found one that is too long, "
            f"'{words} ...'; shorten it, or part it."
        )
    image = Image.new("RGB", size, look.ground)
    boxes = sheet.draw(ImageDraw.Draw(image))
    return DrawnPage(page, np.asarray(image, dtype=np.uint8), tuple(boxes), tuple(sheet.tracks))


_ROW_GAP = 0.5
_TRACK = 2.0
"""Height of a slider, in ems."""


class _Part(NamedTuple):
    """What stands below another part of a page: the gap above it in ems, its height in pixels, and what draws it."""

    gap: float
    high: float
    draw: Callable[[ImageDraw, float], None]


class _Sheet:
    """A page at one size of text: measured first, then drawn from the top down, as blocks that stand in its middle."""

    def __init__(self, page: Page, size: tuple[int, int], look: Look, base: float, em: float) -> None:
        self.page, self.size, self.look, self.base, self.em = page, size, look, base, em
        column = min(size[0] * 0.86, base * 33)
        self.text = wrapped(page.text, self._font(1.0), column)
        if len(self.text) <= 2:
            self.text = balanced(page.text, self._font(1.0), column)
        self.question = balanced(page.question, self._font(1.3), column)
        self.entry = wrapped(page.entry or "", self._font(1.1), column)
        self.hint = balanced(page.hint, self._font(0.82), column)
        self.stacked = False
        self.rows = self._button_rows(size[0] * 0.92)
        self.parts = self._parts()
        gaps = sum(part.gap for part in self.parts[1:])
        self.height = 0.0 if page.cells else sum(part.high for part in self.parts) + em * gaps
        self.boxes: list[Box] = []
        self.tracks: list[Box] = []

    def _font(self, share: float) -> Face:
        return Face(self.look.fonts, max(6, round(self.em * share)))

    def _parts(self) -> list[_Part]:
        page, em = self.page, self.em
        parts: list[_Part] = []

        def lines(gap: float, words: Sequence[str], share: float, lead: float, ink: float) -> None:
            high = sum(lead * em if line else 0.5 * lead * em for line in words)
            parts.append(_Part(gap, high, lambda pen, top: self._lines(pen, words, top, share, lead, ink)))

        if self.text:
            lines(1.2, self.text, 1.0, 1.5, 0.92)
        if self.question:
            lines(1.4, self.question, 1.3, 1.9, 1.0)
        if page.entry is not None:
            parts.append(_Part(1.2, (1.2 + 1.2 * max(1, len(self.entry))) * em, self._draw_entry))
        if page.hint:
            lines(0.5, self.hint, 0.82, 1.25, 0.62)
        if page.sliders:
            parts.append(_Part(2.0, _TRACK * em * len(page.sliders), self._draw_sliders))
            parts.append(_Part(0.2, 1.2 * em, self._draw_ends))
        if self.rows:
            gap = _ROW_GAP * em
            parts.append(_Part(2.0, (self._button_height() + gap) * len(self.rows) - gap, self._draw_buttons))
        if (page.low or page.middle or page.high) and not page.sliders:
            parts.append(_Part(0.5, 1.2 * em, self._draw_ends))
        return parts

    def _button_height(self) -> float:
        if self.stacked:
            return self.em * 2.2
        return self.em * (3.4 if any(button.key_words for button in self.page.buttons) else 2.4)

    def _button_width(self, button: Button) -> float:
        style = self.page.style
        words = max(self._font(1.0).getlength(button.words), self._font(0.68).getlength(button.key_words) + self.em)
        return max(style.least * self.em, words + style.margin * self.em)

    def _button_rows(self, limit: float) -> list[list[tuple[int, float]]]:
        """Numbers and widths of the buttons, row by row: all as wide as the widest in one row, or one below another."""
        widths = [self._button_width(button) for button in self.page.buttons]
        gap, count = self._button_gap, len(widths)
        if not widths:
            return []
        if max(widths) * count + gap * (count - 1) <= limit:
            return [list(enumerate([max(widths)] * count))]
        if self.page.style.one_row:
            return [list(enumerate([(limit - gap * (count - 1)) / count] * count))]
        self.stacked = True
        # Beside the words, the key's cap.
        wide = min(limit, max(widths) + 2.2 * self.em)
        return [[(number, wide)] for number in range(count)]

    @property
    def _button_gap(self) -> float:
        style = self.page.style
        return self.em * (style.gap if len(self.page.buttons) < 10 else style.gap_of_many)

    # Drawing

    def draw(self, pen: ImageDraw) -> list[Box]:
        """Draw it all; returns the places of the buttons."""
        self._draw_note(pen)
        self._draw_progress(pen)
        if self.page.cells:
            self._draw_around_films(pen)
            return self.boxes
        top = max(self.size[1] * 0.08, (self.size[1] - self.height) * 0.46)
        for index, part in enumerate(self.parts):
            top += self.em * part.gap if index else 0.0
            part.draw(pen, top)
            top += part.high
        return [*self.boxes, self._draw_back(pen)] if self.page.back is not None else self.boxes

    def _middle(self, pen: ImageDraw, words: str, y: float, share: float, ink: float, x: float | None = None) -> None:
        place = (self.size[0] / 2 if x is None else x, y)
        self._font(share).draw(pen, place, words, self.look.mix(ink))

    def _lines(self, pen: ImageDraw, lines: Sequence[str], top: float, share: float, lead: float, ink: float) -> None:
        """Paragraphs of several lines are set from a common left edge, short ones in the middle."""
        font = self._font(share)
        widest = max((font.getlength(line) for line in lines), default=0.0)
        centred = len(lines) <= 2
        y = top
        for line in lines:
            if not line:
                y += 0.5 * lead * self.em
                continue
            at = y + 0.5 * lead * self.em
            if centred:
                self._middle(pen, line, at, share, ink)
            else:
                side, anchor = (1, "r") if leftwards(line) else (-1, "l")
                font.draw(pen, ((self.size[0] + side * widest) / 2, at), line, self.look.mix(ink), anchor)
            y += lead * self.em

    def _draw_buttons(self, pen: ImageDraw, top: float) -> None:
        high, gap = self._button_height(), self._button_gap
        for row in self.rows:
            left = (self.size[0] - sum(wide for _, wide in row) - gap * (len(row) - 1)) / 2
            for number, wide in row:
                self.boxes.append((left, top, left + wide, top + high))
                self._draw_button(pen, self.page.buttons[number], self.boxes[-1], number == self.page.chosen)
                left += wide + gap
            top += high + _ROW_GAP * self.em

    def _draw_button(self, pen: ImageDraw, button: Button, box: Box, chosen: bool) -> None:
        em, (left, top, right, bottom) = self.em, box
        pen.rounded_rectangle(
            box,
            radius=0.45 * em,
            fill=self.look.raised,
            outline=self.look.mix(0.95 if chosen else 0.38),
            width=max(1, round(em * (0.16 if chosen else 0.06))),
        )
        middle, y = (left + right) / 2, (top + bottom) / 2
        if not button.key_words:
            self._middle(pen, button.words, y, 1.0, 1.0, middle)
        elif self.stacked:
            half = self._cap_half(button.key_words)
            self._draw_cap(pen, button.key_words, left + half + 0.55 * em, y)
            self._font(1.0).draw(pen, (left + 2 * half + 1.1 * em, y), button.words, self.look.mix(1.0), "l")
        else:
            self._middle(pen, button.words, top + 1.3 * em, 1.0, 1.0, middle)
            self._draw_cap(pen, button.key_words, middle, top + 2.55 * em)

    def _cap_half(self, words: str) -> float:
        return max(0.75 * self.em, self._font(0.68).getlength(words) / 2 + 0.35 * self.em)

    def _draw_cap(self, pen: ImageDraw, words: str, x: float, y: float) -> None:
        """A key as it looks on a keyboard."""
        em, half = self.em, self._cap_half(words)
        cap = (x - half, y - 0.52 * em, x + half, y + 0.52 * em)
        pen.rounded_rectangle(cap, radius=0.2 * em, outline=self.look.mix(0.32), width=max(1, round(em * 0.05)))
        self._middle(pen, words, y, 0.68, 0.66, x)

    def _draw_ends(self, pen: ImageDraw, top: float) -> None:
        """Words under the ends and the middle of a scale."""
        over = self.tracks or self.boxes
        left, right = min(box[0] for box in over), max(box[2] for box in over)
        y, font, ink = top + 0.6 * self.em, self._font(0.85), self.look.mix(0.75)
        ends = [font.getlength(words) for words in (self.page.low, self.page.high)]
        wide = sum(ends) + 2 * self.em
        if self.page.middle:
            # The middle stands in the middle, however long the ends are.
            wide = 2 * max(ends) + font.getlength(self.page.middle) + 2 * self.em
        spread = max(0.0, (wide - (right - left)) / 2)
        font.draw(pen, (left - spread, y), self.page.low, ink, "l")
        font.draw(pen, (right + spread, y), self.page.high, ink, "r")
        font.draw(pen, ((left + right) / 2, y), self.page.middle, ink, "m")

    def _draw_around_films(self, pen: ImageDraw) -> None:
        """The question over films that are shown at once, a slider under each, and the buttons below."""
        (width, height), em, font = self.size, self.em, self._font(0.8)
        lead = 1.5 * em
        for number, words in enumerate(self.question):
            middle = 0.085 * height + (number - (len(self.question) - 1) / 2) * lead
            self._middle(pen, words, middle, 1.15, 1.0)
        cells = self.page.cells if self.page.sliders else ()
        for number, (left, top, right, bottom) in enumerate(cells):
            under = (bottom - top) * (1 / FILM - 1) * height
            y, from_x, to_x = bottom * height + 0.3 * under, left * width + 2 * em, right * width - 1.2 * em
            self._middle(pen, "ABCDEF"[number], y, 1.0, 0.9, left * width + 0.7 * em)
            self.tracks.append((from_x, y - 0.5 * em, to_x, y + 0.5 * em))
            value, stands = self.page.sliders[number], number == self.page.slider
            self._draw_slider(pen, self.tracks[-1], value, stands=stands)
            for x, words, anchor in ((from_x, self.page.low, "l"), (to_x, self.page.high, "r")):
                font.draw(pen, (x, y + 1.1 * em), words, self.look.mix(0.75), anchor)
        self.stacked = True  # the key's cap beside the words
        self.rows = [[(number, wide + 2.8 * em) for number, wide in row] for row in self.rows]
        self._draw_buttons(pen, 0.79 * height)

    def _draw_sliders(self, pen: ImageDraw, top: float) -> None:
        em, half = self.em, min(14 * self.em, 0.4 * self.size[0])
        left, right = self.size[0] / 2 - half, self.size[0] / 2 + half
        for number, value in enumerate(self.page.sliders):
            self.tracks.append((left, top + number * _TRACK * em, right, top + (number + 1) * _TRACK * em))
            self._draw_slider(pen, self.tracks[-1], value, stands=number == self.page.slider)

    def _draw_slider(self, pen: ImageDraw, track: Box, value: int | None, *, stands: bool) -> None:
        """A line with ticks, and a knob where it was moved to."""
        left, top, right, bottom = track
        em, y, wide = self.em, (top + bottom) / 2, max(1, round(self.em * 0.12))
        for tick in range(0, 101, 10) if self.page.ticks else ():
            x = left + tick / 100 * (right - left)
            pen.line((x, y - 0.4 * em, x, y + 0.4 * em), fill=self.look.mix(0.38), width=max(1, wide // 2))
        pen.line((left, y, right, y), fill=self.look.mix(0.6), width=wide)
        if value is not None:
            x, size = left + value / 100 * (right - left), (0.62 if stands else 0.5) * em
            pen.ellipse((x - size, y - size, x + size, y + size), fill=self.look.mix(0.9))

    def _draw_entry(self, pen: ImageDraw, top: float) -> None:
        em, middle = self.em, self.size[0] / 2
        font, lines = self._font(1.1), self.entry or [""]
        half = max(8 * em, max(map(font.getlength, lines)) / 2 + em)
        last = top + (1.2 * len(lines)) * em
        outline, width = self.look.mix(0.6), max(1, round(em * 0.08))
        box = (middle - half, top, middle + half, last + 1.2 * em)
        pen.rounded_rectangle(box, radius=0.3 * em, fill=self.look.raised, outline=outline, width=width)
        for number, words in enumerate(lines, start=1):
            self._middle(pen, words, top + 1.2 * number * em, 1.1, 1.0)
        x = middle + font.getlength(lines[-1]) / 2 + 0.12 * em
        pen.line((x, last - 0.6 * em, x, last + 0.6 * em), fill=self.look.mix(0.8), width=width)

    def _draw_note(self, pen: ImageDraw) -> None:
        if self.page.note:
            self._middle(
                pen, self.page.note, (0.9 if self.page.cells else 1.8) * self.base, 0.9 * self.base / self.em, 0.6
            )

    def _draw_back(self, pen: ImageDraw) -> Box:
        """The back button, small and in the corner, so that it is not mistaken for an answer."""
        assert self.page.back is not None, "asked for only where there is one"
        em, font, words = self.base, Face(self.look.fonts, max(6, round(0.8 * self.base))), self.page.back
        text = f"{words.key_words}  {words.words}"
        box = (1.2 * em, self.size[1] - 2.9 * em, 2.8 * em + font.getlength(text), self.size[1] - 1.2 * em)
        stands = self.page.chosen == len(self.page.buttons)
        outline, width = self.look.mix(0.95 if stands else 0.2), max(1, round(em * (0.12 if stands else 0.05)))
        pen.rounded_rectangle(box, radius=0.35 * em, outline=outline, width=width)
        font.draw(pen, ((box[0] + box[2]) / 2, (box[1] + box[3]) / 2), text, self.look.mix(0.7))
        return box

    def _draw_progress(self, pen: ImageDraw) -> None:
        if self.page.progress is None:
            return
        done, total = self.page.progress
        em, (width, height) = self.base, self.size
        half, y, high = min(10 * em, 0.3 * width), height - 2.0 * em, max(2.0, 0.22 * em)
        box = (width / 2 - half, y, width / 2 + half, y + high)
        pen.rounded_rectangle(box, radius=high / 2, fill=self.look.mix(0.13))
        if done:
            part = max(high, 2 * half * done / max(total, 1))
            pen.rounded_rectangle((box[0], y, box[0] + part, y + high), radius=high / 2, fill=self.look.mix(0.55))
        self._middle(pen, self.page.progress_words, y - 0.9 * em, 0.72 * em / self.em, 0.55)
