"""The form about the participant: what was filled in comes in; what is stored, and what others may see, goes out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import groupby
from statistics import mean
from typing import TYPE_CHECKING

from study.errors import SessionError
from study.experiment.protocol.texts import FormField

if TYPE_CHECKING:
    from study.experiment.protocol.whole import Protocol

LONGEST_TEXT = 1000
"""Characters of a text that a participant may write in the form."""

WRITTEN = ("text", "free-text")
"""Kinds of questions that are answered in one's own words."""

FEWEST = 5
"""People that an answer needs to be shown to others."""


def field_value(field: FormField, value: str) -> str:
    """A field's value as it is stored, or a `SessionError` that says what the field takes."""
    if not value:
        if field.required:
            raise SessionError(f"Expected {field.name} to be filled in, found nothing.")
        return ""
    if field.kind == "choice" and value not in field.choices:
        raise SessionError(f"Expected one of {', '.join(field.choices)} as {field.name}, found {value!r}.")
    if field.kind == "number":
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if "_" in value:  # which Python takes within a number, and nobody else
            number = math.nan
        least = -math.inf if field.least is None else field.least
        most = math.inf if field.most is None else field.most
        if not (math.isfinite(number) and least <= number <= most):
            raise SessionError(f"Expected a number from {least:g} to {most:g} as {field.name}, found {value!r}.")
    if len(value) > LONGEST_TEXT:
        raise SessionError(f"Expected at most {LONGEST_TEXT} characters as {field.name}, found {len(value)}.")
    return value


def asked(protocol: Protocol) -> dict[str, FormField]:
    """Return every question of every form, by the name under which its answers are stored."""
    parts = [("", protocol.form), *((f"{study.name}.", study.form) for study in protocol.studies)]
    return {f"{prefix}{field.name}": field for prefix, fields in parts for field in fields}


def told_together(counts: Mapping[str, int]) -> set[str]:
    """Return the answers that are not told apart: those of fewer than `FEWEST`, and those that were not given ("").

    The next rarer one joins them where they are too few in all, so that no small count can be had by subtraction.
    """
    given = sorted((name for name in counts if counts[name]), key=lambda name: counts[name])
    together = {name for name in given if not name or counts[name] < FEWEST}
    rest = [name for name in given if name not in together]
    while together and rest and sum(counts[name] for name in together) < FEWEST:
        together.add(rest.pop(0))
    return together


def coarsened(fields: Mapping[str, FormField], given: Mapping[int, Mapping[str, str]]) -> dict[int, dict[str, str]]:
    """Return answers by which nobody is singled out: at least `FEWEST` people, or none, share each combination.

    Field after field, those who agree so far are told apart as far as each group keeps `FEWEST`. A number becomes the
    mean of its group (microaggregation; Domingo-Ferrer and Mateo-Sanz 2002), a rarer choice is withheld, as texts are.

    Parameters
    ----------
    fields, given
        Questions by name, those that matter most first; each person's answers by question.
    """
    found: dict[int, dict[str, str]] = {person: {} for person in given}
    cells = [list(given)]
    for name, field in fields.items():
        told = [group for cell in cells for group in _groups(field, {one: given[one].get(name, "") for one in cell})]
        cells = [people for _, people in told]
        for value, people in told:
            for person in people:
                found[person][name] = value
    return found


def _groups(field: FormField, values: Mapping[int, str]) -> list[tuple[str, list[int]]]:
    """Groups of people with the answer that stands for theirs."""
    if field.kind == "number":
        values = {**values, **_means({person: float(value) for person, value in values.items() if value})}
    named = {value: [one for one in values if values[one] == value] for value in dict.fromkeys(values.values())}
    together = told_together({value: len(people) for value, people in named.items()})
    if field.kind in WRITTEN:
        together = set(named)
    withheld = [person for value in named if value in together for person in named[value]]
    return [*((value, people) for value, people in named.items() if value not in together), ("", withheld)]


def _means(numbers: Mapping[int, float]) -> dict[int, str]:
    """Each person's number, replaced by the mean of `FEWEST` neighbours or more."""
    groups: list[list[int]] = [[]]
    for _, equal in groupby(sorted(numbers, key=lambda person: numbers[person]), key=lambda person: numbers[person]):
        if len(groups[-1]) >= FEWEST:
            groups.append([])
        groups[-1].extend(equal)
    if len(groups) > 1 and len(groups[-1]) < FEWEST:
        groups[-2].extend(groups.pop())
    return {one: f"{mean(numbers[one] for one in group):.6g}" for group in groups for one in group}
