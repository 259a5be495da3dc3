"""What is wrong with a protocol, in words: pydantic's findings with the key path, the line and what to do.

A finding (`pydantic` error details) and the model come in; one sentence that says what was expected, what was found,
where and what to do goes out.
"""

from __future__ import annotations

import copy
import re
import types
import typing
from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, get_args, get_origin

from pydantic import BaseModel

from study.counting import counted
from study.toml_text import key_path, quoted

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

Location = Sequence[int | str]


class KeyMismatchError(ValueError):
    """What doesn't fit together in a protocol, and the key (a location within the part) where it shows.

    `others` are further problems of the same part, to be told together with it.
    """

    def __init__(self, message: str, *location: int | str) -> None:
        self.location = location
        self.others: tuple[KeyMismatchError, ...] = ()
        super().__init__(message)


def refuse_all(problems: Iterable[KeyMismatchError]) -> None:
    """Raise all problems of a part as one, so that they are told together; nothing where there is none."""
    if found := tuple(problems):
        found[0].others = found[1:]
        raise found[0] from None


def full_location(detail: Mapping[str, Any]) -> Location:
    """Where a finding is: pydantic's location, and within it the one that a `KeyMismatchError` names."""
    error = detail.get("ctx", {}).get("error")
    return (*detail["loc"], *(error.location if isinstance(error, KeyMismatchError) else ()))


def telling(model: type[BaseModel], details: Sequence[ErrorDetails]) -> list[ErrorDetails]:
    """The findings that are about the protocol itself, without those that only follow from another one.

    A list whose only part has a mistake is not empty; a misspelled key is not missing. A finding that stands for
    several problems of one part becomes as many findings.
    """
    details = [one for detail in details for one in _apart(detail)]
    faulty = [tuple(full_location(detail)) for detail in details]
    meant = set()
    for detail in details:
        if detail["type"] == "extra_forbidden" and (near := _near_key(model, detail["loc"])):
            meant.add((*detail["loc"][:-1], near))
    return [
        detail
        for detail in details
        if not (detail["type"] == "missing" and detail["loc"] in meant)
        and not (detail["type"] == "too_short" and any(_within(other, detail["loc"]) for other in faulty))
    ]


def respelled(model: type[BaseModel], data: Mapping[str, Any], found: Iterable[ErrorDetails]) -> dict[str, Any] | None:
    """The data of a protocol with unknown keys named as they were meant; None where anything else is wrong with it."""
    mended = copy.deepcopy(dict(data))
    for detail in found:
        near = _near_key(model, detail["loc"]) if detail["type"] == "extra_forbidden" else None
        table: Any = mended
        for part in detail["loc"][:-1]:
            table = table[part] if near and part in (table if isinstance(table, dict) else range(len(table))) else {}
        if near is None or near in table or detail["loc"][-1] not in table:
            return None
        table[near] = table.pop(detail["loc"][-1])
    return mended


def _apart(detail: ErrorDetails) -> list[ErrorDetails]:
    """A finding for each problem of a part."""
    error = detail.get("ctx", {}).get("error")
    others = error.others if isinstance(error, KeyMismatchError) else ()
    return [detail, *(typing.cast("ErrorDetails", {**detail, "ctx": {"error": other}}) for other in others)]


def _within(location: Location, part: Location) -> bool:
    return len(location) > len(part) and tuple(location[: len(part)]) == tuple(part)


_EXPECTED = {
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "string_type": "text in quotes",
    "bool_type": "true or false",
    "tuple_type": "a list in brackets",
    "model_type": "a table of keys",
    "dict_type": "a table of tables",
    "model_attributes_type": "a table of keys",
    "finite_number": "a finite number",
}
_BOUNDS = {
    "greater_than": ("gt", "above"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "below"),
    "less_than_equal": ("le", "at most"),
    "multiple_of": ("multiple_of", "a multiple of"),
}


def explain(model: type[BaseModel], detail: Mapping[str, Any]) -> str:
    """One finding as a sentence: key path, expected, found, what to do."""
    location = full_location(detail)
    if detail["type"] == "missing" and isinstance(location[-1], int):
        location = location[:-1]
    return f"{key_path(location) or 'the protocol'}: {finding(model, detail)}"


def finding(model: type[BaseModel], detail: Mapping[str, Any]) -> str:
    """One finding without its key path: expected, found, what to do."""
    location, kind, found = full_location(detail), detail["type"], detail.get("input")
    context = detail.get("ctx", {})
    if kind == "extra_forbidden":
        return _unknown_key(model, location)
    if kind == "missing" and isinstance(location[-1], int):
        return f"expected more than {counted(location[-1], 'entry', 'entries')}; add one."
    unit, words = _described(model, location)
    if kind == "missing":
        return f"expected this key, found none; add it.{words}"
    if kind == "value_error":
        return f"{str(context['error']).removesuffix('?')}{'?' if str(context['error']).endswith('?') else '.'}"
    if kind in _BOUNDS:
        bound, words = _BOUNDS[kind]
        return f"expected {words} {context[bound]:g}{unit}, found {short(found)}; change it."
    if kind == "literal_error":
        choice = _nearest_choice(context["expected"], found) or f"; choose one.{words}"
        return f"expected {context['expected']}, found {short(found)}{choice}"
    if kind in ("string_pattern_mismatch", "string_too_short", "string_too_long"):
        return f"expected {_text_rule(kind, context)}, found {short(found)}; change it."
    if kind in ("too_short", "too_long"):
        bound, words = ("min_length", "at least") if kind == "too_short" else ("max_length", "at most")
        entries = counted(context[bound], "entry", "entries")
        return f"expected {words} {entries}, found {context['actual_length']}; change it."
    do = "change it"
    if (
        kind == "model_type"
        and isinstance(found, str)
        and "name" in getattr(model_at(model, location), "model_fields", ())
    ):
        do = f"write {{ name = {quoted(found[:80])} }}"  # a name alone, as in form = ["age"]
    return f"expected {_EXPECTED.get(kind, detail['msg'])}{unit}, found {_shown(found)}; {do}."


