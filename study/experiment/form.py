"""The form about the participant: a field's value as it was filled in comes in, as it is stored it goes out."""

from __future__ import annotations

import math

from study.errors import SessionError
from study.experiment.protocol.texts import FormField

LONGEST_TEXT = 1000
"""Characters of a text that a participant may write in the form."""


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
