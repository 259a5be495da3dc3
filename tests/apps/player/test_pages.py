"""Pages: where buttons are, which one a key or click means, and that texts fit and can be read."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from renderer.events import Click, Key
from study.apps.player.lettering import default_font
from study.apps.player.pages import POINTS, Button, Look, Page, changed, chosen
from study.apps.player.sheet import draw_page
from study.errors import SessionError

LIGHT = Look((222, 223, 225), (default_font(),))
DARK = Look((20, 22, 26), (default_font(),))
TWO = (Button("same", "Same", "s", "S"), Button("different", "Different", "d", "D"))
ASK = Page(question="Were the two motions the same or different?", buttons=TWO)


@pytest.mark.parametrize("size", [(640, 480), (1280, 800), (1920, 1080), (3840, 2160), (600, 1000)])
def test_buttons_lie_apart_inside_the_window_in_the_same_place_for_every_size(size: tuple[int, int]) -> None:
    (a, top, b, bottom), (c, _, d, _) = draw_page(ASK, size, LIGHT).boxes
    assert 0 < a < b < c < d < size[0]
    assert 0.4 * size[1] < top < bottom < 0.75 * size[1]
    assert (a + d) / 2 == pytest.approx(size[0] / 2)
    assert b - a == pytest.approx(d - c)


def test_a_click_on_a_button_means_it_and_beside_it_nothing() -> None:
    drawn = draw_page(ASK, (1280, 800), LIGHT)
    left, top, right, bottom = drawn.boxes[1]
    assert drawn.clicked((left + right) / 2, (top + bottom) / 2) == TWO[1]
    for x, y in ((left - 1, top + 5), (right + 1, top + 5), (left + 5, top - 1), (left + 5, bottom + 1), (0, 0)):
        assert drawn.clicked(x, y) is None


def test_keys_mean_their_buttons_and_enter_the_chosen_one() -> None:
    drawn = draw_page(ASK, (640, 480), LIGHT)
    assert drawn.pressed("s") == TWO[0]
    assert drawn.pressed("enter") is None
    assert drawn.pressed("x") is None
    assert drawn.pressed("") is None
    chosen = draw_page(replace(ASK, chosen=1), (640, 480), LIGHT)
    assert chosen.pressed("enter") == TWO[1]


def test_arrow_keys_go_round() -> None:
    page = ASK
    for key, at in (("right", 0), ("right", 1), ("right", 0), ("left", 1)):
        page = changed(draw_page(page, (640, 480), LIGHT), Key(key, 0.0)) or page
        assert page.chosen == at
    assert changed(draw_page(page, (640, 480), LIGHT), Key("up", 0.0)) is None
    assert changed(draw_page(Page("Nothing to choose."), (640, 480), LIGHT), Key("left", 0.0)) is None
    last = changed(draw_page(ASK, (640, 480), LIGHT), Key("left", 0.0))
    assert last is not None
    assert last.chosen == 1


def ink(rgb: np.ndarray, ground: tuple[int, int, int]) -> np.ndarray:
    return np.abs(rgb.astype(int) - np.array(ground)).max(axis=2)


@pytest.mark.parametrize("look", [LIGHT, DARK], ids=["light", "dark"])
def test_text_stands_out_from_the_ground_which_is_that_of_the_stimuli(look: Look) -> None:
    rgb = draw_page(replace(ASK, progress=(3, 40), progress_words="3 of 40 done"), (1280, 800), look).rgb
    assert tuple(rgb[3, 3]) == look.ground
    distance = ink(rgb, look.ground)
    assert distance.max() > 150  # a contrast of 10 and more between text and ground
    assert 0.005 < (distance > 100).mean() < 0.1


def test_a_scale_of_eleven_points_is_one_row_with_its_words_at_the_ends() -> None:
    points = tuple(Button(str(i), str(i), str(i) if i < 10 else "") for i in range(11))
    page = Page(question="How natural was it?", buttons=points, style=POINTS, low="not at all", high="very")
    for size in ((640, 480), (1280, 800)):
        boxes = draw_page(page, size, LIGHT).boxes
        assert len({top for _, top, _, _ in boxes}) == 1
        assert boxes[0][0] > 0
        assert boxes[-1][2] < size[0]
        assert all(one[2] < other[0] for one, other in pairwise(boxes))


def test_short_words_are_as_wide_as_long_ones_and_no_scale() -> None:
    short = replace(ASK, buttons=(Button("same", "同じ", "s", "S"), Button("different", "違う", "d", "D")))
    assert draw_page(short, (1280, 800), LIGHT).boxes == draw_page(ASK, (1280, 800), LIGHT).boxes


def test_words_for_the_middle_of_a_scale_stand_under_its_middle() -> None:
    points = tuple(Button(str(i), str(i), str(i)) for i in range(5))
    bare = Page(question="How was it?", buttons=points, style=POINTS, low="worse", high="very much better indeed")
    drawn = [draw_page(page, (1280, 800), LIGHT) for page in (bare, replace(bare, middle="the same"))]
    middle = drawn[1].boxes[2]
    across, below = (middle[0] + middle[2]) / 2, middle[3]
    found = [np.argwhere(ink(one.rgb, LIGHT.ground)[round(below) + 2 :, :] > 60) for one in drawn]
    added = {tuple(place) for place in found[1]} - {tuple(place) for place in found[0]}
    columns = sorted(column for _, column in added if abs(column - across) < 60)
    assert columns[0] + columns[-1] == pytest.approx(2 * across, abs=8)
    assert columns[-1] - columns[0] > 40


def test_many_long_choices_take_several_rows() -> None:
    choices = tuple(Button(f"c{i}", f"a rather long choice, number {i}", str(i), str(i)) for i in range(1, 7))
    boxes = draw_page(Page(question="Which?", buttons=choices), (1000, 700), LIGHT).boxes
    assert len({top for _, top, _, _ in boxes}) == 6  # one below another, all alike
    assert len({(left, right) for left, _, right, _ in boxes}) == 1
    assert all(0 < left < right < 1000 and 0 < top < bottom < 700 for left, top, right, bottom in boxes)


def test_long_texts_are_set_smaller_and_longer_ones_refused() -> None:
    long = Page("Words that go on and on. " * 60, buttons=TWO)
    drawn = draw_page(long, (1280, 800), LIGHT, must_fit=True)
    assert drawn.boxes[0][3] < 800
    with pytest.raises(
        SessionError, match=r"fits on one page of 1280 x 800 pixels, found one that is too long, 'Words"
    ):
        draw_page(Page("Words that go on and on. " * 400, buttons=TWO), (1280, 800), LIGHT, must_fit=True)


def test_a_tiny_window_still_gets_a_page() -> None:
    assert draw_page(Page("Words that go on and on. " * 400, buttons=TWO), (1, 1), LIGHT).rgb.shape == (240, 320, 3)


def test_paragraphs_letters_of_other_scripts_and_words_without_spaces() -> None:
    text = "Größe, ещё раз, ναι.\n\n" + "a" * 300
    drawn = draw_page(Page(text, buttons=TWO), (800, 600), LIGHT)
    distance = ink(drawn.rgb, LIGHT.ground)
    columns = np.flatnonzero((distance > 60).any(axis=0))
    assert columns[0] > 20
    assert columns[-1] < 780  # the long word was cut, not pushed out


def test_what_is_typed_is_shown() -> None:
    empty = draw_page(Page(question="Age?", entry="", buttons=TWO[:1]), (640, 480), LIGHT)
    typed = draw_page(Page(question="Age?", entry="34", buttons=TWO[:1]), (640, 480), LIGHT)
    assert (empty.rgb != typed.rgb).any()
    assert empty.boxes == typed.boxes


def test_a_font_that_is_none_is_refused(tmp_path: Path) -> None:
    broken = tmp_path / "font.ttf"
    broken.write_text("no font")
    with pytest.raises(SessionError, match=r"Expected a font file at .*font.ttf"):
        draw_page(ASK, (640, 480), Look((0, 0, 0), (broken,)))


def test_a_way_back_stands_in_the_corner_and_is_reached_by_key_mouse_and_arrows() -> None:
    page = replace(ASK, back=Button("back", "Back", "up", "↑"))
    drawn = draw_page(page, (1280, 800), LIGHT)
    left, top, right, bottom = drawn.boxes[2]
    assert 0 < left < right < 300
    assert 700 < top < bottom < 800
    assert drawn.boxes[:2] == draw_page(ASK, (1280, 800), LIGHT).boxes  # it moves nothing
    assert drawn.pressed("up") == page.back == drawn.clicked(left + 5, top + 5)
    last = changed(draw_page(page, (640, 480), LIGHT), Key("left", 0.0))
    assert last is not None
    assert draw_page(last, (640, 480), LIGHT).pressed("enter") == page.back


def test_the_space_bar_takes_what_the_arrow_keys_stand_on_but_is_a_letter_in_a_field() -> None:
    assert draw_page(replace(ASK, chosen=1), (640, 480), LIGHT).pressed("space") == TWO[1]
    field = Page(question="Remarks?", entry="a", buttons=(Button("go-on", "Continue", "enter", "Enter"),), chosen=0)
    assert draw_page(field, (640, 480), LIGHT).pressed("space") is None


def test_enter_takes_the_only_button_and_what_the_space_bar_takes() -> None:
    go_on, example = Button("go-on", "Continue", "space", "Space"), Button("example", "Example", "e", "E")
    for buttons in ((go_on,), (go_on, example), (Button("go-on", "Continue"),)):
        assert draw_page(Page("Read.", buttons=buttons), (640, 480), LIGHT).pressed("enter") == buttons[0]
    assert draw_page(ASK, (640, 480), LIGHT).pressed("enter") is None


def test_questions_have_lines_of_like_length() -> None:
    long = replace(
        ASK, question="Which of the two motions that you have just seen was more natural, the first or the last?"
    )
    rgb = draw_page(long, (1000, 800), LIGHT).rgb
    dark = ink(rgb, LIGHT.ground) > 100
    (_, top, _, _), _ = draw_page(long, (1000, 800), LIGHT).boxes
    rows = np.flatnonzero(dark[: int(top) - 5].any(axis=1))
    middle = rows[np.argmax(np.diff(rows))] + 1
    widths = [np.ptp(np.flatnonzero(part.any(axis=0))) for part in (dark[:middle], dark[middle : int(top) - 5])]
    assert min(widths) > 0.75 * max(widths)


SCALE = Page(question="How natural?", buttons=(Button("go-on", "Continue", "space", "Space"),), sliders=(None, None))


def pressed(page: Page, *keys: str) -> Page:
    for key in keys:
        page = changed(draw_page(page, (640, 480), LIGHT), Key(key, 0.0)) or page
    return page


def test_sliders_go_from_0_to_100_by_keys_and_the_button_counts_once_all_were_moved() -> None:
    page = pressed(SCALE, "7", "right", "right")
    assert page.sliders == (72, None)
    assert chosen(draw_page(page, (640, 480), LIGHT), Key("space", 0.0)) is None
    page = pressed(page, "tab", "0", "left")
    assert page.sliders == (72, 0)
    button = chosen(draw_page(page, (640, 480), LIGHT), Key("space", 0.0))
    assert button is not None
    assert button.name == "72 0"
    assert pressed(page, "down", "9", *["right"] * 12).sliders == (100, 0)


def test_a_click_on_a_slider_sets_it_where_it_is_clicked() -> None:
    for size in ((1280, 800), (640, 480)):
        drawn = draw_page(SCALE, size, LIGHT)
        (left, _, right, _), (_, top, _, bottom) = drawn.tracks
        for value in (0, 25, 100):
            at = left + value / 100 * (right - left)
            page = changed(drawn, Click(at, (top + bottom) / 2, 0.0))
            assert page is not None
            assert page.sliders == (None, value)
        assert changed(drawn, Click(left, bottom + 40, 0.0)) is None


def test_ticks_are_drawn_where_they_are_asked_for() -> None:
    plain, ticked = (draw_page(replace(SCALE, ticks=ticks), (1280, 800), LIGHT) for ticks in (False, True))
    left, top, right, bottom = (round(edge) for edge in ticked.tracks[0])
    at = [left + round(tick / 10 * (right - left)) for tick in range(1, 10)]
    row = round(top + 0.35 * (bottom - top))
    for drawn, there in ((plain, False), (ticked, True)):
        dark = ink(drawn.rgb, LIGHT.ground)[row]
        assert all((dark[x - 2 : x + 3].max() > 40) == there for x in at)
