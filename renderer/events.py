"""Events: what people do to a window, each with the time at which it arrived, in seconds of the window's clock."""

from __future__ import annotations

from dataclasses import dataclass

Size = tuple[int, int]


@dataclass(frozen=True)
class Key:
    """A key went down: a letter or digit as it is printed on the key, or `space`, `enter`, `escape`, `left`, ..."""

    name: str
    time_s: float


@dataclass(frozen=True)
class Typed:
    """A character was typed; for text fields. It comes besides its `Key`."""

    character: str
    time_s: float


@dataclass(frozen=True)
class Click:
    """The left mouse button went down; place in pixels of the picture from the top left corner."""

    x: float
    y: float
    time_s: float


@dataclass(frozen=True)
class Focus:
    """The window got the keyboard, or lost it."""

    focused: bool
    time_s: float


@dataclass(frozen=True)
class Resized:
    """The picture has another size, in pixels, or was damaged: what it shows must be drawn again."""

    size: Size
    time_s: float


@dataclass(frozen=True)
class CloseAsked:
    """Somebody asked the window to close; it stays until it is closed."""

    time_s: float


Event = Key | Typed | Click | Focus | Resized | CloseAsked


_NAMED_KEYS = {
    32: "space", 256: "escape", 257: "enter", 335: "enter", 258: "tab", 259: "backspace",
    262: "right", 263: "left", 264: "down", 265: "up",
}  # fmt: skip
"""glfw's numbers of the keys that have no character; they are part of its interface."""


def key_name(token: int, printed: str | None) -> str:
    """A key's name: of letters the one that is printed on it in this layout, of digits the digit in every layout.

    Parameters
    ----------
    token
        glfw's number, which is the key's character on a US keyboard.
    printed
        What the keyboard's layout says that the key gives; None where it gives no character.
    """
    if token in _NAMED_KEYS:
        return _NAMED_KEYS[token]
    if 48 <= token <= 57:
        return chr(token)
    if 320 <= token <= 329:  # the digits of the keypad
        return str(token - 320)
    if printed and len(printed) == 1 and printed.isprintable():
        return printed.lower()
    return chr(token).lower() if 32 < token < 127 else f"key-{token}"
