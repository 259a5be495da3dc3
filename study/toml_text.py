"""TOML: the text of a file that a person wrote comes in; its data goes out, or a refusal of what no such file needs.

Limits on size, depth and numbers are beyond what a person would write; without them, reading could take indefinitely
or end in an error of Python's own.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Sequence
from typing import Any

from study.errors import FileError

LARGEST_TEXT = 1_000_000
"""Letters of a file."""
_DEEPEST = 20
# More keys in a row than that, parted by points: the time to read them grows with the square of their number.
_KEY = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*"""
_DEEP_KEY = re.compile(rf"(?:^|[\[{{,])[ \t]*(?:{_KEY}){{200}}", re.MULTILINE)


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """The data of a text; `where` is the file's name, for messages.

    Raises
    ------
    FileError
        Where it is no TOML, or longer than `LARGEST_TEXT`, deeper than 20 keys, or of numbers beyond 64 bits.
    """
    too_deep = f"{where}: expected keys and lists at most {_DEEPEST} deep, found deeper ones; remove them."
    if len(text) > LARGEST_TEXT:
        raise FileError(f"{where}: expected at most {LARGEST_TEXT:,} letters, found more; shorten it.")
    if _DEEP_KEY.search(text):
        raise FileError(too_deep)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"{where}: expected TOML, found a mistake: {error}. Mend that line.") from error
    except RecursionError:
        raise FileError(too_deep) from None
    except ValueError as error:  # Python's own limit for whole numbers, or a date that does not exist
        raise FileError(f"{where}: expected TOML, found a number or a date out of range ({error}).") from error
    parts: list[tuple[Any, tuple[int | str, ...]]] = [(data, ())]
    while parts:
        part, location = parts.pop()
        if len(location) > _DEEPEST:
            raise FileError(too_deep)
        if isinstance(part, int) and not -(2**63) <= part < 2**63:
            raise FileError(f"{where}: {key_path(location)}: expected a whole number of at most 64 bits, found more.")
        inner = part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ()
        parts += [(value, (*location, key)) for key, value in inner]
    return data


def key_path(location: Sequence[int | str]) -> str:
    """A place in the data as people write it: `studies[0].task`."""
    path = ""
    for step in location:
        if isinstance(step, int):
            path += f"[{step}]"
        else:
            path += ("." if path else "") + (step if len(step) <= 80 else f"{step[:77]}...")
    return path


def quoted(text: str) -> str:
    """A text as a TOML basic string."""
    return json.dumps(text, ensure_ascii=False)
