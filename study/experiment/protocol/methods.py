"""The part of a protocol that names methods of its own: `[[methods]]`, each a choice of points, length and make.

The keys of a method are its name, its parts, and the settings of these parts, which the registry of
`study.transitions.methods` knows: a new part brings its keys along. A `Method` goes out.
"""

from __future__ import annotations

from collections import abc
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields
from difflib import get_close_matches
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar, get_args, get_origin, get_type_hints

from pydantic import Field, create_model, model_validator

from study.experiment.protocol.errors import KeyMismatchError, short
from study.experiment.protocol.texts import LONGEST_NAME, MOST_PARTS, Part, Slug
from study.transitions.methods.lengths.none import NoLength
from study.transitions.methods.method import Length, Make, Method, MethodPart, Points
from study.transitions.methods.registry import LENGTHS, MAKES, METHODS, POINTS


class _OwnMethod(Part):
    """A method of the protocol's own. Its settings come before those of the study and of `[stimuli]`."""

    name: Slug = Field(description="What studies, records and reports call it; none of the built-in names.")
    make: str = Field(description=f"How the frames are made: {', '.join(f'`{name}`' for name in MAKES)}.")
    length: str | None = Field(
        default=None,
        description="How long the blend takes: "
        f"{', '.join(f'`{name}`' for name, part in LENGTHS.items() if part.windows)}; nothing for a make without one.",
    )
    points: str = Field(
        default="shared",
        description="Where it stands: `shared` takes the points that `[points]` gives to all methods; `least-cost` "
        "those where `metric` is least.",
    )
    utility: float = Field(
        default=0.0,
        ge=-10,
        le=10,
        description="How natural simulated observers find it: log-odds of being chosen over a blend of fixed length.",
    )
    words: str = Field(
        default="",
        description="What the report's Methods section calls its transitions, instead of words for its parts.",
    )
    source: str = Field(default="", description="The work that it comes from, as the report's references cite it.")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        """Refuse built-in names, unknown parts, parts that don't fit together, and keys that no part takes."""
        if self.name in METHODS:
            raise KeyMismatchError(f"expected a name of its own, found {self.name!r}, which is built in", "name")
        points, length, make = self.parts
        if length.windows != make.windows:
            fitting = [name for name, part in LENGTHS.items() if part.windows == make.windows and part.windows]
            wanted = " or ".join(map(repr, fitting)) if fitting else "no length"
            found = repr(self.length) if self.length else "none"
            raise KeyMismatchError(f"expected {wanted} with the make {make.name!r}, found {found}; change it", "length")
        taken = [*points.setting_names(), *length.setting_names(), *make.setting_names()]
        if strange := [key for key in self.settings if key not in taken]:
            parts = ", ".join(part.name for part in (points, length, make) if part is not NoLength)
            raise KeyMismatchError(
                f"expected settings of its parts ({parts}), which are {', '.join(taken) or 'none'}, found this key; "
                "remove it",
                strange[0],
            )
        return self

    @property
    def parts(self) -> tuple[type[Points], type[Length], type[Make]]:
        """The three parts."""
        return (
            _part(self.points, POINTS, "points"),
            _part(NoLength.name if self.length is None else self.length, LENGTHS, "length"),
            _part(self.make, MAKES, "make"),
        )

    @property
    def settings(self) -> dict[str, Any]:
        """The settings that the protocol writes for it, by key."""
        own = {key: getattr(self, key) for key in self.model_fields_set - set(_OwnMethod.model_fields)}
        return {key: _plain(value) for key, value in own.items() if value is not None}

    def method(self, defaults: Mapping[str, Any]) -> Method:
        """The method, with settings from elsewhere where it has none of its own."""
        points, length, make = self.parts
        chosen = Method(self.name, points(), length(), make(), self.utility, self.words, self.source)
        return chosen.with_settings({**defaults, **self.settings})


Member = TypeVar("Member", bound=MethodPart)


def _part(name: str, known: Mapping[str, type[Member]], key: str) -> type[Member]:
    """A part by name, or a refusal with the nearest one."""
    if name not in known:
        near = get_close_matches(name[:LONGEST_NAME], known, n=1)
        hint = f"did you mean {near[0]!r}?" if near else "choose one of these"
        raise KeyMismatchError(f"expected {' or '.join(map(repr, known))}, found {short(name)}; {hint}", key)
    return known[name]


def _settings_of(parts: Iterable[type[Any]]) -> dict[str, Any]:
    """Fields for pydantic out of the fields of dataclasses, none of them required where there is a default."""
    found: dict[str, Any] = {}
    for part in parts:
        hints = get_type_hints(part, include_extras=True)
        for one in fields(part):
            required = one.default is MISSING and one.default_factory is MISSING
            words = (
                Field(description=one.metadata["words"])
                if required
                else Field(default=None, description=one.metadata["words"])
            )
            found.setdefault(one.name, (_checked(hints[one.name], required), words))
    return found


def _checked(annotation: Any, required: bool) -> Any:
    """The type of a setting as pydantic checks it in TOML: lists for tuples, tables for dataclasses."""
    bounds: tuple[Any, ...] = ()
    if get_origin(annotation) is Annotated:
        annotation, *rest = get_args(annotation)
        bounds = tuple(rest)
    if get_origin(annotation) is tuple:
        bounds = (*bounds, Field(strict=False, max_length=MOST_PARTS))
    if get_origin(annotation) is abc.Mapping:
        annotation = dict[str, _table(get_args(annotation)[1])]  # type: ignore[misc]
    if not required:
        annotation = annotation | None
    return Annotated[(annotation, *bounds)] if bounds else annotation


_TABLES: dict[type[Part], type[Any]] = {}
"""The dataclass behind each table of a setting."""


def _table(described: type[Any]) -> type[Part]:
    """A part of the protocol for a dataclass."""
    made = create_model(described.__name__, __base__=Part, __doc__=described.__doc__, **_settings_of([described]))
    _TABLES[made] = described
    return made


def _plain(value: Any) -> Any:
    """A setting as the parts of methods take it."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    return _TABLES[type(value)](**dict(value)) if isinstance(value, Part) else value


if TYPE_CHECKING:
    OwnMethod = _OwnMethod
else:
    # The keys of all parts, so that a new part needs no change here.
    OwnMethod = create_model(
        "OwnMethod",
        __base__=_OwnMethod,
        __doc__=_OwnMethod.__doc__,
        **_settings_of((*POINTS.values(), *LENGTHS.values(), *MAKES.values())),
    )
