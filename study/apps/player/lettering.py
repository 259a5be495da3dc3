"""Lettering: which fonts have the letters of a study's texts, and where lines end, in scripts with and without spaces.

Texts come in; a row of fonts goes out, DejaVu Sans first (it comes with matplotlib and has Latin, Greek, Cyrillic and
Arabic letters), then such fonts of this computer as have what it lacks. Where none has, that is refused before a
session starts: nobody is shown boxes. Lines of scripts that run to the left, and letters that join, need raqm.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from study.errors import SessionError

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont

Fonts = tuple[Path, ...]
RGB = tuple[int, int, int]

_NOT_AT_START = set("、。，．・：；？！）」』】〕〉》］｝’”ー々…‥ぁぃぅぇぉっゃゅょゎァィゥェォッャュョヮ!?),.:;]}%")
_NOT_AT_END = set("（「『【〔〈《［｛‘“([{")
_EAST_ASIAN = {"CJK", "HIRAGANA", "KATAKANA", "KATAKANA-HIRAGANA", "HANGUL", "IDEOGRAPHIC", "FULLWIDTH"}
_JOINING = {
    "ARABIC", "HEBREW", "SYRIAC", "THAANA", "NKO", "DEVANAGARI", "BENGALI", "GURMUKHI", "GUJARATI", "ORIYA", "TAMIL",
    "TELUGU", "KANNADA", "MALAYALAM", "SINHALA", "TIBETAN", "MYANMAR", "KHMER", "MONGOLIAN",
}  # fmt: skip
# Of two fonts that have the letters, the plainer one: words in file names that speak against it.
_LESS_PLAIN = ("bold", "italic", "oblique", "mono", "serif", "condensed", "narrow", "black", "light", "thin")


def default_font() -> Path:
    """DejaVu Sans, out of matplotlib."""
    import matplotlib

    return Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"


def fonts_for(texts: Iterable[str], own: Path | None = None) -> Fonts:
    """The fonts that have every letter of the texts: one's own first, where there is one.

    Raises
    ------
    SessionError
        For a font that can't be read, for letters that no font of this computer has, and for scripts that need raqm
        where it is missing.
    """
    wanted = {letter for text in texts for letter in text if _visible(letter)}
    fonts = [default_font()] if own is None else [own, default_font()]
    _check_joining(wanted)
    missing = wanted - set().union(*(letters_of(font) for font in fonts))
    for font in _system_fonts() if missing else ():
        found = missing & _letters_or_none(font)
        if found:
            fonts.append(font)
            missing -= found
        if not missing:
            break
    if missing:
        _refuse(missing)
    return tuple(fonts)


@lru_cache(maxsize=4096)
def _visible(letter: str) -> bool:
    return not letter.isspace() and unicodedata.category(letter) not in ("Cc", "Cf", "Mn", "Me")


def _check_joining(wanted: set[str]) -> None:
    from PIL import features

    scripts = sorted(_JOINING & {_script(letter) for letter in wanted})
    if scripts and not features.check_feature("raqm"):
        raise SessionError(
            f"Expected Pillow with raqm and FriBiDi to set {_names(scripts)} letters, found one without; install "
            "FriBiDi (Debian, Ubuntu: apt install libfribidi0)."
        )


def _refuse(missing: set[str]) -> None:
    scripts = sorted({_script(letter) for letter in missing})
    shown = "".join(sorted(missing)[:12])
    package = "fonts-noto-cjk" if _EAST_ASIAN & set(scripts) else "fonts-noto-core"
    raise SessionError(
        f"Expected fonts with all letters of the protocol's texts, found none on this computer with {_names(scripts)} "
        f"letters ({shown}{'' if len(missing) <= 12 else ' ...'}); install such a font (Debian, Ubuntu: apt install "
        f"{package}), or name one with --font."
    )


@lru_cache(maxsize=4096)
def _script(letter: str) -> str:
    return unicodedata.name(letter, "UNKNOWN").split()[0]


def _names(scripts: Sequence[str]) -> str:
    return ", ".join(script if script == "CJK" else script.capitalize() for script in scripts)


@lru_cache(maxsize=256)
def letters_of(font: Path) -> frozenset[str]:
    """The letters that a font has."""
    from matplotlib.ft2font import FT2Font

    try:
        return frozenset(map(chr, FT2Font(str(font)).get_charmap()))
    except (OSError, RuntimeError) as error:
        raise SessionError(f"Expected a font file at {font}, found none that can be read; name another.") from error


def _letters_or_none(font: Path) -> frozenset[str]:
    """A font of the system that can't be read has no letters."""
    try:
        return letters_of(font)
    except SessionError:
        return frozenset()


def _system_fonts() -> list[Path]:
    """Fonts of this computer, the plainest first."""
    from matplotlib.font_manager import findSystemFonts

    def order(font: Path) -> tuple[int, str]:
        name = font.stem.lower()
        # "Sans" takes back what is no blemish: "NotoSansMono" stays one, "NotoSans" is none.
        return sum(word in name for word in _LESS_PLAIN) - ("sans" in name), name

    # Apple's font of last resort has a box for every letter that there is.
    fonts = (Path(font) for font in findSystemFonts() if "lastresort" not in font.lower())
    return sorted(fonts, key=order)


