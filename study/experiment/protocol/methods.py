"""The part of a protocol that names methods of its own: `[[methods]]`, each a choice of points, length and make.

The keys of a method are its name, its parts, and the settings of these parts, which the registry of
`study.transitions.methods` knows: a new part brings its keys along. A `Method` goes out.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Self

from pydantic import Field, create_model, model_validator

from study.experiment.protocol.errors import KeyMismatchError, refuse_all
from study.experiment.protocol.settings import fields_of, member_of, values_in
from study.experiment.protocol.texts import Part, Slug
from study.transitions.methods.lengths.none import NoLength
from study.transitions.methods.method import Length, Make, Method, Points
from study.transitions.methods.registry import LENGTHS, MAKES, METHODS, POINTS


class _OwnMethod(Part):
    """A method of the protocol's own. Its settings come before those of the study and of `[stimuli]`."""

    name: Slug = Field(description="Name in studies, records and reports; not a built-in name.")
    make: str = Field(description=f"How the frames are made: {', '.join(f'`{name}`' for name in MAKES)}.")
    length: str | None = Field(
        default=None,
        description="Blend length: "
        f"{', '.join(f'`{name}`' for name, part in LENGTHS.items() if part.windows)}; omitted for a make without one.",
    )
    points: str = Field(
        default="shared",
        description="Transition points: `shared` uses those of `[points]`, the same for all methods; `least-cost` "
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
        parts = ", ".join(part.name for part in (points, length, make) if part is not NoLength)
        wanted = f"expected settings of its parts ({parts}), which are {', '.join(taken) or 'none'}"
        refuse_all(
            KeyMismatchError(f"{wanted}, found this key; remove it", key) for key in self.settings if key not in taken
        )
        return self

    @property
    def parts(self) -> tuple[type[Points], type[Length], type[Make]]:
        """The three parts."""
        return (
            member_of(self.points, POINTS, "points"),
            member_of(NoLength.name if self.length is None else self.length, LENGTHS, "length"),
            member_of(self.make, MAKES, "make"),
        )

    @property
    def settings(self) -> dict[str, Any]:
        """The settings that the protocol writes for it, by key."""
        return {key: value for key, value in values_in(self).items() if key not in _OwnMethod.model_fields}

    def method(self, defaults: Mapping[str, Any]) -> Method:
        """The method, with settings from elsewhere where it has none of its own."""
        points, length, make = self.parts
        chosen = Method(self.name, points(), length(), make(), self.utility, self.words, self.source)
        return chosen.with_settings({**defaults, **self.settings})


if TYPE_CHECKING:
    OwnMethod = _OwnMethod
else:
    # The keys of all parts, so that a new part needs no change here.
    OwnMethod = create_model(
        "OwnMethod",
        __base__=_OwnMethod,
        __doc__=_OwnMethod.__doc__,
        **fields_of(*POINTS.values(), *LENGTHS.values(), *MAKES.values(), defaults=False),
    )
