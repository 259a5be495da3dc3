"""Fonts for all letters of a study or a refusal that names what is missing; where lines end in other scripts."""

from __future__ import annotations

import unicodedata
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageDraw, features

from study.apps.cli.play import page_look
from study.apps.player import lettering
from study.apps.player.lettering import Face, balanced, default_font, fonts_for, leftwards, letters_of, wrapped
from study.errors import SessionError
from study.experiment.session import open_session

# A letter that DejaVu Sans has not, and a font beside it, which matplotlib brings along, that has it.
STIX = default_font().parent / "STIXGeneral.ttf"
STRANGE = min(c for c in letters_of(STIX) - letters_of(default_font()) if unicodedata.category(c) == "So")
FACE = Face((default_font(),), 20)


def none_installed(monkeypatch: pytest.MonkeyPatch, *fonts: Path) -> None:
    monkeypatch.setattr(lettering, "_system_fonts", lambda: list(fonts))


def test_latin_greek_cyrillic_and_arabic_letters_need_no_other_font(monkeypatch: pytest.MonkeyPatch) -> None:
    none_installed(monkeypatch)
    texts = ["Größe, déjà vu", "ναι", "ещё раз", "“…” ↑ –"]
    if features.check_feature("raqm"):
        texts.append("هل كانت")
    assert fonts_for(texts) == (default_font(),)


def test_what_is_missing_is_sought_among_the_fonts_of_the_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    none_installed(monkeypatch, default_font(), STIX)
    assert fonts_for([f"a {STRANGE}"]) == (default_font(), STIX)


def test_ones_own_font_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    none_installed(monkeypatch)
    assert fonts_for(["abc"], STIX) == (STIX, default_font())


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("動きは", r"with CJK, Hiragana letters \(きは動\); install .*fonts-noto-cjk\), or name one with --font"),
        ("ሀለ", r"with Ethiopic letters \(ሀለ\); install .*fonts-noto-core"),
    ],
)
def test_letters_that_no_font_has_are_refused_by_name(monkeypatch: pytest.MonkeyPatch, text: str, match: str) -> None:
    none_installed(monkeypatch, default_font())
    with pytest.raises(SessionError, match=match):
        fonts_for(["plain", text])


def test_scripts_that_join_are_refused_where_nothing_joins_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(features, "check_feature", lambda _: False)
    with pytest.raises(SessionError, match=r"raqm and FriBiDi to set Arabic letters"):
        fonts_for(["هل كانت"])


def picture(face: Face, text: str) -> np.ndarray:
    image = Image.new("RGB", (400, 60), "white")
    face.draw(ImageDraw.Draw(image), (10, 30), text, (0, 0, 0), "l")
    return np.asarray(image)


def test_a_line_of_two_fonts_has_each_letter_from_the_one_that_has_it_and_no_box() -> None:
    both, one = Face((default_font(), STIX), 30), Face((default_font(),), 30)
    text = f"ab{STRANGE}cd"
    box = picture(one, text)
    right = picture(both, text)
    assert (box != right).any()
    width = both.getlength("ab")
    assert np.array_equal(box[:, : int(10 + width) - 1], right[:, : int(10 + width) - 1])
    widths = [both.getlength("ab"), Face((STIX,), 30).getlength(STRANGE), both.getlength("cd")]
    assert both.getlength(text) == pytest.approx(sum(widths), abs=1)


def test_a_font_of_boxes_for_everything_is_no_font(monkeypatch: pytest.MonkeyPatch) -> None:
    """macOS and matplotlib have one, for what nothing else has."""
    from matplotlib import font_manager

    boxes = default_font().parent / "LastResortHE-Regular.ttf"
    monkeypatch.setattr(font_manager, "findSystemFonts", lambda: [str(boxes)])
    with pytest.raises(SessionError, match="with CJK letters"):
        fonts_for(["動"])


def test_lines_end_between_words_and_hold_what_fits() -> None:
    lines = wrapped("one two three four\nfive\n\nsix", FACE, FACE.getlength("one two three"))
    assert lines == ["one two three", "four five", "", "six"]


def test_japanese_lines_end_between_letters_but_never_begin_with_a_full_stop() -> None:
    text = "二つの動きは同じでしたか。異なっていましたか。"
    for letters in range(4, 12):
        lines = wrapped(text, FACE, FACE.getlength("二" * letters) + 0.5)
        assert "".join(lines) == text
        assert len(lines) > 1
        assert not any(line[0] in "。、" for line in lines)


def test_a_line_end_in_the_file_is_no_space_between_japanese_letters() -> None:
    assert wrapped("二つの\n動き and\nmore", FACE, 1000) == ["二つの動き and more"]


def test_a_word_that_is_wider_than_a_line_is_cut() -> None:
    lines = wrapped("a" * 60, FACE, FACE.getlength("a" * 25) + 0.5)
    assert lines == ["a" * 25, "a" * 25, "a" * 10]


def test_balanced_lines_are_no_more_than_before_and_more_even() -> None:
    text = "Which motion was more natural, the first or the second?"
    limit = FACE.getlength("Which motion was more natural, the first or the")
    plain, even = wrapped(text, FACE, limit), balanced(text, FACE, limit)
    assert len(plain) == len(even) == 2
    assert plain[1] == "second?"
    widths = [FACE.getlength(line) for line in even]
    assert min(widths) > 0.7 * max(widths)


def test_the_first_letter_with_a_direction_says_where_a_line_begins() -> None:
    assert leftwards("12 هل a")
    assert not leftwards("a هل")
    assert not leftwards("12 34")


def test_every_text_of_a_protocol_gets_its_letters(make_small: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    none_installed(monkeypatch, STIX)
    plain = make_small()
    assert page_look(plain.stimuli, open_session(plain.protocol, plan=plain.plan), None).fonts == (default_font(),)
    for old, new in (
        ("Same or different?", f"Same {STRANGE}?"),
        ('debrief = "', f'debrief = "{STRANGE}'),
        ("\n[texts]", f'\n[consent]\nagree = "Yes {STRANGE}"\n\n[texts]'),
    ):
        small = make_small("", (old, new))
        look = page_look(small.stimuli, open_session(small.protocol, plan=small.plan), None)
        assert look.fonts == (default_font(), STIX)