def _shown(value: object) -> str:
    kinds = {
        bool: "true or false",
        int: "a whole number",
        float: "a number",
        str: "text",
        list: "a list",
        dict: "a table",
    }
    return f"{short(value)} ({kinds.get(type(value), type(value).__name__)})"


def short(value: object) -> str:
    """A value as messages give it: not more than its beginning."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


_PATTERNS = {
    "#": "a colour such as #20305a",
    "{2,3}": "a language such as en, de or pt-BR",
    "[a-z0-9]$": "one small letter or digit",
    "": "a name of small letters, digits, - and _",
}


def _text_rule(kind: str, context: Mapping[str, Any]) -> str:
    if kind == "string_too_short":
        return "some text"
    if kind == "string_too_long":
        return f"at most {counted(context['max_length'], 'letter')}"
    return next(words for sign, words in _PATTERNS.items() if sign in context["pattern"])


def _nearest_choice(expected: str, found: object) -> str:
    near = get_close_matches(str(found)[:80], re.findall(r"'([^']+)'", expected), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""


def _unknown_key(model: type[BaseModel], location: Location) -> str:
    parent = model_at(model, location[:-1])
    keys = list(parent.model_fields) if parent else []
    key = str(location[-1])
    elsewhere = [f"{p}.{key}" if p else key for p, part in parts(model) if key in part.model_fields]
    if elsewhere:
        hint = f"it belongs at {elsewhere[0]}."
    elif near := _near_key(model, location):
        hint = f"did you mean {near!r}?"
    else:
        hint = f"valid keys here: {', '.join(keys)}."
    return f"unknown key; {hint}"


def _near_key(model: type[BaseModel], location: Location) -> str:
    """The valid key that an unknown one is nearest to; empty where none is near."""
    parent = model_at(model, location[:-1])
    near = get_close_matches(str(location[-1])[:80], list(parent.model_fields) if parent else [], n=1)
    return near[0] if near else ""


NAMED = "NAME"
"""Stands in the path of a part for a name that the protocol chooses, as in `methods.files.NAME`."""


def _unwrap(annotation: Any) -> tuple[Any, bool]:
    """The part model within `Annotated`, `X | None`, `tuple[X, ...]` and `dict[str, X]`; anything else as it is.

    And whether it was in a dictionary, so that a name stands before its keys.
    """
    named = False
    while True:
        origin = get_origin(annotation)
        if origin is typing.Annotated or origin is tuple:
            annotation = get_args(annotation)[0]
        elif origin is dict:
            annotation, named = get_args(annotation)[1], True
        elif origin in (typing.Union, types.UnionType):
            annotation = next(a for a in get_args(annotation) if a is not type(None))
        else:
            return annotation, named


def model_at(model: type[BaseModel], location: Location) -> type[BaseModel] | None:
    """The model of the part at a location; None where there is none."""
    named = False
    for step in location:
        if isinstance(step, int):
            continue
        if named:
            named = False
            continue
        if step not in model.model_fields:
            return None
        inner, named = _unwrap(model.model_fields[step].annotation)
        if not (isinstance(inner, type) and issubclass(inner, BaseModel)):
            return None
        model = inner
    return model


def parts(model: type[BaseModel], path: str = "") -> Iterator[tuple[str, type[BaseModel]]]:
    """Every part of a protocol with its path, the protocol first."""
    yield path, model
    for name, field in model.model_fields.items():
        inner, named = _unwrap(field.annotation)
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            yield from parts(inner, ".".join(filter(None, (path, name, NAMED if named else ""))))


def unit_and_words(description: str) -> tuple[str, str]:
    """The unit that stands in brackets at the end of a key's description, and the words before it."""
    if found := re.search(r"\s*\[([a-z ]+)\]$", description):
        return found[1], description[: found.start()]
    return "", description


def _described(model: type[BaseModel], location: Location) -> tuple[str, str]:
    """The unit of the key at a location, and what it means, each with what leads to it in a sentence."""
    names = [step for step in location if isinstance(step, str)]
    parent = model_at(model, names[:-1]) if names else None
    field = parent.model_fields.get(names[-1]) if parent else None
    unit, words = unit_and_words((field.description or "") if field else "")
    return f" in {unit}" if unit else "", f" {words}".rstrip().replace("`", "'")


def line_of(lines: Mapping[tuple[int | str, ...], int], location: Location) -> int:
    """The line (from 1) at which the key of a location, or else its nearest parent, is; 0 where none is."""
    steps = tuple(location)
    while steps:
        if steps in lines:
            return lines[steps]
        steps = steps[:-1]
    return 0


def key_lines(text: str) -> Iterator[tuple[tuple[int | str, ...], int]]:
    """Each table header and key of a TOML text with its location and line; inline tables count as one key."""
    table: tuple[int | str, ...] = ()
    counts: dict[tuple[int | str, ...], int] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if header := re.match(r"\s*\[(\[?)([\w.\-\"' \t]+)\]", line):
            table = ()
            names = [name.strip(" \t\"'") for name in header[2].split(".")]
            for depth, name in enumerate(names):
                table = (*table, name)
                if header[1] and depth == len(names) - 1:
                    counts[table] = counts.get(table, -1) + 1
                if table in counts:
                    table = (*table, counts[table])
            yield table, number
        elif key := re.match(r"\s*([\w\-.\"']+)\s*=", line):
            yield (*table, *(name.strip("\"'") for name in key[1].split("."))), number
