"""The settings of parts and procedures as tables of a protocol: fields of dataclasses in, what checks a table out.

A setting that is declared with `study.settings` is checked, explained and documented as any other key of a protocol.
"""

from __future__ import annotations

from collections import abc
from collections.abc import Mapping
from dataclasses import MISSING, fields
from difflib import get_close_matches
from functools import cache
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

from pydantic import Field, ValidationError, create_model

from study.experiment.protocol.errors import KeyMismatchError, finding, full_location, refuse_all, short, telling
from study.experiment.protocol.texts import LONGEST_NAME, MOST_PARTS, Part
from study.settings import SettingsError

Member = TypeVar("Member")

_DESCRIBED: dict[type[Part], type[Any]] = {}
"""The dataclass behind each table."""


def member_of(name: object, known: Mapping[str, Member], key: str) -> Member:
    """A member of a registry by name, or a refusal with the nearest one."""
    if isinstance(name, str) and name in known:
        return known[name]
    near = get_close_matches(str(name)[:LONGEST_NAME], known, n=1)
    hint = f"did you mean {near[0]!r}?" if near else "choose one of these"
    raise KeyMismatchError(f"expected {' or '.join(map(repr, known))}, found {short(name)}; {hint}", key)


def settings_in(described: type[Member], table: Mapping[str, Any]) -> Member:
    """The settings that a table gives.

    Raises
    ------
    KeyMismatchError
        For every key that is unknown (with the nearest one), missing, or has a bad value.
    """
    model = table_of(described)  # type: ignore[arg-type]
    try:
        return described(**values_in(model.model_validate(table)))
    except ValidationError as error:
        refuse_all(
            KeyMismatchError(finding(model, detail).removesuffix("."), *full_location(detail))
            for detail in telling(model, error.errors())
        )
        raise
    except SettingsError as error:
        raise KeyMismatchError(str(error), error.key) from None


@cache
def table_of(described: type[Any]) -> type[Part]:
    """The part of a protocol whose keys are the fields of a dataclass."""
    keys = fields_of(described)
    made = create_model(described.__name__, __base__=Part, __doc__=described.__doc__, **keys)
    _DESCRIBED[made] = described
    return made


def values_in(table: Part) -> dict[str, Any]:
    """The settings that a table writes, as dataclasses take them."""
    return {key: _plain(getattr(table, key)) for key in table.model_fields_set}


def fields_of(*described: type[Any], defaults: bool = True) -> dict[str, Any]:
    """Fields for pydantic out of the fields of dataclasses; None stands for a default that is found elsewhere."""
    found: dict[str, Any] = {}
    for one in described:
        hints = get_type_hints(one, include_extras=True)
        for key in fields(one):
            required = key.default is MISSING and key.default_factory is MISSING
            default: Any = ... if required else key.default if defaults else None
            kind = _checked(hints[key.name], required or defaults)
            found.setdefault(key.name, (kind, Field(default=default, description=key.metadata["words"])))
    return found


def _checked(annotation: Any, given: bool) -> Any:
    """The type of a setting as pydantic checks it in TOML: lists for tuples, tables for dataclasses."""
    bounds: tuple[Any, ...] = ()
    if get_origin(annotation) is Annotated:
        annotation, *rest = get_args(annotation)
        bounds = tuple(rest)
    if get_origin(annotation) is tuple:
        bounds = (*bounds, Field(strict=False, max_length=MOST_PARTS))
    if get_origin(annotation) is abc.Mapping:
        annotation = dict[str, table_of(get_args(annotation)[1])]  # type: ignore[misc]
    if not given:
        annotation = annotation | None
    return Annotated[(annotation, *bounds)] if bounds else annotation


def _plain(value: Any) -> Any:
    """A value as dataclasses take it."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    return _DESCRIBED[type(value)](**values_in(value)) if isinstance(value, Part) else value
