"""Every procedure by name, and their settings as a protocol's table gives them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import MISSING, asdict, fields
from difflib import get_close_matches
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from annotated_types import Ge

from study.experiment.procedures.constant_stimuli import Constant
from study.experiment.procedures.procedure import Course, Settings, SettingsError
from study.experiment.procedures.staircase import Staircase
from study.tasks.trial import Pair

PROCEDURES: Mapping[str, type[Settings]] = {member.name: member for member in (Constant, Staircase)}

_WORDS = {int: "a whole number", float: "a number", str: "text in quotes", bool: "true or false"}


def settings_of(table: Mapping[str, Any]) -> Settings:
    """The settings that a table of a protocol, or a stored plan, describes.

    Raises
    ------
    SettingsError
        For a procedure or a key that there is not (with the nearest one), a key that is missing, and a bad value.
    """
    own = dict(table)
    name = own.pop("name", Constant.name)
    if name not in PROCEDURES:
        raise SettingsError("name", _expected_one_of(PROCEDURES, name))
    member = PROCEDURES[name]
    hints, known = get_type_hints(member, include_extras=True), {field.name: field for field in fields(member)}
    for key, value in own.items():
        if key not in known:
            near = get_close_matches(key[:80], known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"valid keys here: {', '.join(('name', *known))}"
            raise SettingsError(key, f"unknown key; {hint}")
        own[key] = _checked(key, value, hints[key])
    for key, field in known.items():
        if field.default is MISSING and key not in own:
            raise SettingsError(key, f"expected this key with {name!r}, found none; add it")
    return member(**own)


def course_to_json(course: Course) -> dict[str, Any]:
    """A course as plans store it."""
    return {**asdict(course), "settings": {"name": course.settings.name, **asdict(course.settings)}}


def course_from_json(data: Mapping[str, Any]) -> Course:
    """A course of a stored plan."""
    own = dict(data)
    pairs = tuple(
        Pair(**{**pair, "stimuli": tuple(pair["stimuli"]), "methods": tuple(pair["methods"])}) for pair in own["pairs"]
    )
    arrangements = tuple(tuple(members) for members in own["arrangements"])
    return Course(**{**own, "settings": settings_of(own["settings"]), "pairs": pairs, "arrangements": arrangements})


def _checked(key: str, value: Any, wanted: Any) -> Any:
    """A value of the type that a field has, and within its bounds."""
    if get_origin(wanted) is Annotated:
        kind, *bounds = get_args(wanted)
        checked, (least, most) = (
            _checked(key, value, kind),
            (bound.ge if isinstance(bound, Ge) else bound.le for bound in bounds),
        )
        if not least <= checked <= most:
            raise SettingsError(key, f"expected from {least} to {most}, found {value!r}; change it")
        return checked
    choices, inner = get_args(wanted), get_origin(wanted)
    if inner is tuple:
        if not isinstance(value, (list, tuple)):
            raise SettingsError(key, f"expected a list in brackets, found {value!r}; change it")
        return tuple(_checked(key, one, choices[0]) for one in value)
    if choices:
        if value not in choices:
            raise SettingsError(key, _expected_one_of(choices, value))
    elif type(value) is not wanted:
        raise SettingsError(key, f"expected {_WORDS[wanted]}, found {value!r}; change it")
    return value


def _expected_one_of(names: Iterable[str], found: object) -> str:
    near = get_close_matches(str(found)[:80], list(names), n=1)
    hint = f"did you mean {near[0]!r}?" if near else "choose one of these"
    return f"expected {' or '.join(map(repr, names))}, found {found!r}; {hint}"