@lru_cache(maxsize=128)
def _loaded(path: Path, pixels: int) -> FreeTypeFont:
    from PIL import ImageFont

    try:
        return ImageFont.truetype(str(path), pixels)
    except OSError as error:
        raise SessionError(f"Expected a font file at {path}, found none that can be read; name another.") from error


class Face:
    """Fonts at one size, as if they were one: each letter from the first of them that has it."""

    def __init__(self, fonts: Fonts, pixels: int) -> None:
        self._fonts, self._pixels = fonts, pixels

    def getlength(self, text: str) -> float:
        """How wide a line is, pixels."""
        return sum(_loaded(font, self._pixels).getlength(part) for font, part in self._runs(text))

    def draw(self, pen: ImageDraw, place: tuple[float, float], text: str, fill: RGB, anchor: str = "m") -> None:
        """Draw a line at the height of its middle; `anchor` says whether its left end, middle or right end is there."""
        x, y = place
        x -= {"l": 0.0, "m": 0.5, "r": 1.0}[anchor] * self.getlength(text)
        ascent, descent = _loaded(self._fonts[0], self._pixels).getmetrics()
        direction = "rtl" if leftwards(text) else None
        for font, part in self._runs(text):
            loaded = _loaded(font, self._pixels)
            pen.text((x, y + (ascent - descent) / 2), part, font=loaded, fill=fill, anchor="ls", direction=direction)
            x += loaded.getlength(part)

    def _runs(self, text: str) -> list[tuple[Path, str]]:
        """Parts of a line by font; letters that join stay together wherever one font has the whole line."""
        if any(_script(letter) in _JOINING for letter in text):
            whole = (font for font in self._fonts if all(c in letters_of(font) for c in text if _visible(c)))
            if (font := next(whole, None)) is not None:
                return [(font, text)]
        runs: list[tuple[Path, str]] = []
        for letter in text:
            has = (font for font in self._fonts if letter in letters_of(font))
            font = runs[-1][0] if runs and not _visible(letter) else next(has, self._fonts[0])
            if runs and runs[-1][0] == font:
                runs[-1] = font, runs[-1][1] + letter
            else:
                runs.append((font, letter))
        return runs


def leftwards(text: str) -> bool:
    """Whether a text runs from the right to the left: its first letter with a direction says so."""
    ways = (unicodedata.bidirectional(letter) for letter in text)
    return next((way for way in ways if way in ("L", "R", "AL")), "L") != "L"


def wrapped(text: str, face: Face, limit: float) -> list[str]:
    """Lines no wider than `limit` pixels; single line ends join words, empty lines part paragraphs."""
    lines: list[str] = []
    for paragraph in text.strip().split("\n\n"):
        if not paragraph.strip():
            continue
        if lines:
            lines.append("")
        lines += _filled(list(_pieces(paragraph)), face, limit)
    return lines


def balanced(text: str, face: Face, limit: float) -> list[str]:
    """A few lines to stand in the middle: as even as can be, so that no last word stands alone."""
    lines = wrapped(text, face, limit)
    low, high = limit / max(1, len(lines)), limit
    while len(lines) > 1 and high - low > 1.0:
        middle = (low + high) / 2
        if len(wrapped(text, face, middle)) > len(lines):
            low = middle
        else:
            high = middle
    return wrapped(text, face, high)


def _filled(pieces: Sequence[str], face: Face, limit: float) -> list[str]:
    lines = [""]
    for whole in pieces:
        for piece in _cut(whole, face, limit):
            longer = lines[-1] + piece
            if lines[-1] and face.getlength(longer.rstrip()) > limit:
                lines.append(piece)
            else:
                lines[-1] = longer
    return [line.rstrip() for line in lines]


def _pieces(paragraph: str) -> Iterator[str]:
    """Where a line may end: after spaces (which belong to the word before), and between letters that are words."""
    words = paragraph.split()
    spaces = [not (_wide(a[-1]) and _wide(b[0])) for a, b in pairwise(words)]
    for word, space in zip(words, [*spaces, False], strict=True):
        start = 0
        for i in range(1, len(word)):
            before, after = word[i - 1], word[i]
            if (_wide(before) or _wide(after)) and after not in _NOT_AT_START and before not in _NOT_AT_END:
                yield word[start:i]
                start = i
        yield word[start:] + (" " if space else "")


def _wide(letter: str) -> bool:
    return unicodedata.east_asian_width(letter) in ("W", "F")


def _cut(piece: str, face: Face, limit: float) -> Iterator[str]:
    """A word, cut where it is wider than a line, such as an address."""
    while face.getlength(piece.rstrip()) > limit and len(piece) > 1:
        cut = max(1, int(len(piece) * limit / face.getlength(piece)))
        while cut > 1 and face.getlength(piece[:cut]) > limit:
            cut -= 1
        yield piece[:cut]
        piece = piece[cut:]
    yield piece
