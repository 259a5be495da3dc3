"""The keys of a protocol as tables: what stands in `docs/protocol_keys.md`.

Run as `python -m study.experiment.protocol.keys` to print them; a test keeps the page and the code the same.
"""

from __future__ import annotations

import re
import types
import typing
from collections.abc import Iterator
from dataclasses import fields
from typing import Any, get_args, get_origin

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from study.experiment.procedures.registry import PROCEDURES
from study.experiment.protocol.errors import parts, unit_and_words
from study.experiment.protocol.settings import table_of
from study.experiment.protocol.whole import Protocol

_REPEATED = ("transitions", "studies", "studies.items", "methods", "form")
_WORDS = {int: "whole number", float: "number", str: "text", bool: "true or false"}


def key_tables() -> str:
    """Markdown tables of all keys: key, type with bounds and unit, default, meaning."""
    tables = [_table(_title(path), model) for path, model in parts(Protocol) if not path.endswith(".points")]
    own = [
        _table(f'`[studies.procedure]` with `name = "{name}"`', table_of(member))
        for name, member in PROCEDURES.items()
        if fields(member)
    ]
    return "\n\n".join([*tables, *own])


def _title(path: str) -> str:
    if not path:
        return "At the top of the file"
    return f"`[[{path}]]`" if path in _REPEATED else f"`[{path}]`"


def _table(title: str, model: type[BaseModel]) -> str:
    rows = [_row(name, field) for name, field in model.model_fields.items()]
    return "\n".join([f"## {title}", *_HEAD, *rows])


_HEAD = ("", "| key | type | default | meaning |", "|---|---|---|---|")


def _row(name: str, field: FieldInfo) -> str:
    unit, words = unit_and_words(field.description or "")
    return f"| `{name}` | {_type(field, unit)} | {_default(field)} | {words} |"


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    value = field.default
    if value is None or value in ((), ""):
        return "–"
    if isinstance(value, (str, tuple)):
        return f"`{value if isinstance(value, str) else list(value)}`"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value:g}`" if isinstance(value, (int, float)) else "its own"


def _type(field: FieldInfo, unit: str) -> str:
    bounds = ", ".join(_bounds(field.metadata))
    # A range reads as one.
    bounds = re.sub(r"^≥ ([0-9.]+), ≤ ([0-9.]+)$", r"\1–\2", bounds)
    return ", ".join(filter(None, (_annotation(field.annotation), f"{bounds} {unit}".strip())))


def _bounds(metadata: list[Any]) -> Iterator[str]:
    # 1 and 1.0 are one bound: `typing` keeps one of two annotations that are equal, whichever was made first.
    for bound in metadata:
        if isinstance(bound, annotated_types.Ge):
            yield f"≥ {bound.ge:.10g}"
        elif isinstance(bound, annotated_types.Gt):
            yield f"> {bound.gt:.10g}"
        elif isinstance(bound, annotated_types.Le):
            yield f"≤ {bound.le:.10g}"
        elif isinstance(bound, annotated_types.Lt):
            yield f"< {bound.lt:.10g}"


def _annotation(annotation: Any) -> str:
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is typing.Annotated:
        return _annotation(inner[0])
    if origin is typing.Literal:
        return ", ".join(f"`{choice}`" for choice in inner)
    if origin in (typing.Union, types.UnionType):
        return _annotation(next(part for part in inner if part is not type(None)))
    if origin is tuple:
        if inner[-1] is not Ellipsis:
            return "two numbers, 0 to 1"
        member = _annotation(inner[0])
        return f"list of {member}s" if member in ("text", "number", "whole number") else "tables"
    return _WORDS.get(annotation, "table")


if __name__ == "__main__":
    print(key_tables())
