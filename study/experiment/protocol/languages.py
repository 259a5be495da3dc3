"""Languages: the words that Segue has ready for participants, in the language that a protocol names.

A protocol's data comes in, as TOML gives it; the same with built-in words where it has none of its own goes out. Words
stand in `words/<language>.toml`; English buttons and other small words are the defaults of `protocol_parts`. A language
without a file gets English ones, which the protocol then replaces; `still_english` says which are left.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

FALLBACK = "en"
_FOLDER = Path(__file__).parent / "words"
_PARTS = ("consent", "texts")


def languages() -> tuple[str, ...]:
    """The languages that there are words in, such as `de`."""
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.toml")))


@lru_cache
def words(language: str) -> Mapping[str, Any]:
    """The words of a language: `standard` texts, questions of the `form`, and the `consent` and `texts` of a protocol.

    A language with a region, such as `pt-BR`, takes the words of the language where it has none of its own.
    """
    known = languages()
    own = next((tag for tag in (language, language.split("-")[0]) if tag in known), FALLBACK)
    return tomllib.loads((_FOLDER / f"{own}.toml").read_text(encoding="utf-8"))


def has_words(language: str) -> bool:
    """Whether there are words in a language."""
    return bool({language, language.split("-")[0]} & set(languages()))


def with_words(data: Mapping[str, Any]) -> dict[str, Any]:
    """A protocol's data with the words of its language where it has no own; what is malformed stays as it is."""
    language = data.get("language", FALLBACK)
    # An unknown language is refused later, and should cause no other errors here.
    table, filled = words(language if isinstance(language, str) else FALLBACK), dict(data)
    for part in _PARTS:
        own = data.get(part, {})
        if part in table and isinstance(own, dict):
            filled[part] = {**table[part], **own}
    if isinstance(data.get("form"), list):
        filled["form"] = [_question(table["form"], field) for field in data["form"]]
    return filled


def _question(known: Mapping[str, Any], field: Any) -> Any:
    """A question of the form; one that has a name and no label is the built-in one of that name."""
    if not isinstance(field, dict) or "label" in field or not isinstance(name := field.get("name"), str):
        return field
    return {**known.get(name, {}), **field}
